"""Specification of what the source of an attitude means: a motion capture may be off by degrees, an estimator not.

The flights hover and bob at a heading of 50 degrees. Roll and pitch are those by which the vehicle leans more than its
log says.
"""

from dataclasses import replace

import numpy as np
import pytest

from quadctl.effects.imu_bias import ConstantBias
from quadctl.effects.rotor_drag import LinearDrag
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
from quadctl.lab.fitting.fitted_model import fit_model
from quadctl.lab.fitting.nuisances import CAPTURED, KINDS, MOMENTS, bounds, nuisance_jacobian, predicted_with
from quadctl.lab.flights.dataset import Dataset, load_dataset
from quadctl.lab.flights.prediction import predict, predict_targets
from quadctl.lab.selection.diagnosis import Diagnosis, diagnose
from quadctl.logs.columns import rpm_columns
from quadctl.logs.findings import Kind as RecordKind
from quadctl.logs.findings import of_kind
from quadctl.logs.flight_log import ATTITUDE, IMU, FlightLog
from quadctl.model import Model
from quadctl.vehicle import Vehicle
from tests.support.flights import obedient

ROLL_DEG, PITCH_DEG = 1.4, -0.9
CAPTURED_META = {"attitude_by": "motion_capture"}
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
    diagnosis = found(raptor, flown(raptor, lean(ROLL_DEG, PITCH_DEG), CAPTURED_META))
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
    diagnosis = found(raptor, flown(raptor, UPRIGHT, CAPTURED_META, leant=lean(1.8, -1.5)))
    assert diagnosis.missing == ["thrust_tilt"]
    (tilt,) = diagnosis.best.effects
    assert tilt.values() == pytest.approx({"roll_deg": -1.8, "pitch_deg": 1.5}, abs=0.15)


def test_without_an_accelerometer_it_may_be_either(raptor: Vehicle) -> None:
    diagnosis = found(raptor, flown(raptor, lean(ROLL_DEG, PITCH_DEG), CAPTURED_META, imu=False))
    assert diagnosis.missing == []
    (said,) = [f for f in diagnosis.notes if f.kind is Kind.ATTITUDE_OR_TILT]
    # By their priors, 0.4 and 1.5 degrees, 7 % of it are the trim that any vehicle has.
    assert said.facts["largest_deg"] == pytest.approx(0.93 * np.hypot(ROLL_DEG, PITCH_DEG), abs=0.1)


def test_the_trim_turns_force_and_accelerometer_together(raptor: Vehicle) -> None:
    """Beside a force told by the velocity the accelerometer's, turned by a wrong attitude, is off by as much as the
    predicted one, the other way."""
    (flight,) = load_dataset([flown(raptor, UPRIGHT, CAPTURED_META, leant=lean(4.0, 3.0))], raptor).flights
    flight = replace(flight, measured=flight.motion, trajectory=None)
    groups, model = ("total", "sensing"), Model(raptor)
    nuisance = np.zeros(len(KINDS))
    nuisance[CAPTURED] = np.radians([0.8, 0.5])
    change = predicted_with(model, flight, nuisance, groups) - predict_targets(model, flight, groups)
    assert np.linalg.norm(change[:, :2], axis=1).min() > 0.1
    assert change[:, 3:5] == pytest.approx(-change[:, :2], abs=0.01)
    linear = nuisance_jacobian(model, flight, groups, predict_targets(model, flight, groups)) @ nuisance
    assert linear == pytest.approx(change, abs=0.01)


def test_an_unknown_source_is_refused_with_those_that_are_known(raptor: Vehicle) -> None:
    with pytest.raises(LogError, match="attitude_by in its meta file is 'gps', expected motion_capture or estimator"):
        load_dataset([flown(raptor, UPRIGHT, {"attitude_by": "gps"})], raptor)


