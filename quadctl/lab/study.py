"""Study of a model on flights, for the commands, the page and Python; a verb gives a result and changes nothing."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Self, TypeAlias

from quadctl.effects import Effect, catalog_with, choose_effect, find_effect
from quadctl.errors import SettingsError
from quadctl.lab.comparison.comparison import Comparison, compare
from quadctl.lab.comparison.unseen_flights import Judgement, judge
from quadctl.lab.evaluation import Evaluation, evaluate
from quadctl.lab.evidence import Evidence, evidence_for
from quadctl.lab.fitting.fitted_model import FittedModel, Solution, fit_model
from quadctl.lab.flights.dataset import Dataset, HoldOut, load_dataset
from quadctl.lab.selection.addition import Addition, add
from quadctl.lab.selection.diagnosis import Diagnosis, diagnose_fit
from quadctl.lab.selection.discovery import Discovery, discover
from quadctl.lab.selection.refit import Refit, fit
from quadctl.lab.selection.removal import Removal, held_effect, remove
from quadctl.logs.flight_log import FlightLog
from quadctl.logs.read import read_logs
from quadctl.logs.record.copies import refuse_copies, without_copies
from quadctl.model import Model, load_model
from quadctl.vehicle import Vehicle

Log: TypeAlias = FlightLog | Path | str
Flights: TypeAlias = Dataset | Log | Sequence[Log]
"""One or several flights: logs, paths of logs, or the result of `prepare_flights`."""
AnyModel: TypeAlias = Model | Path | str
"""Model, or the path of a model or vehicle file."""
Progress: TypeAlias = Callable[[str], None]
"""Callback that is told in a few words which step begins."""


def quiet(text: str) -> None:
    """Take no notice of progress."""


@dataclass(frozen=True, eq=False)
class Study:
    """A model, the flights that fits may use, and those held out of all fits.

    Examples
    --------
    >>> from quadctl.lab import Study
    >>> study = Study.of("raptor.yaml", "flight.csv", unseen="other_flight.csv")
    >>> added = study.add("ground_effect.exponential")
    >>> study.after(added).evaluate().error_m_s2 < 0.5 * study.evaluate().error_m_s2
    True
    >>> study.judge(added.model).drop > 0.5
    True
    """

    model: Model
    seen: Dataset
    """Flights that fits may use."""
    unseen: Dataset | None = None
    """Flights held out of all fits."""
    solution: Solution | None = None
    """Fit of the model to the flights that fits may use, where it is known."""

    @classmethod
    def of(cls, model: AnyModel, flights: Flights, hold_out: HoldOut = "blocks", unseen: Flights | None = None) -> Self:
        """Read a model and prepare its flights; those that are `unseen` must be others (see `prepare_flights`).

        Raises
        ------
        LogError
            Also where a flight that no fit may see is one of those that fits use.
        """
        opened = open_model(model)
        if unseen is None:
            return cls(opened, prepare_flights(flights, opened.vehicle, hold_out))
        if not isinstance(flights, Dataset) and not isinstance(unseen, Dataset):
            flights, unseen = _read(flights), _read(unseen)
            refuse_copies(unseen, flights)
        seen = prepare_flights(flights, opened.vehicle, hold_out)
        return cls(opened, seen, prepare_flights(unseen, opened.vehicle))

    def after(self, refit: Refit) -> Self:
        """The same flights with the model of a refit, and its fit."""
        return replace(self, model=refit.model, solution=refit.fit_after.solution)

    def fit(self) -> FittedModel:
        """The model with its parameters fitted to the flights that fits may use."""
        return fit_model(self.model, self.seen) if self.solution is None else self.solution.on(self.seen)

    def compare(self) -> Comparison:
        """The error of the model as it stands, the reference error, and where it fails."""
        return compare(self.model, self.seen)

    def evaluate(self, progress: Progress = quiet) -> Evaluation:
        """The held-out error of the model, by flight, and what remains of it."""
        progress("comparing")
        return evaluate(self.model, self.fit(), self.unseen)

    def diagnose(
        self,
        candidates: Iterable[type[Effect] | str] | None = None,
        progress: Progress = quiet,
        nested: bool = False,
    ) -> Diagnosis:
        """The effects that the model is missing (see `interface.diagnose`)."""
        return diagnose_fit(self.fit(), self._kinds(candidates), progress, nested)

    def discover(
        self,
        candidates: Iterable[type[Effect] | str] | None = None,
        progress: Progress = quiet,
        nested: bool = False,
    ) -> Discovery:
        """The model with all effects that are missing added, one family at a time."""
        return discover(self.model, self.seen, self._kinds(candidates), progress, nested)

    def evidence(self, effect: str, progress: Progress = quiet) -> Evidence:
        """The fit of the model beside that without one of its effects."""
        progress(f"fitting without {effect}")
        return evidence_for(effect, self.fit())

    def add(self, effect: type[Effect] | str, progress: Progress = quiet) -> Addition:
        """The model with `effect`, a class, a name, or FILE.py of one's own, refitted."""
        kind, files = effect, self.model.effect_files
        if isinstance(kind, str):
            kind, files = choose_effect(kind, "effect", files)
        progress(f"fitting {kind.name}")
        return add(kind, replace(self.model, effect_files=files), self.seen, self.fit())

    def refit(self, progress: Progress = quiet) -> Refit:
        """The model with all parameters fitted together, beside the model as it stands."""
        progress("fitting all parameters together")
        return fit(self.model, self.seen)

    def remove(self, effect: str, progress: Progress = quiet) -> Removal:
        """The model without `effect` (name, family or variant), the others refitted."""
        progress(f"fitting without {held_effect(effect, self.model).name}")
        return remove(effect, self.model, self.seen, self.fit())

    def judge(self, after: Model) -> Judgement | None:
        """The error of the model and of another one on the flights held out of all fits; None where there are none."""
        return None if self.unseen is None else judge(self.model, after, self.unseen)

    def _kinds(self, candidates: Iterable[type[Effect] | str] | None) -> list[type[Effect]] | None:
        if candidates is None:
            return None
        known = catalog_with(self.model.effect_files)
        return [find_effect(each, "effect", known) if isinstance(each, str) else each for each in candidates]


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
    given = _several(flights)
    if not given:
        raise SettingsError("no flight is given, expected at least one log")
    if hold_out not in ("blocks", "flights"):
        raise HoldOutError(f"hold_out is '{hold_out}', expected blocks or flights")
    if hold_out == "flights" and len(given) < 2:
        raise HoldOutError("hold_out is flights with 1 log, expected at least 2 logs, or blocks")
    different = without_copies(_read(given))
    if hold_out == "flights" and len(different) < 2:
        raise HoldOutError("hold_out is flights, and all logs hold the same flight, expected different ones, or blocks")
    return load_dataset(different, vehicle, hold_out)


def _several(flights: Log | Sequence[Log]) -> list[Log]:
    return [flights] if isinstance(flights, FlightLog | Path | str) else list(flights)


def _read(flights: Log | Sequence[Log]) -> list[FlightLog]:
    """The logs, those that are given as paths read."""
    given = _several(flights)
    read = iter(read_logs(log for log in given if not isinstance(log, FlightLog)))
    return [log if isinstance(log, FlightLog) else next(read) for log in given]
