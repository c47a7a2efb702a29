"""Bad files of every kind of log on the command line: one sentence naming file and expectation; never a traceback."""

from collections.abc import Callable
from pathlib import Path

import pytest

from tests.support.commands import Result

GARBAGE = b"\x00\xffgarbage" * 40
KINDS = {
    "ulg": "does not begin as a PX4 ULog does, expected a .ulg file of PX4",
    "bin": "describes no message that is needed, expected an ArduPilot DataFlash log",
    "tlog": "holds no readable MAVLink message, expected a telemetry log",
    "mcap": "does not begin as a ROS bag does, expected a .mcap file",
    "db3": "does not begin as a ROS bag does, expected a .db3 file",
    "bag": "does not begin as a ROS bag does, expected a .bag file",
    "parquet": "does not begin as Parquet does, expected a .parquet file",
    "csv": "is not a text file, expected a CSV flight log",
}


def refused(done: Result, said: str) -> None:
    assert done.status == 1, done.out
    assert "Traceback" not in done.err
    assert said in " ".join(done.err.split())


@pytest.mark.parametrize(("suffix", "said"), KINDS.items())
def test_garbage(quadctl: Callable[..., Result], tmp_path: Path, suffix: str, said: str) -> None:
    (tmp_path / f"log.{suffix}").write_bytes(GARBAGE)
    refused(quadctl("logs", tmp_path / f"log.{suffix}"), f"log.{suffix}: {said}")


@pytest.mark.parametrize("magic", [b"\x89MCAP0\r\n", b"SQLite format 3\0", b"#ROSBAG V2.0\n"])
def test_a_bag_of_which_only_the_beginning_is_right_is_named_as_the_user_knows_it(
    quadctl: Callable[..., Result], tmp_path: Path, magic: bytes
) -> None:
    (tmp_path / "my.bag").write_bytes(magic + GARBAGE)
    done = quadctl("logs", tmp_path / "my.bag")
    refused(done, f"{tmp_path / 'my.bag'}: cannot be read as a ROS bag")
    assert "bag.db3" not in done.err


@pytest.mark.parametrize("suffix", KINDS)
def test_an_empty_file(quadctl: Callable[..., Result], tmp_path: Path, suffix: str) -> None:
    (tmp_path / f"log.{suffix}").touch()
    refused(quadctl("logs", tmp_path / f"log.{suffix}"), f"log.{suffix}: is empty, expected a flight log")


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("", "map.yaml: is empty, expected settings in YAML"),
        ("time: later", "map.yaml: time is 'later', expected keys and values"),
        ("vehicle: {}", "map.yaml: unknown key 'vehicle', expected one of: attitude"),
    ],
)
def test_a_map_that_is_none(quadctl: Callable[..., Result], tmp_path: Path, content: str, said: str) -> None:
    (tmp_path / "map.yaml").write_text(content)
    (tmp_path / "table.csv").write_text("a,b\n1,2\n")
    refused(quadctl("logs", "--map", tmp_path / "map.yaml", tmp_path / "table.csv"), said)
