"""The draw: a seed gives an autopilot, a vehicle, a mission, settings, and two to four faults at their times."""

import math
import random
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from ..faults.scene import PROFILES
from .kinds import KINDS

EARLY = 0.12
"""Share of sequences whose first fault comes before the vehicle has left the ground."""
START_S = 4.0
"""Length of the time before take-off in which such a fault comes."""


@dataclass(frozen=True)
class Fault:
    """A fault, `at_s` seconds after the vehicle left the ground, or after the flight began to speak (`early`)."""

    kind: str
    at_s: float
    early: bool
    lasts_s: float
    size: Mapping[str, Any]

    def __str__(self) -> str:
        size = ", ".join(f"{name} {_short(value)}" for name, value in self.size.items())
        lasts = f" for {self.lasts_s:.2f} s" if math.isfinite(self.lasts_s) else ""
        when = f"{self.at_s:.2f} s after {'the first word' if self.early else 'lift-off'}"
        return f"{when}: {self.kind}{f' ({size})' if size else ''}{lasts}"


@dataclass(frozen=True)
class Sequence:
    """A flight and its faults."""

    seed: int
    autopilot: str
    vehicle: str
    mission: Mapping[str, Any]
    guards: Mapping[str, Any]
    parameters: Mapping[str, float]
    """Parameters of the autopilot that differ from those of the fault table."""
    faults: tuple[Fault, ...]
    landing_s: float = field(default=0.0)
    """Duration of the mission, s, after which it lands."""

    def __str__(self) -> str:
        return f"seed {self.seed}, {self.autopilot}, {self.vehicle}: " + "; ".join(map(str, self.faults))


def draw(seed: int) -> Sequence:
    """Draw the sequence of a seed."""
    r = random.Random(seed)
    autopilot = r.choice(list(PROFILES))
    vehicle = r.choice(["raptor", "raptor", "f550"])
    mission, duration_s = _mission(r)
    guards = {
        "max_over_time_s": r.uniform(4.0, 12.0),
        "min_battery_v": r.choice([0.0, 13.5]) if vehicle == "raptor" else 0.0,
    }
    parameters = {"COM_OBL_RC_ACT": r.choice([3.0, 4.0])} if autopilot == "px4" else {"RTL_ALT": 100.0}
    return Sequence(seed, autopilot, vehicle, mission, guards, parameters, _faults(r, duration_s), duration_s)


def _faults(r: random.Random, duration_s: float) -> tuple[Fault, ...]:
    """Two to four faults: most flights end at the first, so the others follow it closely more often than not."""
    early = r.random() < EARLY
    at_s = r.uniform(0.0, START_S) if early else r.uniform(0.0, duration_s + 2.0)
    found = []
    names, weights = list(KINDS), [kind.weight for kind in KINDS.values()]
    for _ in range(r.choice([2, 2, 3, 3, 4])):
        name = r.choices(names, weights)[0]
        kind = KINDS[name]
        lasts_s = math.inf
        if kind.lasting and r.random() < 0.75:
            lasts_s = math.exp(r.uniform(math.log(0.03), math.log(8.0)))
        found.append(Fault(name, at_s, early, lasts_s, kind.draw(r)))
        at_s += math.exp(r.uniform(math.log(0.01), math.log(4.0)))
    return tuple(found)


def _mission(r: random.Random) -> tuple[dict[str, Any], float]:
    """A mission of some seconds, and about how long it lasts."""
    height_m, speed_m_s = r.uniform(0.4, 1.4), r.uniform(0.4, 1.0)
    phases: list[dict[str, Any]] = [
        {"name": "takeoff", "kind": "move", "to_m": [0.0, 0.0, height_m], "speed_m_s": speed_m_s}
    ]
    duration_s = 1.9 * height_m / speed_m_s
    place = [0.0, 0.0, height_m]
    for number in range(r.randrange(1, 4)):
        name = f"part{number + 1}"
        choice = r.choice(["hold", "move", "figure8"] if number == 0 else ["hold", "move"])
        if choice == "hold":
            seconds = r.uniform(1.0, 4.0)
            phases.append({"name": name, "kind": "hold", "duration_s": seconds})
            duration_s += seconds
        elif choice == "move":
            there = [r.uniform(-1.0, 1.0), r.uniform(-1.0, 1.0), r.uniform(0.3, 1.5)]
            phases.append({"name": name, "kind": "move", "to_m": there, "speed_m_s": r.uniform(0.4, 1.2)})
            duration_s += 1.9 * math.dist(place, there) / 0.8
            place = there
        else:
            lap_s = r.uniform(6.0, 9.0)
            phases.append({"name": name, "kind": "figure8", "north_m": 0.8, "east_m": 0.4, "lap_s": lap_s, "laps": 1})
            duration_s += lap_s
    limits = {"min_z_m": 0.1, "max_z_m": 1.8, "max_distance_m": 2.5, "max_duration_s": 90}
    return {"name": "random", "phases": phases, "limits": limits}, duration_s


def _short(value: object) -> str:
    if isinstance(value, float):
        return f"{value:.3g}"
    if isinstance(value, tuple | list):
        return "/".join(map(_short, value))
    return "none" if value is None else str(value)
