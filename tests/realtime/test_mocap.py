"""`quadctl mocap`: poses of any motion-capture axes reach the autopilot as NED/FRD, and what is no pose does not."""

import asyncio
import json
import math
import os
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from typer.testing import CliRunner

from quadctl.cli import app
from quadctl.errors import FlightError, LinkError, QuadctlError
from quadctl.flight.autopilot.mavsdk_autopilot import MavsdkAutopilot
from quadctl.frames import euler_from_quaternion, quaternion_from_euler, rotate
from quadctl.mocap.agreement import Motion, tilt_problem, yaw_problem
from quadctl.mocap.axes import FRAMES, to_ned
from quadctl.mocap.forward import Forwarder
from quadctl.mocap.gate import Gate, Pose
from quadctl.mocap.sources import ReplaySource, parse_pose
from quadctl.mocap.statistics import Flow
from quadctl.mocap.urls import open_source
from quadctl.sitl.rules.copter import SimulatedCopter
from quadctl.sitl.rules.px4 import SimulatedAutopilot
from quadctl.sitl.server.server import MavlinkMock
from quadctl.state import Quat, Vec3, VehicleState
from quadctl.vehicle import load_vehicle
from tests.support.links import IDLE, RAPTOR, TIMEOUT_S, free_port, mock
from tests.support.places import ROOT

pytestmark = pytest.mark.realtime

VEHICLE = load_vehicle(RAPTOR)
SAME: Quat = (1.0, 0.0, 0.0, 0.0)
H = math.sqrt(0.5)

# --- axes ----------------------------------------------------------------------------------------------------------

