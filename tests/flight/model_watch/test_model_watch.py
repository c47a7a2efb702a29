"""The watch over the model that flies: prediction, residual and changes, by hand and on made-up flights."""

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import pytest

from quadctl.control.throttle import lateral_throttle, throttle_for_thrust
from quadctl.effects import Conditions, ThrustRatio
from quadctl.effects.rotor_drag import LinearDrag
from quadctl.flight.model_watch.changes import Change
from quadctl.flight.model_watch.followed_velocity import FollowedVelocity
from quadctl.flight.model_watch.prediction import Prediction, Predictor, slopes
from quadctl.flight.model_watch.regression import BLOCK_S, NAMES, Block, Blocks, Recursion
from quadctl.flight.model_watch.watch import ModelWatch
from quadctl.frames import GRAVITY_M_S2, quaternion_from_euler, rotate
from quadctl.model import Model
from quadctl.numeric import Number
from quadctl.state import AttitudeTarget, Setpoint, Vec3, VehicleState
from quadctl.vehicle import Vehicle, load_vehicle
from tests.support.links import RAPTOR

VEHICLE = load_vehicle(RAPTOR)
LEANING = quaternion_from_euler(0.2, -0.1, 2.0)
NO_WIND: Vec3 = (0.0, 0.0, 0.0)
PLACE = Setpoint((3.0, -2.0, -2.0))


def throttle(thrust_n: float) -> float:
    return VEHICLE.throttle.offset + VEHICLE.throttle.per_newton * thrust_n


def state(
    time_s: float, velocity: Vec3 = NO_WIND, attitude: tuple[float, ...] = LEANING, **others: float
) -> VehicleState:
    w, x, y, z = attitude
    received = {"position": time_s, "attitude": time_s}
    return VehicleState(time_s, (3.0, -2.0, -2.0), velocity, (w, x, y, z), received_s=received, **others)  # type: ignore[arg-type]


# --- the prediction --------------------------------------------------------------------------------------------------


def test_the_prediction_is_thrust_and_drag_and_weight() -> None:
    drag = LinearDrag(d_x=0.3, d_y=0.2, d_z=0.0)
    predictor, thrust_n, velocity = Predictor(Model(VEHICLE).plus(drag)), 1.1 * VEHICLE.weight_n, (1.5, -0.5, 0.2)
    predictor.sent(9.9, AttitudeTarget(LEANING, throttle(thrust_n)), Setpoint((0.0, 0.0, 0.0), (1.4, -0.4, 0.1)))
    assert predictor.predict(state(10.0, velocity), 0.0) is None  # there is nothing to compare the first with
    at = predictor.predict(state(10.02, velocity), 0.0)
    assert at is not None
    only_thrust = rotate(LEANING, (0.0, 0.0, -thrust_n / VEHICLE.mass_kg))
    beyond = np.subtract(at.acceleration_ned, only_thrust) - (0.0, 0.0, GRAVITY_M_S2)
    along = [rotate(LEANING, axis) for axis in np.eye(3).tolist()]
    expected = slopes(Model(VEHICLE).plus(drag), 16.0)
    for axis, slope in zip(along[:2], expected[:2], strict=True):
        assert np.dot(beyond, axis) == pytest.approx(-slope * np.dot(velocity, axis), rel=0.15)  # it grows with thrust
    assert at.air_body == pytest.approx([np.dot((1.4, -0.4, 0.1), axis) for axis in along], abs=0.02)


def test_a_target_counts_from_its_arrival_and_through_the_rotors_lag() -> None:
    predictor, half_n = Predictor(Model(VEHICLE)), 0.5 * VEHICLE.weight_n
    lag_s = VEHICLE.rotor.time_constant_s
    for t, thrust_n in ((9.5, half_n), (10.0, 2.0 * half_n)):
        predictor.sent(t, AttitudeTarget(LEANING, throttle(thrust_n)), PLACE)
    for t in (10.0, 10.02, 10.04):  # of the second, which needs 0.05 s, nothing is felt yet
        before = predictor.predict(state(t, setpoint_delay_s=0.05), 0.0)
    assert before is not None
    assert math.hypot(*before.rotors_body) == pytest.approx(half_n / VEHICLE.mass_kg)
    after = predictor.predict(state(10.06, setpoint_delay_s=0.05), 0.0)
    assert after is not None
    rise = 1.0 - math.exp(-0.02 / lag_s)
    assert math.hypot(*after.rotors_body) == pytest.approx((1.0 + rise) * half_n / VEHICLE.mass_kg)


