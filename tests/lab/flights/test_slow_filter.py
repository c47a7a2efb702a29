"""The slow filter of the moments: one Gaussian over time, whether samples are evenly spaced or not."""

import numpy as np
import pytest

from quadctl.lab.flights.flight import MOMENTS_S, SlowFilter

STEP_S = 0.09
EVEN = STEP_S * np.arange(200)
TIMES = {
    "even": EVEN,
    "with a gap": np.concatenate([EVEN[:90], 7.0 + EVEN[90:]]),
    "in short stretches": np.concatenate([20.0 * i + EVEN[:12] for i in range(4)]),
    "few": EVEN[:5],
    "uneven": EVEN + 0.3 * STEP_S * np.sin(np.arange(200.0)),
}


@pytest.mark.parametrize("time_s", TIMES.values(), ids=TIMES.keys())
def test_each_sample_is_the_gaussian_mean_of_its_neighbours_in_time(time_s: np.ndarray) -> None:
    """Neighbours are as many samples as lie within three standard deviations; beyond the ends the last one counts."""
    reach = int(np.ceil(3.0 * MOMENTS_S / np.median(np.diff(time_s))))
    values = np.random.default_rng(0).standard_normal((len(time_s), 2))
    expected = []
    for i, now_s in enumerate(time_s):
        near = np.clip(np.arange(i - reach, i + reach + 1), 0, len(time_s) - 1)
        weights = np.exp(-0.5 * ((time_s[near] - now_s) / MOMENTS_S) ** 2)
        expected.append(weights @ values[near] / weights.sum())
    slowly = SlowFilter(time_s)
    assert slowly(values) == pytest.approx(np.array(expected), abs=1e-12)
    assert slowly(values[:, 0]) == pytest.approx(np.array(expected)[:, 0], abs=1e-12)
