"""Linearisation: first-order changes of the predictions by the parameters of a model and the nuisances of the
flights."""

import numpy as np

from quadctl.lab.arrays import Floats
from quadctl.lab.fitting.nuisances import FORCES, PRIOR_STD, nuisance_jacobian
from quadctl.lab.fitting.parameters import free_parameters, parameter_jacobian
from quadctl.lab.flights.dataset import Dataset
from quadctl.lab.flights.prediction import predict_targets
from quadctl.model import Model

UNCONSTRAINED = 1e3
"""Factor on the prior standard deviation that leaves a nuisance practically unconstrained."""
RANK_TOLERANCE = 1e-9
"""Least relative singular value of a direction of the parameters that counts as independent of the others."""


class Tangent:
    """Projection that removes from a change of the targets what parameters and nuisances can explain, to first order.

    Changes are in units of `scale` per axis, shape (axes,), so that the noise has variance 1. A nuisance adds variance
    along the direction in which it changes the targets of its flight: `rest` divides by that standard deviation, so
    that what nuisances can easily explain counts little. The nuisances of the forces are unconstrained: a mass that
    changes at the beginning of the flight is nothing but a thrust scale. All others have their prior standard
    deviation: a weak rotor (an effect) looks like a large nuisance. Parameters are unconstrained.
    """

    def __init__(self, model: Model, dataset: Dataset, scale: Floats) -> None:
        self._parts = dataset.parts
        self._own: list[_WidenedNoise] = []
        prior_stds = np.where(np.arange(len(PRIOR_STD)) < FORCES, UNCONSTRAINED, 1.0) * PRIOR_STD
        free = free_parameters(model)
        ranges = np.array([f.parameter.high - f.parameter.low for f in free])
        size, beside = 0.0, []
        for flight in dataset.flights:
            predicted = predict_targets(model, flight, dataset.groups)
            own = _WidenedNoise(
                _flat(nuisance_jacobian(model, flight, dataset.groups, predicted) / scale[:, None] * prior_stds)
            )
            parameters = _flat(
                parameter_jacobian(model, flight, dataset.groups, predicted, free) / scale[:, None] * ranges
            )
            size = max(size, float(np.linalg.norm(parameters)))
            self._own.append(own)
            beside.append(own.whitened(parameters))
        self._shared = orthonormal(np.concatenate(beside), RANK_TOLERANCE * size)

    def rest(self, change: Floats) -> Floats:
        """Part of a change of the targets, in units of the noise, shape (n, axes), that parameters and nuisances do not
        explain."""
        apart = [own.whitened(change[part].ravel()) for own, part in zip(self._own, self._parts, strict=True)]
        flat = np.concatenate(apart)
        return np.asarray(flat - self._shared @ (self._shared.T @ flat)).reshape(change.shape)


class _WidenedNoise:
    """Gaussian noise with covariance I + N N': white noise of variance 1, and errors along the columns of N."""

    def __init__(self, columns: Floats) -> None:
        self._along, size, _ = np.linalg.svd(columns, full_matrices=False)
        self._taken = self._along * (1.0 - 1.0 / np.sqrt(1.0 + size**2))

    def whitened(self, values: Floats) -> Floats:
        """Multiply `values`, shape (n,) or (n, columns), by (I + N N')^(-1/2)."""
        return np.asarray(values - self._taken @ (self._along.T @ values))


def _flat(jacobian: Floats) -> Floats:
    n, axes, columns = jacobian.shape
    return jacobian.reshape(n * axes, columns)


def orthonormal(columns: Floats, least: float = 0.0) -> Floats:
    """Orthonormal basis of the span of `columns`, without singular values below `least` or the rank tolerance; shape
    (n, r)."""
    u, size, _ = np.linalg.svd(columns, full_matrices=False)
    return np.asarray(u[:, size > max(least, RANK_TOLERANCE * max(float(size.max(initial=0.0)), RANK_TOLERANCE))])
