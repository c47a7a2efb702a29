"""World of blade-element rotors: properties that its reader relies on."""

import csv
import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from studies.worlds.blade.cases import RECIPES, draw_case
from studies.worlds.blade.effects import Change, Ensemble, Situation
from studies.worlds.blade.flight import COMMANDED, TICK, Copy, Flight, Recording, World, fly
from studies.worlds.blade.missions import SHAPES, Demand, plan
from studies.worlds.blade.power import open_loop_speed
from studies.worlds.blade.rotation import Array, euler, from_axes, from_matrix, from_vector, matrix
from studies.worlds.blade.rotors import (
    Blades,
    hover_coefficient,
    hover_induced_velocity,
    induced_ratio,
    pitch_for,
    thrust_coefficient,
    thrust_ratio,
    thrust_ratio_reduced_inflow,
)
from studies.worlds.blade.vehicles import GRAVITY
from studies.worlds.blade.world import write_world

pytestmark = pytest.mark.long

C_T, LIFT = 0.01, 0.57
SILENCED = ("ground_effect_1", "rotor_drag_1", "inflow_2", "payload_1", "rotor_fault_1", "thrust_tilt_1")
"""Cases that are flown at strength 0, and again without their effects."""


def blades() -> Blades:
    return Blades(*(np.array([x]) for x in (0.127, 1.2, LIFT, float(pitch_for(C_T, LIFT)))))


def exact(flight: Flight) -> Flight:
    """Flight of a vehicle that is as its file says."""
    count = flight.vehicle.count
    return replace(flight, copy=Copy(0.0, [0.0] * count, [0.0, 0.0], [0.0] * 3))


@pytest.fixture(scope="module")
def flown() -> dict[str, tuple[Flight, Recording]]:
    """Short flights, all in one batch."""
    flights = {"exact": exact(draw_case(RECIPES["clean_02"], 3, 0, 1.0, 4.0).flights[0])}
    flights["clean"] = draw_case(RECIPES["clean_01"], 3, 0, 1.0, 4.0).flights[0]
    for name in SILENCED:
        silent = draw_case(RECIPES[name], 3, 0, 0.0, 4.0).flights[0]
        flights[f"{name} at 0"] = silent
        flights[f"{name} without"] = replace(silent, effects=())
    return dict(zip(flights, zip(flights.values(), fly(list(flights.values())), strict=True), strict=True))


def test_hover_inflow_and_pitch_by_hand() -> None:
    # lambda = sqrt(0.01 / 2) = 0.070711; theta = 3 (2 * 0.01 / 0.57 + 0.035355) = 0.211329
    assert float(pitch_for(C_T, LIFT)) == pytest.approx(0.211329, abs=1e-6)
    assert induced_ratio(blades(), np.zeros(1), np.zeros(1))[0] == pytest.approx(0.0707107, abs=1e-6)
    assert hover_coefficient(blades())[0] == pytest.approx(C_T, rel=1e-9)
    # 10 N by a disk of 0.05067 m^2 in air of 1.2 kg/m^3: sqrt(10 / (2 * 1.2 * 0.05067)) = 9.068 m/s
    assert float(hover_induced_velocity(10.0, 0.127, 1.2)) == pytest.approx(9.068, abs=1e-3)


def test_hover_thrust_goes_with_the_square_of_speed() -> None:
    none = np.zeros(1)
    for speed in (100.0, 500.0, 1500.0):
        assert thrust_ratio(blades(), np.array([speed]), none, none)[0] == pytest.approx(1.0, abs=1e-9)


@pytest.mark.parametrize(("mu", "climb"), [(0.0, 0.03), (0.0, -0.03), (0.1, 0.0), (0.05, 0.02), (0.3, 0.0)])
def test_blades_and_momentum_agree(mu: float, climb: float) -> None:
    induced = induced_ratio(blades(), np.array([mu]), np.array([climb]))
    by_blades = thrust_coefficient(blades(), np.array([mu]), np.array([climb]))
    assert 2.0 * induced * np.hypot(mu, climb + induced) == pytest.approx(by_blades, rel=1e-6)


