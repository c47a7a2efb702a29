"""Command that flies the cases of a world: `python -m studies.worlds.borrowed rotorpy --out DIR --strength 1 0.5`.

One folder for each strength, `DIR/WORLD_SEED_STRENGTH`, with a folder for each case: vehicle file, logs and truth.
With `--records wrong` the logs have the flaws of real ones (`records.py`), and the folder's name says so.
"""

from __future__ import annotations

import argparse
import json
import sys
import zlib
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import yaml

from studies.worlds.borrowed.cases import WORLDS, Case
from studies.worlds.borrowed.craft import GRAVITY_M_S2, RPM, Array, Craft, draw_craft, vehicle_file
from studies.worlds.borrowed.drone_models_world import DroneModels
from studies.worlds.borrowed.flight import TICK_S, Battery, Flight, Record, Simulator, drift, fly
from studies.worlds.borrowed.missions import SETTLE_S, STEP_S, reference
from studies.worlds.borrowed.records import Flaws, distorted, draw_flaws
from studies.worlds.borrowed.rotorpy_world import RotorPy
from studies.worlds.borrowed.sensors import Columns, equip, log_columns, low_pass

SIMULATORS: dict[str, type[Simulator]] = {"rotorpy": RotorPy, "drone_models": DroneModels}
ATTEMPTS = 4
BAD_RECORDS = 1000
"""Part of the seeds of what is wrong in the records, apart from the numbers of the flights."""
IMU_SHARE = 0.6
"""Share of the logs of rotor speeds that have accelerometers, where records are wrong."""


def turbulence(rng: np.random.Generator, rows: int, size: float) -> Array:
    """Acceleration by light turbulence: slow and quick eddies, with a total of the given size."""
    time = rng.uniform(1.5, 4.0)
    mixed = drift(rng, rows, STEP_S, time, 0.8) + drift(rng, rows, STEP_S, 0.3 * time, 0.6)
    return np.asarray(mixed * np.array([1.0, 1.0, 0.7]) * size / np.sqrt(2.49))


def draw_flights(case: Case, craft: Craft, rng: np.random.Generator) -> list[Flight]:
    """Flights of a case at strength 1."""
    calm = rng.uniform(0.04, 0.1) if case.outdoors else rng.uniform(0.02, 0.05)
    drop, flights = rng.uniform(0.02, 0.035), []
    for mission in case.missions:
        path = reference(mission, craft.kind.radius_m, craft.rotor_height_m, case.ceiling_m, rng)
        rows, used = len(path.yaw), rng.uniform(0.0, 0.03) if case.endurance_s < 500 else rng.uniform(0.02, 0.15)
        flights.append(
            Flight(
                craft=craft,
                hidden=case.effects,
                strength=1.0,
                reference=path,
                gust=turbulence(rng, rows, calm),
                twist=drift(rng, rows, STEP_S, 0.3, rng.uniform(0.1, 0.3)),
                hand=drift(rng, rows, STEP_S, 0.5, rng.uniform(0.03, 0.1)),
                stiffness=rng.uniform(0.85, 1.1),
                battery=Battery(case.endurance_s * rng.uniform(0.95, 1.05), used, drop),
                ceiling_m=case.ceiling_m,
            )
        )
    return flights


def hidden_acceleration(case: Case, flight: Flight, record: Record) -> Array:
    """Acceleration by what is hidden, a moment counted at the radius of the arms: what the rigid body of the vehicle
    file leaves, its ordinary errors left out."""
    craft = flight.craft
    speeds = record.rpm / RPM
    if case.source != "speeds":
        speeds = np.sqrt(record.command_n / craft.thrust)
        speeds = low_pass(speeds, craft.lag_s) if case.states_lag else speeds
    lift = np.sum(craft.rotor_gains * craft.thrust * speeds**2, axis=1) / craft.mass_kg
    plain = record.gust - lift[:, None] * record.rotation[:, :, 2] + np.array([0.0, 0.0, GRAVITY_M_S2])
    turn = record.levelling / craft.inertia_kg_m2 * craft.arm_m
    return np.column_stack([record.acceleration - plain, turn, np.tile(bias(flight), (len(lift), 1))])


def bias(flight: Flight) -> Array:
    """Hidden bias of the accelerometers."""
    return np.array([flight.parameter("imu_bias", axis) for axis in "xyz"])


def effect_rms(case: Case, flights: Sequence[Flight], records: Sequence[Record]) -> float:
    """Root mean square of the hidden acceleration over all flights."""
    if not case.effects:
        return 0.0
    parts = [hidden_acceleration(case, f, r) for f, r in zip(flights, records, strict=True)]
    return float(np.sqrt(np.mean(np.sum(np.concatenate(parts) ** 2, axis=1))))


def flaw(case: Case, flight: Flight, record: Record) -> str | None:
    """Reason why a flight is no good: lost, saturated, astray, or through the ground or the ceiling."""
    if not all(np.isfinite(part).all() for part in (record.position, record.rotation, record.rpm)):
        return "lost"
    radius, plane = flight.craft.kind.radius_m, -record.position[:, 2] + flight.craft.rotor_height_m
    if plane.min() < 0.45 * radius:
        return f"touches the ground at {plane.min() / radius:.2f} radii"
    if case.ceiling_m is not None and case.ceiling_m - plane.max() < 0.25 * radius:
        return "touches the ceiling"
    if record.rotation[:, 2, 2].min() < 0.5:
        return "leans by more than 60 degrees"
    if record.saturated > 0.01:
        return f"saturates for {record.saturated:.1%}"
    path = flight.reference.position[round(SETTLE_S / STEP_S) :]
    rows = np.minimum((np.arange(len(record.position)) * TICK_S / STEP_S).astype(int), len(path) - 1)
    away = np.linalg.norm(record.position * np.array([1.0, -1.0, -1.0]) - path[rows], axis=1).max()
    return f"strays by {away:.1f} m" if away > 0.8 + 0.4 * float(np.max(np.ptp(path, axis=0))) else None


