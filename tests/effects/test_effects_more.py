"""The further variants of the ground effect, and what the compensator makes of them.

RAPTOR: R = 0.12 m, d = 0.248 m, b = d sqrt(2), v_h = 5.807795 m/s, 1.5 kg. Hexarotor: R = 0.1194 m, d = 0.28 m, the
vehicle of Garofano-Soldado et al.
"""

import itertools
import math
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from quadctl.compensator import Compensator, CompensatorLimits, Unphysical, check_compensator
from quadctl.effects import CATALOG, Conditions, Effect, ThrustRatio, find_effect
from quadctl.effects.body_drag import QuadraticDrag
from quadctl.effects.ceiling_effect import MomentumCeiling
from quadctl.effects.centre_of_mass import FixedOffset
from quadctl.effects.ground_effect import (
    Cheeseman,
    CheesemanForward,
    Danjun,
    Kan,
    NearGround,
    Nobahari,
    Sanchez,
    Surface,
)
from quadctl.effects.ground_effect_hexarotor import Hexarotor, HexarotorTilted
from quadctl.effects.ground_effect_surfaces import Surfaces
from quadctl.effects.rate_damping import ProportionalDamping
from quadctl.effects.rotor_fault import UnequalRotors
from quadctl.effects.rotor_reaction import InertialReaction
from quadctl.effects.tether import HangingTether
from quadctl.effects.thrust_scale import ConstantScale
from quadctl.errors import SettingsError
from quadctl.frames import quaternion_from_euler, rotate, rotate_inverse
from quadctl.model import Model, StackedEffect
from quadctl.state import VehicleState
from quadctl.vehicle import Rotor, RotorPlace, Vehicle

LEVEL = (1.0, 0.0, 0.0, 0.0)
WEIGHT_N = 14.709975
RADIUS_M = 0.1194
"""Rotor radius of the hexarotor."""


def hexarotor(raptor: Vehicle, cant_deg: float = 0.0, dihedral_deg: float = 0.0) -> Vehicle:
    """Six rotors in a regular hexagon of side 0.28 m, canted to alternate sides."""
    places = tuple(
        RotorPlace(
            position_m=(0.28 * math.cos(i * math.pi / 3.0), 0.28 * math.sin(i * math.pi / 3.0), 0.0),
            spin="cw" if i % 2 else "ccw",
            cant_deg=-cant_deg if i % 2 else cant_deg,
            dihedral_deg=dihedral_deg,
        )
        for i in range(6)
    )
    rotor = Rotor(radius_m=RADIUS_M, thrust_n_per_rpm2=raptor.rotor.thrust_n_per_rpm2)
    return Vehicle(name="hexarotor", mass_kg=2.5, rotor=rotor, rotors=places, throttle=raptor.throttle)


