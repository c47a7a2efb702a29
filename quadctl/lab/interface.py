"""Python interface of the lab: the analyses take logs, their paths, or a prepared dataset."""

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import TypeAlias

import quadctl.lab.figures  # noqa: F401  (registers the figure of each result)
from quadctl.effects import Effect, catalog_with, find_effect
from quadctl.errors import SettingsError
from quadctl.lab.comparison.comparison import Comparison
from quadctl.lab.comparison.comparison import compare as run_compare
from quadctl.lab.comparison.unseen_flights import Judgement
from quadctl.lab.comparison.unseen_flights import judge as run_judge
from quadctl.lab.flights.dataset import Dataset, HoldOut, load_dataset
from quadctl.lab.planning.suggestion import Suggestion
from quadctl.lab.planning.suggestion import suggest as run_suggest
from quadctl.lab.selection.addition import Addition
from quadctl.lab.selection.addition import add as run_add
from quadctl.lab.selection.diagnosis import Diagnosis
from quadctl.lab.selection.diagnosis import diagnose as run_diagnose
from quadctl.lab.selection.discovery import Discovery
from quadctl.lab.selection.discovery import discover as run_discover
from quadctl.lab.selection.refit import Refit
from quadctl.lab.selection.refit import fit as run_fit
from quadctl.lab.selection.removal import Removal
from quadctl.lab.selection.removal import remove as run_remove
from quadctl.logs.flight_log import FlightLog
from quadctl.logs.read import read_logs
from quadctl.logs.record.copies import without_copies
from quadctl.model import Model, load_model
from quadctl.vehicle import Vehicle

Log: TypeAlias = FlightLog | Path | str
Flights: TypeAlias = Dataset | Log | Sequence[Log]
"""One or several flights: logs, paths of logs, or the result of `prepare_flights`."""
AnyModel: TypeAlias = Model | Path | str
"""Model, or the path of a model or vehicle file."""


def compare(model: AnyModel, flights: Flights) -> Comparison:
    """Compare `model` with flights: its error, the reference error, and where it fails. No parameter is fitted.

    Examples
    --------
    >>> from quadctl.lab import compare
    >>> result = compare("raptor.yaml", "flight.csv")
    >>> result.rmse["total"] > result.noise_floor["total"]
    True
    """
    model = open_model(model)
    return run_compare(model, prepare_flights(flights, model.vehicle))


def diagnose(
    model: AnyModel,
    flights: Flights,
    candidates: Iterable[type[Effect] | str] | None = None,
    hold_out: HoldOut = "blocks",
    progress: Callable[[str], None] = lambda text: None,
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
    model = open_model(model)
    kinds = None if candidates is None else [_kind(candidate, model) for candidate in candidates]
    return run_diagnose(model, prepare_flights(flights, model.vehicle, hold_out), kinds, progress, nested)


def suggest(
    model: AnyModel,
    flights: Flights,
    missions: Path | str = Path("missions"),
    candidates: Iterable[type[Effect] | str] | None = None,
    hold_out: HoldOut = "blocks",
    progress: Callable[[str], None] = lambda text: None,
) -> Suggestion:
    """Suggest the mission of the folder `missions` that best answers what `flights` leave open.

    `candidates`, `hold_out` and `progress` are those of `diagnose`, which is run first.
    """
    return run_suggest(diagnose(model, flights, candidates, hold_out, progress), missions)


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
    model = open_model(model)
    return run_add(_kind(effect, model), model, prepare_flights(flights, model.vehicle, hold_out))


def fit(model: AnyModel, flights: Flights, hold_out: HoldOut = "blocks") -> Refit:
    """Refit all parameters of `model` together.

    Examples
    --------
    >>> from quadctl.lab import add, fit
    >>> fitted = add("ground_effect.exponential", "raptor.yaml", "flight.csv").model
    >>> fit(fitted, "other_flight.csv").after["total"] < 0.2
    True
    """
    model = open_model(model)
    return run_fit(model, prepare_flights(flights, model.vehicle, hold_out))


def remove(effect: str, model: AnyModel, flights: Flights, hold_out: HoldOut = "blocks") -> Removal:
    """Remove `effect` (name, family or variant) from `model`, and refit the remaining parameters.

    Examples
    --------
    >>> from quadctl.lab import add, remove
    >>> fitted = add("ground_effect.exponential", "raptor.yaml", "flight.csv").model
    >>> remove("ground_effect", fitted, "flight.csv").p_value < 0.001
    True
    """
    model = open_model(model)
    return run_remove(effect, model, prepare_flights(flights, model.vehicle, hold_out))


def discover(
    model: AnyModel,
    flights: Flights,
    candidates: Iterable[type[Effect] | str] | None = None,
    hold_out: HoldOut = "blocks",
    progress: Callable[[str], None] = lambda text: None,
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
    model = open_model(model)
    kinds = None if candidates is None else [_kind(candidate, model) for candidate in candidates]
    return run_discover(model, prepare_flights(flights, model.vehicle, hold_out), kinds, progress, nested)


def judge(before: AnyModel, after: AnyModel, unseen: Flights) -> Judgement:
    """Compare two models with flights that no fit has seen: the error of both, and the interval of its change."""
    before = open_model(before)
    return run_judge(before, open_model(after), prepare_flights(unseen, before.vehicle))


def open_model(model: AnyModel) -> Model:
    """Return the model, read from its file where a path is given.

    Raises
    ------
    SettingsError
        The file cannot be read, or is no model.
    """
    return model if isinstance(model, Model) else load_model(model)


class HoldOutError(SettingsError):
    """Error of a request to hold out what cannot be held out; the message begins with `hold_out`."""


def prepare_flights(flights: Flights, vehicle: Vehicle, hold_out: HoldOut = "blocks") -> Dataset:
    """Prepare the flights, flown by `vehicle`, for any analysis; keep the result where several analyses follow.

    A dataset is returned as it is.

    Raises
    ------
    LogError
        A log cannot be read or analysed, or contradicts itself.
    SettingsError
        There is no log.
    HoldOutError
        `hold_out` is neither "blocks" nor "flights", or asks for flights to be held out of one.
    """
    if isinstance(flights, Dataset):
        return flights
    given = [flights] if isinstance(flights, FlightLog | Path | str) else list(flights)
    if not given:
        raise SettingsError("no flight is given, expected at least one log")
    if hold_out not in ("blocks", "flights"):
        raise HoldOutError(f"hold_out is '{hold_out}', expected blocks or flights")
    if hold_out == "flights" and len(given) < 2:
        raise HoldOutError("hold_out is flights with 1 log, expected at least 2 logs, or blocks")
    read = iter(read_logs(log for log in given if not isinstance(log, FlightLog)))
    logs = [log if isinstance(log, FlightLog) else next(read) for log in given]
    different = without_copies(logs)
    if hold_out == "flights" and len(different) < 2:
        raise HoldOutError("hold_out is flights, and all logs hold the same flight, expected different ones, or blocks")
    return load_dataset(different, vehicle, hold_out)


def _kind(effect: type[Effect] | str, model: Model) -> type[Effect]:
    return find_effect(effect, "effect", catalog_with(model.effect_files)) if isinstance(effect, str) else effect
