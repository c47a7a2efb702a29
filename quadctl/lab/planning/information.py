"""What a flight tells about the parameters of a model, to first order, its nuisances being unknown."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from quadctl.lab.arrays import Floats
from quadctl.lab.fitting.consider_parameters import error_slopes
from quadctl.lab.fitting.nuisances import sensitivity, usual_sizes
from quadctl.lab.fitting.parameters import free_parameters, parameter_slopes
from quadctl.lab.flights.flight import Flight
from quadctl.lab.flights.prediction import predict_targets
from quadctl.model import Model


@dataclass(frozen=True, eq=False)
class Information:
    """A sum of squares over changes d of the free parameters, in units of the noise: power - 2 gradient d + d normal d.

    `normal` has the shape (p, p): it is Fisher's information. `gradient`, shape (p,), and `power` are of what the model
    would have to imitate. `pull`, shape (p, errors), is that of errors that no data tell of (see `considered`), each of
    its usual size. Independent data add up.
    """

    normal: Floats
    gradient: Floats
    power: float = 0.0
    pull: Floats | None = None

    def __add__(self, other: "Information") -> "Information":
        pulls = [pull for pull in (self.pull, other.pull) if pull is not None]
        pull = sum(pulls[1:], pulls[0]) if pulls else None
        return Information(self.normal + other.normal, self.gradient + other.gradient, self.power + other.power, pull)

    @property
    def standard_errors(self) -> Floats:
        """Of the free parameters (the bound of Cramer and Rao, and what the errors that pull add), shape (p,)."""
        unit = 1.0 / np.sqrt(np.diag(self.normal))  # parameters of very different size
        covariance = np.linalg.pinv(self.normal * np.outer(unit, unit), hermitian=True)
        variance = np.diag(covariance)
        if self.pull is not None:
            variance = variance + np.sum((covariance @ (unit[:, None] * self.pull)) ** 2, axis=1)
        return np.asarray(unit * np.sqrt(variance))

    @property
    def left(self) -> float:
        """Of the power: what no change of the parameters imitates."""
        if not len(self.gradient):
            return self.power
        unit = 1.0 / np.sqrt(np.diag(self.normal))
        imitated = np.linalg.lstsq(self.normal * np.outer(unit, unit), self.gradient * unit, rcond=None)[0]
        return max(0.0, self.power - float(self.gradient * unit @ imitated))


def prior(model: Model) -> Information:
    """What is known before any flight: a parameter lies within its bounds, anywhere alike."""
    ranges = np.array([f.parameter.high - f.parameter.low for f in free_parameters(model)])
    return Information(np.diag(12.0 / ranges**2).reshape(len(ranges), len(ranges)), np.zeros(len(ranges)))


def information(
    model: Model,
    flight: Flight,
    groups: Sequence[str],
    noise: Floats,
    difference: Floats | None = None,
    considering: bool = False,
) -> Information:
    """What `flight` tells about the free parameters of `model`, whatever its nuisances within their usual size.

    `noise` is the standard deviation of each axis of the targets of `groups`, shape (axes,), as if the samples were
    independent. `difference`, shape (n, axes), is what the model would have to imitate. `considering`: with the pull of
    errors that no data tell of.
    """
    usual = usual_sizes(model)
    # In units of their usual size all nuisances have the prior 1.
    here = predict_targets(model, flight, groups)
    n = _flat(sensitivity(model, flight, groups, here), noise) * usual
    j = _flat(parameter_slopes(model, flight, groups, here), noise)
    d = np.zeros(len(j)) if difference is None else (difference / noise).ravel()
    factor = np.linalg.cholesky(n.T @ n + np.eye(len(usual)))
    nj, nd = np.linalg.solve(factor, n.T @ j), np.linalg.solve(factor, n.T @ d)
    pull = None
    if considering:
        e = _flat(error_slopes(model, flight, groups, here), noise)
        pull = j.T @ e - nj.T @ np.linalg.solve(factor, n.T @ e)
    return Information(j.T @ j - nj.T @ nj, j.T @ d - nj.T @ nd, float(d @ d - nd @ nd), pull)


def _flat(slopes: Floats, noise: Floats) -> Floats:
    """Slopes, shape (n, axes, p), in units of the noise, as (n * axes, p)."""
    n, axes, p = slopes.shape
    return np.asarray((slopes / noise[None, :, None]).reshape(n * axes, p))
