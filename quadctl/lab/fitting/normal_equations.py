"""Normal equations of one flight: Gram matrix of the Jacobian and the residual, with robust weights."""

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.fft import rfft

from quadctl.lab.arrays import Floats
from quadctl.lab.fitting.noise import LEAST_VARIANCE, density
from quadctl.lab.fitting.nuisances import KINDS, nuisance_jacobian
from quadctl.lab.fitting.parameters import free_parameters, parameter_jacobian
from quadctl.lab.flights.flight import Flight
from quadctl.lab.flights.prediction import predict_targets
from quadctl.model import Model

SAMPLES_AT_ONCE = 4_000
HUBER_SIGMAS = 3.0
"""Residuals beyond this many (robust) standard deviations count linearly, not squared."""


def jacobian_and_residual(
    model: Model,
    flight: Flight,
    groups: Sequence[str],
    residual: Floats,
    scale: Floats,
    nearby_jacobian: Floats | None = None,
) -> Floats:
    """Jacobian of the prediction with respect to the p parameters and the flight's nuisances, then the residual.

    Shape (n, axes, m) with m = p + kinds + 1, in units of the noise `scale`, shape (axes,). `nearby_jacobian` is that
    of `nuisance_jacobian`.
    """
    p = len(free_parameters(model))
    predicted = predict_targets(model, flight, groups)
    columns = np.empty((*predicted.shape, p + len(KINDS) + 1))
    columns[..., :p] = parameter_jacobian(model, flight, groups, predicted)
    nuisance_jacobian(model, flight, groups, predicted, nearby_jacobian, out=columns[..., p:-1])
    columns[..., -1] = residual
    columns /= scale[:, None]
    return columns


def axis_weights(flight: Flight, groups: Sequence[str]) -> Floats:
    """Weight of a sample of each axis relative to the priors of the nuisances, shape (axes,). Moments are filtered over
    seconds, so that neighbouring samples are hardly independent."""
    return np.repeat([flight.slow_share if group == "turning" else 1.0 for group in groups], 3)


def soft_l1_loss(residual: Floats, weights: Floats) -> float:
    """Sum of the soft-L1 loss of residuals in units of the noise, shape (n, axes); `weights` are those of
    `axis_weights`."""
    loss = 2.0 * HUBER_SIGMAS**2 * (np.sqrt(1.0 + (residual / HUBER_SIGMAS) ** 2) - 1.0)
    return float(np.sum(loss, axis=0) @ weights)


def robust_weights(columns: Floats, weights: Floats) -> Floats:
    """Weights of the samples, shape (n, axes), by the soft-L1 loss of their residual, which is the last of the
    columns."""
    return np.asarray(weights / np.sqrt(1.0 + (columns[..., -1] / HUBER_SIGMAS) ** 2))


def gram_matrix(columns: Floats, weights: Floats | None = None) -> Floats:
    """Gram matrix of `columns`, shape (n, axes, m), summed over samples and axes; shape (m, m)."""
    total = np.zeros((columns.shape[-1],) * 2)
    for here in slices(len(columns)):
        flat = columns[here].reshape(-1, columns.shape[-1])
        weighted = flat if weights is None else flat * weights[here].reshape(-1, 1)
        total += weighted.T @ flat
    return total


def gradient_covariance(columns: Floats, weights: Floats) -> Floats:
    """Covariance of the gradient, the sum of Jacobian times weighted residual, by the spectrum of that residual.

    `columns` has the shape (n, axes, m); shape (m - 1, m - 1). Columns count alike as to the power that a fit has taken
    from the noise (see `spectrum`).
    """
    n, axes, m = columns.shape
    total = np.zeros((m - 1, m - 1))
    for axis in range(axes):
        waves = rfft(columns[:, axis, :-1], axis=0)
        power = np.abs(waves) ** 2 / n
        taken = (power / np.maximum(power.sum(axis=0), LEAST_VARIANCE)).sum(axis=1)
        size = density(weights[:, axis] * columns[:, axis, -1], taken)
        for here in slices(len(waves)):
            total += ((np.conj(waves[here]) * size[here, None]).T @ waves[here]).real
    return total


def slices(count: int) -> Iterator[slice]:
    """Slices of `SAMPLES_AT_ONCE` samples: products of a long flight need no further copy of all its columns."""
    for begin in range(0, count, SAMPLES_AT_ONCE):
        yield slice(begin, min(begin + SAMPLES_AT_ONCE, count))


def resampled_gram_matrices(gram: Floats, times: NDArray[np.uint16], first: NDArray[np.intp]) -> Floats:
    """Gram matrix of each flight when every block of time counts `times`, shape (draws, flights, m, m).

    `gram` holds the matrices of the blocks, shape (blocks, m, m); `times` has the shape (draws, blocks); `first` is the
    first block of each flight.
    """
    count, m, _ = gram.shape
    flat = gram.reshape(count, m * m)
    ends = [*first[1:], count]
    each = [times[:, a:b].astype(float) @ flat[a:b] for a, b in zip(first, ends, strict=True)]
    return np.stack(each, axis=1).reshape(len(times), len(first), m, m)
