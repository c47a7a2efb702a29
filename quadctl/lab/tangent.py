"""What small changes of a model's parameters and of the flights' nuisances do to the predictions, to first order."""

import numpy as np

from quadctl.lab.arrays import Floats
from quadctl.lab.data import Dataset, predict_targets
from quadctl.lab.nuisance import MOST, sensitivity
from quadctl.lab.parameters import free_parameters, parameter_slopes
from quadctl.model import Model

SEEN = 1e-9
"""A direction of the parameters, in units of their ranges, that does less than this share of what others do is none."""


class Tangent:
    """The space of those changes of a dataset's targets, in units of `scale` per axis, shape (axes,).

    It is held as orthonormal columns: those of the nuisances of each flight, which are 0 in every other flight, and
    those of what is left of the parameters' slopes beside them.
    """

    def __init__(self, model: Model, dataset: Dataset, scale: Floats) -> None:
        self._parts = dataset.parts
        self._own: list[Floats] = []
        ranges = np.array([f.parameter.high - f.parameter.low for f in free_parameters(model)])
        size, beside = 0.0, []
        for flight in dataset.flights:
            here = predict_targets(model, flight, dataset.groups)
            nuisances = sensitivity(model, flight, dataset.groups, here) / scale[:, None] * (2.0 * MOST)
            parameters = parameter_slopes(model, flight, dataset.groups, here) / scale[:, None] * ranges
            own = _orthonormal(_flat(nuisances), 0.0)
            size = max(size, float(np.linalg.norm(parameters)))
            self._own.append(own)
            beside.append(_without(own, _flat(parameters)))
        self._shared = _orthonormal(np.concatenate(beside), SEEN * size)

    def rest(self, change: Floats) -> Floats:
        """Of a change of the targets in units of the noise, shape (n, axes): what no parameter and no nuisance does."""
        apart = [_without(own, change[part].ravel()) for own, part in zip(self._own, self._parts, strict=True)]
        return _without(self._shared, np.concatenate(apart)).reshape(change.shape)


def _flat(slopes: Floats) -> Floats:
    n, axes, columns = slopes.shape
    return slopes.reshape(n * axes, columns)


def _orthonormal(columns: Floats, least: float) -> Floats:
    """Basis of what `columns` span, but for what is smaller than `least` or next to nothing; shape (n, r)."""
    u, size, _ = np.linalg.svd(columns, full_matrices=False)
    return np.asarray(u[:, size > max(least, SEEN * max(float(size.max(initial=0.0)), SEEN))])


def _without(basis: Floats, values: Floats) -> Floats:
    """`values`, (n,) or (n, columns), less their part along the orthonormal `basis`, (n, r)."""
    return np.asarray(values - basis @ (basis.T @ values))
