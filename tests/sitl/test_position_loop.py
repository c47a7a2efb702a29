"""Both autopilots fly a place by their own position control, on their own estimate."""

import math

import pytest

from quadctl.frames import GRAVITY_M_S2, euler_from_quaternion
from quadctl.sitl.rules.copter import POSITION_LAW as COPTER
from quadctl.sitl.rules.copter import Guided, SimulatedCopter
from quadctl.sitl.rules.px4 import POSITION_LAW as PX4
from quadctl.sitl.rules.px4 import SimulatedAutopilot
from quadctl.sitl.vehicle.hidden import load_hidden
from quadctl.sitl.vehicle.position_loop import Memory, acceleration_setpoint, leaning, root, share, velocity_setpoint
from quadctl.state import NAN, AttitudeTarget, Setpoint, Vec3
from quadctl.vehicle import load_vehicle
from studies.autopilots.measured import mock
from tests.support.links import LEVEL, RAPTOR
from tests.support.places import ROOT

REST: Vec3 = (0.0, 0.0, 0.0)
TICK_S = 0.02


def test_the_square_root_meets_the_line_and_brakes_with_its_acceleration() -> None:
    assert root(2.0, 1.0, 5.0) == 2.0
    assert root(5.0, 1.0, 5.0) == 5.0
    assert root(9.0, 1.0, 5.0) == pytest.approx(math.sqrt(65.0))  # 2 * 5 * (9 - 2.5)
    assert root(-9.0, 1.0, 5.0) == pytest.approx(-math.sqrt(65.0))
    assert root(100.0, 0.95, math.inf) == pytest.approx(95.0)
    step = 1e-4  # v dv/dp is the acceleration
    v, w = root(20.0, 1.0, 5.0), root(20.0 + step, 1.0, 5.0)
    assert v * (w - v) / step == pytest.approx(5.0, rel=1e-3)


def test_a_far_target_is_approached_straight_and_an_axis_without_place_keeps_its_velocity() -> None:
    north, east, _ = velocity_setpoint(Setpoint((30.0, 40.0, 0.0)), REST, COPTER)
    assert math.hypot(north, east) == pytest.approx(math.sqrt(10.0 * 47.5))
    assert east / north == pytest.approx(4.0 / 3.0)
    assert velocity_setpoint(Setpoint((NAN, 1.0, 0.0), (0.7, 0.0, 0.0)), REST, PX4) == pytest.approx((0.7, 0.95, 0.0))


def test_px4s_gains_act_on_the_first_estimate() -> None:
    """1.8 * 0.95 * 1 m, and the acceleration of the target on top; down 4 * 1 * 0.1 m."""
    target = Setpoint((1.0, 0.0, 0.1), acceleration_ned_m_s2=(0.5, 0.0, 0.0))
    wanted, memory = acceleration_setpoint(target, REST, REST, Memory(), PX4, 0.0)
    assert wanted == pytest.approx((2.21, 0.0, 0.4))
    assert memory.slope_m_s2 == REST


def test_px4_damps_the_acceleration_that_was_asked_for_and_ardupilot_only_its_error() -> None:
    """2 m/s^2, asked for and flown: F passes on 0.01 / (0.01 + 1 / (10 pi)) of it, of which D takes 0.2."""
    for law, expected in ((PX4, 2.0 - 0.2 * 2.0 * 0.01 / (0.01 + 1.0 / (10.0 * math.pi))), (COPTER, 2.0)):
        memory = acceleration_setpoint(Setpoint(REST), REST, REST, Memory(), law, 0.0)[1]
        at, speed = (0.0001, 0.0, 0.0), (0.02, 0.0, 0.0)
        wanted, _ = acceleration_setpoint(Setpoint(at, speed, (2.0, 0.0, 0.0)), at, speed, memory, law, 0.01)
        assert wanted[0] == pytest.approx(expected)


def test_integrals_grow_by_the_error_and_stand_still_at_the_limit_of_tilt() -> None:
    behind = Setpoint(REST, (0.5, 0.0, 0.0))
    memory = acceleration_setpoint(behind, REST, REST, Memory(), PX4, 0.0)[1]
    for _ in range(100):
        _, memory = acceleration_setpoint(behind, REST, REST, memory, PX4, 0.01)
    assert memory.integral_m_s2[0] == pytest.approx(0.4 * 0.5 * 1.0)
    wanted, kept = acceleration_setpoint(Setpoint((99.0, 0.0, 0.0)), REST, REST, memory, PX4, 0.01)
    assert wanted[0] == pytest.approx(GRAVITY_M_S2)  # 45 deg
    assert kept.integral_m_s2[:2] == memory.integral_m_s2[:2]


def test_ardupilots_throttle_follows_the_vertical_acceleration_that_it_misses() -> None:
    """5 m/s^2 wanted and none there: 1.42 times what the filter of 20 Hz passes on, and its integral."""
    sink = Setpoint(REST, (0.0, 0.0, 1.0))
    passed = 5.0 * share(20.0, 0.01)
    memory = Memory(error_m_s=(0.0, 0.0, 1.0))
    wanted, memory = acceleration_setpoint(sink, REST, REST, memory, COPTER, 0.01)
    assert memory.lift_m_s2 == pytest.approx(2.84 * passed * 0.01)
    assert wanted[2] == pytest.approx(1.42 * passed + 2.84 * passed * 0.01)


