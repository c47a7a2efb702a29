"""Errors of the logged velocity: how much of a velocity they may be, and how far they may have weakened a drag."""

from dataclasses import replace

import numpy as np
import pytest

from quadctl.effects.rotor_drag import LinearDrag
from quadctl.lab.fitting import velocity_error
from quadctl.lab.fitting.fitted_model import fit_model
from quadctl.lab.fitting.fitter import Fitter
from quadctl.lab.fitting.velocity_error import error_share, weakening
from quadctl.lab.flights.dataset import load_dataset
from quadctl.lab.flights.prediction import predict
from quadctl.lab.flights.preparation import prepare
from quadctl.logs.flight_log import VELOCITY, FlightLog
from quadctl.model import Model
from quadctl.vehicle import Vehicle
from tests.support.flights import obedient, simulated

TIME_S = np.arange(0.0, 200.0, 0.1)
RATE = 0.5


def wave(hz: float) -> np.ndarray:
    return np.sin(2.0 * np.pi * hz * TIME_S)


@pytest.fixture(scope="module")
def figure8(tmp_path_factory: pytest.TempPathFactory) -> FlightLog:
    """A flight with a drag of 0.5 1/s along both axes."""
    drag = ("rotor_drag.linear", {"d_x": 0.5, "d_y": 0.5, "d_z": 0.0})
    return simulated("figure8", [drag], 2, tmp_path_factory.mktemp("flown"))


class TestErrorShare:
    def test_a_residual_of_one_frequency_is_an_error_of_the_velocity_by_its_own_response(self) -> None:
        """An error e of frequency w leaves (i w + d) e: 0.3 m/s at 0.2 Hz leave 0.3 (1.2566^2 + 0.5^2)^0.5 m/s^2."""
        residual = 0.3 * 1.35246 * wave(0.2)
        assert error_share(1.5 * wave(0.05), residual, RATE, TIME_S) == pytest.approx(0.3**2 / 1.5**2, rel=1e-3)

    def test_quick_noise_is_hardly_an_error_of_the_velocity(self) -> None:
        assert error_share(wave(0.05), 0.3 * wave(3.0), RATE, TIME_S) < 3e-4

    def test_a_vehicle_that_moves_less_than_errors_may_be_all_error(self) -> None:
        assert error_share(0.01 * wave(0.05), 0.3 * wave(0.2), RATE, TIME_S) == 1.0

    def test_a_vehicle_that_does_not_move_may_be_all_error(self) -> None:
        assert error_share(np.zeros_like(TIME_S), 0.3 * wave(0.2), RATE, TIME_S) == 1.0


class TestWeakening:
    def test_a_drag_may_be_larger_by_the_share_of_the_errors_along_each_axis(
        self, raptor: Vehicle, figure8: FlightLog
    ) -> None:
        """A residual to the north says nothing of the velocity to the east, for a vehicle that looks north."""
        flight = prepare(figure8, raptor)
        model = Model(raptor).plus(LinearDrag(0.5, 0.5, 0.0))
        predicted = predict(model, flight)
        does = predicted - predict(Model(raptor), flight)
        residual = np.zeros_like(predicted)
        residual[:, 0] = 0.05 * np.sin(2.0 * np.pi * 0.2 * flight.time_s)
        share = error_share(flight.variables["speed_forward"], residual[:, 0], 0.5, flight.time_s)
        assert 1e-4 < share < 1e-2
        weaker = weakening(model, flight, predicted, residual)
        assert weaker[:, 0] == pytest.approx(share * does[:, 0], abs=1e-4)
        assert weaker[:, 1] == pytest.approx(0.0, abs=1e-4)

    def test_without_a_drag_there_is_nothing_to_weaken(self, raptor: Vehicle) -> None:
        flight = prepare(obedient(Model(raptor)), raptor)
        predicted = predict(Model(raptor), flight)
        assert not weakening(Model(raptor), flight, predicted, np.ones_like(predicted)).any()


def test_a_drag_that_wrong_velocities_weaken_is_within_its_interval(
    raptor: Vehicle, figure8: FlightLog, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Slow errors, larger than the velocity, take nearly half of the drag; an interval without them leaves it out.

    Corrections that they drive to their bounds would widen both intervals, and have tests of their own.
    """
    monkeypatch.setattr(Fitter, "_step_beyond_bounds", lambda *_: 0.0)
    random = np.random.default_rng(1)
    sizes = {name: 1.5 * float(figure8[name].std()) for name in VELOCITY[:2]}
    wrong = {name: figure8[name] + slow(random, figure8.time_s, size) for name, size in sizes.items()}
    start, data = Model(raptor).plus(LinearDrag(0.3, 0.3, 0.0)), load_dataset([changed(figure8, wrong)], raptor)
    found = fit_model(start, data)
    monkeypatch.setattr(velocity_error, "error_share", lambda *_: 0.0)
    unaware = fit_model(start, data).intervals
    values = list(found.model.effects[0].values().values())
    for axis in (0, 1):
        low, high = found.intervals[axis]
        assert values[axis] < 0.35
        assert low < 0.5 < high
        assert unaware[axis][1] < 0.5


def changed(log: FlightLog, columns: dict[str, np.ndarray]) -> FlightLog:
    return replace(log, columns={**log.columns, **columns})


def slow(random: np.random.Generator, time_s: np.ndarray, size: float) -> np.ndarray:
    """Sum of waves of 0.02 to 0.1 Hz with a standard deviation of `size`."""
    found = sum(np.sin(2.0 * np.pi * (hz * time_s + random.uniform())) for hz in np.linspace(0.02, 0.1, 9))
    return np.asarray(found * size / np.std(found))
