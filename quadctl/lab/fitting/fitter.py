"""Fit of the parameters of all effects together: robust nonlinear least squares with bootstrap intervals.

The flights are processed one by one, and each is reduced to Gram matrices: time and memory are linear in the number of
samples and of flights.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import special

from quadctl.lab.arrays import Floats, Mask
from quadctl.lab.fitting.arrowhead import Arrow
from quadctl.lab.fitting.consider_parameters import considered_changes
from quadctl.lab.fitting.constrained_draws import constrained_draws
from quadctl.lab.fitting.noise import LEAST_VARIANCE, noise_scale
from quadctl.lab.fitting.normal_equations import (
    axis_weights,
    gradient_covariance,
    gram_matrix,
    jacobian_and_residual,
    resampled_gram_matrices,
    robust_weights,
    soft_l1_loss,
)
from quadctl.lab.fitting.nuisances import (
    AGE,
    CAPTURED,
    KINDS,
    acceleration_jacobian,
    bounds,
    predicted_with,
    prior_std,
)
from quadctl.lab.fitting.parameters import (
    HELD,
    free_parameters,
    intervals,
    parameter_jacobian,
    values_of,
    with_values,
)
from quadctl.lab.fitting.velocity_error import weakening
from quadctl.lab.flights.dataset import AlignedDataset, Dataset
from quadctl.lab.flights.prediction import predict, predict_targets
from quadctl.lab.threads import one_blas_thread
from quadctl.model import Model

BOOTSTRAPS = 1000
BOOTSTRAP_SEED = 0
MAX_STEPS = 40
MAX_HALVINGS = 6
MAX_STEP = 0.3
"""Largest step of a parameter or nuisance, as a share of its range."""
CONVERGED = 1e-3
"""Convergence: the iteration ends with a step that changes the prediction by less than this share of the noise
(RMS)."""
UNIDENTIFIABLE = 4.0
"""A parameter is unidentifiable when its whole range changes the sum of squares (in units of the noise) by less than
this."""
LEAST_RUNS = 20
"""Least number of runs of neighbouring blocks that the bootstrap resamples."""
WEIGHTS_AT_ONCE = 400_000
"""Number of block counts (draws times blocks) that the bootstrap works on at once."""


@dataclass(frozen=True, eq=False)
class Optimum:
    """Model with fitted parameters, and the fitted nuisances of each flight, shape (flights, kinds)."""

    model: Model
    nuisances: Floats

    def predicted(self, dataset: AlignedDataset) -> Floats:
        """Prediction of every sample's targets, nuisances included, shape (n, 3 * groups)."""
        flights = zip(dataset.flights, self.nuisances, strict=True)
        return np.concatenate([predicted_with(self.model, f, nuisance, dataset.groups) for f, nuisance in flights])


@dataclass(frozen=True, eq=False)
class _Linearisation:
    """Linearised least-squares problem at an optimum: Gram matrices of the samples."""

    residual: Floats
    scale: Floats
    """Noise scale per axis, shape (axes,)."""
    gram: Floats
    """Gram matrix of every block of time, weighted by the soft-L1 loss, shape (blocks, m, m)."""
    starts: NDArray[np.intp]
    """Index of the first sample of each block, shape (blocks,)."""
    power: Floats
    """Unweighted sums of squares of the columns of the parameter Jacobian, shape (p,)."""
    consider_gradients: Floats
    """Weighted products of the Jacobian and the change by each considered error, shape (errors, flights, m - 1)."""
    weakening_gradient: Floats
    """The same for the errors of the velocity, which act in one direction only, shape (1, flights, m - 1)."""
    gradient_covariance: Floats
    """Covariance of the gradient by the noise, as its spectrum tells, shape (flights, m - 1, m - 1)."""


