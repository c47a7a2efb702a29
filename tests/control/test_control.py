"""One tick of control: signs, limits, anti-windup, gravity feed-forward, projection, throttle."""

import inspect
import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from quadctl.compensator import Compensator, CompensatorLimits
from quadctl.control import AxisGains, ControllerSettings, ControlOutput, Memory, control
from quadctl.control.attitude import attitude_for_force, limit_tilt, thrust_along_body
from quadctl.control.lags import Lags, Preview, eased, smoothed, turn_lag_s
from quadctl.control.throttle import throttle_for_thrust, thrust_for_throttle
from quadctl.control.velocity import FULL as FULL_GAINS
from quadctl.control.velocity import VelocityMemory, acceleration_setpoint, velocity_setpoint
from quadctl.effects import Effect
from quadctl.effects.ground_effect import Exponential, Sanchez
from quadctl.effects.inflow import AxialInflow
from quadctl.effects.rotor_drag import LinearDrag
from quadctl.effects.thrust_curve import PowerCurve
from quadctl.effects.thrust_scale import ConstantScale
from quadctl.effects.thrust_tilt import FixedTilt
from quadctl.flight.pilot.settings import load_flight_settings
from quadctl.frames import euler_from_quaternion, quaternion_from_euler, rotate, rotate_inverse, tilt
from quadctl.model import Model, StackedEffect, conditions
from quadctl.state import NAN, AttitudeTarget, Quat, Setpoint, Vec3, VehicleState
from quadctl.vehicle import AttitudeResponse, AxisResponse, RotorPlace, Vehicle, load_vehicle
from tests.support.places import ROOT

SETTINGS = load_flight_settings(ROOT / "config" / "flight_thesis.yaml").controller
DEFAULT = ControllerSettings()
LEVEL: Quat = (1.0, 0.0, 0.0, 0.0)
ORIGIN: Vec3 = (0.0, 0.0, 0.0)
DT = 0.02
WEIGHT_N = 14.709975

component = st.floats(-50.0, 50.0)
vectors = st.tuples(component, component, component)
headings = st.floats(-math.pi, math.pi)


def hovering(down_m: float = -1.0, velocity: Vec3 = ORIGIN, attitude: Quat = LEVEL) -> VehicleState:
    return VehicleState(time_s=0.0, position_ned_m=(0.0, 0.0, down_m), velocity_ned_m_s=velocity, attitude=attitude)


def compensator(vehicle: Vehicle, *effects: Effect, band: float = 0.3) -> Compensator:
    return Compensator(Model(vehicle, tuple(map(StackedEffect, effects))), CompensatorLimits(band=band))


def tick(vehicle: Vehicle, setpoint: Setpoint, state: VehicleState, **changes: Any) -> ControlOutput:
    usual: dict[str, Any] = {"memory": Memory(), "settings": SETTINGS, "compensator": compensator(vehicle)}
    return control(setpoint, state, dt=DT, ground_down_m=0.0, vehicle=vehicle, **{**usual, **changes})


# --- position to velocity ------------------------------------------------------------------------------------------


def test_velocity_is_proportional_to_the_position_error() -> None:
    # 0.95 * (1, -2, 0.5), and the reference's own velocity on top of it
    setpoint = Setpoint((1.0, -2.0, -0.5), velocity_ned_m_s=(0.1, 0.0, 0.2))
    assert velocity_setpoint(setpoint, (0.0, 0.0, -1.0), SETTINGS) == pytest.approx((1.05, -1.9, 0.675))


def test_horizontal_speed_is_limited_and_keeps_its_direction() -> None:
    # 0.95 * (30, 40): 47.5 m/s; limited to 12 m/s along (0.6, 0.8)
    assert velocity_setpoint(Setpoint((30.0, 40.0, 0.0)), ORIGIN, SETTINGS) == pytest.approx((7.2, 9.6, 0.0))


def test_climb_is_limited_to_3_and_descent_to_1_m_s() -> None:
    assert velocity_setpoint(Setpoint((0.0, 0.0, -20.0)), ORIGIN, SETTINGS)[2] == -3.0
    assert velocity_setpoint(Setpoint((0.0, 0.0, 20.0)), ORIGIN, SETTINGS)[2] == 1.0


def test_an_axis_without_position_is_flown_by_velocity() -> None:
    setpoint = Setpoint((NAN, 1.0, NAN), velocity_ned_m_s=(2.0, 0.0, -0.4))
    assert velocity_setpoint(setpoint, (5.0, 0.0, -3.0), SETTINGS) == pytest.approx((2.0, 0.95, -0.4))


@given(target=vectors, actual=vectors, feed_forward=vectors)
def test_velocity_limits_hold_everywhere(target: Vec3, actual: Vec3, feed_forward: Vec3) -> None:
    north, east, down = velocity_setpoint(Setpoint(target, feed_forward), actual, SETTINGS)
    assert math.hypot(north, east) <= 12.0 + 1e-9
    assert -3.0 <= down <= 1.0


# --- velocity to acceleration --------------------------------------------------------------------------------------


def accelerate(
    wanted: Vec3, actual: Vec3 = ORIGIN, memory: VelocityMemory | None = None, settings: ControllerSettings = SETTINGS
) -> tuple[Vec3, VelocityMemory]:
    return acceleration_setpoint(wanted, actual, ORIGIN, memory or VelocityMemory(), DT, settings)


