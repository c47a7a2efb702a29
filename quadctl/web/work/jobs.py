"""The long work of the page: functions that a `Worker` runs. Each takes `progress`, and what it takes and gives can be
sent from process to process."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from quadctl.errors import QuadctlError
from quadctl.lab.comparison.comparison import compare
from quadctl.lab.comparison.wording import listed, where
from quadctl.lab.effect_curves import sketch
from quadctl.lab.evaluation import Evaluation, evaluate
from quadctl.lab.fitting.fitted_model import is_fitted_to
from quadctl.lab.flights.dataset import Dataset, HoldOut, joined
from quadctl.lab.flights.flight import Flight
from quadctl.lab.flights.preparation import prepare
from quadctl.lab.planning.suggestion import Suggestion, suggest
from quadctl.lab.report.results import Results, Shown
from quadctl.lab.rotation.rollout_errors import Unseen
from quadctl.lab.selection.diagnosis import Diagnosis
from quadctl.lab.selection.refit import Refit
from quadctl.lab.sensors.answers import SensorAnswers, answers_on_sensors
from quadctl.lab.study import Study
from quadctl.lab.tracking.step_response import StepResponses
from quadctl.logs.flight_log import FlightLog
from quadctl.logs.quality import quality
from quadctl.logs.read import read_imu_log
from quadctl.logs.record.copies import copies
from quadctl.model import Model
from quadctl.vehicle import Vehicle
from quadctl.web.session.findings import Findings
from quadctl.web.session.session import Step
from quadctl.web.work.doubts import cautions_of, doubt_beside, doubt_of, firmware, names_its_vehicle
from quadctl.web.work.reading import OpenedLog, without_folder
from quadctl.web.work.worker import Progress


@dataclass(frozen=True, eq=False)
class Opened:
    """The flights of a session, prepared; no log where none is open."""

    logs: list[OpenedLog] = field(default_factory=list)
    seen: Dataset | None = None
    """Flights that fits may use; None where none can be analysed."""
    unseen: Dataset | None = None
    """Flights held out of all fits."""
    sensors: SensorAnswers | None = None
    """Answers about the sensors of the height; None where no log has a barometer."""

    @property
    def usable(self) -> list[Path]:
        """Paths of the logs that can be analysed."""
        return [opened.path for opened in self.logs if not (opened.problem or opened.doubt)]

    @property
    def flights(self) -> tuple[Flight, ...]:
        """Those that fits may use, and those held out."""
        return tuple(flight for part in (self.seen, self.unseen) if part is not None for flight in part.flights)

    @property
    def flight_names(self) -> tuple[str, ...]:
        return tuple(flight.name for flight in self.flights)

    @property
    def silent_logs(self) -> list[FlightLog]:
        """Logs that are used and do not say which vehicle flew."""
        return [one.log for one in self.logs if one.log is not None and not (one.problem or names_its_vehicle(one.log))]

    @property
    def silent(self) -> str:
        """Sentence on the logs that do not say which vehicle flew, with the autopilot that they name; empty where all
        do."""
        logs = self.silent_logs
        names = [f"{log.name} ({software})" if (software := firmware(log)) else log.name for log in logs]
        return f"{listed(names)} {'does' if len(names) == 1 else 'do'} not say." if names else ""

    @property
    def weight_doubts(self) -> tuple[str, ...]:
        """Doubts whether the vehicle is the one that flew, of the flights that are used."""
        return tuple(f"{flight.name}: {doubt}" for flight in self.flights if (doubt := flight.weight_doubt))

    @property
    def cautions(self) -> tuple[str, ...]:
        """Sentences on what the data of the flights lack, each with the name of its log."""
        found = []
        for log in self.logs:
            if log.log is None or log.quality is None or log.flight is None or log.problem or log.doubt:
                continue
            used_s = float(log.flight.time_s[0]), float(log.flight.time_s[-1])
            cautions = cautions_of(log.quality, log.flight.bandwidth_hz, used_s)
            found += [f"{log.path.name}: {said}" for said in cautions]
        return tuple(found)

    def log(self, name: str) -> FlightLog | None:
        return next((opened.log for opened in self.logs if opened.log is not None and opened.log.name == name), None)


@dataclass(frozen=True, eq=False)
class NextStep:
    """The model of a new step of the model sequence, and its errors."""

    model: Model
    evaluation: Evaluation
    is_repetition: bool = False
    """True where a refit has found what the model held already."""


def open_logs(
    read: Sequence[OpenedLog],
    unseen: frozenset[Path],
    vehicle: Vehicle,
    hold_out: HoldOut,
    accepted: frozenset[Path],
    progress: Progress,
) -> Opened:
    """Prepare logs that were read; one that cannot be used does not spoil the others.

    Those that are prepared for the vehicle already stay as they are. One that seems to be of another vehicle is not
    used unless it is among the `accepted`.
    """
    prepared = [_prepared(one, vehicle, progress) for one in read]
    opened = _doubted(_without_twins(prepared), vehicle, accepted)
    fitted, kept = (
        [o.flight for o in opened if o.flight and not o.doubt and (o.path in unseen) == held_out]
        for held_out in (False, True)
    )
    return Opened(opened, _dataset(fitted, hold_out), _dataset(kept), _on_sensors(opened, progress))


def _on_sensors(opened: Sequence[OpenedLog], progress: Progress) -> SensorAnswers | None:
    """Answers about the height sensors of the logs that can be analysed; of all that could be read where none can."""
    read = [one for one in opened if one.log is not None]
    used = [one for one in read if not (one.problem or one.doubt)]
    logs = [one.log for one in (used or read) if one.log is not None]
    if any(log.has("baro_m") for log in logs):
        progress("comparing the barometer with its reference")
    return answers_on_sensors(logs)


def _without_twins(opened: Sequence[OpenedLog]) -> list[OpenedLog]:
    """The logs; one that holds the same flight as an earlier one is not used, and says so."""
    read = [one for one in opened if one.log is not None]
    first_of = {later: first for first, later in reversed(copies([one.log for one in read if one.log is not None]))}
    twins = {read[later].path: read[first].path.name for later, first in first_of.items()}
    return [
        replace(one, flight=None, problem=f"{one.path.name}: holds the same flight as {twins[one.path]}")
        if one.path in twins
        else one
        for one in opened
    ]


def _doubted(opened: Sequence[OpenedLog], vehicle: Vehicle, accepted: frozenset[Path]) -> list[OpenedLog]:
    """The logs, each with its doubt: about the vehicle, or beside the first flight that is used."""
    first: OpenedLog | None = None
    asked = []
    for one in opened:
        doubt = None
        if one.log is not None and not one.problem and one.path not in accepted:
            doubt = doubt_of(one.log, vehicle)
            if doubt is None and first is not None and first.log is not None:
                doubt = doubt_beside(one.log, _thrust_source(one), first.log, _thrust_source(first))
        if first is None and one.log is not None and not (one.problem or doubt):
            first = one
        asked.append(one if one.doubt == doubt else replace(one, doubt=doubt))
    return asked


def _thrust_source(opened: OpenedLog) -> str | None:
    return None if opened.quality is None else opened.quality.thrust_source


def _prepared(opened: OpenedLog, vehicle: Vehicle, progress: Progress) -> OpenedLog:
    """The log with its flight, or with the problem that keeps it from being analysed."""
    log = opened.log
    if log is None or (opened.flight is not None and opened.vehicle == vehicle):
        return opened
    progress(f"preparing {log.name}")
    known = replace(opened, quality=opened.quality or quality(log), vehicle=vehicle)
    try:
        return replace(known, flight=prepare(log, vehicle), problem="")
    except QuadctlError as error:
        return replace(known, flight=None, problem=str(error))


def _dataset(flights: Sequence[Flight], hold_out: HoldOut = "blocks") -> Dataset | None:
    if not flights:
        return None
    return joined(flights, hold_out if len(flights) > 1 else "blocks")


def look_for(study: Study, progress: Progress) -> Findings:
    """Search for what a model is missing, and sketch each candidate on the samples that the search has seen."""
    found = study.diagnose(progress=progress)
    searched = found.searched_part
    drawn = {candidate.effect.name: sketch(candidate.model, searched) for candidate in found.ranking}
    return Findings.of(found, {name: drawing for name, drawing in drawn.items() if drawing is not None})


def next_step(change: Callable[..., Refit], study: Study, *effects: str, progress: Progress) -> NextStep:
    """The step after a change of a study's model: `change` is a verb of `Study` that refits."""
    refit = change(study, *effects, progress=progress)
    return NextStep(refit.model, evaluate(refit.model, refit.fit_after, study.unseen), refit.is_repetition)


