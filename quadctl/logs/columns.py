"""Names of the columns of a flight log, in their order in the file (docs/log-format.md)."""

import re

STATE_COLUMNS = (
    "time_s",
    "x_m",
    "y_m",
    "z_m",
    "vx_m_s",
    "vy_m_s",
    "vz_m_s",
    "roll_deg",
    "pitch_deg",
    "yaw_deg",
    "roll_rate_rad_s",
    "pitch_rate_rad_s",
    "yaw_rate_rad_s",
)
COMMAND_COLUMNS = ("thrust_cmd_n", "throttle_cmd", "roll_cmd_deg", "pitch_cmd_deg", "yaw_cmd_deg")
LATERAL_THRUST = ("thrust_x_cmd_n", "thrust_y_cmd_n")
LATERAL_THROTTLE = ("throttle_x_cmd", "throttle_y_cmd")
LATERAL_COLUMNS = (*LATERAL_THRUST, *LATERAL_THROTTLE)
"""Lateral commands of a fully actuated flight, forward and right."""
REFERENCE_COLUMNS = ("x_ref_m", "y_ref_m", "z_ref_m", "vx_ref_m_s", "vy_ref_m_s", "vz_ref_m_s")
TORQUE = ("roll_torque_cmd", "pitch_torque_cmd", "yaw_torque_cmd")
"""Torque setpoint about the body axes, as the autopilot's mixer takes it."""
RESIDUAL_COLUMNS = (
    "residual_x_m_s2",
    "residual_y_m_s2",
    "residual_z_m_s2",
    "residual_north_m_s2",
    "residual_east_m_s2",
    "residual_up_m_s2",
)
"""Specific force beyond the model that flew, filtered: along the body, FRD, and in the world."""
HEIGHT_COLUMNS = ("baro_m", "baro_temperature_c", "range_m", "gps_vz_m_s")
"""Sensors of the height: barometer and its temperature, range finder along the body's axis down, climb rate of GPS."""
LOOP_COLUMNS = ("telemetry_age_s", "tick_late_s")
OPTIONAL_COLUMNS = (
    "ax_m_s2",
    "ay_m_s2",
    "az_m_s2",
    "imu_x_m_s2",
    "imu_y_m_s2",
    "imu_z_m_s2",
    "battery_v",
    *COMMAND_COLUMNS,
    *REFERENCE_COLUMNS,
    "thrust_ratio",
    "compensator_trust",
    *LOOP_COLUMNS,
    *LATERAL_COLUMNS,
    *RESIDUAL_COLUMNS,
    *HEIGHT_COLUMNS,
    *TORQUE,
)
PHASE_COLUMN = "phase"
MOTOR_QUANTITIES = ("rpm", "voltage_v", "current_a", "output")
"""Quantities of each motor, in their order in the file. `output` is the command to the motor, 0..1 of its range."""
_MOTOR_COLUMN = re.compile(rf"motor([1-9]\d*)_({'|'.join(MOTOR_QUANTITIES)})")


def rpm_columns(n_rotors: int) -> list[str]:
    return [f"motor{i + 1}_rpm" for i in range(n_rotors)]


def motor_columns(n_rotors: int, quantity: str) -> list[str]:
    """`quantity` is one of MOTOR_QUANTITIES."""
    return [f"motor{i + 1}_{quantity}" for i in range(n_rotors)]


def motor_of(name: str) -> int | None:
    """Number of the motor, from 1, that a column belongs to; None for a column of no motor."""
    found = _MOTOR_COLUMN.fullmatch(name)
    return int(found[1]) if found else None


def is_column(name: str) -> bool:
    """True for the name of a column of a flight log."""
    return (
        name in STATE_COLUMNS or name in OPTIONAL_COLUMNS or name == PHASE_COLUMN or bool(_MOTOR_COLUMN.fullmatch(name))
    )


def known_columns(n_rotors: int) -> list[str]:
    """All names that the header of a log may hold, in their order in the file."""
    motors = [name for quantity in MOTOR_QUANTITIES for name in motor_columns(n_rotors, quantity)]
    return [*STATE_COLUMNS, *motors, *OPTIONAL_COLUMNS, PHASE_COLUMN]


def column_order(name: str) -> tuple[int, int]:
    """Sorting key for the order in the file; names that are no column of a log go last."""
    if name in STATE_COLUMNS:
        return 0, STATE_COLUMNS.index(name)
    if motor := _MOTOR_COLUMN.fullmatch(name):
        return 1 + MOTOR_QUANTITIES.index(motor[2]), int(motor[1])
    return (8, OPTIONAL_COLUMNS.index(name)) if name in OPTIONAL_COLUMNS else (9, 0)