def test_a_state_that_was_seen_before_gives_no_second_prediction() -> None:
    predictor = Predictor(Model(VEHICLE))
    predictor.sent(9.9, AttitudeTarget(LEANING, 0.5), PLACE)
    assert predictor.predict(state(10.0), 0.0) is None
    assert predictor.predict(state(10.02), 0.0) is not None
    assert predictor.predict(state(10.02), 0.0) is None


def test_the_residual_is_the_acceleration_that_the_model_lacks() -> None:
    """A vehicle that accelerates by 0.4 m/s² north in a hover that the model takes for one."""
    watch, level = ModelWatch(Model(VEHICLE)), quaternion_from_euler(0.0, 0.0, 0.5 * math.pi)  # it looks east
    for i in range(150):
        t = 20.0 + 0.02 * i
        watch.sent(t, AttitudeTarget(LEANING, throttle(VEHICLE.weight_n)), PLACE)
        watch.look(state(t + 0.005, (0.4 * 0.02 * i, 0.0, 0.0), level), 0.0, 0.02 * i)
    assert watch.error.ned_m_s2 == pytest.approx((0.4, 0.0, 0.0), abs=0.01)
    assert watch.error.body_m_s2 == pytest.approx((0.0, -0.4, 0.0), abs=0.01)
    watch.pause()
    assert all(map(math.isnan, watch.error.ned_m_s2))


def test_the_velocity_of_a_vehicle_that_follows_late_is_found_and_an_error_of_the_estimate_is_not_taken_for_it() -> (
    None
):
    followed, random = FollowedVelocity(), np.random.default_rng(5)
    worst_m_s = 0.0
    for i in range(2000):
        t = 0.02 * i
        reference = Setpoint((0.0, 0.0, 0.0), (2.0 * math.sin(t), 0.0, 0.0), (2.0 * math.cos(t), 0.0, 0.0))
        true_m_s = 0.9 * 2.0 * math.sin(t - 0.3)
        estimated = (
            true_m_s + random.normal(0.0, 0.2),
            0.28,
            random.normal(0.0, 0.2),
        )  # to the east it is off for good
        followed.take(estimated, reference, 0.02)
        north, east, down = followed.expected(reference)
        if t > 10.0:
            worst_m_s = max(worst_m_s, abs(north - true_m_s))
            assert (east, down) == (0.0, 0.0)
    assert worst_m_s < 0.1


def test_a_lateral_command_is_predicted_along_the_body() -> None:
    """Tilted rotors push by 2 N to the right of a level vehicle that looks to the south-west."""
    tilted = load_vehicle(RAPTOR.with_name("f550_tilted.yaml"))
    predictor, level = Predictor(Model(tilted)), quaternion_from_euler(0.0, 0.0, -2.4)
    hover = throttle_for_thrust(tilted.weight_n / tilted.axial_share, tilted)
    predictor.sent(9.9, AttitudeTarget(level, hover, lateral_throttle((0.0, 2.0), tilted)), PLACE)
    assert predictor.predict(state(10.0, attitude=level), 0.0) is None
    at = predictor.predict(state(10.02, attitude=level), 0.0)
    assert at is not None
    right = rotate(level, (0.0, 2.0 / tilted.mass_kg, 0.0))
    assert at.acceleration_ned == pytest.approx(right, abs=1e-3)


@dataclass(frozen=True)
class ByVoltage(ThrustRatio):
    """A user's effect, which has no value without a voltage, and raises at 0 V."""

    name: ClassVar[str] = "own.by_voltage"
    depends_on: ClassVar[tuple[str, ...]] = ("battery_v",)

    def ratio(self, c: Conditions, vehicle: Vehicle) -> Number:
        return 1.0 if 16.0 / c.battery_v > 0.0 else math.nan


def test_a_model_without_a_value_leaves_no_trace_once_it_has_one() -> None:
    """The battery's voltage comes a second late."""
    watch, level = ModelWatch(Model(VEHICLE).plus(ByVoltage())), (1.0, 0.0, 0.0, 0.0)
    for i in range(1000):
        t, volts = 20.0 + 0.02 * i, math.nan if i < 50 else 16.0
        watch.sent(t, AttitudeTarget(level, throttle(VEHICLE.weight_n)), PLACE)
        watch.look(state(t + 0.005, attitude=level, battery_v=volts), 0.0, 0.02 * i)
        assert i >= 50 or all(map(math.isnan, watch.error.ned_m_s2))
    assert all(map(math.isfinite, watch.error.ned_m_s2))
    assert watch.known["thrust"].share < 0.01
    assert watch.known["drag"].share > 1.0  # it hovers


