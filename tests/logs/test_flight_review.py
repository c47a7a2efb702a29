"""A folder of Flight Review 2 is the same flight as the ULog that it was written from; a bad one is one sentence."""

import json
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from pyulog import ULog

from quadctl.errors import LogError
from quadctl.logs.flight_log import ATTITUDE, POSITION, RATES, VELOCITY
from quadctl.logs.parameters import read_present_parameters
from quadctl.logs.read import read_log
from quadctl.web.session.start import first_session
from tests.support.commands import Result
from tests.support.log_files import small_ulog
from tests.support.places import DATA

REAL = DATA / "real" / "px4" / "forward_runs.ulg"


def flight_review(ulog: Path, folder: Path) -> Path:
    """The ULog as converter.rs and metadata.rs of PX4's flight-review-rs write it, as far as it is read."""
    log = ULog(str(ulog))
    folder.mkdir()
    for data in log.data_list:
        name = data.name if data.multi_id == 0 else f"{data.name}_{data.multi_id}"
        pl.DataFrame(dict(data.data)).write_parquet(folder / f"{name}.parquet", compression="zstd")
    levels = ("EMERGENCY", "ALERT", "CRITICAL", "ERROR", "WARNING", "NOTICE", "INFO", "DEBUG")
    messages = [
        {"level": levels[m.log_level - ord("0")], "timestamp_us": m.timestamp, "message": m.message}
        for m in log.logged_messages
    ]
    about = {"sys_name": "PX4", "ver_sw_release": log.msg_info_dict.get("ver_sw_release"), "logged_messages": messages}
    changed = [{"name": name, "value": value, "in_flight": True} for _, name, value in log.changed_parameters]
    about |= {"parameters": log.initial_parameters, "changed_parameters": changed}
    (folder / "metadata.json").write_text(json.dumps(about))
    return folder


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "small.ulg").write_bytes(small_ulog())
    return flight_review(tmp_path / "small.ulg", tmp_path / "small")


def assert_same(folder: Path, ulog: Path) -> None:
    found, expected = read_log(folder), read_log(ulog)
    assert found.columns.keys() == expected.columns.keys()
    for name in expected.columns:
        assert np.array_equal(found[name], expected[name], equal_nan=True), name
    assert found.meta["parameters"] == expected.meta["parameters"]


def test_it_is_the_same_flight_as_its_ulog(folder: Path, tmp_path: Path) -> None:
    assert_same(folder, tmp_path / "small.ulg")


@pytest.mark.long
@pytest.mark.skipif(not REAL.is_file(), reason="the recordings of real autopilots are not here")
def test_a_real_flight_with_its_parameters_and_messages(tmp_path: Path) -> None:
    folder = flight_review(REAL, tmp_path / "real")
    assert_same(folder, REAL)
    log = read_log(folder)
    assert set(POSITION + VELOCITY + ATTITUDE + RATES) <= log.columns.keys()
    assert {e["what"] for e in log.meta["events"]} <= {e["what"] for e in read_log(REAL).meta["events"]}
    assert log.meta["software"] == read_log(REAL).meta["software"]
    assert read_present_parameters(folder) == read_present_parameters(REAL)


def test_commands_and_the_page_take_the_folder(quadctl: Callable[..., Result], folder: Path) -> None:
    assert quadctl("logs", folder).status == 0
    assert first_session([folder], None, None).logs == (folder,)


def test_without_metadata_the_parameters_are_unknown(folder: Path) -> None:
    (folder / "metadata.json").unlink()
    assert "has no parameters of the autopilot in metadata.json" in read_log(folder).notes


class TestBad:
    @pytest.mark.parametrize(
        ("content", "said"),
        [
            ("[1]", "cannot be understood"),
            ("{", "cannot be understood"),
            ('{"parameters": {"MPC_THR_HOVER": "high"}}', "cannot be understood"),
            ('{"logged_messages": [{"text": "hello"}]}', "cannot be understood"),
        ],
    )
    def test_metadata(self, folder: Path, content: str, said: str) -> None:
        (folder / "metadata.json").write_text(content)
        with pytest.raises(LogError, match=re.escape(f"{folder / 'metadata.json'}: {said}")) as caught:
            read_log(folder)
        assert "\n" not in str(caught.value)

    def test_a_topic_that_is_damaged(self, folder: Path) -> None:
        path = folder / "vehicle_attitude.parquet"
        path.write_bytes(path.read_bytes()[:200])
        with pytest.raises(LogError, match="cannot be read as Parquet") as caught:
            read_log(folder)
        assert str(path) in str(caught.value) and "\n" not in str(caught.value)

    def test_a_flight_without_position(self, folder: Path) -> None:
        (folder / "vehicle_local_position.parquet").unlink()
        with pytest.raises(LogError, match="expected messages vehicle_local_position and vehicle_attitude"):
            read_log(folder)

    def test_one_topic_alone(self, folder: Path) -> None:
        with pytest.raises(LogError, match="is one topic of a flight, expected the folder"):
            read_log(folder / "vehicle_local_position.parquet")
