"""`quadctl mocap`: poses of any motion-capture axes reach the autopilot as NED/FRD, and what is no pose does not."""

import asyncio
import math
import os
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from typer.testing import CliRunner

from quadctl.cli import app
from quadctl.errors import FlightError
from quadctl.flight.autopilot.mavlink import MOCAP_SYSTEM_ID, OWN_SYSTEM_ID
from quadctl.flight.autopilot.mavsdk_autopilot import MavsdkAutopilot
from quadctl.sitl.rules.copter import SimulatedCopter
from quadctl.sitl.rules.px4 import SimulatedAutopilot
from quadctl.sitl.server.server import MavlinkMock
from quadctl.state import Quat
from quadctl.vehicle import load_vehicle
from tests.support.links import IDLE, RAPTOR, TIMEOUT_S, free_port, mock
from tests.support.mocap import datagram
from tests.support.places import ROOT

pytestmark = pytest.mark.realtime

VEHICLE = load_vehicle(RAPTOR)
SAME: Quat = (1.0, 0.0, 0.0, 0.0)
H = math.sqrt(0.5)


class Cameras:
    """Send the pose of one body at 100 Hz to a UDP port; what they see may be changed."""

    def __init__(self, port: int) -> None:
        self.quaternion: Quat = SAME
        self.height_m = 1.0
        self.frozen = self.blind = False
        self._port = port
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run)

    def __enter__(self) -> "Cameras":
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stopping.set()
        self._thread.join()

    def _run(self) -> None:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as out:
            i = 0
            while not self._stopping.wait(0.01):
                i += not self.frozen
                data = datagram((0.001 * (i % 7), 0.5, self.height_m), self.quaternion)
                if not self.blind:
                    out.sendto(data.encode(), ("127.0.0.1", self._port))


class Mocap:
    """`quadctl mocap` in a process of its own."""

    def __init__(self, source: str, link_port: int, *words: str) -> None:
        command = ["mocap", "--source", source, "--link", f"udpin://127.0.0.1:{link_port}", "--body", "raptor", *words]
        self.process = subprocess.Popen(
            [sys.executable, "-c", "from quadctl.cli import main; main()", *command],
            cwd=ROOT,
            env={**os.environ, "PYTHONPATH": str(ROOT), "PYTHONUNBUFFERED": "1"},
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )

    def ended(self) -> str:
        """All that was said."""
        out, err = self.process.communicate(timeout=TIMEOUT_S)
        return out + err


@contextmanager
def seen_by_cameras(px: MavlinkMock, link_port: int, *words: str) -> Iterator[tuple[Cameras, Mocap]]:
    camera_port = free_port()
    with Cameras(camera_port) as cameras:
        mocap = Mocap(f"udp://127.0.0.1:{camera_port}", link_port, *words)
        try:
            yield cameras, mocap
        finally:
            mocap.process.kill()
            mocap.process.communicate()


def more_poses(px: MavlinkMock, count: int) -> bool:
    wanted = len(px.vision_poses_received) + count
    return px.wait_until(lambda: len(px.vision_poses_received) >= wanted, TIMEOUT_S)


def silent_for(px: MavlinkMock, seconds: float) -> bool:
    """True where no pose arrives for `seconds` of the vehicle's time, after a moment for those under way."""
    settled_s = px.autopilot.time_s + 0.3
    assert px.wait_until(lambda: px.autopilot.time_s > settled_s, TIMEOUT_S)
    before = len(px.vision_poses_received)
    assert px.wait_until(lambda: px.autopilot.time_s > settled_s + seconds, TIMEOUT_S)
    return len(px.vision_poses_received) == before


def test_poses_reach_the_autopilot_and_what_is_no_pose_does_not() -> None:
    """The whole life of one run: forwarding, a body that freezes, is seen again, turns over, and the end by Ctrl-C."""
    port = free_port()
    with mock(SimulatedAutopilot(VEHICLE), port) as px, seen_by_cameras(px, port) as (cameras, mocap):
        assert more_poses(px, 20)
        first_s = px.autopilot.time_s
        assert more_poses(px, 100)
        assert px.autopilot.time_s - first_s < 2.0  # 50 Hz or more
        message = px.vision_poses_received[-1]
        assert (message.y, message.z) == pytest.approx((-0.5, -1.0))
        assert (message.roll, message.pitch, message.yaw) == pytest.approx((0.0, 0.0, 0.0), abs=1e-6)
        assert math.isnan(message.covariance[0])

        cameras.frozen = True
        assert silent_for(px, 0.3)
        cameras.frozen = False
        assert more_poses(px, 5)
        cameras.blind = True
        assert silent_for(px, 0.3)
        cameras.blind = False
        assert more_poses(px, 5)
        cameras.height_m = math.nan
        assert silent_for(px, 0.3)
        cameras.height_m = 1.0
        assert more_poses(px, 5)
        cameras.quaternion = (0.0, 1.0, 0.0, 0.0)  # upside down, which the autopilot is not
        px.wait_until(lambda: False, 0.6)
        assert silent_for(px, 0.3)
        mocap.process.send_signal(signal.SIGINT)
        said = mocap.ended()
    assert mocap.process.returncode == 0
    assert said.count("and the autopilot's own failsafe acts") == 4
    assert said.count("back after") == 3
    assert "tilted 180 deg away from the autopilot's attitude" in said
    assert "age when sent" in said
    for reason in ("frozen", "not a number", "against the autopilot's attitude"):
        assert reason in said


