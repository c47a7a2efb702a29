"""Bags that end early, as after a crash: what is whole is read, and it is said that the rest is gone."""

import shutil
import sqlite3
from pathlib import Path

import numpy as np
import pytest

from quadctl.errors import LogError
from quadctl.logs.findings import Kind, of_kind
from quadctl.logs.read import read_log
from tests.support.bags import INTERVAL_NS, small_bag, written_bag
from tests.support.places import DATA

MESSAGES = 400
KINDS = [
    (".mcap", ""),
    (".mcap", "lz4"),
    (".mcap", "zstd"),
    (".db3", ""),
    (".bag", ""),
    (".bag", "lz4"),
    (".bag", "bz2"),
]
"""Suffix and packing."""
EXAMPLE = DATA / "reports" / "21-cut-bag" / "flight.mcap"


@pytest.mark.parametrize(("suffix", "packing"), KINDS)
class TestCutShort:
    @pytest.mark.parametrize("share", [0.5, 0.7, 0.8, 0.95])
    def test_the_messages_before_the_cut_are_read(
        self, suffix: str, packing: str, share: float, tmp_path: Path
    ) -> None:
        whole = small_bag(suffix, MESSAGES, packing)
        path = tmp_path / f"a{suffix}"
        path.write_bytes(whole[: int(share * len(whole))])
        log = read_log(path)
        assert of_kind(log.findings, Kind.CUT_SHORT)
        steps = np.diff(log.time_s) / (1e-9 * INTERVAL_NS)
        assert steps[:-10] == pytest.approx(1.0)  # SQLite may have put the last ones elsewhere
        assert log["z_m"] == pytest.approx(1.0)
        assert (share - 0.2) * MESSAGES < len(log) <= MESSAGES

    def test_a_whole_one_is_not_called_cut(self, suffix: str, packing: str, tmp_path: Path) -> None:
        path = tmp_path / f"a{suffix}"
        path.write_bytes(small_bag(suffix, MESSAGES, packing))
        log = read_log(path)
        assert len(log) == MESSAGES
        assert not of_kind(log.findings, Kind.CUT_SHORT, Kind.DAMAGED)

    def test_without_its_last_byte_all_messages_are_there(self, suffix: str, packing: str, tmp_path: Path) -> None:
        path = tmp_path / f"a{suffix}"
        path.write_bytes(small_bag(suffix, MESSAGES, packing)[:-1])
        assert len(read_log(path)) >= MESSAGES - 8  # the last page of a database may hold some

    def test_cut_and_damaged_anywhere_it_is_a_log_or_one_sentence(
        self, suffix: str, packing: str, tmp_path: Path
    ) -> None:
        random = np.random.default_rng(5)
        whole = small_bag(suffix, MESSAGES, packing)
        path = tmp_path / f"a{suffix}"
        outcomes = set()
        for _ in range(40):
            data = bytearray(whole[: random.integers(1, len(whole) + 1)])
            for at in random.integers(0, len(data), 3):
                data[at : at + random.integers(1, 20)] = random.bytes(int(random.integers(0, 20)))
            path.write_bytes(data)
            try:
                outcomes.add(len(read_log(path)) > 0)
            except LogError as error:
                assert str(path) in str(error) and "\n" not in str(error)
                outcomes.add(False)
        assert outcomes == {True, False}


