"""Specification of the covariance of the gradient: what noise of a known memory does to a fit."""

import numpy as np
import pytest

from quadctl.lab.arrays import Floats
from quadctl.lab.fitting.normal_equations import gradient_covariance

SAMPLES = 600
BLOCK = 50
"""Samples of a block of time, which the bootstrap draws as one."""


def noise(memory: float, seed: int) -> Floats:
    """Noise x[i] = memory x[i-1] + white noise, of variance 1, for three axes."""
    random = np.random.default_rng(seed)
    x = np.empty((SAMPLES, 3))
    x[0] = random.standard_normal(3)
    for i in range(1, SAMPLES):
        x[i] = memory * x[i - 1] + np.sqrt(1.0 - memory**2) * random.standard_normal(3)
    return x


def columns(memory: float, seed: int) -> Floats:
    """A slow and a fast column of a Jacobian, the same on each axis, and the residual."""
    turns = 2.0 * np.pi * np.arange(SAMPLES) / SAMPLES
    jacobian = np.stack([np.cos(turns), np.cos(40.0 * turns)], axis=-1)
    return np.concatenate([np.repeat(jacobian[:, None], 3, axis=1), noise(memory, seed)[..., None]], axis=-1)


def true_covariance(memory: float) -> Floats:
    lags = np.abs(np.subtract.outer(np.arange(SAMPLES), np.arange(SAMPLES)))
    jacobian = columns(memory, 0)[:, 0, :-1]
    return np.asarray(3.0 * jacobian.T @ memory**lags @ jacobian)


@pytest.mark.parametrize("memory", [0.0, 0.9, 0.99])
def test_it_is_that_of_the_noise_or_more_where_the_column_is_as_slow_as_the_flight(memory: float) -> None:
    """One flight shows its lowest frequencies once: what lies there may be the end of a steep spectrum."""
    found = [gradient_covariance(columns(memory, seed), np.ones((SAMPLES, 3))) for seed in range(100)]
    slow, fast = np.mean(found, axis=0).diagonal() / true_covariance(memory).diagonal()
    assert fast == pytest.approx(1.0, abs=0.3)
    assert 0.8 < slow < 3.0


def test_noise_that_outlasts_a_block_is_more_than_independent_blocks_tell() -> None:
    slow = true_covariance(0.99)[0, 0]
    gradients = [(c[..., 0] * c[..., -1]).sum(axis=1) for c in (columns(0.99, seed) for seed in range(100))]
    by_blocks = np.mean([np.sum(np.sum(g.reshape(-1, BLOCK), axis=1) ** 2) for g in gradients])
    assert by_blocks < 0.7 * slow


def test_weights_count_with_the_residual() -> None:
    random = np.random.default_rng(0)
    given, weights = columns(0.5, 1), random.uniform(0.2, 1.0, (SAMPLES, 3))
    weighted = np.concatenate([given[..., :-1], weights[..., None] * given[..., -1:]], axis=-1)
    assert gradient_covariance(given, weights) == pytest.approx(gradient_covariance(weighted, np.ones((SAMPLES, 3))))
