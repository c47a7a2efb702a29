"""Specification of what only the velocity shows: no verdict where an accelerometer contradicts it."""

from dataclasses import replace

import numpy as np
import pytest

from quadctl.effects.imu_bias import ConstantBias
from quadctl.lab.flights.dataset import Dataset, load_dataset
from quadctl.lab.selection.diagnosis import diagnose
from quadctl.logs.flight_log import VELOCITY
from quadctl.model import Model
from quadctl.vehicle import Vehicle
from tests.lab.fitting.test_captured_attitude import runs


def pushed(vehicle: Vehicle, of_accelerometer: float, bias_m_s2: float = 0.0) -> Dataset:
    """Runs with 0.4 m/s^2 by place in the velocity, and a share of it in the accelerometer, which has a bias east."""
    (flight,) = load_dataset([replace(runs(vehicle, 0.0), meta={})], vehicle).flights
    north = flight.variables["north"]
    push = np.outer(0.4 * np.sin(north / np.std(north) + 0.5), [0.8, 0.6, 0.0])
    assert flight.sensed is not None and flight.trajectory is None
    sensed = flight.sensed + of_accelerometer * push + [0.0, bias_m_s2, 0.0]
    return Dataset((replace(flight, measured=flight.measured + push, sensed=sensed),))


@pytest.mark.parametrize(("share", "verdict"), [(0.0, "none"), (1.0, "unexplained")])
def test_what_the_accelerometer_contradicts_is_not_unexplained(raptor: Vehicle, share: float, verdict: str) -> None:
    assert diagnose(Model(raptor), pushed(raptor, share), []).verdict == verdict


def test_a_velocity_that_lags_is_put_right_and_not_doubted(raptor: Vehicle) -> None:
    log = replace(runs(raptor, 0.0), meta={})
    late = {name: np.interp(log.time_s - 0.14, log.time_s, log[name]) for name in VELOCITY}
    (flight,) = load_dataset([replace(log, columns=log.columns | late)], raptor).flights
    assert flight.doubted_axes == () and flight.velocity_lag_s == pytest.approx(0.14, abs=0.01)


def test_a_bias_stays_beside_an_acceleration_that_nothing_explains(raptor: Vehicle) -> None:
    found = diagnose(Model(raptor), pushed(raptor, 1.0, 0.6), [ConstantBias])
    assert (found.verdict, found.missing, found.unexplained) == ("missing", ["imu_bias"], True)
    assert [step.family for step in found.steps] == ["", "imu_bias"]
    assert found.steps[-1].rmse["sensing"] < 0.5 * found.steps[0].rmse["sensing"]
