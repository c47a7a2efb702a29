"""What the samples of one flight leave behind for a fit: sums of squares and products of slopes and residual."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from quadctl.lab.arrays import Floats
from quadctl.lab.fitting.nuisances import KINDS, sensitivity
from quadctl.lab.fitting.parameters import free_parameters, parameter_slopes
from quadctl.lab.flights.flight import Flight
from quadctl.lab.flights.prediction import predict_targets
from quadctl.model import Model

HUBER_SIGMAS = 3.0
"""Residuals beyond this many (robust) standard deviations count linearly, not squared."""


def slopes_and_residual(
    model: Model,
    flight: Flight,
    groups: Sequence[str],
    residual: Floats,
    scale: Floats,
    near: Floats | None = None,
) -> Floats:
    """Slopes of the prediction to the p parameters and the flight's nuisances, then its residual.

    Shape (n, axes, m), m = p + kinds + 1, in units of the noise, which is `scale`, shape (axes,). `near` as in
    `sensitivity`.
    """
    p = len(free_parameters(model))
    here = predict_targets(model, flight, groups)
    columns = np.empty((*here.shape, p + len(KINDS) + 1))
    columns[..., :p] = parameter_slopes(model, flight, groups, here)
    columns[..., p:-1] = sensitivity(model, flight, groups, here, near)
    columns[..., -1] = residual
    columns /= scale[:, None]
    return columns


def worth(flight: Flight, groups: Sequence[str]) -> Floats:
    """What a sample of each axis counts for, beside the priors of nuisances: moments go through a slow filter, which
    makes them alike over seconds, shape (axes,)."""
    return np.repeat([flight.slow_share if group == "turning" else 1.0 for group in groups], 3)


def soft_l1_loss(residual: Floats, counts: Floats) -> float:
    """Sum of the soft-L1 loss of residuals in units of the noise, shape (n, axes); `counts` as `worth` gives them."""
    loss = 2.0 * HUBER_SIGMAS**2 * (np.sqrt(1.0 + (residual / HUBER_SIGMAS) ** 2) - 1.0)
    return float(np.sum(loss, axis=0) @ counts)


def robust_weights(columns: Floats, counts: Floats) -> Floats:
    """Of the samples, by the soft-L1 loss of their residual, the last of the columns; shape (n, axes)."""
    return np.asarray(counts / np.sqrt(1.0 + (columns[..., -1] / HUBER_SIGMAS) ** 2))


def products(columns: Floats, weights: Floats | None = None) -> Floats:
    """Sums over samples and axes of the squares and products of `columns`, (n, axes, m); shape (m, m)."""
    flat = columns.reshape(-1, columns.shape[-1])
    weighted = flat if weights is None else flat * weights.reshape(-1, 1)
    return np.asarray(weighted.T @ flat)


def resampled_sums(sums: Floats, times: NDArray[np.uint16], first: NDArray[np.intp]) -> Floats:
    """The sums of each flight when every block of time counts so many `times`, shape (draws, flights, m, m).

    `sums` are those of the blocks, shape (blocks, m, m); `times` has the shape (draws, blocks); `first` is the first
    block of each flight.
    """
    count, m, _ = sums.shape
    flat = sums.reshape(count, m * m)
    ends = [*first[1:], count]
    each = [times[:, a:b].astype(float) @ flat[a:b] for a, b in zip(first, ends, strict=True)]
    return np.stack(each, axis=1).reshape(len(times), len(first), m, m)
