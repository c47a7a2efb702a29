"""Specification of the predictions that are kept of a flight: each is that of its model, and nobody changes it."""

import numpy as np
import pytest

from quadctl.effects.rotor_drag import LinearDrag
from quadctl.lab.flights.dataset import load_dataset
from quadctl.lab.flights.flight import Flight
from quadctl.lab.flights.prediction import MOST_KEPT, predict
from quadctl.model import Model
from tests.support.flights import obedient, to_and_fro


@pytest.fixture(scope="module")
def flight(rigid: Model) -> Flight:
    return load_dataset([to_and_fro(obedient(rigid, 30.0), 2.0)], rigid.vehicle).flights[0]


def test_another_vehicle_has_another_prediction(rigid: Model, flight: Flight) -> None:
    of_light = predict(rigid, flight)
    heavy = Model(rigid.vehicle.model_copy(update={"mass_kg": 2.0 * rigid.vehicle.mass_kg}))
    assert np.abs(predict(heavy, flight) - of_light).max() > 1.0
    assert predict(rigid, flight) is of_light


def test_a_prediction_that_others_have_driven_out_is_made_anew(rigid: Model, flight: Flight) -> None:
    first = predict(rigid.plus(LinearDrag(d_x=0.3)), flight)
    others = [predict(rigid.plus(LinearDrag(d_x=0.3 + 0.1 * i)), flight) for i in range(1, MOST_KEPT + 1)]
    again = predict(rigid.plus(LinearDrag(d_x=0.3)), flight)
    assert again is not first and np.array_equal(again, first)
    assert all(np.abs(other - first).max() > 0.01 for other in others)


def test_a_kept_prediction_cannot_be_changed(rigid: Model, flight: Flight) -> None:
    with pytest.raises(ValueError, match="read-only"):
        predict(rigid, flight)[:] = 0.0


@pytest.mark.parametrize("delay_s", [-0.0137, 0.0, 0.0137, 0.2])
def test_rotors_shifted_together_are_those_shifted_one_by_one(flight: Flight, delay_s: float) -> None:
    together = flight.later(np.array(flight.nominal_n), delay_s)
    assert np.array_equal(together, [flight.later(thrust, delay_s) for thrust in flight.nominal_n])
    assert np.ptp(together, axis=1).min() > 0.0
