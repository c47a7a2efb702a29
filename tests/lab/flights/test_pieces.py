"""Long flights are predicted piece by piece: the same values, with little memory."""

import tracemalloc

import numpy as np
import pytest

from quadctl.effects.ground_effect import Exponential
from quadctl.effects.motor_lag import FirstOrderLag
from quadctl.effects.rotor_drag import LinearDrag
from quadctl.frames import ned_from_neu
from quadctl.lab.flights import channels, prediction
from quadctl.lab.flights.channels import Channel
from quadctl.lab.flights.dataset import load_dataset
from quadctl.lab.flights.flight import Flight
from quadctl.lab.flights.prediction import predict
from quadctl.model import Model
from quadctl.vehicle import Vehicle
from tests.support.flights import obedient


@pytest.fixture(scope="module")
def flight(raptor: Vehicle) -> Flight:
    (found,) = load_dataset([obedient(Model(raptor), 60.0, noise_m_s=0.01)], raptor).flights
    return found


@pytest.mark.parametrize("lag", [False, True])
def test_the_pieces_give_what_the_whole_gives(flight: Flight, lag: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    model = Model(flight.vehicle).plus(Exponential(a=0.3, b=5.0)).plus(LinearDrag())
    model = model.plus(FirstOrderLag(time_constant_s=0.1)) if lag else model
    whole = flight.filtered_vector(ned_from_neu(model.acceleration_ned(flight.nominal_n, flight.conditions)))
    monkeypatch.setattr(prediction, "PIECE", 17)
    assert predict(model, flight) == pytest.approx(whole, abs=1e-12)


def test_a_prediction_needs_little_more_memory_than_its_three_components(
    flight: Flight, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(prediction, "PIECE", 64)
    model = Model(flight.vehicle).plus(Exponential(a=0.3, b=5.0))
    predict(model, flight)
    tracemalloc.start()
    predict(model, flight)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 6.0 * np.empty(len(flight.grid_s)).nbytes


def test_a_channel_is_read_in_pieces_as_the_whole_is(monkeypatch: pytest.MonkeyPatch) -> None:
    random = np.random.default_rng(0)
    time_s = np.cumsum(random.uniform(0.01, 0.03, 500))
    time_s[300:] += 1.0  # a gap, which is crossed straight
    channel = Channel(time_s, np.cumsum(random.standard_normal(500)))
    grid = np.arange(time_s[0] - 0.5, time_s[-1] + 0.5, 0.004)
    whole = channel.at(grid)
    monkeypatch.setattr(channels, "PIECE", 37)
    assert channel.at(grid) == pytest.approx(whole, abs=1e-9)
    between = (grid > time_s[299]) & (grid < time_s[300])
    assert whole[between] == pytest.approx(np.interp(grid[between], time_s, channel.value))
