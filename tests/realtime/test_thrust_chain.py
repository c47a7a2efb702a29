"""Additions of an autopilot to the commanded thrust, over MAVLink: the thrust that is flown is the one commanded."""

import asyncio
import math
from pathlib import Path

import numpy as np
import pytest
import yaml
from rich.console import Console

from quadctl.flight.preflight.inquiry import inspect_autopilot
from quadctl.flight.preflight.preparation import prepare_flight
from quadctl.flight.session import fly_real_time
from quadctl.frames import quaternion_from_euler
from quadctl.logs.flight_log import FlightLog
from quadctl.logs.read import read_log
from quadctl.sitl.rules.copter import SimulatedCopter
from quadctl.sitl.rules.px4 import SimulatedAutopilot
from quadctl.sitl.server.faults import leaning
from quadctl.sitl.vehicle.hidden import load_hidden
from quadctl.state import AttitudeTarget
from quadctl.vehicle import load_vehicle
from tests.support.configurations import forgiving_config
from tests.support.links import LEVEL, RAPTOR, connected, free_port, meet_requirements, mock
from tests.support.places import ROOT

pytestmark = pytest.mark.realtime

VEHICLE = load_vehicle(RAPTOR)
RUN = {
    "name": "run",
    "phases": [
        {"name": "takeoff", "kind": "move", "to_m": [0, 0, 1.2], "speed_m_s": 0.7},
        {"name": "hover", "kind": "hold", "duration_s": 3},
        {"name": "run", "kind": "move", "to_m": [22, 0, 1.2], "speed_m_s": 4, "acceleration_m_s2": 2},
    ],
    "limits": {"min_z_m": 0.1, "max_z_m": 3, "max_distance_m": 30, "max_duration_s": 60},
}
DRAG = {"effects": [{"effect": "rotor_drag.linear", "parameters": {"d_x": 0.6, "d_y": 0.6, "d_z": 0.0}}]}
"""Drag that holds the vehicle at 13.7 degrees at 4 m/s."""


def flown_run(where: Path) -> FlightLog:
    mission, hidden, port = where / "run.yaml", where / "hidden.yaml", free_port()
    mission.write_text(yaml.safe_dump(RUN))
    hidden.write_text(yaml.safe_dump(DRAG))
    copter = SimulatedCopter(VEHICLE, load_hidden(hidden), seed=1)
    meet_requirements(copter)
    plan = prepare_flight(mission, forgiving_config(where, height_datum="takeoff"), "none", None)
    with mock(copter, port):
        outcome = fly_real_time(plan, f"udpin://127.0.0.1:{port}", where, Console(quiet=True))
    assert outcome.completed, outcome.ended
    return read_log(next(where.glob("*.csv")))


def test_the_recorded_thrust_is_the_commanded_one_level_and_at_a_steady_tilt(tmp_path: Path) -> None:
    """ArduPilot would add 2.9 % at 14 degrees; 11 % more are in its outputs for thin air."""
    log = flown_run(tmp_path)
    outputs = np.mean([log[f"motor{i}_output"] for i in range(1, 5)], axis=0)
    tilt_deg = np.hypot(log["roll_deg"], log["pitch_deg"])
    assert log.phase is not None
    for where in ((log.phase == "hover"), (log.phase == "run") & (tilt_deg > 12.0) & (tilt_deg < 15.0)):
        assert np.count_nonzero(where) > 50
        assert np.mean(outputs[where]) == pytest.approx(np.mean(log["throttle_cmd"][where]), rel=0.008)


class Copter47(SimulatedCopter):
    """A Copter whose air is that of the standard atmosphere."""

    version = (4, 7)


@pytest.mark.parametrize(
    ("autopilot", "boosts", "factor"),
    [(SimulatedCopter, 1.0, math.cos(0.25)), (SimulatedCopter, 0.0, 1.0), (SimulatedAutopilot, None, 1.0)],
)
def test_the_boost_with_the_tilt_is_divided_out_of_the_target(
    autopilot: type[SimulatedAutopilot], boosts: float | None, factor: float
) -> None:
    simulated = autopilot(VEHICLE)
    if boosts is not None:
        simulated.parameters["ATC_ANGLE_BOOST"] = boosts
    with connected(simulated) as link:
        link.px.faults.distort = leaning(0.25)
        asyncio.run(link.adapter.request_telemetry())
        link.wait(lambda: abs(link.adapter.state().attitude[1] - math.sin(0.125)) < 0.005)
        link.adapter.send(AttitudeTarget(LEVEL, 0.4))
        link.wait(lambda: bool(link.px.setpoints_received))
        sent = link.px.setpoints_received[-1].target.throttle
    assert sent == pytest.approx(0.4 * factor, abs=0.001)


def test_a_boost_that_is_not_told_is_said_and_not_divided_out() -> None:
    simulated = SimulatedCopter(VEHICLE)
    del simulated.parameters["ATC_ANGLE_BOOST"]
    with connected(simulated) as link:
        link.px.faults.distort = leaning(0.25)
        asyncio.run(link.adapter.request_telemetry())
        assert any("does not tell ATC_ANGLE_BOOST" in warning for warning in link.adapter.warnings)
        link.adapter.send(AttitudeTarget(quaternion_from_euler(0.0, 0.0, 0.0), 0.4))
        link.wait(lambda: bool(link.px.setpoints_received))
        assert link.px.setpoints_received[-1].target.throttle == pytest.approx(0.4)


def test_the_check_shows_the_table_of_the_autopilot_that_answers(tmp_path: Path) -> None:
    plan = prepare_flight(
        ROOT / "missions" / "short_hop.yaml", forgiving_config(tmp_path, height_datum="takeoff"), "none", None
    )
    with connected(SimulatedCopter(VEHICLE)) as link:
        findings = asyncio.run(inspect_autopilot(plan, link.adapter, 0.5, without_failsafe=True))
    rows = {" ".join(f.text.split()[:2]): f.text for f in findings if f.topic == "thrust chain"}
    assert "+3.5%" in rows["ATC_ANGLE_BOOST 1"]
    assert "by pressure and temperature" in rows["air density"]
    assert "+10.9%" in rows["air density"]


def test_the_check_takes_the_air_density_of_the_version_that_answers(tmp_path: Path) -> None:
    plan = prepare_flight(
        ROOT / "missions" / "short_hop.yaml", forgiving_config(tmp_path, height_datum="takeoff"), "none", None
    )
    with connected(Copter47(VEHICLE)) as link:
        findings = asyncio.run(inspect_autopilot(plan, link.adapter, 0.5, without_failsafe=True))
    (air,) = [f.text for f in findings if f.topic == "thrust chain" and f.text.startswith("air density")]
    assert air.startswith("air density 0.954 of sea level, by the standard atmosphere at its altitude above the sea")
    assert "+4.8%" in air