def test_moments_of_short_arms_are_those_of_a_centre_of_mass_that_is_two_millimetres_off(raptor: Vehicle) -> None:
    (flight,) = load_dataset([flown(raptor, UPRIGHT, CAPTURED_META)], raptor).flights
    assert bounds(flight)[1][MOMENTS] == pytest.approx([0.04, 0.04, 0.04])
    arms = tuple(
        place.model_copy(update={"position_m": tuple(0.25 * x for x in place.position_m)}) for place in raptor.rotors
    )
    short = replace(flight, vehicle=raptor.model_copy(update={"rotors": arms}))
    # Arms of 31 mm: four rotors of W/4 each, (4 (W/4)^2 arm^2)^(1/2) = W arm / 2
    assert bounds(short)[1][MOMENTS] == pytest.approx([0.002 / 0.0155, 0.002 / 0.0155, 0.04])
    assert bounds(short)[0][MOMENTS] == pytest.approx([-0.002 / 0.0155, -0.002 / 0.0155, -0.04])


class TestForceByTheAccelerometer:
    def test_of_a_captured_flight_it_is_the_target_and_the_velocity_its_check(self, raptor: Vehicle) -> None:
        log = flown(raptor, lean(ROLL_DEG, PITCH_DEG), CAPTURED_META)
        (flight,) = load_dataset([log], raptor).flights
        assert flight.sensed is not None and flight.trajectory is not None and flight.imu_error is not None
        later = flight.with_velocity_lag(0.03)
        for one in (flight, later):
            np.testing.assert_array_equal(one.measured, one.sensed)
            assert one.imu_error == pytest.approx(flight.sensed - one.motion)
        assert np.abs(later.motion - flight.motion).max() > 0.01
        assert any(said.kind is RecordKind.FORCE_BY_ACCELEROMETER for said in flight.findings)

    @pytest.mark.parametrize(("meta", "factor"), [({"attitude_by": "estimator"}, 1.0), ({}, 1.0), (CAPTURED_META, 1.1)])
    def test_not_of_an_estimator_nor_where_it_measures_another_weight(
        self, raptor: Vehicle, meta: dict[str, str], factor: float
    ) -> None:
        log = flown(raptor, UPRIGHT, meta)
        log = replace(log, columns=log.columns | {name: factor * log[name] for name in IMU})
        (flight,) = load_dataset([log], raptor).flights
        assert flight.trajectory is None and flight.sensed is not None
        assert np.abs(flight.measured - flight.sensed).max() > 1e-3

    def test_an_attitude_that_is_off_by_place_does_not_forbid_it(self, raptor: Vehicle) -> None:
        log = runs(raptor, 0.0)
        wrong = 2.0 * np.sin(log["x_m"] / 0.4 + 0.3)
        log = replace(log, columns=log.columns | {"pitch_deg": log["pitch_deg"] + wrong})
        (flight,) = load_dataset([log], raptor).flights
        assert [f.figures["odd"] for f in of_kind(flight.findings, RecordKind.WITNESSES_DISAGREE)] == ["attitude"]
        assert flight.tells_force and flight.doubted_axes == ()

    def test_where_the_velocity_is_doubted_along_an_axis_a_bias_is_found_nevertheless(self, raptor: Vehicle) -> None:
        """The velocity east swings by itself; the accelerometer reads 0.5 m/s^2 too much to the right."""
        log = flown(raptor, UPRIGHT, {})
        wrong = log["vy_m_s"] + 0.2 * np.sin(1.3 * log.time_s)
        log = replace(log, columns=log.columns | {"imu_y_m_s2": log["imu_y_m_s2"] + 0.5, "vy_m_s": wrong})
        (flight,) = load_dataset([log], raptor).flights
        assert flight.doubted_axes == (0, 1)
        flight = replace(flight, measured=flight.motion, trajectory=None, doubted_axes=()).by_accelerometer((1,))
        assert flight.doubted_axes == (1,) and not flight.tells_force
        later = flight.with_velocity_lag(0.03)
        for one in (flight, later):
            assert one.sensed is not None and one.imu_error is not None
            assert one.imu_error == pytest.approx(one.sensed - one.motion)
            left = one.measured - one.sensed
            assert np.ptp(left[:, 1]) < 1e-9 and np.ptp(left[:, 0]) > 1e-3
        dataset = Dataset((flight,))
        assert "sensing" in dataset.groups
        bias = fit_model(Model(raptor).plus(ConstantBias()), dataset).model.effects[0].values()
        assert [bias[axis] for axis in "xyz"] == pytest.approx([0.0, 0.5, 0.0], abs=0.03)
        assert diagnose(Model(raptor), dataset, [ConstantBias]).missing == ["imu_bias"]

    def test_along_a_doubted_axis_a_bias_is_predicted_without_its_mean(self, raptor: Vehicle) -> None:
        log = flown(raptor, UPRIGHT, {})
        (flight,) = (flight.by_accelerometer((1,)) for flight in load_dataset([log], raptor).flights)
        turning = quaternion_from_euler(0.0 * flight.grid_s, 0.0 * flight.grid_s, 0.4 * flight.grid_s)
        flight = replace(flight, conditions=replace(flight.conditions, attitude=turning))
        with_bias = predict(Model(raptor).plus(ConstantBias(x=0.7)), flight) - predict(Model(raptor), flight)
        east = flight.filtered(0.7 * np.sin(0.4 * flight.grid_s))
        assert with_bias[:, 1] == pytest.approx(east - east.mean(), abs=1e-6)
        assert np.abs(with_bias[:, [0, 2]]).max() < 1e-9

    def test_an_attitude_that_is_wrong_with_the_speed_is_no_drag(self, raptor: Vehicle) -> None:
        """Runs at up to 2 m/s, logged as pitched by 1 degree less for each m/s: a drag of 0.17 1/s, were the force that
        of the velocity."""
        log, drag = runs(raptor, -1.0), Model(raptor).plus(LinearDrag())
        by_force = fit_model(drag, load_dataset([log], raptor))
        assert by_force.model.effects[0].values()["d_x"] == pytest.approx(0.0, abs=0.02)
        by_velocity = fit_model(drag, load_dataset([replace(log, meta={})], raptor))
        assert by_velocity.model.effects[0].values()["d_x"] > 0.1


