"""Sizes that are large enough to be called missing, or unexplained."""

import numpy as np
import pytest

from quadctl.effects import Effect
from quadctl.effects.body_drag import QuadraticDrag
from quadctl.effects.motor_lag import FirstOrderLag
from quadctl.effects.rotor_fault import WeakRotor
from quadctl.lab.selection.rule import RULE, explained_m_s2, is_material, is_unexplained

LITTLE, ENOUGH, MUCH = 0.5 * RULE.least_m_s2, 1.5 * RULE.least_m_s2, 1.5 * RULE.material_m_s2


@pytest.mark.parametrize(
    ("effect", "drop", "explained", "material"),
    [
        pytest.param(QuadraticDrag(), 0.2, LITTLE, False, id="half of the error of a very quiet log"),
        pytest.param(QuadraticDrag(), 0.2, ENOUGH, True, id="more than attitudes are off"),
        pytest.param(QuadraticDrag(), 0.01, ENOUGH, False, id="little of a noisy log"),
        pytest.param(QuadraticDrag(), 0.01, MUCH, True, id="little of a noisy log, but an acceleration that counts"),
        pytest.param(WeakRotor(), 0.2, LITTLE, True, id="it shows in the moments"),
        pytest.param(FirstOrderLag(), 0.2, LITTLE, True, id="a delay explains most of it"),
    ],
)
def test_an_effect_matters_by_its_share_of_the_error_and_by_its_acceleration(
    effect: Effect, drop: float, explained: float, material: bool
) -> None:
    assert is_material(effect, drop, explained) is material


def test_the_explained_acceleration_is_that_of_the_axis_on_which_it_is_largest() -> None:
    before = np.tile([0.5, 0.1, 0.0], (10, 1))
    assert explained_m_s2(before, np.tile([0.3, 0.1, 0.1], (10, 1))) == pytest.approx(0.4)
    assert explained_m_s2(before, 2.0 * before) == 0.0


@pytest.mark.parametrize(("times", "unexplained"), [(0.7, False), (1.5, True)])
def test_what_no_more_than_biases_can_be_is_not_called_unexplained(times: float, unexplained: bool) -> None:
    wave = times * RULE.trim_m_s2 * np.sqrt(2.0) * np.sin(np.linspace(0.0, 60.0, 2000))
    flexible = np.column_stack([wave, 0.0 * wave, 0.0 * wave])
    residual = flexible + 0.05 * np.random.default_rng(0).standard_normal(flexible.shape)
    assert is_unexplained(residual, flexible, p_value=1e-9) is unexplained
