"""Fisher information of a flight about the parameters of a model, to first order, with unknown nuisances."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from quadctl.lab.arrays import Floats
from quadctl.lab.fitting.consider_parameters import consider_jacobian
from quadctl.lab.fitting.nuisances import KINDS, nuisance_jacobian, prior_std
from quadctl.lab.fitting.parameters import free_parameters, parameter_jacobian
from quadctl.lab.flights.flight import Flight
from quadctl.lab.flights.prediction import predict_targets
from quadctl.model import Model


@dataclass(frozen=True, eq=False)
class Information:
    """Quadratic function of changes d of the free parameters, in units of the noise: power - 2 gradient d + d normal d.

    `normal`, shape (p, p), is the Fisher information (normal matrix). `gradient`, shape (p,), and `power` belong to the
    difference that the parameters try to imitate. `consider_gradient`, shape (p, errors), is the gradient of each
    considered error (`consider_parameters`) of one standard deviation. Information of independent data adds up.
    """

    normal: Floats
    gradient: Floats
    power: float = 0.0
    consider_gradient: Floats | None = None

    def __add__(self, other: "Information") -> "Information":
        gradients = [g for g in (self.consider_gradient, other.consider_gradient) if g is not None]
        considered = sum(gradients[1:], gradients[0]) if gradients else None
        normal, gradient = self.normal + other.normal, self.gradient + other.gradient
        return Information(normal, gradient, self.power + other.power, considered)

    @property
    def standard_errors(self) -> Floats:
        """Standard errors of the free parameters, shape (p,): Cramer-Rao bound, and the considered errors."""
        unit = 1.0 / np.sqrt(np.diag(self.normal))  # parameters of very different size
        covariance = np.linalg.pinv(self.normal * np.outer(unit, unit), hermitian=True)
        variance = np.diag(covariance)
        if self.consider_gradient is not None:
            variance = variance + np.sum((covariance @ (unit[:, None] * self.consider_gradient)) ** 2, axis=1)
        return np.asarray(unit * np.sqrt(variance))

    @property
    def left(self) -> float:
        """Part of the power that no change of the parameters imitates."""
        if not len(self.gradient):
            return self.power
        unit = 1.0 / np.sqrt(np.diag(self.normal))
        imitated = np.linalg.lstsq(self.normal * np.outer(unit, unit), self.gradient * unit, rcond=None)[0]
        return max(0.0, self.power - float(self.gradient * unit @ imitated))


def prior(model: Model) -> Information:
    """Information before any flight: a parameter is uniformly distributed between its bounds."""
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
    """Information of `flight` about the free parameters of `model`; nuisances have their priors.

    `noise` is the standard deviation of each axis of the targets of `groups`, shape (axes,), as if samples were
    independent. `difference`, shape (n, axes), is what the parameters try to imitate. `considering` includes the
    gradient of the considered errors.
    """
    # In units of their prior standard deviations all nuisances have variance 1.
    predicted = predict_targets(model, flight, groups)
    n = _flat(nuisance_jacobian(model, flight, groups, predicted), noise) * prior_std(flight)
    j = _flat(parameter_jacobian(model, flight, groups, predicted), noise)
    d = np.zeros(len(j)) if difference is None else (difference / noise).ravel()
    factor = np.linalg.cholesky(n.T @ n + np.eye(len(KINDS)))
    nj, nd = np.linalg.solve(factor, n.T @ j), np.linalg.solve(factor, n.T @ d)
    consider_gradient = None
    if considering:
        e = _flat(consider_jacobian(model, flight, groups, predicted), noise)
        consider_gradient = j.T @ e - nj.T @ np.linalg.solve(factor, n.T @ e)
    return Information(j.T @ j - nj.T @ nj, j.T @ d - nj.T @ nd, float(d @ d - nd @ nd), consider_gradient)


def _flat(jacobian: Floats, noise: Floats) -> Floats:
    """Reshape a Jacobian, shape (n, axes, p), to (n * axes, p), in units of the noise."""
    n, axes, p = jacobian.shape
    return np.asarray((jacobian / noise[None, :, None]).reshape(n * axes, p))
