"""A compensator turns its model round, within its limits; one that must not fly is refused."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from quadctl.compensator import NOTHING, Compensator, CompensatorLimits, Unphysical, check_compensator
from quadctl.effects import CATALOG, Conditions, Effect, ThrustRatio
from quadctl.effects.ground_effect import Cheeseman, Exponential, Hayden, Sanchez
from quadctl.effects.inflow import AxialInflow
from quadctl.effects.motor_lag import FirstOrderLag
from quadctl.effects.rotor_drag import LinearDrag
from quadctl.effects.rotor_fault import UnequalRotors, WeakRotor
from quadctl.effects.thrust_curve import PowerCurve
from quadctl.effects.thrust_scale import ConstantScale
from quadctl.effects.thrust_tilt import FixedTilt
from quadctl.effects.translational_lift import HorizontalLift
from quadctl.effects.wind import SteadyWind
from quadctl.errors import SettingsError
from quadctl.frames import quaternion_from_euler
from quadctl.model import Model, Provenance, StackedEffect
from quadctl.numeric import Number
from quadctl.state import Quat, Vec3, VehicleState
from quadctl.vehicle import Vehicle
from quadctl.words import Fact

LEVEL: Quat = (1.0, 0.0, 0.0, 0.0)
WEIGHT_N = 14.709975
THRUST_RATIOS = [kind for kind in CATALOG.values() if issubclass(kind, ThrustRatio)]


def state(down_m: float = -1.0, velocity: Vec3 = (0.0, 0.0, 0.0), attitude: Quat = LEVEL) -> VehicleState:
    return VehicleState(time_s=1.0, position_ned_m=(0.0, 0.0, down_m), velocity_ned_m_s=velocity, attitude=attitude)


def compensator(vehicle: Vehicle, *effects: Effect, band: float = 0.3, fade_m: float = 0.3) -> Compensator:
    stack = tuple(StackedEffect(effect) for effect in effects)
    return Compensator(Model(vehicle, stack), CompensatorLimits(band=band, fade_m=fade_m))


@dataclass(frozen=True)
class RatioOverHeight(ThrustRatio):
    """Any thrust ratio over height, also one that nature does not know."""

    name: ClassVar[str] = "test.ratio_over_height"
    depends_on: ClassVar[tuple[str, ...]] = ("height_over_radius",)

    of_height: Callable[[float], float]

    def ratio(self, c: Conditions, vehicle: Vehicle) -> Number:
        return self.of_height(c.height_m)


# --- inverse -------------------------------------------------------------------------------------------------------


def test_no_effects_is_no_compensation(raptor: Vehicle) -> None:
    assert compensator(raptor)(state(-0.1, (3.0, 0.0, 1.0)), 0.0, WEIGHT_N) == NOTHING
    assert NOTHING == (1.0, (0.0, 0.0, 0.0), 1.0)


def test_ratio_by_hand(raptor: Vehicle) -> None:
    # Cheeseman one rotor radius above the ground: 16/15; 10 % less thrust on top: 0.96.
    both = compensator(raptor, Cheeseman(), ConstantScale(0.9))
    assert both(state(-0.12), 0.0, WEIGHT_N).thrust_ratio == pytest.approx(0.96)


def test_height_is_that_of_the_rotor_plane_above_the_ground(raptor: Vehicle) -> None:
    # 2 R = 0.24 m: 64/63. The ground lies 0.5 m below the origin, the rotors 0.04 m above the logged position.
    vehicle = raptor.model_copy(update={"rotor_height_m": 0.04})
    assert compensator(vehicle, Cheeseman())(state(0.3), 0.5, WEIGHT_N).thrust_ratio == pytest.approx(64.0 / 63.0)


@pytest.mark.parametrize("kind", THRUST_RATIOS)
@given(
    data=st.data(),
    height_m=st.floats(0.0, 4.0),
    down_m_s=st.floats(-6.0, 6.0),
    wanted_n=st.floats(2.0, 35.0),
    scale=st.floats(0.8, 1.25),
)
def test_commanding_thrust_over_ratio_gives_the_wanted_thrust(
    raptor: Vehicle,
    kind: type[Effect],
    data: st.DataObject,
    height_m: float,
    down_m_s: float,
    wanted_n: float,
    scale: float,
) -> None:
    effect = kind(**{p.name: data.draw(st.floats(p.low, p.high)) for p in kind.parameters()})
    turned = compensator(raptor, effect, ConstantScale(scale), band=0.9)
    now = state(-height_m, (0.0, 0.0, down_m_s))
    ratio, *_ = turned(now, 0.0, wanted_n)
    c = Conditions(height_m, (0.0, 0.0, down_m_s), LEVEL, now.time_s, now.battery_v)
    assume(0.11 < sum(turned.model.rotor_thrust([1.0] * 4, c)) / 4.0 < 1.89)  # within the band
    given_n = turned.model.rotor_thrust([wanted_n / ratio / 4.0] * 4, c)
    assert sum(given_n) == pytest.approx(wanted_n, rel=1e-12)


@given(
    exponent=st.floats(1.8, 2.6),
    wanted_n=st.floats(2.0, 35.0),
    height_m=st.floats(0.03, 2.0),
    order=st.permutations(range(3)),
)
def test_a_bent_thrust_curve_gives_the_wanted_thrust_too(
    raptor: Vehicle, exponent: float, wanted_n: float, height_m: float, order: list[int]
) -> None:
    """The ratio is that of the thrust which is asked for in the end, whatever else acts before or after the bend."""
    effects = (PowerCurve(exponent), Cheeseman(), WeakRotor(0.2, rotor=2.0))
    turned = compensator(raptor, *(effects[i] for i in order), band=0.9)
    ratio, *_ = turned(state(-height_m), 0.0, wanted_n)
    given_n = turned.model.rotor_thrust([wanted_n / ratio / 4.0] * 4, Conditions(height_m, (0.0, 0.0, 0.0), LEVEL))
    assert sum(given_n) == pytest.approx(wanted_n, rel=1e-12)


def test_drag_is_pushed_against(raptor: Vehicle) -> None:
    # Heading east at 2 m/s east: forward speed 2, drag 1.5 * 0.4 * 2 = 1.2 N backward, which is west.
    heading_east: Quat = quaternion_from_euler(0.0, 0.0, math.pi / 2)
    _, force, _ = compensator(raptor, LinearDrag(0.4, 0.1))(state(-1.0, (0.0, 2.0, 0.0), heading_east), 0.0, WEIGHT_N)
    assert force == pytest.approx((0.0, -1.2, 0.0), abs=1e-12)


@pytest.mark.parametrize("order", [1, -1])
def test_a_force_stands_on_the_whole_thrust_whatever_the_order(raptor: Vehicle, order: int) -> None:
    # 12 N that the rotors are to give, 1.2 times what is asked, leaning 4 deg to the right: 12 sin 4 deg = 0.8370777 N
    effects = (FixedTilt(roll_deg=4.0), ConstantScale(1.2))[::order]
    ratio, force, _ = compensator(raptor, *effects)(state(), 0.0, 12.0)
    assert ratio == pytest.approx(1.2)
    assert force == pytest.approx((0.0, 0.8370777, 0.0292314), abs=1e-7)  # 12 (1 - cos 4 deg)


def test_in_a_wind_the_drag_is_that_of_the_air(raptor: Vehicle) -> None:
    # Hover, heading east, air to the north at 2 m/s: 1.5 * 0.4 * 2 = 1.2 N to the north, by the drag's coefficient
    # (d_y, as the air comes from the right) and not by the wind's own.
    heading_east: Quat = quaternion_from_euler(0.0, 0.0, math.pi / 2)
    wind = SteadyWind(2.0, 0.0, drag=0.3)
    for effects in ((wind, LinearDrag(0.1, 0.4)), (LinearDrag(0.1, 0.4), wind)):
        _, force, _ = compensator(raptor, *effects)(state(attitude=heading_east), 0.0, WEIGHT_N)
        assert force == pytest.approx((1.2, 0.0, 0.0), abs=1e-12)
    _, own, _ = compensator(raptor, wind)(state(attitude=heading_east), 0.0, WEIGHT_N)
    assert own == pytest.approx((0.9, 0.0, 0.0), abs=1e-12)  # 1.5 * 0.3 * 2


def test_in_a_wind_the_lift_is_that_of_the_air(raptor: Vehicle) -> None:
    # Hover in a wind of v_h = 5.807795 m/s: half of the gain.
    turned = compensator(raptor, HorizontalLift(0.3), SteadyWind(-5.807795, 0.0))
    assert turned(state(), 0.0, WEIGHT_N).thrust_ratio == pytest.approx(1.15, abs=1e-6)


def test_unequal_rotors_are_left_to_the_rate_controller(raptor: Vehicle) -> None:
    unequal = compensator(raptor, UnequalRotors.of({1: 0.93, 2: 1.04, 4: 1.05}))
    assert unequal(state(), 0.0, 1.2 * WEIGHT_N) == (pytest.approx(1.0), (0, 0, 0), 1.0)


def test_a_weak_rotor_is_made_up_for_by_all(raptor: Vehicle) -> None:
    # One of four gives 20 % less: 95 % of the whole.
    assert compensator(raptor, WeakRotor(0.2, rotor=2.0))(state(), 0.0, WEIGHT_N) == (
        pytest.approx(0.95),
        (0, 0, 0),
        1.0,
    )


def test_a_lag_cannot_be_turned_round_and_is_left_alone(raptor: Vehicle) -> None:
    assert compensator(raptor, FirstOrderLag(0.3))(state(), 0.0, 20.0) == NOTHING


# --- limits --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("factor", "band", "ratio"), [(2.0, 0.3, 1.3), (0.5, 0.3, 0.7), (1.2, 0.3, 1.2), (1.2, 0.1, 1.1)]
)
def test_thrust_correction_stays_in_its_band(raptor: Vehicle, factor: float, band: float, ratio: float) -> None:
    turned = compensator(raptor, ConstantScale(factor), band=band)
    assert turned(state(), 0.0, WEIGHT_N).thrust_ratio == pytest.approx(ratio)


def test_the_band_holds_for_the_stack_and_not_for_each_effect(raptor: Vehicle) -> None:
    turned = compensator(raptor, ConstantScale(1.2), ConstantScale(1.2))  # 1.44
    assert turned(state(), 0.0, WEIGHT_N).thrust_ratio == pytest.approx(1.3)


def test_side_force_stays_in_its_band(raptor: Vehicle) -> None:
    # Drag at 10 m/s: 1.5 * 3 * 10 = 45 N; the band is 0.3 * 14.709975 = 4.4129925 N, in the same direction.
    _, force, _ = compensator(raptor, LinearDrag(3.0, 3.0))(state(-1.0, (6.0, -8.0, 0.0)), 0.0, WEIGHT_N)
    assert force == pytest.approx((-0.6 * 4.4129925, 0.8 * 4.4129925, 0.0))


@pytest.mark.parametrize(
    ("height_m", "trust"),
    [
        (0.5, 1.0),
        (0.2, 1.0),
        (1.0, 1.0),
        (1.1, 2.0 / 3.0),  # 0.1 m of 0.3 m outside
        (1.15, 0.5),
        (1.3, 0.0),
        (2.0, 0.0),
        (0.05, 0.5),  # below what was flown it is not trusted either
    ],
)
def test_correction_fades_beyond_the_heights_of_the_fit(raptor: Vehicle, height_m: float, trust: float) -> None:
    gain = RatioOverHeight(lambda z: 1.2)
    model = Model(raptor, (StackedEffect(gain, Provenance(height_m=(0.2, 1.0))),))
    turned = Compensator(model, CompensatorLimits(fade_m=0.3))
    assert turned(state(-height_m), 0.0, WEIGHT_N).thrust_ratio == pytest.approx(1.0 + 0.2 * trust)


def test_what_does_not_depend_on_height_does_not_fade_with_it(raptor: Vehicle) -> None:
    model = Model(raptor).plus(ConstantScale(1.1), Provenance(height_m=(0.2, 1.0)))
    assert Compensator(model)(state(-5.0), 0.0, WEIGHT_N).thrust_ratio == pytest.approx(1.1)


def test_an_effect_from_a_book_is_trusted_at_all_heights(raptor: Vehicle) -> None:
    assert compensator(raptor, Hayden())(state(-100.0), 0.0, WEIGHT_N).thrust_ratio == pytest.approx(
        0.9950606, abs=1e-6
    )


@dataclass(frozen=True)
class Nothing(ThrustRatio):
    name: ClassVar[str] = "nothing.at_all"
    depends_on: ClassVar[tuple[str, ...]] = ()

    def ratio(self, c: Conditions, vehicle: Vehicle) -> Number:
        return 0.0


def test_what_would_leave_no_thrust_at_all_is_corrected_by_the_band(raptor: Vehicle) -> None:
    """A form far beyond its heights gives 0: what follows it in the stack has a thrust of nothing to change."""
    for stack in ((Nothing(), ConstantScale(1.1)), (ConstantScale(1.1), Nothing()), (Nothing(), PowerCurve(1.6))):
        assert compensator(raptor, *stack)(state(), 0.0, 0.8 * WEIGHT_N).thrust_ratio == pytest.approx(0.7)


@given(
    effects=st.lists(st.sampled_from(list(CATALOG.values())), max_size=5),
    data=st.data(),
    height_m=st.floats(-0.5, 100.0),
    velocity=st.tuples(st.floats(-30.0, 30.0), st.floats(-30.0, 30.0), st.floats(-30.0, 30.0)),
    euler=st.tuples(st.floats(-3.0, 3.0), st.floats(-1.5, 1.5), st.floats(-3.0, 3.0)),
    thrust_n=st.floats(0.0, 40.0),
)
def test_whatever_the_model_the_correction_is_bounded(
    raptor: Vehicle,
    effects: list[type[Effect]],
    data: st.DataObject,
    height_m: float,
    velocity: Vec3,
    euler: Vec3,
    thrust_n: float,
) -> None:
    stack = [kind(**{p.name: data.draw(st.floats(p.low, p.high)) for p in kind.parameters()}) for kind in effects]
    now = state(-height_m, velocity, quaternion_from_euler(*euler))
    ratio, force, _ = compensator(raptor, *stack)(now, 0.0, thrust_n)
    assert 0.7 <= ratio <= 1.3
    assert math.hypot(*force) <= 0.3 * WEIGHT_N + 1e-9


# --- refused before the flight -------------------------------------------------------------------------------------

RADIUS_M = 0.12


def check(vehicle: Vehicle, of_height: Callable[[float], float], lowest_m: float = 0.02) -> list[Fact]:
    return check_compensator(Model(vehicle, (StackedEffect(RatioOverHeight(of_height)),)), lowest_m, 2.0, "model.yaml")


@pytest.mark.parametrize(
    "of_height",
    [
        lambda z: 1.0 / (1.0 - (RADIUS_M / (4.0 * z)) ** 2),  # Cheeseman without a floor: pole at R/4 = 0.03 m
        lambda z: 1.0 / (1.0 - (2.5 * RADIUS_M / (4.0 * z)) ** 2),  # Nobahari: pole at 0.075 m
        lambda z: 1.0 - 0.2 / z,  # negative below 0.2 m
        lambda z: z - 0.02,  # zero at the lowest height
        lambda z: 1.0 / (z - 0.02),  # divides by zero there
        lambda z: math.exp(20.0 / z),  # too large for a number
        lambda z: math.sqrt(z - 0.5),  # not defined below 0.5 m
        lambda z: math.inf if z < 0.1 else 1.0,
        lambda z: math.nan,
    ],
)
def test_a_ratio_that_is_not_finite_and_positive_must_not_fly(
    raptor: Vehicle, of_height: Callable[[float], float]
) -> None:
    with pytest.raises(SettingsError) as caught:
        check(raptor, of_height)
    said = str(caught.value)
    assert said.startswith("model.yaml: the thrust ratio is ")
    assert "at a rotor height of 0.0" in said
    assert said.endswith("expected a finite positive number from 0.02 to 2 m: not safe to fly")


def test_a_pole_below_the_flight_is_no_matter(raptor: Vehicle) -> None:
    assert check(raptor, lambda z: 1.0 / (1.0 - (RADIUS_M / (4.0 * z)) ** 2), lowest_m=0.05) == []


def test_less_thrust_near_the_ground_is_warned_of(raptor: Vehicle) -> None:
    # Kan as the thesis prints it, in hover: 1 - 3R / 25z.
    warnings = check(raptor, lambda z: 1.0 - 3.0 * RADIUS_M / (25.0 * z))
    assert [warning.kind for warning in warnings] == [Unphysical.RISES, Unphysical.LOWER_NEAR_GROUND]


def test_a_bump_is_warned_of(raptor: Vehicle) -> None:
    warnings = check(raptor, lambda z: 1.0 + 0.1 * math.exp(-3.0 * z) + 0.1 * math.exp(-(((z - 1.0) / 0.1) ** 2)))
    assert [warning.kind for warning in warnings] == [Unphysical.RISES]


@pytest.mark.parametrize(
    "effects",
    [
        (),
        (Cheeseman(),),
        (Hayden(),),
        (Sanchez(),),
        (Exponential(),),
        (Exponential(), ConstantScale(0.9), LinearDrag(), AxialInflow(), FixedTilt(2.0, 2.0)),
    ],
)
def test_physical_compensators_may_fly(raptor: Vehicle, effects: tuple[Effect, ...]) -> None:
    model = Model(raptor, tuple(StackedEffect(effect) for effect in effects))
    assert check_compensator(model, 0.0, 3.0, "model.yaml") == []