def forecast(opened: Opened, unseen: frozenset[Path], vehicle: Vehicle, progress: Progress) -> Unseen:
    """Errors of forecasts of the whole state in the flights that can be used, by fits that have not seen them."""
    from quadctl.lab.rotation.unseen import forecast_unseen  # brings what the start of the page should not wait for

    def read(held_out: bool) -> list[FlightLog]:
        """Those logs with what only an analysis of rotation needs, under the names that they have on the page."""
        logs = []
        for one in opened.logs:
            if one.path in opened.usable and (one.path in unseen) == held_out and one.log is not None:
                progress(f"reading {one.log.name}")
                logs.append(replace(read_imu_log(one.path), name=one.log.name))
        return logs

    try:
        return forecast_unseen(read(held_out=False), Model(vehicle), read(held_out=True), progress)
    except QuadctlError as error:
        sentence = str(error)
        for path in opened.usable:
            sentence = without_folder(sentence, path)
        raise QuadctlError(sentence) from None


def next_flight(diagnosis: Diagnosis, missions: Path, progress: Progress) -> Suggestion:
    progress("predicting the data of each mission")
    return suggest(diagnosis, missions)


def report(
    sequence: Sequence[Step], opened: Opened, steps: StepResponses | None, shown: Shown, progress: Progress
) -> bytes:
    """The report of the `sequence`, from its first step to its last: one file of HTML, with the numbers and the
    words that the page has `shown`; its errors are those of the first and of the last step."""
    from quadctl.lab.report.page import render_report  # its figures need a library that nothing else here does

    first, last = sequence[0], sequence[-1]
    seen, unseen = opened.seen, opened.unseen
    if seen is None:
        raise QuadctlError("there is no flight to report on, expected at least one log")
    progress("comparing")
    comparison = compare(first.model, seen)
    diagnosis = None if first.found is None else first.found.diagnosed(first.model, seen).diagnosis
    addition, after = None, None
    if len(last.model.stack) > len(first.model.stack):
        progress(f"judging {last.model.effects[-1].name}")
        addition = Study(replace(last.model, stack=last.model.stack[:-1]), seen).add(type(last.model.effects[-1]))
        after = None if unseen is None else compare(last.model, unseen)
    progress("drawing")
    if first.error_m_s2 is not None and last.error_m_s2 is not None:
        stands = not is_fitted_to(last.model, seen.names)
        shown_where = where(seen, () if unseen is None else unseen.names, stands)
        errors = first.error_m_s2, last.error_m_s2 if len(sequence) > 1 else None
        shown = shown._replace(errors_m_s2=errors, where=str(shown_where), on_unseen=unseen is not None)
    results = Results(comparison, diagnosis=diagnosis, addition=addition, after=after, steps=steps, shown=shown)
    return render_report(results).encode()
