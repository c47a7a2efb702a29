"""Regression of a residual on the logged variables: what it predicts of held-out blocks."""

from dataclasses import replace

import numpy as np
import pytest

from quadctl.frames import quaternion_from_euler
from quadctl.lab.arrays import Floats
from quadctl.lab.fitting.flexible_regression import flexible_residual, noise_floor, turned_by
from quadctl.lab.flights.dataset import Dataset, load_dataset
from quadctl.model import Model
from tests.support.flights import obedient


def test_a_vector_to_the_north_turned_by_a_right_angle_points_east() -> None:
    assert turned_by(np.array([[1.0, 0.0]]), np.array([np.pi / 2])) == pytest.approx(np.array([[0.0, 1.0]]))


@pytest.fixture(scope="module")
def turning(rigid: Model) -> Dataset:
    """Flight that climbs and sinks, with a heading that goes round in 30 s."""
    (flight,) = load_dataset([obedient(rigid, 120.0)], rigid.vehicle).flights
    c = flight.conditions
    yaw = np.linspace(0.0, 8.0 * np.pi, c.height_m.size)
    zero = np.zeros_like(yaw)
    return Dataset((replace(flight, conditions=replace(c, attitude=quaternion_from_euler(zero, zero, yaw))),))


@pytest.mark.parametrize("turns", [True, False])
def test_an_error_along_the_body_is_predicted_and_so_is_one_along_the_world(turning: Dataset, turns: bool) -> None:
    (flight,) = turning.flights
    speed = flight.variables["climb_rate"]
    along = np.column_stack([0.5 * speed, np.zeros_like(speed)])
    horizontal = turned_by(along, flight.heading_rad) if turns else along
    noise = 0.02 * np.random.default_rng(1).standard_normal((len(speed), 3))
    residual = np.column_stack([horizontal, np.zeros_like(speed)]) + noise
    left = noise_floor(residual, flexible_residual(residual, turning))
    assert _rms(left) < 1.2 * _rms(noise) < 0.5 * _rms(residual)


def test_of_noise_nothing_is_predicted(turning: Dataset) -> None:
    noise = np.random.default_rng(2).standard_normal((len(turning.targets), 3))
    assert _rms(noise_floor(noise, flexible_residual(noise, turning))) > 0.97 * _rms(noise)


def _rms(values: Floats) -> float:
    return float(np.sqrt(np.mean(values**2)))
