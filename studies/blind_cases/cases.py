"""The list of hidden cases: which truths, how strong, on which vehicle, flown how. Two sets of seeds share none."""

import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from . import truths_air, truths_rotation, truths_unknown, truths_vehicle
from .world import Truth

HERE = Path(__file__).parent
RAPTOR = HERE.parents[1] / "config" / "vehicles" / "raptor.yaml"
VEHICLES = {
    "raptor": RAPTOR,
    "small_quad": HERE / "vehicles" / "small_quad.yaml",
    "hexarotor": HERE / "vehicles" / "hexarotor.yaml",
}
STRENGTHS = (1.0, 0.5, 0.3)
SeedSet = Literal["tuning", "final"]
FIRST_SEED: dict[SeedSet, int] = {"tuning": 1_000_000, "final": 4_000_000}
Kind = Literal["single", "pair", "none", "unexplained", "nameless"]

TRUTHS: dict[str, type[Truth]] = {
    name: kind
    for module in (truths_air, truths_vehicle, truths_unknown, truths_rotation)
    for name, kind in vars(module).items()
    if isinstance(kind, type) and issubclass(kind, Truth) and kind is not Truth
}
"""Every truth of those modules, by its name."""

MISSIONS: dict[str, tuple[str, ...]] = {
    "GroundCushion": ("heights", "climbs", "heights"),
    "GroundImages": ("heights", "climbs", "heights"),
    "CeilingSuction": ("ceiling", "climbs", "ceiling"),
    "HubForce": ("runs", "climbs", "runs"),
    "CrossflowDrag": ("fast_runs", "runs", "fast_runs"),
    "AxialBlades": ("climbs", "runs", "climbs"),
    "FreshAir": ("fast_runs", "climbs", "fast_runs"),
    "Breeze": ("places", "runs", "places"),
    "SkewedWakes": ("fast_runs", "runs", "fast_runs"),
    "LevellingGround": ("low_runs", "heights", "low_runs"),
    "OtherMass": ("heights", "runs", "climbs"),
    "Cargo": ("places", "heights", "places"),
    "TiredBattery": ("places", "climbs", "places"),
    "SluggishMotors": ("climbs", "runs", "climbs"),
    "BentArms": ("places", "runs", "places"),
    "Cable": ("heights", "climbs", "heights"),
    "ChippedBlade": ("places", "heights", "climbs"),
    "ShiftedAccelerometer": ("places", "runs", "places"),
    "ReynoldsThrust": ("jumps", "climbs", "jumps"),
    "Updraft": ("places", "runs", "places"),
    "Resonance": ("jumps", "climbs", "jumps"),
    "Magnet": ("runs", "places", "runs"),
    "StiffHubs": ("fast_runs", "runs", "fast_runs"),
    "OtherInertia": ("fast_runs", "places", "jumps"),
    "OffCentre": ("places", "runs", "places"),
}
"""Flights that show each truth; the last is kept unseen."""

SINGLES = tuple(name for name, kind in TRUTHS.items() if kind.family and name not in ("GroundCushion", "GroundImages"))
NAMELESS = tuple(name for name, kind in TRUTHS.items() if kind.nameless)
UNKNOWN = tuple(name for name, kind in TRUTHS.items() if not kind.family and not kind.nameless)
PAIRS = (
    ("GroundCushion", "HubForce"),
    ("GroundImages", "OtherMass"),
    ("GroundCushion", "Cable"),
    ("GroundCushion", "ChippedBlade"),
    ("GroundImages", "Cargo"),
    ("HubForce", "AxialBlades"),
    ("HubForce", "BentArms"),
    ("HubForce", "OtherMass"),
    ("AxialBlades", "OtherMass"),
    ("CrossflowDrag", "FreshAir"),
    ("BentArms", "ChippedBlade"),
    ("Breeze", "OtherMass"),
    ("Cable", "BentArms"),
    ("ReynoldsThrust", "BentArms"),
    ("SkewedWakes", "HubForce"),
    ("CeilingSuction", "OtherMass"),
)


@dataclass(frozen=True)
class Case:
    """One blind case. Only its logs and its vehicle's file go to the lab."""

    truths: tuple[str, ...]
    """Names of `TRUTHS`."""
    strength: float
    vehicle: str
    missions: tuple[str, ...]
    """The last one is kept unseen."""
    seed: int

    @property
    def name(self) -> str:
        truth = "+".join(self.truths) or f"None{self.seed % 1000}"
        return f"{truth}_{self.strength:g}_{self.vehicle}_{self.seed}"

    @property
    def kind(self) -> Kind:
        if not self.truths:
            return "none"
        if all(TRUTHS[name].nameless for name in self.truths):
            return "nameless"
        if not all(self.families):
            return "unexplained"
        return "pair" if len(self.truths) > 1 else "single"

    @property
    def families(self) -> tuple[str, ...]:
        return tuple(TRUTHS[name].family for name in self.truths)

    @property
    def also(self) -> set[str]:
        """Families that may be named too."""
        return {family for name in self.truths for family in TRUTHS[name].also}

    @property
    def vehicle_path(self) -> Path:
        return VEHICLES[self.vehicle]

    @property
    def imu(self) -> bool:
        """True where the logs hold the accelerometer: always where it matters, else in every third case."""
        return "imu_bias" in self.families or self.seed % 3 == 0

    @property
    def outputs_only(self) -> bool:
        """True where the logs of a case without truths hold motor outputs instead of rotor speeds."""
        return not self.truths and self.seed % 5 == 0


def truth_kinds(case: Case) -> list[type[Truth]]:
    return [TRUTHS[name] for name in case.truths]


def all_cases(seeds: SeedSet) -> list[Case]:
    """Single truths on every vehicle at every strength, pairs, nothing, and what no catalogue has."""
    cases = []
    vehicles = list(VEHICLES)
    for strength in STRENGTHS:
        for vehicle in vehicles:
            ground = "GroundImages" if vehicle == "hexarotor" else "GroundCushion"
            cases += [_case((name,), strength, vehicle, seeds) for name in (ground, *SINGLES)]
        cases += [_case(pair, strength, vehicles[i % 3], seeds) for i, pair in enumerate(PAIRS)]
        cases += [_case((name,), strength, vehicle, seeds) for name in UNKNOWN for vehicle in vehicles[:2]]
        cases += [_case((name,), strength, vehicle, seeds) for name in NAMELESS for vehicle in vehicles]
    sets = sorted(set(MISSIONS.values()))
    for i in range(24):
        cases.append(_case((), 1.0, vehicles[i % 3], seeds, missions=sets[i % len(sets)], salt=i))
    return cases


def _case(
    truths: tuple[str, ...],
    strength: float,
    vehicle: str,
    seeds: SeedSet,
    missions: Sequence[str] = (),
    salt: int = 0,
) -> Case:
    """A case with a seed of its own that stays when other cases are added."""
    flown = tuple(missions) or _missions(truths)
    own = zlib.crc32(repr((truths, strength, vehicle, salt)).encode()) % 900_000
    return Case(truths, strength, vehicle, flown, FIRST_SEED[seeds] + own)


def _missions(truths: tuple[str, ...]) -> tuple[str, ...]:
    """Missions that show each truth, and one that no fit sees; for two truths the first of each, then the second's."""
    if len(truths) == 1:
        return MISSIONS[truths[0]]
    first, second = (MISSIONS[name] for name in truths)
    both = tuple(dict.fromkeys((first[0], second[0], first[1])))[:3]
    return (*both, first[-1])
