"""Turbulence by Dryden's spectra."""

import numpy as np

from studies.worlds.blade.rotation import Array


class Turbulence:
    """Dryden turbulence of many flights at once (MIL-F-8785C): a first-order filter along the wind, second-order
    filters across it, each driven by white noise; here along north, east, down."""

    def __init__(self, sigma: Array, height: Array, airspeed: Array, step: float) -> None:
        """Filters of intensity sigma (m/s, one per flight) at a height (m) and an airspeed (m/s)."""
        feet = np.clip(height / 0.3048, 10.0, 1000.0)
        along = 0.3048 * feet / (0.177 + 0.000823 * feet) ** 1.2  # low-altitude scale lengths, section 3.7.3.4
        down = 0.3048 * feet
        speed = np.maximum(airspeed, 1.0)
        times = np.stack([along / speed, along / speed, down / speed], axis=-1)
        self._decay = np.exp(-step / times)
        self._gain = np.sqrt(1.0 - self._decay**2) * sigma[:, None]
        self._first = np.zeros_like(times)
        self._second = np.zeros_like(times)

    def advance(self, white: Array) -> Array:
        """Gust velocity (n, 3) after one more step with this unit white noise."""
        self._first = self._decay * self._first + self._gain * white
        self._second = self._decay * self._second + (1.0 - self._decay) * self._first
        # (1 + sqrt(3) T s) / (1 + T s)^2 splits into the first-order part and its own lag; the variance is the same.
        across = np.sqrt(1.5) * self._first + (1.0 - np.sqrt(3.0)) / np.sqrt(2.0) * self._second
        return np.concatenate([self._first[:, :1], across[:, 1:]], axis=-1)
