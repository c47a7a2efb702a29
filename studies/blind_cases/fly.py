"""Fly one hidden case: logs as a user has them, and, apart from them, what the truths did, for the judge alone."""

import hashlib
import random
from pathlib import Path
from typing import NamedTuple

import numpy as np

import quadctl.sitl.rules.px4
import quadctl.sitl.vehicle.body
import quadctl.sitl.vehicle.estimator
import quadctl.sitl.vehicle.inner_loops
from quadctl.compensator import Compensator
from quadctl.flight.pilot.outcome import COMPLETED
from quadctl.flight.pilot.pilot import Pilot
from quadctl.flight.pilot.settings import load_flight_settings
from quadctl.flight.pilot.tick import Tick
from quadctl.flight.record.recorder import header, row
from quadctl.logs.columns import PHASE_COLUMN, motor_columns, rpm_columns
from quadctl.logs.csv_log import write_csv
from quadctl.logs.flight_log import FlightLog, Floats
from quadctl.missions import load_mission
from quadctl.model import Model
from quadctl.sitl.rules.px4 import SimulatedAutopilot
from quadctl.sitl.run import fly_lockstep
from quadctl.vehicle import Vehicle, load_vehicle

from .cases import HERE, Case, truth_kinds
from .nuisances import IMU_NOISE_M_S2, Nuisances
from .truths_vehicle import ShiftedAccelerometer
from .world import HiddenBody, Truth

NO_PART_OF_FLIGHT = ("cases", "judge", "scoreboard", "test_hidden")
IMU_COLUMNS = ("imu_x_m_s2", "imu_y_m_s2", "imu_z_m_s2")


class FlownCase(NamedTuple):
    """Files of one case: the logs that may be analysed, the one kept back, and the judge's."""

    seen: list[Path]
    unseen: Path
    truth: Path
    """Time and acceleration by the truths (north, east, up) of the unseen flight, .npz."""


def truths_of(case: Case, vehicle: Vehicle) -> list[Truth]:
    """The truths of a case, with what they leave to chance drawn from its seed."""
    return [kind(vehicle, case.strength, random.Random(f"{kind.__name__} {case.seed}")) for kind in truth_kinds(case)]


def fly_case(case: Case, folder: Path) -> FlownCase:
    """Fly all missions of a case; what was flown before is not flown again."""
    where = folder / str(case.seed)  # a name that gives nothing away
    paths = [where / f"{i + 1}_{mission}.csv" for i, mission in enumerate(case.missions)]
    flown = FlownCase(paths[:-1], paths[-1], where / "judge.npz")
    if not all(path.exists() for path in (*paths, flown.truth)):
        where.mkdir(parents=True, exist_ok=True)
        for i, path in enumerate(paths):
            log, effect = fly(case, i)
            write_csv(log, path)
        np.savez_compressed(flown.truth, time_s=effect[:, 0], acceleration=effect[:, 1:])
    return flown


def fly(case: Case, number: int) -> tuple[FlightLog, Floats]:
    """One flight of a case: its log, and (time, acceleration by the truths north, east, up) per tick."""
    vehicle = load_vehicle(case.vehicle_path)
    settings = load_flight_settings(HERE / "flight.yaml")
    mission = load_mission(HERE / "missions" / f"{case.missions[number]}.yaml")
    nuisances = Nuisances.draw(vehicle.n_rotors, case.seed, number)
    truths = truths_of(case, vehicle)
    autopilot = SimulatedAutopilot(vehicle)
    body = HiddenBody(vehicle, truths, nuisances)
    body.from_outputs = body.from_outputs or case.outputs_only
    autopilot.body = body
    autopilot.estimator = nuisances.estimator()
    autopilot.estimator.observe(body.motion())
    pilot = Pilot(mission, Model(vehicle), settings, Compensator(Model(vehicle), settings.compensator_limits))
    chance = random.Random(f"imu {nuisances.seed}")
    bias = [
        b + sum(t.bias[i] for t in truths if isinstance(t, ShiftedAccelerometer))
        for i, b in enumerate(nuisances.imu_bias_m_s2)
    ]
    rows: list[list[float | str]] = []
    effects: list[tuple[float, ...]] = []

    def listen(tick: Tick) -> None:
        effect, specific = body.means()
        imu = [value + b + chance.gauss(0.0, IMU_NOISE_M_S2) for value, b in zip(specific, bias, strict=True)]
        rows.append([*row(tick, vehicle.n_rotors), *imu, *autopilot.outputs])
        effects.append((tick.time_s, effect[0], effect[1], -effect[2]))

    fly_lockstep(autopilot, pilot, settings.controller.rate_hz, [listen])
    if pilot.ended != COMPLETED:
        raise RuntimeError(f"{case.name}: mission {mission.name} ended early: {pilot.ended}")
    log = _log(f"{number + 1}_{mission.name}.csv", rows, vehicle, case.imu, body.from_outputs)
    return nuisances.with_lost_samples(log), np.array(effects)


def generator_digest() -> str:
    """Of everything that a flight is made by: flights of another generator are not mixed with these."""
    sources = [p for p in sorted(HERE.rglob("*")) if p.suffix in (".py", ".yaml") and p.stem not in NO_PART_OF_FLIGHT]
    sources += [
        Path(module.__file__ or "")
        for module in (
            quadctl.sitl.vehicle.body,
            quadctl.sitl.rules.px4,
            quadctl.sitl.vehicle.estimator,
            quadctl.sitl.vehicle.inner_loops,
        )
    ]
    return hashlib.sha256(b"".join(path.read_bytes() for path in sources)).hexdigest()[:10]


def _log(name: str, rows: list[list[float | str]], vehicle: Vehicle, imu: bool, outputs_only: bool) -> FlightLog:
    names = [*header(vehicle.n_rotors), *IMU_COLUMNS, *motor_columns(vehicle.n_rotors, "output")]
    values = dict(zip(names, zip(*rows, strict=True), strict=True))
    phase = np.array(values.pop(PHASE_COLUMN), dtype=np.str_)
    left_out = set(motor_columns(vehicle.n_rotors, "voltage_v") + motor_columns(vehicle.n_rotors, "current_a"))
    left_out |= set() if imu else set(IMU_COLUMNS)
    left_out |= set(rpm_columns(vehicle.n_rotors) if outputs_only else motor_columns(vehicle.n_rotors, "output"))
    columns = {key: np.round(np.array(v, dtype=float), 7) for key, v in values.items() if key not in left_out}
    return FlightLog(name, None, columns, phase)
