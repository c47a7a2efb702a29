"""First-order search: how well any subset of effects would predict held-out data, by one linearised problem.

Each effect has forms: guesses of what acts nonlinearly, each with the change of the prediction that it makes, and the
derivatives by its parameters. The nuisances of the flights are eliminated, as they are in a fit, so that the least
squares of a subset are those of a few columns: all pairs take a tenth of a second.
"""

import math
from collections.abc import Callable, Sequence
from functools import cached_property
from itertools import combinations, product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from quadctl.effects import Effect
from quadctl.lab.arrays import Floats, Mask
from quadctl.lab.fitting.fitted_model import FittedModel
from quadctl.lab.fitting.initial_guesses import Unmodelled
from quadctl.lab.fitting.normal_equations import axis_weights
from quadctl.lab.fitting.nuisances import bounds, nuisance_jacobian, prior_std
from quadctl.lab.fitting.parameters import HELD, Free, free_parameters, parameter_jacobian
from quadctl.lab.fitting.significance import improvement_p_value
from quadctl.lab.flights.flight import Flight
from quadctl.lab.flights.prediction import predict_targets
from quadctl.lab.selection.rule import Rule, is_significant, score_of_power
from quadctl.model import Model

KEPT = 3
"""Number of forms of an effect that are kept alone, and of effects beside which the best form is kept, too."""
MOST, WIDTH = 4, 12
"""Largest number of effects of a subset, and of subsets of a size to which another effect is added."""
AT_ONCE = 4096
LEAST_POWER = 1e-9


class Form(NamedTuple):
    """Form of an effect, with its columns in the linearised problem."""

    kind: type[Effect]
    start: Effect
    change: int
    """Column of the change of the prediction."""
    free: tuple[int, ...]
    """Columns of the derivatives by the parameters."""


Forms = tuple[Form, ...]


