"""Draw of a case: its vehicle, equipment, controllers, disturbances and references."""

from __future__ import annotations

import zlib
from dataclasses import dataclass
from typing import Any

import numpy as np

from studies.worlds.open.cases import Case
from studies.worlds.open.control import gains
from studies.worlds.open.effects import Hidden, hide
from studies.worlds.open.missions import STEP_S, reference
from studies.worlds.open.noise import drift, turbulence
from studies.worlds.open.sensors import Equipment, equip
from studies.worlds.open.simulate import Battery, Flight
from studies.worlds.open.vehicles import Craft, draw_craft


@dataclass(frozen=True)
class Drawn:
    """Case with its random numbers drawn."""

    case: Case
    craft: Craft
    hidden: Hidden
    parameters: dict[str, Any]
    kit: Equipment
    flights: tuple[Flight, ...]
    seed: tuple[int, int, int]
    strength: float

    def generator(self, purpose: int) -> np.random.Generator:
        """Random numbers of the case for one purpose, the same whatever else is simulated."""
        return np.random.default_rng([*self.seed, purpose])


def draw(case: Case, strength: float, seed: int, attempt: int) -> Drawn:
    """Case drawn from a seed; another attempt draws everything anew."""
    key = (seed, zlib.crc32(case.name.encode()), attempt)
    rng = np.random.default_rng([*key, 0])
    craft = draw_craft(case.kind, rng)
    hidden, parameters = hide(case.effects, craft, strength)
    kit = equip(case.place, case.source, case.imu, case.quick, case.slow_speeds, rng)
    calm = rng.uniform(0.04, 0.1) if case.place == "field" else rng.uniform(0.02, 0.05)
    drop = rng.uniform(0.02, 0.035)
    flights = []
    for number, mission in enumerate(case.missions):
        path = reference(mission, craft.radius_m, craft.rotor_height_m, case.ceiling_m, rng)
        rows = len(path.yaw)
        battery = Battery(
            case.endurance_s * rng.uniform(0.95, 1.05),
            rng.uniform(0.0, 0.03) if case.endurance_s < 500 else rng.uniform(0.02, 0.15),
            drop,
        )
        style = case.styles[(number + int(rng.integers(len(case.styles)))) % len(case.styles)]
        flights.append(
            Flight(
                craft=craft,
                hidden=hidden,
                reference=path,
                gust=turbulence(rng, rows, STEP_S, calm),
                twist=drift(rng, rows, STEP_S, 0.3, rng.uniform(0.1, 0.3)),
                hand=drift(rng, rows, STEP_S, 0.5, 0.12 if style == "pilot" else 0.03),
                gains=gains(style, craft.time_constant_s + hidden.lag_s, rng),
                battery=battery,
                ceiling_m=case.ceiling_m,
            )
        )
    return Drawn(case, craft, hidden, parameters, kit, tuple(flights), key, strength)
