"""Python interface of the lab: one function for each verb of a `Study`, of logs, their paths, or a prepared dataset."""

from collections.abc import Iterable
from pathlib import Path

import quadctl.lab.figures  # noqa: F401  (registers the figure of each result)
from quadctl.effects import Effect
from quadctl.lab.comparison.comparison import Comparison
from quadctl.lab.comparison.unseen_flights import Judgement
from quadctl.lab.comparison.unseen_flights import judge as judge_on
from quadctl.lab.flights.dataset import HoldOut
from quadctl.lab.planning.suggestion import Suggestion
from quadctl.lab.planning.suggestion import suggest as suggest_after
from quadctl.lab.selection.addition import Addition
from quadctl.lab.selection.diagnosis import Diagnosis
from quadctl.lab.selection.discovery import Discovery
from quadctl.lab.selection.refit import Refit
from quadctl.lab.selection.removal import Removal
from quadctl.lab.study import AnyModel, Flights, Progress, Study, open_model, prepare_flights, quiet


def compare(model: AnyModel, flights: Flights) -> Comparison:
    """Compare `model` with flights: its error, the reference error, and where it fails. No parameter is fitted.

    Examples
    --------
    >>> from quadctl.lab import compare
    >>> result = compare("raptor.yaml", "flight.csv")
    >>> result.rmse["total"] > result.noise_floor["total"]
    True
    """
    return Study.of(model, flights).compare()


def diagnose(
    model: AnyModel,
    flights: Flights,
    candidates: Iterable[type[Effect] | str] | None = None,
    hold_out: HoldOut = "blocks",
    progress: Progress = quiet,
    nested: bool = False,
) -> Diagnosis:
    """Find the physical effects that are missing from `model`.

    `candidates` are effects or their names; all known ones by default. `hold_out` says what each fit does not see:
    blocks of time of every flight, or whole flights. `progress` is called with short texts. With `nested` the whole
    search is repeated without each part of the data, which gives an error that no choice has seen (`unseen`).

    Examples
    --------
    >>> from quadctl.lab import diagnose
    >>> diagnose("raptor.yaml", "flight.csv", ["thrust_scale", "ground_effect.exponential"]).missing
    ['ground_effect']
    """
    return Study.of(model, flights, hold_out).diagnose(candidates, progress, nested)


def suggest(
    model: AnyModel,
    flights: Flights,
    missions: Path | str = Path("missions"),
    candidates: Iterable[type[Effect] | str] | None = None,
    hold_out: HoldOut = "blocks",
    progress: Progress = quiet,
) -> Suggestion:
    """Suggest the mission of the folder `missions` that best answers what `flights` leave open.

    `candidates`, `hold_out` and `progress` are those of `diagnose`, which is run first.
    """
    return suggest_after(diagnose(model, flights, candidates, hold_out, progress), missions)


def add(effect: type[Effect] | str, model: AnyModel, flights: Flights, hold_out: HoldOut = "blocks") -> Addition:
    """Add `effect` to `model` and refit all parameters.

    Examples
    --------
    >>> from quadctl.lab import add
    >>> result = add("ground_effect.exponential", "raptor.yaml", "flight.csv")
    >>> result.held_out_drop > 0.5
    True
    >>> round(result.model.effects[0].a, 1)
    0.3
    """
    return Study.of(model, flights, hold_out).add(effect)


def fit(model: AnyModel, flights: Flights, hold_out: HoldOut = "blocks") -> Refit:
    """Refit all parameters of `model` together.

    Examples
    --------
    >>> from quadctl.lab import add, fit
    >>> fitted = add("ground_effect.exponential", "raptor.yaml", "flight.csv").model
    >>> fit(fitted, "other_flight.csv").after["total"] < 0.2
    True
    """
    return Study.of(model, flights, hold_out).refit()


def remove(effect: str, model: AnyModel, flights: Flights, hold_out: HoldOut = "blocks") -> Removal:
    """Remove `effect` (name, family or variant) from `model`, and refit the remaining parameters.

    Examples
    --------
    >>> from quadctl.lab import add, remove
    >>> fitted = add("ground_effect.exponential", "raptor.yaml", "flight.csv").model
    >>> remove("ground_effect", fitted, "flight.csv").p_value < 0.001
    True
    """
    return Study.of(model, flights, hold_out).remove(effect)


def discover(
    model: AnyModel,
    flights: Flights,
    candidates: Iterable[type[Effect] | str] | None = None,
    hold_out: HoldOut = "blocks",
    progress: Progress = quiet,
    nested: bool = False,
) -> Discovery:
    """Compare, diagnose and add, until no significant effect is missing; `nested` is that of `diagnose`.

    Examples
    --------
    >>> from quadctl.lab import discover
    >>> found = discover("raptor.yaml", "flight.csv", ["thrust_scale", "ground_effect.exponential"])
    >>> [effect.name for effect in found.model.effects]
    ['ground_effect.exponential']
    """
    return Study.of(model, flights, hold_out).discover(candidates, progress, nested)


def judge(before: AnyModel, after: AnyModel, unseen: Flights) -> Judgement:
    """Compare two models with flights that no fit has seen: the error of both, and the interval of its change."""
    before = open_model(before)
    return judge_on(before, open_model(after), prepare_flights(unseen, before.vehicle))