def near_ground(z_m: Any, velocity: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Conditions:
    return Conditions(height_m=z_m, velocity_body_m_s=velocity, attitude=LEVEL)


# --- quadrotors ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("effect", "z_m", "velocity", "ratio"),
    [
        # 1 / (1 - (R/4z)^2 / (1 + (V/v_h)^2)), v_h^2 = 33.730481
        (CheesemanForward(), 0.12, (0.0, 0.0, 0.0), 1.0666667),  # hover, z = R: 16/15, as without forward speed
        # V^2 = 9 + 16 = 25: 1 + 25 / 33.730481 = 1.7411694; 0.0625 / 1.7411694 = 0.0358954; 1 / 0.9641046
        (CheesemanForward(), 0.12, (3.0, -4.0, 0.0), 1.0372319),
        (CheesemanForward(), 0.12, (3.0, -4.0, 9.0), 1.0372319),  # the climb rate does not count
        (CheesemanForward(), 0.12, (5.807795, 0.0, 0.0), 1.0322581),  # V = v_h halves the image: 1 / (1 - 1/32)
        # 1 / (1 - (2.5 R/4z)^2)
        (Nobahari(), 0.24, (0.0, 0.0, 0.0), 1.1082251),  # z = 2R: 0.3125^2 = 0.09765625; 1 / 0.90234375
        (Nobahari(), 0.12, (0.0, 0.0, 0.0), 1.6410256),  # z = R: 0.625^2 = 0.390625; 1 / 0.609375
        (Nobahari(), 0.06, (0.0, 0.0, 0.0), -1.7777778),  # below the pole: 1.25^2 = 1.5625; 1 / -0.5625
        # 1 / (1 - rho (R/4z)^2)
        (Danjun(), 0.12, (0.0, 0.0, 0.0), 1.2954417),  # 3.649 / 16 = 0.2280625; 1 / 0.7719375
        (Danjun(rho=1.0), 0.12, (0.0, 0.0, 0.0), 1.0666667),  # cheeseman
        (Danjun(rho=2.0), 0.06, (0.0, 0.0, 0.0), 2.0),  # z = R/2: 1 / (1 - 2/4)
        # sanchez with k_b + k_s
        (Surface(k_s=1.5491), 0.12, (0.0, 0.0, 0.0), 1.2592061),  # 0.4509 + 1.5491 = 2
        (Surface(), 0.12, (0.0, 0.0, 0.0), 1.1575390),  # k_b = 0.4509 alone
        (Surface(k_s=-3.0), 0.12, (0.0, 0.0, 0.0), 1.1309605),  # no fountain at all: it does not pull
        # (1 - 3R/25z) / (1 + (3V/50v_h)^3)
        (Kan(), 0.12, (0.0, 0.0, 0.0), 0.88),  # z = R: 1 - 0.12
        (Kan(), 0.01, (0.0, 0.0, 0.0), 0.76),  # evaluated at R/2: 1 - 0.24
        # z = 2R: 0.94; V = 50: 3 / 5.807795 = 0.5165472, ^3 = 0.1378257; 0.94 / 1.1378257
        (Kan(), 0.24, (30.0, 40.0, 0.0), 0.8261371),
    ],
)
def test_quadrotor_variants_by_hand(
    raptor: Vehicle, effect: ThrustRatio, z_m: float, velocity: tuple[float, float, float], ratio: float
) -> None:
    assert effect.ratio(near_ground(z_m, velocity), raptor) == pytest.approx(ratio, abs=2e-7)


@pytest.mark.parametrize("effect", [CheesemanForward(), Kan()])
@given(roll=st.floats(-1.0, 1.0), pitch=st.floats(-1.0, 1.0), yaw=st.floats(-3.0, 3.0))
def test_forward_speed_is_the_one_over_ground_whatever_the_attitude(
    raptor: Vehicle, effect: ThrustRatio, roll: float, pitch: float, yaw: float
) -> None:
    attitude = quaternion_from_euler(roll, pitch, yaw)
    tilted = Conditions(0.12, rotate_inverse(attitude, (3.0, -4.0, 2.0)), attitude)
    assert effect.ratio(tilted, raptor) == pytest.approx(effect.ratio(near_ground(0.12, (5.0, 0.0, 0.0)), raptor))


@given(slow=st.floats(0.0, 20.0), faster=st.floats(0.0, 20.0), z_m=st.floats(0.0, 3.0))
def test_forward_speed_takes_ground_effect_away(raptor: Vehicle, slow: float, faster: float, z_m: float) -> None:
    effect = CheesemanForward()
    low = effect.ratio(near_ground(z_m, (slow, 0.0, 0.0)), raptor)
    high = effect.ratio(near_ground(z_m, (slow + faster, 0.0, 0.0)), raptor)
    assert 1.0 < high <= low + 1e-12


def test_the_pole_of_nobahari_is_there_to_see(raptor: Vehicle) -> None:
    pole_m = 0.625 * 0.12
    assert Nobahari().ratio(near_ground(pole_m), raptor) == math.inf
    ratios = Nobahari().ratio(near_ground(np.array([0.0, pole_m, 0.12])), raptor)
    assert ratios == pytest.approx([-1.0 / 0.5625, math.inf, 1.0 / 0.609375])


@given(rho=st.floats(0.0, 3.9))
def test_danjun_has_no_pole_above_the_lowest_height(raptor: Vehicle, rho: float) -> None:
    assert 1.0 <= Danjun(rho).ratio(near_ground(0.0), raptor) <= 1.0 / (1.0 - 3.9 / 4.0) + 1e-9