def test_proportional_and_integral_by_hand() -> None:
    # P: 1.4 * 1, 1.4 * -0.5, 4 * 0.25; the integrator acts from the next tick: 0.4 * 1 * 0.02, ..., 2 * 0.25 * 0.02
    acceleration, memory = accelerate((1.0, -0.5, 0.25))
    assert acceleration == pytest.approx((1.4, -0.7, 1.0))
    assert memory.integral_m_s2 == pytest.approx((0.008, -0.004, 0.01))
    acceleration, _ = accelerate((1.0, -0.5, 0.25), memory=memory)
    assert acceleration == pytest.approx((1.408, -0.704, 1.01))


def test_the_references_acceleration_is_fed_forward() -> None:
    acceleration, _ = acceleration_setpoint(ORIGIN, ORIGIN, (0.5, -0.25, 1.0), VelocityMemory(), DT, SETTINGS)
    assert acceleration == pytest.approx((0.5, -0.25, 1.0))


def test_derivative_acts_on_the_measured_velocity() -> None:
    # 0.7 m/s in one tick is 35 m/s^2, of which the filter lets 0.02 / (0.02 + 0.05) = 2/7 through: 10 m/s^2;
    # P 1.4 * -0.7 = -0.98, D -0.2 * 10 = -2
    before = VelocityMemory(previous_velocity_m_s=ORIGIN)
    acceleration, memory = accelerate(ORIGIN, (0.7, 0.0, 0.0), before)
    assert memory.acceleration_m_s2 == pytest.approx((10.0, 0.0, 0.0))
    assert acceleration == pytest.approx((-2.98, 0.0, 0.0))


def test_a_step_of_the_setpoint_does_not_kick() -> None:
    before = VelocityMemory(previous_velocity_m_s=ORIGIN)
    assert accelerate((0.7, 0.0, 0.0), ORIGIN, before)[0] == pytest.approx((0.98, 0.0, 0.0))


def test_the_first_tick_and_a_tick_without_time_have_no_derivative() -> None:
    assert accelerate(ORIGIN, (1.0, 0.0, 0.0))[0] == pytest.approx((-1.4, 0.0, 0.0))
    before = VelocityMemory(previous_velocity_m_s=ORIGIN)
    acceleration, _ = acceleration_setpoint(ORIGIN, (1.0, 0.0, 0.0), ORIGIN, before, 0.0, SETTINGS)
    assert acceleration == pytest.approx((-1.4, 0.0, 0.0))


def test_vertical_acceleration_is_limited() -> None:
    assert accelerate((0.0, 0.0, -10.0))[0] == pytest.approx((0.0, 0.0, -8.0))
    assert accelerate((0.0, 0.0, 10.0))[0] == pytest.approx((0.0, 0.0, 7.0))


@pytest.mark.parametrize(
    ("down_m_s", "horizontal"),
    # tan 35 deg = 0.7002075, times the specific force upward: 9.80665 in hover, 17.80665 going up at 8 m/s^2,
    # 2.80665 going down at 7 m/s^2
    [(0.0, 6.8666903), (-10.0, 12.4683505), (10.0, 1.9652375)],
)
def test_tilt_limit_leaves_this_much_horizontal_acceleration(down_m_s: float, horizontal: float) -> None:
    north, east, _ = accelerate((-60.0, 80.0, down_m_s))[0]
    assert (north, east) == pytest.approx((-0.6 * horizontal, 0.8 * horizontal))


@pytest.mark.parametrize("wanted", [(0.0, 0.0, -10.0), (0.0, 0.0, 10.0), (60.0, 0.0, 0.0), (-60.0, -60.0, 0.0)])
def test_the_integrator_does_not_grow_at_the_limit(wanted: Vec3) -> None:
    memory = VelocityMemory()
    for _ in range(500):
        _, memory = accelerate(wanted, memory=memory)
    assert memory.integral_m_s2 == (0.0, 0.0, 0.0)


def test_the_integrator_recovers_from_the_limit_at_once() -> None:
    # Wound up against the upper limit by what came before: 4 * -1.5 - 3 = -9, limited to -8. When the error turns,
    # the integrator must unwind at once.
    memory = VelocityMemory(integral_m_s2=(0.0, 0.0, -3.0))
    _, memory = accelerate((0.0, 0.0, -1.5), memory=memory)
    assert memory.integral_m_s2[2] == -3.0
    _, memory = accelerate((0.0, 0.0, 0.5), memory=memory)
    assert memory.integral_m_s2[2] == pytest.approx(-2.98)  # -3 + 2 * 0.5 * 0.02


def test_an_error_that_leads_away_from_the_limit_is_integrated_at_the_limit() -> None:
    # The feed-forward alone is past the limit; the error asks for less.
    memory = VelocityMemory(integral_m_s2=(0.0, 0.0, -3.0))
    acceleration, memory = acceleration_setpoint((0.0, 0.0, 0.5), ORIGIN, (0.0, 0.0, -9.0), memory, DT, SETTINGS)
    assert acceleration[2] == -8.0  # -9 + 4 * 0.5 - 3 = -10
    assert memory.integral_m_s2[2] == pytest.approx(-2.98)


def test_one_axis_at_its_limit_does_not_stop_the_others() -> None:
    _, memory = accelerate((0.5, 0.0, -10.0))
    assert memory.integral_m_s2 == pytest.approx((0.004, 0.0, 0.0))  # 0.4 * 0.5 * 0.02


