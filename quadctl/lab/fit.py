"""Fit the parameters of all effects together: robust nonlinear least squares, intervals by block bootstrap."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares
from threadpoolctl import ThreadpoolController

from quadctl.effects import Effect, Parameter
from quadctl.lab.data import Dataset, predict
from quadctl.lab.nuisance import KINDS, MOST, disturbed, sensitivity
from quadctl.lab.prepare import Floats, Mask
from quadctl.model import Model

_BLAS = ThreadpoolController().select(user_api="blas")
"""The matrices of a fit are small: several BLAS threads on them only wait for each other (ten times slower here)."""

BOOTSTRAPS = 1000
MAX_PASSES = 8
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


@dataclass(frozen=True, eq=False)
class Fitted:
    """A fitted model and the nuisances of the flights it was fitted on, shape (flights, kinds)."""

    model: Model
    nuisances: Floats

    def predicted(self, dataset: Dataset) -> Floats:
        """Prediction of every sample, nuisances included, shape (n, 3)."""
        flights = zip(dataset.flights, self.nuisances, strict=True)
        return np.concatenate([predict(self.model, disturbed(flight, nuisance)) for flight, nuisance in flights])


class Fitter:
    """Fits one form of model, and the nuisances of each flight, to parts of one dataset.

    The fit minimises the robust sum of squares of the residual, in units of its noise, plus the squares of the
    nuisances in units of their usual size.
    """

    def __init__(self, model: Model, dataset: Dataset) -> None:
        self.dataset = dataset
        self.model = model
        self.free = free_parameters(model)
        count = len(dataset.flights)
        self._low = np.concatenate([[f.parameter.low for f in self.free], np.tile(-MOST, count)])
        self._high = np.concatenate([[f.parameter.high for f in self.free], np.tile(MOST, count)])
        replaced = {name for effect in model.effects for name in effect.replaces}
        # A nuisance that an effect of the model stands for is held at 0: the two could not be told apart.
        self._usual = np.tile([1e-4 * k.usual if k.name in replaced else k.usual for k in KINDS], count)

    def fit(self, used: Mask | None = None, start: Fitted | None = None) -> Fitted:
        """Fit on the samples `used` (all by default), from the model's present parameters or from an earlier fit.

        The scale of the noise, which says what an outlier is, and the fit are found in turns until the scale stays.
        """
        fitted = start or Fitted(self.model, np.zeros((len(self.dataset.flights), len(KINDS))))
        rows = np.ones(len(self.dataset.measured), dtype=bool) if used is None else used
        scale = noise_scale((self.dataset.measured - fitted.predicted(self.dataset))[rows])
        for _ in range(MAX_PASSES):
            fitted = self._least_squares(fitted, scale, rows)
            last, scale = scale, noise_scale((self.dataset.measured - fitted.predicted(self.dataset))[rows])
            if np.all(np.abs(scale / last - 1.0) < 0.05):
                break
        return fitted

    def held_out(self, fitted: Fitted) -> Floats:
        """Prediction of every sample by a fit that has not seen its fold, shape (n, 3); starts from `fitted`.

        The nuisances of a flight that is held out as a whole are not known: they stay where nothing pulls them, at 0.
        """
        predicted = np.empty_like(self.dataset.measured)
        for number in self.dataset.folds:
            held = self.dataset.fold == number
            predicted[held] = self.fit(~held, fitted).predicted(self.dataset)[held]
        return predicted

    def bootstrap(self, fitted: Fitted, seed: int = 0) -> Floats:
        """Free parameters of `BOOTSTRAPS` refits on resampled blocks of time, shape (draws, p), within their bounds.

        Each draw is one Gauss-Newton step from the optimum with the blocks' new weights, which is the refit to first
        order, with the robust weights of the fit and the nuisances free.
        """
        n_free = len(self.free)
        if not n_free:
            return np.empty((BOOTSTRAPS, 0))
        residual = self.dataset.measured - fitted.predicted(self.dataset)
        scale = noise_scale(residual)
        e = residual / scale
        parameters = self._parameter_slopes(values_of(fitted.model, self.free))
        j = np.concatenate([parameters, self._nuisance_slopes(fitted.model)], axis=-1) / scale[None, :, None]
        robust = 1.0 / np.sqrt(1.0 + (e / HUBER_SIGMAS) ** 2)
        blocks = self.dataset.block
        count = int(blocks.max()) + 1
        p = j.shape[-1]
        gradient = np.zeros((count, p))
        normal = np.zeros((count, p, p))
        np.add.at(gradient, blocks, np.einsum("nap,na->np", j, robust * e))
        np.add.at(normal, blocks, np.einsum("nap,naq,na->npq", j, j, robust))
        present = np.flatnonzero(np.bincount(blocks, minlength=count))
        random = np.random.default_rng(seed)
        values = self._values(fitted)
        unit = self._high - self._low
        prior = np.concatenate([np.zeros(n_free), 1.0 / self._usual**2])
        # What the fit has pushed against a bound stays there, as it would in a refit.
        moves = np.flatnonzero((values - self._low > 1e-3 * unit) & (self._high - values > 1e-3 * unit))
        draws = np.tile(values, (BOOTSTRAPS, 1))
        with _BLAS.limit(limits=1):
            for i in range(BOOTSTRAPS):
                weight = np.bincount(random.choice(present, len(present)), minlength=count).astype(float)
                a = (np.tensordot(weight, normal, axes=1) + np.diag(prior)) * np.outer(unit, unit)
                b = (weight @ gradient - prior * values) * unit
                # The tiny ridge decides only directions that the data do not see at all.
                a += 1e-9 * (np.trace(a) / p + 1e-12) * np.eye(p)
                draws[i, moves] += unit[moves] * np.linalg.solve(a[np.ix_(moves, moves)], b[moves])
        draws = np.clip(draws, self._low, self._high)[:, :n_free]
        unseen = (np.einsum("nap,nap->p", j, j) * unit**2 < UNSEEN)[:n_free]
        either = random.integers(0, 2, size=draws.shape)
        # A parameter that is not seen may be anything that is possible.
        draws[:, unseen] = np.where(either, self._high[:n_free], self._low[:n_free])[:, unseen]
        return draws

    def _least_squares(self, start: Fitted, scale: Floats, rows: Mask) -> Fitted:
        n_free = len(self.free)
        slopes = self._nuisance_slopes(start.model)
        prior = np.zeros((len(self._usual), n_free + len(self._usual)))
        prior[:, n_free:] = np.diag(1.0 / self._usual)

        def residual(values: Floats) -> Floats:
            predicted = self.dataset.predicted(self._model(values)) + slopes @ values[n_free:]
            return np.asarray((self.dataset.measured - predicted)[rows] / scale)

        def cost(values: Floats) -> Floats:
            # The loss is applied to the samples alone: a prior's term is never an outlier.
            return np.concatenate([_soft(residual(values)).ravel(), values[n_free:] / self._usual])

        def slope(values: Floats) -> Floats:
            j = np.concatenate([self._parameter_slopes(values[:n_free]), slopes], axis=-1)[rows] / scale[:, None]
            j *= -_soft_slope(residual(values))[..., None]
            return np.concatenate([j.reshape(-1, j.shape[-1]), prior])

        inside = 1e-6 * (self._high - self._low)
        with _BLAS.limit(limits=1):
            result = least_squares(
                cost,
                np.clip(self._values(start), self._low + inside, self._high - inside),
                jac=slope,
                bounds=(self._low, self._high),
                x_scale=0.1 * (self._high - self._low),
                max_nfev=60,
                xtol=1e-7,
                ftol=1e-8,
            )
        values = np.where(result.x - self._low < 2.0 * inside, self._low, result.x)
        values = np.where(self._high - values < 2.0 * inside, self._high, values)
        return Fitted(self._model(values), values[n_free:].reshape(-1, len(KINDS)))

    def _values(self, fitted: Fitted) -> Floats:
        return np.concatenate([values_of(fitted.model, self.free), fitted.nuisances.ravel()])

    def _model(self, values: Floats) -> Model:
        return with_values(self.model, self.free, values[: len(self.free)])

    def _parameter_slopes(self, values: Floats) -> Floats:
        """d prediction / d free parameter, shape (n, 3, p), by differences that stay within the bounds."""
        found = np.empty((*self.dataset.measured.shape, len(self.free)))
        if not self.free:
            return found
        here = self.dataset.predicted(self._model(values))
        for i in range(len(self.free)):
            step = 1e-4 * (self._high[i] - self._low[i])
            step = step if values[i] + step <= self._high[i] else -step
            moved = values.copy()
            moved[i] += step
            found[..., i] = (self.dataset.predicted(self._model(moved)) - here) / step
        return found

    def _nuisance_slopes(self, model: Model) -> Floats:
        """d prediction / d nuisance, shape (n, 3, flights * kinds): a nuisance moves only its own flight."""
        count = len(self.dataset.flights)
        found = np.zeros((*self.dataset.measured.shape, count, len(KINDS)))
        for i, flight in enumerate(self.dataset.flights):
            found[self.dataset.flight_index == i, :, i] = sensitivity(model, flight)
        return found.reshape(*self.dataset.measured.shape, count * len(KINDS))


def _soft(residual: Floats) -> Floats:
    """Residuals whose squares are the soft-L1 loss of `residual`: near the same when small, its root when large."""
    ratio = (residual / HUBER_SIGMAS) ** 2
    return np.asarray(np.sign(residual) * HUBER_SIGMAS * np.sqrt(2.0 * (np.sqrt(1.0 + ratio) - 1.0)))


def _soft_slope(residual: Floats) -> Floats:
    """d _soft / d residual."""
    root = np.sqrt(1.0 + (residual / HUBER_SIGMAS) ** 2)
    return np.asarray(np.sqrt((root + 1.0) / 2.0) / root)


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
