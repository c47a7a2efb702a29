"""`clean_log`, the last step of every reader: what it leaves out is said, what no log can be is refused."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from quadctl.errors import LogError
from quadctl.logs.cleaning import clean_log
from quadctl.logs.columns import STATE_COLUMNS
from quadctl.logs.findings import Kind, finding

PATH = Path("flight.abc")


def table(**columns: Any) -> dict[str, Any]:
    """A table of 200 rows with the required columns, in which time increases by 0.02 s and everything else is 1."""
    required: dict[str, Any] = dict.fromkeys(STATE_COLUMNS, np.ones(200))
    return required | {"time_s": 0.02 * np.arange(200)} | columns


def with_value(at: int, value: float) -> np.ndarray[Any, Any]:
    values = np.ones(200)
    values[at] = value
    return values


class TestCleanLog:
    def test_a_clean_table_becomes_a_log_without_notes(self) -> None:
        log = clean_log(PATH, table(phase=["hover"] * 200, motor1_rpm=[5000] * 200))
        assert (log.name, log.path, log.notes, log.meta) == ("flight.abc", PATH, [], {})
        assert (len(log), log.n_rotors, log.phase[0] if log.phase is not None else "") == (200, 1, "hover")

    def test_the_table_stays_as_it_is(self) -> None:
        given = table(battery_v=with_value(3, np.inf))
        clean_log(PATH, given)["x_m"][:] = 7.0
        assert given["battery_v"][3] == np.inf
        assert given["x_m"][0] == 1.0

    def test_a_column_with_an_unknown_name_is_left_out(self) -> None:
        log = clean_log(PATH, table(batery_v=np.ones(200), remark=["text"] * 200))
        assert set(log.columns) == set(STATE_COLUMNS)
        assert log.notes == [
            "column 'batery_v' is not a flight log's and was left out (did you mean 'battery_v'?)",
            "column 'remark' is not a flight log's and was left out",
        ]

    def test_rows_before_the_first_position_are_left_out(self) -> None:
        x = np.ones(200)
        x[:5] = np.nan
        log = clean_log(PATH, table(x_m=x))
        assert (len(log), log.time_s[0]) == (195, 0.1)
        assert log.notes == ["5 rows before the first known position left out (from row 1)"]

    def test_rows_in_which_time_does_not_increase_are_left_out(self) -> None:
        time_s = 0.02 * np.arange(200)
        time_s[7] = 99.0
        log = clean_log(PATH, table(time_s=time_s, phase=[str(i) for i in range(200)]))
        assert len(log) == 199 and np.all(np.diff(log.time_s) > 0.0)
        assert log.phase is not None and log.phase[7] == "8"
        assert log.notes == ["1 row in which time does not increase left out, the first is row 8 (time_s = 99)"]

    def test_messages_name_the_line_of_the_file_where_the_reader_knows_it(self) -> None:
        time_s = 0.02 * np.arange(200)
        time_s[7] = 99.0
        log = clean_log(PATH, table(time_s=time_s), line_numbers=np.arange(200) + 30)
        assert log.notes[0].endswith("the first is line 37 (time_s = 99)")

    @pytest.mark.parametrize(
        ("column", "value", "note"),
        [
            ("battery_v", np.inf, "1 infinite value of battery_v read as missing"),
            ("battery_v", 1e15, "1 impossible value of battery_v (beyond 1e+12) read as missing"),
            ("motor1_rpm", 4e5, "1 impossible value of motor1_rpm (beyond 300000) read as missing"),
        ],
    )
    def test_a_value_that_cannot_be_is_missing(self, column: str, value: float, note: str) -> None:
        log = clean_log(PATH, table(**{column: with_value(3, value)}))
        assert np.flatnonzero(np.isnan(log[column])).tolist() == [3]
        assert log.notes == [note]

    def test_the_reader_s_own_notes_come_first(self) -> None:
        log = clean_log(PATH, table(remark=np.ones(200)), findings=[finding(Kind.DAMAGED_BYTES, bytes=3)])
        assert log.notes[0] == "3 damaged bytes left out" and len(log.notes) == 2

    def test_the_sidecar_beside_the_file_is_read_unless_the_reader_knows_better(self, tmp_path: Path) -> None:
        path = tmp_path / "flight.abc"
        (tmp_path / "flight.meta.yaml").write_text("mission: step\n")
        assert clean_log(path, table()).meta == {"mission": "step"}
        assert clean_log(path, table(), meta={"vehicle": "x"}).meta == {"vehicle": "x"}

    @pytest.mark.parametrize(
        ("columns", "said"),
        [
            ({"motor2_rpm": np.ones(200)}, "the table lacks motor1_rpm, expected motor1_rpm to motorN_rpm"),
            ({"x_m": np.full(200, np.nan)}, "no row has time and position, expected finite time_s"),
            ({"time_s": np.ones(200)}, "time does not increase in 199 rows of 200"),
            ({"battery_v": ["full"] * 200}, "column 'battery_v' holds no numbers, expected one for each row"),
            ({"battery_v": np.ones(3)}, "column 'battery_v' has 3 values, expected 200 as time_s has"),
        ],
    )
    def test_what_is_no_flight_is_one_sentence(self, columns: dict[str, Any], said: str) -> None:
        with pytest.raises(LogError) as refused:
            clean_log(PATH, table(**columns))
        assert str(refused.value).startswith("flight.abc: ") and said in str(refused.value)

    @pytest.mark.parametrize("column", STATE_COLUMNS)
    def test_the_state_is_required(self, column: str) -> None:
        short = table()
        del short[column]
        with pytest.raises(LogError, match=f"flight.abc: the table lacks {column}, expected a flight log's columns"):
            clean_log(PATH, short)