class FirstOrder:
    """Linearised problem about a fitted model, with the effects of `pool` on top, in units of the noise."""

    def __init__(self, fit: FittedModel, pool: Sequence[type[Effect]], rule: Rule) -> None:
        self._fit, self._model, self._dataset, self._rule = fit, fit.model, fit.fitter.dataset, rule
        self._left, self._pool = Unmodelled(fit), pool
        self._asked: dict[frozenset[type[Effect]], tuple[float, Forms]] = {}
        dataset, groups = self._dataset, self._dataset.groups
        self._unit = self._left.scale / np.sqrt(axis_weights(dataset.flights[0], groups))
        self._predicted = [predict_targets(self._model, flight, groups) for flight in dataset.flights]
        self._nuisances = [self._nuisances_of(number) for number in range(len(dataset.flights))]
        residual = (dataset.targets - fit.predicted) / self._unit
        flights = [flight.conditions for flight in dataset.flights]
        starts = [(kind, start) for kind in pool for start in kind.starts(flights, self._model.vehicle)]
        changes = [self._change(start) for _, start in starts]
        free = free_parameters(self._model)
        columns = self._derivatives(self._model, dataset.flights, self._predicted, free)
        steps = [_steps(self._model.effects[f.effect], f) for f in free]
        self._base = tuple(range(len(free)))
        self.forms: list[Form] = []
        for i in self._worth_a_place(starts, changes, residual):
            kind, start = starts[i]
            with_it, at, flown = self._model.plus(start), len(columns), self._flights_for(start)
            own = [f for f in free_parameters(with_it) if f.effect == len(self._model.effects)]
            predicted = [predict_targets(with_it, flight, groups) for flight in flown]
            columns += [changes[i], *self._derivatives(with_it, flown, predicted, own)]
            steps += [(1.0, 1.0, 1.0), *(_steps(start, f) for f in own)]
            self.forms.append(Form(kind, start, at, tuple(range(at + 1, len(columns)))))
        self._steps = np.array(steps).reshape(-1, 3)
        """Lowest and highest step of each column's coefficient, and the standard deviation of its prior."""
        self._reduce(np.stack([*columns, residual], axis=-1))

    def promising(self) -> list[tuple[float, frozenset[type[Effect]]]]:
        """Expected score and effects of the subsets each effect of which is half as large as a material one beside the
        others, in the order of the scores, where one more effect must lower them by `equal_score`."""
        if not self._best:
            return []
        parts = {part for _, forms in self._best for part in (forms, *(_without(forms, form) for form in forms))}
        powers = dict(zip(parts, self._powers(list(parts)), strict=True))

        def matters(forms: Forms, form: Form) -> bool:
            before, after = powers[_without(forms, form)], powers[forms]
            gain_m_s2 = math.sqrt(max(float(np.max((before - after)[:3])), 0.0))
            drop = 1.0 - math.sqrt(float(np.min(after / before)))
            return drop > 0.5 * self._rule.material or gain_m_s2 > 0.5 * self._rule.material_m_s2

        found = [each for each in self._best if all(matters(each[1], form) for form in each[1])]
        found.sort(key=lambda each: each[0] + self._rule.equal_score * len(each[1]))
        return [(expected, frozenset(form.kind for form in forms)) for expected, forms in found]

    def all_help(self, subset: frozenset[type[Effect]]) -> bool:
        """Tell whether every effect of a subset is significant beside the others, uncorrected."""
        _, forms = self._best_forms(subset)
        return all(is_significant(self._p_value(forms, form), self._rule) for form in forms)

    def score(self, subset: frozenset[type[Effect]]) -> float:
        """Expected score of a subset, with its best forms."""
        return self._best_forms(subset)[0]

    def p_value(self, kind: type[Effect]) -> float:
        """p-value of one effect, not corrected for the number tried."""
        _, forms = self._best_forms(frozenset({kind}))
        return self._p_value(forms, forms[0])

    def _best_forms(self, subset: frozenset[type[Effect]]) -> tuple[float, Forms]:
        if subset not in self._asked:
            forms = [[form for form in self.forms if form.kind is kind] for kind in self._pool if kind in subset]
            (self._asked[subset],) = self._of_each(list(product(*forms)))
        return self._asked[subset]

    # --- columns ------------------------------------------------------------------------------------------------------

    def _flights_for(self, start: Effect) -> Sequence[Flight]:
        """Flights, aligned anew for a lag."""
        return self._dataset.aligned_for(self._model.plus(start)).flights if start.adds_lag else self._dataset.flights

    def _change(self, start: Effect) -> Floats:
        """Change of the prediction by an effect, shape (n, axes)."""
        model, groups = self._model.plus(start), self._dataset.groups
        flown = zip(self._flights_for(start), self._predicted, strict=True)
        return (
            np.concatenate([predict_targets(model, flight, groups) - before for flight, before in flown]) / self._unit
        )

    def _derivatives(
        self, model: Model, flights: Sequence[Flight], predicted: Sequence[Floats], free: Sequence[Free]
    ) -> list[Floats]:
        """Derivatives of the prediction by the parameters `free`, shape (n, axes) each."""
        groups, flown = self._dataset.groups, zip(flights, predicted, strict=True)
        each = np.concatenate([parameter_jacobian(model, flight, groups, at, free) for flight, at in flown])
        return list(np.moveaxis(each / self._unit[:, None], -1, 0))

    def _nuisances_of(self, number: int) -> tuple[Floats, Floats, Floats]:
        """Columns of the nuisances of a flight that no bound holds, shape (n, axes, k), with the inverse of their prior
        standard deviations, and the means of their priors from where they are, in units of these."""
        flight, groups = self._dataset.flights[number], self._dataset.groups
        found, (low, high) = self._fit.optimum.nuisances[number], bounds(flight)
        free = np.minimum(found - low, high - found) > HELD * (high - low)
        jacobian = nuisance_jacobian(self._model, flight, groups, self._predicted[number])[..., free]
        std = prior_std(flight)[free]
        return jacobian / self._unit[:, None], 1.0 / std, -found[free] / std

    def _by_nuisances(self, number: int, rows: Floats, seen: Mask | slice) -> tuple[Floats, Floats]:
        """Nuisances of a flight fitted to each of the columns, shape (k, m), of the samples `seen`; and the Gram matrix
        of these without them. The last of the columns is the target."""
        jacobian, inverse, mean = self._nuisances[number]
        own = jacobian[seen].reshape(len(rows), len(inverse))
        right = own.T @ rows
        right[:, -1] += inverse * mean
        by = np.linalg.solve(own.T @ own + np.diag(inverse**2), right)
        return np.asarray(by), rows.T @ rows - right.T @ by

    def _eliminated(self, number: int, columns: Floats, seen: Mask) -> tuple[Floats, Floats]:
        """Columns of a flight without what nuisances explain that are fitted to the samples `seen`, shape (n, axes,
        m); and the Gram matrix of these samples."""
        by, gram = self._by_nuisances(number, columns[seen].reshape(-1, columns.shape[-1]), seen)
        return columns - self._nuisances[number][0] @ by, gram

    def _worth_a_place(
        self, starts: Sequence[tuple[type[Effect], Effect]], changes: Sequence[Floats], residual: Floats
    ) -> list[int]:
        """Numbers of the starts that explain most times a factor: of each effect alone, and beside the best others."""
        gram = np.zeros((len(changes) + 1,) * 2)
        for number, part in enumerate(self._dataset.parts):
            rows = np.stack([column[part].ravel() for column in (*changes, residual)], axis=-1)
            gram += self._by_nuisances(number, rows, slice(None))[1]
        reversible = np.array([start.reversible for _, start in starts])

        def explained(gram: Floats) -> Floats:
            along = gram[:-1, -1]
            return along * np.where(reversible, along, np.abs(along)) / np.maximum(np.diagonal(gram)[:-1], LEAST_POWER)

        alone = explained(gram)
        places: dict[type[Effect], list[int]] = {}
        for i in np.argsort(-alone, kind="stable").tolist():
            places.setdefault(starts[i][0], []).append(i)
        kept = {i for own in places.values() for i in own[:KEPT]}
        leaders = {kind.family(): own[0] for kind, own in reversed(places.items())}
        for leader in sorted(leaders.values(), key=lambda i: -alone[i])[:KEPT]:
            beside = explained(gram - np.outer(gram[leader], gram[leader]) / max(gram[leader, leader], LEAST_POWER))
            kept |= {max(own, key=lambda i: beside[i]) for own in places.values() if leader not in own}
        return sorted(kept)

    def _reduce(self, columns: Floats) -> None:
        """Reduce the columns, shape (n, axes, m), to Gram matrices without and of each fold."""
        dataset, (_, axes, m) = self._dataset, columns.shape
        self._train, self._whole = np.zeros((len(dataset.folds), m, m)), np.zeros((m, m))
        self._test, self._held = np.zeros((len(dataset.folds), axes, m, m)), np.empty_like(columns)
        for number, part in enumerate(dataset.parts):
            fold = dataset.fold[part]
            self._whole += self._eliminated(number, columns[part], np.ones(len(fold), dtype=bool))[1]
            for k, held in enumerate(fold == name for name in dataset.folds):
                left, gram = self._eliminated(number, columns[part], ~held)
                self._train[k] += gram
                self._test[k] += np.einsum("nai,naj->aij", left[held], left[held], optimize=True)
                self._held[part][held] = left[held]

    # --- subsets ------------------------------------------------------------------------------------------------------

    @cached_property
    def _best(self) -> list[tuple[float, Forms]]:
        """Subsets with their scores: all of one and of two effects, larger ones by a beam."""
        pairs = [p for p in combinations(self.forms, 2) if p[0].kind.family() != p[1].kind.family()]
        found, wider = self._of_each([(form,) for form in self.forms]), self._of_each(pairs)
        for _ in range(MOST - 2):
            found += wider
            beam = [forms for _, forms in sorted(wider, key=lambda each: each[0])[:WIDTH]]
            more = [(*b, f) for b in beam for f in self.forms if f.kind.family() not in {x.kind.family() for x in b}]
            wider = self._of_each(more)
        return found + wider

    def _of_each(self, subsets: Sequence[Forms]) -> list[tuple[float, Forms]]:
        """Forms of each set of effects that fit best, with their held-out score."""
        if not subsets:
            return []
        least: dict[frozenset[type[Effect]], tuple[float, Forms]] = {}
        for forms, objective in zip(subsets, self._in_groups(subsets, self._objectives), strict=True):
            key = frozenset(form.kind for form in forms)
            if key not in least or objective < least[key][0]:
                least[key] = float(objective), forms
        kept = [forms for _, forms in least.values()]
        return [(score_of_power(p, self._rule), f) for p, f in zip(self._powers(kept), kept, strict=True)]

    def _powers(self, subsets: Sequence[Forms]) -> Floats:
        """Held-out mean square of each axis, shape (subsets, axes)."""
        return self._in_groups(subsets, self._powers_of)

    def _p_value(self, forms: Forms, form: Form) -> float:
        """p-value of an effect beside the others, not corrected for the number tried."""
        before, after = self._residual(_without(forms, form)), self._residual(forms)
        return improvement_p_value(before, before - after, self._left.dataset, self._left.forms)

    def _residual(self, forms: Forms) -> Floats:
        """Held-out residual, shape (n, axes)."""
        columns = self._columns([forms])
        found = np.empty(self._held.shape[:2])
        for number, gram in zip(self._dataset.folds, self._train, strict=True):
            here = self._dataset.fold == number
            found[here] = self._held[here][..., columns[0]] @ self._solved(gram, columns, len(forms))[0]
        return found * self._unit

    def _columns(self, subsets: Sequence[Forms]) -> NDArray[np.intp]:
        """Columns of subsets of one size: the changes, what is free, and the target."""
        target = self._whole.shape[-1] - 1
        each = [[*(f.change for f in s), *self._base, *(c for f in s for c in f.free), target] for s in subsets]
        return np.array(each, dtype=np.intp)

    def _in_groups(self, subsets: Sequence[Forms], of: Callable[[NDArray[np.intp], int], Floats]) -> Floats:
        """Results for all subsets, computed for those of one size at once."""
        sizes: dict[tuple[int, int], list[int]] = {}
        for i, forms in enumerate(subsets):
            sizes.setdefault((len(forms), sum(len(form.free) for form in forms)), []).append(i)
        order, found = [], []
        for (count, _), places in sizes.items():
            for begin in range(0, len(places), AT_ONCE):
                now = places[begin : begin + AT_ONCE]
                order += now
                found.append(of(self._columns([subsets[i] for i in now]), count))
        return np.concatenate(found)[np.argsort(order)]

    def _solved(self, gram: Floats, columns: NDArray[np.intp], fixed: int) -> Floats:
        """Coefficients of the columns in the residual, shape (subsets, columns): -1 for the `fixed` ones, 1 for the
        target, and for the others by least squares, within their bounds."""
        own, steps = gram[columns[:, :, None], columns[:, None, :]], self._steps[columns[:, fixed:-1]]
        found = np.ones(columns.shape)
        found[:, :fixed] = -1.0
        free = slice(fixed, -1)
        right = own[:, free, -1] - own[:, free, :fixed].sum(axis=-1)
        normal = own[:, free, free] + np.eye(steps.shape[1]) / steps[:, :, None, 2] ** 2
        found[:, free] = -np.clip(np.linalg.solve(normal, right[..., None])[..., 0], steps[..., 0], steps[..., 1])
        return found

    def _objectives(self, columns: NDArray[np.intp], fixed: int) -> Floats:
        return _squares(self._whole, columns, self._solved(self._whole, columns, fixed))

    def _powers_of(self, columns: NDArray[np.intp], fixed: int) -> Floats:
        power = np.zeros((len(columns), len(self._unit)))
        for train, test in zip(self._train, self._test, strict=True):
            by = self._solved(train, columns, fixed)
            power += np.stack([_squares(gram, columns, by) for gram in test], axis=-1)
        return np.asarray(power * self._unit**2 / len(self._held))


def _squares(gram: Floats, columns: NDArray[np.intp], by: Floats) -> Floats:
    """Sum of squares of the columns times their coefficients, shape (subsets,)."""
    return np.asarray(np.einsum("si,sij,sj->s", by, gram[columns[:, :, None], columns[:, None, :]], by))


def _without(forms: Forms, form: Form) -> Forms:
    return tuple(other for other in forms if other is not form)


def _steps(effect: Effect, free: Free) -> tuple[float, float, float]:
    """Lowest and highest step of a parameter, and the standard deviation of its prior: its range."""
    value, p = getattr(effect, free.parameter.name), free.parameter
    return p.low - value, p.high - value, p.high - p.low
