"""Any format: told by its content, damaged or not, there and back; a new one is one file and one line."""

import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from pkgutil import resolve_name

import numpy as np
import pytest

from quadctl.errors import LogError
from quadctl.logs.columns import STATE_COLUMNS
from quadctl.logs.convert import write_parquet
from quadctl.logs.csv_log import read_csv, write_csv
from quadctl.logs.flight_log import FlightLog
from quadctl.logs.formats import CONVERTERS, FORMATS, writer
from quadctl.logs.read import read_log
from tests.support.bags import small_bag
from tests.support.log_files import sentence_of, small_dataflash, small_ulog, telemetry, tlog_bytes
from tests.support.places import ROOT


def small_parquet() -> bytes:
    """Whole numbers of a flight, as `quadctl logs --to parquet` writes them."""
    columns = {name: np.arange(200.0) for name in STATE_COLUMNS}
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "a.parquet"
        write_parquet(FlightLog(path.name, path, columns), path)
        return path.read_bytes()


SMALL: dict[str, Callable[[], bytes]] = {
    ".ulg": small_ulog,
    ".bin": small_dataflash,
    ".tlog": lambda: tlog_bytes(telemetry()),
    ".mcap": small_bag,
    ".parquet": small_parquet,
}
"""A small whole file of each format that is recognised by its content."""


class TestAnyFormat:
    def test_is_tested_here(self) -> None:
        assert SMALL.keys() == {form.suffix for form in FORMATS if form.recogniser is not None}

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
        needs_its_end = suffix == ".parquet"  # where its index is
        assert outcomes == ({False} if needs_its_end else {True, False})

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


class TestNewFormat:
    """A module with its functions and one entry in a table: reader, commands and page know it."""

    MODULE = """
from pathlib import Path
import numpy as np
from quadctl.logs.cleaning import clean_log
from quadctl.logs.columns import STATE_COLUMNS

def is_toy(head):
    return head.startswith(b"TOY")

def read_toy(path):
    time_s = np.array(path.read_text().split()[1:], dtype=float)
    return clean_log(path, dict.fromkeys(STATE_COLUMNS, 0.0 * time_s) | {"time_s": time_s})

def write_toy(log, path):
    path.write_text(" ".join(["TOY", *map(str, log.time_s.tolist())]))
"""
    ENTRY = """
import sys
from quadctl.logs import formats
formats.FORMATS += (formats.LogFormat("Toy", ".toy", "toy:read_toy", "toy:is_toy"),)
formats.CONVERTERS["toy"] = "toy:write_toy"
"""

    @pytest.fixture
    def run(self, tmp_path: Path) -> Callable[[str], str]:
        """Run code after the entry was made, in a folder with a log of that format; what it prints."""
        (tmp_path / "toy.py").write_text(self.MODULE)
        (tmp_path / "flight.log").write_text("TOY 0 0.5 1")

        def run(code: str) -> str:
            code = f"import sys; sys.path[:0] = [{str(tmp_path)!r}, {str(ROOT)!r}]\n{self.ENTRY}\n{code}"
            command = [sys.executable, "-c", code]
            return subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=True).stdout

        return run

    def test_is_read_and_written(self, run: Callable[[str], str], tmp_path: Path) -> None:
        read = "from quadctl.logs.read import read_log; log = read_log('flight.log'); print(len(log))"
        assert run(read) == "3\n"
        run(f"{read}; from quadctl.logs.convert import convert; convert(log, 'toy')")
        assert (tmp_path / "flight.toy").read_text() == "TOY 0.0 0.5 1.0"

    def test_is_in_the_help_and_guarded_by_the_commands(self, run: Callable[[str], str]) -> None:
        helped = run("sys.argv = ['quadctl', 'logs', '--help']; from quadctl.cli import main; main()")
        helped = " ".join(helped.split())
        assert f"{FORMATS[-1].suffix}, .toy" in helped and "csv|parquet|mcap|toy" in helped
        refused = "from quadctl.errors import QuadctlError\nfrom pathlib import Path\n"
        refused += "from quadctl.cli.overwriting import check_outputs\n"
        refused += "try: check_outputs([], Path('a.toy'))\nexcept QuadctlError as error: print(error)"
        assert "is the name of a flight log" in run(refused)

    def test_may_be_dropped_on_the_page(self, run: Callable[[str], str]) -> None:
        dropped = "from pathlib import Path; from quadctl.web.session.files import upload_path; "
        assert run(dropped + "print(upload_path(Path('in'), 'a.toy'))") == "in/a.toy\n"
        assert "Toy (.toy)" in run("from quadctl.logs.formats import labels; print(labels())")


def test_every_function_that_the_tables_name_is_there() -> None:
    for form in FORMATS:
        assert callable(resolve_name(form.reader)) and (
            form.recogniser is None or callable(resolve_name(form.recogniser))
        )
    assert all(callable(writer(to)) for to in CONVERTERS)


def test_formats_are_listed_without_their_libraries() -> None:
    code = "import sys, quadctl.logs.formats; print([m for m in ('numpy', 'polars', 'pyulog') if m in sys.modules])"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout == "[]\n"
