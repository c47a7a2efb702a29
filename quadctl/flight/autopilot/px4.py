"""PX4 on the MAVLink wire: offboard mode follows targets, which also lift the vehicle off."""

from quadctl.flight.autopilot import mavlink
from quadctl.flight.autopilot.firmware import (
    Check,
    Firmware,
    Requirement,
    Stream,
    above_ceiling,
    hover_throttle_check,
    rotor_count_check,
)
from quadctl.thrust_chain.px4 import CHAIN
from quadctl.words import When

MAX_SILENCE_S = 1.0
"""Longest time without setpoints after which the autopilot should act."""
LOST_OFFBOARD = {
    0: "it goes to Position, where a pilot has to fly",
    1: "it goes to Altitude, where a pilot has to fly",
    2: "it goes to Stabilized, where a pilot has to fly",
    3: "it goes to Return",
    4: "it goes to Land",
    5: "it goes to Hold",
    6: "it goes to Terminate",
    7: "it goes to Disarm",
}
"""COM_OBL_RC_ACT: the mode that it enters when setpoints stop in offboard. Without a remote control PX4 returns instead
of a mode that a pilot flies: RTL was measured 1.0 s after the last setpoint."""
UNAIDED_US = 1e6
"""Longest time, us, for which the estimator should trust itself without GPS or motion capture: after 1 s the vehicle
was measured 0.28 m off, after the default of 5 s 1.1 and 2.3 m."""
LAND = 4
LANDING = (3, LAND)
"""Modes of COM_OBL_RC_ACT that bring the vehicle down in control by themselves."""

LOST_REMOTE = {0: "it goes to Hold, and stays", 1: "it goes to Hold", 2: "it goes to Return", 3: "it goes to Land",
               5: "its motors stop", 6: "its motors stop"}  # fmt: skip
"""NAV_RCL_ACT: the action when the remote control is lost."""
LANDING_WITHOUT_REMOTE = (2, 3)
EXCEPT_OFFBOARD = 4
"""Bit of COM_RCL_EXCEPT: offboard goes on without a remote control."""
NO_REMOTE = 4
"""COM_RC_IN_MODE: sticks are not read."""
STICKS_END_OFFBOARD = 2
"""Bit of COM_RC_OVERRIDE."""
LOW_BATTERY = {0: "it only says so", 1: "it returns", 2: "it lands", 3: "it returns, and lands in an emergency"}
"""COM_LOW_BAT_ACT."""

_MAIN_AND_SUB_MODE = {
    "MANUAL": (1, 0),
    "ALTCTL": (2, 0),
    "POSCTL": (3, 0),
    "ORBIT": (3, 1),
    "POSITION_SLOW": (3, 2),
    "READY": (4, 1),
    "TAKEOFF": (4, 2),
    "HOLD": (4, 3),
    "MISSION": (4, 4),
    "RTL": (4, 5),
    "LAND": (4, 6),
    "FOLLOW": (4, 8),
    "PRECLAND": (4, 9),
    "VTOL_TAKEOFF": (4, 10),
    **{f"EXTERNAL{number}": (4, 10 + number) for number in range(1, 9)},
    "ACRO": (5, 0),
    "OFFBOARD": (6, 0),
    "STABILIZED": (7, 0),
    "RATTITUDE": (8, 0),
    "TERMINATION": (10, 0),
    "ALTITUDE_CRUISE": (11, 0),
}


def _main_and_sub(custom_mode: int) -> tuple[int, int]:
    return custom_mode >> 16 & 0xFF, custom_mode >> 24 & 0xFF


