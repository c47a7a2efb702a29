"""The autopilot's words reach the user: refusals with their reasons, and every text of a flight."""

import asyncio
import json
from collections.abc import Callable
from pathlib import Path

import pytest
import yaml

from quadctl.errors import FlightError
from quadctl.sitl.rules.copter import SimulatedCopter
from quadctl.sitl.rules.px4 import SimulatedAutopilot
from quadctl.vehicle import load_vehicle
from tests.support.commands import Result
from tests.support.flight_process import Flight
from tests.support.links import RAPTOR, connected, free_port, meet_requirements, mock

pytestmark = pytest.mark.realtime

VEHICLE = load_vehicle(RAPTOR)
STATION, COMPANION = (1, 6), (1, 18)
"""System and type of our heartbeats: MAV_TYPE_GCS, MAV_TYPE_ONBOARD_CONTROLLER."""
LONG = "Preflight Fail: height estimate is not stable, check the barometer and its foam, then try again in a moment"


def test_px4_tells_its_reasons_only_to_a_ground_station_and_in_chunks() -> None:
    with connected(SimulatedAutopilot(VEHICLE)) as link:
        link.wait(lambda: STATION in link.px.heartbeats_heard)
        link.px.autopilot.said.append((4, LONG))
        link.wait(lambda: bool(link.adapter.state().texts))
        (text,) = link.adapter.state().texts
        assert str(text) == f"the autopilot says (warning): {LONG}"
        link.px.faults.refuse_arming = LONG
        with pytest.raises(FlightError, match=f"refused to arm: TEMPORARILY_REJECTED; {LONG}"):
            asyncio.run(link.adapter.arm())


def test_two_heartbeats_of_ours_come_to_each_of_mavsdk() -> None:
    with connected(SimulatedAutopilot(VEHICLE)) as link:
        heard = link.px.heartbeats_heard
        link.wait(lambda: heard[COMPANION] >= 4)  # MAVSDK's, once a second
        assert heard[STATION] >= 6


def test_ardupilot_hears_no_ground_station_whose_heartbeats_its_failsafe_could_take_for_ours() -> None:
    with connected(SimulatedCopter(VEHICLE)) as link:
        asyncio.run(link.pass_time(2.5))
        assert set(link.px.heartbeats_heard) == {COMPANION}
        link.px.autopilot.said.append((4, LONG))
        link.wait(lambda: [text.text for text in link.adapter.state().texts] == [LONG])


@pytest.mark.parametrize("kind", [SimulatedAutopilot, SimulatedCopter])
def test_the_residual_of_the_model_reaches_the_autopilot_for_the_stations_behind_it(
    kind: type[SimulatedAutopilot],
) -> None:
    with connected(kind(VEHICLE)) as link:
        link.adapter.tell("residual", (0.25, -0.5, 1.0))
        link.wait(lambda: bool(link.px.vectors_received))
        (vector,) = link.px.vectors_received
        assert (vector.name, vector.x, vector.y, vector.z) == ("residual", 0.25, -0.5, 1.0)


@pytest.fixture
def impatient(monkeypatch: pytest.MonkeyPatch) -> None:
    """Check without waiting for what does not come."""
    monkeypatch.setattr("quadctl.flight.pilot.guards.BOOT_TIMEOUT_S", 1.5)


@pytest.mark.usefixtures("impatient")
@pytest.mark.parametrize(
    ("kind", "reason"),
    [(SimulatedAutopilot, "Preflight Fail: ekf2 missing data"), (SimulatedCopter, "PreArm: EKF attitude is bad")],
)
def test_check_refuses_an_autopilot_that_would_not_arm_with_its_reasons(
    kind: type[SimulatedAutopilot], reason: str, quadctl: Callable[..., Result]
) -> None:
    autopilot, port = kind(VEHICLE), free_port()
    autopilot.ready_after_s = 1e9
    with mock(autopilot, port):
        asked = quadctl("check", "missions/short_hop.yaml", "--link", f"udpin://127.0.0.1:{port}", "--seconds", "1")
    lines = asked.out.splitlines()
    assert asked.status == 1
    assert any(line.startswith("refused  mode") and "it would not arm" in line for line in lines), asked
    assert f"warning  autopilot    the autopilot says (critical): {reason}" in lines, asked


