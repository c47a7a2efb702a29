"""Fit the parameters of all effects together: robust nonlinear least squares, intervals by block bootstrap."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import stats
from scipy.linalg import solve_triangular
from scipy.optimize import lsq_linear

from quadctl.effects import Effect, Parameter
from quadctl.lab.arrays import Floats, Mask
from quadctl.lab.data import Dataset
from quadctl.lab.nuisance import KINDS, MOST, predicted_with, sensitivity
from quadctl.lab.threads import one_blas_thread
from quadctl.model import Model

BOOTSTRAPS = 1000
MAX_STEPS = 40
MAX_HALVINGS = 6
LONGEST = 0.3
"""No step goes further than this share of a parameter's range."""
CLOSE_ENOUGH = 1e-3
"""A step that moves the prediction by less than this share of the noise is the last."""
HUBER_SIGMAS = 3.0
"""Residuals beyond this many (robust) standard deviations count linearly, not squared."""

LEAST_NOISE = 1e-4
"""The noise of no axis is taken as less than this share of the largest."""
UNSEEN = 4.0
"""A parameter that changes the sum of squares (in noise units) by less than this over its whole range is not seen."""


@dataclass(frozen=True)
class Free:
    """One fitted parameter: which effect of the stack, and its declaration."""

    effect: int
    parameter: Parameter


def judged(model: Model, dataset: Dataset) -> tuple[Model, Floats]:
    """`model` fitted to all data, and what fits leave of the parts that they did not see, shape (n, 3 or 6)."""
    fitter = Fitter(model, dataset)
    fitted = fitter.fit()
    return fitted.model, dataset.targets - fitter.held_out(fitted)


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


@dataclass(frozen=True, eq=False)
class Fitted:
    """A fitted model and the nuisances of the flights it was fitted on, shape (flights, kinds)."""

    model: Model
    nuisances: Floats

    def predicted(self, dataset: Dataset) -> Floats:
        """Prediction of every sample's targets, nuisances included, shape (n, 3 or 6)."""
        flights = zip(dataset.flights, self.nuisances, strict=True)
        return np.concatenate([predicted_with(self.model, f, nuisance, dataset.groups) for f, nuisance in flights])


