"""Sources of poses: datagrams, recordings, and motion-capture systems."""

import time
from pathlib import Path

import pytest

from quadctl.errors import LinkError, QuadctlError
from quadctl.mocap.capture import open_source
from quadctl.mocap.gate import Pose
from quadctl.mocap.sources import ReplaySource, parse_pose
from quadctl.state import Quat
from tests.support.links import TIMEOUT_S
from tests.support.mocap import datagram

SAME: Quat = (1.0, 0.0, 0.0, 0.0)


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