def test_the_integral_of_the_position_is_limited_and_blind_to_the_velocity() -> None:
    """0.4 times the velocity back to the place, of 0.5 m/s at most, times 0.02 s; the vertical one is not concerned."""
    chosen = ControllerSettings(horizontal_integral="position")
    wanted, reference = (1.3, -0.1, 0.5), (1.0, 0.2, 0.0)
    _, memory = acceleration_setpoint(
        wanted, (5.0, -3.0, 0.0), ORIGIN, VelocityMemory(), 0.02, chosen, here_m_s=reference
    )
    assert memory.integral_m_s2 == pytest.approx((0.0024, -0.0024, 0.02))
    far = (1.0 + 30.0, 0.2 - 40.0, 0.0)
    _, memory = acceleration_setpoint(far, ORIGIN, ORIGIN, VelocityMemory(), 0.02, chosen, here_m_s=reference)
    assert memory.integral_m_s2 == pytest.approx((0.0, 0.0, 0.0))  # at the limit of the tilt nothing is summed up
    near = (1.0 + 0.6, 0.2 - 0.8, 0.0)
    _, memory = acceleration_setpoint(near, ORIGIN, ORIGIN, VelocityMemory(), 0.02, chosen, here_m_s=reference)
    assert memory.integral_m_s2 == pytest.approx((0.4 * 0.3 * 0.02, -0.4 * 0.4 * 0.02, 0.0))


@pytest.mark.parametrize(("integral", "off_m"), [("velocity", 0.35), ("position", 0.0)])
def test_a_constant_error_of_the_velocity_moves_the_place_only_where_the_velocity_is_summed_up(
    integral: Any, off_m: float
) -> None:
    """A point mass whose estimated velocity reads 0.28 m/s too much to the east, held at its place for a minute."""
    chosen, memory, x_m, v_m_s = ControllerSettings(horizontal_integral=integral), VelocityMemory(), 0.0, 0.0
    for _ in range(3000):
        state = (0.0, v_m_s + 0.28, 0.0)
        wanted = velocity_setpoint(Setpoint(ORIGIN), (0.0, x_m, 0.0), chosen)
        (_, a_m_s2, _), memory = acceleration_setpoint(wanted, state, ORIGIN, memory, 0.02, chosen)
        v_m_s += 0.02 * a_m_s2
        x_m += 0.02 * v_m_s
    assert -x_m == pytest.approx(off_m, abs=0.01)  # 0.28 m/s over 0.8 1/s


def test_the_integral_is_bounded() -> None:
    memory = VelocityMemory()
    for _ in range(1000):  # 2 * 0.5 * 20 s = 20 m/s^2 without a bound; 4 * 0.5 + 4 is within the limits
        _, memory = accelerate((0.0, 0.0, 0.5), memory=memory)
    assert memory.integral_m_s2[2] == 4.0


# --- force to attitude ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("force", "yaw", "euler_deg"),
    [
        ((0.0, 0.0, -10.0), 0.0, (0.0, 0.0, 0.0)),
        ((0.0, 0.0, -10.0), 1.0, (0.0, 0.0, 57.29578)),
        ((0.0, 10.0, -10.0), 0.0, (45.0, 0.0, 0.0)),  # to the east, heading north: roll right
        ((10.0, 0.0, -10.0), 0.0, (0.0, -45.0, 0.0)),  # to the north, heading north: nose down
        ((10.0, 0.0, -10.0), math.pi / 2, (-45.0, 0.0, 90.0)),  # to the north, heading east: roll left
        ((0.0, 10.0, -10.0), math.pi / 2, (0.0, -45.0, 90.0)),
        # pitch = -atan(fx / up) = -atan(1/2) = -26.56505; roll = asin(fy / length) = asin(1/sqrt(6)) = 24.09484
        ((1.0, 1.0, -2.0), 0.0, (24.09484, -26.56505, 0.0)),
    ],
)
def test_attitude_for_a_force_by_hand(force: Vec3, yaw: float, euler_deg: Vec3) -> None:
    euler = euler_from_quaternion(attitude_for_force(force, yaw))
    assert [math.degrees(angle) for angle in euler] == pytest.approx(euler_deg, abs=1e-5)


@given(force=vectors.filter(lambda f: math.hypot(*f) > 1e-3), yaw=headings)
def test_thrust_axis_points_along_any_force(force: Vec3, yaw: float) -> None:
    q = attitude_for_force(force, yaw)
    assert math.hypot(*q) == pytest.approx(1.0, abs=1e-9)
    length = math.hypot(*force)
    assert rotate(q, (0.0, 0.0, -1.0)) == pytest.approx([f / length for f in force], abs=1e-6)


@given(fx=component, fy=component, up=st.floats(0.1, 50.0), yaw=headings)
def test_heading_is_kept_when_thrust_points_up(fx: float, fy: float, up: float, yaw: float) -> None:
    _, _, got = euler_from_quaternion(attitude_for_force((fx, fy, -up), yaw))
    assert math.remainder(got - yaw, 2.0 * math.pi) == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("yaw", [0.0, 0.7, 2.0, -3.0, math.pi])
@pytest.mark.parametrize("sideways", ["right", "left", "ahead", "behind", "down"])
def test_forces_without_an_upward_part(sideways: str, yaw: float) -> None:
    c, s = math.cos(yaw), math.sin(yaw)
    force = {"right": (-s, c, 0.0), "left": (s, -c, 0.0), "ahead": (c, s, 0.0), "behind": (-c, -s, 0.0)}.get(
        sideways, (0.0, 0.0, 1.0)
    )
    q = attitude_for_force(force, yaw)
    assert math.hypot(*q) == pytest.approx(1.0)
    assert rotate(q, (0.0, 0.0, -1.0)) == pytest.approx(force, abs=1e-9)


