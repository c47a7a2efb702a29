"""Verification of a model on new flights: do its parameters still hold, and is anything missing that was not?

Each flight is judged by itself, because that is what changes from one day to the next. Two questions are asked of it:

- Does a refit of an effect lower the error on held-out blocks of this flight, and does one of its parameters move by
  more than its interval in the model's file and its interval in this flight allow?
- Does the diagnosis find an effect missing on top of the refitted model, by the rule of `diagnose`?

The bias of a flight (`nuisances`) is fitted in both, so that what flights of one vehicle differ by is no change.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text
from scipy import special

from quadctl.errors import SettingsError
from quadctl.lab.fitting.fitted_model import FittedModel, fit_as_it_stands, fit_model
from quadctl.lab.fitting.parameters import undetermined
from quadctl.lab.fitting.significance import improvement_p_value
from quadctl.lab.flights.dataset import Dataset
from quadctl.lab.random_effects import Z95
from quadctl.lab.results import Result
from quadctl.lab.selection.diagnosis import diagnose
from quadctl.lab.words import Answer
from quadctl.model import Model
from quadctl.words import Fact, fact

FALSE_ALARMS = 0.05
"""Nominal share of all verifications of an unchanged vehicle in which some parameter is called changed."""


class Change(NamedTuple):
    """A parameter that left its interval."""

    effect: str
    parameter: str
    before: tuple[float, float, float]
    """Value and 95 % interval in the model's file."""
    now: tuple[float, float, float]
    """The same by this flight alone."""
    sigmas: float
    """Difference over the standard error of the difference."""

    def to_dict(self) -> dict[str, Any]:
        (value, *ci95), (now, *now_ci95) = self.before, self.now
        intervals = {"value": value, "ci95": ci95, "now": now, "now_ci95": now_ci95}
        return {"effect": self.effect, "parameter": self.parameter, **intervals, "sigmas": self.sigmas}


@dataclass(frozen=True)
class FlightCheck:
    """Result of one flight."""

    flight: str
    error_m_s2: float
    """Held-out acceleration error of the model as it is, the bias of the flight fitted."""
    refitted_m_s2: float
    """The same with the effects refitted to this flight that it shows to have changed."""
    changes: tuple[Change, ...]
    missing: tuple[str, ...]
    """Families of effects that are missing on top of the refitted model."""
    silent: tuple[str, ...]
    """Parameters that this flight does not determine."""

    @property
    def holds(self) -> bool:
        return not self.changes and not self.missing

    def to_dict(self) -> dict[str, Any]:
        return {
            "flight": self.flight,
            "holds": self.holds,
            "error_m_s2": self.error_m_s2,
            "refitted_m_s2": self.refitted_m_s2,
            "changes": [change.to_dict() for change in self.changes],
            "missing": list(self.missing),
            "not_determined": list(self.silent),
        }


@dataclass(frozen=True, eq=False, repr=False)
class Verification(Result):
    """Result of `verify`."""

    model: Model
    checks: tuple[FlightCheck, ...]

    @property
    def holds(self) -> bool:
        return all(check.holds for check in self.checks)

    def to_dict(self) -> dict[str, Any]:
        return {
            "holds": self.holds,
            "false_alarm_rate": FALSE_ALARMS,
            "flights": [check.to_dict() for check in self.checks],
        }

    def __rich__(self) -> RenderableType:
        table = Table(title="Held-out acceleration error of each flight, m/s^2", title_justify="left")
        for heading in ("flight", "model", "refitted", "verdict"):
            table.add_column(heading, overflow="fold")
        for check in self.checks:
            verdict = "holds" if check.holds else "does not hold"
            table.add_row(check.flight, f"{check.error_m_s2:.4f}", f"{check.refitted_m_s2:.4f}", verdict)
        return Group(table, Text("\n".join(map(str, self.answer))))

    @property
    def answer(self) -> list[Fact]:
        """Changes and missing effects of each flight, and the verdict."""
        found = []
        first: dict[tuple[str, str], str] = {}
        for check in self.checks:
            for c in check.changes:
                since = first.setdefault((c.effect, c.parameter), check.flight)
                since = "" if since == check.flight else since
                found.append(fact(Answer.CHANGED, flight=check.flight, since=since, **c._asdict()))
            if check.missing:
                found.append(fact(Answer.MISSING_ON_TOP, flight=check.flight, families=check.missing))
            if check.silent:
                found.append(fact(Answer.NOT_DETERMINED, flight=check.flight, parameters=check.silent))
        return [*found, fact(Answer.HOLDS if self.holds else Answer.HOLDS_NOT)]


