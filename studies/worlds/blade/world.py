"""World: folders of cases, each with its vehicle file, its logs and its truth."""

import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from studies.worlds.blade.alternatives import alike, motion, visible
from studies.worlds.blade.cases import RECIPES, Case, draw_case
from studies.worlds.blade.flight import Recording, fly
from studies.worlds.blade.logs import tabulate, write_log
from studies.worlds.blade.rotation import Array, conjugate, multiply, to_vector
from studies.worlds.blade.vehicles import write_vehicle

BATCH = 200
"""Flights that are flown at once; a bound of memory."""
ATTEMPTS = 8


def write_world(out: Path, names: list[str], seed: int, strength: float, duration: float | None = None) -> list[Case]:
    """Cases of these names, flown and written; one with a flight that crashes is drawn again."""
    waiting, done = [RECIPES[name] for name in names], []
    for attempt in range(ATTEMPTS):
        cases = [draw_case(recipe, seed, attempt, strength, duration) for recipe in waiting]
        waiting = []
        for batch in _batches(cases):
            recordings = iter(fly([flight for case in batch for flight in case.flights]))
            for case in batch:
                flown = [next(recordings) for _ in case.flights]
                failures = [r.failure for r in flown if r.failure]
                if failures:
                    print(f"{case.recipe.name}, attempt {attempt + 1}: {'; '.join(failures)}")
                    waiting.append(case.recipe)
                else:
                    write_case(out / case.recipe.name, case, flown, seed, strength)
                    done.append(case)
        if not waiting:
            return done
    raise RuntimeError("these cases crash whatever is drawn: " + ", ".join(recipe.name for recipe in waiting))


def _batches(cases: list[Case]) -> list[list[Case]]:
    batches: list[list[Case]] = [[]]
    for case in cases:
        if batches[-1] and sum(len(c.flights) for c in batches[-1]) + len(case.flights) > BATCH:
            batches.append([])
        batches[-1].append(case)
    return batches


def write_case(folder: Path, case: Case, recordings: list[Recording], seed: int, strength: float) -> None:
    """Folder of one case."""
    folder.mkdir(parents=True, exist_ok=True)
    for old in folder.glob("flight*.csv"):
        old.unlink()
    families = [family for family, _ in case.recipe.hidden]
    write_vehicle(folder / "vehicle.yaml", case.vehicle, with_lag="motor_lag" not in families)
    for i, (flight, recording) in enumerate(zip(case.flights, recordings, strict=True), 1):
        rng = np.random.default_rng([flight.seed, 99])
        write_log(folder / f"flight{i}.csv", tabulate(rng, flight, case.recorder, recording))
    content = truth(case, recordings, seed, strength)
    (folder / "truth.json").write_text(json.dumps(content, indent=1, default=float) + "\n", encoding="utf-8")


def _rms(parts: list[Any]) -> float:
    whole = np.concatenate([np.asarray(part, float) for part in parts])
    return round(float(np.sqrt((whole**2).sum(-1).mean())), 4)


def _turned(estimate: Array, true: Array) -> Array:
    """Rotation from the true attitude to the estimate, degrees."""
    return np.degrees(to_vector(multiply(conjugate(true.astype(float)), estimate.astype(float))))


def truth(case: Case, recordings: list[Recording], seed: int, strength: float) -> dict[str, Any]:
    """Truth of a case: its families, what is alike in these flights, sizes, and how it was flown."""
    families = tuple(family for family, _ in case.recipe.hidden)
    first, vehicle = case.flights[0], case.vehicle
    tapes = [r.columns for r in recordings]
    moved = motion(case.flights, recordings)
    size = _rms([tape["effect"] for tape in tapes])
    moment = _rms([tape["effect_moment"] for tape in tapes])
    if "imu_bias" in families:
        bias = next(e.values["bias_m_s2"] for e in first.effects if e.family == "imu_bias")
        size = round(float(np.linalg.norm(bias)), 4)
    if families == ("ground_torque",):
        size = round(moment / (vehicle.mass * vehicle.arm), 4)
    return {
        "families": list(families),
        "indistinguishable": alike(moved, families, tuple(form for _, form in case.recipe.hidden)) if families else [],
        "effect_rms_m_s2": size if families else 0.0,
        "effect_moment_rms_n_m": moment,
        "visible_m_s2": visible(moved, families),
        "strength": strength,
        "seed": seed,
        "attempt": case.attempt,
        "effects": [[{"family": e.family, "form": e.form, **e.values} for e in f.effects] for f in case.flights],
        "missions": [asdict(demand) for demand in case.demands],
        "rotor_speeds": first.source,
        "time_offsets_s": {
            "rotor_speeds_late": case.recorder.rotor_delay if first.source == "measured" else 0.0,
            "command_to_motor": first.command_delay * 0.005,
            "position_sensor": first.suite.delay,
            "position_sensor_as_believed": first.suite.believed_delay,
        },
        "motor_time_constant_s": vehicle.time_constant,
        "copy": asdict(first.copy),
        "sensors": asdict(first.suite),
        "controller": {"kind": ("cascade", "geometric", "person")[first.tuning.kind], **asdict(first.tuning)},
        "recorder": asdict(case.recorder),
        "packs": [asdict(f.pack) for f in case.flights],
        "estimate_error_rms": {
            "velocity_m_s": _rms([t["velocity"] - t["true_velocity"] for t in tapes]),
            "position_m": _rms([t["position"] - t["true_position"] for t in tapes]),
            "attitude_deg": _rms([_turned(t["attitude"], t["true_attitude"]) for t in tapes]),
            "tilt_deg": _rms([_turned(t["attitude"], t["true_attitude"])[:, :2] for t in tapes]),
        },
        "light_air_m_s2": [f.light_air for f in case.flights],
        "rest_of_physics_m_s2": size if not families else None,
    }