def test_no_force_is_the_level_attitude() -> None:
    # yaw 1 rad: (cos 0.5, 0, 0, sin 0.5)
    assert attitude_for_force(ORIGIN, 1.0) == pytest.approx((0.8775826, 0.0, 0.0, 0.4794255))


def test_leaning_is_limited_and_the_vertical_part_kept() -> None:
    # tan 35 deg * 10 = 7.002075, along (0.6, -0.8)
    limited = limit_tilt((30.0, -40.0, -10.0), math.radians(35.0))
    assert limited == pytest.approx((4.201245, -5.601660, -10.0), abs=1e-6)
    assert limit_tilt((3.0, -4.0, -10.0), math.radians(35.0)) == (3.0, -4.0, -10.0)


def test_a_force_that_points_down_is_no_force() -> None:
    assert limit_tilt((3.0, -4.0, 2.0), math.radians(35.0)) == pytest.approx((0.0, 0.0, 0.0))


# --- thrust --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("roll_deg", "thrust_n"),
    [(0.0, 10.0), (60.0, 5.0), (-60.0, 5.0), (90.0, 0.0), (180.0, 0.0)],  # 10 cos(roll), never less than 0
)
def test_thrust_is_the_wanted_force_along_the_present_axis(roll_deg: float, thrust_n: float) -> None:
    q: Quat = quaternion_from_euler(math.radians(roll_deg), 0.0, 0.3)
    assert thrust_along_body((0.0, 0.0, -10.0), q) == pytest.approx(thrust_n, abs=1e-12)


def test_throttle_line_by_hand(raptor: Vehicle) -> None:
    assert throttle_for_thrust(0.0, raptor) == pytest.approx(0.1644)
    assert throttle_for_thrust(WEIGHT_N, raptor) == pytest.approx(0.5165568)  # 0.1644 + 0.02394 * 14.709975
    assert thrust_for_throttle(0.5165568, raptor) == pytest.approx(WEIGHT_N)
    assert thrust_for_throttle(0.1, raptor) == 0.0


def test_throttle_limits(raptor: Vehicle) -> None:
    assert throttle_for_thrust(100.0, raptor) == 1.0
    assert throttle_for_thrust(100.0, raptor, high=0.9) == 0.9
    assert throttle_for_thrust(-10.0, raptor) == 0.0  # 0.1644 - 0.2394 < 0
    assert throttle_for_thrust(0.0, raptor, low=0.2) == 0.2


@given(thrust_n=st.floats(0.0, 34.9))  # throttle 1 is (1 - 0.1644) / 0.02394 = 34.9039 N
def test_throttle_and_back(raptor: Vehicle, thrust_n: float) -> None:
    assert thrust_for_throttle(throttle_for_thrust(thrust_n, raptor), raptor) == pytest.approx(thrust_n, abs=1e-9)


# --- the whole tick ------------------------------------------------------------------------------------------------


def test_hover_at_the_setpoint_asks_for_exactly_the_weight(raptor: Vehicle) -> None:
    out = tick(raptor, Setpoint((0.0, 0.0, -1.0)), hovering())
    assert out.thrust_n == raptor.weight_n
    assert out.target.attitude == pytest.approx(LEVEL)
    assert out.target.throttle == pytest.approx(0.5165568)
    assert out.acceleration_sp == (0.0, 0.0, 0.0)
    assert out.memory.velocity.integral_m_s2 == (0.0, 0.0, 0.0)


@pytest.mark.parametrize(
    ("position", "roll_sign", "pitch_sign", "thrust_sign"),
    [
        ((0.0, 1.0, -1.0), 1.0, 0.0, 0.0),  # to the east: roll right
        ((0.0, -1.0, -1.0), -1.0, 0.0, 0.0),
        ((1.0, 0.0, -1.0), 0.0, -1.0, 0.0),  # to the north: nose down
        ((-1.0, 0.0, -1.0), 0.0, 1.0, 0.0),
        ((0.0, 0.0, -1.1), 0.0, 0.0, 1.0),  # up: more thrust
        ((0.0, 0.0, -0.9), 0.0, 0.0, -1.0),
    ],
)
def test_it_moves_toward_the_setpoint(
    raptor: Vehicle, position: Vec3, roll_sign: float, pitch_sign: float, thrust_sign: float
) -> None:
    out = tick(raptor, Setpoint(position), hovering())
    roll, pitch, yaw = euler_from_quaternion(out.target.attitude)

    def sign(value: float) -> float:
        return 0.0 if abs(value) < 1e-9 else math.copysign(1.0, value)

    assert (sign(roll), sign(pitch), sign(yaw)) == (roll_sign, pitch_sign, 0.0)
    assert sign(out.thrust_n - WEIGHT_N) == thrust_sign


def test_a_tick_by_hand(raptor: Vehicle) -> None:
    # 1 m too far west: velocity 0.95, acceleration 1.4 * 0.95 = 1.33 m/s^2 east;
    # roll = atan(1.33 / 9.80665) = 7.72346 deg.
    # The vehicle is level still: the thrust is the vertical part, the weight.
    out = tick(raptor, Setpoint((0.0, 1.0, -1.0)), hovering())
    assert out.velocity_sp == pytest.approx((0.0, 0.95, 0.0))
    assert out.acceleration_sp == pytest.approx((0.0, 1.33, 0.0))
    assert math.degrees(euler_from_quaternion(out.target.attitude)[0]) == pytest.approx(7.72346, abs=1e-5)
    assert out.thrust_n == pytest.approx(WEIGHT_N)