def verify(
    model: Model, flights: Sequence[Dataset], progress: Callable[[str], None] = lambda text: None
) -> Verification:
    """Judge a fitted `model` on new flights, a dataset of one flight each, in their order of time.

    Raises
    ------
    SettingsError
        The model holds no parameter with an interval, so that no change could be told.
    """
    known = [name for item in model.stack for name in item.ci95]
    if not known:
        raise SettingsError(f"{model.name}: holds no parameter with an interval, expected a model that was fitted")
    limit = -float(special.ndtri(0.5 * FALSE_ALARMS / (len(known) * len(flights))))
    checks = []
    for dataset in flights:
        progress(f"verified on {dataset.names[0]}")
        checks.append(_check(model, dataset, limit, FALSE_ALARMS / len(flights)))
    return Verification(model, tuple(checks))


def _check(model: Model, dataset: Dataset, limit: float, p_limit: float) -> FlightCheck:
    whole = fit_model(model, dataset)
    names = [f"{f.parameter.name} of {model.effects[f.effect].name}" for f in whole.free]
    blind = undetermined(whole.free, whole.intervals)
    silent = tuple(name for name, free in zip(names, whole.free, strict=True) if free in blind)
    as_it_is, after = _refitted_effects(model, dataset, p_limit / max(1, len(model.stack)))
    changes = _changes(model, after, limit)
    missing = tuple(diagnose(model, dataset).missing)
    before_m_s2, after_m_s2 = as_it_is.held_out_rmse["total"], after.held_out_rmse["total"]
    return FlightCheck(dataset.names[0], before_m_s2, after_m_s2, changes, missing, silent)


def _refitted_effects(model: Model, dataset: Dataset, p_limit: float) -> tuple[FittedModel, FittedModel]:
    """Fit of the model as it is, and with those effects refitted that lower the held-out error, one after the other.

    A change of one effect bends the parameters of all others in a common fit; so an effect is freed only where the
    effects freed before it do not explain what changed.
    """
    freed: frozenset[int] = frozenset()
    before = after = fit_as_it_stands(model, dataset)
    while len(freed) < len(model.stack):
        others = (i for i in range(len(model.stack)) if i not in freed)
        trials = {i: fit_as_it_stands(model, dataset, freed | {i}) for i in others}
        best = min(trials, key=lambda i: trials[i].held_out_rmse["total"])
        lower = after.held_out_residual - trials[best].held_out_residual
        if improvement_p_value(after.held_out_residual, lower, dataset) >= p_limit:
            break
        freed, after = freed | {best}, trials[best]
    return before, after


def _changes(model: Model, after: FittedModel, limit: float) -> tuple[Change, ...]:
    found = []
    blind = undetermined(after.free, after.intervals)
    for free, (low, high) in zip(after.free, after.intervals, strict=True):
        item, name = model.stack[free.effect], free.parameter.name
        old = item.ci95.get(name)
        if old is None or free in blind:
            continue
        before, now = getattr(item.effect, name), getattr(after.model.effects[free.effect], name)
        error = math.hypot(old[1] - old[0], high - low) / (2.0 * Z95)
        sigmas = abs(now - before) / error if error > 0.0 else 0.0
        if sigmas > limit:
            found.append(Change(item.effect.name, name, (before, *old), (now, low, high), sigmas))
    return tuple(found)
