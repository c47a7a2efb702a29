"""Specification of the small curves of candidates: the residual as the effect was fitted to it."""

from dataclasses import replace

import numpy as np
import pytest

from quadctl.effects.ground_effect import Exponential
from quadctl.effects.rotor_drag import LinearDrag
from quadctl.effects.thrust_scale import ConstantScale
from quadctl.lab.flights.dataset import load_dataset
from quadctl.lab.selection.effect_curves import measured_ratio, ratio_as_flown, sketch
from quadctl.model import Model
from tests.support.flights import obedient, to_and_fro


def test_a_trim_does_not_move_the_residual_off_the_curve(rigid: Model) -> None:
    """1 % more thrust, as a trim of one flight explains it, is 0.1 m/s^2 at every height."""
    ground = rigid.plus(Exponential(0.3, 6.0))
    drawn = sketch(ground, load_dataset([obedient(ground.plus(ConstantScale(1.01)))], rigid.vehicle))
    assert drawn is not None
    assert np.ptp(drawn.effect.mean) > 0.5
    assert drawn.residual.mean == pytest.approx(drawn.effect.mean, abs=0.03)


def test_a_drag_is_sketched_over_the_speed_that_it_follows(rigid: Model) -> None:
    drag = rigid.plus(LinearDrag(d_x=0.02, d_y=0.6, d_z=0.0))
    log = to_and_fro(obedient(rigid), 2.0)
    w = 2.0 * np.pi * 0.083  # to the side at another pace than forward
    side = {"y_m": -2.0 / w * np.cos(w * log.time_s), "vy_m_s": 2.0 * np.sin(w * log.time_s)}
    drawn = sketch(drag, load_dataset([replace(log, columns=log.columns | side)], rigid.vehicle))
    assert drawn is not None
    assert (drawn.variable, drawn.component) == ("speed_right", "right")
    assert (np.diff(drawn.effect.mean) < 0.0).all()  # a line, no zigzag


def test_the_ratio_over_speed_is_that_at_the_heights_flown_at_that_speed(rigid: Model) -> None:
    """A vehicle that is fast only high up has a ground effect at low speeds, and none at high ones."""
    truth = rigid.plus(Exponential(a=0.3, b=5.0))
    log = obedient(truth, 120.0, noise_m_s=0.01)
    columns = {**log.columns, "vx_m_s": log.columns["vx_m_s"] + 3.0 * log.columns["z_m"]}
    dataset = load_dataset([replace(log, columns=columns)], rigid.vehicle)
    measured = measured_ratio(dataset, "speed_forward")
    modelled = ratio_as_flown(truth, dataset, "speed_forward")
    assert measured is not None and modelled is not None
    assert modelled.x == pytest.approx(measured.x)
    assert modelled.mean == pytest.approx(measured.mean, abs=0.01)
    assert modelled.mean[0] - modelled.mean[-1] > 0.05
