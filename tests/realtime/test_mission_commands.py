"""`quadctl check` with an autopilot on the wire."""

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
import yaml

from quadctl.sitl.rules.copter import SimulatedCopter
from quadctl.sitl.rules.px4 import SimulatedAutopilot
from quadctl.sitl.server.faults import nan_position
from quadctl.sitl.server.server import MavlinkMock
from quadctl.vehicle import Vehicle
from tests.support.commands import Result
from tests.support.links import free_port, mock
from tests.support.places import ROOT

pytestmark = pytest.mark.realtime


@pytest.fixture
def px4(raptor: Vehicle) -> Iterator[tuple[MavlinkMock, str]]:
    """A PX4 on the wire and its URL."""
    port = free_port()
    with mock(SimulatedAutopilot(raptor), port) as px:
        yield px, f"udpin://127.0.0.1:{port}"


def test_the_autopilot_is_asked_over_mavlink(quadctl: Callable[..., Result], px4: tuple[MavlinkMock, str]) -> None:
    autopilot, url = px4
    autopilot.autopilot.parameters |= {"COM_OF_LOSS_T": 5.0, "COM_OBL_RC_ACT": 4.0}
    asked = quadctl("check", "missions/short_hop.yaml", "--link", url, "--seconds", "1")
    assert asked.status == 0, asked
    lines = asked.out.splitlines()
    assert any(line.startswith("ok       autopilot    PX4 (system 1)") for line in lines)
    assert "warning  parameters   COM_OF_LOSS_T: acts 5 s after the last setpoint: expected at most 1 s" in lines
    assert "ok       parameters   COM_OBL_RC_ACT: when setpoints stop it goes to Land (4)" in lines
    assert any(line.startswith("ok       mode         HOLD, disarmed") for line in lines)
    trusts = "EKF2_NOAID_TOUT: without GPS or motion capture the estimator trusts itself for 5 s: expected 1000000"
    assert any(line.startswith(f"warning  parameters   {trusts} (--set-params does it)") for line in lines)
    assert not autopilot.setpoints_received  # nothing moves


def test_what_an_ardupilot_lacks_is_refused_as_a_flight_would_refuse_it(
    quadctl: Callable[..., Result], raptor: Vehicle
) -> None:
    port = free_port()
    with mock(SimulatedCopter(raptor), port):
        link = f"udpin://127.0.0.1:{port}"
        asked = quadctl("check", "missions/short_hop.yaml", "--link", link, "--seconds", "1")
    assert asked.status == 1
    lines = asked.out.splitlines()
    expected = "refused  parameters   GUID_OPTIONS = 0: expected 8 (--set-params does it): with bit 3 (value 8) clear"
    assert any(line.startswith(expected) for line in lines), asked
    assert any(line.startswith("warning  parameters   GUID_TIMEOUT = 3: expected 0.5") for line in lines)
    assert "must not be flown like this" in asked.err


def test_an_ardupilot_that_nobody_would_land_after_quadctl_has_died_is_refused(
    quadctl: Callable[..., Result], raptor: Vehicle
) -> None:
    port, copter = free_port(), SimulatedCopter(raptor)
    copter.parameters |= {"GUID_OPTIONS": 8.0, "RTL_ALT": 1500.0, "FS_THR_ENABLE": 0.0}
    ask = ("check", "missions/short_hop.yaml", "--link", f"udpin://127.0.0.1:{port}", "--seconds", "1")
    with mock(copter, port):
        asked = quadctl(*ask)
        accepted = quadctl(*ask, "--without-failsafe", "--system-id", "42")
    assert (asked.status, accepted.status) == (1, 0), accepted
    lines = asked.out.splitlines()
    expected = (
        "parameters   FS_GCS_ENABLE: after quadctl has died it goes on (0): expected 5 (--set-params does it): when"
    )
    assert any(line.startswith(f"refused  {expected}") for line in lines), asked
    assert any(line.startswith(f"warning  {expected}") for line in accepted.out.splitlines())
    expected = (
        "the ground-station failsafe watches the heartbeats of system 255: expected 1 (--set-params does it): its"
    )
    assert any(line.startswith(f"refused  parameters   SYSID_MYGCS: {expected}") for line in lines), asked
    assert "heartbeats of system 255: expected 42 (--set-params does it)" in accepted.out
    assert any(
        "FS_GCS_TIMEOUT: the ground-station failsafe acts 5 s after the last heartbeat" in line for line in lines
    )
    remote = "FS_THR_ENABLE: when the remote control is lost it does nothing (0): expected 3 (Land)"
    assert f"warning  parameters   {remote}" in lines
    climb = "RTL_ALT: a return climbs to 15 m first: there is a ceiling at 2.6 m; expected failsafes that land, or 0"
    assert f"warning  parameters   {climb} (keep the height)" in lines
    assert "ok       parameters   FS_EKF_ACTION: when the estimate is lost it lands (1)" in lines


def test_an_autopilot_without_a_position_is_refused(
    quadctl: Callable[..., Result], px4: tuple[MavlinkMock, str]
) -> None:
    autopilot, url = px4
    autopilot.faults.distort = nan_position
    asked = quadctl("check", "missions/short_hop.yaml", "--link", url, "--seconds", "1")
    assert asked.status == 1
    assert "refused  estimator" in asked.out


def test_a_link_without_an_autopilot_is_one_sentence(quadctl: Callable[..., Result], tmp_path: Path) -> None:
    config = tmp_path / "flight.yaml"
    vehicle = ROOT / "config/vehicles/raptor.yaml"
    config.write_text(yaml.safe_dump({"vehicle": str(vehicle), "link": {"timeout_s": 0.3}}))
    silent = quadctl("check", "missions/short_hop.yaml", "--config", config, "--link", "udpin://127.0.0.1:14999")
    assert (silent.status, silent.err.count("\n")) == (1, 1)
    assert "No autopilot answers" in silent.err