@pytest.mark.parametrize("volts", [math.nan, 0.0])
def test_a_quantity_of_a_model_without_a_value_is_not_known(volts: float) -> None:
    assert all(map(math.isnan, slopes(Model(VEHICLE).plus(ByVoltage()), volts)[2:]))
    assert not ModelWatch(Model(VEHICLE)).known["drag"].share <= 1.0


# --- what it learns --------------------------------------------------------------------------------------------------


def test_a_block_is_the_velocity_gained_beyond_the_model() -> None:
    blocks, found = Blocks(), []
    for i in range(27):
        velocity = (0.1 * 0.02 * i, -0.2 * 0.02 * i, 0.0)
        at = Prediction(5.0 + 0.02 * i, 0.02, (0.3, 0.0, 0.1), (0.0, 0.0, -10.0), (2.0, -1.0, 0.5))
        found.append(blocks.add(at, velocity, LEANING))
    (block,) = [block for block in found if block is not None]
    assert block.excess_m_s2 == pytest.approx((0.1 - 0.3, -0.2, -0.1))
    assert block.air_m_s == pytest.approx((2.0, 1.0, 0.5))
    forward, right, down = (np.array(rotate(LEANING, axis)) for axis in np.eye(3).tolist())
    columns = dict(zip(NAMES, block.slopes.T, strict=True))
    assert columns["thrust"] == pytest.approx(-10.0 * down)
    assert columns["drag forward"] == pytest.approx(-2.0 * forward)
    assert columns["drag right"] == pytest.approx(right)
    assert columns["inflow"] == pytest.approx(-0.5 * down)
    assert columns["lean right"] == pytest.approx(GRAVITY_M_S2 * right)
    assert columns["push east"] == pytest.approx((0.0, 1.0, 0.0))


def blocks_of(truth: dict[str, float], n: int, noise: float, seed: int) -> list[Block]:
    """Blocks of a flight back and forth in changing headings, of a vehicle that differs from its model by `truth`."""
    random, blocks = np.random.default_rng(seed), []
    x = np.array([truth.get(name, 0.0) for name in NAMES])
    for i in range(n):
        attitude = quaternion_from_euler(0.1 * math.sin(0.7 * i), 0.1 * math.cos(1.1 * i), 0.3 * i)
        u, v, w = 2.0 * math.sin(0.9 * i), 1.5 * math.cos(0.6 * i), 0.8 * math.sin(0.4 * i)
        summed, made = Blocks(), None
        for t in (0.0, BLOCK_S):
            at = Prediction(t, BLOCK_S, (0.0, 0.0, 0.0), (0.0, 0.0, -9.8), (u, v, w))
            made = summed.add(at, (0.0, 0.0, 0.0), attitude)
        assert made is not None
        blocks.append(made._replace(excess_m_s2=made.slopes @ x + random.normal(0.0, noise, 3)))
    return blocks


TRUTH = {"thrust": -0.08, "drag forward": 0.25, "drag right": -0.1, "lean right": 0.03, "push north": 0.2}


def test_the_recursion_finds_each_parameter_within_its_interval() -> None:
    inside = total = 0
    for seed in range(20):
        recursion = Recursion(constant=True)
        for block in blocks_of(TRUTH, 60, 0.05, seed):
            recursion.take(block)
        found = recursion.estimates()
        assert found["thrust"].value == pytest.approx(-0.08, abs=0.01)
        assert found["drag forward"].value == pytest.approx(0.25, abs=0.05)
        for name in ("thrust", "drag forward", "drag right", "inflow", "lean forward", "lean right"):
            total += 1
            inside += abs(found[name].value - TRUTH.get(name, 0.0)) < 1.96 * found[name].std
    assert inside / total > 0.88  # 95 % but for chance


def test_a_change_in_flight_is_followed_and_the_whole_flight_is_not_taken_for_it() -> None:
    now, whole = Recursion(constant=False), Recursion(constant=True)
    for block in [*blocks_of({}, 60, 0.03, 1), *blocks_of({"thrust": -0.13}, 8, 0.03, 2)]:
        now.take(block)
        whole.take(block)
    assert now.estimates()["thrust"].value == pytest.approx(-0.13, abs=0.02)
    assert abs(whole.estimates()["thrust"].value) < 0.05


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (Change("thrust", -0.131, 0.01, 14.2), "thrust 13% below the model since 14 s"),
        (Change("drag right", 0.304, 0.05, 8.0), "drag right 0.30 1/s above the model since 8 s"),
        (Change("lean forward", -0.05, 0.01, 30.0), "lean forward by -2.9 deg against the model since 30 s"),
    ],
)
def test_a_change_is_one_line(change: Change, sentence: str) -> None:
    assert str(change) == sentence