@pytest.mark.parametrize(("yaw_deg", "roll_deg", "pitch_deg"), [(0.0, 45.0, 0.0), (90.0, 0.0, -45.0)])
def test_it_leans_towards_east_in_any_heading(yaw_deg: float, roll_deg: float, pitch_deg: float) -> None:
    attitude, cosine = leaning((0.0, GRAVITY_M_S2, 3.0), math.radians(yaw_deg))
    roll, pitch, yaw = (math.degrees(angle) for angle in euler_from_quaternion(attitude))
    assert (roll, pitch, yaw) == pytest.approx((roll_deg, pitch_deg, yaw_deg), abs=1e-9)
    assert cosine == pytest.approx(math.sqrt(0.5))


def airborne(name: str) -> SimulatedAutopilot:
    """Mock that hovers at 1.5 m by its own position control."""
    truth = load_hidden(ROOT / "sitl/px4/like_sih_good_imu.yaml") if name == "px4" else None
    simulated = mock(name, truth=truth)
    simulated.step(8.1)
    hold = Setpoint((0.0, 0.0, -1.5))
    if name == "px4":
        simulated.set_position_target(hold)
    simulated.request_mode(simulated.offboard_mode)
    assert simulated.request_arm() is None
    simulated.request_take_off(1.5)
    if name == "ardupilot":
        simulated.step(simulated.time_s + 6.0)
    fly(simulated, hold, 6.0)
    return simulated


def fly(simulated: SimulatedAutopilot, setpoint: Setpoint, seconds: float) -> list[float]:
    """East of each tick."""
    east = []
    for _ in range(round(seconds / TICK_S)):
        simulated.set_position_target(setpoint)
        simulated.step(simulated.time_s + TICK_S)
        east.append(simulated.body.position[1])
    return east


@pytest.mark.parametrize(("name", "most_over_m"), [("px4", 0.2), ("ardupilot", 0.35)])
def test_its_own_control_flies_a_step_of_1_m_and_stays(name: str, most_over_m: float) -> None:
    simulated = airborne(name)
    start = simulated.body.position[1]
    east = fly(simulated, Setpoint((0.0, 1.0, -1.5)), 10.0)
    assert abs(start) < 0.1
    assert 0.9 < max(east) < 1.0 + most_over_m
    assert east[round(0.3 / TICK_S)] < 0.3  # no faster than it can lean
    assert -simulated.estimator.position[2] == pytest.approx(1.5, abs=0.1)


@pytest.mark.parametrize("name", ["px4", "ardupilot"])
def test_a_circle_is_followed_better_with_its_velocity_and_acceleration(name: str) -> None:
    """A circle of 1 m in 6 s; by its place alone the vehicle lags behind by about v / Kp."""

    def worst_m(feed_forward: float) -> float:
        simulated, rate, errors = airborne(name), 2.0 * math.pi / 6.0, []
        for tick in range(round(12.0 / TICK_S)):
            angle = rate * tick * TICK_S
            n, e = math.cos(angle), math.sin(angle)
            u, a = feed_forward * rate, feed_forward * rate**2
            simulated.set_position_target(
                Setpoint((n - 1.0, e, -1.5), (-u * e, u * n, 0.0), (-a * n, -a * e, 0.0), yaw_rad=0.5)
            )
            x, y, _ = simulated.estimator.position
            errors.append(math.hypot(x - n + 1.0, y - e))
            simulated.step(simulated.time_s + TICK_S)
        return max(errors[round(6.0 / TICK_S) :])

    followed, lagging = worst_m(1.0), worst_m(0.0)
    assert followed < (0.12 if name == "ardupilot" else 0.6)
    assert lagging > 2.0 * followed


def test_it_flies_by_its_estimate_not_by_the_truth() -> None:
    simulated = airborne("ardupilot")
    simulated.estimator.height_step_m += 0.5
    fly(simulated, Setpoint((0.0, 0.0, -1.5)), 6.0)
    assert -simulated.body.position[2] == pytest.approx(1.0, abs=0.1)


def test_an_attitude_target_takes_over_and_gives_back() -> None:
    copter = SimulatedCopter(load_vehicle(RAPTOR))
    copter.parameters["GUID_OPTIONS"] = 8.0
    copter.request_mode("GUIDED")
    copter.request_arm()
    copter.request_take_off(1.0)
    copter.step(5.0)
    copter.set_position_target(Setpoint((0.0, 0.0, -1.0)))
    assert copter.guided is Guided.PLACES
    copter.set_attitude_target(AttitudeTarget(LEVEL, copter.vehicle.hover_throttle))
    assert copter.guided is Guided.TARGETS
    copter.step(copter.time_s + 0.1)
    assert copter._active.throttle == pytest.approx(copter.vehicle.hover_throttle, rel=1e-3)


def test_copter_stays_where_its_last_target_was_and_px4_fails_over() -> None:
    copter, px4 = airborne("ardupilot"), airborne("px4")
    moving = Setpoint((0.0, 0.0, -1.5), (1.0, 0.0, 0.0), (0.5, 0.0, 0.0))
    for simulated in (copter, px4):
        simulated.set_position_target(moving)
        simulated.step(simulated.time_s + 8.0)
    assert copter.mode == "GUIDED"
    assert copter.body.position[0] == pytest.approx(0.0, abs=0.35)
    assert px4.mode == "RTL"
