"""The scale of the velocity: whether the position changes as fast as it says."""

from dataclasses import replace

import numpy as np
import pytest

from quadctl.effects.thrust_curve import PowerCurve
from quadctl.lab.fitting.fitted_model import fit_model
from quadctl.lab.fitting.initial_guesses import Unmodelled
from quadctl.lab.flights.dataset import load_dataset
from quadctl.lab.flights.preparation import prepare
from quadctl.lab.flights.velocity_scale import velocity_scale_errors
from quadctl.lab.selection.trial import try_effect
from quadctl.logs.flight_log import FlightLog
from quadctl.model import Model
from quadctl.vehicle import Vehicle
from tests.support.flights import obedient


def slow(log: FlightLog, share: float) -> FlightLog:
    """The same flight by a clock that is slow by this share: all lasts shorter, velocities stay what they are."""
    return replace(log, columns={**log.columns, "time_s": log.time_s * (1.0 - share)})


@pytest.fixture(scope="module")
def flown(raptor: Vehicle) -> FlightLog:
    return obedient(Model(raptor), 90.0, noise_m_s=0.01)


@pytest.mark.parametrize(("share", "error"), [(0.0, 0.0), (0.06, 0.0638), (-0.06, -0.0566)])  # 1 / (1 - share) - 1
def test_a_clock_that_is_slow_shows(flown: FlightLog, raptor: Vehicle, share: float, error: float) -> None:
    errors = velocity_scale_errors(prepare(slow(flown, share), raptor))
    assert errors[2] == pytest.approx(error, abs=0.004)
    assert list(errors[:2]) == [0.0, 0.0]  # it hovers


def test_noise_alone_is_no_error_of_the_scale(raptor: Vehicle) -> None:
    """Noise in the velocity lowers the slope of a regression on it: by 5 % here."""
    noisy = prepare(obedient(Model(raptor), 90.0, noise_m_s=0.2), raptor)
    up = noisy.smooth @ noisy.velocity_neu[2]
    change = noisy.derivative @ np.asarray(noisy.conditions.height_m)
    assert change @ up / (up @ up) < 0.97
    assert abs(velocity_scale_errors(noisy)[2]) < 0.005


def test_a_faster_flight_with_another_scale_is_told(raptor: Vehicle, plain_runs: list[FlightLog]) -> None:
    runs = plain_runs[0]
    said = "times as fast as v"
    assert not any(said in note for note in prepare(runs, raptor).notes)
    (note,) = [note for note in prepare(slow(runs, 0.08), raptor).notes if said in note]
    assert "m changes 1.09 times as fast as v" in note


def test_a_thrust_curve_is_not_found_where_the_clock_does_the_same(flown: FlightLog, raptor: Vehicle) -> None:
    def p_value(log: FlightLog) -> float:
        return try_effect(PowerCurve, Unmodelled(fit_model(Model(raptor), load_dataset([log], raptor))), 1).p_value

    curved = obedient(Model(raptor), 90.0, noise_m_s=0.01)
    faster = {name: curved[name] ** (2.0 / 2.13) for name in curved.columns if name.endswith("_rpm")}
    hover = {name: np.mean(curved[name]) / np.mean(speed) for name, speed in faster.items()}
    bent = replace(curved, columns={**curved.columns, **{name: faster[name] * hover[name] for name in faster}})
    assert p_value(bent) < 1e-6
    assert p_value(slow(flown, 0.06)) > 0.05