def write_log(path: Path, columns: Columns) -> None:
    """Write a log as CSV."""
    formats = ["%.1f" if n.endswith("_rpm") else "%.3f" if n.endswith(("_v", "_deg")) else "%.5f" for n in columns]
    rows = np.column_stack(list(columns.values()))
    np.savetxt(path, rows, fmt=",".join(formats), header=",".join(columns), comments="")


def flaws_of(case: Case, craft: Craft, rng: np.random.Generator) -> list[Flaws]:
    """Flaws of the records of all flights of a case."""
    by_voltage = "thrust_map" in case.effects
    radius_m = craft.kind.radius_m
    return draw_flaws(len(case.missions), outdoors=case.outdoors, radius_m=radius_m, by_voltage=by_voltage, rng=rng)


def measured_by_more(case: Case, rng: np.random.Generator) -> Case:
    """Case with accelerometers in most logs, and in all without rotor speeds: a pose that is late would else be a late
    motor."""
    return replace(case, imu=case.imu or case.source != "speeds" or rng.random() < IMU_SHARE)


def make_case(
    simulator: type[Simulator],
    case: Case,
    strengths: Sequence[float],
    seed: int,
    folders: Sequence[Path],
    wrong_records: bool = False,
) -> str:
    """Fly a case at all strengths, drawn anew while it is no good, and write its folders; returns what was done."""
    for attempt in range(ATTEMPTS):
        key = (seed, zlib.crc32(case.name.encode()), attempt)
        rng = np.random.default_rng([*key, 0])
        bad = np.random.default_rng([*key, BAD_RECORDS])
        case = measured_by_more(case, bad) if wrong_records else case
        craft = draw_craft(case.kind, simulator.kinds[case.kind], rng)
        kit = equip(case.outdoors, case.source, case.imu, case.quick, rng)
        plain = draw_flights(case, craft, rng)
        flights = [replace(flight, strength=strength) for strength in strengths for flight in plain]
        records = fly(simulator, flights)
        wrong = [flaw(case, flight, record) for flight, record in zip(flights, records, strict=True)]
        if not any(wrong):
            break
        print(f"{case.name}: drawn anew, {next(filter(None, wrong))}", file=sys.stderr)
    else:
        return f"{case.name}: dropped"
    sizes, flaws = [], flaws_of(case, craft, bad) if wrong_records else []
    field = int(bad.integers(2**32))
    for i, (strength, out) in enumerate(zip(strengths, folders, strict=True)):
        mine = slice(i * len(plain), (i + 1) * len(plain))
        folder = out / case.name
        folder.mkdir(parents=True, exist_ok=True)
        content = vehicle_file(craft, case.states_lag, case.ceiling_m)
        (folder / "vehicle.yaml").write_text(yaml.safe_dump(content, sort_keys=False))
        for number, (flight, record) in enumerate(zip(flights[mine], records[mine], strict=True), start=1):
            columns, _ = log_columns(record, bias(flight), craft, kit, np.random.default_rng([*key, number]))
            if flaws:
                again = np.random.default_rng([*key, BAD_RECORDS, number])
                columns = distorted(columns, flaws[number - 1], field, again)
            write_log(folder / f"flight{number}.csv", columns)
        sizes.append(effect_rms(case, flights[mine], records[mine]))
        truth = {
            "case": case.name,
            "families": case.families,
            "indistinguishable": [],
            "effect_rms_m_s2": float(f"{sizes[-1]:.4g}"),
            "parameters": {name: dict(values) for name, values in case.effects.items()},
            "strength": strength,
        }
        if flaws:
            also = [family for family in flaws[0].also if case.imu or family != "imu_bias"]
            truth |= {"also": also, "records": [each.content() for each in flaws]}
        (folder / "truth.json").write_text(json.dumps(truth, indent=1))
    return f"{case.name}: {' + '.join(case.families) or 'nothing'}, {', '.join(f'{s:.2f}' for s in sizes)} m/s^2"


def main() -> None:
    """Read the arguments and fly."""
    parser = argparse.ArgumentParser(prog="python -m studies.worlds.borrowed", description=__doc__)
    parser.add_argument("world", choices=sorted(WORLDS))
    parser.add_argument("--out", type=Path, required=True, help="folder to write")
    parser.add_argument("--strength", type=float, nargs="+", default=[1.0, 0.5, 0.3], help="factors on all effects")
    parser.add_argument("--seed", type=int, default=1, help="seed of all random numbers")
    parser.add_argument("--records", choices=["ordinary", "wrong"], default="ordinary", help="state of the logs")
    parser.add_argument("--only", default="", help="only the cases whose name begins so")
    arguments = parser.parse_args()
    cases = [case for case in WORLDS[arguments.world] if case.name.startswith(arguments.only)]
    if not cases:
        parser.error(f"no case begins with {arguments.only}")
    wrong = arguments.records == "wrong"
    title = f"{arguments.world}{'_wrong_records' * wrong}_{arguments.seed}"
    folders, simulator = [arguments.out / f"{title}_{s:g}" for s in arguments.strength], SIMULATORS[arguments.world]
    for case in cases:
        print(make_case(simulator, case, arguments.strength, arguments.seed, folders, wrong), flush=True)


if __name__ == "__main__":
    main()
