"""Fly a model in the simulated world: the step response with the compensator and without it."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml

from quadctl.errors import QuadctlError
from quadctl.lab.tracking.metrics import Window, metrics
from quadctl.lab.tracking.step_response import StepResponses, step_responses
from quadctl.logs.flight_log import FlightLog
from quadctl.logs.read import read_log
from quadctl.model import Model, save_model
from quadctl.vehicle import Vehicle
from quadctl.web.work.worker import Progress

MISSION, REFERENCE_MISSION = "step_response", "step_response_high"
SAMPLE_MISSION, SAMPLE_SEED = "hover_staircase", 1
WITHOUT, WITH, FAR = "without compensator", "with this model", "far from the ground"


@dataclass(frozen=True)
class Simulation:
    """Access to the simulated world; it can be sent to another process."""

    simulate: Callable[..., Any]
    """Flies a plan: (plan, log folder, hidden truth, seed) -> outcome."""
    missions: Path
    folder: Path
    """Folder for logs and models."""
    hidden: Path | None = None
    """File that describes the world; None: the world obeys the model that is flown."""
    sample_world: Mapping[str, Any] = field(default_factory=dict)
    """Content of the file of the world that a sample flight is flown in."""

    def check(self, model: Model) -> list[str]:
        """Check `model` as a compensator before a flight, and return warnings.

        Raises
        ------
        SettingsError
            It must not fly, and why.
        """
        from quadctl.compensator import check_compensator
        from quadctl.flight.preflight.plan import read_flight

        plan = read_flight(self._mission(MISSION), None, str(self._saved(model)), None)
        return [*map(str, check_compensator(plan.compensator, *plan.rotor_heights_m, plan.compensator.name))]

    def fly_steps(self, model: Model, progress: Progress) -> StepResponses:
        """Step responses into the ground effect, and one far from the ground that they are compared with.

        Raises
        ------
        QuadctlError
            The model must not fly, a file is missing, or a flight was not completed.
        """
        rigid, compensated = self._saved(Model(model.vehicle, name="uncompensated")), self._saved(model)
        hidden = self.hidden or compensated  # the file of a model is also that of a world that obeys it
        logs = {}
        flights = (
            (WITHOUT, MISSION, rigid, 11),
            (WITH, MISSION, compensated, 11),
            (FAR, REFERENCE_MISSION, rigid, 10),
        )
        for number, (name, mission, flown, seed) in enumerate(flights, start=1):
            progress(f"flying the step {name}, {number} of {len(flights)}")
            logs[name] = self._fly(mission, flown, hidden, seed)
        table = metrics([logs[WITHOUT], logs[WITH]], [logs[FAR]], window=Window(phase="step"))
        return step_responses(logs, table)

    def fly_sample(self, vehicle: Vehicle, progress: Progress) -> Path:
        """Log of a flight of `vehicle` in a world with an effect that its model does not hold.

        Raises
        ------
        QuadctlError
            The vehicle cannot fly the mission, or a file is missing.
        """
        rigid = self._saved(Model(vehicle, name="uncompensated"))
        world = self.folder / "simulated" / "sample_world.yaml"
        world.write_text(yaml.safe_dump(dict(self.sample_world)), encoding="utf-8")
        progress("hovering at several heights over the ground")
        flown = self._fly(SAMPLE_MISSION, rigid, world, SAMPLE_SEED)
        assert flown.path is not None, "a log that was read has a path"
        return flown.path

    def _fly(self, mission: str, model: Path, hidden: Path, seed: int) -> FlightLog:
        from quadctl.flight.preflight.preparation import prepare_flight

        plan = prepare_flight(self._mission(mission), None, str(model), None)
        outcome = self.simulate(plan, self.folder / "simulated", hidden, seed)
        if not outcome.completed:
            raise QuadctlError(f"the simulated flight of {mission} was not completed: {outcome.ended}")
        return read_log(outcome.log)

    def _mission(self, name: str) -> Path:
        path = self.missions / f"{name}.yaml"
        if not path.is_file():
            raise QuadctlError(f"{path}: there is no such mission, expected the folder of the missions with --missions")
        return path

    def _saved(self, model: Model) -> Path:
        path = self.folder / "simulated" / f"{'model' if model.stack else 'uncompensated'}.yaml"
        save_model(model, path)
        return path