@given(k_b=st.floats(0.0, 3.0), k_s=st.floats(0.0, 3.0), z_m=st.floats(0.0, 3.0))
def test_surface_is_sanchez_with_both_weights(raptor: Vehicle, k_b: float, k_s: float, z_m: float) -> None:
    c = near_ground(z_m)
    assert Surface(k_b, k_s).ratio(c, raptor) == Sanchez(k_b + k_s).ratio(c, raptor)


# --- hexarotors ----------------------------------------------------------------------------------------------------

# z = 0.1 m: R^2 z = 0.01425636 * 0.1 = 0.001425636; 4 z^2 = 0.04; d^2 = 0.0784
#   d^2/4  = 0.0196: 0.0596^1.5 = 0.01455021; 0.001425636 / 0.01455021 = 0.0979804
#   21d^2/4 = 0.4116: 0.4516^1.5 = 0.30348057; 0.000712818 / 0.30348057 = 0.0023488
#   13d^2/4 = 0.2548: 0.2948^1.5 = 0.16006311; 0.001425636 / 0.16006311 = 0.0089067
#   7d^2/4 = 0.1372: 0.1772^1.5 = 0.07459257; 0.000712818 / 0.07459257 = 0.0095561
#   S = 0.1187920; r_d = 0.56 - 0.22 = 0.34: 0.1556^1.5 = 0.06137824; F = 0.002851272 J_k / 0.06137824 = 0.0464541 J_k
IMAGES, FOUNTAIN = 0.1187920, 0.0464541


@pytest.mark.parametrize(
    ("effect", "z_m", "ratio"),
    [
        (Hexarotor(), 0.1, 1.0 / (1.0 - IMAGES - 2.2 * FOUNTAIN)),  # 1 / 0.7790090 = 1.2836822
        (Hexarotor(j_k=0.0), 0.1, 1.0 / (1.0 - IMAGES)),
        (Hexarotor(), 0.0, 1.2111),  # evaluated at 0.25 R
        (Hexarotor(), 0.25 * RADIUS_M, 1.2111),
        (Hexarotor(), 8.001 * RADIUS_M, 1.0),
    ],
)
def test_hexarotor_by_hand(raptor: Vehicle, effect: Hexarotor, z_m: float, ratio: float) -> None:
    tolerance = 1e-6 if ratio != 1.2111 else 5e-5
    assert effect.ratio(near_ground(z_m), hexarotor(raptor)) == pytest.approx(ratio, abs=tolerance)


def test_a_hexarotor_has_its_strongest_ground_effect_above_its_lowest_height(raptor: Vehicle) -> None:
    heights = np.linspace(0.25, 7.99, 775) * RADIUS_M  # 0.01 R apart
    ratios = Hexarotor().ratio(near_ground(heights), hexarotor(raptor))
    top = int(np.argmax(ratios))
    assert heights[top] / RADIUS_M == pytest.approx(0.58, abs=0.015)
    assert ratios[top] == pytest.approx(1.3049, abs=1e-4)
    assert (np.diff(ratios[:top]) > 0.0).all()
    assert (np.diff(ratios[top:]) < 0.0).all()
    assert ratios[-1] == pytest.approx(1.0138, abs=1e-4)  # which it loses at 8 R


@pytest.mark.parametrize(
    ("tilt_deg", "z_m", "ratio"),
    [
        # sin(30) cos(30) = 0.4330127; f_m = 0.216 + 0.4330127 (0.841 + 0.826) = 0.9378322
        (30.0, 0.1, 1.0 / (1.0 - 0.9378322 * IMAGES - 2.2 * FOUNTAIN)),
        # f_d = -0.0136 - 0.4330127 * 0.3845 = -0.1800934, f_r = 1.105 + 0.4330127 * 1.035 = 1.5531681
        (30.0, 2.75 * RADIUS_M, 1.5531681 - 2.75 * 0.1800934),
        # upright: f_m = 0.216; f_d = -0.0136, f_r = 1.105
        (0.0, 0.1, 1.0 / (1.0 - 0.216 * IMAGES - 2.2 * FOUNTAIN)),
        (0.0, 2.75 * RADIUS_M, 1.0676),
        # above 3 R, z = 0.5: R^2 z = 0.00712818; 1.0196^1.5 = 1.0295436, 1.4116^1.5 = 1.6771329,
        # 1.2548^1.5 = 1.4056001, 1.1372^1.5 = 1.2127053, r_d: 1.1156^1.5 = 1.1783187
        # S = 0.0069236 + 0.0021251 + 0.0050713 + 0.0029390 = 0.0170590, F = 0.031363992 / 1.1783189 = 0.0266176
        # f_n = 0.553 + 0.4330127 (-8.784 + 4.874) = -1.1400797: 1 / (1 + 0.0194485 - 0.0266176)
        (30.0, 0.5, 1.0072209),
        (0.0, 0.5, 1.0373995),  # f_n = 0.553: 1 / (1 - 0.0094336 - 0.0266176) = 1 / 0.9639488
        (30.0, 8.001 * RADIUS_M, 1.0),
    ],
)
def test_tilted_hexarotor_by_hand(raptor: Vehicle, tilt_deg: float, z_m: float, ratio: float) -> None:
    vehicle = hexarotor(raptor, tilt_deg, tilt_deg)
    assert HexarotorTilted().ratio(near_ground(z_m), vehicle) == pytest.approx(ratio, abs=2e-6)


