"""Every formula against values worked out by hand for the RAPTOR.

R = 0.12 m, d = 0.248 m, b = d sqrt(2), v_h = 5.807795 m/s, m = 1.5 kg.
"""

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from quadctl.effects import CATALOG, Conditions, Effect, ThrustRatio, find_effect
from quadctl.effects.base import VARIABLES
from quadctl.effects.body_drag import QuadraticDrag
from quadctl.effects.ceiling_effect import MomentumCeiling
from quadctl.effects.ground_effect import Cheeseman, Exponential, GroundEffect, Hayden, Sanchez
from quadctl.effects.inflow import AxialInflow
from quadctl.effects.rotor_drag import LinearDrag
from quadctl.effects.tether import HangingTether
from quadctl.effects.thrust_scale import ConstantScale
from quadctl.effects.thrust_tilt import FixedTilt
from quadctl.errors import SettingsError
from quadctl.frames import quaternion_from_euler, rotate
from quadctl.vehicle import Vehicle
from tests.support.places import ROOT

LEVEL = (1.0, 0.0, 0.0, 0.0)
GROUND_EFFECTS = [kind for kind in CATALOG.values() if issubclass(kind, GroundEffect)]


def at_height(z_m: Any) -> Conditions:
    return Conditions(height_m=z_m, velocity_body_m_s=(0.0, 0.0, 0.0), attitude=LEVEL)


def at_velocity(forward: float, right: float, down: float) -> Conditions:
    return Conditions(height_m=1.0, velocity_body_m_s=(forward, right, down), attitude=LEVEL)


def any_effect(kind: type[Effect]) -> st.SearchStrategy[Effect]:
    """Effects of this kind with any parameters within their bounds."""
    return st.builds(kind, **{p.name: st.floats(p.low, p.high) for p in kind.parameters()})


# --- ground effect -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("effect", "z_m", "ratio"),
    [
        # 1 / (1 - (R/4z)^2)
        (Cheeseman(), 0.24, 1.0158730),  # z = 2R: R/4z = 1/8, 1 / (1 - 1/64) = 64/63
        (Cheeseman(), 0.12, 1.0666667),  # z = R: 1 / (1 - 1/16) = 16/15
        (Cheeseman(), 0.06, 1.3333333),  # z = R/2: 1 / (1 - 1/4) = 4/3
        # (0.9926 + 0.03794 / (z/2R)^2)^(2/3)
        (Hayden(), 0.24, 1.0202577),  # z = 2R: 1.03054^(2/3); ln = 0.0300829, * 2/3 = 0.0200552
        (Hayden(), 0.12, 1.0940616),  # z = R: (0.9926 + 4 * 0.03794)^(2/3) = 1.14436^(2/3)
        (Hayden(), 1e3, 0.9950606),  # 0.9926^(2/3)
        # 1 / (1 - own - neighbours - opposite - fountain), z = R = 0.12: R^2 z = 0.0144 * 0.12 = 0.001728,
        # d^2 + 4z^2 = 0.061504 + 0.0576 = 0.119104, ^1.5 = 0.04110451
        # 2d^2 + 4z^2 = b^2 + 4z^2 = 0.123008 + 0.0576 = 0.180608, ^1.5 = 0.07675479
        # own = (1/4)^2 = 0.0625, neighbours = 0.001728 / 0.04110451 = 0.04203918,
        # opposite = 0.000864 / 0.07675479 = 0.01125663, fountain = 2 * 0.001728 k_b / 0.07675479 = 0.04502651 k_b
        # k_b = 2: 1 / (1 - 0.0625 - 0.04203918 - 0.01125663 - 0.09005301) = 1 / 0.79415118
        (Sanchez(k_b=2.0), 0.12, 1.2592061),
        # k_b = 0.4509: fountain = 0.02030245, 1 / 0.86390174
        (Sanchez(k_b=0.4509), 0.12, 1.1575390),
        # k_b = 0: no fountain: 1 / 0.88420419
        (Sanchez(k_b=0.0), 0.12, 1.1309605),
        # z = 2R = 0.24: R^2 z = 0.003456; 0.061504 + 0.2304 = 0.291904, ^1.5 = 0.15771030; 0.353408^1.5 = 0.21009444
        # own = 1/64 = 0.015625, neighbours = 0.02191360, opposite = 0.00822487, fountain = 0.06579898
        # 1 / (1 - 0.11156245) = 1 / 0.88843755
        (Sanchez(k_b=2.0), 0.24, 1.1255715),
        # c + a exp(-b z): exp(-0.5388) = 0.5834480; 0.114 * 0.5834480 = 0.0665131
        (Exponential(a=0.114, b=5.388), 0.1, 1.0665131),
        (Exponential(a=0.114, b=5.388, c=1.028), 0.1, 1.0945131),  # as the thesis fits it
        (Exponential(a=0.0), 0.1, 1.0),
    ],
)
def test_ground_effect_by_hand(raptor: Vehicle, effect: GroundEffect, z_m: float, ratio: float) -> None:
    assert effect.ratio(at_height(z_m), raptor) == pytest.approx(ratio, abs=1e-7)


