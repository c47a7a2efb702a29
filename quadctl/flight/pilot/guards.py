"""Guards: conditions for going on to command. Pure functions of the state; the first breach decides.

Each breach has one answer. LAND: the autopilot's land mode, from our last good state. HAND_OVER: our setpoints stop at
once and the autopilot is asked to land by its own means; where even that does not arrive, the silence triggers its own
failsafe. RELEASE: somebody else flies now; we stop and keep recording.
"""

import enum
import math
from typing import NamedTuple

from pydantic import Field

from quadctl.flight.pilot.continuity import ContinuityLimits
from quadctl.flight.pilot.following import FollowingLimits
from quadctl.flight.pilot.model_guard import ModelErrorLimits
from quadctl.flight.pilot.reasons import Kind, Reason, reason
from quadctl.frames import tilt
from quadctl.missions import MissionLimits
from quadctl.settings import Settings
from quadctl.state import AttitudeTarget, VehicleState

READY_TIMEOUT_S, BOOT_TIMEOUT_S = 15.0, 60.0
"""Longest wait for a state that a flight may use, and for an autopilot that reports that it is not ready, as it does
for some time after boot."""


class Answer(enum.Enum):
    LAND = "land"
    HAND_OVER = "hand over"
    RELEASE = "release"


class Guard(enum.StrEnum):
    """Guards with a limit of their own, as the log's events and the live view name them."""

    LINK = "link age"
    TICK_LATE = "tick lateness"
    STATE_AGE = "state age"
    ESTIMATOR = "estimator ratio"
    HORIZONTAL_STD = "stated accuracy"
    VERTICAL_STD = "stated accuracy, height"
    MODEL = "model error"
    TILT = "tilt"
    SPEED = "speed"
    HEIGHT = "height"
    FLOOR = "lowest height"
    DISTANCE = "distance"
    TIME = "mission time"
    BATTERY = "battery"


class Defect(NamedTuple):
    """Defect of a state, with the guard whose limit it is beyond; None: it has none."""

    reason: Reason
    guard: Guard | None = None


class Breach(NamedTuple):
    answer: Answer
    reason: Reason
    guard: Guard | None = None


class GuardLimits(Settings):
    """Limits of the guards, in YAML under `guards`."""

    max_state_age_s: float = Field(default=0.2, gt=0.0, le=1.0)
    """Largest age of position and attitude when a setpoint made from them reaches the autopilot."""
    max_tilt_deg: float = Field(default=50.0, gt=0.0, lt=90.0)
    max_speed_m_s: float = Field(default=8.0, gt=0.0, le=50.0)
    max_tick_late_s: float = Field(default=0.2, gt=0.0, le=1.0)
    """Largest lateness of a tick: a loop that wakes up later has been stalled, and hands over instead of going on."""
    min_battery_v: float = Field(default=0.0, ge=0.0)
    """Voltage below which the flight lands; 0: not guarded."""
    max_estimator_ratio: float = Field(default=1.0, ge=0.0)
    """Largest ratio of innovation to gate, if known: above 1 the autopilot rejects measurements. 0: not guarded."""
    max_horizontal_std_m: float = Field(default=0.5, ge=0.0)
    """Largest standard deviation of the horizontal position that the estimator may state, if it does. 0: not guarded.

    PX4's estimate with GPS was measured at 0.28 to 0.30 m, and at 0.56 m two seconds after the GPS was lost.
    """
    max_vertical_std_m: float = Field(default=1.0, ge=0.0)
    """Largest standard deviation of the height that the estimator may state, if it does. 0: not guarded.

    Measured were 0.03 to 0.26 m with GPS or motion capture, and 0.51 m in a healthy flight by the barometer alone.
    """
    max_over_time_s: float = Field(default=60.0, gt=0.0, le=600.0)
    """Longest time by which a flight may exceed its mission, by a slow take-off, and longest landing."""
    continuity: ContinuityLimits = ContinuityLimits()
    following: FollowingLimits = FollowingLimits()
    model_error: ModelErrorLimits = ModelErrorLimits()


UNIT_TOLERANCE = 0.01
"""Tolerance of the norm of an attitude quaternion; one of zeros is finite, but no attitude."""


def floor(mission: MissionLimits) -> float:
    """Height below which a flight lands, m; negative where the mission goes close to the ground."""
    return mission.min_z_m - mission.margin_m


def defect(state: VehicleState, limits: GuardLimits) -> Defect | None:
    """Defect because of which control must not use this state, or None."""
    if not state.connected:
        return Defect(Reason(Kind.HEARTBEAT_LOST), Guard.LINK)
    for part in ("position", "attitude"):
        age_s, delay_s, allowed_s = state.age_s(part), state.setpoint_delay_s, limits.max_state_age_s
        if age_s == math.inf:
            return Defect(reason(Kind.NEVER_CAME, part=part), Guard.STATE_AGE)
        if age_s > allowed_s:
            return Defect(reason(Kind.STALE, part=part, age_s=age_s, most_s=allowed_s), Guard.STATE_AGE)
        if age_s + delay_s > allowed_s:
            late = reason(Kind.SLOW_LINK, part=part, age_s=age_s + delay_s, most_s=allowed_s)
            return Defect(late, Guard.STATE_AGE)
    if not state.finite:
        return Defect(Reason(Kind.STATE_NOT_FINITE))
    if abs(math.hypot(*state.attitude) - 1.0) > UNIT_TOLERANCE:
        return Defect(reason(Kind.NO_ATTITUDE, norm=math.hypot(*state.attitude)))
    if not state.estimator_ok:
        return Defect(Reason(Kind.DISTRUSTED))
    if 0.0 < limits.max_estimator_ratio < state.estimator_ratio:
        ratio, largest = state.estimator_ratio, limits.max_estimator_ratio
        return Defect(reason(Kind.IN_DOUBT, ratio=ratio, most=largest), Guard.ESTIMATOR)
    return _unaided(state, limits)