@pytest.mark.parametrize(
    ("cant_deg", "dihedral_deg", "at_low_end", "at_high_begin", "at_8_radii"),
    [
        (0.0, 0.0, (1.0703, 1.0710), (1.0642, 1.0647), 1.0113),
        (20.0, 20.0, (1.0933, 1.0947), (1.0261, 1.0257), 1.0044),
        (30.0, 30.0, (1.1015, 1.1029), (1.0129, 1.0128), 1.0020),
        (30.0, 0.0, (1.0879, 1.0041), (0.9510, 1.1496), 1.0251),
        (0.0, 30.0, (1.0882, 1.1747), (1.1181, 0.9397), 0.9874),
    ],
)
def test_jumps_between_the_sections_are_those_of_the_docstring(
    raptor: Vehicle,
    cant_deg: float,
    dihedral_deg: float,
    at_low_end: tuple[float, float],
    at_high_begin: tuple[float, float],
    at_8_radii: float,
) -> None:
    vehicle = hexarotor(raptor, cant_deg, dihedral_deg)

    def beside(radii: float) -> tuple[float, float]:
        below, above = ((1.0 + side * 1e-9) * radii * RADIUS_M for side in (-1.0, 1.0))
        return tuple(HexarotorTilted().ratio(near_ground(z), vehicle) for z in (below, above))

    assert beside(2.5) == pytest.approx(at_low_end, abs=6e-5)
    assert beside(3.0) == pytest.approx(at_high_begin, abs=6e-5)
    assert beside(8.0) == pytest.approx((at_8_radii, 1.0), abs=6e-5)


@given(tilt_deg=st.floats(0.0, 30.0))
def test_sections_meet_where_cant_and_dihedral_are_equal(raptor: Vehicle, tilt_deg: float) -> None:
    vehicle = hexarotor(raptor, tilt_deg, tilt_deg)
    heights = np.arange(2.2, 3.3, 0.01) * RADIUS_M
    ratios = HexarotorTilted().ratio(near_ground(heights), vehicle)
    assert np.abs(np.diff(ratios)).max() < 0.004  # the steepest slope is 0.18 per R, the largest jump 0.0015


def test_which_variant_applies_to_which_vehicle(raptor: Vehicle) -> None:
    upright, tilted = hexarotor(raptor), hexarotor(raptor, 20.0, 20.0)
    assert [Hexarotor.applies_to(v) for v in (raptor, upright, tilted)] == [False, True, True]
    assert [HexarotorTilted.applies_to(v) for v in (raptor, upright, tilted)] == [False, False, True]
    assert all(kind.applies_to(raptor) for kind in (Cheeseman, CheesemanForward, Danjun, Surface, Nobahari, Kan))


