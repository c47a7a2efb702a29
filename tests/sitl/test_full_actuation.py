"""A fully actuated vehicle in lockstep: it moves to the side and stays level, as far as its rotors reach."""

import math
from pathlib import Path

import numpy as np
import pytest
import yaml

from quadctl.flight.preflight.preparation import prepare_flight
from quadctl.lab.arrays import Floats
from quadctl.logs.columns import LATERAL_COLUMNS
from quadctl.logs.flight_log import FlightLog
from quadctl.logs.read import read_log
from quadctl.sitl.rules.px4 import SimulatedAutopilot
from quadctl.sitl.run import simulate
from quadctl.sitl.vehicle.inner_loops import InnerLoops, allocation
from quadctl.state import AttitudeTarget
from quadctl.vehicle import load_vehicle
from tests.support.places import ROOT

VEHICLE = ROOT / "config" / "vehicles" / "f550_tilted.yaml"
TILTED = load_vehicle(VEHICLE)
LEVEL = (1.0, 0.0, 0.0, 0.0)
STILL = (0.0, 0.0, 0.0)
HOVER = 0.1 + 0.018 * 21.57463


def flown(where: Path, actuation: str, step_m: float = 0.5, hidden: dict[str, object] | None = None) -> FlightLog:
    """The log of missions/sidestep.yaml, completed."""
    config, world = where / "flight.yaml", where / "hidden.yaml"
    config.write_text(yaml.safe_dump({"vehicle": str(VEHICLE), "controller": {"actuation": actuation}}))
    world.write_text(yaml.safe_dump(hidden or {"effects": []}))
    plan = prepare_flight(ROOT / "missions" / "sidestep.yaml", config, None, None, [f"step_m={step_m}"])
    outcome = simulate(plan, where, world, seed=1)
    assert outcome.completed, outcome.ended
    return read_log(outcome.log)


@pytest.fixture(scope="module")
def both(tmp_path_factory: pytest.TempPathFactory) -> tuple[FlightLog, FlightLog]:
    """The same mission by full actuation and by tilt."""
    where = tmp_path_factory.mktemp("both")
    return flown(where, "full"), flown(where, "tilt")


def tilt_deg(log: FlightLog) -> Floats:
    """Tilt while the mission is flown, deg."""
    flying = np.isin(log.phase, ["settle", "east", "back"])
    roll, pitch = (np.radians(log[name][flying]) for name in ("roll_deg", "pitch_deg"))
    return np.degrees(np.arccos(np.cos(roll) * np.cos(pitch)))


def test_a_step_to_the_side_is_flown_level_and_leans_with_tilt(both: tuple[FlightLog, FlightLog]) -> None:
    level, leaning = both
    for log in (level, leaning):
        assert log["y_m"][log.phase == "east"][-1] == pytest.approx(0.5, abs=0.05)
    assert tilt_deg(level).max() < 1.0
    assert tilt_deg(leaning).max() > 3.0


def test_the_log_tells_the_lateral_commands_and_a_log_of_tilt_is_what_it_was(both: tuple[FlightLog, FlightLog]) -> None:
    level, leaning = both
    flying = level.phase == "east"
    force, throttle = level["thrust_y_cmd_n"][flying], level["throttle_y_cmd"][flying]
    # the answer to 0.5 m: 0.8 * 2.0 * 0.5 m/s^2 of 2.2 kg
    assert force[0] == pytest.approx(0.8 * 2.0 * 0.5 * 2.2, abs=0.1)
    per_newton = 6 * TILTED.throttle.per_newton * TILTED.allocation.lateral_scale[1]
    assert throttle == pytest.approx(per_newton * force, abs=1e-5)
    assert np.isnan(level["throttle_y_cmd"][level.phase == "stream"]).all()
    assert not set(LATERAL_COLUMNS) & set(leaning.columns)


def test_beyond_their_reach_the_vehicle_leans_and_arrives(tmp_path: Path) -> None:
    log = flown(tmp_path, "full", step_m=1.5)
    assert log["y_m"][log.phase == "east"][-1] == pytest.approx(1.5, abs=0.15)
    assert 2.0 < tilt_deg(log).max() < 8.0


def test_with_a_rotor_that_has_lost_half_of_its_thrust_the_others_hold_what_they_can(tmp_path: Path) -> None:
    fault = {"effect": "rotor_fault.weak", "parameters": {"loss": 0.5, "rotor": 2}}
    log = flown(tmp_path, "full", hidden={"effects": [fault]})
    assert log["y_m"][log.phase == "east"][-1] == pytest.approx(0.5, abs=0.1)
    # It is driven harder, by 1 / sqrt(0.5) and more, so that five and a half hold the weight together.
    rpm = np.array([log[f"motor{i}_rpm"][log.phase == "settle"][-50:].mean() for i in range(1, 7)])
    assert rpm[1] > 1.2 * np.delete(rpm, 1).mean()


def test_each_rotor_is_driven_by_the_allocation_matrix_and_saturates() -> None:
    loops = InnerLoops(TILTED)
    forward = loops.motor_outputs(STILL, STILL, HOVER, 0.002, True, lateral=(0.1, 0.0))
    change = (np.array(forward) - HOVER) / (6 * TILTED.throttle.per_newton)
    wrench = TILTED.allocation.matrix @ change
    assert wrench == pytest.approx([0.1 / (6 * 0.018 * TILTED.allocation.lateral_scale[0]), 0, 0, 0, 0, 0], abs=1e-9)
    assert set(loops.motor_outputs(STILL, STILL, HOVER, 0.002, True, lateral=(9.0, 9.0))) == {0.0, 1.0}


def test_a_moment_of_tilted_rotors_brings_no_lateral_force() -> None:
    columns = np.array(allocation(TILTED))
    assert TILTED.allocation.matrix @ columns == pytest.approx(np.vstack([np.zeros((3, 3)), np.eye(3)]), abs=1e-9)


def test_its_own_modes_leave_lateral_force_to_the_attitude() -> None:
    autopilot = SimulatedAutopilot(TILTED)
    autopilot.set_attitude_target(AttitudeTarget(LEVEL, 0.0, (0.3, 0.3)))
    assert autopilot._active.lateral is None  # it is in HOLD


def test_the_parameters_of_its_control_allocation_are_those_of_the_vehicle() -> None:
    parameters = SimulatedAutopilot(TILTED).parameters
    assert (parameters["CA_AIRFRAME"], parameters["CA_ROTOR_COUNT"]) == (0.0, 6.0)
    axis = tuple(parameters[f"CA_ROTOR0_A{axis}"] for axis in "XYZ")
    # cant 20 deg, dihedral 20 deg, at 30 deg from the front: leans back, inward and right
    assert axis == pytest.approx((-0.449, 0.136, -0.883), abs=1e-3)
    assert math.hypot(*axis) == pytest.approx(1.0)
