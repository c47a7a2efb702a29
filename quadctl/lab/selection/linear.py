"""Linearised problem of a search: how well any subset of effects would predict held-out data, to first order."""

from collections.abc import Sequence
from itertools import combinations, product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from quadctl.effects import Effect
from quadctl.lab.arrays import Floats
from quadctl.lab.fitting.fitted_model import FittedModel
from quadctl.lab.fitting.initial_guesses import _trusted
from quadctl.lab.fitting.noise import noise_scale
from quadctl.lab.fitting.normal_equations import axis_weights
from quadctl.lab.fitting.nuisances import PRIOR_STD, bounds, nuisance_jacobian
from quadctl.lab.fitting.parameters import HELD, Free, free_parameters, parameter_jacobian
from quadctl.lab.flights.flight import Flight
from quadctl.lab.flights.prediction import predict_targets
from quadctl.lab.selection.rule import RULE
from quadctl.model import Model

KEPT = 3


class Form(NamedTuple):
    kind: type[Effect]
    effect: Effect
    fixed: int
    """Column of the change of the prediction by the effect at its start."""
    free: tuple[int, ...]
    """Columns of the derivatives by its parameters."""


class Linearised:
    """Linearised problem about a fitted model."""

    def __init__(self, fit: FittedModel, pool: Sequence[type[Effect]]) -> None:
        self.fit, self.dataset = fit, fit.fitter.dataset
        self.model = fit.model
        dataset, groups = self.dataset, self.dataset.groups
        residual = dataset.targets - fit.predicted
        self.scale = _trusted(noise_scale(residual), dataset)
        self.weights = np.sqrt(axis_weights(dataset.flights[0], groups))
        self._unit = self.scale / self.weights
        self._predicted = [predict_targets(self.model, f, groups) for f in dataset.flights]
        self._nuisances = [self._nuisance(number) for number in range(len(dataset.flights))]
        self.y = residual / self._unit
        conditions = [f.conditions for f in dataset.flights]
        starts = [(kind, start) for kind in pool for start in kind.starts(conditions, self.model.vehicle)]
        changes = [self._change(start) for _, start in starts]
        kept = self._selected(starts, changes)
        base = free_parameters(self.model)
        columns = [*self._jacobian(self.model, dataset.flights, self._predicted, base)]
        steps = [self._steps(self.model.effects[f.effect], f) for f in base]
        self.base = tuple(range(len(base)))
        self.forms: list[Form] = []
        for i in kept:
            kind, start = starts[i]
            model = self.model.plus(start)
            fixed = len(columns)
            columns.append(changes[i])
            steps.append((1.0, 1.0, 1.0))
            own = [f for f in free_parameters(model) if f.effect == len(self.model.effects)]
            if own:
                flights = self._aligned(start)
                with_it = [predict_targets(model, f, groups) for f in flights]
                columns += self._jacobian(model, flights, with_it, own)
                steps += [self._steps(start, f) for f in own]
            self.forms.append(Form(kind, start, fixed, tuple(range(fixed + 1, len(columns)))))
        self.steps = np.array(steps)
        self._reduce(np.stack([*columns, self.y], axis=-1))

    def _aligned(self, start: Effect) -> Sequence[Flight]:
        dataset = self.dataset
        return dataset.aligned_for(self.model.plus(start)).flights if start.adds_lag else dataset.flights

    def _change(self, start: Effect) -> Floats:
        model, groups = self.model.plus(start), self.dataset.groups
        parts = [predict_targets(model, f, groups) - p for f, p in zip(self._aligned(start), self._predicted, strict=True)]
        return np.concatenate(parts) / self._unit

    def _jacobian(
        self, model: Model, flights: Sequence[Flight], predicted: Sequence[Floats], free: Sequence[Free]
    ) -> list[Floats]:
        if not free:
            return []
        each = [parameter_jacobian(model, f, self.dataset.groups, p, free) for f, p in zip(flights, predicted, strict=True)]
        return list(np.moveaxis(np.concatenate(each) / self._unit[:, None], -1, 0))

    @staticmethod
    def _steps(effect: Effect, free: Free) -> tuple[float, float, float]:
        value, p = getattr(effect, free.parameter.name), free.parameter
        return p.low - value, p.high - value, p.high - p.low

    def _nuisance(self, number: int) -> tuple[Floats, Floats, Floats]:
        """Columns of the nuisances of a flight that no bound holds, with the inverse of their prior deviations, and
        their means."""
        flight, groups = self.dataset.flights[number], self.dataset.groups
        found = self.fit.optimum.nuisances[number]
        low, high = bounds(flight)
        free = (found - low > HELD * (high - low)) & (high - found > HELD * (high - low))
        n = nuisance_jacobian(self.model, flight, groups, self._predicted[number])
        return n[..., free] / self._unit[:, None], 1.0 / PRIOR_STD[free], -found[free] / PRIOR_STD[free]

    def _reduce(self, w: Floats) -> None:
        dataset, folds = self.dataset, self.dataset.folds
        n, axes, m = w.shape
        self.train = np.zeros((len(folds) + 1, m, m))
        self.test = np.zeros((len(folds), axes, m, m))
        self.held = np.empty((n, axes, m))
        for (jac, inv, offset), part in zip(self._nuisances, dataset.parts, strict=True):
            fold = dataset.fold[part]
            own = w[part]
            for k, number in enumerate([*folds, None]):
                seen = fold != number if number is not None else np.ones(len(fold), dtype=bool)
                a, b = self._normal(jac[seen], inv, offset, own[seen])
                dn = np.linalg.solve(a, b)
                rows = own[seen].reshape(-1, m)
                self.train[k] += rows.T @ rows - b.T @ dn
                if number is not None and not seen.all():
                    held = own[~seen] - (jac[~seen].reshape(-1, jac.shape[-1]) @ dn).reshape(own[~seen].shape)
                    self.held[np.arange(part.start, part.stop)[~seen]] = held
                    for axis in range(axes):
                        self.test[k, axis] += held[:, axis].T @ held[:, axis]
        self.n = n

    @staticmethod
    def _normal(jac: Floats, inv: Floats, offset: Floats, w: Floats) -> tuple[Floats, Floats]:
        flat, rows = jac.reshape(-1, jac.shape[-1]), w.reshape(-1, w.shape[-1])
        a = flat.T @ flat + np.diag(inv**2)
        b = flat.T @ rows
        b[:, -1] += inv * offset
        return a, b

    def _selected(self, starts: Sequence[tuple[type[Effect], Effect]], changes: Sequence[Floats]) -> list[int]:
        """Starts worth a place: of each class the best alone, and the best beside each of the best ones; by what a factor
        on the change explains."""
        w = np.stack([*changes, self.y], axis=-1)
        gram = np.zeros((w.shape[-1], w.shape[-1]))
        for (jac, inv, offset), part in zip(self._nuisances, self.dataset.parts, strict=True):
            a, b = self._normal(jac, inv, offset, w[part])
            rows = w[part].reshape(-1, w.shape[-1])
            gram += rows.T @ rows - b.T @ np.linalg.solve(a, b)
        reversible = np.array([start.reversible for _, start in starts])

        def gains(gram: Floats) -> Floats:
            along = gram[:-1, -1]
            squared = along * np.where(reversible, along, np.abs(along))
            return squared / np.maximum(np.diagonal(gram)[:-1], 1e-9)

        kept: dict[int, None] = {}
        by_kind: dict[type[Effect], list[int]] = {}
        for i, (kind, _) in enumerate(starts):
            by_kind.setdefault(kind, []).append(i)
        alone = gains(gram)
        leaders: dict[str, int] = {}
        for kind, places in by_kind.items():
            order = sorted(places, key=lambda i: -alone[i])
            kept |= dict.fromkeys(order[:KEPT])
            if kind.family() not in leaders or alone[order[0]] > alone[leaders[kind.family()]]:
                leaders[kind.family()] = order[0]
        for leader in sorted(leaders.values(), key=lambda i: -alone[i])[:KEPT]:
            rest = gram - np.outer(gram[:, leader], gram[leader]) / max(gram[leader, leader], 1e-9)
            beside = gains(rest)
            for places in by_kind.values():
                if len(places) > KEPT and leader not in places:
                    kept[max(places, key=lambda i: beside[i])] = None
        return sorted(kept)

    @staticmethod
    def _solved(gram: Floats, fixed: int, steps: Floats) -> tuple[Floats, Floats]:
        """Coefficients and objective of problems whose first columns have the coefficient 1, the last is the target;
        gram (..., c, c)."""
        c = gram.shape[-1]
        one = np.zeros(c)
        one[:fixed], one[-1] = -1.0, 1.0
        a = gram[..., fixed:-1, fixed:-1].copy()
        at = np.arange(a.shape[-1])
        a[..., at, at] += 1.0 / steps[..., 2] ** 2
        rhs = gram[..., fixed:-1, :] @ one
        b = np.linalg.solve(a, rhs[..., None])[..., 0] if a.shape[-1] else np.zeros(rhs.shape)
        b = np.clip(b, steps[..., 0], steps[..., 1])
        full = np.concatenate([-np.ones((*b.shape[:-1], fixed)), -b, np.ones((*b.shape[:-1], 1))], axis=-1)
        return b, np.einsum("...i,...ij,...j->...", full, gram, full)

    def scores(self, subsets: Sequence[Sequence[Form]]) -> Floats:
        """Held-out score of each subset of forms, to first order."""
        return self._batched(subsets, self._held_out)

    def objectives(self, subsets: Sequence[Sequence[Form]]) -> Floats:
        """Objective in units of the noise of each subset, fitted to all data."""
        return self._batched(subsets, self._in_sample)

    def _batched(self, subsets, how, width: int = 0) -> Floats:
        found = np.empty((len(subsets), width) if width else len(subsets))
        groups: dict[tuple[int, int], list[int]] = {}
        for i, s in enumerate(subsets):
            groups.setdefault((len(s), sum(len(f.free) for f in s)), []).append(i)
        last = len(self.steps)
        for (count, _), places in groups.items():
            idx = np.array(
                [[*(f.fixed for f in subsets[i]), *self.base, *(c for f in subsets[i] for c in f.free), last] for i in places]
            )
            for begin in range(0, len(idx), 4096):
                part = idx[begin : begin + 4096]
                found[np.array(places[begin : begin + 4096])] = how(part, count)
        return found

    def _in_sample(self, idx: NDArray[np.intp], fixed: int) -> Floats:
        gram = self.train[-1][idx[:, :, None], idx[:, None, :]]
        return self._solved(gram, fixed, self.steps[idx[:, fixed:-1]])[1]

    def residual(self, subset: Sequence[Form]) -> Floats:
        """Held-out residual of a subset, shape (n, axes)."""
        idx = np.array([*(f.fixed for f in subset), *self.base, *(c for f in subset for c in f.free), len(self.steps)])
        fixed = len(subset)
        found = np.empty(self.held.shape[:2])
        for k, number in enumerate(self.dataset.folds):
            b, _ = self._solved(self.train[k][np.ix_(idx, idx)], fixed, self.steps[idx[fixed:-1]])
            here = self.dataset.fold == number
            found[here] = self.held[here][..., idx] @ np.concatenate([-np.ones(fixed), -b, np.ones(1)])
        return found * self._unit

    def powers(self, subsets: Sequence[Sequence[Form]]) -> Floats:
        """Held-out mean square of each axis, shape (subsets, axes)."""
        return self._batched(subsets, self._power, self.test.shape[1])

    def _held_out(self, idx: NDArray[np.intp], fixed: int) -> Floats:
        power = self._power(idx, fixed)
        others = 0.0
        for i in range(3, power.shape[1], 3):
            p = power[:, i : i + 3]
            others = others + np.log(np.maximum(p, RULE.least_share_of_moment**2 * p.sum(axis=1, keepdims=True))).mean(axis=1)
        return 0.5 * (np.log(power[:, :3].sum(axis=1)) + others)

    def _power(self, idx: NDArray[np.intp], fixed: int) -> Floats:
        axes = self.test.shape[1]
        power = np.zeros((len(idx), axes))
        for k in range(len(self.test)):
            gram = self.train[k][idx[:, :, None], idx[:, None, :]]
            b, _ = self._solved(gram, fixed, self.steps[idx[:, fixed:-1]])
            full = np.concatenate([-np.ones((len(idx), fixed)), -b, np.ones((len(idx), 1))], axis=-1)
            for axis in range(axes):
                test = self.test[k, axis][idx[:, :, None], idx[:, None, :]]
                power[:, axis] += np.einsum("ki,kij,kj->k", full, test, full)
        return np.maximum(power * self._unit**2 / self.n, 1e-12)

    def best(self, most: int = 4, width: int = 12) -> list[tuple[float, tuple[Form, ...]]]:
        """Best combinations of forms, one for each set of classes, by first-order held-out score."""
        singles = [(f,) for f in self.forms]
        pairs = [
            p for p in combinations(self.forms, 2) if p[0].effect.family() != p[1].effect.family()
        ]
        found = self._one_each([*singles, *pairs])
        beam = sorted((s for s in found if len(s[1]) == 2), key=lambda s: s[0])[:width]
        for _ in range(most - 2):
            wider = [
                (*b, f) for _, b in beam for f in self.forms
                if f.kind.family() not in {x.effect.family() for x in b}
            ]
            new = self._one_each(wider)
            found += new
            beam = sorted(new, key=lambda s: s[0])[:width]
        return sorted(found, key=lambda s: s[0])

    def _one_each(self, subsets) -> list[tuple[float, tuple[Form, ...]]]:
        """Of each set of classes the forms of the least objective, with their held-out score."""
        if not subsets:
            return []
        chosen: dict[frozenset, tuple[float, tuple[Form, ...]]] = {}
        for s, o in zip(subsets, self.objectives(subsets), strict=True):
            key = frozenset(f.kind for f in s)
            if key not in chosen or o < chosen[key][0]:
                chosen[key] = o, s
        kept = [s for _, s in chosen.values()]
        return list(zip(self.scores(kept).tolist(), kept, strict=True))

    def first_order(self, key: frozenset[type[Effect]]) -> float:
        """First-order held-out score of a set of classes, by their best forms."""
        each = [[f for f in self.forms if f.kind is kind] for kind in key]
        ((found, _),) = self._one_each(list(product(*each)))
        return found
