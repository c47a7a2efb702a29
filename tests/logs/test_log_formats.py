"""Any format: told by its content, damaged or not, there and back."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from quadctl.errors import LogError
from quadctl.logs.csv_log import read_csv, write_csv
from quadctl.logs.read import read_log
from tests.support.log_files import sentence_of, small_dataflash, small_ulog, telemetry, tlog_bytes

SMALL: dict[str, Callable[[], bytes]] = {
    ".ulg": small_ulog,
    ".bin": small_dataflash,
    ".tlog": lambda: tlog_bytes(telemetry()),
}


class TestAnyFormat:
    @pytest.mark.parametrize("suffix", SMALL)
    def test_is_told_by_its_content(self, tmp_path: Path, suffix: str) -> None:
        named, renamed = tmp_path / f"a{suffix}", tmp_path / "a.log"
        for path in (named, renamed):
            path.write_bytes(SMALL[suffix]())
        assert read_log(renamed).columns.keys() == read_log(named).columns.keys()

    @pytest.mark.parametrize("suffix", SMALL)
    @pytest.mark.parametrize("content", [b"", b"x", b"time_s,x_m\n0,1\n" * 9, bytes(4000), bytes(range(256)) * 20])
    def test_something_else_under_its_name_is_one_sentence(self, tmp_path: Path, suffix: str, content: bytes) -> None:
        path = tmp_path / f"a{suffix}"
        path.write_bytes(content)
        assert "expected" in sentence_of(path)

    @pytest.mark.parametrize("suffix", SMALL)
    def test_damage_gives_a_log_or_one_sentence(self, tmp_path: Path, suffix: str) -> None:
        random = np.random.default_rng(7)
        whole = SMALL[suffix]()
        path = tmp_path / f"a{suffix}"
        outcomes = set()
        for _ in range(60):
            data = bytearray(whole[: random.integers(1, len(whole) + 1)])
            for at in random.integers(0, len(data), 4):
                data[at : at + random.integers(1, 20)] = random.bytes(int(random.integers(0, 20)))
            path.write_bytes(data)
            try:
                outcomes.add(len(read_log(path)) > 0)
            except LogError as error:
                assert "\n" not in str(error)
                outcomes.add(False)
        assert outcomes == {True, False}

    @pytest.mark.parametrize("suffix", SMALL)
    def test_comes_back_from_csv(self, tmp_path: Path, suffix: str) -> None:
        path = tmp_path / f"a{suffix}"
        path.write_bytes(SMALL[suffix]())
        log = read_log(path)
        write_csv(log, tmp_path / "b.csv")
        again = read_csv(tmp_path / "b.csv")
        known = np.isfinite(log["x_m"])
        for name in log.columns:
            np.testing.assert_array_equal(again[name], log[name][np.argmax(known) :])
        assert again.meta == log.meta

    def test_missing_file_is_missing(self, tmp_path: Path) -> None:
        assert sentence_of(tmp_path / "a.ulg").endswith("there is no such file")
