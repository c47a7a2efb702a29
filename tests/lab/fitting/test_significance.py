"""Specification of the noise that a p-value is computed with: what its spectrum is at the lowest frequencies."""

import functools
import math

import numpy as np
import pytest
from scipy.signal import lfilter

from quadctl.lab.arrays import Floats
from quadctl.lab.fitting.noise import spectrum

SAMPLES = 900
LOW = round(math.sqrt(SAMPLES))
REPEATED = 200


def autoregressive(memory: float, seed: int) -> tuple[Floats, Floats]:
    """Noise x[i] = memory x[i-1] + white noise of variance 1, and its true spectrum at the frequencies of `rfft`."""
    random = np.random.default_rng(seed)
    before = random.standard_normal() / math.sqrt(1.0 - memory**2)
    noise, _ = lfilter([1.0], [1.0, -memory], random.standard_normal(SAMPLES), zi=[memory * before])
    turn = 2.0 * math.pi * np.arange(SAMPLES // 2 + 1) / SAMPLES
    return noise, 1.0 / (1.0 - 2.0 * memory * np.cos(turn) + memory**2)


@functools.cache
def found_over_true(memory: float) -> Floats:
    """Estimate over truth, shape (noises, frequencies); the model that is tested varies as slowly as a minute."""
    taken = np.zeros(SAMPLES // 2 + 1)
    taken[:3] = 1.0
    ratios = []
    for seed in range(REPEATED):
        noise, true = autoregressive(memory, seed)
        ratios.append(spectrum(noise, taken, LOW)[:3] / true[:3])
    return np.array(ratios)


@pytest.mark.parametrize(
    ("memory", "most"), [(0.0, 2.0), (0.8, 2.0), (0.95, 6.5)], ids=["white", "of 5 samples", "of 20 samples"]
)
@pytest.mark.parametrize("frequency", [0, 1, 2])
def test_noise_that_is_forgotten_does_not_grow_over_the_flight(memory: float, most: float, frequency: int) -> None:
    """The estimate errs toward too much. A power law through all frequencies gives twice as much for the last noise."""
    ratios = found_over_true(memory)[:, frequency]
    assert 1.0 < np.median(ratios) < most


def test_noise_that_drifts_all_flight_long_is_not_taken_for_less() -> None:
    """The lowest frequencies of a random walk, here a memory of 2000 samples, have the most power."""
    ratios = found_over_true(0.9995)[:, 1]
    assert np.mean(ratios < 1.0 / 3.0) < 0.15
    noise, _ = autoregressive(0.9995, 0)
    found = spectrum(noise, np.zeros(SAMPLES // 2 + 1), LOW)
    assert found[1] > 10.0 * found[LOW]