def test_a_model_without_effects_is_the_same_as_no_compensator(raptor: Vehicle) -> None:
    setpoint, state = Setpoint((1.0, 2.0, -0.4)), hovering(-0.2, (0.3, -0.1, 0.2))
    assert tick(raptor, setpoint, state, compensator=compensator(raptor)) == tick(raptor, setpoint, state)


def test_compensated_hover_commands_the_weight_over_the_ratio(raptor: Vehicle) -> None:
    # K = 1.2592061 one rotor radius above the ground (sanchez, k_b = 2): 14.709975 / 1.2592061 = 11.6819437 N
    out = tick(raptor, Setpoint((0.0, 0.0, -0.12)), hovering(-0.12), compensator=compensator(raptor, Sanchez(2.0)))
    assert out.thrust_n == raptor.weight_n
    assert out.memory.thrust_n == pytest.approx(raptor.weight_n)
    assert out.target.throttle == pytest.approx(0.1644 + 0.02394 * 11.6819437)


def test_drag_is_answered_by_leaning_into_it(raptor: Vehicle) -> None:
    # 2 m/s north, as wanted: drag is 1.5 * 0.4 * 2 = 1.2 N south; pitch = -atan(1.2 / 14.709975) = -4.66371 deg
    setpoint = Setpoint((NAN, NAN, NAN), velocity_ned_m_s=(2.0, 0.0, 0.0))
    out = tick(raptor, setpoint, hovering(-1.0, (2.0, 0.0, 0.0)), compensator=compensator(raptor, LinearDrag(0.4, 0.4)))
    assert math.degrees(euler_from_quaternion(out.target.attitude)[1]) == pytest.approx(-4.66371, abs=1e-5)


@given(
    acceleration=st.tuples(st.floats(-3.0, 3.0), st.floats(-3.0, 3.0), st.floats(-3.0, 3.0)),
    velocity=st.tuples(st.floats(-2.0, 2.0), st.floats(-2.0, 2.0), st.floats(-1.0, 1.0)),
    height_m=st.floats(0.06, 2.0),
    yaw=headings,
    tilts_deg=st.tuples(st.floats(-3.0, 3.0), st.floats(-3.0, 3.0)),
    factor=st.floats(0.85, 1.15),
    exponent=st.floats(1.8, 2.6),
    order=st.permutations(range(6)),
)
def test_a_world_that_is_as_modelled_gives_the_wanted_acceleration(
    raptor: Vehicle,
    acceleration: Vec3,
    velocity: Vec3,
    height_m: float,
    yaw: float,
    tilts_deg: tuple[float, float],
    factor: float,
    exponent: float,
    order: list[int],
) -> None:
    effects = (
        *(Exponential(), ConstantScale(factor), LinearDrag(0.3, 0.2, 0.1), AxialInflow(0.3), FixedTilt(*tilts_deg)),
        PowerCurve(exponent),
    )
    turned = compensator(raptor, *(effects[i] for i in order), band=0.9)
    setpoint = Setpoint((NAN, NAN, NAN), velocity, acceleration, yaw)
    state, memory = hovering(-height_m, velocity), Memory()
    for _ in range(60):  # until the vehicle has the attitude and the thrust that are asked of it
        out = tick(raptor, setpoint, state, memory=memory, compensator=turned)
        state, memory = hovering(-height_m, velocity, out.target.attitude), Memory(thrust_n=out.memory.thrust_n)
    nominal = [thrust_for_throttle(out.target.throttle, raptor) / 4.0] * 4
    c = conditions(raptor, height_m, rotate_inverse(state.attitude, velocity), state.attitude)
    assert turned.model.acceleration_ned(nominal, c) == pytest.approx(acceleration, abs=1e-6)


def test_canted_rotors_hover_too(raptor: Vehicle) -> None:
    # Six rotors, cant +-20 deg in turn: the sideways parts cancel, cos 20 deg = 0.9396926 of the thrust carries;
    # 14.709975 / 0.9396926 = 15.6540287 N.
    corners = [math.radians(30.0 + 60.0 * i) for i in range(6)]
    rotors = tuple(
        RotorPlace(position_m=(math.cos(a), math.sin(a), 0.0), spin="cw", cant_deg=(-1.0) ** i * 20.0)
        for i, a in enumerate(corners)
    )
    vehicle = raptor.model_copy(update={"rotors": rotors})
    out = tick(vehicle, Setpoint((0.0, 0.0, -1.0)), hovering())
    nominal_n = thrust_for_throttle(out.target.throttle, vehicle)
    assert nominal_n == pytest.approx(15.6540287)
    c = conditions(vehicle, 1.0, ORIGIN, LEVEL)
    assert Model(vehicle).acceleration_ned([nominal_n / 6.0] * 6, c) == pytest.approx((0.0, 0.0, 0.0), abs=1e-9)


