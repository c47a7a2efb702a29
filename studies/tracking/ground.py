"""The thesis' step and swoop in ground effect, without its compensator and with it, by both control laws.

The world has a ground effect that is no formula of the catalogue, and a drag; the lab finds both in staircases and a
flight of excitation, and the attitude's lag.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import yaml

from quadctl.effects.ground_effect import Exponential
from quadctl.effects.rotor_drag import LinearDrag
from quadctl.lab.flights.dataset import load_dataset
from quadctl.lab.selection.addition import add
from quadctl.lab.tracking.attitude_response import attitude_response, with_response
from quadctl.lab.tracking.metrics import Window, metrics
from quadctl.logs.flight_log import FlightLog
from quadctl.model import Model, load_model, save_model
from studies.page import ROOT
from studies.papers.garofano_flight import CUSHION
from studies.papers.world import STAIRCASE_SEEDS, World

CONFIGS = {"before": "flight_thesis.yaml", "now": "flight.yaml"}
SEEDS = (1, 2)
FIT_SEED = 111
DRAG = LinearDrag(0.3, 0.25, 0.05)
WITHOUT, WITH = "without the ground effect", "with it"


class Ground(NamedTuple):
    """Results of one law with one model, means over the seeds."""

    law: str
    model: str
    m_b_signed: float
    """Step: M_B, m s."""
    m_b_absolute: float
    swoop_up_m: float
    """Swoop: RMSE of the height."""
    swoop_m: float
    """Swoop: RMSE in three dimensions."""


class _World(World):
    """World with a drag beside its ground effect."""

    def __init__(self, folder: Path, config: str) -> None:
        super().__init__(folder, ROOT / "config" / config, CUSHION)
        hidden = yaml.safe_load(self.hidden.read_text(encoding="utf-8"))
        hidden["effects"].append({"effect": DRAG.name, "parameters": DRAG.values()})
        self.hidden.write_text(yaml.safe_dump(hidden), encoding="utf-8")

    def found(self) -> dict[str, Path]:
        """Model files of drag and lag alone, and with the ground effect, fitted together."""
        waves = self.fly("excitation", "none", FIT_SEED)
        logs = [self.fly("hover_staircase", "none", seed) for seed in STAIRCASE_SEEDS]
        data = load_dataset([*logs, waves], self.vehicle)
        both = add(LinearDrag, add(Exponential, Model(self.vehicle), data).model, data).model
        response = attitude_response([waves])
        assert response is not None
        drag = Model(self.vehicle, both.stack[-1:], name="drag")
        files = {}
        for name, model in ((WITHOUT, drag), (WITH, both)):
            files[name] = self.folder / f"{len(model.stack)}.yaml"
            save_model(with_response(model, response), files[name])
            load_model(files[name])
        return files


def results(folder: Path, laws: Sequence[str] = tuple(reversed(CONFIGS)), seeds: Sequence[int] = SEEDS) -> list[Ground]:
    """Flights of these laws in the same world; files go to `folder`."""
    found: dict[str, Path] = {}
    rows = []
    for law in laws:
        config = CONFIGS[law]
        world = _World(folder / law, config)
        found = found or world.found()
        rows += [_flown(world, law, name, str(path), seeds) for name, path in found.items()]
    return rows


def _flown(world: _World, law: str, name: str, model: str, seeds: Sequence[int]) -> Ground:
    steps = [world.fly("step_response", model, seed) for seed in seeds]
    high = [world.fly("step_response_high", model, seed) for seed in seeds]
    table = metrics(steps, high, window=Window(phase="step"))
    low = [flight for flight in table.flights if not flight.is_reference]
    swoops = [world.fly("swoop", model, seed) for seed in seeds]
    return Ground(
        law,
        name,
        float(np.mean([flight.m_b_signed or 0.0 for flight in low])),
        float(np.mean([flight.m_b_absolute or 0.0 for flight in low])),
        float(np.mean([_rmse(log, "z") for log in swoops])),
        float(np.mean([_rmse(log, "xyz") for log in swoops])),
    )


def _rmse(log: FlightLog, axes: Sequence[str]) -> float:
    """RMSE over the swoops along `axes` together."""
    assert log.phase is not None
    rows = np.array([str(phase).startswith("swoop") for phase in log.phase])
    square = sum((log[f"{axis}_m"][rows] - log[f"{axis}_ref_m"][rows]) ** 2 for axis in axes)
    return float(np.sqrt(np.nanmean(square)))