@pytest.mark.usefixtures("impatient")
def test_reasons_that_px4_tells_as_events_only_are_told_too(quadctl: Callable[..., Result]) -> None:
    px4, port = SimulatedAutopilot(VEHICLE), free_port()
    px4.ready_after_s = 1e9
    px = mock(px4, port)
    px.faults.withheld = frozenset({"STATUSTEXT"})
    with px:
        asked = quadctl("check", "missions/short_hop.yaml", "--link", f"udpin://127.0.0.1:{port}", "--seconds", "1")
    reasons = "Waiting for estimator to initialize; Navigation error: No valid position estimate"
    assert f"its own checks do not pass ({reasons}): it would not arm" in asked.out, asked


def test_check_waits_as_a_flight_does_until_the_autopilot_is_ready(quadctl: Callable[..., Result]) -> None:
    px4, port = SimulatedAutopilot(VEHICLE), free_port()
    px4.ready_after_s = 6.0
    with mock(px4, port):
        asked = quadctl("check", "missions/short_hop.yaml", "--link", f"udpin://127.0.0.1:{port}", "--seconds", "1")
    assert asked.status == 0, asked
    assert px4.time_s > 6.0


def test_ardupilot_without_its_own_checks_is_warned_of_and_waited_for(quadctl: Callable[..., Result]) -> None:
    """With ARMING_CHECK 0, SYS_STATUS lists the check as one that is not in use, and never as healthy."""
    copter, port = SimulatedCopter(VEHICLE), free_port()
    meet_requirements(copter)
    copter.parameters["ARMING_CHECK"] = 0.0
    copter.ready_after_s = 4.0  # its estimator
    with mock(copter, port):
        asked = quadctl("check", "missions/short_hop.yaml", "--link", f"udpin://127.0.0.1:{port}", "--seconds", "1")
    assert (
        "warning  mode         STABILIZE, disarmed: its own checks before arming are off (ARMING_CHECK is 0)"
        in asked.out
    )
    assert asked.status == 0, asked
    assert copter.time_s > 4.0


def test_check_says_that_px4_in_offboard_does_not_tell_if_it_would_arm(quadctl: Callable[..., Result]) -> None:
    px4, port = SimulatedAutopilot(VEHICLE), free_port()
    px4._enter("OFFBOARD")  # as after a flight
    with mock(px4, port):
        asked = quadctl("check", "missions/short_hop.yaml", "--link", f"udpin://127.0.0.1:{port}", "--seconds", "1")
    assert "warning  mode         OFFBOARD, disarmed: in this mode it does not say if it would arm" in asked.out


@pytest.mark.parametrize(
    ("kind", "said", "ended"),
    [
        (SimulatedAutopilot, "Battery failure", "left offboard for HOLD"),
        (SimulatedCopter, "Battery 1 is low", "left offboard for LAND"),
    ],
)
def test_the_text_of_a_failsafe_is_printed_and_logged(
    kind: type[SimulatedAutopilot], said: str, ended: str, tmp_path: Path
) -> None:
    autopilot, port, result = kind(VEHICLE), free_port(), tmp_path / "out.json"
    if isinstance(autopilot, SimulatedCopter):
        meet_requirements(autopilot)
    autopilot.parameters["COM_DISARM_LAND"] = 0.3
    with mock(autopilot, port):
        flight = Flight(tmp_path, f"udpin://127.0.0.1:{port}", "--json", str(result))
        flight.until_recorded("hover")
        autopilot.fail_battery()
        log, told = flight.ended()
    assert told.count(f"the autopilot says (critical): {said}") == 2  # when it came, and at the end
    assert ended in told
    *_, text = json.loads(result.read_text())["texts"]
    assert said in text
    (path,) = tmp_path.glob("*.meta.yaml")
    (event,) = [event for event in yaml.safe_load(path.read_text())["events"] if said in event["what"]]
    assert event["what"] == text
    assert 0.0 < event["time_s"] < log.time_s[-1]


def test_an_autopilot_that_is_killed_is_called_gone(tmp_path: Path) -> None:
    px4, port = SimulatedAutopilot(VEHICLE), free_port()
    px = mock(px4, port)
    with px:
        flight = Flight(tmp_path, f"udpin://127.0.0.1:{port}", guards={"max_over_time_s": 14.0})
        flight.until_recorded("hover")
        px.stop()
        _, told = flight.ended()
    assert "Sending message failed" not in told  # MAVSDK says so at every heartbeat, from 10 s on
    assert "did not land and disarm in 14 s; the autopilot is gone" in told
    (path,) = tmp_path.glob("*.meta.yaml")
    whats = [event["what"] for event in yaml.safe_load(path.read_text())["events"]]
    assert "the autopilot is gone: nothing comes from it" in whats