@given(
    target=vectors,
    velocity=vectors,
    euler=st.tuples(headings, st.floats(-1.5, 1.5), headings),
    yaw=headings,
    drag=st.floats(0.0, 3.0),
    lift=st.floats(0.0, 3.0),
    thrust_n=st.floats(0.0, 40.0),
)
def test_limits_hold_whatever_happens(
    raptor: Vehicle, target: Vec3, velocity: Vec3, euler: Vec3, yaw: float, drag: float, lift: float, thrust_n: float
) -> None:
    settings = SETTINGS.model_copy(update={"min_throttle": 0.2, "max_throttle": 0.8})
    out = tick(
        raptor,
        Setpoint(target, yaw_rad=yaw),
        hovering(-0.5, velocity, quaternion_from_euler(*euler)),
        settings=settings,
        memory=Memory(thrust_n=thrust_n),
        compensator=compensator(raptor, LinearDrag(drag, drag, lift), Exponential(a=1.5)),
    )
    assert 0.2 <= out.target.throttle <= 0.8
    assert math.hypot(*out.target.attitude) == pytest.approx(1.0, abs=1e-9)
    assert math.degrees(tilt(out.target.attitude)) <= 35.0 + 1e-6


def test_compensation_may_not_lean_further_than_the_tilt_limit(raptor: Vehicle) -> None:
    # The velocity loop alone asks for 35 deg to the north; drag against 12 m/s would add 0.3 of the weight to it.
    setpoint = Setpoint((NAN, NAN, NAN), velocity_ned_m_s=(12.0, 0.0, 0.0))
    state = hovering(-1.0, (5.0, 0.0, 0.0))
    out = tick(raptor, setpoint, state, compensator=compensator(raptor, LinearDrag(3.0, 3.0)))
    assert math.degrees(tilt(out.target.attitude)) == pytest.approx(35.0)


def test_a_lift_that_carries_the_vehicle_does_not_turn_it_over(raptor: Vehicle) -> None:
    # Sinking fast, down is wanted at 7 m/s^2: 1.5 * 2.80665 = 4.21 N of thrust are left; drag along body z pushes
    # up with 4.41 N (its band). No thrust is the answer, not thrust downward.
    setpoint = Setpoint((NAN, NAN, NAN), velocity_ned_m_s=(0.0, 0.0, 1.0), acceleration_ned_m_s2=(0.0, 0.0, 60.0))
    state = hovering(-5.0, (0.0, 0.0, 8.0))
    out = tick(raptor, setpoint, state, compensator=compensator(raptor, LinearDrag(0.0, 0.0, 3.0)))
    assert out.acceleration_sp[2] == 7.0
    assert out.target.attitude == pytest.approx(LEVEL)
    assert out.memory.thrust_n == 0.0


def test_no_thrust_at_the_last_tick_is_no_thrust_to_the_effects(raptor: Vehicle) -> None:
    # A thrust axis leaning 5 deg pushes with thrust * sin 5; the rotors count for no less than a tenth of the weight.
    leaning = compensator(raptor, FixedTilt(roll_deg=5.0))
    for memory, felt_n in ((Memory(thrust_n=0.0), 0.1 * WEIGHT_N), (Memory(thrust_n=20.0), 20.0), (Memory(), WEIGHT_N)):
        out = tick(raptor, Setpoint(ORIGIN), hovering(), memory=memory, compensator=leaning)
        assert out.compensation.force_ned_n[1] == pytest.approx(math.sin(math.radians(5.0)) * felt_n)


def test_control_makes_no_compensator_of_its_own_at_every_tick() -> None:
    assert inspect.signature(control).parameters["compensator"].default is inspect.Parameter.empty


def test_gains_of_zero_leave_the_reference_alone(raptor: Vehicle) -> None:
    none = AxisGains(p=0.0, i=0.0, d=0.0)
    settings = SETTINGS.model_copy(update={"velocity_horizontal": none, "velocity_vertical": none})
    out = tick(raptor, Setpoint((5.0, 5.0, -5.0)), hovering(), settings=settings)
    assert out.thrust_n == raptor.weight_n
    assert out.target.attitude == pytest.approx(LEVEL)


# --- look-ahead, error of the acceleration, factor of thrust ---------------------------------------------------------


def test_damping_leaves_the_references_own_acceleration_alone(raptor: Vehicle) -> None:
    """All is as wanted: nothing is added to the feed-forward, of which the thesis' law takes off a fifth."""
    before = VelocityMemory(previous_velocity_m_s=(0.94, -0.3, 0.1), acceleration_m_s2=(0.0, 0.0, 0.0))
    on_velocity = before._replace(acceleration_m_s2=(3.0, 0.0, 0.0))
    wanted, now = (3.0, 0.0, 0.0), (1.0, -0.3, 0.1)
    error, memory = acceleration_setpoint(now, now, wanted, before, DT, DEFAULT, wanted)
    assert error == pytest.approx(wanted)
    assert memory.acceleration_m_s2 == pytest.approx(ORIGIN)
    assert acceleration_setpoint(now, now, wanted, on_velocity, DT, SETTINGS, wanted)[0][0] == pytest.approx(2.4)


def test_damping_acts_on_the_acceleration_that_is_not_wanted() -> None:
    # 0.7 m/s in one tick is 35 m/s^2, of which 5 are wanted: 2/7 of 30; D is 0.2 of these 8.571
    before = VelocityMemory(previous_velocity_m_s=ORIGIN)
    now = (0.7, 0.0, 0.0)
    out, memory = acceleration_setpoint(now, now, ORIGIN, before, DT, DEFAULT, (5.0, 0.0, 0.0))
    assert memory.acceleration_m_s2[0] == pytest.approx(60.0 / 7.0)
    assert out[0] == pytest.approx(-12.0 / 7.0)