# A vehicle 1 m north, 2 m east and 3 m up, its nose to the east, its right side down by 90 degrees: where each of its
# axes (forward, right, down) points, north, east, down, is known without any formula.
FORWARD_RIGHT_DOWN = ((0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (1.0, 0.0, 0.0))
NORTH_EAST_DOWN = (1.0, 2.0, -3.0)

# What each system measures of the directions north, east and down, and calls the body's forward, right and down.
WORLD: dict[str, Callable[[Vec3], Vec3]] = {
    "nwu": lambda v: (v[0], -v[1], -v[2]),
    "enu": lambda v: (v[1], v[0], -v[2]),
    "y_up": lambda v: (v[0], -v[2], v[1]),
    "ned": lambda v: v,
}
BODY: dict[str, Callable[[Vec3], Vec3]] = {**WORLD, "enu": WORLD["nwu"]}


def quaternion_of(columns: tuple[Vec3, Vec3, Vec3]) -> Quat:
    """Quaternion of the rotation that brings x, y, z to `columns`, by Shepperd's method where w is the largest."""
    (a, b, c), (d, e, f), (g, h, i) = columns
    values = [1 + a + e + i, 1 + a - e - i, 1 - a + e - i, 1 - a - e + i]
    largest = max(range(4), key=lambda n: values[n])
    s = 2.0 * math.sqrt(values[largest])
    rows: list[Quat] = [
        (s / 4, (f - h) / s, (g - c) / s, (b - d) / s),
        ((f - h) / s, s / 4, (b + d) / s, (g + c) / s),
        ((g - c) / s, (b + d) / s, s / 4, (f + h) / s),
        ((b - d) / s, (g + c) / s, (f + h) / s, s / 4),
    ]
    return rows[largest]


def as_measured(frame: str, axes: tuple[Vec3, Vec3, Vec3]) -> Quat:
    """The quaternion that a system with such axes gives a vehicle whose forward, right, down point so in NED."""
    basis: list[Vec3] = [(1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)]
    places = [BODY[frame](unit) for unit in basis]  # of forward, right, down among the system's body axes
    columns = []
    for axis in range(3):
        column = (0.0, 0.0, 0.0)
        for place, world in zip(places, axes, strict=True):
            seen = WORLD[frame](world)
            column = tuple(c + place[axis] * s for c, s in zip(column, seen, strict=True))
        columns.append(column)
    return quaternion_of((columns[0], columns[1], columns[2]))


@pytest.mark.parametrize("frame", FRAMES)
def test_a_known_place_and_attitude_comes_out_of_every_frame(frame: str) -> None:
    position, attitude = to_ned(WORLD[frame](NORTH_EAST_DOWN), as_measured(frame, FORWARD_RIGHT_DOWN), FRAMES[frame])
    assert position == pytest.approx(NORTH_EAST_DOWN)
    for unit, points_to in zip(((1, 0, 0), (0, 1, 0), (0, 0, 1)), FORWARD_RIGHT_DOWN, strict=True):
        assert rotate(attitude, unit) == pytest.approx(points_to, abs=1e-12)


ANGLE = st.floats(-1.4, 1.4)


@given(ANGLE, ANGLE, ANGLE, st.sampled_from(sorted(FRAMES)))
def test_any_attitude_comes_out_of_every_frame(roll: float, pitch: float, yaw: float, frame: str) -> None:
    wanted = quaternion_from_euler(roll, pitch, yaw)
    axes = (rotate(wanted, (1, 0, 0)), rotate(wanted, (0, 1, 0)), rotate(wanted, (0, 0, 1)))
    _, attitude = to_ned((0.0, 0.0, 0.0), as_measured(frame, axes), FRAMES[frame])
    assert euler_from_quaternion(attitude) == pytest.approx((roll, pitch, yaw), abs=1e-6)


def test_the_yaw_option_turns_place_and_heading() -> None:
    position, attitude = to_ned((1.0, 0.0, 0.0), SAME, FRAMES["nwu"], math.radians(90.0))
    assert position == pytest.approx((0.0, 1.0, 0.0))
    assert euler_from_quaternion(attitude) == pytest.approx((0.0, 0.0, math.radians(90.0)))


# --- agreement with the autopilot ------------------------------------------------------------------------------------


def test_swapped_axes_are_named_with_the_frame_that_would_fit() -> None:
    tilted = quaternion_from_euler(math.radians(5.0), 0.0, 2.0)
    assert tilt_problem(as_measured("nwu", ((1, 0, 0), (0, 1, 0), (0, 0, 1))), "nwu", tilted) == ""
    level_y_up = (H, H, 0.0, 0.0)  # z-up axes turned so that y is up: what nwu reads as a vehicle on its side
    assert "tilted 90 deg away" in tilt_problem(level_y_up, "nwu", SAME)
    upside_down = as_measured("ned", ((1, 0, 0), (0, -1, 0), (0, 0, -1)))
    assert "tilted 180 deg away" in tilt_problem(upside_down, "ned", SAME)


def test_a_rolled_vehicle_tells_swapped_body_axes() -> None:
    rolled, pitched = quaternion_from_euler(0.5, 0.0, 0.0), quaternion_from_euler(0.0, 0.5, 0.0)
    assert tilt_problem(rolled, "ned", rolled) == ""
    assert "define the rigid body anew" in tilt_problem(pitched, "ned", rolled)


def test_a_heading_that_is_far_off_is_told_with_the_option_that_mends_it() -> None:
    ours, theirs = quaternion_from_euler(0.0, 0.0, 3.0), quaternion_from_euler(0.0, 0.0, -1.5)
    assert yaw_problem(ours, quaternion_from_euler(0.0, 0.0, -3.0)) == ""
    problem = yaw_problem(ours, theirs)
    assert f"--yaw {math.degrees(-4.5 + 2 * math.pi):.0f}" in problem


def test_motion_in_another_direction_than_the_autopilots_is_told_once_per_half_metre() -> None:
    motion = Motion()
    origin = (0.0, 0.0, 0.0)
    assert motion.problem(origin, origin) == ""
    assert motion.problem((0.4, 0.0, 0.0), (0.0, 0.4, 0.0)) == ""
    assert "moves north by motion capture and west by the autopilot" in motion.problem((0.6, 0, 0), (0, -0.6, 0))
    assert motion.problem((0.7, 0, 0), (0, -0.7, 0)) == ""
    assert motion.problem((1.4, 0, 0), (0.7, -0.5, 0)) == ""


# --- what may pass -------------------------------------------------------------------------------------------------


def pose(at_s: float, x: float = 0.0, q: Quat = SAME, sent_s: float = math.nan) -> Pose:
    return Pose("raptor", at_s, (x, 0.0, 0.0), q, sent_s)


def test_only_numbers_of_unit_attitude_pass() -> None:
    gate = Gate()
    assert gate.objection(pose(0.0, math.nan), 0.0) == "not a number"
    assert gate.objection(pose(0.0, q=(math.inf, 0.0, 0.0, 0.0)), 0.0) == "not a number"
    assert gate.objection(pose(0.0, q=(0.0, 0.0, 0.0, 0.0)), 0.0) == "the quaternion is not of length 1"
    assert gate.objection(pose(0.0), 0.0) == ""


def test_a_pose_that_is_old_or_came_late_does_not_pass() -> None:
    gate = Gate()
    assert gate.objection(pose(1.0, 0.0), 1.2) == "stale"
    assert gate.objection(pose(2.0, 0.1, sent_s=1002.0), 2.0) == ""
    assert gate.objection(pose(3.0, 0.2, sent_s=1002.8), 3.0) == "stale"  # 0.2 s longer on its way than the one before
    assert gate.objection(pose(3.1, 0.3, sent_s=1003.05), 3.1) == ""


def test_a_pose_that_repeats_itself_does_not_pass_and_is_soon_called_frozen() -> None:
    gate = Gate()
    reasons = [gate.objection(pose(0.01 * i, 1.0), 0.01 * i) for i in range(13)]
    assert reasons[0] == ""
    assert set(reasons[1:10]) == {"repeated"}
    assert reasons[-1] == "frozen"
    assert gate.objection(pose(0.2, 1.001), 0.2) == ""


def test_a_jump_does_not_pass_and_the_new_place_does_when_it_could_have_been_reached() -> None:
    gate = Gate()
    assert gate.objection(pose(0.0, 0.0), 0.0) == ""
    assert gate.objection(pose(0.01, 3.0), 0.01) == "jumped"
    assert gate.objection(pose(0.02, 0.01), 0.02) == ""
    assert gate.objection(pose(0.22, 3.0), 0.22) == ""


def test_rate_age_and_dropouts_are_counted() -> None:
    flow = Flow()
    for i in range(101):
        flow.add(0.01 * i + (0.5 if i > 50 else 0.0), 0.002)
    assert flow.rate_hz(None) == pytest.approx(100 / 1.5)
    assert (flow.dropouts, flow.longest_gap_s) == (1, pytest.approx(0.51))
    assert "age when sent 2.0 ms" in flow.line()


def test_a_silent_autopilot_and_a_link_that_is_down_are_told() -> None:
    sent: list[dict[str, object]] = []
    there = True

    def send(fields: dict[str, object]) -> None:
        if not there:
            raise LinkError("unplugged")
        sent.append(fields)

    forwarder = Forwarder(send, lambda: VehicleState(0.0, connected=there), "nwu", 0.0)
    assert forwarder.take(pose(0.0, 0.0), 0.0) == []
    there = False
    assert forwarder.take(pose(0.01, 0.01), 0.01) == ["the autopilot has gone silent"]
    assert forwarder.take(pose(0.02, 0.02), 0.02) == []
    there = True
    assert forwarder.take(pose(0.03, 0.03), 0.03) == ["the autopilot is heard again"]
    assert (len(sent), forwarder.flow.sent) == (2, 2)
    assert forwarder.flow.withheld == {"with the link down": 2}


# --- sources -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "data",
    [b"", b"\xff", b"[]", b"7", b'{"position": [1, 2], "quaternion": [1, 0, 0, 0]}', b'{"position": 1}', b"{" * 9999],
)
def test_a_datagram_that_is_no_pose_is_none(data: bytes) -> None:
    assert parse_pose(data, 0.0) is None


