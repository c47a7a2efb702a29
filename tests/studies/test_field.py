"""The field world is physically sane: it flies as Newton's laws say, and what its logs hold belongs together."""

import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest
import yaml

from studies.worlds.field.__main__ import write_world
from studies.worlds.field.arrays import GRAVITY_M_S2, Floats, rotate
from studies.worlds.field.cases import Case
from studies.worlds.field.draws import draw_case
from studies.worlds.field.missions import STEP_S
from studies.worlds.field.simulation import Track, simulate

pytestmark = pytest.mark.long

SECONDS = 20.0


def _shortened(case: Case, seconds: float) -> Case:
    """Case with one flight of this length of log."""
    flight = case.flights[0]
    samples = int((flight.settle_s + seconds) / STEP_S)
    reference = flight.reference
    short = dataclasses.replace(
        reference,
        position_m=reference.position_m[:samples],
        velocity_m_s=reference.velocity_m_s[:samples],
        accel_m_s2=reference.accel_m_s2[:samples],
        yaw_rad=reference.yaw_rad[:samples],
    )
    return dataclasses.replace(case, flights=(dataclasses.replace(flight, reference=short),))


def _case(name: str, *families: str, strength: float = 1.0, seconds: float = SECONDS) -> Case:
    return _shortened(draw_case(name, families, 1, strength, 7), seconds)


@pytest.fixture(scope="module")
def flown() -> dict[str, tuple[Case, Track]]:
    cases = [
        _case("clean"),
        _case("scale", "thrust_scale"),
        _case("drag", "rotor_drag"),
        _case("levels", "ground_effect"),
        _case("lag", "motor_lag"),
    ]
    tracks = simulate(cases, [case.flights[0] for case in cases])
    return {case.name: (case, track) for case, track in zip(cases, tracks, strict=True)}


def _world_force_per_mass(track: Track) -> Floats:
    return rotate(track.attitude, track.specific_force_m_s2)


@pytest.mark.long
def test_the_mean_thrust_of_a_clean_flight_is_the_weight(flown: dict[str, tuple[Case, Track]]) -> None:
    case, track = flown["clean"]
    vehicle = case.vehicle
    thrust = np.sum(track.rpm**2 * vehicle.thrust_n_per_rpm2 * (1.0 + vehicle.rotor_spread), axis=1)
    upward = np.mean(thrust * track.attitude[:, 2, 2]) / vehicle.mass_kg
    gained = (track.velocity_m_s[-1, 2] - track.velocity_m_s[0, 2]) / track.time_s[-1]
    assert upward == pytest.approx(GRAVITY_M_S2 - gained, rel=0.01)


@pytest.mark.long
def test_a_wrong_thrust_coefficient_shows_as_its_factor(flown: dict[str, tuple[Case, Track]]) -> None:
    case, track = flown["scale"]
    believed = np.sum(track.rpm**2, axis=1) * case.beliefs.thrust_n_per_rpm2 / case.beliefs.mass_kg
    upward = -np.mean(_world_force_per_mass(track)[:, 2])
    factor = case.hidden[0].parameters["factor"]
    assert upward / np.mean(believed * track.attitude[:, 2, 2]) == pytest.approx(factor, rel=0.015)


def test_work_of_the_forces_is_the_change_of_energy(flown: dict[str, tuple[Case, Track]]) -> None:
    for _, track in flown.values():
        power = np.sum(_world_force_per_mass(track) * track.velocity_m_s, axis=1)
        work = np.sum(0.5 * (power[1:] + power[:-1]) * np.diff(track.time_s))
        energy = 0.5 * np.sum(track.velocity_m_s**2, axis=1) - GRAVITY_M_S2 * track.position_m[:, 2]
        exchanged = np.sum(np.abs(np.diff(energy)))
        assert work == pytest.approx(energy[-1] - energy[0], abs=0.01 * exchanged + 0.02)


