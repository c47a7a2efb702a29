"""Fit the parameters of all effects together: robust nonlinear least squares, intervals by block bootstrap.

Flights are gone through one by one, and each leaves only sums of squares and products behind: time and memory are
linear in the samples and in the flights.
"""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from quadctl.lab.arrays import Floats, Mask
from quadctl.lab.fitting.arrowhead import Arrow
from quadctl.lab.fitting.consider_parameters import error_slopes
from quadctl.lab.fitting.normal_equations import (
    products,
    resampled_sums,
    robust_weights,
    slopes_and_residual,
    soft_l1_loss,
    worth,
)
from quadctl.lab.fitting.nuisances import KINDS, MOST, acceleration_slopes, predicted_with, usual_sizes
from quadctl.lab.fitting.parameters import (
    Free,
    free_parameters,
    intervals,
    parameter_slopes,
    remarks,
    values_of,
    with_values,
)
from quadctl.lab.flights.dataset import AlignedDataset, Dataset
from quadctl.lab.flights.flight import Flight
from quadctl.lab.flights.prediction import predict, predict_targets, rmse
from quadctl.lab.threads import one_blas_thread
from quadctl.model import Model

BOOTSTRAPS = 1000
MAX_STEPS = 40
MAX_HALVINGS = 6
LONGEST = 0.3
"""No step goes further than this share of a parameter's range."""
CLOSE_ENOUGH = 1e-3
"""A step that moves the prediction by less than this share of the noise is the last."""
LEAST_NOISE = 1e-4
"""The noise of no axis is taken as less than this share of the largest."""
UNSEEN = 4.0
"""A parameter that changes the sum of squares (in noise units) by less than this over its whole range is not seen."""
WEIGHTS_AT_ONCE = 400_000
"""Of blocks of time in draws: so many are worked on at once."""


@dataclass(frozen=True, eq=False)
class Optimum:
    """A model with fitted parameters, and the fitted nuisances of each flight, shape (flights, kinds)."""

    model: Model
    nuisances: Floats

    def predicted(self, dataset: AlignedDataset) -> Floats:
        """Prediction of every sample's targets, nuisances included, shape (n, 3 * groups)."""
        flights = zip(dataset.flights, self.nuisances, strict=True)
        return np.concatenate([predicted_with(self.model, f, nuisance, dataset.groups) for f, nuisance in flights])


@dataclass(frozen=True, eq=False)
class FittedModel:
    """A model fitted to flights: the value that adding, removing, searching and evaluating take and give.

    Its bootstrap draws are computed when they are first asked for, and kept.
    """

    fitter: "Fitter"
    optimum: Optimum
    held_out_residual: Floats
    """Targets minus predictions of refits that have not seen the sample, shape (n, 3 * groups)."""

    @property
    def model(self) -> Model:
        """The model with its fitted parameters."""
        return self.optimum.model

    @property
    def dataset(self) -> Dataset:
        """The flights as they were prepared."""
        return self.fitter.dataset.source

    @property
    def free(self) -> list[Free]:
        """The fitted parameters, in the order of `draws`."""
        return self.fitter.free

    @property
    def flights(self) -> tuple[Flight, ...]:
        """The flights as they were aligned for the fit."""
        return self.fitter.dataset.flights

    @property
    def predicted(self) -> Floats:
        """Prediction of every sample's targets, the flights' nuisances included, shape (n, 3 * groups)."""
        return self.optimum.predicted(self.fitter.dataset)

    @cached_property
    def held_out_rmse(self) -> dict[str, float]:
        """Held-out error per axis and group (see `rmse`)."""
        return rmse(self.held_out_residual, self.dataset.groups)

    @cached_property
    def draws(self) -> Floats:
        """Bootstrap draws of the fitted parameters, shape (draws, p)."""
        return self.fitter.bootstrap(self.optimum)

    @cached_property
    def intervals(self) -> list[tuple[float, float]]:
        """95 % interval of each fitted parameter."""
        return intervals(self.free, self.draws)

    def refined(self) -> "FittedModel":
        """The fit, gone on with: where the minimum is flat, a fit stops a little before it (see `CLOSE_ENOUGH`)."""
        return fit_model(self.model, self.dataset)

    def ci95(self, effect: int) -> dict[str, tuple[float, float]]:
        """95 % intervals of the fitted parameters of one effect of the stack, by their names."""
        return {f.parameter.name: ci for f, ci in zip(self.free, self.intervals, strict=True) if f.effect == effect}

    def remarks(self, effect: int | None = None) -> list[str]:
        """Remarks on the fitted parameters (see `remarks`), on those of one effect only where it is given."""
        own = [(f, ci) for f, ci in zip(self.free, self.intervals, strict=True) if effect in (None, f.effect)]
        free = [f for f, _ in own]
        return remarks(free, values_of(self.model, free), [ci for _, ci in own])


