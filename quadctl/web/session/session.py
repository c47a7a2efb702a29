"""The session: flights, the sequence of models with the results for each, and the current step.

A session is a value: every action gives a new one. It can be written to a file and read again.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import yaml
from pydantic import Field

from quadctl.errors import SettingsError
from quadctl.lab.flights.dataset import HoldOut
from quadctl.lab.rotation.rollout_errors import Unseen
from quadctl.model import Model, model_from_dict, model_to_dict
from quadctl.settings import MAX_YAML_BYTES, Settings, read_yaml, validate
from quadctl.vehicle import Vehicle
from quadctl.web.session.findings import Findings

SUFFIX = ".lab.yaml"
AUTOSAVED = f"session{SUFFIX}"
"""File that holds every step of the page, in its folder."""


@dataclass(frozen=True)
class Step:
    """One step of the model sequence."""

    name: str
    """Name of the action: `rigid body`, `+ ground_effect.exponential`, `refitted`."""
    model: Model
    error_m_s2: float | None = None
    """Acceleration error (RMSE) of all axes on held-out data; None until it is known."""
    floor_m_s2: float | None = None
    """Reference error, estimated with this model."""
    found: Findings | None = None
    """Findings of the search for what this model is missing; None before its end."""


@dataclass(frozen=True)
class Session:
    """Flights, those of them that are held out, and the models in the order in which they were made."""

    logs: tuple[Path, ...] = ()
    unseen: frozenset[Path] = frozenset()
    """Logs that no fit may see."""
    hold_out: HoldOut = "blocks"
    """Parts of the other logs that cross-validation leaves out, one fold at a time."""
    sequence: tuple[Step, ...] = ()
    """Steps of the model sequence, beginning with the first model; empty until a vehicle is chosen."""
    current: int = 0
    off: frozenset[str] = field(default_factory=frozenset)
    """Effects of the current model that are switched off, by name."""
    hashes: Mapping[Path, str] = field(default_factory=dict)
    """SHA-256 of the logs as they were when the session was saved; those that are not known are left out."""
    view: str = ""
    """Choices of the tab in which the session was saved, as the query of its address."""
    vehicle_assumed: bool = False
    """True where nobody has said which vehicle flew: it was taken from the flight configuration."""
    rollouts: Unseen | None = None
    """Errors of forecasts of the whole state, of these flights with this vehicle; None until they are asked for."""

    @property
    def step(self) -> Step | None:
        return self.sequence[self.current] if self.sequence else None

    @property
    def vehicle(self) -> Vehicle | None:
        return self.sequence[0].model.vehicle if self.sequence else None

    @property
    def model(self) -> Model | None:
        """The current model without what is switched off."""
        if self.step is None:
            return None
        model = self.step.model
        return replace(model, stack=tuple(item for item in model.stack if item.effect.name not in self.off))

    @property
    def confounded(self) -> dict[str, tuple[str, ...]]:
        """Families that the data did not distinguish from those in the model, by the families of the model, as the
        searches of the steps up to the current one have found."""
        alike: dict[str, tuple[str, ...]] = {}
        held = [] if self.step is None else [effect.family() for effect in self.step.model.effects]
        for step in self.sequence[: self.current + 1]:
            pairs = [] if step.found is None else step.found.confounded
            for one, other in [*pairs, *((b, a) for a, b in pairs)]:
                if one in held and other not in alike.get(one, ()):
                    alike[one] = (*alike.get(one, ()), other)
        return alike

    @property
    def floor_m_s2(self) -> float | None:
        """Lowest reference error of all steps, m/s²: each estimate is an upper bound."""
        return min((step.floor_m_s2 for step in self.sequence if step.floor_m_s2 is not None), default=None)

    def begun_with(self, model: Model) -> "Session":
        """A new model sequence that begins with `model`, whose vehicle somebody has chosen."""
        name = "as it was" if model.stack else "rigid body"
        begun = replace(self, sequence=(Step(name, model),), current=0, off=frozenset(), vehicle_assumed=False)
        return begun if model.vehicle == self.vehicle else replace(begun, rollouts=None)

    def extended(self, step: Step) -> "Session":
        """Session with one more step after the current one; later steps are dropped."""
        sequence = (*self.sequence[: self.current + 1], step)
        return replace(self, sequence=sequence, current=len(sequence) - 1, off=frozenset())

    def at(self, step: int) -> "Session":
        """Session with another current step.

        Raises
        ------
        SettingsError
            There is no such step.
        """
        if not 0 <= step < len(self.sequence):
            raise SettingsError(f"step {step} of the sequence is asked for, expected 0 to {len(self.sequence) - 1}")
        return replace(self, current=step, off=frozenset())

    def switched(self, effect: str) -> "Session":
        """Session with the effect of that name switched off, or on again."""
        return replace(self, off=self.off ^ {effect})

    def judged(self, error_m_s2: float, floor_m_s2: float | None = None) -> "Session":
        """Session with the error and the reference error of the current step, m/s²."""
        return self.with_errors({self.current: (error_m_s2, floor_m_s2)})

    def with_errors(self, errors: Mapping[int, tuple[float, float | None]]) -> "Session":
        """Session with the error and the reference error, m/s², of some of its steps, by their numbers."""
        sequence = list(self.sequence)
        for number, (error, floor) in errors.items():
            sequence[number] = replace(sequence[number], error_m_s2=error, floor_m_s2=floor)
        return replace(self, sequence=tuple(sequence))

    def searched(self, model: Model, found: Findings) -> "Session":
        """Session with the findings of a search on `model`."""
        return replace(
            self, sequence=tuple(replace(step, found=found) if step.model == model else step for step in self.sequence)
        )

    def forecast(self, vehicle: Vehicle, rollouts: Unseen) -> "Session":
        """Session with the errors of forecasts with a vehicle, if it is the one of this session."""
        return replace(self, rollouts=rollouts) if vehicle == self.vehicle else self

    def unjudged(self) -> "Session":
        """Session without errors, reference errors, findings and rollouts, for when the flights change."""
        return replace(self, sequence=tuple(Step(step.name, step.model) for step in self.sequence), rollouts=None)

    def with_logs(self, logs: Sequence[Path]) -> "Session":
        """Session with further logs, each once. Results stay valid if none of the new logs can be used."""
        return replace(self, logs=tuple(dict.fromkeys([*self.logs, *logs])))

    def without_log(self, log: Path) -> "Session":
        """Session without a log. Results stay valid if the log could not be used; of one flight no whole flight can be
        held out by turns."""
        logs = tuple(other for other in self.logs if other != log)
        hashes = {other: text for other, text in self.hashes.items() if other != log}
        hold_out = self.hold_out if len(logs) > 1 else "blocks"
        return replace(self, logs=logs, unseen=self.unseen - {log}, hashes=hashes, hold_out=hold_out)

    def with_flights_of(self, other: "Session") -> "Session":
        """Session with the flights of another one. Results stay valid if the flights that can be used are the same."""
        return replace(self, logs=other.logs, unseen=other.unseen, hold_out=other.hold_out, hashes=other.hashes)

    def moved(self, places: Mapping[Path, Path]) -> "Session":
        """Session whose logs lie in other places: `places` are the new paths by the old ones."""
        return replace(
            self,
            logs=tuple(places.get(log, log) for log in self.logs),
            unseen=frozenset(places.get(log, log) for log in self.unseen),
            hashes={places.get(log, log): text for log, text in self.hashes.items()},
        )

    def with_role(self, log: Path, unseen: bool) -> "Session":
        """Session in which `log` is held out of all fits, or used by them.

        Raises
        ------
        SettingsError
            No log would be left to fit.
        """
        chosen = self.unseen | {log} if unseen else self.unseen - {log}
        if self.logs and len(chosen) == len(self.logs):
            raise SettingsError("every flight would be held out, expected at least one to fit the model to")
        return replace(self, unseen=frozenset(chosen)).unjudged()


class StepEntry(Settings):
    """One step of the model sequence in a session file."""

    name: str
    error_m_s2: float | None = None
    floor_m_s2: float | None = None
    model: dict[str, Any]
    found: str | None = None
    """JSON text: so many numbers would take seconds to read as YAML."""


class SessionFile(Settings):
    """Content of a session file, before the models in it are loaded."""

    logs: list[str] = Field(default_factory=list)
    sha256: dict[str, str] = Field(default_factory=dict)
    """By the paths of the logs."""
    unseen: list[str] = Field(default_factory=list)
    view: str = ""
    vehicle_assumed: bool = False
    hold_out: HoldOut = "blocks"
    current: int = Field(default=0, ge=0)
    switched_off: list[str] = Field(default_factory=list)
    rungs: list[StepEntry] = Field(default_factory=list)
    """The model sequence."""
    rollouts: str | None = None
    """JSON text, as of `StepEntry.found`."""


def session_to_yaml(session: Session) -> str:
    """The session as the text of a file; logs by their full path, vehicles written out.

    Of a very long sequence only the current step keeps its findings: the size of a settings file is limited.
    """
    text = _to_yaml(session)
    if len(text.encode()) < MAX_YAML_BYTES:
        return text
    kept = (replace(step, found=step.found if step is session.step else None) for step in session.sequence)
    return _to_yaml(replace(session, sequence=tuple(kept)))


def _to_yaml(session: Session) -> str:
    content = {
        "logs": [str(log.resolve()) for log in session.logs],
        "sha256": {str(log.resolve()): text for log, text in session.hashes.items() if log in session.logs},
        "view": session.view,
        "vehicle_assumed": session.vehicle_assumed,
        "unseen": sorted(str(log.resolve()) for log in session.unseen),
        "hold_out": session.hold_out,
        "current": session.current,
        "switched_off": sorted(session.off),
        "rungs": [
            {
                "name": step.name,
                "error_m_s2": step.error_m_s2,
                "floor_m_s2": step.floor_m_s2,
                "model": model_to_dict(step.model, None),
                **({} if step.found is None else {"found": step.found.to_json()}),
            }
            for step in session.sequence
        ],
        **({} if session.rollouts is None else {"rollouts": session.rollouts.to_json()}),
    }
    return yaml.safe_dump(content, sort_keys=False, allow_unicode=True)


def load_session(path: Path) -> Session:
    """Read a session file.

    Raises
    ------
    SettingsError
        It cannot be read, or is no session; the sentence names what was expected.
    """
    entry = validate(read_yaml(path), SessionFile, str(path))
    logs = tuple(path.parent / log for log in entry.logs)
    unseen = frozenset(path.parent / log for log in entry.unseen)
    if not unseen <= set(logs):
        raise SettingsError(f"{path}: unseen holds {', '.join(entry.unseen)}, expected some of the logs")
    if entry.rungs and entry.current >= len(entry.rungs):
        raise SettingsError(f"{path}: current is {entry.current}, expected a step from 0 to {len(entry.rungs) - 1}")
    sequence = tuple(_step(step, path) for step in entry.rungs)
    hashes = {path.parent / log: text for log, text in entry.sha256.items()}
    session = Session(logs, unseen, entry.hold_out, sequence, entry.current, hashes=hashes, view=entry.view)
    held = {item.effect.name for item in session.step.model.stack} if session.step else set()
    if not set(entry.switched_off) <= held:
        off = ", ".join(entry.switched_off)
        raise SettingsError(f"{path}: switched_off holds {off}, expected effects of the step where one stands")
    try:
        rollouts = None if entry.rollouts is None else Unseen.from_json(entry.rollouts)
    except SettingsError as error:
        raise SettingsError(f"{path}: rollouts {error}") from None
    known = replace(session, vehicle_assumed=entry.vehicle_assumed, rollouts=rollouts)
    return replace(known, off=frozenset(entry.switched_off))


def _step(entry: StepEntry, path: Path) -> Step:
    model = _model(entry.model, path)
    try:
        found = None if entry.found is None else Findings.from_json(entry.found, model)
    except SettingsError as error:
        raise SettingsError(f"{path}: found: {error}") from None
    return Step(entry.name, model, entry.error_m_s2, entry.floor_m_s2, found)


def _model(entry: dict[str, Any], path: Path) -> Model:
    model = model_from_dict(entry, path)
    return replace(model, name=model.vehicle.name)