@pytest.mark.parametrize("kind", GROUND_EFFECTS)
def test_near_the_ground_there_is_more_thrust(raptor: Vehicle, kind: type[GroundEffect]) -> None:
    for z_m in (-0.1, 0.0, 0.06, 0.12, 0.24, 0.48):  # up to 4 R
        assert kind().ratio(at_height(z_m), raptor) > 1.0


@pytest.mark.parametrize("kind", GROUND_EFFECTS)
def test_far_away_there_is_none(raptor: Vehicle, kind: type[GroundEffect]) -> None:
    far = 0.9950606 if kind is Hayden else 1.0  # Hayden's fit tends to 0.9926^(2/3)
    assert kind().ratio(at_height(50.0), raptor) == pytest.approx(far, abs=1e-5)


@pytest.mark.parametrize("kind", GROUND_EFFECTS)
@given(data=st.data(), z_m=st.floats(0.0, 5.0), higher_m=st.floats(0.0, 5.0))
def test_it_never_grows_with_height(
    raptor: Vehicle, kind: type[GroundEffect], data: st.DataObject, z_m: float, higher_m: float
) -> None:
    effect = data.draw(any_effect(kind))
    assert isinstance(effect, GroundEffect)
    low, high = effect.ratio(at_height(z_m), raptor), effect.ratio(at_height(z_m + higher_m), raptor)
    assert high <= low + 1e-12


@pytest.mark.parametrize("kind", GROUND_EFFECTS)
def test_poles_are_out_of_reach(raptor: Vehicle, kind: type[GroundEffect]) -> None:
    # Cheeseman's pole is at z = R/4; all forms are evaluated no lower than R/2 = 0.06 m.
    lowest = kind().ratio(at_height(0.06), raptor)
    assert kind().ratio(at_height(0.03), raptor) == lowest
    assert kind().ratio(at_height(-1.0), raptor) == lowest
    assert kind().ratio(at_height(0.061), raptor) < lowest


def test_a_missing_height_is_not_taken_for_the_ground(raptor: Vehicle) -> None:
    assert np.isnan(Cheeseman().ratio(at_height(float("nan")), raptor))


# --- other thrust ratios -------------------------------------------------------------------------------------------


def test_thrust_scale_is_its_factor(raptor: Vehicle) -> None:
    assert ConstantScale(factor=0.93).ratio(at_height(1.0), raptor) == 0.93
    assert ConstantScale().ratio(at_height(1.0), raptor) == 1.0


@pytest.mark.parametrize(
    ("k", "down_m_s", "ratio"),
    [
        (0.3, 0.0, 1.0),
        (0.3, -1.0, 0.9483453),  # climbing at 1 m/s: 1 - 0.3 / 5.807795 = 1 - 0.0516547
        (0.3, 2.0, 1.1033094),  # sinking at 2 m/s: 1 + 0.6 / 5.807795
        (1.0, -2.0, 0.6556352),  # 1 - 2 / 5.807795
        (1.0, -20.0, 0.5),  # the linear law is cut at one half
        (1.0, 20.0, 1.5),
    ],
)
def test_inflow_by_hand(raptor: Vehicle, k: float, down_m_s: float, ratio: float) -> None:
    assert AxialInflow(k=k).ratio(at_velocity(3.0, -2.0, down_m_s), raptor) == pytest.approx(ratio, abs=1e-7)


