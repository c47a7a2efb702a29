"""Fit the parameters of all effects together: robust nonlinear least squares, intervals by block bootstrap."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from quadctl.effects import Effect, Parameter
from quadctl.lab.data import Dataset
from quadctl.lab.prepare import Floats
from quadctl.model import Model

BOOTSTRAPS = 1000
HUBER_SIGMAS = 3.0
"""Residuals beyond this many (robust) standard deviations count linearly, not squared."""

UNSEEN = 4.0
"""A parameter that changes the sum of squares (in noise units) by less than this over its whole range is not seen."""


@dataclass(frozen=True)
class Free:
    """One fitted parameter: which effect of the stack, and its declaration."""

    effect: int
    parameter: Parameter


def free_parameters(model: Model) -> list[Free]:
    """The parameters of the stack that a fit may move."""
    return [Free(i, p) for i, effect in enumerate(model.effects) for p in effect.parameters() if p.fitted]


def values_of(model: Model, free: Sequence[Free]) -> Floats:
    return np.array([getattr(model.effects[f.effect], f.parameter.name) for f in free])


def with_values(model: Model, free: Sequence[Free], values: Floats) -> Model:
    """The model with its free parameters at `values`."""
    changed: list[dict[str, float]] = [effect.values() for effect in model.effects]
    for f, value in zip(free, values, strict=True):
        changed[f.effect][f.parameter.name] = float(value)
    effects: list[Effect] = [type(e)(**v) for e, v in zip(model.effects, changed, strict=True)]
    return model.with_effects(effects)


class Fitter:
    """Fits one form of model to parts of one dataset."""

    def __init__(self, model: Model, dataset: Dataset) -> None:
        self.dataset = dataset
        self.model = model
        self.free = free_parameters(model)
        self._low = np.array([f.parameter.low for f in self.free])
        self._high = np.array([f.parameter.high for f in self.free])

    def fit(self, used: NDArray[np.bool_] | None = None) -> Model:
        """Fit on the samples `used` (all by default), from the model's present parameters.

        Two passes: the first brings the residual near noise, the second weighs it by that noise.
        """
        if not self.free:
            return self.model
        model = self.model
        for _ in range(2):
            scale = noise_scale(self._residual(model, used))
            model = self._least_squares(model, scale, used)
        return model

    def _least_squares(self, model: Model, scale: Floats, used: NDArray[np.bool_] | None) -> Model:
        def weighted(values: Floats) -> Floats:
            return (self._residual(with_values(model, self.free, values), used) / scale).ravel()

        inside = 1e-6 * (self._high - self._low)
        result = least_squares(
            weighted,
            np.clip(values_of(model, self.free), self._low + inside, self._high - inside),
            bounds=(self._low, self._high),
            x_scale=0.1 * (self._high - self._low),
            loss="soft_l1",
            f_scale=HUBER_SIGMAS,
            diff_step=np.array(1e-4),
            max_nfev=60,
            xtol=1e-6,
            ftol=1e-7,
        )
        return with_values(model, self.free, result.x)

    def _residual(self, model: Model, used: NDArray[np.bool_] | None) -> Floats:
        residual = self.dataset.residual(model)
        return residual if used is None else residual[used]

    def held_out(self, fitted: Model) -> Floats:
        """Prediction of every sample by a fit that has not seen its fold, shape (n, 3); starts from `fitted`."""
        predicted = np.empty_like(self.dataset.measured)
        fitter = Fitter(fitted, self.dataset)
        for number in self.dataset.folds:
            held = self.dataset.fold == number
            model = fitter.fit(~held)
            predicted[held] = self.dataset.predicted(model)[held]
        return predicted

    def jacobian(self, fitted: Model) -> Floats:
        """d prediction / d parameter at `fitted`, shape (n, 3, p)."""
        values = values_of(fitted, self.free)
        columns = []
        for i in range(len(self.free)):
            step = 1e-4 * (self._high[i] - self._low[i])
            ends = []
            for sign in (-1.0, 1.0):
                moved = values.copy()
                moved[i] = np.clip(values[i] + sign * step, self._low[i], self._high[i])
                ends.append((moved[i], self.dataset.predicted(with_values(fitted, self.free, moved))))
            (a, below), (b, above) = ends
            columns.append((above - below) / (b - a))
        return np.stack(columns, axis=-1)

    def bootstrap(self, fitted: Model, seed: int = 0) -> Floats:
        """Parameters of `BOOTSTRAPS` refits on resampled blocks of time, shape (draws, p), within their bounds.

        Each draw is one Gauss-Newton step from the optimum with the blocks' new weights, which is the refit to first
        order, with the robust weights of the fit.
        """
        if not self.free:
            return np.empty((BOOTSTRAPS, 0))
        residual = self.dataset.residual(fitted)
        scale = noise_scale(residual)
        e = residual / scale
        j = self.jacobian(fitted) / scale[None, :, None]
        robust = 1.0 / np.sqrt(1.0 + (e / HUBER_SIGMAS) ** 2)
        blocks = self.dataset.block
        count = int(blocks.max()) + 1
        p = len(self.free)
        gradient = np.zeros((count, p))
        normal = np.zeros((count, p, p))
        np.add.at(gradient, blocks, np.einsum("nap,na->np", j, robust * e))
        np.add.at(normal, blocks, np.einsum("nap,naq,na->npq", j, j, robust))
        present = np.flatnonzero(np.bincount(blocks, minlength=count))
        random = np.random.default_rng(seed)
        values = values_of(fitted, self.free)
        unit = self._high - self._low
        draws = np.empty((BOOTSTRAPS, p))
        unseen = np.einsum("nap,nap->p", j, j) * unit**2 < UNSEEN
        for i in range(BOOTSTRAPS):
            weight = np.bincount(random.choice(present, len(present)), minlength=count).astype(float)
            a = np.tensordot(weight, normal, axes=1) * np.outer(unit, unit)
            b = weight @ gradient * unit
            # The tiny ridge decides only directions that the data do not see at all.
            a += 1e-9 * (np.trace(a) / p + 1e-12) * np.eye(p)
            draws[i] = np.clip(values + unit * np.linalg.solve(a, b), self._low, self._high)
        either = random.integers(0, 2, size=draws.shape)
        draws[:, unseen] = np.where(either, self._high, self._low)[:, unseen]  # anything that is possible
        return draws


def noise_scale(residual: Floats) -> Floats:
    """Robust standard deviation of each axis about zero, shape (3,)."""
    return np.maximum(1.4826 * np.median(np.abs(residual), axis=0), 1e-3)


def intervals(free: Sequence[Free], draws: Floats) -> list[tuple[float, float]]:
    """95 % percentile interval of each free parameter."""
    if not free:
        return []
    low, high = np.percentile(draws, [2.5, 97.5], axis=0)
    return [(float(a), float(b)) for a, b in zip(low, high, strict=True)]


def remarks(free: Sequence[Free], values: Floats, ci: Sequence[tuple[float, float]]) -> list[str]:
    """What a user must know about the fitted parameters: at a bound, or not determined by these data."""
    found = []
    for f, value, (low, high) in zip(free, values, ci, strict=True):
        p = f.parameter
        span = p.high - p.low
        if p.high - value < 1e-3 * span:
            found.append(f"{p.name} is at its upper bound {p.high:g}: the form does not fit, or the data do not tell")
        elif value - p.low < 1e-3 * span and p.low == 0.0:
            found.append(f"{p.name} came out as 0: these data show none of it")
        elif value - p.low < 1e-3 * span:
            found.append(f"{p.name} is at its lower bound {p.low:g}: the form does not fit, or the data do not tell")
        if high - low > 0.8 * span:
            found.append(f"{p.name} is not determined by these data: its interval spans most of what is possible")
    return found
