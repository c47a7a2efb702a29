"""The view: all that the page can show at one moment, by the names under which a panel asks for it."""

from dataclasses import dataclass, fields
from functools import cache
from pathlib import Path
from typing import Any, Literal

from quadctl.lab.comparison.comparison import values_of_other_flights
from quadctl.lab.comparison.reservations import reservations, thrust_reservation
from quadctl.lab.flights.flight import Flight
from quadctl.logs.flight_log import FlightLog
from quadctl.model import Model
from quadctl.vehicle import Vehicle
from quadctl.web.elements.theme import Theme
from quadctl.web.panels.choices import FILE, Choices
from quadctl.web.session.earlier import Earlier, earlier_sessions
from quadctl.web.session.history import History
from quadctl.web.session.session import Session
from quadctl.web.work.jobs import Opened
from quadctl.web.work.state import Gathered, Message, Results, Work

CURRENT = "with added effects"
"""Name of the current model in a legend, where it is not the first one."""


@dataclass(frozen=True, eq=False)
class View:
    """Parts of the workbench and the choices of one tab; its own properties are what several of these give together.

    Every value in it is immutable, and replaced when it changes: so a panel that compares its fields with those of the
    last drawing sees every change.
    """

    choices: Choices
    """Choices of the tab, with the axis that is shown where none was chosen."""
    session: Session
    history: History
    opened: Opened
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
    hidden: Path | None
    """File of the simulated world; None: the world is as the model says."""
    vehicles: tuple[Path, ...]
    """Vehicle files to choose from."""
    own_vehicles: tuple[Path, ...]
    """Vehicle files that were made on this page."""
    folder: Path
    """Folder that the page saves in."""
    other_model: Model | None
    """Model of a file, named after it, to be drawn beside those of the model sequence."""
    theme: Theme

    def value(self, name: str) -> Any:
        """Value of a field of a panel: an attribute of the view, or of the part that has it (see `owner_of`)."""
        part = owner_of(name)
        return getattr(self if part is None else getattr(self, part), name)

    # --- work in progress ---------------------------------------------------------------------------------------------

    @property
    def idle(self) -> bool:
        return self.work is None

    @property
    def searching(self) -> bool:
        return self.search is not None

    @property
    def starting(self) -> bool:
        """No flight is open, and none is being opened."""
        return not self.opened.logs and self.work is None

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
        return self.results.evaluation is None and self.work is not None

    # --- flights ------------------------------------------------------------------------------------------------------

    @property
    def flight(self) -> Flight | None:
        """The chosen flight; the first where none was chosen."""
        flights = self.opened.flights
        chosen = (flight for flight in flights if flight.name == self.choices.flight)
        return next(chosen, flights[0] if flights else None)

    @property
    def log(self) -> FlightLog | None:
        """The log of the chosen flight."""
        return None if self.flight is None else self.opened.log(self.flight.name)

    @property
    def shown_logs(self) -> tuple[FlightLog, ...]:
        """Logs whose channels are shown: the chosen flight's first."""
        log = self.log
        if log is None:
            return ()
        names = [name for name in self.opened.flight_names if name != log.name and self.choices.over_each_other]
        return (log, *(other for other in map(self.opened.log, names) if other is not None))

    @property
    def unconfirmed(self) -> Vehicle | None:
        """The vehicle, where nobody has said that it flew: neither a person nor one of the logs that are used."""
        return self.session.vehicle if self.session.vehicle_assumed and self.opened.silent_logs else None

    @property
    def reservations(self) -> tuple[str, ...]:
        """Sentences on what the results cannot tell, since numbers of the vehicle were assumed."""
        vehicle, seen = self.session.vehicle, self.opened.seen
        return () if vehicle is None or seen is None else tuple(f"{each}." for each in reservations(vehicle, seen))

    @property
    def thrust_reservation(self) -> str:
        """The one of them on mass and thrust; empty where the thrust does not rest on an assumed number."""
        vehicle, seen = self.session.vehicle, self.opened.seen
        said = None if vehicle is None or seen is None else thrust_reservation(vehicle, seen)
        return "" if said is None else f"{said}."

    @property
    def of_other_flights(self) -> tuple[str, ...]:
        """Sentences on values of single flights that the model uses for others, or in another order."""
        model, parts = self.session.model, (self.opened.seen, self.opened.unseen)
        if model is None:
            return ()
        found = (note for part in parts if part is not None for note in values_of_other_flights(model, part.names))
        return tuple(f"{note}." for note in found)

    # --- models and results -------------------------------------------------------------------------------------------

    @property
    def models(self) -> dict[str, Model]:
        """The first model of the sequence and the current one, by their names in a legend; and that beside them."""
        session, beside = self.session, self.choices.beside
        if session.model is None:
            return {}
        first = session.sequence[0]
        changed = session.current > 0 or session.off
        shown = {first.name: first.model} | ({CURRENT: session.model} if changed else {})
        if beside not in self.comparable:
            return shown
        other = self.other_model if beside == FILE else session.sequence[int(beside)].model
        return shown if other is None else shown | {self.comparable[beside]: other}

    @property
    def comparable(self) -> dict[str, str]:
        """Models that can be drawn beside the others: their names in a legend, by the value of `Choices.beside`."""
        steps = {str(i): f"step {i + 1}: {step.name}" for i, step in enumerate(self.session.sequence)}
        return steps | ({} if self.other_model is None else {FILE: f"file {self.other_model.name}"})

    @property
    def floor_m_s2(self) -> float | None:
        """Lowest reference error of all steps of the model sequence, m/s^2; None before the first is known."""
        evaluation = self.results.evaluation
        floors = [self.session.floor_m_s2, None if evaluation is None else evaluation.floor_m_s2]
        return min((floor for floor in floors if floor is not None), default=None)

    @property
    def gathered(self) -> Gathered | None:
        """The evidence that is open; None where none is, or it is not there yet."""
        return self.results.evidence.get(self.choices.evidence)

    @property
    def gathering(self) -> Literal["", "wanted", "waiting", "cancelled"]:
        """State of the evidence that is open and not there yet; empty where there is none such."""
        effect, results = self.choices.evidence, self.results
        models = [self.session.model, *(found.diagnosis.best for found in (results.found, results.before) if found)]
        known = {effect.name for model in models if model is not None for effect in model.effects}
        if effect not in known or self.gathered is not None or self.opened.seen is None:
            return ""
        if not self.idle:
            return "waiting"
        return "cancelled" if effect in results.evidence else "wanted"


OWNERS: dict[str | None, Any] = {
    None: View,
    "choices": Choices,
    "session": Session,
    "history": History,
    "opened": Opened,
    "results": Results,
}
"""The view itself, and its parts whose attributes panels may ask for, too, in this order."""


@cache
def owner_of(name: str) -> str | None:
    """The first of the `OWNERS` that has an attribute of this name; None is the view itself."""
    return next(part for part, kind in OWNERS.items() if name in {*dir(kind), *(field.name for field in fields(kind))})
