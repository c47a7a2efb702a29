"""A flight that does not follow its mission ends: tracking error, contact with the ground, saturation."""

import csv
import math
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import pytest

from quadctl.flight.pilot.following import Following, FollowingLimits
from quadctl.flight.pilot.guards import GuardLimits
from quadctl.flight.pilot.reasons import Kind, Reason, reason
from quadctl.flight.pilot.settings import load_flight_settings
from quadctl.flight.preflight.preparation import prepare_flight
from quadctl.frames import quaternion_from_euler
from quadctl.missions.mission import MissionLimits
from quadctl.state import NAN, AttitudeTarget, Setpoint, VehicleState
from quadctl.vehicle import load_vehicle
from tests.support.places import DATA, ROOT
from tests.support.watched import Flight, drifting, hop, in_flight

REAL = DATA / "real"
CONTROLLER = hop().settings.controller
VEHICLE = hop().body.vehicle
HOVER = VEHICLE.throttle.offset + VEHICLE.throttle.per_newton * VEHICLE.weight_n
LEVEL = (1.0, 0.0, 0.0, 0.0)
FLYING = VehicleState(0.0, (0.0, 0.0, -1.0), (0.0, 0.0, 0.0), LEVEL, landed=False)
THERE = Setpoint((0.0, 0.0, -1.0), yaw_rad=0.0)
TICK_S = 0.02


def first_defect(
    state: VehicleState = FLYING,
    setpoint: Setpoint = THERE,
    throttle: float = HOVER,
    tilt_deg: float = 0.0,
    seconds: float = 5.0,
    limits: FollowingLimits | None = None,
) -> tuple[float, Reason] | None:
    """When the same tick, repeated, is objected to, and why; it follows one that is in order."""
    following = Following(limits or FollowingLimits(), CONTROLLER, VEHICLE)
    assert following.defect(FLYING, THERE, AttitudeTarget(LEVEL, HOVER), 0.0) is None
    target = AttitudeTarget(quaternion_from_euler(math.radians(tilt_deg), 0.0, 0.0), throttle)
    for i in range(round(seconds / TICK_S)):
        now_s = i * TICK_S
        why = following.defect(replace(state, time_s=now_s), setpoint, target, 0.0)
        if why is not None:
            return now_s, why
    return None


def at(north: float = 0.0, up: float = 1.0, **changes: Any) -> VehicleState:
    return replace(FLYING, position_ned_m=(north, 0.0, -up), **changes)


def astray(part: str, error_m: float, most_m: float) -> Reason:
    return reason(Kind.ASTRAY, part=part, error_m=pytest.approx(error_m), most_m=most_m, longest_s=1.0)


def thrust(share: float) -> float:
    """Throttle that carries so much of the weight."""
    return VEHICLE.throttle.offset + VEHICLE.throttle.per_newton * share * VEHICLE.weight_n / VEHICLE.axial_share


def test_a_flight_on_its_reference_is_let_through() -> None:
    assert first_defect() is None


@pytest.mark.parametrize(
    ("state", "expected"),
    [
        (at(north=2.01), astray("horizontal", 2.01, 2.0)),
        (at(up=1.76), astray("vertical", 0.76, 0.75)),
    ],
)
def test_a_position_error_beyond_its_limit_for_its_time_is_a_breach(state: VehicleState, expected: Reason) -> None:
    found = first_defect(state)
    assert found is not None
    assert found[1] == expected
    assert found[0] == pytest.approx(1.0, abs=0.05)


@pytest.mark.parametrize("state", [at(north=1.99), at(up=1.74)])
def test_a_position_error_inside_its_limit_is_let_through(state: VehicleState) -> None:
    assert first_defect(state) is None


def test_an_axis_that_is_flown_by_velocity_has_no_position_error() -> None:
    assert first_defect(at(north=9.0), Setpoint((NAN, 0.0, -1.0), yaw_rad=0.0)) is None


def test_the_way_back_to_a_position_that_a_run_by_velocity_has_missed_is_given_time() -> None:
    following = Following(FollowingLimits(), CONTROLLER, VEHICLE)
    target = AttitudeTarget(LEVEL, HOVER)
    assert following.defect(at(north=-3.0), Setpoint((NAN, 0.0, -1.0), yaw_rad=0.0), target, 0.0) is None
    found = {}
    for i in range(400):
        found[i * TICK_S] = following.defect(replace(at(north=-3.0), time_s=i * TICK_S), THERE, target, 0.0)
    assert next(time_s for time_s, why in found.items() if why) == pytest.approx(3.0 / 0.5 + 1.0, abs=0.05)


