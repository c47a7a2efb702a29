"""Guards: every limit exactly at its edge and just beyond it, and which answer goes first."""

import math
from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from quadctl.errors import SettingsError
from quadctl.flight.pilot.guards import Answer, Breach, GuardLimits, defect, inspect, unfit
from quadctl.flight.pilot.reasons import Kind, Reason, reason
from quadctl.frames import quaternion_from_euler
from quadctl.missions import MissionLimits
from quadctl.settings import validate
from quadctl.state import AttitudeTarget, VehicleState

LIMITS = GuardLimits(max_state_age_s=0.2, max_tilt_deg=50.0, max_speed_m_s=8.0, min_battery_v=14.0, max_over_time_s=5.0)
MISSION = MissionLimits(max_z_m=1.0, max_distance_m=5.0, margin_m=0.5)
NAN = math.nan

GOOD = VehicleState(
    time_s=100.0,
    position_ned_m=(0.0, 0.0, -0.5),
    velocity_ned_m_s=(0.0, 0.0, 0.0),
    attitude=(1.0, 0.0, 0.0, 0.0),
    battery_v=15.0,
    armed=True,
    landed=False,
    mode="OFFBOARD",
    connected=True,
    received_s={"position": 100.0, "attitude": 100.0},
)


def verdict(state: VehicleState, **where: float) -> Breach | None:
    place: dict[str, Any] = {"in_air_s": 10.0, "mission_s": 60.0, "height_m": 0.5, "distance_m": 0.0, **where}
    return inspect(state, limits=LIMITS, mission=MISSION, **place)


def tilted(roll_deg: float, pitch_deg: float = 0.0) -> VehicleState:
    return replace(GOOD, attitude=quaternion_from_euler(math.radians(roll_deg), math.radians(pitch_deg), 1.0))


def aged(part: str, age_s: float) -> VehicleState:
    return replace(GOOD, time_s=0.0, received_s={"position": 0.0, "attitude": 0.0, part: -age_s})


def test_a_good_state_is_let_through() -> None:
    assert verdict(GOOD) is None


def near(value: float) -> Any:
    return pytest.approx(value, abs=0.006)


def stale(part: str, age_s: float) -> Reason:
    return reason(Kind.STALE, part=part, age_s=near(age_s), most_s=0.2)


def low_battery(volts: float) -> Reason:
    return reason(Kind.BATTERY, battery_v=volts, least_v=14.0)


def leaning(deg: float) -> Reason:
    return reason(Kind.TILT, tilt_deg=near(deg), most_deg=50.0)


