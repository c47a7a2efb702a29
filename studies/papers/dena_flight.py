"""Dena et al., table 5: tracking errors over one surface and over an edge, without compensation, with M4, with PM.

M4 has one weight of the fountain for all surfaces, PM one for each. Both are fitted to hovers at 13 heights over each
surface; the world obeys eq. 20, whose weights are ours, as the paper prints none.
"""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import yaml

from quadctl.effects.ground_effect import Sanchez
from quadctl.flight.preflight.preparation import prepare_flight
from quadctl.lab.flights.dataset import load_dataset
from quadctl.lab.selection.addition import add
from quadctl.lab.surfaces import SurfaceComparison, compare_surfaces
from quadctl.logs.flight_log import FlightLog
from quadctl.missions import load_mission
from quadctl.model import Model, save_model
from quadctl.sitl.run import simulate
from studies.page import table, with_deviation
from studies.papers.four_vehicles import CONFIGS
from studies.papers.world import MISSIONS, Errors, World, completed

WEIGHTS = {"turf": 0.2, "dirt": 0.5, "concrete": 1.4}
"""True weight k_b + k_s of each surface."""
K_B = 0.4509
CONFIG = CONFIGS["AscTec Pelican (Dena et al.)"]
SEEDS = (1, 2, 3)
MODELS = ("none", "M4, one weight", "PM, one for each surface")
WIRE_SEED = 1


class Ground(World):
    """A world whose ground effect obeys eq. 20; where its surfaces lie is that of the mission flown."""

    def __init__(self, folder: Path) -> None:
        super().__init__(
            folder, CONFIG, "ground_effect.surfaces", {"k_b": K_B, **{f"k_{n}": k - K_B for n, k in WEIGHTS.items()}}
        )

    def over(self, mission: str, compensator: str, seed: int, overrides: Sequence[str] = ()) -> FlightLog:
        """One flight in lockstep over the surfaces that its mission names."""
        plan = prepare_flight(MISSIONS / f"{mission}.yaml", self.config, compensator, None, overrides)
        self.lay(mission, overrides)
        return completed(simulate(plan, self.folder / "logs", self.hidden, seed), mission)

    def lay(self, mission: str, overrides: Sequence[str] = ()) -> None:
        """Lay the surfaces of a mission into the world."""
        place = load_mission(MISSIONS / f"{mission}.yaml", overrides=overrides).place
        assert place is not None
        truth = yaml.safe_load(self.hidden.read_text()) | {"ground": place.model_dump(mode="json")}
        self.hidden.write_text(yaml.safe_dump(truth))

    def fit(self) -> tuple[dict[str, str], SurfaceComparison]:
        """Compensators by name: none, M4 and PM, fitted to one flight over each surface; and the comparison."""
        logs = [self.over("surface_heights", "none", 100 + i, [f"surface={name}"]) for i, name in enumerate(WEIGHTS)]
        data = load_dataset(logs, self.vehicle)
        compared = compare_surfaces(Model(self.vehicle), data)
        words = {"none": "none"}
        for name, model in zip(
            MODELS[1:], (add(Sanchez, Model(self.vehicle), data).model, compared.model), strict=True
        ):
            path = self.folder / f"{name[:2]}.yaml"
            save_model(replace(model, name=name[:2]), path)
            words[name] = str(path)
        return words, compared


def section(folder: Path) -> str:
    """The part of the page; flies, with its files in `folder`."""
    world = Ground(folder)
    words, compared = world.fit()
    rows = []
    for name in WEIGHTS:
        over = [f"surface={name}"]
        rows.append([f"{name}, cosine", *_cells(world, words, "surface_cosine", "cosine", over)])
    rows.append(["runs over the edge", *_cells(world, words, "surface_edge", "edge")])
    world.lay("surface_edge")
    wire = [
        world.fly_over_mavlink("surface_edge", word, WIRE_SEED, f"wire{i}") for i, word in enumerate(words.values())
    ]
    flown = [Errors.of([flight.log()], "edge") for flight in wire]
    rows.append(["the same, MAVLink", *(f"{100.0 * errors.rmse[0]:.2f}" for errors in flown)])
    weights = ", ".join(f"{name} {true:g}" for name, true in WEIGHTS.items())
    fitted = ", ".join(f"{name} {k:.2f}" for name, k in zip(compared.names, compared.weights, strict=True))
    return f"""## Dena et al.: table 5, tracking over surfaces and over an edge

The Pelican flies z = 0.55 + 0.45 cos(2πt/5) over each surface, and over an edge, in a world that obeys eq. 20
with weights
of our own ({weights}). PM, fitted to one hover staircase over each surface, finds {fitted}. {len(SEEDS)} seeds.

{table(["RMSE of height, cm", *MODELS], rows)}
"""


def _cells(world: Ground, words: dict[str, str], mission: str, phase: str, overrides: Sequence[str] = ()) -> list[str]:
    flown = {
        name: Errors.of([world.over(mission, word, seed, overrides) for seed in SEEDS], phase)
        for name, word in words.items()
    }
    none = float(np.mean(flown["none"].rmse))
    return [
        with_deviation([100.0 * e for e in errors.rmse], 2)
        + ("" if name == "none" else f" ({np.mean(errors.rmse) / none:.0%})")
        for name, errors in flown.items()
    ]
