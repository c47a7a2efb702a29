"""The view: all that the page can show at one moment, by the names under which a panel asks for it."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from quadctl.lab.comparison.agreement import Agreement
from quadctl.lab.comparison.comparison import Comparison, values_of_other_flights
from quadctl.lab.comparison.reservations import reservations, thrust_reservation
from quadctl.lab.comparison.wording import listed, sentence
from quadctl.lab.evaluation import Evaluation
from quadctl.lab.flights.dataset import Dataset, HoldOut
from quadctl.lab.flights.flight import Flight
from quadctl.lab.planning.suggestion import Suggestion
from quadctl.lab.sensors.answers import SensorAnswers
from quadctl.lab.tracking.step_response import StepResponses
from quadctl.logs.flight_log import FlightLog
from quadctl.model import Model
from quadctl.vehicle import Vehicle
from quadctl.web.elements.theme import Theme
from quadctl.web.session.earlier import Earlier, earlier_sessions
from quadctl.web.session.findings import Diagnosed
from quadctl.web.session.session import Rung, Session
from quadctl.web.work.doubts import cautions_of, firmware, names_its_vehicle
from quadctl.web.work.jobs import Opened
from quadctl.web.work.state import Gathered, Message, Results, Work

CURRENT = "with added effects"
"""Name of the current model in a legend, where it is not the first one."""
FILE = "file"
"""Value of `View.beside` for the model of a file."""
Brush = Mapping[str, tuple[float, float]]
"""Selected ranges, by the names of their variables."""


@dataclass(frozen=True, eq=False)
class View:
    """State of the workbench, and the choices of one tab.

    Every value in it is immutable, and replaced when it changes: so a panel that compares its fields with those of the
    last drawing sees every change.
    """

    session: Session
    opened: Opened | None
    results: Results
    work: Work | None
    search: Work | None
    message: Message | None
    as_read: tuple[FlightLog, ...]
    """Logs that have been read and are being prepared."""
    waiting: tuple[str, ...]
    """Names of files that were dropped, and that wait for the work in progress."""
    windows: int
    """Number of windows and tabs of browsers that show the session."""
    can_undo: bool
    can_redo: bool
    hidden: Path | None
    """File of the simulated world; None: the world is as the model says."""
    vehicles: tuple[Path, ...]
    """Vehicle files to choose from."""
    own_vehicles: tuple[Path, ...]
    """Vehicle files that were made on this page."""
    folder: Path
    """Folder that the page saves in."""
    template: str
    """Text of a vehicle file to begin with."""
    theme: Theme
    axis: str
    brush: Brush
    flight_name: str
    """Name of the flight that was chosen; empty where none was."""
    channels: tuple[str, ...]
    """Columns of the logs that are shown over time."""
    beside: str
    """Model that is drawn beside the others: the number of a step of the ladder, `FILE`, or empty for none."""
    other_model: Model | None
    """Model of a file, named after it, to be drawn beside those of the ladder."""
    evidence: str
    """Name of the effect whose evidence is open; empty where none is."""
    over_each_other: bool
    """Show these channels of all flights, not only of the chosen one."""

    # --- work in progress ---------------------------------------------------------------------------------------------

    @property
    def idle(self) -> bool:
        return self.work is None

    @property
    def starting(self) -> bool:
        """No flight is open, and none is being opened."""
        return self.opened is None and self.work is None

    @property
    def earlier(self) -> tuple[Earlier, ...]:
        """Earlier sessions to go on with; none where one is open."""
        return earlier_sessions(self.folder) if self.starting else ()

    @property
    def reading(self) -> bool:
        """Flights are being read, and there is none to look at yet."""
        return self.flight is None and self.work is not None

    @property
    def comparing(self) -> bool:
        """A comparison is being made, and there is none to look at yet."""
        return self.comparison is None and self.work is not None

    @property
    def work_title(self) -> str | None:
        return None if self.work is None else self.work.title

    @property
    def work_detail(self) -> str:
        return "" if self.work is None else self.work.detail

    @property
    def search_title(self) -> str | None:
        return None if self.search is None else self.search.title

    @property
    def search_detail(self) -> str:
        return "" if self.search is None else self.search.detail

    # --- flights ------------------------------------------------------------------------------------------------------

    @property
    def logs(self) -> tuple[Path, ...]:
        return self.session.logs

    @property
    def unseen(self) -> frozenset[Path]:
        """Logs that no fit may see."""
        return self.session.unseen

    @property
    def hold_out(self) -> HoldOut:
        """Parts of the other flights that cross-validation leaves out."""
        return self.session.hold_out

    @property
    def seen(self) -> Dataset | None:
        """Flights that fits may use."""
        return None if self.opened is None else self.opened.seen

    @property
    def sensors(self) -> SensorAnswers | None:
        """Answers about the sensors of the height; None where no log has a barometer."""
        return None if self.opened is None else self.opened.sensors

    @property
    def unconfirmed(self) -> Vehicle | None:
        """The vehicle, where nobody has said that it flew: neither a person nor one of the logs that are used."""
        return self.vehicle if self.session.vehicle_assumed and self._silent_logs else None

    @property
    def _silent_logs(self) -> list[FlightLog]:
        """Logs that are used and do not say which vehicle flew."""
        logs = [] if self.opened is None else self.opened.logs
        return [log.log for log in logs if log.log is not None and not (log.problem or names_its_vehicle(log.log))]

    @property
    def silent(self) -> str:
        """Sentence on the logs that do not say which vehicle flew, with the autopilot that they name; empty where all
        do."""
        logs = self._silent_logs
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
        for log in [] if self.opened is None else self.opened.logs:
            if log.log is None or log.quality is None or log.flight is None or log.problem or log.doubt:
                continue
            used_s = float(log.flight.time_s[0]), float(log.flight.time_s[-1])
            cautions = cautions_of(log.quality, log.flight.bandwidth_hz, used_s)
            found += [f"{log.path.name}: {said}" for said in cautions]
        return tuple(found)

    @property
    def reservations(self) -> tuple[str, ...]:
        """Sentences on what the results cannot tell, since numbers of the vehicle were assumed."""
        return () if self.vehicle is None or self.seen is None else tuple(reservations(self.vehicle, self.seen))

    @property
    def of_other_flights(self) -> tuple[str, ...]:
        """Sentences on values of single flights that the model uses for others, or in another order."""
        if self.model is None or self.opened is None:
            return ()
        datasets = [dataset for dataset in (self.opened.seen, self.opened.unseen) if dataset is not None]
        found = (note for dataset in datasets for note in values_of_other_flights(self.model, dataset.names))
        return tuple(f"{sentence(note)}." for note in found)

    @property
    def thrust_reservation(self) -> str:
        """The one of them on mass and thrust; empty where the thrust does not rest on an assumed number."""
        return "" if self.vehicle is None or self.seen is None else thrust_reservation(self.vehicle, self.seen)

    @property
    def flights(self) -> tuple[Flight, ...]:
        datasets = () if self.opened is None else (self.opened.seen, self.opened.unseen)
        return tuple(flight for dataset in datasets if dataset is not None for flight in dataset.flights)

    @property
    def flight_names(self) -> tuple[str, ...]:
        return tuple(flight.name for flight in self.flights)

    @property
    def flight(self) -> Flight | None:
        """The chosen flight; the first where none was chosen."""
        flights = self.flights
        return next((flight for flight in flights if flight.name == self.flight_name), flights[0] if flights else None)

    @property
    def log(self) -> FlightLog | None:
        """The log of the chosen flight."""
        flight = self.flight
        return None if flight is None or self.opened is None else self.opened.log(flight.name)

    @property
    def shown_logs(self) -> tuple[FlightLog, ...]:
        """Logs whose channels are shown: the chosen flight's first."""
        opened, log = self.opened, self.log
        if opened is None or log is None:
            return ()
        others = (opened.log(name) for name in self.flight_names if name != log.name and self.over_each_other)
        return (log, *(other for other in others if other is not None))

    # --- models -------------------------------------------------------------------------------------------------------

    @property
    def vehicle(self) -> Vehicle | None:
        return self.session.rungs[0].model.vehicle if self.session.rungs else None

    @property
    def rung(self) -> Rung | None:
        """The current step of the ladder."""
        return self.session.rung

    @property
    def model(self) -> Model | None:
        """The current model, without the effects that are switched off."""
        return self.session.model

    @property
    def off(self) -> frozenset[str]:
        """Names of the effects that are switched off."""
        return self.session.off

    @property
    def look_alikes(self) -> dict[str, tuple[str, ...]]:
        """Families that the data did not distinguish from those in the model."""
        return self.session.look_alikes

    @property
    def models(self) -> dict[str, Model]:
        """The first model of the ladder and the current one, by their names in a legend."""
        session = self.session
        if session.model is None:
            return {}
        first = session.rungs[0]
        changed = session.current > 0 or session.off
        shown = {first.name: first.model} | ({CURRENT: session.model} if changed else {})
        beside = self._model_beside
        return shown if beside is None else shown | {self.comparable[self.beside]: beside}

    @property
    def comparable(self) -> dict[str, str]:
        """Models that can be drawn beside the others: their names in a legend, by the value of `beside`."""
        steps = {str(i): f"step {i + 1}: {rung.name}" for i, rung in enumerate(self.session.rungs)}
        return steps | ({} if self.other_model is None else {FILE: f"file {self.other_model.name}"})

    @property
    def _model_beside(self) -> Model | None:
        if self.beside not in self.comparable:
            return None
        return self.other_model if self.beside == FILE else self.session.rungs[int(self.beside)].model

    @property
    def floor_m_s2(self) -> float | None:
        """Lowest reference error of all steps of the ladder, m/s^2; None before the first is known."""
        floors = [self.session.floor_m_s2, None if self.evaluation is None else self.evaluation.floor_m_s2]
        return min((floor for floor in floors if floor is not None), default=None)

    # --- results for the current model --------------------------------------------------------------------------------

    @property
    def evaluation(self) -> Evaluation | None:
        return self.results.evaluation

    @property
    def comparison(self) -> Comparison | None:
        """The comparison on the flights that fits may use."""
        return None if self.results.evaluation is None else self.results.evaluation.comparison

    @property
    def unseen_comparison(self) -> Comparison | None:
        """The comparison on the flights held out of all fits."""
        return None if self.results.evaluation is None else self.results.evaluation.unseen

    @property
    def agreement(self) -> Agreement | None:
        """Agreement of the flights in the error of the model."""
        return None if self.results.evaluation is None else self.results.evaluation.agreement

    @property
    def found(self) -> Diagnosed | None:
        return self.results.found

    @property
    def before(self) -> Diagnosed | None:
        """Findings for an earlier model of this ladder."""
        return self.results.before

    @property
    def gathered(self) -> Gathered | None:
        """The evidence that is open; None where none is, or it is not there yet."""
        return self.results.evidence.get(self.evidence)

    @property
    def gathering(self) -> Literal["", "wanted", "waiting", "cancelled"]:
        """State of the evidence that is open and not there yet; empty where there is none such."""
        searches = (self.results.found, self.results.before)
        models = [self.model, *(found.diagnosis.best for found in searches if found is not None)]
        known = {effect.name for model in models if model is not None for effect in model.effects}
        if self.evidence not in known or self.gathered is not None or self.seen is None:
            return ""
        if not self.idle:
            return "waiting"
        return "cancelled" if self.evidence in self.results.evidence else "wanted"

    @property
    def suggestion(self) -> Suggestion | None:
        return self.results.suggestion

    @property
    def steps(self) -> StepResponses | None:
        return self.results.steps

    @property
    def checked(self) -> tuple[str, ...] | None:
        """Warnings of the check of the compensator; None before the check."""
        return self.results.checked

    @property
    def refused(self) -> str:
        """Reason why the compensator must not fly."""
        return self.results.refused
