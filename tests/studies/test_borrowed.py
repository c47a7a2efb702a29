"""Worlds of RotorPy and drone-models: what is injected acts as it should, and what the logs hold belongs together."""

import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest
import yaml

from studies.worlds.borrowed.cases import SWAY, WORLDS, Case, roam, runs, swings
from studies.worlds.borrowed.craft import GRAVITY_M_S2, RPM, Array, draw_craft
from studies.worlds.borrowed.effects import EFFECTS
from studies.worlds.borrowed.flight import TICK_S, Flight, Record, State, fly
from studies.worlds.borrowed.missions import Mission, part

worlds = pytest.importorskip("studies.worlds.borrowed.__main__", exc_type=ImportError)
KINDS = {"rotorpy": "hummingbird", "drone_models": "cf21B_500"}
SECONDS = 8.0
EXERCISES = {
    "clean": Case("clean", "", (roam(SECONDS, 1.0, 1.0, 2.0),)),
    "scale": Case("scale", "", (roam(SECONDS, 1.0, 1.0, 2.0),), {"thrust_scale": {"error": -0.08}}),
    "drag": Case("drag", "", (runs(SECONDS, 3.0, height=2.0),), {"rotor_drag": {"x": 0.3, "y": 0.3}}),
    "levels": Case(
        "levels",
        "",
        (Mission(2 * SECONDS, SWAY, part("climbs", low=1.0, high=8.0, speed=3.0), "slow", "radii"),),
        {"ground_effect.images": {"rho": 2.5}},
    ),
    "late": Case("late", "", (swings(SECONDS, 2.0, 2.5, 2.4),), {"motor_lag": {"extra": 0.06}}, source="outputs"),
}


def drawn(world: str, case: Case) -> tuple[Case, list[Flight]]:
    """Case in the vehicle of a world, and its flights."""
    kind, rng = KINDS[world], np.random.default_rng(5)
    craft = draw_craft(kind, worlds.SIMULATORS[world].kinds[kind], rng)
    return dataclasses.replace(case, kind=kind), worlds.draw_flights(case, craft, rng)


@pytest.mark.parametrize("world", WORLDS)
def test_a_force_and_a_moment_that_are_injected_accelerate_the_vehicle_by_mass_and_inertia(world: str) -> None:
    _, flights = drawn(world, EXERCISES["clean"])
    simulator = worlds.SIMULATORS[world](flights)
    fleet, zero = simulator.fleet, np.zeros((1, 3))
    tilted = np.array([[0.1, -0.2, 0.3, 0.9]]) / np.linalg.norm([0.1, -0.2, 0.3, 0.9])
    speeds = np.full((1, 4), fleet.hover_rad_s[0])
    state = State(np.array([[0.0, 0.0, 2.0]]), zero, tilted, zero, speeds, zero)
    force, moment, none = np.array([[0.01, -0.02, 0.03]]), np.array([[1e-5, 2e-5, -1e-5]]), np.zeros(1)
    plain = simulator.slope(state, speeds, zero, zero, none)
    pushed = simulator.slope(state, speeds, force, moment, none)
    assert pushed.acceleration - plain.acceleration == pytest.approx(force / fleet.mass_kg[:, None])
    assert pushed.spin_up - plain.spin_up == pytest.approx(moment / fleet.inertia_kg_m2)
    lift = fleet.mass_kg[0] * GRAVITY_M_S2 * state.rotation[0, :, 2]
    loaded = simulator.slope(state, speeds, zero, zero, 0.1 * fleet.mass_kg)
    expected = lift / (1.1 * fleet.mass_kg[0]) - np.array([0.0, 0.0, GRAVITY_M_S2])
    assert loaded.acceleration[0] == pytest.approx(expected)


def test_each_world_has_the_families_pairs_and_clean_flights_and_each_effect_has_physics() -> None:
    for name, cases in WORLDS.items():
        single = {case.families[0] for case in cases if len(case.effects) == 1}
        assert len(single) == 19
        assert sum(len(case.effects) == 2 for case in cases) == 5
        assert sum(not case.effects for case in cases) == 8
        elsewhere = {"battery_sag", "thrust_map", "imu_bias"}
        known = {*EFFECTS, *worlds.SIMULATORS[name].own, *elsewhere}
        assert {effect for case in cases for effect in case.effects} <= known
        assert {case.kind for case in cases} == set(worlds.SIMULATORS[name].kinds)
        lag_needs_commands = [case.source for case in cases if "motor_lag" in case.effects]
        assert "speeds" not in lag_needs_commands


@pytest.fixture(scope="module", params=WORLDS)
def flown(request: pytest.FixtureRequest) -> dict[str, tuple[Case, Flight, Record]]:
    """Short flights of one world."""
    found = {}
    for name, plain in EXERCISES.items():
        case, flights = drawn(request.param, plain)
        (record,) = fly(worlds.SIMULATORS[request.param], flights)
        assert worlds.flaw(case, flights[0], record) is None
        found[name] = (case, flights[0], record)
    return found


def moved(record: Record) -> Array:
    """Force over mass, world."""
    return np.asarray(record.acceleration - np.array([0.0, 0.0, GRAVITY_M_S2]))


@pytest.mark.long
def test_only_a_flight_with_an_effect_has_a_hidden_acceleration(
    flown: dict[str, tuple[Case, Flight, Record]],
) -> None:
    for name, (case, flight, record) in flown.items():
        size = np.sqrt(np.mean(np.sum(worlds.hidden_acceleration(case, flight, record) ** 2, axis=1)))
        assert size > 0.02 if case.effects else size < 1e-9, name