class Fitter:
    """Least-squares problem of one model and one dataset; fits it, also to parts of the data.

    The objective is the robust sum of squares of the residual, in units of its noise, plus the squares of the
    nuisances, in units of their prior standard deviations. The unknowns are one vector: the p parameters, then the
    nuisances flight by flight.
    """

    def __init__(self, model: Model, dataset: Dataset) -> None:
        self.dataset = dataset.aligned_for(model)
        self.model = model
        self.free = free_parameters(model)
        lowest, highest = map(np.array, zip(*map(bounds, self.dataset.flights), strict=True))
        self._bound, self._prior_std = highest, np.array([prior_std(flight) for flight in self.dataset.flights])
        # A rotor signal that comes earlier than positions are late has rotors that follow it late, and no delay.
        earliest = np.array([f.timing.earliest_s - f.delay_s for f in self.dataset.flights])
        lowest[:, AGE] = np.clip(earliest, -highest[:, AGE], 0.0)
        self._low = np.concatenate([[f.parameter.low for f in self.free], lowest.ravel()])
        self._high = np.concatenate([[f.parameter.high for f in self.free], highest.ravel()])
        self._unit = self._high - self._low
        self._last: tuple[Optimum, _Linearisation] | None = None

    @one_blas_thread
    def fit(self, used: Mask | None = None, start: Optimum | None = None) -> Optimum:
        """Fit on the samples `used` (all by default), from the model's present parameters or from an earlier fit.

        Each Gauss-Newton step solves a bounded linear least-squares problem. The noise scale, which decides what an
        outlier is, is estimated anew at each step.
        """
        fitted = start or Optimum(self.model, np.zeros((len(self.dataset.flights), len(KINDS))))
        rows = self._all() if used is None else used
        residual = self._residual(fitted, rows)
        nearby_jacobian = self._nuisance_jacobians(fitted.model)
        for _ in range(MAX_STEPS):
            scale = noise_scale(residual[rows])
            robust, plain = self._gram_matrices(fitted.model, residual, scale, rows, nearby_jacobian)
            step = self._bounded_step(fitted, robust)
            moved = self._mean_square(plain, step, rows)
            fitted, residual, taken = self._line_search(fitted, residual, step, scale, rows)
            if taken == 0.0 or taken * math.sqrt(moved) < CONVERGED:
                break
        return fitted

    @one_blas_thread
    def held_out(self, fitted: Optimum) -> Floats:
        """Predict every sample's targets by a fit that has not seen its fold, shape (n, 3 * groups).

        `fitted` is the fit to all samples. Without a few blocks the optimum changes little: the refit is approximated
        to first order by one Gauss-Newton step from the optimum, shortened until the objective falls; where it does
        not fall, the fit is repeated. Without a whole flight the optimum may change much, and the fit is repeated; the
        nuisances of that flight are then unknown and stay at the mean of their prior, 0.
        """
        left = self._without_flights(fitted) if self.dataset.whole_flights else self._without_blocks(fitted)
        return self.dataset.targets - left

    def _without_flights(self, fitted: Optimum) -> Floats:
        """Residual of each flight by a refit that has not seen it, shape (n, 3 * groups)."""
        left = np.empty_like(self.dataset.targets)
        for number in self.dataset.folds:
            held = self.dataset.fold == number
            known = np.array([not held[part.start] for part in self.dataset.parts])
            refitted = self.fit(~held, Optimum(fitted.model, np.where(known[:, None], fitted.nuisances, 0.0)))
            left[held] = self._residual(refitted, held)[held]
        return left

    def _without_blocks(self, fitted: Optimum) -> Floats:
        """Residual of each fold by a first-order refit that has not seen it, shape (n, 3 * groups)."""
        tangent = self._linearisation_at(fitted)
        fold = self.dataset.fold[tangent.starts]
        first = np.flatnonzero(np.diff(self.dataset.flight_index[tangent.starts], prepend=-1))
        free_mask = self._free_mask(fitted)
        left = np.empty_like(tangent.residual)
        for number in self.dataset.folds:
            held = self.dataset.fold == number
            seen = np.add.reduceat(tangent.gram * (fold != number)[:, None, None], first, axis=0)
            step = self._unit * self._equations(seen, -fitted.nuisances).solve(free_mask)
            _, residual, taken = self._line_search(fitted, tangent.residual, step, tangent.scale, ~held)
            # Without a step the residual would still be that of the fit to all samples.
            left[held] = (residual if taken else self._residual(self.fit(~held, fitted), held))[held]
        return left

    @one_blas_thread
    def bootstrap(self, fitted: Optimum, seed: int = BOOTSTRAP_SEED) -> Floats:
        """Draw the free parameters from `BOOTSTRAPS` refits on resampled blocks of time, shape (draws, p), within their
        bounds.

        Each draw is one Gauss-Newton step from the optimum with new weights of the blocks, i.e. the refit to first
        order with the robust weights of the fit. Each draw also has its own prior means of the nuisances, since what
        the data do not tell about a nuisance is as uncertain as its prior says, and its own considered errors
        (`consider_parameters`). Where the noise is slower than the runs of blocks tell, by its spectrum, the draws
        spread as far as that says. A nuisance that a bound holds may be beyond it
        (`_step_beyond_bounds`). Errors of the velocity may have weakened a drag, never strengthened it
        (`velocity_error`). Parameters that a bound holds are drawn last, and the others follow them.
        """
        p = len(self.free)
        if not p:
            return np.empty((BOOTSTRAPS, 0))
        tangent = self._linearisation_at(fitted)
        count = len(tangent.starts)
        random = np.random.default_rng(seed)
        at_once = max(1, WEIGHTS_AT_ONCE // count)
        parts = [slice(begin, min(begin + at_once, BOOTSTRAPS)) for begin in range(0, BOOTSTRAPS, at_once)]
        # Residuals stay correlated for tens of seconds: neighbouring blocks are drawn together.
        run = np.arange(count) // max(1, count // LEAST_RUNS)
        runs = int(run[-1]) + 1
        times, alike = np.empty((BOOTSTRAPS, count), dtype=np.uint16), np.full(runs, 1.0 / runs)
        for now in parts:
            times[now] = random.multinomial(runs, alike, now.stop - now.start)[:, run]
        count_flights, usual = len(fitted.nuisances), CAPTURED.start
        centres = np.empty((BOOTSTRAPS, *fitted.nuisances.shape))
        centres[..., :usual] = random.standard_normal((BOOTSTRAPS, count_flights, usual))
        # Drawn apart: flights without a motion capture keep the draws of the others, and so the intervals of the pages.
        apart = np.random.default_rng([seed, usual])
        centres[..., usual:] = apart.standard_normal((BOOTSTRAPS, count_flights, len(KINDS) - usual))
        centres *= self._prior_std
        # The spread is estimated from few runs: Student's t instead of the normal distribution, n - 1 instead of n.
        wider = float(special.stdtrit(runs - 1, 0.975)) / 1.96 * math.sqrt(runs / (runs - 1)) if runs > 1 else 1.0
        first = np.flatnonzero(np.diff(self.dataset.flight_index[tangent.starts], prepend=-1))
        free_mask = self._free_mask(fitted)
        released = np.where(np.arange(len(free_mask)) < p, True, free_mask)
        held = np.flatnonzero(~free_mask[:p])
        whole = np.add.reduceat(tangent.gram, first, axis=0)
        normals = random.standard_normal((BOOTSTRAPS, len(tangent.consider_gradients)))
        masks = [free_mask, released] if len(held) else [free_mask]
        drawn_steps = [
            normals @ self._steps_by_errors(fitted, whole, tangent.consider_gradients, mask) for mask in masks
        ]
        for now in parts:
            drawn = resampled_gram_matrices(tangent.gram, times[now], first)
            equations = self._equations(drawn, centres[now] - fitted.nuisances)
            for steps, mask in zip(drawn_steps, masks, strict=True):
                steps[now] += equations.solve(mask)[:, :p]
        values, low, high = values_of(fitted.model, self.free), self._low[:p], self._high[:p]
        more = self._variance_beyond_runs(fitted, whole, tangent, run, masks[-1])
        drawn_steps = [
            steps * np.sqrt(1.0 + more / np.maximum(steps.var(axis=0), LEAST_VARIANCE)) for steps in drawn_steps
        ]
        moves = wider * drawn_steps[0]
        if len(held):
            equations = self._equations(whole, -fitted.nuisances)
            moves += self._moves_of_held(equations, free_mask, held, values, wider, drawn_steps[-1], random)
        moves += random.uniform(size=(BOOTSTRAPS, 1)) * self._step_beyond_bounds(fitted, whole, free_mask)
        weaker = np.maximum(random.standard_normal((BOOTSTRAPS, 1)), 0.0)
        moves += weaker @ self._steps_by_errors(fitted, whole, tangent.weakening_gradient, free_mask)
        draws = np.clip(values + self._unit[:p] * moves, low, high)
        ends = np.array(intervals(self.free, values, draws))
        # A fitted value outside the draws: the fit stopped in a flat valley before the minimum.
        adrift = (values < ends[:, 0]) | (values > ends[:, 1])
        unidentifiable = (
            adrift | self._unidentifiable(tangent.power) | self._unidentifiable_at_bounds(values, draws, tangent.scale)
        )
        either = random.integers(0, 2, size=draws.shape)
        # An unidentifiable parameter may have any value within its bounds.
        draws[:, unidentifiable] = np.where(either, high, low)[:, unidentifiable]
        return np.asarray(draws)

    def objective(self, fitted: Optimum, scale: Floats) -> float:
        """Objective of a fit to all samples for a given noise `scale` per axis: comparable between models."""
        rows = self._all()
        return self._objective(fitted, self._residual(fitted, rows), scale, rows)

    # --- steps: vectors of the parameters and the nuisances of all flights --------------------------------------------

    def _equations(self, gram: Floats, prior_offset: Floats, std: Floats | None = None) -> Arrow:
        """Normal equations, in units of the range of each parameter and nuisance.

        `gram` holds the Gram matrix of each flight (see `gram_matrix`), `prior_offset` the prior mean minus the present
        value of the nuisances, shape (flights, kinds), and `std` their standard deviation, if not that of their priors;
        the first two may have a leading axis of draws.
        """
        std = self._prior_std if std is None else std
        p, kinds = len(self.free), np.arange(len(KINDS))
        unit = np.column_stack([self._unit_by_flight, np.ones(len(self.dataset.flights))])
        scaled = gram * (unit[:, :, None] * unit[:, None, :])
        own = unit[:, p:-1]
        scaled[..., p + kinds, p + kinds] += (own / std) ** 2
        scaled[..., p:-1, -1] += own / std**2 * prior_offset
        return Arrow.of_gram_matrices(scaled, p).ridged()

    def _moves_of_held(
        self,
        equations: Arrow,
        free_mask: Mask,
        held: NDArray[np.intp],
        values: Floats,
        wider: float,
        unbounded_steps: Floats,
        random: np.random.Generator,
    ) -> Floats:
        """Draws of the moves of the parameters `held` away from their bounds, and of those that this causes in the
        others, in units of the ranges, shape (draws, p).

        Without their bounds the parameters would move to the minimum of the quadratic approximation `equations` of the
        objective, about which `unbounded_steps` scatter. Within the bounds `constrained_draws` says how far they may.
        The others follow along the valley of the objective.
        """
        p = len(self.free)
        released = np.where(np.arange(len(free_mask)) < p, True, free_mask)
        centre = equations.solve(released)[held]
        scatter = unbounded_steps[:, held] - unbounded_steps[:, held].mean(axis=0)
        unit, low, high = self._unit[held], self._low[held], self._high[held]
        moves = constrained_draws(values[held] + unit * (centre + wider * scatter), low, high, random) - values[held]
        follow = np.zeros((len(held), p))
        for row, i in zip(follow, held, strict=True):
            one = np.zeros(len(free_mask))
            one[i] = 1.0
            row[:] = equations.with_rhs(-equations.times(one)).solve(free_mask)[:p]
            row[i] = 1.0
        return np.asarray(moves / unit @ follow)

    def _steps_by_errors(self, fitted: Optimum, gram: Floats, consider_gradients: Floats, free_mask: Mask) -> Floats:
        """Parameter steps caused by one standard deviation of each considered error, in units of the parameters'
        ranges, shape (errors, p).

        `gram` holds the Gram matrix of each flight: its nuisances absorb a part of an error. The errors enter by their
        `consider_gradients`.
        """
        rhs_of_errors = np.repeat(gram[None], len(consider_gradients), axis=0)
        rhs_of_errors[..., :-1, -1] = consider_gradients
        equations = self._equations(rhs_of_errors, np.zeros_like(fitted.nuisances))
        return np.asarray(equations.solve(free_mask)[:, : len(self.free)])

    def _step_beyond_bounds(self, fitted: Optimum, gram: Floats, free_mask: Mask) -> Floats:
        """Step of the parameters, in units of their ranges, where the nuisances that are held by their bounds go beyond
        them, shape (p,); 0 where none is.

        A bound is what usual vehicles and estimators have, and no law of physics. What it holds belongs to an
        unusual one, of which nobody knows how far it goes: its prior is then as wide as the bound.
        """
        p = len(self.free)
        unusual = np.abs(fitted.nuisances) > (1.0 - HELD) * self._bound
        released = free_mask | np.concatenate([np.zeros(p, dtype=bool), unusual.ravel()])
        if np.array_equal(released, free_mask):
            return np.zeros(p)
        wide = np.where(unusual, self._bound, self._prior_std)
        return np.asarray(self._equations(gram, -fitted.nuisances, wide).solve(released)[:p])

    def _variance_beyond_runs(
        self, fitted: Optimum, gram: Floats, tangent: _Linearisation, run: NDArray[np.intp], free_mask: Mask
    ) -> Floats:
        """Variance of the steps of the parameters, in units of their ranges, by which the spectrum of the noise says
        more than runs of blocks that are taken for independent, shape (p,); 0 where it says less."""
        p, k, count = len(self.free), len(KINDS), len(gram)
        equations = self._equations(gram, -fitted.nuisances)
        unit = self._unit_by_flight
        flight = self.dataset.flight_index[tangent.starts]
        more = np.zeros(p)
        for i in range(p):
            one = np.zeros(p + count * k)
            one[i] = 1.0
            solved = equations.with_rhs(one).solve(free_mask)
            by_gradient = unit * np.column_stack([np.tile(solved[:p], (count, 1)), solved[p:].reshape(count, k)])
            by_block = np.einsum("bm,bm->b", by_gradient[flight], tangent.gram[:, :-1, -1])
            by_run = np.bincount(run, by_block)
            of_spectrum = np.einsum("fm,fmn,fn->", by_gradient, tangent.gradient_covariance, by_gradient)
            more[i] = max(of_spectrum - float(by_run @ by_run), 0.0)
        return more

    @property
    def _unit_by_flight(self) -> Floats:
        """Range of each parameter and of each nuisance of a flight, shape (flights, p + kinds)."""
        p, own = len(self.free), self._unit[len(self.free) :].reshape(-1, len(KINDS))
        return np.column_stack([np.tile(self._unit[:p], (len(own), 1)), own])

    def _free_mask(self, fitted: Optimum) -> Mask:
        """Mask of the unknowns that are not at a bound; those at a bound stay there, as they would in a refit."""
        values = self._values(fitted)
        return np.asarray((values - self._low > HELD * self._unit) & (self._high - values > HELD * self._unit))

    def _bounded_step(self, fitted: Optimum, gram: Floats) -> Floats:
        """Gauss-Newton step within the bounds, and within `MAX_STEP` of the range of each unknown."""
        values = self._values(fitted)
        low = np.maximum((self._low - values) / self._unit, -MAX_STEP)
        high = np.minimum((self._high - values) / self._unit, MAX_STEP)
        return np.asarray(self._unit * self._equations(gram, -fitted.nuisances).within(low, high))

    def _line_search(
        self, fitted: Optimum, residual: Floats, step: Floats, scale: Floats, rows: Mask
    ) -> tuple[Optimum, Floats, float]:
        """Try `step`, its half, its quarter, ... until the objective falls; return the fit, its residual, and the share
        of `step` taken (0 if none)."""
        before = self._objective(fitted, residual, scale, rows)
        values = self._values(fitted)
        share = 1.0
        for _ in range(MAX_HALVINGS):
            candidate = self._fitted(np.clip(values + share * step, self._low, self._high))
            left = self._residual(candidate, rows)
            if self._objective(candidate, left, scale, rows) < before:
                return candidate, left, share
            share *= 0.5
        return fitted, residual, 0.0

    def _mean_square(self, gram: Floats, step: Floats, rows: Mask) -> float:
        """Mean square of the change that `step` makes to the predictions of the samples `rows`, to first order, in
        units of the noise."""
        p = len(self.free)
        own = step[p:].reshape(len(gram), -1)
        each = np.concatenate([np.broadcast_to(step[:p], (len(gram), p)), own], axis=-1)
        square = np.sum(np.einsum("fm,fmk->fk", each, gram[:, :-1, :-1]) * each)
        return max(float(square), 0.0) / float(np.count_nonzero(rows) * self.dataset.targets.shape[1])

    def _fitted(self, values: Floats) -> Optimum:
        p = len(self.free)
        return Optimum(with_values(self.model, self.free, values[:p]), values[p:].reshape(-1, len(KINDS)))

    def _values(self, fitted: Optimum) -> Floats:
        return np.concatenate([values_of(fitted.model, self.free), fitted.nuisances.ravel()])

    def _unidentifiable(self, power: Floats) -> Mask:
        """Mask of the unidentifiable parameters (see `UNIDENTIFIABLE`); `power` are the sums of squares of the
        Jacobian's columns."""
        return np.asarray(power * self._unit[: len(self.free)] ** 2 < UNIDENTIFIABLE)

    def _unidentifiable_at_bounds(self, values: Floats, draws: Floats, scale: Floats) -> Mask:
        """Mask of the parameters that become unidentifiable where another one is at the bound that its interval
        reaches, as b in a exp(b z) at a = 0."""
        p = len(self.free)
        lowest, highest = np.array(intervals(self.free, values, draws)).T
        found = np.zeros(p, dtype=bool)
        for i in range(p if p > 1 else 0):
            at_bound = self._low[i] if lowest[i] <= self._low[i] else self._high[i]
            if lowest[i] <= self._low[i] or highest[i] >= self._high[i]:
                model = with_values(self.model, self.free, np.where(np.arange(p) == i, at_bound, values))
                found |= self._unidentifiable(self._power(model, scale)) & (np.arange(p) != i)
        return found

    # --- one flight after the other -----------------------------------------------------------------------------------

    def _all(self) -> Mask:
        return np.ones(len(self.dataset.targets), dtype=bool)

    def _residual(self, fitted: Optimum, rows: Mask) -> Floats:
        """Residual of the targets of all flights that have samples in `rows`, shape (n, axes); 0 elsewhere."""
        left = np.zeros_like(self.dataset.targets)
        for flight, part, nuisance in zip(self.dataset.flights, self.dataset.parts, fitted.nuisances, strict=True):
            if rows[part].any():
                predicted = predicted_with(fitted.model, flight, nuisance, self.dataset.groups)
                left[part] = self.dataset.targets[part] - predicted
        return left

    def _objective(self, fitted: Optimum, residual: Floats, scale: Floats, rows: Mask) -> float:
        """Objective: soft-L1 loss of the residual in units of the noise, plus the squared prior terms of the
        nuisances."""
        total = float(np.sum((fitted.nuisances / self._prior_std) ** 2))
        for flight, part in zip(self.dataset.flights, self.dataset.parts, strict=True):
            total += soft_l1_loss(residual[part][rows[part]] / scale, axis_weights(flight, self.dataset.groups))
        return total

    def _nuisance_jacobians(self, model: Model) -> list[Floats]:
        """Jacobian of each flight's acceleration with respect to its nuisances; a fit keeps it constant, which saves a
        third of the time."""
        return [acceleration_jacobian(model, flight, predict(model, flight)) for flight in self.dataset.flights]

    def _gram_matrices(
        self, model: Model, residual: Floats, scale: Floats, rows: Mask, nearby_jacobian: list[Floats]
    ) -> tuple[Floats, Floats]:
        """Gram matrices of each flight's samples in `rows`: weighted by the soft-L1 loss, and unweighted; shape
        (flights, m, m) each."""
        m, groups = len(self.free) + len(KINDS) + 1, self.dataset.groups
        robust, plain = np.zeros((2, len(self.dataset.flights), m, m))
        for i, (flight, part) in enumerate(zip(self.dataset.flights, self.dataset.parts, strict=True)):
            used = rows[part]
            if not used.any():
                continue
            for group, axes in _one_by_one(groups):
                columns = jacobian_and_residual(
                    model, flight, group, residual[part, axes], scale[axes], nearby_jacobian[i]
                )
                columns = columns if used.all() else columns[used]
                robust[i] += gram_matrix(columns, robust_weights(columns, axis_weights(flight, group)))
                plain[i] += gram_matrix(columns)
                del columns  # before the next, which is as large
        return robust, plain

    def _linearisation_at(self, fitted: Optimum) -> _Linearisation:
        """Linearisation at `fitted`; the last one is kept, because intervals are computed after the held-out error."""
        if self._last is None or self._last[0] is not fitted:
            self._last = fitted, self._linearise(fitted)
        return self._last[1]

    def _linearise(self, fitted: Optimum) -> _Linearisation:
        model, groups, p = fitted.model, self.dataset.groups, len(self.free)
        residual = self._residual(fitted, self._all())
        scale = noise_scale(residual)
        starts = np.flatnonzero(np.diff(self.dataset.block, prepend=-1))
        unknowns, flights = p + len(KINDS), len(self.dataset.flights)
        gram, power = np.zeros((len(starts), unknowns + 1, unknowns + 1)), np.zeros(p)
        weaker, covariance = np.zeros((1, flights, unknowns)), np.zeros((flights, unknowns, unknowns))
        consider: list[Floats] = []
        for i, (flight, part) in enumerate(zip(self.dataset.flights, self.dataset.parts, strict=True)):
            (blocks,) = np.nonzero((starts >= part.start) & (starts < part.stop))
            ends = [*(starts[blocks[1:]] - part.start), part.stop - part.start]
            of_errors: list[Floats] = []
            for group, axes in _one_by_one(groups):
                columns = jacobian_and_residual(model, flight, group, residual[part, axes], scale[axes])
                weights = robust_weights(columns, axis_weights(flight, group))
                for block, end in zip(blocks, ends, strict=True):
                    here = slice(starts[block] - part.start, end)
                    gram[block] += gram_matrix(columns[here], weights[here])
                flat, predicted = columns.reshape(-1, unknowns + 1)[:, :-1], predict_targets(model, flight, group)
                changes = considered_changes(model, flight, group, predicted)
                of_errors.append(np.array([(change / scale[axes] * weights).ravel() @ flat for change in changes]))
                if group == ("total",):
                    change = weakening(model, flight, predicted, residual[part, axes])
                    weaker[0, i] = (change / scale[axes] * weights).ravel() @ flat
                power += np.einsum("nap,nap->p", columns[..., :p], columns[..., :p])
                covariance[i] += gradient_covariance(columns, weights)
                del columns, flat  # before the next, which are as large
            consider.append(np.sum(of_errors, axis=0))
        return _Linearisation(residual, scale, gram, starts, power, np.stack(consider, axis=1), weaker, covariance)

    def _power(self, model: Model, scale: Floats) -> Floats:
        """Sum of squares of each column of the parameter Jacobian of `model`, in units of the noise, shape (p,)."""
        power, groups = np.zeros(len(self.free)), self.dataset.groups
        for flight in self.dataset.flights:
            j = parameter_jacobian(model, flight, groups, predict_targets(model, flight, groups)) / scale[:, None]
            power += np.einsum("nap,nap->p", j, j)
        return power


def _one_by_one(groups: Sequence[str]) -> Iterator[tuple[tuple[str], slice]]:
    """Each group by itself, with its axes: a Jacobian of all of a long flight takes hundreds of megabytes."""
    for number, group in enumerate(groups):
        yield (group,), slice(3 * number, 3 * number + 3)