INSIDE: dict[str, tuple[VehicleState, dict[str, float]]] = {
    "position 0.2 s old": (aged("position", 0.2), {}),
    "attitude 0.2 s old": (aged("attitude", 0.2), {}),
    "0.2 s old when a setpoint arrives": (replace(aged("position", 0.125), setpoint_delay_s=0.075), {}),
    "roll 49.99 deg": (tilted(49.99), {}),
    "pitch -49.99 deg": (tilted(0.0, -49.99), {}),
    "speed 8 m/s": (replace(GOOD, velocity_ned_m_s=(0.0, 0.0, 8.0)), {}),
    "battery 14 V": (replace(GOOD, battery_v=14.0), {}),
    "height 1.5 m": (GOOD, {"height_m": 1.5}),
    "under the ground by less than the margin": (GOOD, {"height_m": -0.44}),
    "on its way up to the floor": (GOOD, {"height_m": -1.0, "above_floor": False}),
    "distance 5.5 m": (GOOD, {"distance_m": 5.5}),
    "estimator at its gate": (replace(GOOD, estimator_ratio=1.0), {}),
    "estimator unknown": (replace(GOOD, estimator_ratio=NAN), {}),
    "accuracy at its limits": (replace(GOOD, horizontal_std_m=0.5, vertical_std_m=0.5), {}),
    "accuracy unknown": (replace(GOOD, horizontal_std_m=NAN, vertical_std_m=NAN), {}),
    "5 s over time": (GOOD, {"in_air_s": 65.0}),
    "rates unknown": (replace(GOOD, rates_rad_s=(NAN, NAN, NAN)), {}),
    "rotors unknown": (replace(GOOD, rotor_rpm=(NAN,) * 4), {}),
    "quaternion rounded by float32": (replace(GOOD, attitude=(1.00001, 0.0, 0.0, 0.0)), {}),
    "quaternion of the other sign": (replace(GOOD, attitude=(-1.0, 0.0, 0.0, 0.0)), {}),
}
BEYOND: dict[str, tuple[VehicleState, dict[str, float], Answer, Reason]] = {
    "disarmed": (replace(GOOD, armed=False), {}, Answer.RELEASE, reason(Kind.DISARMED)),
    "mode taken": (replace(GOOD, mode="POSCTL"), {}, Answer.RELEASE, reason(Kind.LEFT_OFFBOARD, mode="POSCTL")),
    "mode unknown": (replace(GOOD, mode=""), {}, Answer.RELEASE, reason(Kind.LEFT_OFFBOARD, mode="")),
    "heartbeat lost": (replace(GOOD, connected=False), {}, Answer.HAND_OVER, reason(Kind.HEARTBEAT_LOST)),
    "old position": (aged("position", 0.201), {}, Answer.HAND_OVER, stale("position", 0.201)),
    "old attitude": (aged("attitude", 0.5), {}, Answer.HAND_OVER, stale("attitude", 0.5)),
    "slow setpoints": (
        replace(aged("position", 0.11), setpoint_delay_s=0.1),
        {},
        Answer.HAND_OVER,
        reason(Kind.SLOW_LINK, part="position", age_s=near(0.21), most_s=0.2),
    ),
    "no position": (
        replace(GOOD, received_s={"attitude": 100.0}),
        {},
        Answer.HAND_OVER,
        reason(Kind.NEVER_CAME, part="position"),
    ),
    "roll 50.1 deg": (tilted(50.1), {}, Answer.HAND_OVER, leaning(50.1)),
    "roll and pitch": (tilted(40.0, 40.0), {}, Answer.HAND_OVER, leaning(54.07)),
    "upside down": (tilted(180.0), {}, Answer.HAND_OVER, leaning(180.0)),
    "speed": (
        replace(GOOD, velocity_ned_m_s=(4.7, -4.7, 4.7)),
        {},
        Answer.LAND,
        reason(Kind.SPEED, speed_m_s=near(8.14), most_m_s=8.0),
    ),
    "height": (GOOD, {"height_m": 1.51}, Answer.LAND, reason(Kind.HEIGHT, height_m=1.51, most_m=near(1.5))),
    "floor": (GOOD, {"height_m": -0.46}, Answer.LAND, reason(Kind.FLOOR, height_m=-0.46, least_m=near(-0.45))),
    "estimator": (
        replace(GOOD, estimator_ratio=1.01),
        {},
        Answer.HAND_OVER,
        reason(Kind.IN_DOUBT, ratio=1.01, most=1.0),
    ),
    "horizontal accuracy": (
        replace(GOOD, horizontal_std_m=0.51),
        {},
        Answer.HAND_OVER,
        reason(Kind.UNCERTAIN, part="horizontal position", std_m=0.51, most_m=0.5),
    ),
    "vertical accuracy": (
        replace(GOOD, vertical_std_m=1.01),
        {},
        Answer.HAND_OVER,
        reason(Kind.UNCERTAIN, part="height", std_m=1.01, most_m=1.0),
    ),
    "position aid lost": (replace(GOOD, aid_lost=True), {}, Answer.HAND_OVER, reason(Kind.AID_LOST)),
    "distance": (GOOD, {"distance_m": 5.51}, Answer.LAND, reason(Kind.DISTANCE, distance_m=5.51, most_m=near(5.5))),
    "time": (GOOD, {"in_air_s": 65.1}, Answer.LAND, reason(Kind.TIME, in_air_s=65.1, mission_s=60.0)),
    "battery": (replace(GOOD, battery_v=13.99), {}, Answer.LAND, low_battery(13.99)),
    "battery unknown": (
        replace(GOOD, battery_v=NAN),
        {},
        Answer.LAND,
        low_battery(NAN),
    ),
    "no attitude at all": (
        replace(GOOD, attitude=(0.0,) * 4),
        {},
        Answer.HAND_OVER,
        reason(Kind.NO_ATTITUDE, norm=0.0),
    ),
}


@pytest.mark.parametrize("name", INSIDE)
def test_at_its_edge_a_limit_still_allows(name: str) -> None:
    state, where = INSIDE[name]
    assert verdict(state, **where) is None


@pytest.mark.parametrize("name", BEYOND)
def test_beyond_its_edge_a_limit_answers(name: str) -> None:
    state, where, answer, expected = BEYOND[name]
    breach = verdict(state, **where)
    assert breach is not None
    assert breach.answer is answer
    assert breach.reason == expected


@pytest.mark.parametrize(
    "part", [("position_ned_m", 3), ("velocity_ned_m_s", 3), ("attitude", 4)], ids=lambda part: part[0]
)
@pytest.mark.parametrize("bad", [NAN, math.inf, -math.inf])
def test_every_component_that_control_stands_on_must_be_a_number(part: tuple[str, int], bad: float) -> None:
    name, length = part
    for i in range(length):
        values = list(getattr(GOOD, name))
        values[i] = bad
        changed: dict[str, Any] = {name: tuple(values)}
        state = replace(GOOD, **changed)
        breach = verdict(state)
        assert breach is not None
        assert breach.answer is Answer.HAND_OVER
        assert breach.reason.kind is Kind.STATE_NOT_FINITE