def test_a_jump_of_the_reference_gives_the_vehicle_time_to_make_up_for_it() -> None:
    assert first_defect(FLYING, Setpoint((0.0, 0.0, -3.0), yaw_rad=0.0), seconds=4.9) is None
    found = first_defect(FLYING, Setpoint((0.0, 0.0, -3.0), yaw_rad=0.0), seconds=6.0)
    assert found is not None


def test_little_thrust_without_a_fall_is_contact_with_the_ground() -> None:
    found = first_defect(throttle=thrust(0.6))
    assert found is not None
    assert found[0] == pytest.approx(1.52, abs=0.05)
    assert found[1] == reason(Kind.CARRIED, share=pytest.approx(0.6))
    assert first_defect(throttle=thrust(0.7)) is None  # as in a strong ground effect
    assert first_defect(replace(FLYING, velocity_ned_m_s=(0.0, 0.0, 0.6)), throttle=thrust(0.6)) is None  # it falls


def test_a_vehicle_that_the_autopilot_calls_landed_touches_the_ground() -> None:
    found = first_defect(replace(FLYING, landed=True))
    assert found is not None
    assert found[1] == reason(Kind.CALLED_LANDED, landed_s=pytest.approx(1.5, abs=0.05))


def test_a_vehicle_that_does_not_lift_off_stays_on_the_ground() -> None:
    found = first_defect(at(up=0.05), Setpoint((0.0, 0.0, -0.5), yaw_rad=0.0))
    assert found is not None
    assert found[1] == reason(Kind.NOT_LIFTED, climbed_m=pytest.approx(0.05), wanted_m=pytest.approx(0.5))


def test_a_command_that_stays_at_its_limit_is_saturated() -> None:
    leaning = first_defect(tilt_deg=CONTROLLER.max_tilt_deg)
    assert leaning is not None
    assert leaning[1].kind is Kind.TILT_SATURATED
    pushing = first_defect(throttle=CONTROLLER.max_throttle)
    assert pushing is not None
    assert pushing[1].kind is Kind.THROTTLE_SATURATED
    assert pushing[0] == pytest.approx(2.02, abs=0.05)


def test_zero_turns_a_guard_off() -> None:
    off = FollowingLimits(max_horizontal_error_m=0.0, max_vertical_error_m=0.0, max_contact_s=0.0, max_saturated_s=0.0)
    assert first_defect(at(north=9.0, up=5.0), throttle=thrust(0.3), tilt_deg=30.0, limits=off) is None


# --- in flight, over the simulated autopilot -------------------------------------------------------------------------


def test_a_vehicle_that_is_held_on_the_ground_ends_the_flight() -> None:
    flight = Flight()
    body = flight.autopilot.body

    def hold(_: object) -> None:
        body.position, body.velocity = (0.0, 0.0, -0.0495), (0.0, 0.0, 0.0)

    flight.also.append(hold)
    flight.fly()
    assert flight.pilot.ended.startswith("the vehicle stays on the ground: it is at")
    assert not any(tick.target for tick in flight.watch.ticks[-20:])
    assert flight.at_rest


def test_an_estimate_that_rises_until_the_vehicle_stands_on_the_ground_ends_the_flight() -> None:
    """As recorded on PX4: off by decimetres, it stood on the ground for 20 s, and "completed"."""

    def fly(limits: FollowingLimits) -> str:
        hop = prepare_flight(ROOT / "missions" / "short_hop.yaml", ROOT / "config" / "flight.yaml", None, None)
        guards = GuardLimits(following=limits)
        plan = hop._replace(settings=hop.settings.model_copy(update={"guards": guards}))
        return Flight(plan).show(drifting(0.0, 0.0, -0.6), in_flight(1.5)).fly().pilot.ended

    assert fly(FollowingLimits(max_contact_s=1.0)).startswith("the vehicle touches the ground: ")
    assert fly(FollowingLimits(max_contact_s=0.0)) == "completed"


