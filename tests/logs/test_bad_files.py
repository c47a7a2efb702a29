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
    "mcap": "cannot be read as a ROS bag",
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