def fit_model(model: Model, dataset: Dataset) -> FittedModel:
    """Fit the parameters of `model`, from their present values on, and the nuisances of the flights of `dataset`."""
    fitter = Fitter(model, dataset)
    optimum = fitter.fit()
    return FittedModel(fitter, optimum, dataset.targets - fitter.held_out(optimum))


@dataclass(frozen=True, eq=False)
class _Linearisation:
    """Sums over the samples at an optimum, to first order in what changes."""

    residual: Floats
    scale: Floats
    """Of the noise, per axis."""
    sums: Floats
    """Of every block of time, weighted by the soft-L1 loss, shape (blocks, m, m)."""
    starts: NDArray[np.intp]
    """Where the blocks begin."""
    power: Floats
    """Plain squares of the slopes to the parameters, shape (p,)."""
    pulls: Floats
    """Products of each flight's slopes and its errors that are not fitted, shape (errors, flights, m - 1)."""


class Fitter:
    """Fits one form of model, and the nuisances of each flight, to parts of one dataset.

    The fit minimises the robust sum of squares of the residual, in units of its noise, plus the squares of the
    nuisances in units of their usual size. All that is fitted makes one vector: the p parameters, then the nuisances
    flight by flight.
    """

    def __init__(self, model: Model, dataset: Dataset) -> None:
        self.dataset = dataset.aligned_for(model)
        self.model = model
        self.free = free_parameters(model)
        count = len(dataset.flights)
        self._low = np.concatenate([[f.parameter.low for f in self.free], np.tile(-MOST, count)])
        self._high = np.concatenate([[f.parameter.high for f in self.free], np.tile(MOST, count)])
        self._unit = self._high - self._low
        self._usual = usual_sizes(model)
        self._last: tuple[Optimum, _Linearisation] | None = None

    @one_blas_thread
    def fit(self, used: Mask | None = None, start: Optimum | None = None) -> Optimum:
        """Fit on the samples `used` (all by default), from the model's present parameters or from an earlier fit.

        Gauss-Newton with bounded linear least squares for each step. The scale of the noise, which says what an outlier
        is, follows the fit.
        """
        fitted = start or Optimum(self.model, np.zeros((len(self.dataset.flights), len(KINDS))))
        rows = self._all() if used is None else used
        residual = self._residual(fitted, rows)
        near = self._nuisance_slopes(fitted.model)
        for _ in range(MAX_STEPS):
            scale = noise_scale(residual[rows])
            robust, plain = self._sums_by_flight(fitted.model, residual, scale, rows, near)
            step = self._bounded_step(fitted, robust)
            moved = self._mean_square(plain, step, rows)
            fitted, residual, taken = self._downhill(fitted, residual, step, scale, rows)
            if taken == 0.0 or taken * math.sqrt(moved) < CLOSE_ENOUGH:
                break
        return fitted

    @one_blas_thread
    def held_out(self, fitted: Optimum) -> Floats:
        """Prediction of every sample's targets by a fit that has not seen its fold, shape (n, 3 or 6).

        `fitted` is the fit to all samples. Without a few blocks the optimum moves little: one Gauss-Newton step from
        it, no further than it is downhill, is the refit to first order. Without a whole flight it may move far, and the
        fit is done again; the nuisances of that flight are then not known and stay where nothing pulls them, at 0.
        """
        left = self._without_flights(fitted) if self.dataset.whole_flights else self._without_blocks(fitted)
        return self.dataset.targets - left

    def _without_flights(self, fitted: Optimum) -> Floats:
        """Residual of refits that have not seen the flight."""
        left = np.empty_like(self.dataset.targets)
        for number in self.dataset.folds:
            held = self.dataset.fold == number
            known = np.array([not held[part.start] for part in self.dataset.parts])
            refitted = self.fit(~held, Optimum(fitted.model, np.where(known[:, None], fitted.nuisances, 0.0)))
            left[held] = self._residual(refitted, held)[held]
        return left

    def _without_blocks(self, fitted: Optimum) -> Floats:
        """Residual of refits, to first order, that have not seen the blocks of the fold."""
        here = self._linearised(fitted)
        fold = self.dataset.fold[here.starts]
        first = np.flatnonzero(np.diff(self.dataset.flight_index[here.starts], prepend=-1))
        moves = self._moves(fitted)
        left = np.empty_like(here.residual)
        for number in self.dataset.folds:
            held = self.dataset.fold == number
            seen = np.add.reduceat(here.sums * (fold != number)[:, None, None], first, axis=0)
            step = self._unit * self._equations(seen, -fitted.nuisances).solve(moves)
            left[held] = self._downhill(fitted, here.residual, step, here.scale, ~held)[1][held]
        return left

    @one_blas_thread
    def bootstrap(self, fitted: Optimum, seed: int = 0) -> Floats:
        """Free parameters of `BOOTSTRAPS` refits on resampled blocks of time, shape (draws, p), within their bounds.

        Each draw is one Gauss-Newton step from the optimum with the blocks' new weights, which is the refit to first
        order, with the robust weights of the fit. What the data cannot tell of a nuisance is as uncertain as its prior
        says: each draw has a prior of its own, about another centre, and errors of its own of what is not fitted.
        """
        p = len(self.free)
        if not p:
            return np.empty((BOOTSTRAPS, 0))
        here = self._linearised(fitted)
        count = len(here.starts)
        random = np.random.default_rng(seed)
        at_once = max(1, WEIGHTS_AT_ONCE // count)
        parts = [slice(begin, min(begin + at_once, BOOTSTRAPS)) for begin in range(0, BOOTSTRAPS, at_once)]
        times, alike = np.empty((BOOTSTRAPS, count), dtype=np.uint16), np.full(count, 1.0 / count)
        for now in parts:
            times[now] = random.multinomial(count, alike, now.stop - now.start)
        centres = self._usual * random.standard_normal((BOOTSTRAPS, *fitted.nuisances.shape))
        # Few blocks know little of their own spread: Student's t for the normal distribution, n - 1 for n.
        wider = float(stats.t.ppf(0.975, count - 1)) / 1.96 * math.sqrt(count / (count - 1)) if count > 1 else 1.0
        first = np.flatnonzero(np.diff(self.dataset.flight_index[here.starts], prepend=-1))
        moves = self._moves(fitted)
        steps = self._considered_steps(fitted, np.add.reduceat(here.sums, first, axis=0), here.pulls, random)
        for now in parts:
            drawn = resampled_sums(here.sums, times[now], first)
            equations = self._equations(drawn, centres[now] - fitted.nuisances)
            steps[now] += equations.solve(moves)[:, :p]
        steps *= wider * self._unit[:p]
        values, low, high = values_of(fitted.model, self.free), self._low[:p], self._high[:p]
        draws = np.clip(values + steps, low, high)
        lowest, highest = np.percentile(draws, [2.5, 97.5], axis=0)
        # Where the refits go on, the fit came to rest in a flat valley.
        adrift = (values < lowest) | (values > highest)
        unseen = adrift | self._unseen(here.power) | self._unseen_at_bounds(values, draws, here.scale)
        either = random.integers(0, 2, size=draws.shape)
        # A parameter that is not seen may be anything that is possible.
        draws[:, unseen] = np.where(either, high, low)[:, unseen]
        return draws

    def misfit(self, fitted: Optimum, scale: Floats) -> float:
        """What a fit of all samples minimises, for noise of `scale` per axis: to compare fits of other models."""
        rows = self._all()
        return self._cost(fitted, self._residual(fitted, rows), scale, rows)

    # --- steps: vectors of the parameters and the nuisances of all flights --------------------------------------------

    def _equations(self, sums: Floats, pull: Floats) -> Arrow:
        """Normal equations, in units of the range of each parameter and nuisance.

        `sums` are those of each flight (see `products`), `pull` is where the prior would have the nuisances from where
        they are, shape (flights, kinds); both may have an axis of draws in front.
        """
        p, kinds = len(self.free), np.arange(len(KINDS))
        unit = np.concatenate([self._unit[: p + len(KINDS)], [1.0]])
        scaled = sums * np.outer(unit, unit)
        own = unit[p:-1]
        scaled[..., p + kinds, p + kinds] += (own / self._usual) ** 2
        scaled[..., p:-1, -1] += own / self._usual**2 * pull
        return Arrow.of_sums(scaled, p).ridged()

    def _considered_steps(self, fitted: Optimum, sums: Floats, pulls: Floats, random: np.random.Generator) -> Floats:
        """Where draws of errors that are not fitted lead the parameters, in units of their ranges, shape (draws, p).

        `sums` are those of each flight, which takes up with its nuisances what it can of the `pulls` of an error.
        """
        pulled = np.repeat(sums[None], len(pulls), axis=0)
        pulled[..., :-1, -1] = pulls
        led = self._equations(pulled, np.zeros_like(fitted.nuisances)).solve(self._moves(fitted))[:, : len(self.free)]
        return np.asarray(random.standard_normal((BOOTSTRAPS, len(led))) @ led)

    def _moves(self, fitted: Optimum) -> Mask:
        """What the fit has pushed against a bound stays there, as it would in a refit."""
        values = self._values(fitted)
        return np.asarray((values - self._low > 1e-6 * self._unit) & (self._high - values > 1e-6 * self._unit))

    def _bounded_step(self, fitted: Optimum, sums: Floats) -> Floats:
        """The Gauss-Newton step that stays within the bounds, and within `LONGEST` of the range of each of them."""
        values = self._values(fitted)
        low = np.maximum((self._low - values) / self._unit, -LONGEST)
        high = np.minimum((self._high - values) / self._unit, LONGEST)
        return np.asarray(self._unit * self._equations(sums, -fitted.nuisances).within(low, high))

    def _downhill(
        self, fitted: Optimum, residual: Floats, step: Floats, scale: Floats, rows: Mask
    ) -> tuple[Optimum, Floats, float]:
        """The fit after the longest of `step`, its half, its quarter... that lowers the cost, its residual, and that
        share."""
        before = self._cost(fitted, residual, scale, rows)
        values = self._values(fitted)
        share = 1.0
        for _ in range(MAX_HALVINGS):
            candidate = self._fitted(np.clip(values + share * step, self._low, self._high))
            left = self._residual(candidate, rows)
            if self._cost(candidate, left, scale, rows) < before:
                return candidate, left, share
            share *= 0.5
        return fitted, residual, 0.0

    def _mean_square(self, sums: Floats, step: Floats, rows: Mask) -> float:
        """Of what `step` does to the predictions of the samples `rows`, to first order, in units of the noise."""
        p = len(self.free)
        own = step[p:].reshape(len(sums), -1)
        each = np.concatenate([np.broadcast_to(step[:p], (len(sums), p)), own], axis=-1)
        square = np.sum(np.einsum("fm,fmk->fk", each, sums[:, :-1, :-1]) * each)
        return max(float(square), 0.0) / float(np.count_nonzero(rows) * self.dataset.targets.shape[1])

    def _fitted(self, values: Floats) -> Optimum:
        p = len(self.free)
        return Optimum(with_values(self.model, self.free, values[:p]), values[p:].reshape(-1, len(KINDS)))

    def _values(self, fitted: Optimum) -> Floats:
        return np.concatenate([values_of(fitted.model, self.free), fitted.nuisances.ravel()])

    def _unseen(self, power: Floats) -> Mask:
        """Parameters whose whole range changes the sum of squares by next to nothing; `power` of their slopes."""
        return np.asarray(power * self._unit[: len(self.free)] ** 2 < UNSEEN)

    def _unseen_at_bounds(self, values: Floats, draws: Floats, scale: Floats) -> Mask:
        """Parameters that are not seen once another is at the bound that its interval reaches (no a, no b)."""
        p = len(self.free)
        lowest, highest = np.percentile(draws, [2.5, 97.5], axis=0)
        found = np.zeros(p, dtype=bool)
        for i in range(p):
            at_bound = self._low[i] if lowest[i] <= self._low[i] else self._high[i]
            if lowest[i] <= self._low[i] or highest[i] >= self._high[i]:
                model = with_values(self.model, self.free, np.where(np.arange(p) == i, at_bound, values))
                found |= self._unseen(self._power(model, scale)) & (np.arange(p) != i)
        return found

    # --- one flight after the other -----------------------------------------------------------------------------------

    def _all(self) -> Mask:
        return np.ones(len(self.dataset.targets), dtype=bool)

    def _residual(self, fitted: Optimum, rows: Mask) -> Floats:
        """What `fitted` leaves of the targets of all flights with samples in `rows`, shape (n, axes); 0 elsewhere."""
        left = np.zeros_like(self.dataset.targets)
        for flight, part, nuisance in zip(self.dataset.flights, self.dataset.parts, fitted.nuisances, strict=True):
            if rows[part].any():
                predicted = predicted_with(fitted.model, flight, nuisance, self.dataset.groups)
                left[part] = self.dataset.targets[part] - predicted
        return left

    def _cost(self, fitted: Optimum, residual: Floats, scale: Floats, rows: Mask) -> float:
        """Soft-L1 loss of the samples in units of their noise; a prior's term is never an outlier."""
        total = float(np.sum((fitted.nuisances / self._usual) ** 2))
        for flight, part in zip(self.dataset.flights, self.dataset.parts, strict=True):
            total += soft_l1_loss(residual[part][rows[part]] / scale, worth(flight, self.dataset.groups))
        return total

    def _nuisance_slopes(self, model: Model) -> list[Floats]:
        """Of the acceleration of each flight: a fit takes them for constant, which saves a third of its time."""
        return [acceleration_slopes(model, flight, predict(model, flight)) for flight in self.dataset.flights]

    def _sums_by_flight(
        self, model: Model, residual: Floats, scale: Floats, rows: Mask, near: list[Floats]
    ) -> tuple[Floats, Floats]:
        """Sums of each flight's samples in `rows`, weighted by the soft-L1 loss, and plain."""
        m, groups = len(self.free) + len(KINDS) + 1, self.dataset.groups
        robust, plain = np.zeros((2, len(self.dataset.flights), m, m))
        for i, (flight, part) in enumerate(zip(self.dataset.flights, self.dataset.parts, strict=True)):
            used = rows[part]
            if used.any():
                columns = slopes_and_residual(model, flight, groups, residual[part], scale, near[i])
                columns = columns if used.all() else columns[used]
                robust[i] = products(columns, robust_weights(columns, worth(flight, groups)))
                plain[i] = products(columns)
        return robust, plain

    def _linearised(self, fitted: Optimum) -> _Linearisation:
        """What the samples leave behind at `fitted`; kept, for intervals are asked for after the unseen error."""
        if self._last is None or self._last[0] is not fitted:
            self._last = fitted, self._summed_up(fitted)
        return self._last[1]

    def _summed_up(self, fitted: Optimum) -> _Linearisation:
        model, groups, p = fitted.model, self.dataset.groups, len(self.free)
        residual = self._residual(fitted, self._all())
        scale = noise_scale(residual)
        starts = np.flatnonzero(np.diff(self.dataset.block, prepend=-1))
        sums, pulls, power = [], [], np.zeros(p)
        for flight, part in zip(self.dataset.flights, self.dataset.parts, strict=True):
            columns = slopes_and_residual(model, flight, groups, residual[part], scale)
            weights = robust_weights(columns, worth(flight, groups))
            within = starts[(starts >= part.start) & (starts < part.stop)] - part.start
            for begin, end in zip(within, [*within[1:], len(columns)], strict=True):
                sums.append(products(columns[begin:end], weights[begin:end]))
            slopes = columns[..., :-1]
            errors = error_slopes(model, flight, groups, predict_targets(model, flight, groups)) / scale[:, None]
            pulls.append(np.tensordot(errors, slopes * weights[..., None], axes=((0, 1), (0, 1))))
            power += np.einsum("nap,nap->p", slopes[..., :p], slopes[..., :p])
        return _Linearisation(residual, scale, np.array(sums), starts, power, np.stack(pulls, axis=1))

    def _power(self, model: Model, scale: Floats) -> Floats:
        """Sum of squares of the slopes to the parameters of `model`, in units of the noise, shape (p,)."""
        power, groups = np.zeros(len(self.free)), self.dataset.groups
        for flight in self.dataset.flights:
            j = parameter_slopes(model, flight, groups, predict_targets(model, flight, groups)) / scale[:, None]
            power += np.einsum("nap,nap->p", j, j)
        return power


def noise_scale(residual: Floats) -> Floats:
    """Robust standard deviation of each axis about zero, shape (axes,)."""
    deviation = 1.4826 * np.array([np.median(np.abs(axis)) for axis in residual.T])
    return np.asarray(np.maximum(deviation, LEAST_NOISE * max(float(deviation.max()), 1e-3)))