def test_the_vertical_integral_is_a_factor_of_the_thrust_and_does_not_turn_it(raptor: Vehicle) -> None:
    """A vehicle 20 % heavier than its file: as an acceleration the integral would take a sixth of the lean away."""
    found = Memory(VelocityMemory(integral_m_s2=(0.0, 0.0, -0.2 * 9.80665)))
    setpoint = Setpoint((NAN, NAN, -1.0), acceleration_ned_m_s2=(2.0, 0.0, 0.0))
    lean_deg = math.degrees(math.atan2(2.0, 9.80665))
    factor, force = (
        tick(raptor, setpoint, hovering(), memory=found, settings=settings) for settings in (DEFAULT, SETTINGS)
    )
    assert math.degrees(tilt(factor.target.attitude)) == pytest.approx(lean_deg)
    assert math.degrees(tilt(force.target.attitude)) == pytest.approx(math.degrees(math.atan2(2.0, 1.2 * 9.80665)))
    assert factor.thrust_n == pytest.approx(1.2 * raptor.weight_n)
    assert factor.memory.thrust_n == pytest.approx(1.2 * raptor.weight_n)


def test_acceleration_and_drag_are_those_of_the_reference_ahead(raptor: Vehicle) -> None:
    here = Setpoint((0.0, 0.0, -1.0), (1.5, 0.0, 0.0), (2.0, 0.0, 0.4))
    ahead = Setpoint((0.375, 0.0, -1.0), (2.0, 0.0, 0.0), (3.0, 0.0, 0.8))
    state = hovering(-1.0, (1.5, 0.0, 0.0))
    out = tick(
        raptor,
        here,
        state,
        settings=DEFAULT,
        compensator=compensator(raptor, LinearDrag(0.4, 0.4)),
        preview=Preview(ahead, 0.25, 0.25),
    )
    assert out.acceleration_sp == pytest.approx((3.0, 0.0, 0.5))  # down: a quarter of the way from 0.4 to 0.8
    assert out.compensation.force_ned_n[0] == pytest.approx(-0.4 * 1.5 * 2.0)


def test_far_from_the_reference_effects_are_those_at_the_state(raptor: Vehicle) -> None:
    """A step of 1 m down that is still ahead: the ground effect there is not taken for that up here."""
    near_ground = Setpoint((0.0, 0.0, -0.2))
    ground = compensator(raptor, Sanchez(2.0))
    up_here = tick(raptor, Setpoint((0.0, 0.0, -1.2)), hovering(-1.2), settings=DEFAULT, compensator=ground)
    before = tick(
        raptor,
        Setpoint((0.0, 0.0, -1.2)),
        hovering(-1.2),
        settings=DEFAULT,
        compensator=ground,
        preview=Preview(near_ground, 0.2),
    )
    assert before.compensation == up_here.compensation


def test_the_ground_effect_is_that_of_the_place_not_of_the_reference(raptor: Vehicle) -> None:
    """The thrust follows at once: on the way down a step, the ground at its end is not yet felt."""
    ground, falling = compensator(raptor, Sanchez(2.0)), hovering(-0.35, (0.0, 0.0, 0.1))
    reference = Setpoint((0.0, 0.0, -0.2))
    out = tick(raptor, reference, falling, settings=DEFAULT, compensator=ground, preview=Preview(reference, 0.25))
    assert out.compensation.thrust_ratio == pytest.approx(ground(falling, 0.0, out.memory.thrust_n or 0.0).thrust_ratio)
    assert out.compensation.thrust_ratio < 0.99 * ground(hovering(-0.25), 0.0, WEIGHT_N).thrust_ratio


def responding(vehicle: Vehicle, lag_s: float) -> Vehicle:
    axis = AxisResponse(frequency_rad_s=2.0 / (lag_s - 0.05), delay_s=0.05)
    return vehicle.model_copy(update={"attitude_response": AttitudeResponse(roll=axis, pitch=axis)})


def test_it_looks_ahead_only_with_a_known_lag_and_a_known_drag(raptor: Vehicle) -> None:
    quick, drag = responding(raptor, 0.17), (StackedEffect(LinearDrag(0.4, 0.4)),)
    assert turn_lag_s(Model(quick, drag), DEFAULT) == pytest.approx(0.17)
    assert turn_lag_s(Model(raptor, drag), DEFAULT) is None
    assert turn_lag_s(Model(quick), DEFAULT) is None
    assert turn_lag_s(Model(quick, (StackedEffect(Sanchez(2.0)),)), DEFAULT) is None
    assert turn_lag_s(Model(raptor), FULL) == raptor.rotor.time_constant_s


def test_a_slow_link_lowers_the_gains_smoothly() -> None:
    """Kv 2 is made for 0.25 s: with 0.17 s of attitude the first 0.08 s of a link cost nothing."""
    shares = [eased(delay_s, 0.17, 0.04, DEFAULT).horizontal for delay_s in (0.0, 0.08, 0.16, 0.33)]
    assert shares == pytest.approx([1.0, 1.0, 0.25 / 0.33, 0.5])
    assert eased(0.16, None, 0.04, DEFAULT).horizontal == pytest.approx(0.25 / 0.41)
    assert eased(0.16, 0.17, 0.04, DEFAULT).vertical == pytest.approx(0.125 / 0.2)
    assert eased(0.33, 0.17, 0.04, SETTINGS) == FULL_GAINS
    late = Lags(age_s=0.1, way_s=0.1)
    assert smoothed(0.0, late, DT) == pytest.approx(0.002)
    assert smoothed(0.2, late, DT) == pytest.approx(0.2)


