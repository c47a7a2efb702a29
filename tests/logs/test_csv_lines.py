"""Lines that are plain are read the fast way, others the slow way; nobody can tell which from the log."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from quadctl.errors import LogError
from quadctl.logs import csv_log
from quadctl.logs.columns import STATE_COLUMNS
from quadctl.logs.csv_log import read_csv
from quadctl.logs.flight_log import FlightLog
from tests.support.log_files import assert_same

ROWS = 60
HEADER = ",".join([*STATE_COLUMNS, "phase", "battery_v"])


def plain() -> list[str]:
    """Lines of a log: a header, and rows in which one value is missing and one not a number."""
    random = np.random.default_rng(1)
    rows = [[0.02 * i, *random.standard_normal(len(STATE_COLUMNS) - 1)] for i in range(ROWS)]
    lines = [",".join([*map(repr, map(float, row)), "hover" if i > 9 else "", "16.1"]) for i, row in enumerate(rows)]
    lines[20] = lines[20].replace(",hover", ",").replace(lines[20].split(",")[4], "", 1)
    lines[21] = lines[21].replace(lines[21].split(",")[5], "nan", 1)
    return [HEADER, *lines]


def cut_short(lines: list[str]) -> None:
    lines[30] = lines[30].rsplit(",", 2)[0]


def blank(lines: list[str]) -> None:
    lines[30] = "  "


def of_text(lines: list[str]) -> None:
    lines[30] = lines[30].replace("16.1", "much")


def with_more(lines: list[str]) -> None:
    lines[30] += ",7"


def with_blanks(lines: list[str]) -> None:
    lines[30] = lines[30].replace(",", " , ") + " "


def quoted(lines: list[str]) -> None:
    lines[30] = lines[30].replace("hover", '"hover, low"')


def as_it_is(lines: list[str]) -> None:
    return


def both_ways(path: Path, monkeypatch: pytest.MonkeyPatch) -> tuple[FlightLog, FlightLog]:
    fast = read_csv(path)
    monkeypatch.setattr(csv_log, "_plain_part", lambda *_: None)
    return fast, read_csv(path)


@pytest.mark.parametrize("spoil", [as_it_is, cut_short, blank, of_text, with_more, with_blanks, quoted])
@pytest.mark.parametrize(("begin", "end"), [("", "\n"), ("\ufeff", "\r\n"), ("\n\n", "\n")])
def test_both_ways_read_the_same_log(
    spoil: Callable[[list[str]], None], begin: str, end: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    lines = plain()
    spoil(lines)
    path = tmp_path / "flight.csv"
    path.write_bytes((begin + end.join([*lines, ""])).encode())
    fast, slow = both_ways(path, monkeypatch)
    assert_same(fast, slow)
    np.testing.assert_array_equal(fast.phase, slow.phase)


def test_a_plain_log_is_read_the_fast_way(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "flight.csv"
    path.write_text("\n".join([*plain(), ""]))
    monkeypatch.setattr(csv_log, "_part", lambda *_: pytest.fail("the slow way"))
    assert len(read_csv(path)) == ROWS


def test_both_ways_refuse_a_header_without_rows(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "flight.csv"
    path.write_text(HEADER + "\n")
    with pytest.raises(LogError, match="has a header and no complete row"):
        read_csv(path)
