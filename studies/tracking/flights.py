"""Flights in lockstep with four controllers on three mocks, and what their logs say of the tracking."""

import math
import random
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple, cast

import numpy as np

from quadctl.effects import Effect
from quadctl.effects.body_drag import QuadraticDrag
from quadctl.effects.payload import MassStep
from quadctl.effects.rotor_drag import LinearDrag
from quadctl.errors import FlightError
from quadctl.flight.pilot.pilot import Pilot
from quadctl.flight.pilot.tick import Stage, Tick
from quadctl.flight.preflight.plan import FlightPlan
from quadctl.flight.preflight.preparation import prepare_flight
from quadctl.lab.flights.dataset import load_dataset
from quadctl.lab.selection.addition import add
from quadctl.lab.selection.refit import fit
from quadctl.lab.tracking.attitude_response import attitude_response, with_response
from quadctl.logs.flight_log import FlightLog, Floats
from quadctl.logs.read import read_log
from quadctl.model import EffectEntry, Model
from quadctl.sitl.rules.copter import SimulatedCopter
from quadctl.sitl.rules.px4 import SimulatedAutopilot
from quadctl.sitl.run import fly_lockstep
from quadctl.sitl.vehicle.hidden import HiddenTruth, load_hidden
from quadctl.state import AttitudeTarget, Setpoint, Vec3, VehicleState
from studies.autopilots.flights import recorded_law
from studies.autopilots.measured import mock
from studies.page import ROOT

SEEDS = (1,)
FIT_SEED = 11
FIT_MISSION = "excitation_east"
ADDED_DELAY_S = 0.08
LOSS = 0.2
ADDED_MASS, LOADED_S = 0.15, {"px4": 0.0, "ardupilot": 19.0}
"""Share of the mass that is loaded, and when: the take-off of ArduPilot's mock, which integrates nothing, would not
lift it, so it comes in the air before the figure 8."""
REACHED_M = 0.1


class Mock(NamedTuple):
    """Simulated autopilot with one of the truths that were measured."""

    title: str
    name: str
    truth: str

    def hidden(self) -> HiddenTruth:
        return load_hidden(ROOT / "sitl" / self.name / self.truth)


ARDUPILOT = Mock("ArduPilot", "ardupilot", "like_sitl.yaml")
PX4_GOOD = Mock("PX4, good IMU", "px4", "like_sih_good_imu.yaml")
PX4_STOCK = Mock("PX4, IMU of the stock SIH", "px4", "like_sih.yaml")
MOCKS = (ARDUPILOT, PX4_GOOD, PX4_STOCK)

BEFORE, FOUND, UNKNOWN, OWN = "before", "found", "unknown", "own"
"""The thesis' law, which was the product before; the present one with the lag and drag that the lab found; the same
without that knowledge; and the autopilot's own control."""
LAWS = (BEFORE, UNKNOWN, FOUND, OWN)


class Course(NamedTuple):
    """Mission, its overrides, and how its measured phases begin."""

    mission: str
    overrides: tuple[str, ...]
    phases: tuple[str, ...]
    lifted_m: float = 1.0


COURSES = {
    "figure 8": Course("figure8", (), ("figure8",), 1.7),
    "1.6-fold speed": Course("figure8", ("lap_s=5",), ("figure8",), 1.7),
    "swoop": Course("swoop", (), ("swoop",)),
    "runs": Course("forward_runs", (), ("forward_", "back_", "right_", "left_")),
    "excitation": Course("excitation", (), ("multisine",)),
}
STEP = Course("sidestep", ("step_m=1",), ("east",))


class Link(NamedTuple):
    """Defects of the link between companion and autopilot."""

    delay_s: float = 0.0
    """Delay of states and of setpoints, a multiple of a tick."""
    loss: float = 0.0
    """Share of states, and of setpoints, that is lost."""


PERFECT = Link()


