"""Garofano-Soldado et al., table IV: z = 0.55 + 0.45 cos(2 pi t / 5) near the ground, with and without compensation.

Both vehicles of the paper are flown in lockstep, the co-planar one and the one with tilted rotors, each in two worlds:
one whose ground effect is no formula of the catalogue, and one that obeys the paper's own formula for this vehicle, in
which the paper's compensator is right by construction.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from quadctl.effects.ground_effect import Exponential
from studies.page import ROOT, table, with_deviation
from studies.papers.world import STAIRCASE_SEEDS, Errors, World

CUSHION = "hidden.ground_cushion"
CUSHION_NAME = "a cushion, K = 1 + 0.25 / (1 + (z/1.8R)²)^1.5"
FOUND = "found from a staircase"
HIGH = "none, 1 m higher"
SEEDS = (1, 2, 3)
GOAL = 0.2
"""Largest share of the error without compensation that may remain."""


class Hexarotor(NamedTuple):
    """One vehicle of the paper."""

    name: str
    config: Path
    formula: str
    """Variant of the ground effect that the paper derives for it."""
    equations: str
    published_cm: tuple[float, float]
    """RMSE of the paper's table IV without and with its compensation."""


CONFIG = ROOT / "config"
VEHICLES = (
    Hexarotor("upright rotors (co-planar)", CONFIG / "flight_f550.yaml", "hexarotor", "eq. 9", (6.77, 3.43)),
    Hexarotor(
        "tilted rotors (fully actuated)",
        CONFIG / "flight_f550_tilted.yaml",
        "hexarotor_tilted",
        "eq. 10 to 13",
        (6.65, 3.13),
    ),
)


def fly_all(vehicle: Hexarotor, folder: Path, seeds: Sequence[int] = SEEDS) -> dict[str, dict[str, Errors]]:
    """Errors by world and compensator; logs and models go to `folder`."""
    worlds = {CUSHION_NAME: CUSHION, f"{vehicle.equations} of the paper": f"ground_effect.{vehicle.formula}"}
    found = {}
    for number, (name, effect) in enumerate(worlds.items()):
        world = World(folder / str(number), vehicle.config, effect)
        flown = {word: world.errors("garofano_cosine", word, seeds) for word in ("none", vehicle.formula)}
        flown[FOUND] = world.errors("garofano_cosine", str(world.find(Exponential)), seeds)
        flown[HIGH] = world.errors("garofano_cosine_high", "none", seeds)
        found[name] = flown
    return found


def section(folder: Path) -> str:
    """The part of the page; flies, with its files in `folder`."""
    parts = []
    for vehicle in VEHICLES:
        before, after = vehicle.published_cm
        name = vehicle.name[0].upper() + vehicle.name[1:]
        parts.append(f"### {name}\n\n`{vehicle.config.name}`; the paper: RMSE {before} to {after} cm.")
        for world, flown in fly_all(vehicle, folder / vehicle.formula).items():
            none = flown["none"]
            rows = [
                [
                    name,
                    with_deviation([100.0 * e for e in errors.largest], 2),
                    _share(errors.largest, none.largest),
                    with_deviation([100.0 * e for e in errors.rmse], 3),
                    _share(errors.rmse, none.rmse),
                ]
                for name, errors in flown.items()
            ]
            parts.append(f"World: {world}\n\n{table(HEADINGS, rows)}\n\n{_verdict(flown)}")
    text = "\n\n".join(parts)
    return f"""## Garofano-Soldado et al.: table IV in closed loop

Each vehicle follows z = 0.55 + 0.45 cos(2πt/5) m for eight cycles in the lockstep simulator, in two worlds with
different ground effects. Each compensator has its own formula only. *{FOUND}* is `ground_effect.exponential`, which
`quadctl add` has fitted to {len(STAIRCASE_SEEDS)} hover staircases in the same world. The numbers are mean ± standard
deviation over {len(SEEDS)} seeds of the noise of the state estimate. The mass, the gains and the ground effect of the
paper are different, so only errors relative to those without compensation can be compared: the paper halves the error,
our goal is a fifth. *{HIGH}* shows the error of the controller itself, out of ground effect. The vehicle with tilted
rotors stays level and is commanded in three dimensions (`actuation: full`).

{text}
"""


HEADINGS = ("compensator", "largest error, cm", "relative to none", "RMSE, cm", "relative to none")


def _share(values: Sequence[float], none: Sequence[float]) -> str:
    return f"{np.mean(values) / np.mean(none):.0%}"


def _verdict(flown: dict[str, Errors]) -> str:
    parts = []
    for name in [name for name in flown if name not in ("none", HIGH)]:
        share = float(np.mean(flown[name].rmse) / np.mean(flown["none"].rmse))
        word = "at most a fifth" if share <= GOAL else "at most a half" if share <= 0.5 else "more than a half"
        parts.append(f"{word} with {f'*{name}*' if name == FOUND else f'`{name}`'}")
    return f"The RMSE, relative to that without compensation, is {', '.join(parts)}."