# --- full actuation --------------------------------------------------------------------------------------------------

TILTED = load_vehicle(ROOT / "config" / "vehicles" / "f550_tilted.yaml")
FULL = ControllerSettings(actuation="full")


def full_tick(acceleration: Vec3, state: VehicleState, *effects: Effect, yaw_rad: float = 0.0) -> ControlOutput:
    """One tick that wants this acceleration at the place and speed of `state`."""
    setpoint = Setpoint(state.position_ned_m, state.velocity_ned_m_s, acceleration, yaw_rad)
    return tick(TILTED, setpoint, state, settings=FULL, compensator=compensator(TILTED, *effects))


def given_force_n(target: AttitudeTarget) -> Vec3:
    """Force of the rotors, FRD, by the vehicle's throttle curve and the mix of its lateral throttle."""
    curve, n = TILTED.throttle, TILTED.n_rotors
    forward, right = target.lateral or (0.0, 0.0)
    outputs = [target.throttle + forward * x + right * y for x, y in TILTED.allocation.lateral_mix]
    return TILTED.rotor_force([(output - curve.offset) / (curve.per_newton * n) for output in outputs])


def test_full_actuation_pushes_to_the_side_with_the_attitude_level() -> None:
    # 1 m/s^2 east on 2.2 kg: 2.2 N, less than the reach of 2.866 N
    output = full_tick((0.0, 1.0, 0.0), hovering())
    assert output.target.attitude == pytest.approx(LEVEL)
    assert given_force_n(output.target) == pytest.approx((0.0, 2.2, -TILTED.weight_n), abs=1e-5)
    assert output.lateral_n == pytest.approx((0.0, 2.2))
    assert output.thrust_n == pytest.approx(TILTED.weight_n)


@given(heading=headings)
def test_full_actuation_keeps_the_yaw_that_is_set_and_turns_the_force_into_the_body(heading: float) -> None:
    state = hovering(attitude=quaternion_from_euler(0.0, 0.0, heading))
    output = full_tick((0.7, -0.3, 0.0), state, yaw_rad=heading)
    assert euler_from_quaternion(output.target.attitude) == pytest.approx((0.0, 0.0, heading), abs=1e-9)
    ned = rotate(state.attitude, given_force_n(output.target))
    assert ned == pytest.approx((0.7 * 2.2, -0.3 * 2.2, -TILTED.weight_n), abs=1e-5)


def test_beyond_the_reach_the_rest_is_made_by_leaning() -> None:
    # 3 m/s^2 east: 6.6 N on 21.575 N of weight, 17.01 deg. Of these 22.56 N the rotors hold 7.36 deg.
    output = full_tick((0.0, 3.0, 0.0), hovering())
    assert math.degrees(tilt(output.target.attitude)) == pytest.approx(17.01 - 7.36, abs=0.01)
    arrived = full_tick((0.0, 3.0, 0.0), hovering(attitude=output.target.attitude))
    ned = rotate(output.target.attitude, given_force_n(arrived.target))
    assert ned == pytest.approx((0.0, 6.6, -TILTED.weight_n), abs=1e-3)


@given(
    direction=headings,
    acceleration=st.floats(0.0, 6.0),
    climb=st.floats(-5.0, 6.0),
    change=st.tuples(*[st.floats(-0.01, 0.01)] * 3),
)
def test_the_attitude_never_jumps_as_the_demand_crosses_the_reach(
    direction: float, acceleration: float, climb: float, change: Vec3
) -> None:
    wanted = (acceleration * math.cos(direction), acceleration * math.sin(direction), -climb)
    changed = (wanted[0] + change[0], wanted[1] + change[1], wanted[2] + change[2])
    before = full_tick(wanted, hovering()).target
    after = full_tick(changed, hovering()).target
    turn = 2.0 * math.acos(min(1.0, abs(sum(a * b for a, b in zip(before.attitude, after.attitude, strict=True)))))
    assert math.degrees(turn) < 0.4
    assert after.lateral == pytest.approx(before.lateral, abs=0.005)


def test_the_ratio_of_an_effect_corrects_the_force_in_the_bodys_frame() -> None:
    effect = Exponential(a=0.2, b=2.0)
    state = hovering(down_m=-0.3)
    plain, corrected = full_tick((0.0, 1.0, 0.0), state), full_tick((0.0, 1.0, 0.0), state, effect)
    ratio = corrected.compensation.thrust_ratio
    assert ratio > 1.05
    fx, fy, fz = given_force_n(plain.target)
    assert given_force_n(corrected.target) == pytest.approx((fx / ratio, fy / ratio, fz / ratio))


def test_the_force_of_an_effect_goes_into_the_lateral_force_without_leaning() -> None:
    state = hovering(velocity=(2.0, 0.0, 0.0))
    output = full_tick(ORIGIN, state, LinearDrag(d_x=0.3))
    assert output.target.attitude == pytest.approx(LEVEL)
    assert given_force_n(output.target)[0] == pytest.approx(-output.compensation.force_ned_n[0])
    assert given_force_n(output.target)[0] > 0.3


def test_tilt_actuation_sends_no_lateral_force_whatever_the_rotors_could() -> None:
    setpoint = Setpoint((0.0, 0.5, -1.0))
    output = tick(TILTED, setpoint, hovering())
    assert output.target.lateral is None
    assert output.lateral_n is None
    assert tilt(output.target.attitude) > 0.05
