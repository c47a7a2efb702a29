"""The flights that are meant to fool the lab obey Newton's laws, and their judge tells true answers from false ones."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from quadctl.logs.csv_log import write_csv
from quadctl.vehicle import load_vehicle
from studies.worlds.traps.flights import CONTROLS, TRAPS, SlungLoad
from studies.worlds.traps.judgement import Honest, Outcome, judge
from studies.worlds.traps.second import SECOND
from studies.worlds.traps.simulation import VEHICLES, Leg, World, fly, turning
from studies.worlds.traps.third import ARMS_M, MASS_KG, SPIN, THIRD, commanded_thrusts

pytestmark = pytest.mark.long

DRAG = Honest("drag of 0.3", {"rotor_drag"}, {"unexplained"}, {"rotor_drag.linear d_x": (0.3, 0.3)})
CLEAN = Honest("none", verdicts={"none"})


def _named(
    family: str, interval: tuple[float, float] = (0.2, 0.4), confounded: Sequence[Sequence[str]] = ()
) -> dict[str, Any]:
    """Result of a diagnosis that names one effect with one parameter."""
    effect = {"rotor_drag": "rotor_drag.linear"}.get(family, f"{family}.formula")
    return {
        "verdict": "missing",
        "missing": [family],
        "confounded": confounded,
        "ladder": [{"family": "", "effect": "raptor"}, {"family": family, "effect": effect}],
        "ranking": [{"effect": effect, "parameters": {"d_x": sum(interval) / 2}, "ci95": {"d_x": interval}}],
    }


def _silent(verdict: str) -> dict[str, Any]:
    """Result of a diagnosis that names nothing."""
    return {"verdict": verdict, "missing": [], "confounded": [], "ladder": [], "ranking": []}


def test_there_are_three_times_ten_traps_and_their_names_differ() -> None:
    assert len(TRAPS) == len(SECOND) == len(THIRD) == 10
    assert len({trap.name for trap in (*CONTROLS, *TRAPS, *SECOND, *THIRD)}) == len(CONTROLS) + 30


def test_a_trap_of_two_flights_has_two_logs_of_different_names() -> None:
    trap = next(trap for trap in SECOND if trap.name == "warm_controllers")
    assert [log.name for log in trap.generate()] == ["warm_controllers_1.csv", "warm_controllers_2.csv"]


def test_a_moment_makes_the_rotors_hold_against_it() -> None:
    vehicle = load_vehicle(VEHICLES / "raptor.yaml")
    moment_n_m = np.array([0.04, -0.02, 0.0])
    world = World(moment_n_m=lambda time_s, body: moment_n_m)
    log = fly("held", "raptor", [Leg(0.0, 0.0, 1.0, 0.0, 20.0)], world)
    rpm = np.array([log[f"motor{i + 1}_rpm"] for i in range(4)])[:, 500:]
    thrust_n = (vehicle.rotor.thrust_n_per_rpm2 * rpm**2).mean(axis=1)
    assert np.array(vehicle.moment_arms_m).T @ thrust_n == pytest.approx(-moment_n_m, abs=0.002)


def test_products_of_inertia_turn_a_body_about_another_axis_than_its_moment() -> None:
    inertia = np.array([[2.0, -0.5, 0.0], [-0.5, 1.0, 0.0], [0.0, 0.0, 3.0]])
    rates = np.array([0.1, -0.2, 0.3])
    accel = turning(np.array([1.0, 0.0, 0.0]), rates, inertia)
    assert inertia @ accel + np.cross(rates, inertia @ rates) == pytest.approx([1.0, 0.0, 0.0])


def test_a_trap_that_is_generated_twice_is_the_same_file(tmp_path: Path) -> None:
    trap = next(trap for trap in TRAPS if trap.name == "swinging_load")
    paths = [tmp_path / name for name in ("once.csv", "again.csv")]
    for path in paths:
        write_csv(trap.generate()[0], path)
    once, again = (path.read_bytes() for path in paths)
    assert once == again


@pytest.mark.parametrize("loaded", [False, True])
def test_the_mean_thrust_of_a_hover_is_the_weight_of_all_that_hangs_on_the_rotors(loaded: bool) -> None:
    vehicle = load_vehicle(VEHICLES / "x500.yaml")
    sling = World(force_n=SlungLoad(), mass_kg=lambda time_s: vehicle.mass_kg - SlungLoad.mass_kg)
    log = fly("hover", "x500", [Leg(0.0, 0.0, 3.0, 0.0, 20.0)], sling if loaded else World())
    rpm = np.array([log[f"motor{i + 1}_rpm"] for i in range(4)])
    thrust_n = (vehicle.rotor.thrust_n_per_rpm2 * rpm**2).sum(axis=0).mean()
    assert thrust_n == pytest.approx(vehicle.weight_n, rel=0.005)


def test_a_run_arrives_and_accelerates_where_the_rotors_tilt_the_thrust() -> None:
    vehicle = load_vehicle(VEHICLES / "raptor.yaml")
    log = fly("run", "raptor", [Leg(0.0, 0.0, 1.0, 0.0, 2.0), Leg(3.0, 0.0, 1.0, 3.0, 4.0)])
    assert log["x_m"][-1] == pytest.approx(3.0, abs=0.05)
    rpm = np.array([log[f"motor{i + 1}_rpm"] for i in range(4)])
    thrust_n = (vehicle.rotor.thrust_n_per_rpm2 * rpm**2).sum(axis=0)
    by_thrust = -np.sin(np.radians(log["pitch_deg"])) * thrust_n / vehicle.mass_kg
    speed = np.cumsum(by_thrust) * 0.02
    assert np.abs(speed - log["vx_m_s"]).max() < 0.15


def test_the_judge_takes_the_true_effect_whose_interval_holds_the_truth() -> None:
    assert judge(DRAG, _named("rotor_drag")) is Outcome.HONEST


def test_the_judge_is_not_content_with_an_interval_that_leaves_out_the_truth() -> None:
    assert judge(DRAG, _named("rotor_drag", (0.4, 0.5))) is Outcome.FOOLED


def test_the_judge_sees_an_effect_that_is_not_there() -> None:
    assert judge(DRAG, _named("wind")) is Outcome.FOOLED
    assert judge(CLEAN, _named("wind")) is Outcome.FOOLED


def test_the_judge_wants_to_hear_of_what_no_family_explains() -> None:
    beyond = replace(DRAG, beyond=True)
    assert judge(beyond, _named("rotor_drag") | {"unexplained": False}) is Outcome.MISSED
    assert judge(beyond, _named("rotor_drag") | {"unexplained": True}) is Outcome.HONEST


def test_the_judge_takes_each_of_several_true_values_and_nothing_between_them() -> None:
    days = Honest("one of two days", {"rotor_drag"}, either={"rotor_drag.linear d_x": (0.0, 0.8)})
    assert judge(days, _named("rotor_drag", (0.7, 0.9))) is Outcome.HONEST
    assert judge(days, _named("rotor_drag", (0.3, 0.5))) is Outcome.FOOLED


def test_a_pair_that_cannot_be_told_apart_is_honest_where_one_of_the_two_is_true() -> None:
    assert judge(DRAG, _named("wind", confounded=[["rotor_drag", "wind"]])) is Outcome.HONEST
    assert judge(DRAG, _named("wind", confounded=[["thrust_tilt", "wind"]])) is Outcome.FOOLED


def test_silence_about_an_effect_is_a_miss_and_a_fault_in_a_clean_flight_is_false() -> None:
    assert judge(DRAG, _silent("unexplained")) is Outcome.HONEST
    assert judge(DRAG, _silent("none")) is Outcome.MISSED
    assert judge(CLEAN, _silent("none")) is Outcome.HONEST
    assert judge(CLEAN, _silent("unexplained")) is Outcome.FOOLED


def test_the_controller_of_the_third_set_carries_the_weight_and_turns_only_where_it_should() -> None:
    still, level = np.zeros(3), np.eye(3)
    turning_right = np.array([0.1, 0.0, 0.0])
    thrust_n = commanded_thrusts(still, still, level, still, (still, still, still, 0.0))
    against_n = commanded_thrusts(still, still, level, turning_right, (still, still, still, 0.0)) - thrust_n
    assert thrust_n == pytest.approx(np.full(4, MASS_KG * 9.81 / 4))
    assert [against_n.sum(), against_n @ ARMS_M[:, 0], against_n @ SPIN] == pytest.approx([0.0, 0.0, 0.0], abs=1e-9)
    assert -against_n @ ARMS_M[:, 1] == pytest.approx(-0.0075 * 13.0 * 0.1)
