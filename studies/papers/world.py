"""A simulated world for one vehicle: flights in it in lockstep and over MAVLink, and what is found from them."""

import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import yaml

from quadctl.effects import Effect
from quadctl.errors import QuadctlError
from quadctl.flight.pilot.outcome import Outcome
from quadctl.flight.preflight.preparation import prepare_flight
from quadctl.lab.flights.dataset import load_dataset
from quadctl.lab.selection.addition import add
from quadctl.lab.tracking.metrics import Window, metrics
from quadctl.logs.flight_log import FlightLog
from quadctl.logs.read import read_log
from quadctl.model import Model, save_model
from quadctl.sitl.run import simulate
from quadctl.vehicle import load_vehicle
from studies.page import ROOT

MISSIONS = ROOT / "missions"
STAIRCASE_SEEDS = (101, 102)
LONGEST_FLIGHT_S = 300.0


class Errors(NamedTuple):
    """Height errors over one phase, m, one value per flight."""

    largest: tuple[float, ...]
    rmse: tuple[float, ...]

    @classmethod
    def of(cls, logs: Sequence[FlightLog], phase: str) -> "Errors":
        flights = [metrics([log], window=Window(phase=phase)).flights[0] for log in logs]
        return cls(tuple(abs(f.max_error_m) for f in flights), tuple(f.rmse_m for f in flights))


class World:
    """One vehicle, by its flight configuration, in a world with hidden effects; its files are in `folder`."""

    def __init__(self, folder: Path, config: Path, effect: str, parameters: dict[str, float] | None = None) -> None:
        folder.mkdir(parents=True)
        self.folder, self.config = folder, config
        self.vehicle = load_vehicle(config.parent / yaml.safe_load(config.read_text(encoding="utf-8"))["vehicle"])
        self.hidden = folder / "hidden.yaml"
        self.hidden.write_text(yaml.safe_dump({"effects": [{"effect": effect, "parameters": parameters or {}}]}))

    def fly(self, mission: str, compensator: str, seed: int) -> FlightLog:
        """One flight in lockstep.

        Raises
        ------
        QuadctlError
            It was not completed.
        """
        plan = prepare_flight(MISSIONS / f"{mission}.yaml", self.config, compensator, None)
        return completed(simulate(plan, self.folder / "logs", self.hidden, seed), mission)

    def fly_over_mavlink(self, mission: str, compensator: str, seed: int, name: str) -> "WireFlight":
        """Begin one flight in real time, in a process of its own; `name` names the folder of its log."""
        folder = self.folder / name
        words = [
            *("fly", str(MISSIONS / f"{mission}.yaml"), "--sitl", "--set-params", "--seed", str(seed)),
            *("--config", str(self.config), "--hidden", str(self.hidden), "--model", compensator),
            *("--log-dir", str(folder)),
        ]
        return WireFlight(words, folder)

    def find(self, kind: type[Effect]) -> Path:
        """Fit an effect to hover staircases; gives the model file."""
        logs = [self.fly("hover_staircase", "none", seed) for seed in STAIRCASE_SEEDS]
        path = self.folder / "found.yaml"
        save_model(add(kind, Model(self.vehicle), load_dataset(logs, self.vehicle)).model, path)
        return path

    def errors(self, mission: str, compensator: str, seeds: Sequence[int], phase: str = "cosine") -> Errors:
        """Height errors of one compensator, in lockstep."""
        return Errors.of([self.fly(mission, compensator, seed) for seed in seeds], phase)


def completed(outcome: Outcome, mission: str) -> FlightLog:
    """The log of a flight in lockstep; raises QuadctlError where it was not completed."""
    if not outcome.completed:
        raise QuadctlError(f"the simulated flight of {mission} was not completed: {outcome.ended}")
    return read_log(outcome.log)


class WireFlight:
    """A flight of `quadctl fly --sitl` under way."""

    def __init__(self, words: Sequence[str], folder: Path) -> None:
        self._folder = folder
        self._process = subprocess.Popen(
            [sys.executable, "-m", "quadctl", *words], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
        )

    def log(self) -> FlightLog:
        """The log, once it has landed.

        Raises
        ------
        QuadctlError
            It was not completed.
        """
        said, _ = self._process.communicate(timeout=LONGEST_FLIGHT_S)
        if self._process.returncode:
            raise QuadctlError(f"a flight over MAVLink was not completed: {said}")
        return read_log(next(self._folder.glob("*.csv")))