@pytest.mark.parametrize("url", ["udp://nowhere", "udp://:5005", "vicon:", "serial:///dev/x", "", "replay:"])
def test_a_source_that_cannot_be_is_one_sentence(url: str) -> None:
    with pytest.raises(LinkError, match="expected udp://"):
        open_source(url, "raptor")


def test_a_recording_is_given_at_its_own_pace(tmp_path: Path) -> None:
    path = tmp_path / "poses.jsonl"
    path.write_text("\n".join(datagram((0.1 * i, 0.0, 1.0), SAME, time_s=50.0 + 0.05 * i) for i in range(3)))
    with ReplaySource(path, "raptor") as source:
        found = [source.receive(TIMEOUT_S) for _ in range(3)]
    assert [p.position[0] for p in found if p] == pytest.approx([0.0, 0.1, 0.2])
    assert found[2] is not None and found[0] is not None
    assert found[2].received_s - found[0].received_s >= 0.09
    path.write_text('{"position": [1, 2, 3], "quaternion": [1, 0, 0, 0]}\n')
    with pytest.raises(QuadctlError, match=r"poses.jsonl, line 1: is no pose with a time"):
        ReplaySource(path, "raptor")


LIBRARY = """
import time, types

rotation = types.SimpleNamespace(w=1.0, x=0.0, y=0.0, z=0.0)

class System:
    rigidBodies = {n: types.SimpleNamespace(position=[1.0, 2.0, 3.0], rotation=rotation) for n in ("raptor", "box")}

    def waitForNextFrame(self):
        time.sleep(0.005)

def connect(system, settings):
    assert settings == {"hostname": "10.0.0.5"}
    if system == "vicon":
        time.sleep(60.0)
    if system == "qualisys":
        raise RuntimeError("no route")
    return System()
"""