class TestFolder:
    @pytest.mark.parametrize("suffix", [".mcap", ".db3"])
    def test_a_cut_file_in_it(self, suffix: str, tmp_path: Path) -> None:
        file = written_bag(tmp_path / "bag", suffix, MESSAGES)
        file.write_bytes(file.read_bytes()[: file.stat().st_size * 3 // 4])
        log = read_log(tmp_path / "bag")
        assert MESSAGES // 2 < len(log) < MESSAGES
        assert of_kind(log.findings, Kind.CUT_SHORT)

    @pytest.mark.parametrize("suffix", [".mcap", ".db3"])
    def test_the_recorder_did_not_come_to_write_its_metadata(self, suffix: str, tmp_path: Path) -> None:
        """The files of a bag of ROS 2 are named by its folder, and numbered."""
        file = written_bag(tmp_path / "flight", suffix, MESSAGES)
        (tmp_path / "flight" / "metadata.yaml").unlink()
        file.rename(file.with_name(f"flight_0{suffix}"))
        log = read_log(tmp_path / "flight")
        assert len(log) == MESSAGES
        assert of_kind(log.findings, Kind.CUT_SHORT)

    def test_several_files_are_one_flight(self, tmp_path: Path) -> None:
        (tmp_path / "flight").mkdir()
        whole = small_bag(".mcap", MESSAGES)
        for number in range(2):
            (tmp_path / "flight" / f"flight_{number}.mcap").write_bytes(whole)
        assert len(read_log(tmp_path / "flight")) == MESSAGES  # the same times twice

    def test_a_folder_of_anything_else_is_none(self, tmp_path: Path) -> None:
        (tmp_path / "flights").mkdir()
        (tmp_path / "flights" / "monday.mcap").write_bytes(small_bag())
        with pytest.raises(LogError, match="is a directory, expected a flight log"):
            read_log(tmp_path / "flights")


class TestDamage:
    @pytest.mark.parametrize("suffix", [".mcap", ".bag"])
    def test_a_damaged_part_of_a_bag_with_an_end_costs_that_part(self, suffix: str, tmp_path: Path) -> None:
        data = bytearray(small_bag(suffix, MESSAGES, "lz4" if suffix == ".bag" else ""))
        at = len(data) // 2 if suffix == ".bag" else data.index(b"base_link", len(data) // 2)
        data[at : at + 4] = b"\xff\xff\xff\xff"
        path = tmp_path / f"a{suffix}"
        path.write_bytes(data)
        try:
            log = read_log(path)
        except LogError as error:
            assert "cannot be read as a ROS bag" in str(error)
        else:
            assert of_kind(log.findings, Kind.DAMAGED)
            assert len(log) < MESSAGES

    def test_where_nothing_is_whole_the_sentence_says_what_may_help(self, tmp_path: Path) -> None:
        for suffix, remedy in (
            (".mcap", "mcap recover"),
            (".bag", "rosbag reindex"),
            (".db3", "sqlite3 FILE .recover"),
        ):
            path = tmp_path / f"a{suffix}"
            path.write_bytes(small_bag(suffix)[:300])
            with pytest.raises(LogError, match=f"cannot be read as a ROS bag .*`{remedy}`"):
                read_log(path)

    def test_what_a_killed_recorder_left_in_the_journal_is_read(self, tmp_path: Path) -> None:
        """As SQLite leaves it, whose file alone holds nothing yet."""
        file = written_bag(tmp_path / "bag", ".db3", MESSAGES)
        live = sqlite3.connect(tmp_path / "live.db3")
        live.execute("PRAGMA journal_mode = WAL")
        live.execute("PRAGMA wal_autocheckpoint = 0")
        live.execute(f"ATTACH '{file}' AS whole")
        for name, sql in live.execute("SELECT name, sql FROM whole.sqlite_master WHERE type = 'table'").fetchall():
            live.execute(sql)
            live.execute(f"INSERT INTO main.{name} SELECT * FROM whole.{name}")
        live.commit()
        for end in ("", "-wal"):
            shutil.copy(tmp_path / f"live.db3{end}", tmp_path / f"killed.db3{end}")
        live.close()
        assert len(read_log(tmp_path / "killed.db3")) == MESSAGES


@pytest.mark.skipif(not EXAMPLE.is_file(), reason="the examples of bug reports are not here")
def test_a_bag_of_a_flight_whose_last_fifth_is_missing() -> None:
    log = read_log(EXAMPLE)
    assert log.time_s[-1] == pytest.approx(55.0, abs=5.0)
    assert of_kind(log.findings, Kind.CUT_SHORT)
