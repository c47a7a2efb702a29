"""Specification of the small curves of candidates: the residual as the effect was fitted to it."""

from dataclasses import replace

import numpy as np
import pytest

from quadctl.effects.ground_effect import Exponential
from quadctl.effects.ground_torque import Levelling
from quadctl.effects.rotor_drag import LinearDrag
from quadctl.effects.rotor_fault import WeakRotor
from quadctl.effects.thrust_scale import ConstantScale
from quadctl.lab.effect_curves import fitted_effect_curves, measured_ratio, ratio_as_flown, sketch
from quadctl.lab.fitting.fitted_model import fit_as_it_stands
from quadctl.lab.flights.dataset import load_dataset
from quadctl.model import Model
from tests.support.flights import obedient, to_and_fro


def test_a_per_flight_bias_does_not_move_the_residual_off_the_curve(rigid: Model) -> None:
    """1 % more thrust, as a bias of one flight explains it, is 0.1 m/s^2 at every height."""
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


class TestMoments:
    """An effect that turns the vehicle is shown in the moments, too: its evidence may be there alone."""

    def test_a_weak_rotor_lifts_less_and_turns_the_vehicle_about_two_axes(self, rigid: Model) -> None:
        dataset = load_dataset([obedient(rigid)], rigid.vehicle)
        curves = fitted_effect_curves(fit_as_it_stands(rigid.plus(WeakRotor(0.2)), dataset), 0)
        assert {curve.variable for curve in curves} == {"time"}
        labels = ["residual up / m/s²", "residual roll moment / N m", "residual pitch moment / N m"]
        assert [curve.residual_label for curve in curves] == labels
        up, roll, pitch = (curve.fitted.mean.mean() for curve in curves)
        one_n = 0.2 * rigid.vehicle.weight_n / rigid.vehicle.n_rotors
        x, y, _ = rigid.vehicle.rotors[0].position_m
        expected = (-one_n / rigid.vehicle.mass_kg, y * one_n, -x * one_n)
        assert (up, roll, pitch) == pytest.approx(expected, rel=0.05)

    def test_a_moment_is_drawn_over_what_it_follows(self, rigid: Model) -> None:
        """A moment near the ground depends on the height, but goes with the lean."""
        log = obedient(rigid)
        leaning = {"roll_deg": 8.0 * np.sin(2.0 * np.pi * 0.3 * log.time_s)}
        dataset = load_dataset([replace(log, columns=log.columns | leaning)], rigid.vehicle)
        (drawn,) = fitted_effect_curves(fit_as_it_stands(rigid.plus(Levelling(2.0, 5.0)), dataset), 0)
        assert (drawn.variable, drawn.component) == ("roll", "roll moment")
        assert (np.diff(drawn.fitted.mean) < 0.0).all()
