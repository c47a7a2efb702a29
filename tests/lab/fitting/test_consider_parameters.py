"""Considered errors: their effect on a prediction and on the intervals of a fit."""

import dataclasses
import math

import numpy as np
import pytest

from quadctl.effects.ground_effect import Exponential
from quadctl.effects.rotor_drag import LinearDrag
from quadctl.effects.rotor_fault import WeakRotor
from quadctl.effects.thrust_scale import ConstantScale
from quadctl.lab.fitting import consider_parameters as considered
from quadctl.lab.fitting.consider_parameters import (
    AIRSPEED,
    FORM,
    GROUND_SLOPE,
    ROTOR_COEFFICIENT,
    consider_jacobian,
)
from quadctl.lab.fitting.fitter import Fitter
from quadctl.lab.flights.dataset import Dataset, load_dataset
from quadctl.lab.flights.flight import Flight
from quadctl.lab.flights.prediction import predict, predict_targets
from quadctl.lab.flights.preparation import prepare
from quadctl.model import Model
from quadctl.vehicle import Vehicle
from tests.support.flights import obedient

GROUPS = ("total",)
UP = 2


@pytest.fixture(scope="module")
def flight(raptor: Vehicle) -> Flight:
    return prepare(obedient(Model(raptor)), raptor)


def jacobian(model: Model, flight: Flight) -> np.ndarray:
    """Jacobian of the considered errors: four rotors, the ground's slope north and east, then each form."""
    return consider_jacobian(model, flight, GROUPS, predict_targets(model, flight, GROUPS))


def test_rotors_that_all_give_the_same_say_nothing_of_their_differences(raptor: Vehicle, flight: Flight) -> None:
    assert jacobian(Model(raptor), flight)[..., :4] == pytest.approx(0.0, abs=1e-12)


def test_a_stronger_rotor_acts_by_its_thrust_beyond_the_mean(raptor: Vehicle, flight: Flight) -> None:
    first, *others = flight.nominal_n
    uneven = dataclasses.replace(flight, nominal_n=[first + 1.0, *others])
    expected = ROTOR_COEFFICIENT * 0.75 / raptor.mass_kg  # N above the mean of four
    assert jacobian(Model(raptor), uneven)[:, UP, 0] == pytest.approx(expected, rel=1e-3)


def test_ground_that_rises_to_the_north_is_nearer_there(raptor: Vehicle, flight: Flight) -> None:
    model = Model(raptor).plus(Exponential(0.3, 6.0))
    c = flight.conditions
    north = dataclasses.replace(flight, conditions=dataclasses.replace(c, position_ne_m=(2.0 + 0.0 * c.height_m, 0.0)))
    lower = dataclasses.replace(c, height_m=c.height_m - 2.0 * GROUND_SLOPE)
    nearer = predict_targets(model, dataclasses.replace(flight, conditions=lower), GROUPS)
    assert jacobian(model, north)[..., 4] == pytest.approx(nearer - predict_targets(model, flight, GROUPS), abs=1e-9)
    assert jacobian(model, north)[..., 5] == pytest.approx(0.0, abs=1e-12)
    assert (jacobian(model, north)[:, UP, 4] > 0.0).all()


def test_a_form_is_off_by_a_share_of_what_its_effect_does(raptor: Vehicle, flight: Flight) -> None:
    model = Model(raptor).plus(ConstantScale(1.1)).plus(Exponential(0.3, 6.0))
    does = predict_targets(model, flight, GROUPS) - predict_targets(
        Model(raptor).plus(ConstantScale(1.1)), flight, GROUPS
    )
    off = jacobian(model, flight)[..., 6]
    assert off[:, UP] == pytest.approx(FORM * math.sqrt(np.mean(does[:, UP] ** 2)))
    assert off[:, :UP] == pytest.approx(0.0)


def test_what_has_no_form_is_not_off(raptor: Vehicle, flight: Flight) -> None:
    assert jacobian(Model(raptor).plus(ConstantScale(1.1)), flight).shape[-1] == 6


def test_a_drag_is_off_by_a_share_because_the_airspeed_is(raptor: Vehicle, flight: Flight) -> None:
    model = Model(raptor).plus(LinearDrag(0.3, 0.3, 0.3))
    does = predict(model, flight) - predict(Model(raptor), flight)
    off = jacobian(model, flight)[..., 6]
    assert off[:, :3] == pytest.approx(AIRSPEED * does)
    assert np.abs(does).max() > 0.01


def test_a_thrust_scale_is_less_sure_beside_a_form(raptor: Vehicle, monkeypatch: pytest.MonkeyPatch) -> None:
    """A ground effect with a slightly different tail gives slightly more thrust everywhere."""
    model = Model(raptor).plus(ConstantScale(1.0)).plus(Exponential(0.3, 6.0))
    data = load_dataset([obedient(model, 60.0, noise_m_s=0.002)], raptor)
    wide = _spread(model, data)
    monkeypatch.setattr(considered, "FORM", 0.0)
    by_form = np.sqrt(wide**2 - _spread(model, data) ** 2)
    assert by_form > 0.002


def test_intervals_grow_by_what_rotors_of_one_batch_differ(raptor: Vehicle, monkeypatch: pytest.MonkeyPatch) -> None:
    """A longer flight does not help: no data distinguish a weak rotor from one with a slightly smaller coefficient."""
    log = obedient(Model(raptor), 60.0, noise_m_s=0.002)
    swing = np.sin(2.0 * np.pi * 0.2 * log.time_s)
    turned = {f"motor{i}_rpm": log[f"motor{i}_rpm"] * (1.0 + sign * 0.05 * swing) for i, sign in ((1, 1.0), (2, -1.0))}
    turned["motor1_rpm"] = turned["motor1_rpm"] / np.sqrt(0.9)
    data = load_dataset([dataclasses.replace(log, columns={**log.columns, **turned})], raptor)
    model = Model(raptor).plus(WeakRotor(rotor=1.0))
    wide = _spread(model, data)
    monkeypatch.setattr(considered, "ROTOR_COEFFICIENT", 0.0)
    assert wide > 1.5 * _spread(model, data)


def _spread(model: Model, data: Dataset) -> float:
    """Standard deviation of the first parameter."""
    fitter = Fitter(model, data)
    return float(np.std(fitter.bootstrap(fitter.fit())[:, 0]))
