"""The cases: which errors are hidden, with which forces and reference, drawn from the number of the case."""

import random
from dataclasses import dataclass
from pathlib import Path

import yaml

from quadctl.errors import QuadctlError
from quadctl.flight.preflight.preparation import prepare_flight
from quadctl.logs.csv_log import write_csv
from quadctl.logs.read import read_log
from quadctl.sitl.run import simulate
from studies.page import ROOT

from .world import SIDES, Forces, Form, Ground, Nuisance, Reference, Truth, observed

MISSION = ROOT / "missions" / "barometer_runs.yaml"
CONFIG = ROOT / "config" / "flight.yaml"
REFERENCES: tuple[Reference, ...] = ("motion capture", "range finder", "GPS")
KINDS = ("clean",) * 10 + ("airspeed",) * 8 + ("ground",) * 8 + ("both",) * 4
FIRST_SEED = 7000
HALL = ("speeds_m_s=[2, 4]", "reach_m=5", "low_m=-5")
FIELD = ("speeds_m_s=[3, 6]", "reach_m=12", "low_m=-12")


@dataclass(frozen=True)
class Case:
    """One flight of the mission for barometers."""

    seed: int
    kind: str
    reference: Reference
    truth: Truth
    forces: Forces
    nuisance: Nuisance

    @property
    def room(self) -> tuple[str, ...]:
        """The mission's parameters: in a hall, or in a field."""
        return HALL if self.reference == "motion capture" else FIELD


def all_cases() -> list[Case]:
    """The thirty cases, and one without a reference."""
    cases = [_case(FIRST_SEED + i, kind, REFERENCES[i % 3], i % 2 == 0) for i, kind in enumerate(KINDS)]
    return [*cases, _case(FIRST_SEED + len(KINDS), "both", "none", False)]


def _case(seed: int, kind: str, reference: Reference, with_force: bool) -> Case:
    chance = random.Random(seed)
    sides: dict[str, float] = {}
    if kind in ("airspeed", "both"):
        of_size = chance.sample(SIDES[:4], chance.randint(2, 4))
        sides = {side: chance.choice((-1.0, 1.0)) * chance.uniform(0.07, 0.15) for side in of_size}
        if chance.random() < 0.5:
            sides |= {side: chance.choice((-1.0, 1.0)) * chance.uniform(0.05, 0.12) for side in SIDES[4:]}
    ground = None
    if kind in ("ground", "both"):
        forms: tuple[Form, ...] = ("exponential", "lorentz", "gauss")
        size_m = chance.choice((-1.0, 1.0)) * chance.uniform(0.2, 0.4)
        ground = Ground(size_m, chance.uniform(0.3, 0.6), chance.choice(forms))
    return Case(seed, kind, reference, Truth(sides, ground), _forces(chance, reference, with_force), _nuisance(chance))


def _forces(chance: random.Random, reference: Reference, with_force: bool) -> Forces:
    """A force in every second case; a wind in half of those out of doors, where a vehicle that feels it has a drag."""
    drag = area = gain = 0.0
    if with_force:
        which = chance.choice(("rotor drag", "body drag", "ground effect"))
        drag = chance.uniform(0.2, 0.5) if which == "rotor drag" else 0.0
        area = chance.uniform(0.015, 0.035) if which == "body drag" else 0.0
        gain = chance.uniform(0.15, 0.3) if which == "ground effect" else 0.0
    wind = (0.0, 0.0)
    if reference != "motion capture" and chance.random() < 0.5:
        wind = chance.uniform(-1.4, 1.4), chance.uniform(-1.4, 1.4)
        drag = drag or (0.0 if area else chance.uniform(0.2, 0.4))
    payload_kg = chance.uniform(0.1, 0.3) if chance.random() < 0.3 else 0.0
    return Forces(drag, area, gain, chance.uniform(1.5, 2.5), payload_kg, wind)


def _nuisance(chance: random.Random) -> Nuisance:
    return Nuisance(
        white_m=chance.uniform(0.05, 0.1),
        interval_s=chance.choice((0.02, 0.04)),
        wander_m=chance.uniform(0.02, 0.05),
        wander_s=chance.uniform(10.0, 40.0),
        offset_m=chance.uniform(-50.0, 500.0),
        delay_s=chance.uniform(0.0, 0.06),
        drift_m_s=chance.uniform(-0.03, 0.03) / 60.0,
        range_m=chance.uniform(0.01, 0.02),
        range_offset_m=chance.uniform(0.0, 0.05),
        gps_m_s=chance.uniform(0.05, 0.1),
        gps_time_s=chance.uniform(0.2, 0.6),
        gps_delay_s=chance.uniform(0.05, 0.12),
    )


def write_case(case: Case, folder: Path) -> Path:
    """Fly a case and write its log, unless it is there already; gives the path of the log.

    Raises
    ------
    QuadctlError
        The flight was not completed.
    """
    where = folder / str(case.seed)  # a name that gives nothing away
    path = where / "flight.csv"
    if path.exists():
        return path
    raw = where / "raw"
    raw.mkdir(parents=True, exist_ok=True)
    hidden, mission = raw / "hidden.yaml", raw / MISSION.name
    hidden.write_text(yaml.safe_dump(case.forces.hidden()), encoding="utf-8")
    wide = yaml.safe_load(MISSION.read_text(encoding="utf-8"))
    wide["limits"] |= {"max_distance_m": 30.0, "max_duration_s": 600}
    mission.write_text(yaml.safe_dump(wide, sort_keys=False), encoding="utf-8")
    plan = prepare_flight(mission, CONFIG, None, None, case.room)
    outcome = simulate(plan, raw, hidden, case.seed)
    if not outcome.completed:
        raise QuadctlError(f"case {case.seed}: the simulated flight was not completed: {outcome.ended}")
    flown, vehicle = read_log(outcome.log), plan.body.vehicle
    write_csv(observed(flown, vehicle, case.truth, case.forces, case.nuisance, case.reference, case.seed), path)
    return path