PX4 = Firmware(
    name="PX4",
    mav_autopilot=12,
    modes={name: main << 16 | sub << 24 for name, (main, sub) in _MAIN_AND_SUB_MODE.items()},
    unknown_mode=lambda custom_mode: "{}/{}".format(*_main_and_sub(custom_mode)),
    set_mode_parameters=_main_and_sub,
    offboard_mode="OFFBOARD",
    land_mode="LAND",
    hold_mode="HOLD",
    takes_off_itself=False,
    stays_up=False,
    streams=(
        Stream("LOCAL_POSITION_NED", 32, 100.0, required=True),
        Stream("ATTITUDE_QUATERNION", 31, 100.0, required=True),
        Stream("ESC_STATUS", 291, 50.0, alternative=True),
        Stream("RAW_RPM", 339, 50.0, alternative=True),
        Stream("ACTUATOR_OUTPUT_STATUS", 375, 50.0, alternative=True),
        Stream("SYS_STATUS", 1, 5.0),
        Stream("BATTERY_STATUS", 147, 1.0, alternative=True),
        Stream("EXTENDED_SYS_STATE", 245, 5.0),
        Stream("ESTIMATOR_STATUS", 230, 5.0),
        # Heartbeats tell the mode too, but come at 1 Hz, and PX4 refuses another interval. Newer ones send this every
        # 0.51 s whatever is asked for, and within 60 ms of a change.
        Stream("CURRENT_MODE", 436, 20.0, without="A change of mode is seen after up to a second, a short one never."),
    ),
    # The bit is about the present mode, and offboard is not ready before setpoints arrive.
    tells_readiness=lambda mode: mode != "OFFBOARD",
    lists_prearm=False,
    heartbeat_type=mavlink.STATION,
    disarming_text="Disarmed by ",
    tells_aids=False,
    thrust_chain=CHAIN,
    requirements=lambda own_system_id: (
        Requirement(
            "COM_OBL_RC_ACT",
            lambda value: value if round(value) in LANDING else float(LAND),
            "when quadctl dies, nobody would land the vehicle",
            failsafe=True,
            finding="when setpoints stop {meaning} ({value:g})",
            meaning=LOST_OFFBOARD,
        ),
        Requirement(
            "EKF2_NOAID_TOUT",
            lambda value: min(value, UNAIDED_US),
            "the time in microseconds for which PX4 flies on by dead reckoning when GPS or motion capture is lost",
            advice=True,
            finding="without GPS or motion capture the estimator trusts itself for {meaning:g} s",
            meaning=lambda us: 1e-6 * us,
        ),
    ),
    checks=(
        Check(
            "COM_OF_LOSS_T",
            "acts {value:g} s after the last setpoint",
            lambda seconds, vehicle: seconds > MAX_SILENCE_S,
            f"expected at most {MAX_SILENCE_S:g} s",
        ),
        Check(
            "COM_RC_IN_MODE",
            "sticks are {meaning} ({value:g})",
            lambda value, vehicle: round(value) == NO_REMOTE,
            "nobody can take the vehicle with a remote control; expected 0",
            lambda value: "not read" if round(value) == NO_REMOTE else "read",
        ),
        Check(
            "COM_RC_OVERRIDE",
            "moving the sticks {meaning} offboard ({value:g})",
            lambda value, vehicle: not int(value) & STICKS_END_OFFBOARD,
            "only the mode switch does; expected 3",
            lambda value: "ends" if int(value) & STICKS_END_OFFBOARD else "does not end",
        ),
        Check(
            "NAV_RCL_ACT",
            "when the remote control is lost {meaning} ({value:g})",
            lambda value, vehicle: round(value) not in LANDING_WITHOUT_REMOTE,
            "expected 3 (Land)",
            LOST_REMOTE,
        ),
        Check(
            "COM_RCL_EXCEPT",
            "offboard {meaning} without a remote control ({value:g})",
            lambda value, vehicle: bool(int(value) & EXCEPT_OFFBOARD),
            "then nobody can take the vehicle; expected 0",
            lambda value: "flies on" if int(value) & EXCEPT_OFFBOARD else "does not fly on",
        ),
        Check(
            "COM_LOW_BAT_ACT",
            "with a low battery {meaning} ({value:g})",
            lambda value, vehicle: not value or round(value) not in LOW_BATTERY,
            "expected 2 (Land)",
            LOW_BATTERY,
        ),
        Check(
            "RTL_RETURN_ALT",
            "a return climbs to up to {value:g} m first",
            above_ceiling(1.0),
            "there is a ceiling at {vehicle.ceiling_m:g} m; expected failsafes that land",
        ),
        hover_throttle_check("MPC_THR_HOVER"),
        rotor_count_check("CA_ROTOR_COUNT", lambda value: round(value) or None),
        Check(
            "MC_BAT_SCALE_EN",
            When("value", "thrust grows as the battery empties", "thrust does not change with the battery"),
            lambda value, vehicle: bool(value),
            "expected 0: the thrust that is flown is not the one that is commanded",
        ),
    ),
    serial_parameters=("MAV_1_CONFIG", "SER_TEL2_BAUD"),
    rotor_axis_parameters=lambda rotor: (f"CA_ROTOR{rotor}_AX", f"CA_ROTOR{rotor}_AY", f"CA_ROTOR{rotor}_AZ"),
    throttle_bent_by="THR_MDL_FAC",
    attitude_parameters=(
        *(f"MC_{axis}_P" for axis in ("ROLL", "PITCH")),
        *(f"MC_{axis}RATE_{term}" for axis in ("ROLL", "PITCH") for term in ("P", "I", "D", "FF", "K", "MAX")),
        # The reference model of the attitude since May 2026 (PX4 27255).
        "MC_REF_W_N",
        "MC_REF_FF",
        "IMU_GYRO_CUTOFF",
        "IMU_DGYRO_CUTOFF",
    ),
    rate_limits=("MC_ROLLRATE_MAX", "MC_PITCHRATE_MAX"),
)
