"""Band-limited random signals: estimator noise, drift and gusts."""

import numpy as np
from scipy.ndimage import gaussian_filter1d
from scipy.signal import lfilter

from studies.worlds.field.arrays import Floats


def first_order_noise(
    rng: np.random.Generator, samples: int, step_s: float, sigma: float, time_s: float, columns: int
) -> Floats:
    """Stationary first-order Gauss-Markov noise, shape (samples, columns), standard deviation `sigma`."""
    decay = float(np.exp(-step_s / time_s))
    white = rng.normal(0.0, 1.0, (samples, columns)) * np.sqrt(1.0 - decay**2)
    start = rng.normal(0.0, 1.0, (1, columns))
    filtered, _ = lfilter([1.0], [1.0, -decay], white, axis=0, zi=decay * start)
    return np.asarray(filtered * sigma, dtype=np.float64)


def smooth_noise(
    rng: np.random.Generator, samples: int, step_s: float, sigma: float, time_s: float, columns: int
) -> Floats:
    """Noise of Gaussian correlation (differentiable), shape (samples, columns), standard deviation `sigma`."""
    width = max(time_s / step_s / np.sqrt(2.0), 0.5)
    edge = int(4.0 * width) + 1
    white = rng.normal(0.0, 1.0, (samples + 2 * edge, columns))
    filtered = gaussian_filter1d(white, width, axis=0)[edge : edge + samples]
    # White noise through a Gaussian of this width keeps 1 / (2 sqrt(pi) width) of its variance.
    return np.asarray(filtered * sigma * np.sqrt(2.0 * np.sqrt(np.pi) * width))


def passing_noise(
    rng: np.random.Generator, samples: int, step_s: float, sigma: float, time_s: float, columns: int
) -> Floats:
    """Smooth noise without its slow part, as in a velocity that is kept in line with measured positions."""
    noise = smooth_noise(rng, samples, step_s, 1.0, time_s, columns)
    noise = noise - gaussian_filter1d(noise, max(2.0 * time_s, 0.4) / step_s, axis=0, mode="reflect")
    return np.asarray(sigma * noise / np.std(noise))


def gusts(
    rng: np.random.Generator, samples: int, step_s: float, sigma_m_s: float, air_m_s: float, height_m: float
) -> Floats:
    """Turbulence (north, east, down) in the manner of Dryden at low altitude, shape (samples, 3).

    The length scales of MIL-F-8785C grow with height; what passes the vehicle is frozen turbulence carried by the mean
    air velocity. Half of the variance is put in eddies four times smaller, as buildings and trees make them.
    """
    height = max(height_m, 1.0)
    vertical_length = height
    horizontal_length = min(height / (0.177 + 0.0027 * height) ** 1.2, 60.0)
    speed = max(air_m_s, 1.5)
    wind = np.zeros((samples, 3))
    for scale in (1.0, 0.25):
        horizontal = first_order_noise(rng, samples, step_s, np.sqrt(0.5), scale * horizontal_length / speed, 2)
        vertical = first_order_noise(rng, samples, step_s, np.sqrt(0.5), scale * vertical_length / speed, 1)
        wind += np.concatenate([horizontal, 0.7 * vertical], axis=1)
    return np.asarray(sigma_m_s * (wind - wind.mean(axis=0)))
