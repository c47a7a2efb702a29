"""Draws of parameters that bounds hold: a normal distribution, truncated at what is physically possible."""

import numpy as np
from scipy.special import log_ndtr, ndtri_exp

from quadctl.lab.arrays import Floats

SWEEPS = 30
"""Gibbs sweeps over several parameters that bounds hold; after these the draws have forgotten where they began."""
LEAST_VARIANCE = 1e-24
"""Least variance of a draw, relative to the squared range: an effect that does nothing has none."""


def constrained_draws(draws: Floats, low: Floats, high: Floats, random: np.random.Generator) -> Floats:
    """Draw from the normal distribution of `draws`, shape (draws, k), within the bounds, shape (k,).

    Unbounded draws approximate the posterior of parameters without their bounds. The bounds cut this off: what is left
    is a truncated normal distribution (Gelfand, Smith & Lee 1992, J. Am. Stat. Assoc. 87: Bayesian analysis of
    constrained parameters, by Gibbs sampling).
    """
    unit = high - low
    lowest, highest, centre = low / unit, high / unit, draws.mean(axis=0) / unit
    apart = draws / unit - centre
    precision = np.linalg.inv(apart.T @ apart / len(draws) + LEAST_VARIANCE * np.eye(len(unit)))
    found = np.broadcast_to(np.clip(centre, lowest, highest), draws.shape).copy()
    for _ in range(SWEEPS if len(unit) > 1 else 1):
        for i in range(len(unit)):
            others = np.arange(len(unit)) != i
            own = centre[i] - (found[:, others] - centre[others]) @ precision[i, others] / precision[i, i]
            found[:, i] = _truncated_normal(own, precision[i, i] ** -0.5, lowest[i], highest[i], random)
    return np.asarray(found * unit)


def _truncated_normal(mean: Floats, std: float, low: float, high: float, random: np.random.Generator) -> Floats:
    """Draw one value for each `mean`, shape (n,), within `low` and `high`; exact also far out in a tail."""
    a, b = (low - mean) / std, (high - mean) / std
    mirrored = np.abs(a) > np.abs(b)  # the nearer bound becomes the lower one, whose tail is known exactly
    a, b = np.where(mirrored, -b, a), np.where(mirrored, -a, b)
    above_low, above_high = log_ndtr(-a), log_ndtr(-b)
    share = random.uniform(size=len(mean))
    at = -ndtri_exp(above_low + np.log(share + (1.0 - share) * np.exp(above_high - above_low)))
    return np.asarray(np.clip(mean + std * np.where(mirrored, -at, at), low, high))
