"""Surrogate flights: a known model leaves just the residual that is asked for."""

import numpy as np
import pytest

from quadctl.lab.flights.dataset import load_dataset
from quadctl.model import Model
from studies.real_residuals import surrogate, transplanted
from tests.support.flights import obedient


@pytest.mark.parametrize("period_s", [40.0, 4.0], ids=["slow", "quick"])
def test_the_truth_leaves_the_residual_that_is_wanted(rigid: Model, period_s: float) -> None:
    log = obedient(rigid, noise_m_s=0.002)
    time_s = load_dataset([log], rigid.vehicle).flights[0].time_s
    wave = np.sin(2.0 * np.pi * time_s / period_s)
    wanted = np.outer(wave, [0.1, -0.05, 0.2])
    made = load_dataset([surrogate(log, rigid, wanted, time_s)], rigid.vehicle).aligned_for(rigid)
    asked = np.column_stack([np.interp(made.flights[0].time_s, time_s, axis) for axis in wanted.T])
    away = made.residual(rigid) - asked
    assert np.sqrt(np.mean(away**2)) < 0.15 * np.sqrt(np.mean(asked**2))


def test_a_transplanted_residual_has_no_jump_and_the_size_of_its_source() -> None:
    time_s = np.arange(0.0, 30.0, 0.2)
    source = np.column_stack([np.sin(time_s), np.cos(time_s), time_s / 30.0])
    moved = transplanted((time_s, source), np.arange(0.0, 90.0, 0.2), np.random.default_rng(1))
    assert np.abs(np.diff(moved, axis=0)).max() < 0.25
    assert np.abs(moved).max(axis=0) == pytest.approx([1.0, 1.0, 1.0], abs=0.02)
