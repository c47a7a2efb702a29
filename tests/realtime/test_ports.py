"""The autopilot is found among serial ports and on UDP."""

from pathlib import Path

import pytest

from quadctl.errors import LinkError
from quadctl.flight.autopilot import ports
from quadctl.sitl.rules.copter import SimulatedCopter
from quadctl.sitl.rules.px4 import SimulatedAutopilot
from quadctl.vehicle import load_vehicle
from studies.serial_line import SerialLine
from tests.support.links import RAPTOR, free_port, mock

pytestmark = pytest.mark.realtime


def test_an_autopilot_is_found_on_a_serial_line(tmp_path: Path) -> None:
    carried, udp = free_port(), free_port()
    with SerialLine(tmp_path / "tty", carried) as line, mock(SimulatedCopter(load_vehicle(RAPTOR)), carried):
        found = ports.find_autopilot([str(tmp_path / "nothing"), str(line.device)], udp)
    assert found == f"serial://{line.device}:{ports.BAUD_RATES[0]}"


def test_an_autopilot_is_found_on_udp() -> None:
    udp = free_port()
    with mock(SimulatedAutopilot(load_vehicle(RAPTOR)), udp):
        assert ports.find_autopilot([], udp) == f"udpin://0.0.0.0:{udp}"


def test_where_no_autopilot_is_heard_all_that_was_tried_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ports, "LISTEN_S", 0.01)
    udp = free_port()
    with pytest.raises(LinkError) as error:
        ports.find_autopilot(["/dev/no-such-tty"], udp)
    assert str(error.value).startswith(
        f"No autopilot is heard at udpin://0.0.0.0:{udp}, serial:///dev/no-such-tty: check that it is powered"
    )