@pytest.mark.parametrize("kind", [kind for kind in CATALOG.values() if issubclass(kind, ThrustRatio)])
def test_a_thrust_ratio_acts_on_every_rotor_and_adds_no_force(raptor: Vehicle, kind: type[ThrustRatio]) -> None:
    effect, c = kind(), Conditions(0.1, (1.0, 2.0, -0.5), LEVEL)
    ratio = effect.ratio(c, raptor)
    assert list(effect.rotor_thrust([1.0, 2.0, 3.0, 4.0], c, raptor)) == pytest.approx(
        [ratio, 2.0 * ratio, 3.0 * ratio, 4.0 * ratio]
    )
    assert effect.force(10.0, c, raptor) == (0.0, 0.0, 0.0)


# --- forces --------------------------------------------------------------------------------------------------------


def test_rotor_drag_by_hand(raptor: Vehicle) -> None:
    # F = -m D v: -1.5 * 0.3 * 2 = -0.9; -1.5 * 0.5 * (-1) = 0.75; -1.5 * 0.1 * 4 = -0.6
    effect = LinearDrag(d_x=0.3, d_y=0.5, d_z=0.1)
    assert effect.force(14.7, at_velocity(2.0, -1.0, 4.0), raptor) == pytest.approx((-0.9, 0.75, -0.6))


def test_rotor_drag_leaves_the_vertical_to_inflow_unless_asked(raptor: Vehicle) -> None:
    assert LinearDrag().force(14.7, at_velocity(0.0, 0.0, 4.0), raptor) == pytest.approx((0.0, 0.0, 0.0))


@pytest.mark.parametrize(
    ("roll_deg", "pitch_deg", "force_n"),
    [
        # 10 N along R_y(pitch) R_x(roll) (0, 0, -1) = (-cos r sin p, sin r, -cos r cos p), less the upright 10 N
        (2.0, 0.0, (0.0, 0.3489950, 0.0060917)),  # 10 sin 2 deg; 10 (1 - cos 2 deg): leans right
        (0.0, 3.0, (-0.5233596, 0.0, 0.0137047)),  # -10 sin 3 deg; 10 (1 - cos 3 deg): leans backward
        # cos 2 = 0.99939083, sin 3 = 0.05233596, cos 3 = 0.99862953
        (2.0, 3.0, (-0.5230407, 0.3489950, 0.0197880)),
        (-2.0, -3.0, (0.5230407, -0.3489950, 0.0197880)),
    ],
)
def test_thrust_tilt_by_hand(
    raptor: Vehicle, roll_deg: float, pitch_deg: float, force_n: tuple[float, float, float]
) -> None:
    effect = FixedTilt(roll_deg=roll_deg, pitch_deg=pitch_deg)
    assert effect.force(10.0, at_height(1.0), raptor) == pytest.approx(force_n, abs=1e-7)


@given(roll_deg=st.floats(-8.0, 8.0), pitch_deg=st.floats(-8.0, 8.0))
def test_thrust_tilt_turns_the_thrust_as_an_attitude_would(raptor: Vehicle, roll_deg: float, pitch_deg: float) -> None:
    fx, fy, fz = FixedTilt(roll_deg=roll_deg, pitch_deg=pitch_deg).force(10.0, at_height(1.0), raptor)
    turned = rotate(quaternion_from_euler(np.radians(roll_deg), np.radians(pitch_deg), 0.0), (0.0, 0.0, -10.0))
    assert (fx, fy, fz - 10.0) == pytest.approx(turned, abs=1e-9)


# --- what all effects promise --------------------------------------------------------------------------------------

finite = st.floats(-20.0, 20.0)
SAMPLES = st.lists(st.tuples(st.floats(0.0, 5.0), finite, finite, finite, st.floats(0.0, 20.0)), min_size=1, max_size=8)


