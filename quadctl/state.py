"""State of the vehicle, setpoint and target: the types that autopilot, control and recorder pass to each other."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

Vec3 = tuple[float, float, float]
Quat = tuple[float, float, float, float]

NAN = float("nan")
NO_VECTOR: Vec3 = (NAN, NAN, NAN)


class StatusText(NamedTuple):
    """A text of the autopilot."""

    received_s: float
    severity: int
    """MAV_SEVERITY: 0 is an emergency, 7 a message for debugging."""
    text: str

    @property
    def grave(self) -> bool:
        """True for a warning, and for anything more severe."""
        return self.severity <= SEVERITIES.index("warning")

    def __str__(self) -> str:
        name = SEVERITIES[self.severity] if self.severity < len(SEVERITIES) else f"severity {self.severity}"
        return f"the autopilot says ({name}): {self.text}"


SEVERITIES = ("emergency", "alert", "critical", "error", "warning", "notice", "info", "debug")


@dataclass(frozen=True, slots=True)
class VehicleState:
    """One snapshot of the vehicle, NED/FRD, as the autopilot's telemetry last told it."""

    time_s: float
    """Clock of this process (monotonic) or of the simulation, when the snapshot was taken."""
    position_ned_m: Vec3 = NO_VECTOR
    velocity_ned_m_s: Vec3 = NO_VECTOR
    attitude: Quat = (NAN, NAN, NAN, NAN)
    rates_rad_s: Vec3 = NO_VECTOR
    rotor_rpm: tuple[float, ...] = ()
    motor_voltage_v: tuple[float, ...] = ()
    motor_current_a: tuple[float, ...] = ()
    motor_output: tuple[float, ...] = ()
    """Output of the autopilot to each motor, on the scale of the throttle target, 0..1."""
    battery_v: float = NAN
    battery_remaining: float = NAN
    """Share of the battery's charge that remains, 0..1, as the autopilot says."""
    battery_alarm: str = ""
    """Charge state that the autopilot gives its worst battery, if that is critical or worse."""
    armed: bool = False
    landed: bool = True
    mode: str = ""
    """Flight mode by the autopilot's own name, e.g. OFFBOARD, LAND, HOLD."""
    offboard_mode: str = "OFFBOARD"
    """The mode that follows our targets, by the autopilot's own name."""
    estimator_ok: bool = True
    """False when the autopilot's estimator says that attitude, velocity or position are not to be trusted."""
    ready_to_arm: bool = True
    """False when the autopilot says that its own checks do not pass, for example soon after boot."""
    tells_readiness: bool = True
    """False when it does not say if they pass, as PX4 in offboard mode, or ArduPilot whose checks are off; then
    `ready_to_arm` is a guess."""
    remote: bool | None = None
    """True when a remote control is received, False when none is; None where the autopilot does not tell."""
    checks_off: bool = False
    """True when its own checks before arming are switched off, so that it arms whatever is wrong."""
    failing: tuple[str, ...] = ()
    """Names of the parts that the autopilot uses and reports as not healthy."""
    refusals: tuple[str, ...] = ()
    """Reasons against arming in the autopilot's last report, for this mode and the one that follows our targets."""
    connected: bool = False
    """True when heartbeats arrive."""
    received_s: Mapping[str, float] = field(default_factory=dict)
    """Time at which each part was true, on the clock of `time_s`: position, attitude, rates, rpm, battery, heartbeat,
    mode.

    The time of arrival, earlier by the link's delay: a burst of queued messages is old, however new its arrival.
    """
    setpoint_delay_s: float = 0.0
    """Time that a setpoint needs to the autopilot, s; 0 where it is not known."""
    boots: int = 0
    """Number of restarts of the autopilot's clock since the link was opened."""
    estimator_ratio: float = NAN
    """Worst innovation test ratio of position and velocity; from 1 on the estimator rejects its own sensors."""
    horizontal_std_m: float = NAN
    """Standard deviation of the horizontal position, as the estimator states it; nan where it does not."""
    vertical_std_m: float = NAN
    """Standard deviation of the height, as the estimator states it; nan where it does not."""
    baro_m: float = NAN
    """Height by the barometer alone, above where it began, m; nan where it is not told."""
    range_m: float = NAN
    """Distance to the ground along the body's axis down, m; nan where no range finder tells it."""
    aid_lost: bool = False
    """True when the autopilot had a working source of position (GPS, motion capture) and has none any more."""
    texts: tuple[StatusText, ...] = ()
    """Latest texts of the autopilot, oldest first; the same object until another one comes."""

    def age_s(self, part: str) -> float:
        """Time since `part` was true; infinite when it never arrived."""
        return self.time_s - self.received_s.get(part, -math.inf)

    @property
    def silence_s(self) -> float:
        """Time since the autopilot was heard at all, s; infinite when it never was."""
        return self.time_s - max(self.received_s.values(), default=-math.inf)

    @property
    def control_age_s(self) -> float:
        """Age of the oldest part that control uses, s."""
        return max(self.age_s("position"), self.age_s("attitude"))

    @property
    def mode_age_s(self) -> float:
        """Time since the mode was told, by a message about it alone or by a heartbeat, s."""
        return min(self.age_s("mode"), self.age_s("heartbeat"))

    @property
    def why_not_ready(self) -> tuple[str, ...]:
        """Reasons against arming beside the texts: those of its report, the parts that fail, and an empty battery."""
        failing = (f"failing: {', '.join(self.failing)}",) if self.failing else ()
        empty = () if self.why_battery_empty is None else (self.why_battery_empty,)
        return (*self.refusals, *failing, *empty)

    @property
    def why_battery_empty(self) -> str | None:
        """Reason why the battery must not be flown, by the autopilot's own word, or None."""
        left = f"{100.0 * self.battery_remaining:.0f} % of the battery is left"
        if self.battery_alarm:
            known = "" if math.isnan(self.battery_remaining) else f" ({left})"
            return f"the autopilot calls the battery {self.battery_alarm}{known}"
        return left if self.battery_remaining <= 0.0 else None

    @property
    def offboard(self) -> bool:
        """True when the autopilot is in the mode that follows our targets."""
        return self.mode == self.offboard_mode

    @property
    def finite(self) -> bool:
        """True when every value that control uses is finite."""
        return all(map(math.isfinite, (*self.position_ned_m, *self.velocity_ned_m_s, *self.attitude)))


class Motion(NamedTuple):
    """Position and velocity at one instant, NED."""

    position_ned_m: Vec3
    velocity_ned_m_s: Vec3


@dataclass(frozen=True, slots=True)
class Setpoint:
    """Setpoint at one instant, NED. An axis whose position is nan is flown by velocity alone."""

    position_ned_m: Vec3
    velocity_ned_m_s: Vec3 = (0.0, 0.0, 0.0)
    acceleration_ned_m_s2: Vec3 = (0.0, 0.0, 0.0)
    yaw_rad: float = 0.0


class AttitudeTarget(NamedTuple):
    """Target for the autopilot: attitude (body to world) and throttle 0..1."""

    attitude: Quat
    throttle: float
    lateral: tuple[float, float] | None = None
    """Lateral throttle forward and right, -1..1: the average change of the outputs of the rotors that take part
    (`Allocation.lateral_mix`); None: the target leaves lateral force to the attitude."""
