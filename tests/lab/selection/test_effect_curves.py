"""Specification of the small curves of candidates: the residual as the effect was fitted to it."""

import numpy as np
import pytest

from quadctl.effects.ground_effect import Exponential
from quadctl.effects.thrust_scale import ConstantScale
from quadctl.lab.flights.dataset import load_dataset
from quadctl.lab.selection.effect_curves import sketch
from quadctl.model import Model
from tests.support.flights import obedient


def test_a_trim_does_not_move_the_residual_off_the_curve(rigid: Model) -> None:
    """1 % more thrust, as a trim of one flight explains it, is 0.1 m/s^2 at every height."""
    ground = rigid.plus(Exponential(0.3, 6.0))
    drawn = sketch(ground, load_dataset([obedient(ground.plus(ConstantScale(1.01)))], rigid.vehicle))
    assert drawn is not None
    assert np.ptp(drawn.effect.mean) > 0.5
    assert drawn.residual.mean == pytest.approx(drawn.effect.mean, abs=0.03)
