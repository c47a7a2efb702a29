"""What small changes of a model's parameters and of the flights' nuisances do to the predictions, to first order."""

import numpy as np

from quadctl.lab.arrays import Floats
from quadctl.lab.fitting.nuisances import FORCES, sensitivity, usual_sizes
from quadctl.lab.fitting.parameters import free_parameters, parameter_slopes
from quadctl.lab.flights.dataset import Dataset
from quadctl.lab.flights.prediction import predict_targets
from quadctl.model import Model

ANY = 1e3
"""Times its usual size a nuisance may be anything."""
SEEN = 1e-9
"""A direction of the parameters, in units of their ranges, that does less than this share of what others do is none."""


class Tangent:
    """Changes of a dataset's targets, in units of `scale` per axis, shape (axes,), seen beside what nuisances may do.

    In these units the noise has the variance 1. A nuisance adds to it along the direction in which it moves the targets
    of its flight: `rest` divides by that standard deviation, so that what nuisances can do easily counts for little. A
    nuisance of the moments has its usual size, for a weak rotor is like one that is larger. Those of the forces may
    have any: a mass that changes as the flight begins is nothing but a thrust scale. So may the parameters.
    """

    def __init__(self, model: Model, dataset: Dataset, scale: Floats) -> None:
        self._parts = dataset.parts
        self._own: list[_Wider] = []
        sizes = usual_sizes(model)
        sizes[:FORCES] *= ANY
        ranges = np.array([f.parameter.high - f.parameter.low for f in free_parameters(model)])
        size, beside = 0.0, []
        for flight in dataset.flights:
            here = predict_targets(model, flight, dataset.groups)
            own = _Wider(_flat(sensitivity(model, flight, dataset.groups, here) / scale[:, None] * sizes))
            parameters = _flat(parameter_slopes(model, flight, dataset.groups, here) / scale[:, None] * ranges)
            size = max(size, float(np.linalg.norm(parameters)))
            self._own.append(own)
            beside.append(own.whitened(parameters))
        self._shared = _orthonormal(np.concatenate(beside), SEEN * size)

    def rest(self, change: Floats) -> Floats:
        """Of a change of the targets in units of the noise, shape (n, axes): what no parameter does, and nuisances
        hardly."""
        apart = [own.whitened(change[part].ravel()) for own, part in zip(self._own, self._parts, strict=True)]
        flat = np.concatenate(apart)
        return np.asarray(flat - self._shared @ (self._shared.T @ flat)).reshape(change.shape)


class _Wider:
    """White noise of variance 1 and, on top, errors along some columns: covariance I + N N'."""

    def __init__(self, columns: Floats) -> None:
        self._along, size, _ = np.linalg.svd(columns, full_matrices=False)
        self._taken = 1.0 - 1.0 / np.sqrt(1.0 + size**2)

    def whitened(self, values: Floats) -> Floats:
        """`values`, (n,) or (n, columns), times (I + N N')^(-1/2)."""
        return np.asarray(values - (self._along * self._taken) @ (self._along.T @ values))


def _flat(slopes: Floats) -> Floats:
    n, axes, columns = slopes.shape
    return slopes.reshape(n * axes, columns)


def _orthonormal(columns: Floats, least: float) -> Floats:
    """Basis of what `columns` span, but for what is smaller than `least` or next to nothing; shape (n, r)."""
    u, size, _ = np.linalg.svd(columns, full_matrices=False)
    return np.asarray(u[:, size > max(least, SEEN * max(float(size.max(initial=0.0)), SEEN))])