def test_a_mission_that_was_not_flown_within_its_tolerance_is_not_completed() -> None:
    plan = hop()
    strict = plan.mission.limits.model_copy(update={"tolerance_m": 0.005})
    flight = Flight(plan._replace(mission=plan.mission._replace(limits=strict))).fly()
    assert flight.pilot.ended.startswith("mission not followed: the position error was 0.0")
    assert flight.pilot.ended.endswith("m (RMS), allowed are 0.005 m")
    assert flight.at_rest


# --- recorded on real autopilots -------------------------------------------------------------------------------------


CONTACT_ONLY = FollowingLimits(max_horizontal_error_m=0.0, max_vertical_error_m=0.0, max_saturated_s=0.0)
SATURATION_ONLY = FollowingLimits(max_horizontal_error_m=0.0, max_vertical_error_m=0.0, max_contact_s=0.0)


def replayed(name: str, limits: FollowingLimits | None = None) -> Iterator[tuple[float, str | None, Following]]:
    """Time and objection of each tick of a recorded flight, from take-off to the end of its mission."""
    path = REAL / f"{name}.csv"
    if not path.is_file():
        pytest.skip(f"{path} is not there")
    autopilot = name.partition("/")[0]
    settings = load_flight_settings(ROOT / "sitl" / autopilot / "flight.yaml")
    vehicle = load_vehicle(ROOT / "sitl" / autopilot / "vehicle.yaml")
    following = Following(limits or FollowingLimits(), settings.controller, vehicle)
    with path.open() as file:
        for row in csv.DictReader(file):
            if row["z_ref_m"] in ("", "nan") or row["throttle_cmd"] in ("", "nan"):
                continue
            value = {key: float(text) if text else NAN for key, text in row.items() if key != "phase"}
            roll, pitch, yaw, roll_to, pitch_to, yaw_to = (
                math.radians(value[f"{axis}{kind}_deg"]) for kind in ("", "_cmd") for axis in ("roll", "pitch", "yaw")
            )
            state = VehicleState(
                value["time_s"],
                (value["x_m"], value["y_m"], -value["z_m"]),
                (value["vx_m_s"], value["vy_m_s"], -value["vz_m_s"]),
                quaternion_from_euler(roll, pitch, yaw),
                landed=False,
            )
            setpoint = Setpoint((value["x_ref_m"], value["y_ref_m"], -value["z_ref_m"]), yaw_rad=yaw_to)
            target = AttitudeTarget(quaternion_from_euler(roll_to, pitch_to, yaw_to), value["throttle_cmd"])
            yield value["time_s"], following.defect(state, setpoint, target, 0.0), following


@pytest.mark.parametrize(
    ("name", "limits", "expected", "by_s"),
    [
        ("px4/figure8_on_the_ground", FollowingLimits(), (Kind.ASTRAY, "horizontal"), 25.0),
        ("px4/figure8_on_the_ground", CONTACT_ONLY, (Kind.CARRIED, ""), 25.0),
        ("px4/figure8_on_the_ground", SATURATION_ONLY, (Kind.TILT_SATURATED, ""), 30.0),
        ("ardupilot/fault_delay_250ms", FollowingLimits(), (Kind.ASTRAY, "vertical"), 40.0),
    ],
)
def test_a_recorded_flight_that_called_itself_completed_is_ended(
    name: str, limits: FollowingLimits, expected: tuple[Kind, str], by_s: float
) -> None:
    time_s, found = next((time_s, found) for time_s, found, _ in replayed(name, limits) if found is not None)
    assert found is not None
    assert (found.kind, found.facts.get("part", "")) == expected
    assert time_s < by_s
    *_, (_, _, last) = replayed(name)
    assert last.error_rms_m > MissionLimits(max_z_m=1.0).tolerance_m


@pytest.mark.parametrize(
    "name",
    ["px4/forward_runs", "px4/excitation", "px4/vertical_runs", "px4/fault_mode_taken_for_0.6s",
     "ardupilot/forward_runs", "ardupilot/excitation", "ardupilot/vertical_runs"],
)  # fmt: skip
def test_a_recorded_flight_that_followed_its_mission_is_let_through(name: str) -> None:
    found = list(replayed(name))
    assert [why for _, why, _ in found if why is not None] == []
    assert found[-1][2].error_rms_m < MissionLimits(max_z_m=1.0).tolerance_m