class Fitter:
    """Fits one form of model, and the nuisances of each flight, to parts of one dataset.

    The fit minimises the robust sum of squares of the residual, in units of its noise, plus the squares of the
    nuisances in units of their usual size.
    """

    def __init__(self, model: Model, dataset: Dataset) -> None:
        self.dataset = dataset.timed_for(model)
        self.model = model
        self.free = free_parameters(model)
        count = len(dataset.flights)
        self._low = np.concatenate([[f.parameter.low for f in self.free], np.tile(-MOST, count)])
        self._high = np.concatenate([[f.parameter.high for f in self.free], np.tile(MOST, count)])
        replaced = {name for effect in model.effects for name in effect.replaces}
        # A nuisance that an effect of the model stands for is held at 0: the two could not be told apart.
        self._usual = np.tile([1e-4 * k.usual if k.name in replaced else k.usual for k in KINDS], count)

    @one_blas_thread
    def fit(self, used: Mask | None = None, start: Fitted | None = None) -> Fitted:
        """Fit on the samples `used` (all by default), from the model's present parameters or from an earlier fit.

        Gauss-Newton with bounded linear least squares for each step. The scale of the noise, which says what an outlier
        is, follows the fit.
        """
        fitted = start or Fitted(self.model, np.zeros((len(self.dataset.flights), len(KINDS))))
        rows = np.ones(len(self.dataset.targets), dtype=bool) if used is None else used
        for _ in range(MAX_STEPS):
            slopes = self._slopes(fitted, rows)
            step = self._bounded_step(self._values(fitted), slopes)
            moved = slopes.j[rows] @ step
            fitted, taken = self._downhill(fitted, step, slopes.scale, rows)
            if taken == 0.0 or np.sqrt(np.mean((taken * moved) ** 2)) < CLOSE_ENOUGH:
                break
        return fitted

    @one_blas_thread
    def held_out(self, fitted: Fitted) -> Floats:
        """Prediction of every sample's targets by a fit that has not seen its fold, shape (n, 3 or 6).

        `fitted` is the fit to all samples. Without a few blocks the optimum moves little: one Gauss-Newton step from
        it, no further than it is downhill, is the refit to first order. Without a whole flight it may move far, and the
        fit is done again; the nuisances of that flight are then not known and stay where nothing pulls them, at 0.
        """
        predicted = np.empty_like(self.dataset.targets)
        slopes = self._slopes(fitted)
        for number in self.dataset.folds:
            held = self.dataset.fold == number
            if self.dataset.whole_flights:
                known = np.isin(np.arange(len(self.dataset.flights)), self.dataset.flight_index[~held])
                refitted = self.fit(~held, Fitted(fitted.model, np.where(known[:, None], fitted.nuisances, 0.0)))
            else:
                normal, gradient = slopes.sums(~held)
                step = self._step(normal[None], gradient[None], slopes)[0]
                refitted, _ = self._downhill(fitted, step, slopes.scale, ~held)
            predicted[held] = refitted.predicted(self.dataset)[held]
        return predicted

    @one_blas_thread
    def bootstrap(self, fitted: Fitted, seed: int = 0) -> Floats:
        """Free parameters of `BOOTSTRAPS` refits on resampled blocks of time, shape (draws, p), within their bounds.

        Each draw is one Gauss-Newton step from the optimum with the blocks' new weights, which is the refit to first
        order, with the robust weights of the fit. What the data cannot tell of a nuisance is as uncertain as its prior
        says: each draw has a prior of its own, about another centre.
        """
        n_free = len(self.free)
        if not n_free:
            return np.empty((BOOTSTRAPS, 0))
        slopes = self._slopes(fitted)
        blocks = np.unique(self.dataset.block, return_inverse=True)[1]
        count = int(blocks.max()) + 1
        random = np.random.default_rng(seed)
        weight = random.multinomial(count, np.full(count, 1.0 / count), size=BOOTSTRAPS).astype(float)
        normals, gradients = slopes.sums_per(blocks, count)
        p = normals.shape[-1]
        normal = (weight @ normals.reshape(count, p * p)).reshape(BOOTSTRAPS, p, p)
        centres = np.zeros((BOOTSTRAPS, p))
        centres[:, n_free:] = self._usual * random.standard_normal((BOOTSTRAPS, p - n_free))
        # Few blocks know little of their own spread: Student's t for the normal distribution, n - 1 for n.
        wider = float(stats.t.ppf(0.975, count - 1)) / 1.96 * math.sqrt(count / (count - 1)) if count > 1 else 1.0
        steps = wider * self._step(normal, weight @ gradients + slopes.prior * centres, slopes)
        values = self._values(fitted)
        draws = np.clip(values + steps, self._low, self._high)[:, :n_free]
        unseen = self._unseen(slopes.j, slice(n_free)) | self._unseen_at_bounds(values[:n_free], draws, slopes.scale)
        either = random.integers(0, 2, size=draws.shape)
        # A parameter that is not seen may be anything that is possible.
        draws[:, unseen] = np.where(either, self._high[:n_free], self._low[:n_free])[:, unseen]
        return draws

    def tangent(self, scale: Floats) -> Floats:
        """Orthonormal basis of what small changes of the parameters and nuisances do to the targets, which are in units
        of `scale` per axis: shape (n * axes, p)."""
        parameters = self._parameter_slopes(values_of(self.model, self.free))
        j = np.concatenate([parameters, self._nuisance_slopes(self.model)], axis=-1) / scale[None, :, None]
        u, size, _ = np.linalg.svd(j.reshape(-1, j.shape[-1]) * (self._high - self._low), full_matrices=False)
        return np.asarray(u[:, size > 1e-9 * max(float(size[0]), 1e-9)])

    def _unseen(self, j: Floats, which: slice) -> Mask:
        """Parameters whose whole range changes the sum of squares by next to nothing; `j` in units of the noise."""
        unit = (self._high - self._low)[which]
        return np.asarray(np.einsum("nap,nap->p", j[..., which], j[..., which]) * unit**2 < UNSEEN)

    def _unseen_at_bounds(self, values: Floats, draws: Floats, scale: Floats) -> Mask:
        """Parameters that are not seen once another is at the bound that its interval reaches (no a, no b)."""
        n_free = len(self.free)
        lowest, highest = np.percentile(draws, [2.5, 97.5], axis=0)
        found = np.zeros(n_free, dtype=bool)
        for i in range(n_free):
            at_bound = self._low[i] if lowest[i] <= self._low[i] else self._high[i]
            if lowest[i] <= self._low[i] or highest[i] >= self._high[i]:
                moved = np.where(np.arange(n_free) == i, at_bound, values)
                unseen = self._unseen(self._parameter_slopes(moved) / scale[None, :, None], slice(n_free))
                found |= unseen & (np.arange(n_free) != i)
        return found

    def _slopes(self, fitted: Fitted, rows: Mask | None = None) -> "_Slopes":
        rows = np.ones(len(self.dataset.targets), dtype=bool) if rows is None else rows
        residual = self.dataset.targets - fitted.predicted(self.dataset)
        scale = noise_scale(residual[rows])
        parameters = self._parameter_slopes(values_of(fitted.model, self.free))
        j = np.concatenate([parameters, self._nuisance_slopes(fitted.model)], axis=-1) / scale[None, :, None]
        values = self._values(fitted)
        unit = self._high - self._low
        # What the fit has pushed against a bound stays there, as it would in a refit.
        moves = np.flatnonzero((values - self._low > 1e-6 * unit) & (self._high - values > 1e-6 * unit))
        prior = np.concatenate([np.zeros(len(self.free)), 1.0 / self._usual**2])
        return _Slopes(rows, scale, j, residual / scale, moves, prior, -prior * values)

    def _step(self, normal: Floats, gradient: Floats, slopes: "_Slopes") -> Floats:
        """Gauss-Newton steps for normal matrices of shape (draws, p, p) and gradients of shape (draws, p)."""
        a, b = self._with_prior(normal, gradient, slopes)
        moves = slopes.moves
        steps = np.zeros_like(b)
        kept = np.ix_(np.arange(len(a)), moves, moves)
        steps[:, moves] = np.linalg.solve(a[kept], b[:, moves, None])[..., 0]
        return np.asarray((self._high - self._low) * steps)

    def _with_prior(self, normal: Floats, gradient: Floats, slopes: "_Slopes") -> tuple[Floats, Floats]:
        """Normal matrices and gradients with the prior of the nuisances, in units of the range of each parameter."""
        unit = self._high - self._low
        a = (normal + np.diag(slopes.prior)) * np.outer(unit, unit)
        # The tiny ridge decides only directions that the data do not see at all.
        ridge = 1e-9 * np.diagonal(a, axis1=-2, axis2=-1) + 1e-6
        return a + ridge[..., None] * np.eye(len(unit)), (gradient + slopes.prior_gradient) * unit

    def _bounded_step(self, values: Floats, slopes: "_Slopes") -> Floats:
        """The Gauss-Newton step that stays within the bounds, and within `LONGEST` of the range of each of them."""
        unit = self._high - self._low
        normal, gradient = slopes.sums(slopes.rows)
        a, b = self._with_prior(normal, gradient, slopes)
        low = np.maximum((self._low - values) / unit, -LONGEST)
        high = np.minimum((self._high - values) / unit, LONGEST)
        # min |L' s - L^-1 b| has the normal equations a s = b.
        factor = np.linalg.cholesky(a)
        result = lsq_linear(factor.T, solve_triangular(factor, b, lower=True), (low, high + 1e-12), method="bvls")
        return np.asarray(unit * result.x)

    def _downhill(self, fitted: Fitted, step: Floats, scale: Floats, rows: Mask) -> tuple[Fitted, float]:
        """The fit after the longest of `step`, its half, its quarter... that lowers the cost, and that share."""
        before = self._cost(fitted, scale, rows)
        values = self._values(fitted)
        share = 1.0
        for _ in range(MAX_HALVINGS):
            moved = np.clip(values + share * step, self._low, self._high)
            candidate = self._fitted(moved)
            if self._cost(candidate, scale, rows) < before:
                return candidate, share
            share *= 0.5
        return fitted, 0.0

    def misfit(self, fitted: Fitted, scale: Floats) -> float:
        """What a fit of all samples minimises, for noise of `scale` per axis: to compare fits of other models."""
        return self._cost(fitted, scale, np.ones(len(self.dataset.targets), dtype=bool))

    def _cost(self, fitted: Fitted, scale: Floats, rows: Mask) -> float:
        """Soft-L1 loss of the samples in units of their noise; a prior's term is never an outlier."""
        e = (self.dataset.targets - fitted.predicted(self.dataset))[rows] / scale
        loss = 2.0 * HUBER_SIGMAS**2 * (np.sqrt(1.0 + (e / HUBER_SIGMAS) ** 2) - 1.0)
        return float(loss.sum() + np.sum((fitted.nuisances.ravel() / self._usual) ** 2))

    def _fitted(self, values: Floats) -> Fitted:
        return Fitted(self._model(values), values[len(self.free) :].reshape(-1, len(KINDS)))

    def _values(self, fitted: Fitted) -> Floats:
        return np.concatenate([values_of(fitted.model, self.free), fitted.nuisances.ravel()])

    def _model(self, values: Floats) -> Model:
        return with_values(self.model, self.free, values[: len(self.free)])

    def _parameter_slopes(self, values: Floats) -> Floats:
        """d prediction / d free parameter, shape (n, axes, p), by differences that stay within the bounds."""
        found = np.empty((*self.dataset.targets.shape, len(self.free)))
        if not self.free:
            return found
        here = self.dataset.predicted_targets(self._model(values))
        for i in range(len(self.free)):
            step = 1e-4 * (self._high[i] - self._low[i])
            step = step if values[i] + step <= self._high[i] else -step
            moved = values.copy()
            moved[i] += step
            found[..., i] = (self.dataset.predicted_targets(self._model(moved)) - here) / step
        return found

    def _nuisance_slopes(self, model: Model) -> Floats:
        """d prediction / d nuisance, shape (n, axes, flights * kinds): a nuisance moves only its own flight."""
        count = len(self.dataset.flights)
        found = np.zeros((*self.dataset.targets.shape, count, len(KINDS)))
        for i, flight in enumerate(self.dataset.flights):
            found[self.dataset.flight_index == i, :, i] = sensitivity(model, flight, self.dataset.groups)
        return found.reshape(*self.dataset.targets.shape, count * len(KINDS))