@pytest.fixture
def library(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """A package `motioncapture` in the place of the real one, which needs cameras."""
    (tmp_path / "motioncapture.py").write_text(LIBRARY)
    monkeypatch.syspath_prepend(tmp_path)


def first_pose(url: str) -> Pose:
    with open_source(url, "raptor") as source:
        end_s = time.monotonic() + TIMEOUT_S
        while time.monotonic() < end_s:
            found = source.receive(0.05)
            if found is not None:
                return found
    raise AssertionError("no pose came")


@pytest.mark.usefixtures("library")
def test_a_motion_capture_system_gives_the_body_that_is_asked_for() -> None:
    found = first_pose("vrpn://10.0.0.5")
    assert (found.name, found.position, found.quaternion) == ("raptor", (1.0, 2.0, 3.0), SAME)


@pytest.mark.usefixtures("library")
def test_a_system_that_fails_or_does_not_answer_is_one_sentence(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(LinkError, match=r"qualisys://10\.0\.0\.5 cannot be read: no route"):
        first_pose("qualisys://10.0.0.5")
    monkeypatch.setattr("quadctl.mocap.capture.CONNECT_S", 0.1)
    with pytest.raises(LinkError, match=r"vicon://10\.0\.0\.5 does not answer"):
        first_pose("vicon://10.0.0.5")


def test_without_the_package_the_sentence_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("importlib.util.find_spec", lambda _: None)
    with pytest.raises(LinkError, match=r"pip install 'quadctl\[mocap\]'"):
        open_source("vrpn://10.0.0.5", "raptor")


# --- over MAVLink --------------------------------------------------------------------------------------------------


def datagram(position: Vec3, quaternion: Quat, time_s: float | None = None, name: str = "raptor") -> str:
    fields = {"name": name, "position": position, "quaternion": quaternion}
    return json.dumps(fields if time_s is None else {**fields, "time": time_s})


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
        finally:
            asyncio.run(flight.close())
