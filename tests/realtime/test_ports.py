"""Serial ports and what is plugged in; the autopilot found among them."""

import json
from pathlib import Path

import pytest
from serial.tools import list_ports
from serial.tools.list_ports_common import ListPortInfo
from typer.testing import CliRunner

from quadctl.cli import app
from quadctl.errors import LinkError
from quadctl.flight.autopilot import ports
from quadctl.sitl.rules.copter import SimulatedCopter
from quadctl.sitl.rules.px4 import SimulatedAutopilot
from quadctl.vehicle import load_vehicle
from tests.support.links import RAPTOR, SerialLine, free_port, mock

pytestmark = pytest.mark.realtime


def plugged(device: str, vendor: int | None, product: str | None) -> ListPortInfo:
    info = ListPortInfo(device)
    info.vid, info.product = vendor, product
    return info


def test_what_is_plugged_in_is_named_and_the_likely_ones_come_first(monkeypatch: pytest.MonkeyPatch) -> None:
    there = [
        plugged("/dev/ttyS0", None, None),
        plugged("/dev/ttyUSB0", 0x0403, "FT232R USB UART"),
        plugged("/dev/ttyAMA0", None, None),
        plugged("/dev/ttyACM0", 0x26AC, "PX4 FMU v6X.x"),
    ]
    monkeypatch.setattr(list_ports, "comports", lambda: there)
    assert [(port.device, port.what, port.likely) for port in ports.serial_ports()] == [
        ("/dev/ttyACM0", "3D Robotics autopilot (PX4 FMU v6X.x)", True),
        ("/dev/ttyAMA0", "UART of a Raspberry Pi", True),
        ("/dev/ttyUSB0", "FTDI adapter (FT232R USB UART)", True),
        ("/dev/ttyS0", "unknown", False),
    ]


def test_the_command_lists_them(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(list_ports, "comports", lambda: [plugged("/dev/ttyACM0", 0x26AC, "PX4 FMU v6X.x")])
    result = CliRunner().invoke(app, ["ports", "--json", str(tmp_path / "out.json")])
    assert result.exit_code == 0
    (port,) = json.loads((tmp_path / "out.json").read_text())["ports"]
    assert port == {"device": "/dev/ttyACM0", "what": "3D Robotics autopilot (PX4 FMU v6X.x)", "likely": True}


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