def test_the_logged_velocity_is_the_derivative_of_position_late_by_the_lag(
    flown: dict[str, tuple[Case, Track]],
) -> None:
    case, track = flown["clean"]
    lags = np.arange(0.0, 0.08, 0.001)
    inner = (track.time_s > 0.5) & (track.time_s < SECONDS - 0.5)
    errors = []
    for lag in lags:
        late = np.stack(
            [np.interp(track.time_s[inner] - lag, track.time_s, track.velocity_m_s[:, axis]) for axis in range(3)],
            axis=1,
        )
        errors.append(np.mean((track.estimated_velocity_m_s[inner] - late) ** 2))
    assert lags[int(np.argmin(errors))] == pytest.approx(case.sensing.velocity_lag_s, abs=0.012)
    moved = np.cumsum(track.estimated_velocity_m_s, axis=0) * float(np.diff(track.time_s)[0])
    drift = (track.estimated_position_m - track.estimated_position_m[0]) - moved
    assert np.max(np.abs(drift)) < 0.3


def test_only_a_case_with_an_effect_has_a_hidden_acceleration(flown: dict[str, tuple[Case, Track]]) -> None:
    assert np.max(np.abs(flown["clean"][1].hidden_accel_m_s2)) < 1e-9
    for name in ("scale", "drag", "levels", "lag"):
        assert np.sqrt(np.mean(flown[name][1].hidden_accel_m_s2 ** 2)) > 0.02


def test_rotor_drag_is_against_the_airspeed(flown: dict[str, tuple[Case, Track]]) -> None:
    _, track = flown["drag"]
    assert np.sum(track.hidden_accel_m_s2[:, :2] * track.velocity_m_s[:, :2]) < 0.0


def test_ground_effect_lifts_near_the_ground_and_fades_with_height(flown: dict[str, tuple[Case, Track]]) -> None:
    case, track = flown["levels"]
    near = track.lowest_m < 2.0 * case.vehicle.radius_m
    far = track.lowest_m > 8.0 * case.vehicle.radius_m
    assert near.any() and far.any()
    up = -track.hidden_accel_m_s2[:, 2]
    assert np.min(up[near]) > 0.0
    assert np.max(np.abs(up[far])) < 0.3 * np.max(up[near])


def test_commanded_speeds_lead_the_true_ones_by_the_motor_lag(flown: dict[str, tuple[Case, Track]]) -> None:
    case, track = flown["lag"]
    step = float(np.diff(track.time_s)[0])
    change = np.gradient(track.rpm, step, axis=0)
    ahead = track.commanded_rpm - track.rpm
    measured = np.sum(ahead * change) / np.sum(change * change)
    assert measured == pytest.approx(case.vehicle.motor_time_s, rel=0.2)


@pytest.mark.long
def test_the_world_is_the_same_for_the_same_seed_and_the_truth_stands_apart(tmp_path: Path) -> None:
    for folder in ("a", "b"):
        write_world([_case("again", "thrust_tilt", strength=0.5, seconds=4.0)], tmp_path / folder)
    names = sorted(path.name for path in (tmp_path / "a" / "again").iterdir())
    assert names == ["flight1.csv", "truth.json", "vehicle.yaml"]
    for name in names:
        assert (tmp_path / "a" / "again" / name).read_bytes() == (tmp_path / "b" / "again" / name).read_bytes()
    truth = json.loads((tmp_path / "a" / "again" / "truth.json").read_text())
    assert truth["families"] == ["thrust_tilt"]
    assert truth["trims_deg"] > 0.8
    vehicle = yaml.safe_load((tmp_path / "a" / "again" / "vehicle.yaml").read_text())
    assert "tilt" not in json.dumps(vehicle)
    header = (tmp_path / "a" / "again" / "flight1.csv").read_text().splitlines()[0]
    assert header.startswith("time_s,x_m,y_m,z_m,vx_m_s")