def test_climb_by_hand() -> None:
    # Vertical: 2 x (x + 0.03) = 0.285 (0.211329 / 3 - (x + 0.03) / 2) gives x = 0.0547436,
    # C_T = 2 * 0.0547436 * 0.0847436 = 0.0092784: 7 % less than in hover.
    ratio = thrust_ratio(blades(), np.array([1.0 / 0.127 * 100]), np.zeros(1), np.array([3.0]))[0]
    x = (-(0.06 + 0.1425) + np.sqrt((0.06 + 0.1425) ** 2 + 8.0 * (0.285 * 0.211329 / 3.0 - 0.1425 * 0.03))) / 4.0
    assert ratio == pytest.approx(2.0 * x * (x + 0.03) / C_T, rel=1e-4)
    assert 0.7 < ratio < 0.97


def test_thrust_grows_with_edgewise_speed_and_near_the_ground() -> None:
    speed, none = np.array([600.0]), np.zeros(1)
    ratios = [thrust_ratio(blades(), speed, np.array([v]), none)[0] for v in (0.0, 2.0, 5.0, 10.0)]
    assert ratios == sorted(ratios) and 1.05 < ratios[-1] < 1.6
    reduced = [thrust_ratio_reduced_inflow(blades(), np.array([r]))[0] for r in (0.0, 0.1, 0.4)]
    assert reduced[0] == pytest.approx(1.0) and reduced == sorted(reduced)


def test_motor_turns_as_commanded_at_the_nominal_voltage() -> None:
    command = np.array([0.5, 1.0, 1.4])
    assert open_loop_speed(command, np.ones(3), np.full(3, 0.2)) == pytest.approx(command)
    assert np.all(open_loop_speed(command, np.full(3, 0.9), np.full(3, 0.2)) < command)


def test_attitudes_follow_the_frames_of_the_logs() -> None:
    rng = np.random.default_rng(1)
    q = from_vector(rng.normal(0.0, 0.8, (50, 3)))
    assert np.abs((from_matrix(matrix(q)) * q).sum(-1)) == pytest.approx(1.0)
    pitch_up = from_vector(np.array([[0.0, 0.1, 0.0]]))
    assert euler(pitch_up)[0] == pytest.approx([0.0, 0.1, 0.0])
    thrust = -matrix(pitch_up)[0, :, 2]  # nose up: the thrust leans backwards, and upwards is negative
    assert thrust[0] < 0 and thrust[2] < 0
    heading = from_axes(np.array([[0.0, 0.0, 1.0]] * 4), np.array([0.0, 1.0, 3.14, -2.0]))
    assert euler(heading)[:, 2] == pytest.approx([0.0, 1.0, 3.14, -2.0])


@pytest.mark.parametrize("shape", sorted(SHAPES))
def test_missions_keep_their_limits(shape: str) -> None:
    demand = Demand(shape, 40.0, speed=3.0, low=1.0, high=3.0, extent=3.0)
    for seed in range(3):
        reference = plan(np.random.default_rng(seed), demand)
        height = -reference.position[:, 2]
        assert height.min() > 0.999 and height.max() < 3.001
        assert np.hypot(*reference.velocity[:, :2].T).max() < 3.0 * 1.3
        steps = np.diff(reference.position, axis=0)
        assert np.abs(steps).max() < 0.01 * 4.0  # no jumps


def test_exact_vehicle_needs_the_thrust_of_its_file(flown: dict[str, tuple[Flight, Recording]]) -> None:
    flight, recording = flown["exact"]
    tape, vehicle = recording.columns, flight.vehicle
    thrust = vehicle.k * (tape["speed"][:, : vehicle.count].astype(float) ** 2).sum(-1) / vehicle.mass
    predicted = -matrix(tape["true_attitude"].astype(float))[:, :, 2] * thrust[:, None] + [0.0, 0.0, GRAVITY]
    rest = tape["true_acceleration"] - predicted
    assert np.abs(rest.mean(0)).max() < 0.03  # light air
    assert np.sqrt((rest**2).sum(-1).mean()) < 0.06
    assert np.abs(tape["effect"]).max() < 1e-4


@pytest.mark.parametrize("name", SILENCED)
def test_effect_of_strength_nought_changes_nothing(name: str, flown: dict[str, tuple[Flight, Recording]]) -> None:
    silent, without = flown[f"{name} at 0"][1].columns, flown[f"{name} without"][1].columns
    for channel in ("true_position", "position", "speed"):
        assert np.array_equal(silent[channel], without[channel])
    assert np.abs(silent["effect"]).max() < 1e-4