@pytest.mark.parametrize("kind", list(CATALOG.values()))
@given(data=st.data(), samples=SAMPLES)
def test_one_log_at_once_is_the_same_as_one_sample_at_a_time(
    raptor: Vehicle, kind: type[Effect], data: st.DataObject, samples: list[tuple[float, ...]]
) -> None:
    effect = data.draw(any_effect(kind))
    z, u, v, w, thrust = (np.array(column) for column in zip(*samples, strict=True))
    ones, zeros = np.ones(len(samples)), np.zeros(len(samples))
    log = Conditions(z, (u, v, w), (ones, zeros, zeros, zeros))
    thrusts = [thrust, 2.0 * thrust, 3.0 * thrust, 4.0 * thrust]
    log_thrusts = [np.broadcast_to(t, z.shape) for t in effect.rotor_thrust(thrusts, log, raptor)]
    log_force = [np.broadcast_to(f, z.shape) for f in effect.force(10.0 * thrust, log, raptor)]
    for i, (zi, ui, vi, wi, ti) in enumerate(samples):
        c = Conditions(zi, (ui, vi, wi), LEVEL)
        one = effect.rotor_thrust([ti, 2.0 * ti, 3.0 * ti, 4.0 * ti], c, raptor)
        force = effect.force(10.0 * ti, c, raptor)
        assert all(type(number) is float for number in (*one, *force)), "no numpy numbers in the control loop"
        assert [float(t[i]) for t in log_thrusts] == pytest.approx(list(one), rel=1e-12, abs=1e-300)
        assert [float(f[i]) for f in log_force] == pytest.approx(list(force), rel=1e-12, abs=1e-300)


@pytest.mark.parametrize("kind", list(CATALOG.values()))
@given(data=st.data())
def test_values_of_a_file_make_the_same_effect(kind: type[Effect], data: st.DataObject) -> None:
    effect = data.draw(any_effect(kind))
    assert kind.from_values(effect.values(), "model.yaml") == effect


@pytest.mark.parametrize("kind", [kind for kind in CATALOG.values() if kind.parameters()])
@given(data=st.data())
def test_values_out_of_bounds_are_refused(kind: type[Effect], data: st.DataObject) -> None:
    parameter = data.draw(st.sampled_from(kind.parameters()))
    value = data.draw(
        st.floats(max_value=parameter.low, exclude_max=True)
        | st.floats(min_value=parameter.high, exclude_min=True)
        | st.just(float("nan"))
    )
    with pytest.raises(SettingsError, match=f"parameter {parameter.name} of {kind.name} is"):
        kind.from_values({parameter.name: value}, "model.yaml")


@pytest.mark.parametrize("kind", list(CATALOG.values()))
def test_an_effect_declares_itself(kind: type[Effect]) -> None:
    family, variant = kind.name.split(".")
    assert kind.family() == family
    assert CATALOG[kind.name] is kind
    assert find_effect(variant, "model.yaml") is kind
    assert all((kind.source, kind.physics, kind.distinguished_by, kind.mission))
    assert set(kind.depends_on) <= set(VARIABLES)
    assert (ROOT / kind.mission).is_file()
    for p in kind.parameters():
        assert p.low <= p.default <= p.high
        assert p.low < p.high
        assert p.meaning


def test_a_family_stands_for_its_first_variant() -> None:
    assert find_effect("ground_effect", "model.yaml") is Exponential
    assert find_effect("rotor_drag", "model.yaml") is LinearDrag


def test_parameters_not_named_keep_their_default() -> None:
    assert Exponential.from_values({"a": 0.2}, "model.yaml") == Exponential(a=0.2, b=5.388, c=1.0)


# --- ceiling, body drag, tether ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("gain", "z_m", "ratio"),
    [
        # The ceiling is at 2.6 m, R = 0.12 m: K = 1/2 + 1/2 sqrt(1 + gain / 8 (R/D)^2)
        (1.0, 2.48, 1.0303301),  # D = R: sqrt(1 + 1/8) = 1.0606602
        (1.0, 2.54, 1.1123724),  # D = R/2: sqrt(1 + 4/8) = 1.2247449
        (4.0, 2.54, 1.3660254),  # sqrt(1 + 4 * 4/8) = sqrt(3) = 1.7320508
        (0.0, 2.54, 1.0),
        (1.0, 2.60, 1.5155048),  # never nearer than R/5: sqrt(1 + 25/8) = 2.0310096
    ],
)
def test_ceiling_effect(raptor: Vehicle, gain: float, z_m: float, ratio: float) -> None:
    assert MomentumCeiling(gain).ratio(at_height(z_m), raptor) == pytest.approx(ratio, abs=1e-7)


