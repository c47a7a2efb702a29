"""Full actuation over MAVLink: thrust in three dimensions on the wire, and a step to the side that stays level."""

import io
import math
from pathlib import Path

import numpy as np
import pytest
import yaml
from rich.console import Console

from quadctl.errors import FlightError
from quadctl.flight.preflight.preparation import prepare_flight
from quadctl.flight.session import fly_real_time
from quadctl.frames import quaternion_from_euler
from quadctl.logs.flight_log import FlightLog
from quadctl.logs.read import read_log
from quadctl.sitl.autopilots import Simulated
from quadctl.sitl.rules.copter import SimulatedCopter
from quadctl.sitl.rules.px4 import SimulatedAutopilot
from quadctl.sitl.run import mock_process
from quadctl.state import NAN, AttitudeTarget
from quadctl.vehicle import load_vehicle
from tests.support.links import IDLE, LEVEL, connected
from tests.support.places import ROOT

pytestmark = pytest.mark.realtime

VEHICLE = ROOT / "config" / "vehicles" / "f550_tilted.yaml"
TILTED = load_vehicle(VEHICLE)


def flown(where: Path, actuation: str, kind: Simulated = Simulated.PX4) -> FlightLog:
    """The log of a short missions/sidestep.yaml on the mock, completed."""
    where.mkdir()
    config = where / "flight.yaml"
    config.write_text(yaml.safe_dump({"vehicle": str(VEHICLE), "controller": {"actuation": actuation}}))
    shorter = ["settle_s=2", "step_s=4"]
    plan = prepare_flight(ROOT / "missions" / "sidestep.yaml", config, None, None, shorter)
    with mock_process(plan.body.vehicle, None, 1, kind) as url:
        outcome = fly_real_time(plan, url, where, Console(file=io.StringIO()))
    assert outcome.completed, outcome.ended
    return read_log(outcome.log)


def largest_tilt_deg(log: FlightLog) -> float:
    flying = np.isin(log.phase, ["settle", "east", "back"])
    roll, pitch = (np.radians(log[name][flying]) for name in ("roll_deg", "pitch_deg"))
    return float(np.degrees(np.arccos(np.cos(roll) * np.cos(pitch))).max())


def test_a_step_to_the_side_stays_within_2_deg_of_level(tmp_path: Path) -> None:
    """With tilt it leans more: tests/sitl/test_full_actuation.py flies both in simulated time."""
    log = flown(tmp_path / "full", "full")
    assert log["y_m"][log.phase == "east"].max() > 0.45
    assert largest_tilt_deg(log) < 2.0


def test_lateral_throttle_arrives_as_thrust_in_three_dimensions_and_a_target_without_it_as_before() -> None:
    target = AttitudeTarget(quaternion_from_euler(0.0, 0.0, 0.3), 0.625, (0.125, -0.25))
    with connected(SimulatedAutopilot(TILTED), n_rotors=6) as link:
        link.adapter.send(target)
        link.adapter.send(IDLE)
        link.wait(lambda: len(link.px.setpoints_received) == 2)
        three, one = (setpoint.target for setpoint in link.px.setpoints_received)
    assert three.attitude == pytest.approx(target.attitude, abs=1e-6)
    assert (three.throttle, three.lateral) == (0.625, (0.125, -0.25))
    assert one == IDLE


def test_ardupilot_flies_the_scalar_thrust_of_such_a_target_and_nothing_to_the_side() -> None:
    with connected(SimulatedCopter(TILTED), n_rotors=6) as link:
        link.adapter.send(AttitudeTarget(LEVEL, 0.5, (0.1, 0.1)))
        link.wait(lambda: len(link.px.setpoints_received) == 1)
        assert link.px.setpoints_received[0].target == AttitudeTarget(LEVEL, 0.5)


@pytest.mark.parametrize("lateral", [(NAN, 0.0), (0.0, math.inf), (1.01, 0.0), (0.0, -1.01)])
def test_a_lateral_throttle_that_is_none_is_not_sent(lateral: tuple[float, float]) -> None:
    with connected(SimulatedAutopilot(TILTED), n_rotors=6) as link:
        with pytest.raises(FlightError, match="lateral throttle"):
            link.adapter.send(AttitudeTarget(LEVEL, 0.5, lateral))
        link.adapter.send(IDLE)
        link.wait(lambda: len(link.px.setpoints_received) > 0)
        assert [setpoint.target for setpoint in link.px.setpoints_received] == [IDLE]


def test_ardupilot_is_refused_before_anything_is_armed(tmp_path: Path) -> None:
    with pytest.raises(FlightError, match="it has no setpoint of lateral force and would fly without it"):
        flown(tmp_path / "full", "full", Simulated.ARDUPILOT)
