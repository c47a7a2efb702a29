"""Specification of what the source of an attitude means: a motion capture may be off by degrees, an estimator not.

The flights hover and bob at a heading of 50 degrees. Roll and pitch are those by which the vehicle leans more than its
log says.
"""

from dataclasses import replace

import numpy as np
import pytest

from quadctl.effects.imu_bias import ConstantBias
from quadctl.effects.thrust_tilt import FixedTilt
from quadctl.errors import LogError
from quadctl.frames import (
    GRAVITY_M_S2,
    Quaternion,
    euler_from_quaternion,
    multiply,
    quaternion_from_euler,
    rotate_inverse,
)
from quadctl.lab.finding import Kind
from quadctl.lab.fitting.nuisances import (
    FORCES,
    KINDS,
    bounds,
    nuisance_jacobian,
    predicted_with,
    prior_std,
)
from quadctl.lab.flights.dataset import load_dataset
from quadctl.lab.flights.prediction import predict_targets
from quadctl.lab.selection.diagnosis import Diagnosis, diagnose
from quadctl.logs.flight_log import ATTITUDE, IMU, FlightLog
from quadctl.model import Model
from quadctl.vehicle import RotorPlace, Vehicle
from tests.support.flights import obedient

ROLL_DEG, PITCH_DEG = 1.4, -0.9
CAPTURED = {"attitude_by": "motion_capture"}
HEADING = quaternion_from_euler(0.0, 0.0, np.radians(50.0))
PAIR = (FixedTilt, ConstantBias)
UPRIGHT: Quaternion = (1.0, 0.0, 0.0, 0.0)


def lean(roll_deg: float, pitch_deg: float) -> Quaternion:
    return quaternion_from_euler(np.radians(roll_deg), np.radians(pitch_deg), 0.0)


def flown(
    vehicle: Vehicle, off: Quaternion, meta: dict[str, str], leant: Quaternion = UPRIGHT, imu: bool = True
) -> FlightLog:
    """A flight whose vehicle leans by `leant`, with vertical thrust, and by `off` more than its attitude says."""
    log = obedient(Model(vehicle), 60.0, noise_m_s=0.005)
    true = multiply(HEADING, leant)
    w, x, y, z = off
    logged = np.degrees(euler_from_quaternion(multiply(true, (w, -x, -y, -z))))
    random, columns = np.random.default_rng(3), dict(log.columns)
    for name, value in zip(ATTITUDE, logged, strict=True):
        columns[name] = value + 0.01 * random.standard_normal(len(log))
    up_m_s2 = np.gradient(obedient(Model(vehicle), 60.0)["vz_m_s"], log.time_s)
    force = rotate_inverse(true, (0.0 * up_m_s2, 0.0 * up_m_s2, -GRAVITY_M_S2 - up_m_s2))
    if imu:
        columns |= {n: f + 0.02 * random.standard_normal(len(log)) for n, f in zip(IMU, force, strict=True)}
    return replace(log, columns=columns, meta=meta)


def found(vehicle: Vehicle, log: FlightLog) -> Diagnosis:
    return diagnose(Model(vehicle), load_dataset([log], vehicle), PAIR)


def test_an_attitude_of_a_motion_capture_that_is_off_is_a_finding_and_no_effect(raptor: Vehicle) -> None:
    diagnosis = found(raptor, flown(raptor, lean(ROLL_DEG, PITCH_DEG), CAPTURED))
    assert diagnosis.missing == []
    (said,) = [f for f in diagnosis.notes if f.kind is Kind.ATTITUDE_OFF]
    assert said.facts["flights"]["made.csv"] == pytest.approx({"roll_deg": ROLL_DEG, "pitch_deg": PITCH_DEG}, abs=0.1)
    assert said.facts["largest_deg"] == pytest.approx(np.hypot(ROLL_DEG, PITCH_DEG), abs=0.1)
    assert "off by up to 1.7° (made.csv: roll +1.4°, pitch -0.9°)" in "\n".join(diagnosis.lines())