@pytest.mark.parametrize("kind", [Hexarotor, HexarotorTilted])
@given(
    data=st.data(),
    heights=st.lists(st.floats(-0.1, 1.5), min_size=1, max_size=10),
    cant_deg=st.floats(-30.0, 30.0),
    dihedral_deg=st.floats(-30.0, 30.0),
)
def test_a_log_of_a_hexarotor_at_once_is_the_same_as_one_sample_at_a_time(
    raptor: Vehicle,
    kind: type[ThrustRatio],
    data: st.DataObject,
    heights: list[float],
    cant_deg: float,
    dihedral_deg: float,
) -> None:
    effect = kind(**{p.name: data.draw(st.floats(p.low, p.high)) for p in kind.parameters()})
    vehicle = hexarotor(raptor, cant_deg, dihedral_deg)
    ratios = effect.ratio(near_ground(np.array(heights)), vehicle)
    for height, ratio in zip(heights, ratios, strict=True):
        one = effect.ratio(near_ground(height), vehicle)
        assert type(one) is float, "no numpy numbers in the control loop"
        assert float(ratio) == pytest.approx(one, rel=1e-12)


# --- what they promise ---------------------------------------------------------------------------------------------

NEAR_GROUND = [kind for kind in CATALOG.values() if issubclass(kind, NearGround)]


@pytest.mark.parametrize("kind", NEAR_GROUND)
def test_a_missing_height_is_not_taken_for_a_height(raptor: Vehicle, kind: type[NearGround]) -> None:
    vehicle = hexarotor(raptor, 20.0, 20.0)
    assert math.isnan(kind().ratio(near_ground(math.nan), vehicle))
    assert np.isnan(kind().ratio(near_ground(np.array([math.nan, 1.0])), vehicle)).tolist() == [True, False]


@pytest.mark.parametrize(
    ("word", "name"),
    [
        ("cheeseman", "ground_effect.cheeseman"),
        ("cheeseman_forward", "ground_effect.cheeseman_forward"),
        ("hexarotor", "ground_effect.hexarotor"),
        ("hexarotor_tilted", "ground_effect.hexarotor_tilted"),
        ("ground_effect", "ground_effect.exponential"),
    ],
)
def test_short_names_keep_their_meaning(word: str, name: str) -> None:
    assert find_effect(word, "model.yaml").name == name


def test_what_the_lab_never_proposes() -> None:
    assert {kind for kind in CATALOG.values() if not kind.candidate} == {
        Surface,
        Surfaces,
        Nobahari,
        Kan,
        ProportionalDamping,
        InertialReaction,
        FixedOffset,
        UnequalRotors,
    }


# --- compensated ---------------------------------------------------------------------------------------------------


def stack(vehicle: Vehicle, *effects: Effect) -> Model:
    return Model(vehicle, tuple(StackedEffect(effect) for effect in effects))


@pytest.mark.parametrize("kind", [kind for kind in CATALOG.values() if issubclass(kind, ThrustRatio)])
@given(
    data=st.data(),
    height_m=st.floats(0.0, 2.5),
    velocity=st.tuples(*[st.floats(-8.0, 8.0)] * 3),
    euler=st.tuples(st.floats(-0.6, 0.6), st.floats(-0.6, 0.6), st.floats(-3.0, 3.0)),
    wanted_n=st.floats(5.0, 30.0),
)
def test_wanted_thrust_is_given_in_any_flight(
    raptor: Vehicle,
    kind: type[Effect],
    data: st.DataObject,
    height_m: float,
    velocity: tuple[float, float, float],
    euler: tuple[float, float, float],
    wanted_n: float,
) -> None:
    vehicle = hexarotor(raptor, 25.0, 25.0) if kind.__module__.endswith("hexarotor") else raptor
    n = vehicle.n_rotors
    effect = kind(**{p.name: data.draw(st.floats(p.low, p.high)) for p in kind.parameters()})
    model = stack(vehicle, effect, ConstantScale(0.9))
    attitude = quaternion_from_euler(*euler)
    state = VehicleState(
        time_s=1.0, position_ned_m=(0.0, 0.0, -height_m), velocity_ned_m_s=velocity, attitude=attitude, battery_v=15.0
    )
    ratio, *_ = Compensator(model, CompensatorLimits(band=0.9))(state, 0.0, wanted_n)
    c = Conditions(height_m, rotate_inverse(attitude, velocity), attitude, 1.0, 15.0)
    assume(0.11 < sum(model.rotor_thrust([1.0] * n, c)) / n < 1.89)  # within the band
    given_n = sum(model.rotor_thrust([wanted_n / ratio / n] * n, c))
    assert given_n == pytest.approx(wanted_n, rel=1e-12)


