"""Remaining error of a model: the variables that can be a cause, and those that may follow a disturbance."""

from dataclasses import replace

import numpy as np
import pytest

from quadctl.lab.comparison.remainder import remainder
from quadctl.lab.comparison.wording import Said
from quadctl.lab.fitting.flexible_regression import flexible_residual, noise_floor
from quadctl.lab.flights.dataset import Dataset, load_dataset
from quadctl.lab.flights.prediction import rmse
from quadctl.model import Model
from quadctl.vehicle import Vehicle
from tests.support.flights import obedient


@pytest.fixture(scope="module")
def flown(raptor: Vehicle) -> Dataset:
    return load_dataset([obedient(Model(raptor), 60.0, noise_m_s=0.01, name="a.csv")], raptor)


def test_what_goes_with_time_is_told_from_what_goes_with_a_cause(flown: Dataset) -> None:
    noise = np.random.default_rng(1).normal(0.0, 0.05, flown.measured.shape)
    for name, shown in (("time", False), ("height_over_radius", True)):
        x = flown.flights[0].variables[name]
        residual = noise.copy()
        residual[:, 2] += 0.5 * (x - x.mean()) / x.std()
        found = remainder(residual, flown, rmse(noise_floor(residual, flexible_residual(residual, flown))))
        assert found.axis == "up" and found.explained > 0.9 and not found.is_near_the_floor
        assert (found.explained_by_causes > 0.9) == shown
        assert bool(found.said().facts["others"]) != shown


def test_noise_is_near_the_floor(flown: Dataset) -> None:
    residual = np.random.default_rng(1).normal(0.0, 0.05, flown.measured.shape)
    found = remainder(residual, flown, rmse(residual))
    assert found.is_near_the_floor
    assert found.said().kind is Said.IS_FLOOR
    near = replace(found, floor_m_s2=found.error_m_s2 / 1.05).said(["a.csv"])
    assert near.kind is Said.NEAR_FLOOR and near.facts["above"] == pytest.approx(0.05)
    assert "remains on the held-out a.csv, 5% above the reference error" in str(near)