@pytest.mark.parametrize("meta", [{}, {"attitude_by": "estimator"}])
def test_of_another_source_it_is_a_tilt_that_is_not_told_from_a_bias(raptor: Vehicle, meta: dict[str, str]) -> None:
    diagnosis = found(raptor, flown(raptor, lean(ROLL_DEG, PITCH_DEG), meta))
    assert sorted(diagnosis.missing) == ["imu_bias", "thrust_tilt"]
    assert ["imu_bias", "thrust_tilt"] in diagnosis.confounded
    assert not any(f.kind is Kind.ATTITUDE_OFF for f in diagnosis.notes)


def test_a_tilted_thrust_that_the_accelerometer_sees_is_named_beside_a_motion_capture(raptor: Vehicle) -> None:
    diagnosis = found(raptor, flown(raptor, UPRIGHT, CAPTURED, leant=lean(1.8, -1.5)))
    assert diagnosis.missing == ["thrust_tilt"]
    (tilt,) = diagnosis.best.effects
    assert tilt.values() == pytest.approx({"roll_deg": -1.8, "pitch_deg": 1.5}, abs=0.15)


def test_without_an_accelerometer_it_may_be_either(raptor: Vehicle) -> None:
    diagnosis = found(raptor, flown(raptor, lean(ROLL_DEG, PITCH_DEG), CAPTURED, imu=False))
    assert diagnosis.missing == []
    (said,) = [f for f in diagnosis.notes if f.kind is Kind.ATTITUDE_OR_TILT]
    assert said.facts["largest_deg"] == pytest.approx(np.hypot(ROLL_DEG, PITCH_DEG), abs=0.1)


def test_the_trim_turns_force_and_accelerometer_together(raptor: Vehicle) -> None:
    """The accelerometer's force, turned by a wrong attitude, is off by as much as the predicted one, the other way."""
    data = load_dataset([flown(raptor, UPRIGHT, CAPTURED, leant=lean(4.0, 3.0))], raptor)
    (flight,), groups, model = data.flights, ("total", "sensing"), Model(raptor)
    nuisance = np.zeros(len(KINDS))
    nuisance[1:3] = np.radians([0.8, 0.5])
    change = predicted_with(model, flight, nuisance, groups) - predict_targets(model, flight, groups)
    assert np.linalg.norm(change[:, :2], axis=1).min() > 0.1
    assert change[:, 3:5] == pytest.approx(-change[:, :2], abs=0.01)
    linear = nuisance_jacobian(model, flight, groups, predict_targets(model, flight, groups)) @ nuisance
    assert linear == pytest.approx(change, abs=0.01)


def test_an_unknown_source_is_refused_with_those_that_are_known(raptor: Vehicle) -> None:
    with pytest.raises(LogError, match="attitude_by in its meta file is 'gps', expected motion_capture or estimator"):
        load_dataset([flown(raptor, UPRIGHT, {"attitude_by": "gps"})], raptor)


def test_bounds_are_those_of_the_flight(raptor: Vehicle) -> None:
    """Trims are wide beside a motion capture; moments of a vehicle with short arms are those of 2 mm."""
    estimated, captured = (load_dataset([flown(raptor, UPRIGHT, meta)], raptor).flights[0] for meta in ({}, CAPTURED))
    assert np.degrees(bounds(estimated)[1][1:3]) == pytest.approx([0.8, 0.8])
    assert np.degrees(bounds(captured)[1][1:3]) == pytest.approx([5.0, 5.0])
    assert np.degrees(prior_std(captured)[1:3]) == pytest.approx([1.5, 1.5])
    assert bounds(captured)[1][FORCES:] == pytest.approx([0.04, 0.04, 0.04])
    arms = [
        RotorPlace(position_m=tuple(0.25 * x for x in place.position_m), spin=place.spin) for place in raptor.rotors
    ]
    short = replace(estimated, vehicle=raptor.model_copy(update={"rotors": tuple(arms)}))
    # Arms of 31 mm: four rotors of W/4 each, (4 (W/4)^2 arm^2)^(1/2) = W arm / 2
    assert bounds(short)[1][FORCES:] == pytest.approx([0.002 / 0.0155, 0.002 / 0.0155, 0.04])
    assert bounds(short)[0][FORCES:] == pytest.approx([-0.002 / 0.0155, -0.002 / 0.0155, -0.04])