class Linked:
    """Mock behind a link: what `fly_lockstep` does with an autopilot, with delays and losses on the way.

    With `own` control the attitude targets of a flight are dropped, and `send` takes its setpoints; the companion's
    own states matter to nothing then, so that they keep their time.
    """

    def __init__(self, autopilot: SimulatedAutopilot, link: Link, pilot: Pilot, own: bool, seed: int) -> None:
        self._autopilot, self._link, self._pilot, self._own = autopilot, link, pilot, own
        self._random = random.Random(seed)
        self._states: deque[VehicleState] = deque()
        self._last: VehicleState | None = None
        self._under_way: deque[tuple[float, AttitudeTarget | Setpoint]] = deque()

    def __getattr__(self, name: str) -> Any:
        return getattr(self._autopilot, name)

    def estimate(self) -> VehicleState:
        now = self._autopilot.estimate()
        if self._own:
            return now
        self._states.append(now)
        while len(self._states) > 1 and self._states[1].time_s <= now.time_s - self._link.delay_s + 1e-9:
            self._states.popleft()
        if self._last is None or not self._is_lost():
            self._last = self._states[0]
        return replace(self._last, time_s=now.time_s, setpoint_delay_s=self._link.delay_s)

    def set_attitude_target(self, target: AttitudeTarget) -> None:
        if not (self._own and self._pilot.stage is Stage.FLY):
            self.send(target)

    def send(self, target: AttitudeTarget | Setpoint) -> None:
        if not self._is_lost():
            self._under_way.append((self._autopilot.time_s + self._link.delay_s, target))

    def step(self, until_s: float) -> None:
        while self._under_way and self._under_way[0][0] <= self._autopilot.time_s + 1e-9:
            target = self._under_way.popleft()[1]
            if isinstance(target, Setpoint):
                self._autopilot.set_position_target(target)
            else:
                self._autopilot.set_attitude_target(target)
        self._autopilot.step(until_s)

    def _is_lost(self) -> bool:
        flies = self._pilot.stage is Stage.FLY
        return flies and self._link.loss > 0.0 and self._random.random() < self._link.loss


class Track(NamedTuple):
    """Path of one flight over the measured phases, NED."""

    time_s: Floats
    """Time of the reference, from the begin of the first measured phase."""
    error_m: Floats
    """Estimate less reference, shape (n, 3)."""
    ended: str

    @property
    def rmse_m(self) -> float:
        """3D error, RMS."""
        return rmse(self.error_m)


def rmse(error_m: Floats) -> float:
    """Root mean square of the lengths of errors, shape (n, 3)."""
    return float(np.sqrt(np.mean(np.sum(error_m**2, axis=1))))


class StepFlown(NamedTuple):
    """Step of 1 m to the east."""

    overshoot_m: float
    settled_s: float
    """Time after which the error along the step stays below REACHED_M; inf: it does not, within the phase."""


def step_flown(track: Track) -> StepFlown:
    """Overshoot and time of a step to the east."""
    east = track.error_m[:, 1]
    outside = np.flatnonzero(np.abs(east) > REACHED_M)
    late = len(outside) > 0 and outside[-1] == len(east) - 1
    settled_s = math.inf if late else float(track.time_s[outside[-1] + 1]) if len(outside) else 0.0
    return StepFlown(max(0.0, float(np.max(east))), settled_s)


def fly(
    course: Course,
    where: Mock,
    law: str,
    model: Model,
    seed: int,
    link: Link = PERFECT,
    extra: Sequence[Effect] = (),
    log_dir: Path | None = None,
) -> Track:
    """Fly a course by one of the LAWS; `model` is what that law is to know of vehicle and effects.

    `extra` effects act in the world beside those of the mock. The log is written where a folder is given.
    """
    truth = where.hidden()
    entries = [EffectEntry(effect=effect.name, parameters=effect.values()) for effect in extra]
    hidden = truth.model_copy(update={"effects": [*truth.effects, *entries]})
    autopilot = mock(where.name, seed, truth=hidden)
    return flown(planned(course, where, law, model), autopilot, course.phases, law == OWN, link, seed, log_dir)


