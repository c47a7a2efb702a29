"""Judge one case: the lab gets its logs and the vehicle's file, and what it says is held against the truth."""

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from quadctl.frames import euler_from_quaternion
from quadctl.lab.flights.dataset import Dataset, load_dataset
from quadctl.lab.flights.prediction import rmse
from quadctl.lab.selection.diagnosis import Diagnosis, diagnose
from quadctl.logs.read import read_logs
from quadctl.model import Model, load_model
from quadctl.vehicle import load_vehicle

from .cases import Case
from .fly import FlownCase, fly_case, truths_of
from .nuisances import Nuisances

NO_FORCE_TO_COMPARE = ("motor_lag", "imu_bias", "ground_torque", "airspeed_moment")
"""Families whose truth is no acceleration: there the error left has nothing to be compared with."""


@dataclass(frozen=True)
class Result:
    """Verdict of the lab on one case."""

    case: Case
    verdict: str
    missing: list[str]
    effects: list[str]
    """The model's effects with their parameters, in words."""
    seconds: float
    """Processor time from the files to the verdict."""
    error_left: float | None
    """Error of the found model divided by that of the true one, on the flight that no fit saw."""
    covered: list[bool]
    """True for each true parameter that lies in its 95 % interval, for truths that the catalogue holds too."""
    problem: str = ""
    """Reason why there is no verdict."""
    small: tuple[str, ...] = ()
    """Families that are measured, but small, in the order of adding."""

    @property
    def right(self) -> bool:
        if self.case.kind == "nameless":
            return not self.missing and not self.small and not self.problem
        if self.case.kind in ("none", "unexplained"):
            return self.verdict == self.case.kind and not self.missing
        n = len(self.case.families)
        first, rest = self.missing[:n], self.missing[n:]
        return sorted(first) == sorted(self.case.families) and set(rest) <= self.case.also

    @property
    def right_but_small(self) -> bool:
        """True where nothing is called missing, and what is hidden comes first of what is small."""
        hidden = sorted(self.case.families)
        return self.verdict == "small" and sorted(self.small[: len(hidden)]) == hidden


def blind(vehicle: Path, logs: Sequence[Path]) -> Diagnosis:
    """All that the lab is told: the vehicle's file and the logs."""
    model = load_model(vehicle)
    diagnosis: Diagnosis = diagnose(model, load_dataset(read_logs(logs), model.vehicle))
    return diagnosis


def judge(case: Case, folder: Path) -> Result:
    """Fly a case (or take what was flown), have it diagnosed, and compare with the truth."""
    began = time.process_time()
    try:
        flown = fly_case(case, folder)
        began = time.process_time()
        diagnosis = blind(case.vehicle_path, flown.seen)
    except Exception as error:  # what breaks a flight or the lab is a wrong case, not the end of the scoreboard
        return Result(case, "error", [], [], time.process_time() - began, None, [], f"{type(error).__name__}: {error}")
    seconds = time.process_time() - began
    words = [f"{e.name}({', '.join(f'{k}={v:.3g}' for k, v in e.values().items())})" for e in diagnosis.best.effects]
    left = error_left(case, flown, diagnosis.best)
    small = tuple(group[0].family for group in diagnosis.small)
    inside = covered(case, diagnosis)
    return Result(case, diagnosis.verdict, list(diagnosis.missing), words, seconds, left, inside, small=small)


def error_left(case: Case, flown: FlownCase, found: Model) -> float | None:
    """RMSE of the model found over that of the rigid body with the truth's own acceleration, on the unseen flight."""
    if case.kind in ("none", "unexplained", "nameless") or set(case.families) & set(NO_FORCE_TO_COMPARE):
        return None
    rigid = Model(found.vehicle)
    data: Dataset = load_dataset(read_logs([flown.unseen]), found.vehicle)
    truth = np.load(flown.truth)
    delay_s = Nuisances.draw(found.vehicle.n_rotors, case.seed).delay_s
    (flight,) = data.flights
    true = [
        flight.filtered(np.interp(flight.grid_s - delay_s, truth["time_s"], component))
        for component in truth["acceleration"].T
    ]
    best = rmse(data.aligned_for(rigid).residual(rigid)[:, :3] - np.column_stack(true))["total"]
    return rmse(data.aligned_for(found).residual(found)[:, :3])["total"] / best


def covered(case: Case, diagnosis: Diagnosis) -> list[bool]:
    """Tell for each true parameter of the missing effects whether its interval holds it, where the catalogue has it."""
    expected = true_parameters(case)
    found = []
    for candidate in diagnosis.ranking:
        if candidate.family not in diagnosis.missing:
            continue
        for name, value in expected.get(candidate.effect.name, {}).items():
            if name in candidate.ci95:
                low, high = candidate.ci95[name]
                found.append(low <= value <= high)
    return found


def true_parameters(case: Case) -> dict[str, dict[str, float]]:
    """In the catalogue's words and as the data hold them: with the set-up's own errors where these act the same way."""
    vehicle = load_vehicle(case.vehicle_path)
    nuisances = Nuisances.draw(vehicle.n_rotors, case.seed)
    expected: dict[str, dict[str, float]] = {}
    for truth in truths_of(case, vehicle):
        expected |= truth.parameters()
    scale = sum(nuisances.rotor_coefficients) / vehicle.n_rotors
    if "thrust_scale.constant" in expected:
        expected["thrust_scale.constant"]["factor"] *= scale
    if "thrust_tilt.fixed" in expected:
        roll, pitch, _ = euler_from_quaternion(nuisances.attitude_bias)
        expected["thrust_tilt.fixed"]["roll_deg"] -= math.degrees(roll)
        expected["thrust_tilt.fixed"]["pitch_deg"] -= math.degrees(pitch)
    if "rotor_fault.weak" in expected:
        weak = expected["rotor_fault.weak"]
        weak["loss"] = 1.0 - (1.0 - weak["loss"]) * nuisances.rotor_coefficients[round(weak["rotor"]) - 1] / scale
    return expected