@dataclass(frozen=True, eq=False)
class _Slopes:
    """A fit and its neighbourhood, in units of the noise."""

    rows: Mask
    """Samples that the noise was taken from."""
    scale: Floats
    """Of the noise, per axis."""
    j: Floats
    """d prediction / d (parameters, nuisances), shape (n, axes, p)."""
    e: Floats
    """Residual, shape (n, axes)."""
    moves: NDArray[np.intp]
    """Of the p, those that are not at a bound."""
    prior: Floats
    prior_gradient: Floats

    @cached_property
    def robust(self) -> Floats:
        """Weights of the samples by the soft-L1 loss."""
        return np.asarray(1.0 / np.sqrt(1.0 + (self.e / HUBER_SIGMAS) ** 2))

    @cached_property
    def _weighted(self) -> Floats:
        return self.j * self.robust[..., None]

    def sums(self, rows: Mask) -> tuple[Floats, Floats]:
        """Normal matrix and gradient of the samples `rows`."""
        p = self.j.shape[-1]
        j, w = self.j[rows].reshape(-1, p), self._weighted[rows].reshape(-1, p)
        return w.T @ j, w.T @ self.e[rows].ravel()

    def sums_per(self, group: NDArray[np.intp], count: int) -> tuple[Floats, Floats]:
        """The same for every group of samples, shapes (count, p, p) and (count, p)."""
        found = [self.sums(group == number) for number in range(count)]
        return np.array([normal for normal, _ in found]), np.array([gradient for _, gradient in found])


def noise_scale(residual: Floats) -> Floats:
    """Robust standard deviation of each axis about zero, shape (axes,)."""
    deviation = 1.4826 * np.median(np.abs(residual), axis=0)
    return np.asarray(np.maximum(deviation, LEAST_NOISE * max(float(deviation.max()), 1e-3)))


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