@pytest.mark.long
def test_the_mean_thrust_of_a_clean_flight_is_the_weight(flown: dict[str, tuple[Case, Flight, Record]]) -> None:
    _, flight, record = flown["clean"]
    craft = flight.craft
    thrust = np.sum(craft.rotor_gains * craft.thrust * (record.rpm / RPM) ** 2, axis=1)
    upward = np.mean(thrust * record.rotation[:, 2, 2]) / craft.mass_kg
    gained = (record.velocity[-1, 2] - record.velocity[0, 2]) / (len(thrust) * TICK_S)
    assert upward == pytest.approx(GRAVITY_M_S2 - gained, rel=0.01)


@pytest.mark.long
def test_a_wrong_thrust_coefficient_shows_as_its_factor(flown: dict[str, tuple[Case, Flight, Record]]) -> None:
    _, flight, record = flown["scale"]
    lift = np.sum(flight.craft.thrust * (record.rpm / RPM) ** 2, axis=1) / flight.craft.mass_kg
    upward = -np.mean(moved(record)[:, 2])
    assert upward / np.mean(lift * record.rotation[:, 2, 2]) == pytest.approx(0.92, rel=0.015)


@pytest.mark.long
def test_work_of_the_forces_is_the_change_of_energy(flown: dict[str, tuple[Case, Flight, Record]]) -> None:
    for _, _, record in flown.values():
        power = np.sum(moved(record) * record.velocity, axis=1)
        work = np.sum(0.5 * (power[1:] + power[:-1])) * TICK_S
        energy = 0.5 * np.sum(record.velocity**2, axis=1) - GRAVITY_M_S2 * record.position[:, 2]
        exchanged = np.sum(np.abs(np.diff(energy)))
        assert work == pytest.approx(energy[-1] - energy[0], abs=0.01 * exchanged + 0.02)


@pytest.mark.long
def test_rotor_drag_is_against_the_airspeed(flown: dict[str, tuple[Case, Flight, Record]]) -> None:
    case, flight, record = flown["drag"]
    hidden = worlds.hidden_acceleration(case, flight, record)
    assert np.sum(hidden[:, :2] * record.velocity[:, :2]) / np.sum(record.velocity[:, :2] ** 2) == pytest.approx(
        -0.3, rel=0.15
    )


@pytest.mark.long
def test_ground_effect_lifts_near_the_ground_and_fades_with_height(
    flown: dict[str, tuple[Case, Flight, Record]],
) -> None:
    case, flight, record = flown["levels"]
    height = (flight.craft.rotor_height_m - record.position[:, 2]) / flight.craft.kind.radius_m
    near, far = height < 2.0, height > 6.0
    assert near.any() and far.any()
    up = -worlds.hidden_acceleration(case, flight, record)[:, 2]
    assert np.min(up[near]) > 0.2
    assert np.max(np.abs(up[far])) < 0.3 * np.max(up[near])


@pytest.mark.long
def test_commanded_speeds_lead_the_true_ones_by_the_motor_lag(flown: dict[str, tuple[Case, Flight, Record]]) -> None:
    _, flight, record = flown["late"]
    change = np.gradient(record.rpm / RPM, TICK_S, axis=0)
    ahead = np.sqrt(record.command_n / flight.craft.thrust) - record.rpm / RPM
    measured = np.sum((ahead - ahead.mean(axis=0)) * change) / np.sum(change * change)
    assert measured == pytest.approx(flight.craft.lag_s + 0.06, rel=0.25)


@pytest.mark.long
@pytest.mark.parametrize("world", WORLDS)
def test_a_world_is_the_same_for_the_same_seed_and_the_truth_stands_apart(world: str, tmp_path: Path) -> None:
    case = dataclasses.replace(
        EXERCISES["clean"],
        name="again",
        kind=KINDS[world],
        effects={"thrust_tilt": {"forward_deg": 2.0, "left_deg": 1.0}},
    )
    for folder in ("a", "b"):
        worlds.make_case(worlds.SIMULATORS[world], case, [0.5], 3, [tmp_path / folder])
    names = sorted(path.name for path in (tmp_path / "a" / "again").iterdir())
    assert names == ["flight1.csv", "truth.json", "vehicle.yaml"]
    for name in names:
        assert (tmp_path / "a" / "again" / name).read_bytes() == (tmp_path / "b" / "again" / name).read_bytes()
    truth = json.loads((tmp_path / "a" / "again" / "truth.json").read_text())
    assert truth["families"] == ["thrust_tilt"] and truth["strength"] == 0.5
    assert truth["effect_rms_m_s2"] == pytest.approx(0.5 * np.radians(np.hypot(2.0, 1.0)) * GRAVITY_M_S2, rel=0.1)
    vehicle = yaml.safe_load((tmp_path / "a" / "again" / "vehicle.yaml").read_text())
    assert "tilt" not in json.dumps(vehicle)
    header, *rows = (tmp_path / "a" / "again" / "flight1.csv").read_text().splitlines()
    assert header.startswith("time_s,x_m,y_m,z_m,vx_m_s")
    log = np.array([row.split(",") for row in rows], dtype=float)
    climbed = np.cumsum(log[:-1, 6] * np.diff(log[:, 0]))
    assert np.abs(climbed - (log[1:, 3] - log[0, 3])).max() < 0.1