def test_an_autopilot_without_an_origin_is_given_one_and_another_keeps_its_own() -> None:
    """Without one PX4 does not get ready in hold: it needs a global position there."""
    asked, port = ("--origin", "47.3977,8.5456,488"), free_port()
    with mock(SimulatedAutopilot(VEHICLE), port) as px:
        for words, own, expected, said in (
            ((), None, None, "--origin LATITUDE,LONGITUDE,ALTITUDE gives it one"),
            (asked, None, (473977000, 85456000, 488000), "the autopilot has taken the origin"),
            (asked, (1, 2, 3), (1, 2, 3), "the autopilot has an origin already"),
        ):
            px.origin = own
            with seen_by_cameras(px, port, *words) as (_, mocap):
                assert more_poses(px, 10)
                assert px.origin == expected
                mocap.process.send_signal(signal.SIGINT)
                assert said in mocap.ended()


@pytest.mark.parametrize("origin", ["47.4,8.5", "here", "95,8,400", "nan,8,400"])
def test_an_origin_that_is_none_is_refused(origin: str) -> None:
    words = ["mocap", "--source", "udp://127.0.0.1:1", "--link", "udpin://127.0.0.1:1", "--body", "raptor"]
    result = CliRunner().invoke(app, [*words, "--origin", origin])
    assert result.exit_code == 2
    assert "--origin is" in result.output


def test_axes_that_contradict_gravity_are_refused_before_anything_is_sent() -> None:
    port = free_port()
    with mock(SimulatedCopter(VEHICLE), port) as px, seen_by_cameras(px, port, "--frame", "ned") as (cameras, mocap):
        cameras.quaternion = (H, H, 0.0, 0.0)
        said = mocap.ended()
        assert "Nothing is forwarded: the rigid body is tilted 90 deg away" in said
        assert mocap.process.returncode == 1
        assert px.vision_poses_received == []


def test_a_body_that_never_comes_is_told_with_those_that_do(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr("quadctl.mocap.forward.FIRST_POSE_S", 0.2)
    path, port = tmp_path / "poses.jsonl", free_port()
    path.write_text(datagram((0.0, 0.0, 0.0), SAME, 0.0, name="box"))
    with mock(SimulatedAutopilot(VEHICLE), port):
        words = ["mocap", "--source", f"replay:{path}", "--link", f"udpin://127.0.0.1:{port}", "--body", "raptor"]
        result = CliRunner().invoke(app, words)
    assert isinstance(result.exception, FlightError)
    assert "(seen: box): check --body" in str(result.exception)


def test_it_works_beside_a_flight_on_a_link_of_its_own() -> None:
    """Two programs, two ports of one autopilot: targets of the one and poses of the other both arrive."""
    flight_port, mocap_port = free_port(), free_port()
    flight = MavsdkAutopilot(f"udpin://127.0.0.1:{flight_port}", 4)
    px = mock(SimulatedAutopilot(VEHICLE), flight_port)
    px.also_send_to(mocap_port)
    with px:
        asyncio.run(flight.connect())
        try:
            with seen_by_cameras(px, mocap_port):
                assert more_poses(px, 10)
                for _ in range(10):
                    flight.send(IDLE)
                assert px.wait_until(lambda: len(px.setpoints_received) == 10, TIMEOUT_S)
                assert more_poses(px, 10)
                # Told apart, so that those of the one do not stand for those of a flight that has died.
                apart = {OWN_SYSTEM_ID, MOCAP_SYSTEM_ID}
                assert px.wait_until(lambda: {system for system, _ in px.heartbeats_heard} == apart, TIMEOUT_S)
        finally:
            asyncio.run(flight.close())