def _unaided(state: VehicleState, limits: GuardLimits) -> Defect | None:
    """Defect of a position that is not measured any more, though the estimate goes on, or None."""
    if state.aid_lost:
        return Defect(Reason(Kind.AID_LOST))
    for guard, part, std_m, largest_m in (
        (Guard.HORIZONTAL_STD, "horizontal position", state.horizontal_std_m, limits.max_horizontal_std_m),
        (Guard.VERTICAL_STD, "height", state.vertical_std_m, limits.max_vertical_std_m),
    ):
        if 0.0 < largest_m < std_m:
            return Defect(reason(Kind.UNCERTAIN, part=part, std_m=std_m, most_m=largest_m), guard)
    return None


def unfit(target: AttitudeTarget, limits: GuardLimits, max_throttle: float) -> Reason | None:
    """Reason why this target must not reach the motors, whatever its origin, or None."""
    if not all(map(math.isfinite, (*target.attitude, target.throttle, *(target.lateral or ())))):
        return Reason(Kind.TARGET_NOT_FINITE)
    if not 0.0 <= target.throttle <= max_throttle:
        return reason(Kind.TARGET_THROTTLE, throttle=target.throttle, most=max_throttle)
    if abs(math.hypot(*target.attitude) - 1.0) > UNIT_TOLERANCE:
        return reason(Kind.TARGET_NO_ATTITUDE, norm=math.hypot(*target.attitude))
    if target.lateral is not None and max(map(abs, target.lateral)) > max_throttle:
        return reason(Kind.TARGET_LATERAL, lateral=target.lateral, most=max_throttle)
    tilt_deg = math.degrees(tilt(target.attitude))
    if tilt_deg > limits.max_tilt_deg:
        return reason(Kind.TARGET_TILT, tilt_deg=tilt_deg, most_deg=limits.max_tilt_deg)
    return None


def inspect(
    state: VehicleState,
    in_air_s: float,
    mission_s: float,
    height_m: float,
    distance_m: float,
    limits: GuardLimits,
    mission: MissionLimits,
    above_floor: bool = True,
) -> Breach | None:
    """First breach of a limit, or None.

    `in_air_s` is the time since the take-off began, `mission_s` how long the mission lasts, `height_m` the vehicle's
    height above the ground and `distance_m` its horizontal distance from the take-off point. `above_floor`: it has left
    the ground and been above the floor, so that it is not on its way up to it.
    """
    # First who flies: what else is wrong is no longer our business, least of all to take the mode back for it.
    if not state.armed:
        return Breach(Answer.RELEASE, Reason(Kind.DISARMED))
    if not state.offboard:
        return Breach(Answer.RELEASE, reason(Kind.LEFT_OFFBOARD, mode=state.mode))
    problem = defect(state, limits)
    if problem is not None:
        return Breach(Answer.HAND_OVER, *problem)
    tilt_deg = math.degrees(tilt(state.attitude))
    if tilt_deg > limits.max_tilt_deg:
        tilted = reason(Kind.TILT, tilt_deg=tilt_deg, most_deg=limits.max_tilt_deg)
        return Breach(Answer.HAND_OVER, tilted, Guard.TILT)
    speed = math.hypot(*state.velocity_ned_m_s)
    if speed > limits.max_speed_m_s:
        fast = reason(Kind.SPEED, speed_m_s=speed, most_m_s=limits.max_speed_m_s)
        return Breach(Answer.LAND, fast, Guard.SPEED)
    ceiling_m = mission.max_z_m + mission.margin_m
    if height_m > ceiling_m:
        return Breach(Answer.LAND, reason(Kind.HEIGHT, height_m=height_m, most_m=ceiling_m), Guard.HEIGHT)
    floor_m = floor(mission)
    if above_floor and height_m < floor_m:
        return Breach(Answer.LAND, reason(Kind.FLOOR, height_m=height_m, least_m=floor_m), Guard.FLOOR)
    fence_m = mission.max_distance_m + mission.margin_m
    if distance_m > fence_m:
        return Breach(Answer.LAND, reason(Kind.DISTANCE, distance_m=distance_m, most_m=fence_m), Guard.DISTANCE)
    if in_air_s > mission_s + limits.max_over_time_s:
        return Breach(Answer.LAND, reason(Kind.TIME, in_air_s=in_air_s, mission_s=mission_s), Guard.TIME)
    if limits.min_battery_v > 0.0 and not state.battery_v >= limits.min_battery_v:  # an unknown voltage is a breach
        empty = reason(Kind.BATTERY, battery_v=state.battery_v, least_v=limits.min_battery_v)
        return Breach(Answer.LAND, empty, Guard.BATTERY)
    return None


def patience_s(state: VehicleState) -> float:
    """Longest wait for a better state than this one, s."""
    return READY_TIMEOUT_S if state.ready_to_arm and state.estimator_ok else BOOT_TIMEOUT_S
