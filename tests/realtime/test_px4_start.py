"""The start on a PX4 as measured: it checks offboard only half a second after it has entered it."""

import asyncio
from collections.abc import Callable
from pathlib import Path

import pytest

from quadctl.errors import FlightError
from quadctl.sitl.rules.px4 import SimulatedAutopilot
from quadctl.sitl.server.px4 import MavlinkPx4
from quadctl.vehicle import load_vehicle
from tests.support.commands import Result
from tests.support.flight_process import START_TIMEOUT_S, Flight
from tests.support.links import RAPTOR, connected, free_port, mock

pytestmark = pytest.mark.realtime

NO_MAG = "Preflight Fail: no magnetometer"


def test_the_first_flight_after_boot_arms(tmp_path: Path) -> None:
    """SYS_STATUS speaks of offboard, unchecked, while CURRENT_MODE still says hold; heartbeats come every second."""
    px4, port = SimulatedAutopilot(load_vehicle(RAPTOR)), free_port()
    with MavlinkPx4(px4, port):
        flight = Flight(tmp_path, f"udpin://127.0.0.1:{port}")
        flight.until_recorded("takeoff")
        flight.process.send_signal(2)
        _, told = flight.ended()
    assert "asked to land by SIGINT after" in told


def test_an_empty_battery_is_refused_by_check_and_is_the_reason_why_offboard_is_not_entered(
    quadctl: Callable[..., Result],
) -> None:
    """PX4 accepts offboard, and stays in hold."""
    px4 = SimulatedAutopilot(load_vehicle(RAPTOR))
    px4.battery_remaining, px4.battery_alarm = 0.0, "critical"
    empty = "the autopilot calls the battery critical (0 % of the battery is left)"
    port = free_port()
    with mock(px4, port):
        asked = quadctl("check", "missions/short_hop.yaml", "--link", f"udpin://127.0.0.1:{port}", "--seconds", "1")
    assert asked.status == 1
    assert f"left: {empty}" in asked.out, asked
    with connected(px4) as link:
        asyncio.run(link.adapter.request_telemetry())
        asyncio.run(link.until(lambda s: bool(s.battery_alarm)))
        with pytest.raises(
            FlightError, match=r"accepted to enter OFFBOARD, but no heartbeat shows it .*; the autopilot"
        ):
            asyncio.run(link.adapter.start_offboard())


def test_a_lasting_refusal_is_told_with_its_reasons_and_offboard_is_left(tmp_path: Path) -> None:
    px4, port = SimulatedAutopilot(load_vehicle(RAPTOR)), free_port()
    with MavlinkPx4(px4, port) as px:
        flight = Flight(tmp_path, f"udpin://127.0.0.1:{port}")
        assert px.wait_until(lambda: px4.mode == "OFFBOARD", START_TIMEOUT_S)
        px.faults.refuse_arming = NO_MAG
        _, told = flight.ended()
        assert px4.mode == "HOLD"
        assert not px4.armed
    assert f"refused to arm: TEMPORARILY_REJECTED; {NO_MAG}" in told.split("the flight was not completed")[1]