@given(
    effects=st.sets(st.sampled_from([QuadraticDrag(0.05, 0.03, 0.02), HangingTether(0.4, 0.3)]), min_size=1),
    height_m=st.floats(0.0, 5.0),
    velocity=st.tuples(*[st.floats(-3.0, 3.0)] * 3),
    euler=st.tuples(st.floats(-0.6, 0.6), st.floats(-0.6, 0.6), st.floats(-3.0, 3.0)),
)
def test_what_is_not_thrust_is_made_up_for_in_world_axes(
    raptor: Vehicle,
    effects: set[Effect],
    height_m: float,
    velocity: tuple[float, float, float],
    euler: tuple[float, float, float],
) -> None:
    model = stack(raptor, *effects)
    attitude = quaternion_from_euler(*euler)
    state = VehicleState(time_s=1.0, position_ned_m=(0.0, 0.0, -height_m), velocity_ned_m_s=velocity, attitude=attitude)
    ratio, force_ned_n, _ = Compensator(model)(state, 0.0, WEIGHT_N)
    c = Conditions(height_m, rotate_inverse(attitude, velocity), attitude)
    with_effects = rotate(attitude, model.body_force([WEIGHT_N / 4.0] * 4, c))
    without = rotate(attitude, Model(raptor).body_force([WEIGHT_N / 4.0] * 4, c))
    assert ratio == 1.0
    # Subtracted from what is wanted, it leaves just that.
    assert [a - f for a, f in zip(with_effects, force_ned_n, strict=True)] == pytest.approx(without, abs=1e-9)


# --- refused before the flight -------------------------------------------------------------------------------------


def test_kan_may_not_fly_however_high(raptor: Vehicle) -> None:
    with pytest.raises(SettingsError) as caught:
        check_compensator(stack(raptor, ConstantScale(1.1), Kan()), 0.5, 2.0, "kan.yaml")
    assert str(caught.value) == (
        "kan.yaml: ground_effect.kan cannot be compensated (as printed it takes thrust away near the ground, where "
        "there is more), expected a model without it: not safe to fly"
    )


@pytest.mark.parametrize("lowest_m", [0.01, 0.06, 0.074])
def test_nobahari_may_not_fly_as_low_as_its_pole(raptor: Vehicle, lowest_m: float) -> None:
    with pytest.raises(SettingsError, match=r"the thrust ratio is -.* expected a finite positive number"):
        check_compensator(stack(raptor, Nobahari()), lowest_m, 2.0, "model.yaml")


def test_a_flight_that_begins_at_the_pole_is_refused(raptor: Vehicle) -> None:
    with pytest.raises(SettingsError, match=r"the thrust ratio is inf at a rotor height of 0\.07 m"):
        check_compensator(stack(raptor, Nobahari()), 0.625 * 0.12, 2.0, "model.yaml")


@pytest.mark.parametrize(
    "effect", [CheesemanForward(), Danjun(), Surface(), Surface(k_s=2.0), MomentumCeiling(), Nobahari()]
)
def test_what_may_fly_is_not_warned_of(raptor: Vehicle, effect: Effect) -> None:
    assert check_compensator(stack(raptor, effect), 0.1, 2.5, "model.yaml") == []


def test_a_ceiling_does_not_hide_what_is_wrong_near_the_ground(raptor: Vehicle) -> None:
    sinking = HexarotorTilted()  # on a quadrotor without dihedral, its high section jumps up by 0.2 at 3 R
    canted = raptor.model_copy(update={"rotors": tuple(r.model_copy(update={"cant_deg": 30.0}) for r in raptor.rotors)})
    for effects in itertools.permutations([sinking, MomentumCeiling()]):
        warnings = check_compensator(stack(canted, *effects), 0.1, 2.5, "model.yaml")
        assert Unphysical.RISES in [warning.kind for warning in warnings]


def test_the_hexarotor_form_is_warned_of_only_where_it_rises(raptor: Vehicle) -> None:
    model = stack(hexarotor(raptor), Hexarotor())
    assert check_compensator(model, 0.6 * RADIUS_M, 2.0, "model.yaml") == []
    assert check_compensator(model, 0.25 * RADIUS_M, 2.0, "model.yaml")[0].kind is Unphysical.RISES