def flown(
    plan: FlightPlan,
    autopilot: SimulatedAutopilot,
    phases: tuple[str, ...],
    own: bool = False,
    link: Link = PERFECT,
    seed: int = 0,
    log_dir: Path | None = None,
) -> Track:
    """Fly a plan over a link; with `own` control the autopilot is sent the references, as positions."""
    pilot = plan.pilot(autopilot_takes_off=isinstance(autopilot, SimulatedCopter))
    linked = Linked(autopilot, link, pilot, own, seed)
    rows: list[Row] = []

    def witness(tick: Tick) -> None:
        if tick.stage is not Stage.FLY or tick.setpoint is None:
            return
        if own:
            linked.send(tick.setpoint)
        now_s, at = tick.state.time_s, autopilot.estimator.position
        age_s = max(0.0, tick.state.age_s("position")) if plan.settings.controller.look_ahead else 0.0
        rows.append(Row(now_s - age_s, tick.setpoint.position_ned_m, tick.phase, now_s, at))

    listeners: list[Callable[[Tick], None]] = [witness]
    recorder = plan.recorder(log_dir, f"simulated {autopilot.name}") if log_dir is not None else None
    if recorder is not None:
        listeners.append(recorder)
    fly_lockstep(cast(SimulatedAutopilot, linked), pilot, plan.settings.controller.rate_hz, listeners)
    if recorder is not None:
        recorder.close(pilot.ended)
    return _track(rows, phases, pilot.ended)


class Row(NamedTuple):
    """One tick: the reference at its time, and the estimate at the time of the tick."""

    reference_s: float
    reference: Vec3
    phase: str
    time_s: float
    estimate: Vec3


def _track(rows: Sequence[Row], phases: tuple[str, ...], ended: str) -> Track:
    """Track over the phases whose names begin like one of `phases`."""
    measured = np.array([row.phase.startswith(phases) for row in rows], dtype=bool)
    if not measured.any():
        raise FlightError(f"the flight did not come to the phase {phases[0]}: {ended}")
    reference_s, time_s = np.array([row.reference_s for row in rows]), np.array([row.time_s for row in rows])
    reference = np.array([row.reference for row in rows])

    path = [row.estimate for row in rows]
    at = np.column_stack([np.interp(reference_s, time_s, axis) for axis in zip(*path, strict=True)])
    from_s = reference_s[measured]
    return Track(from_s - from_s[0], (at - reference)[measured], ended)


def planned(course: Course, where: Mock, law: str, model: Model) -> FlightPlan:
    """Plan of a course by one of the LAWS."""
    config = ROOT / "sitl" / where.name / "flight.yaml"
    mission = ROOT / "missions" / f"{course.mission}.yaml"
    plan = prepare_flight(mission, config, "none", course.lifted_m, course.overrides)
    settings = plan.settings
    if law == BEFORE:
        settings = settings.model_copy(update={"controller": recorded_law(settings.controller)})
    if law == OWN:  # the pilot's own targets are not flown, and may be anything
        following = settings.guards.following.model_copy(update={"max_saturated_s": 0.0})
        guards = settings.guards.model_copy(update={"following": following})
        settings = settings.model_copy(update={"guards": guards})
    body = Model(model.vehicle, name=model.name)
    return plan._replace(settings=settings, body=body, compensator=model)


def unknown_model(where: Mock) -> Model:
    """The vehicle without what a fit finds: no lag of the attitude, no effects."""
    vehicle = mock(where.name).vehicle.model_copy(update={"attitude_response": None})
    return Model(vehicle, name="none")


@cache
def found_model(where: Mock, folder: Path) -> Model:
    """Model that the lab finds in one flight of excitation: the drags that its rule accepts, and the attitude's lag."""
    bare = unknown_model(where)
    log = excitation(where, bare, folder)
    data = load_dataset([log], bare.vehicle)
    model = bare
    for drag in (LinearDrag, QuadraticDrag):
        added = add(drag, model, data)
        if not added.conclusion:
            model = added.model
    response = attitude_response([log])
    fitted = fit(model, data).model if model.stack else model
    return fitted if response is None else with_response(fitted, response)


def excitation(where: Mock, model: Model, folder: Path) -> FlightLog:
    """Log of the flight that the fit sees, flown by the present law without knowledge."""
    before = set(folder.glob("*.csv"))
    fly(Course(FIT_MISSION, (), ("multisine",)), where, UNKNOWN, model, FIT_SEED, log_dir=folder)
    (path,) = set(folder.glob("*.csv")) - before
    return read_log(path)


def heavier(where: Mock) -> list[Effect]:
    """Load of ADDED_MASS of the vehicle's mass, from before the measured phase on."""
    return [MassStep(ADDED_MASS * mock(where.name).vehicle.mass_kg, LOADED_S[where.name])]