@pytest.mark.parametrize("taken", [{"mode": "POSCTL"}, {"armed": False}], ids=str)
@pytest.mark.parametrize(
    "trouble", [{"connected": False}, {"received_s": {}}, {"position_ned_m": (NAN,) * 3}, {"battery_v": 1.0}], ids=str
)
def test_who_flies_goes_before_all_other_troubles(taken: dict[str, Any], trouble: dict[str, Any]) -> None:
    """Handing over asks for the land mode: that would take the mode back from whoever has taken it."""
    breach = verdict(replace(GOOD, **taken, **trouble))
    assert breach is not None
    assert breach.answer is Answer.RELEASE


def test_a_battery_limit_of_zero_guards_nothing() -> None:
    for volts in (0.0, NAN):
        state = replace(GOOD, battery_v=volts)
        assert inspect(state, 1.0, 60.0, 0.5, 0.0, GuardLimits(), MISSION) is None


def test_a_height_by_the_barometer_is_flown_by_default() -> None:
    """A real PX4 stated 0.51 m in a healthy flight."""
    assert defect(replace(GOOD, vertical_std_m=0.51), GuardLimits()) is None


def test_an_accuracy_limit_of_zero_guards_nothing() -> None:
    state = replace(GOOD, horizontal_std_m=99.0, vertical_std_m=99.0)
    assert defect(state, GuardLimits(max_horizontal_std_m=0.0, max_vertical_std_m=0.0)) is None


@given(
    st.sampled_from(["position_ned_m", "velocity_ned_m_s", "attitude"]),
    st.floats(allow_nan=True, allow_infinity=True),
    st.integers(0, 2),
)
def test_what_passes_is_fit_for_control(part: str, value: float, i: int) -> None:
    values = list(getattr(GOOD, part))
    values[i] = value
    changed: dict[str, Any] = {part: tuple(values)}
    state = replace(GOOD, **changed)
    if defect(state, LIMITS) is None:
        assert state.finite
        assert math.hypot(*state.attitude) == pytest.approx(1.0, abs=0.011)
    else:
        assert verdict(state) is not None


LEVEL = (1.0, 0.0, 0.0, 0.0)


def leaning_target(deg: float) -> AttitudeTarget:
    return AttitudeTarget(quaternion_from_euler(math.radians(deg), 0.0, 2.0), 0.5)


@pytest.mark.parametrize("target", [AttitudeTarget(LEVEL, 0.0), AttitudeTarget(LEVEL, 0.9), leaning_target(49.9)])
def test_a_target_at_its_limits_is_fit(target: AttitudeTarget) -> None:
    assert unfit(target, LIMITS, max_throttle=0.9) is None


@pytest.mark.parametrize(
    ("target", "expected"),
    [
        (AttitudeTarget(LEVEL, NAN), reason(Kind.TARGET_NOT_FINITE)),
        (AttitudeTarget((1.0, 0.0, math.inf, 0.0), 0.5), reason(Kind.TARGET_NOT_FINITE)),
        (AttitudeTarget(LEVEL, 0.901), reason(Kind.TARGET_THROTTLE, throttle=0.901, most=0.9)),
        (AttitudeTarget(LEVEL, -0.01), reason(Kind.TARGET_THROTTLE, throttle=-0.01, most=0.9)),
        (AttitudeTarget((1.0, 0.2, 0.0, 0.0), 0.5), reason(Kind.TARGET_NO_ATTITUDE, norm=near(1.0198))),
        (leaning_target(50.1), reason(Kind.TARGET_TILT, tilt_deg=near(50.1), most_deg=50.0)),
        (leaning_target(-170.0), reason(Kind.TARGET_TILT, tilt_deg=near(170.0), most_deg=50.0)),
    ],
)
def test_a_target_beyond_its_limits_is_unfit(target: AttitudeTarget, expected: Reason) -> None:
    assert unfit(target, LIMITS, max_throttle=0.9) == expected


@pytest.mark.parametrize(
    "setting",
    [
        {"max_state_age_s": 0.0},
        {"max_state_age_s": 5.0},
        {"max_tilt_deg": 90.0},
        {"max_speed_m_s": -1.0},
        {"max_tick_late_s": math.nan},
        {"min_battery_v": -1.0},
        {"max_estimator_ratio": -1.0},
        {"max_horizontal_std_m": -1.0},
        {"max_vertical_std_m": -1.0},
        {"max_over_time_s": 0.0},
    ],
    ids=str,
)
def test_limits_that_would_not_guard_are_refused(setting: dict[str, float]) -> None:
    with pytest.raises(SettingsError, match=f"flight.yaml: {next(iter(setting))} is "):
        validate(setting, GuardLimits, "flight.yaml")
