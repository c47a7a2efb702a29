"""The start on a PX4 as measured: it checks offboard only half a second after it has entered it."""

from pathlib import Path

import pytest

from quadctl.sitl.rules.px4 import SimulatedAutopilot
from quadctl.sitl.server.px4 import MavlinkPx4
from quadctl.vehicle import load_vehicle
from tests.support.flight_process import START_TIMEOUT_S, Flight
from tests.support.links import RAPTOR, free_port

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