def runs(vehicle: Vehicle, wrong_deg_per_m_s: float) -> FlightLog:
    """Runs to and fro without drag, at a heading of 50 degrees, whose pitch is wrong with the speed."""
    log = obedient(Model(vehicle), 60.0, noise_m_s=0.005)
    random, columns, t = np.random.default_rng(4), dict(log.columns), log.time_s
    waves = [(1.3, 2.0 * np.pi * 0.07), (0.8, 2.0 * np.pi * 0.23)]  # of one alone the error would be a delay
    speed, ahead = (sum(v * w**n * wave(w * t) for v, w in waves) for n, wave in ((0, np.sin), (1, np.cos)))
    gone = sum(-v / w * np.cos(w * t) for v, w in waves)
    up = np.gradient(obedient(Model(vehicle), 60.0)["vz_m_s"], log.time_s)
    pitch = -np.arctan2(ahead, GRAVITY_M_S2 + up)
    force = np.hypot(ahead, GRAVITY_M_S2 + up)
    yaw = np.radians(50.0)
    for axis, share in (("x", np.cos(yaw)), ("y", np.sin(yaw))):
        columns[f"{axis}_m"] = columns[f"{axis}_m"] + share * gone
        columns[f"v{axis}_m_s"] = columns[f"v{axis}_m_s"] + share * speed
    columns["pitch_deg"] = np.degrees(pitch) + wrong_deg_per_m_s * speed
    columns["yaw_deg"] = columns["yaw_deg"] + 50.0
    rpm = np.sqrt(vehicle.mass_kg * force / vehicle.n_rotors / vehicle.rotor.thrust_n_per_rpm2)
    columns |= dict.fromkeys(rpm_columns(vehicle.n_rotors), rpm)
    columns |= {n: f + 0.02 * random.standard_normal(len(log)) for n, f in zip(IMU, (0.0, 0.0, -force), strict=True)}
    return replace(log, columns=columns, meta=CAPTURED_META)
