"""Serial ports and what is plugged in."""

import json
from pathlib import Path

import pytest
from serial.tools import list_ports
from serial.tools.list_ports_common import ListPortInfo
from typer.testing import CliRunner

from quadctl.cli import app
from quadctl.flight.autopilot import ports


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


def likely(dev: Path, monkeypatch: pytest.MonkeyPatch, *listed: str) -> list[tuple[str, str]]:
    """The ports at which `auto` listens, by their names in the folder `dev`."""
    monkeypatch.setattr(ports, "DEV", dev)
    monkeypatch.setattr(list_ports, "comports", lambda: [plugged(str(dev / name), None, None) for name in listed])
    return [(Path(port.device).name, port.what) for port in ports.serial_ports() if port.likely]


PINS = "UART on the pins of a Raspberry Pi (serial0)"


@pytest.mark.parametrize("listed", [[], ["ttyS0"]], ids=["not listed by pyserial", "listed by pyserial"])
def test_the_mini_uart_behind_serial0_is_listened_to(
    listed: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "ttyS0").touch()
    (tmp_path / "serial0").symlink_to("ttyS0")
    assert likely(tmp_path, monkeypatch, *listed) == [("ttyS0", PINS)]


def test_a_uart_with_two_names_is_listened_to_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "ttyAMA0").touch()
    (tmp_path / "serial0").symlink_to("ttyAMA0")
    assert likely(tmp_path, monkeypatch, "ttyS0", "ttyAMA0") == [("ttyAMA0", PINS)]


def test_a_serial0_that_leads_nowhere_is_none(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "serial0").symlink_to("ttyS0")
    assert likely(tmp_path, monkeypatch) == []


def test_the_uarts_of_a_jetson_are_listened_to(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("ttyTHS1", "ttyTHS0", "ttyS0"):
        (tmp_path / name).touch()
    assert likely(tmp_path, monkeypatch, "ttyS0") == [("ttyTHS0", "UART of a Jetson"), ("ttyTHS1", "UART of a Jetson")]


def test_the_command_lists_them(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(list_ports, "comports", lambda: [plugged("/dev/ttyACM0", 0x26AC, "PX4 FMU v6X.x")])
    result = CliRunner().invoke(app, ["ports", "--json", str(tmp_path / "out.json")])
    assert result.exit_code == 0
    (port,) = json.loads((tmp_path / "out.json").read_text())["ports"]
    assert port == {"device": "/dev/ttyACM0", "what": "3D Robotics autopilot (PX4 FMU v6X.x)", "likely": True}