def test_velocity_integrates_to_position(flown: dict[str, tuple[Flight, Recording]]) -> None:
    tape = flown["clean"][1].columns
    for velocity, position, tolerance in (
        ("true_velocity", "true_position", 0.001),
        ("velocity", "position", 0.05),
    ):
        speed = tape[velocity].astype(float)
        way = np.cumsum(0.5 * (speed[1:] + speed[:-1]), axis=0) * TICK
        assert np.abs(way - (tape[position][1:] - tape[position][0])).max() < tolerance


def situation(**changes: Array) -> Situation:
    """One vehicle, level in hover 2 m up."""
    world = World([exact(draw_case(RECIPES["clean_02"], 3, 0, 1.0, 4.0).flights[0])])
    here = world.situation(matrix(world.attitude))
    for name, value in changes.items():
        setattr(here, name, value)
    return here


def act(name: str, **changes: Array) -> Change:
    """Change by the effects of a case."""
    effects = draw_case(RECIPES[name], 3, 0, 1.0, 4.0).flights[0].effects
    return Ensemble.of([effects]).act(situation(**changes))


def test_effects_push_where_physics_says() -> None:
    ahead, up = np.array([[5.0, 0.0, 0.0]]), np.array([[0.0, 0.0, -2.0]])
    for name in ("rotor_drag_2", "body_drag_1"):
        assert act(name, airspeed=ahead).body[0, 0] < -0.05
    assert np.all(act("inflow_1", airspeed=up).factor[0, :4] < 1.0)
    assert np.all(act("translational_lift_1", airspeed=ahead).factor[0, :4] > 1.0)
    assert act("tether_1", position=np.array([[0.0, 0.0, -8.0]])).world[0, 2] > 0.1
    low = np.full((1, 8), 1.0) * situation().blades.radius_m
    for name in ("ground_effect_1", "ground_effect_2", "ground_effect_3"):
        assert np.all(act(name, height=low).factor[0, :4] > 1.04)
        assert act(name, height=10.0 * low).factor[0, :4] == pytest.approx(1.0, abs=0.02)
    rolled = matrix(from_vector(np.array([[0.2, 0.1, 0.0]])))
    levelling = act("ground_torque_1", rotation=rolled, height=low).moment[0]
    assert levelling[0] < 0 and levelling[1] < 0


def test_every_family_has_three_cases_and_few_logs_lack_speeds() -> None:
    single = [recipe.hidden[0][0] for recipe in RECIPES.values() if len(recipe.hidden) == 1]
    assert all(single.count(family) >= 3 for family in set(single)) and len(set(single)) >= 17
    assert sum(len(recipe.hidden) == 2 for recipe in RECIPES.values()) >= 9
    assert sum(not recipe.hidden for recipe in RECIPES.values()) == 12
    for recipe in RECIPES.values():
        if any(family == "motor_lag" for family, _ in recipe.hidden):
            assert recipe.source == COMMANDED


@pytest.fixture(scope="module")
def folders(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Path, Path]]:
    """One case, written twice."""
    first, second = tmp_path_factory.mktemp("first"), tmp_path_factory.mktemp("second")
    for folder in (first, second):
        write_world(folder, ["clean_01"], seed=5, strength=1.0, duration=3.0)
    yield first / "clean_01", second / "clean_01"


def test_same_seed_same_files(folders: tuple[Path, Path]) -> None:
    first, second = folders
    names = sorted(path.name for path in first.iterdir())
    assert names == ["flight1.csv", "flight2.csv", "truth.json", "vehicle.yaml"]
    for name in names:
        assert (first / name).read_bytes() == (second / name).read_bytes()


def test_log_and_truth_hold_what_they_should(folders: tuple[Path, Path]) -> None:
    with (folders[0] / "flight1.csv").open(encoding="utf-8") as file:
        rows = [{name: float(value) for name, value in row.items()} for row in csv.DictReader(file)]
    assert {"time_s", "z_m", "vz_m_s", "yaw_rate_rad_s", "motor4_rpm"} <= set(rows[0])
    times = np.array([row["time_s"] for row in rows])
    assert np.all(np.diff(times) > 0)
    assert all(row["z_m"] > 0 for row in rows)  # upwards
    climb = np.array([row["vz_m_s"] for row in rows])
    height = np.array([row["z_m"] for row in rows])
    integral = np.concatenate([[0.0], np.cumsum(0.5 * (climb[1:] + climb[:-1]) * np.diff(times))])
    assert np.abs(integral - (height - height[0])).max() < 0.05
    truth = json.loads((folders[0] / "truth.json").read_text())
    assert truth["families"] == [] and truth["indistinguishable"] == [] and truth["effect_rms_m_s2"] == 0.0