def test_without_a_ceiling_there_is_no_ceiling_effect(raptor: Vehicle) -> None:
    outdoors = raptor.model_copy(update={"ceiling_m": None})
    assert MomentumCeiling.applies_to(raptor)
    assert not MomentumCeiling.applies_to(outdoors)
    assert MomentumCeiling(5.0).ratio(at_height(2.5), outdoors) == 1.0


def test_body_drag_grows_with_the_square_of_the_speed_and_points_against_it(raptor: Vehicle) -> None:
    drag = QuadraticDrag(area_x_m2=0.02, area_y_m2=0.04, area_z_m2=0.06)
    # 1/2 * 1.205 * 0.02 * 4 = 0.0482 N at 2 m/s forward
    assert drag.force(15.0, at_velocity(2.0, 0.0, 0.0), raptor) == pytest.approx((-0.0482, 0.0, 0.0))
    assert drag.force(15.0, at_velocity(4.0, 0.0, 0.0), raptor) == pytest.approx((-0.1928, 0.0, 0.0))
    # |v| = 5: -1/2 * 1.205 * 5 * (0.02 * 3, 0.04 * -4, 0) = (-0.18075, 0.482, 0)
    assert drag.force(15.0, at_velocity(3.0, -4.0, 0.0), raptor) == pytest.approx((-0.18075, 0.482, 0.0))
    # climbing is -z: the force is +z, down. 1/2 * 1.205 * 0.06 = 0.03615
    assert drag.force(15.0, at_velocity(0.0, 0.0, -1.0), raptor) == pytest.approx((0.0, 0.0, 0.03615))


def test_a_tether_weighs_more_than_thinner_air_costs(raptor: Vehicle) -> None:
    # 1.5 kg: rotors lose 1.5 * 9.81 * 1e-4 = 0.0015 N of thrust per metre of height
    assert not HangingTether(weight_n_per_m=0.0025).believable([], raptor)
    assert HangingTether(weight_n_per_m=0.0035).believable([], raptor)


def test_a_ground_effect_fades_within_a_few_radii(raptor: Vehicle) -> None:
    # R = 0.12 m: from one radius to eight, 0.84 m, exp(-1.0 * 0.84) = 0.43 is left, and exp(-3.7 * 0.84) = 0.045
    climb = [hovering(0.12, 1.5)]
    assert not Exponential(a=0.2, b=1.0).believable(climb, raptor)
    assert Exponential(a=0.2, b=3.7).believable(climb, raptor)


def hovering(low_m: float, high_m: float) -> Conditions:
    """Hover at all heights between two."""
    return Conditions(np.linspace(low_m, high_m, 200), (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0))


@pytest.mark.parametrize(("low_m", "believed"), [(0.12, True), (1.0, False)])
def test_a_textbook_form_far_from_the_ground_is_a_constant_factor(
    raptor: Vehicle, low_m: float, believed: bool
) -> None:
    """Hayden's is 1.094 at one radius, 0.9965 at eight, 0.9957 at twelve, and 0.995 far away."""
    assert Hayden().believable([hovering(low_m, 1.5)], raptor) is believed


def test_a_tether_pulls_down_whatever_the_attitude(raptor: Vehicle) -> None:
    tether = HangingTether(weight_n_per_m=0.5, slack_m=0.2)
    tilted = quaternion_from_euler(0.3, -0.5, 1.0)
    c = Conditions(height_m=1.2, velocity_body_m_s=(0.0, 0.0, 0.0), attitude=tilted)
    assert rotate(tilted, tether.force(15.0, c, raptor)) == pytest.approx((0.0, 0.0, 0.5))  # 0.5 N/m of 1 m lifted
    below = Conditions(height_m=0.1, velocity_body_m_s=(0.0, 0.0, 0.0), attitude=tilted)
    assert tether.force(15.0, below, raptor) == pytest.approx((0.0, 0.0, 0.0))
