"""Flight logs are read as they are: what can be left out is said in a note, what cannot is one sentence."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from quadctl.errors import LogError
from quadctl.logs.cleaning import increasing
from quadctl.logs.columns import STATE_COLUMNS
from quadctl.logs.csv_log import read_csv, write_csv
from quadctl.logs.flight_log import POSITION, FlightLog, Floats
from quadctl.logs.read import read_log, read_logs
from quadctl.logs.sidecar import meta_path
from tests.support.places import DATA

RAPTOR = DATA / "raptor"
needs_raptor = pytest.mark.skipif(not RAPTOR.is_dir(), reason="the public RAPTOR logs are not here")

HEADER = ",".join(STATE_COLUMNS)
Write = Callable[[str | bytes], Path]


@pytest.fixture
def write(tmp_path: Path) -> Write:
    def write(content: str | bytes) -> Path:
        path = tmp_path / "flight.csv"
        path.write_bytes(content.encode() if isinstance(content, str) else content)
        return path

    return write


def row(time_s: object, n_columns: int = 13, z_m: object = 1.0) -> str:
    return ",".join([str(time_s), "0.5", "0.25", str(z_m), *["0.125"] * (n_columns - 4)])


def rows(n: int, n_columns: int = 13) -> list[str]:
    return [row(i / 50, n_columns) for i in range(n)]


def text(*lines: str) -> str:
    return "".join(line + "\n" for line in lines)


def sentence_of(path: Path) -> str:
    with pytest.raises(LogError) as caught:
        read_csv(path)
    message = str(caught.value)
    assert str(path) in message
    assert "\n" not in message
    return message


class TestOurs:
    def test_has_the_columns_of_its_header_and_no_notes(self, write: Write) -> None:
        log = read_csv(
            write(text(HEADER + ",battery_v,phase", "0,1,2,3,4,5,6,7,8,9,10,11,12,16.5,settle", row(0.02) + ",16,step"))
        )
        assert len(log) == 2
        assert [log[name][0] for name in STATE_COLUMNS] == list(range(13))
        assert log["battery_v"].tolist() == [16.5, 16.0]
        assert log.phase is not None
        assert log.phase.tolist() == ["settle", "step"]
        assert log.notes == []

    def test_comes_back_from_a_file_as_it_was(self, tmp_path: Path) -> None:
        random = np.random.default_rng(1)
        names = [*STATE_COLUMNS, *(f"motor{i}_rpm" for i in range(1, 7)), "throttle_cmd", "z_ref_m"]
        columns: dict[str, Floats] = {
            name: random.normal(0.0, 1.0, 20) * 10.0 ** random.integers(-9, 9) for name in names
        }
        columns["time_s"] = np.linspace(0.0, 1.9, 20)
        columns["throttle_cmd"][3:5] = np.nan
        phase = np.array(["", *["over, and out"] * 9, *['a "quoted" one'] * 10])
        log = FlightLog("a.csv", None, columns, phase, {"vehicle": "raptor", "gains": [1, 2.5]})
        write_csv(log, tmp_path / "a.csv")
        again = read_csv(tmp_path / "a.csv")
        assert again.columns.keys() == columns.keys()
        for name, values in columns.items():
            np.testing.assert_array_equal(again[name], values)
        assert again.phase is not None
        assert again.phase.tolist() == phase.tolist()
        assert again.meta == log.meta
        assert again.n_rotors == 6
        assert again.notes == []
        assert sorted(p.name for p in tmp_path.iterdir()) == ["a.csv", "a.meta.yaml"]

    def test_writes_columns_in_the_order_of_the_contracts_and_nan_for_missing(self, tmp_path: Path) -> None:
        columns = {name: np.array([0.5]) for name in reversed([*STATE_COLUMNS, "motor1_rpm", "motor2_rpm"])}
        columns["motor2_rpm"][:] = np.nan
        write_csv(FlightLog("a", None, columns), tmp_path / "a.csv")
        header, data = (tmp_path / "a.csv").read_text().splitlines()
        assert header == HEADER + ",motor1_rpm,motor2_rpm"
        assert data == ",".join(["0.5"] * 14) + ",nan"

    def test_cannot_be_written_into_a_missing_directory(self, tmp_path: Path) -> None:
        log = FlightLog("a", None, {"time_s": np.zeros(1)})
        with pytest.raises(LogError, match=r"no/a\.csv: cannot be written \(No such file"):
            write_csv(log, tmp_path / "no" / "a.csv")

    def test_may_have_its_columns_in_any_order_spaces_and_dos_line_ends(self, write: Write) -> None:
        header = ", ".join(reversed(STATE_COLUMNS))
        log = read_csv(write(b"\xef\xbb\xbf" + f"{header}\r\n12, 11,10,9,8,7,6,5,4,3,2,1, 0\r\n\r\n".encode()))
        assert [log[name][0] for name in STATE_COLUMNS] == list(range(13))
        assert log.notes == []

    def test_unknown_column_is_left_out_with_the_nearest_name(self, write: Write) -> None:
        log = read_csv(write(text(HEADER + ",motor1_rmp", *rows(3, 14))))
        assert not log.has("motor1_rmp")
        assert log.notes == ["column 'motor1_rmp' is not a flight log's and was left out (did you mean 'motor1_rpm'?)"]

    def test_unknown_column_may_hold_text(self, write: Write) -> None:
        log = read_csv(write(text(HEADER + ",comment", *(line + ",hello" for line in rows(3)))))
        assert len(log) == 3

    def test_missing_columns_are_named_with_the_nearest_there(self, write: Write) -> None:
        header = HEADER.replace("time_s", "times").replace("z_m,", "height,", 1)
        message = sentence_of(write(text(header, *rows(3))))
        assert "line 1: the header lacks time_s (is it 'times'?), z_m" in message

    def test_column_given_twice_is_refused(self, write: Write) -> None:
        assert "'z_m' is there twice" in sentence_of(write(text(HEADER + ",z_m", *rows(3, 14))))

    def test_rotor_left_out_is_named(self, write: Write) -> None:
        message = sentence_of(write(text(HEADER + ",motor1_rpm,motor3_rpm", *rows(3, 15))))
        assert "the header lacks motor2_rpm" in message

    def test_infinite_values_are_missing_ones(self, write: Write) -> None:
        log = read_csv(write(text(HEADER, row(0), row(1, z_m="inf"), row(2))))
        np.testing.assert_array_equal(log["z_m"], [1.0, np.nan, 1.0])
        assert log.notes == ["1 infinite value of z_m read as missing"]

    def test_empty_field_is_a_missing_value(self, write: Write) -> None:
        log = read_csv(write(text(HEADER + ",battery_v", row(0) + ",", row(1) + ",16")))
        np.testing.assert_array_equal(log["battery_v"], [np.nan, 16.0])

    def test_sidecar_is_read_as_meta(self, write: Write) -> None:
        path = write(text(HEADER, *rows(2)))
        meta_path(path).write_text("mission: step\n")
        assert read_csv(path).meta == {"mission": "step"}

    @pytest.mark.parametrize("content", [b"a: [", b"just text", b"\xff\xfe\x00"])
    def test_damaged_sidecar_costs_a_note_and_not_the_flight(self, write: Write, content: bytes) -> None:
        path = write(text(HEADER, *rows(2)))
        meta_path(path).write_bytes(content)
        log = read_csv(path)
        assert (len(log), log.meta) == (2, {})
        assert log.notes == ["flight.meta.yaml beside it is not a readable YAML mapping and was left out"]


class TestHeaderless:
    @pytest.mark.parametrize(("n_columns", "n_rotors"), [(25, 4), (31, 6), (37, 8)])
    def test_has_rpm_voltages_and_currents_by_position(self, write: Write, n_columns: int, n_rotors: int) -> None:
        lines = [",".join([str(i), *(str(c) for c in range(1, n_columns))]) for i in range(3)]
        log = read_csv(write(text(*lines)))
        assert log.n_rotors == n_rotors
        assert log["yaw_rate_rad_s"].tolist() == [12.0] * 3
        assert log["motor1_rpm"].tolist() == [13.0] * 3
        assert log["motor1_voltage_v"].tolist() == [13.0 + n_rotors] * 3
        assert log[f"motor{n_rotors}_current_a"].tolist() == [12.0 + 3 * n_rotors] * 3

    def test_17_columns_end_with_commands_and_hold_no_rpm(self, write: Write) -> None:
        log = read_csv(write(text(*(row(i) + ",-1.5,2.5,-90,0.49" for i in range(3)))))
        assert log.n_rotors == 0
        commands = [log[name][0] for name in ("roll_cmd_deg", "pitch_cmd_deg", "yaw_cmd_deg", "throttle_cmd")]
        assert commands == [-1.5, 2.5, -90.0, 0.49]
        assert len(log.notes) == 1
        assert "commanded attitude and throttle" in log.notes[0]

    def test_17_columns_that_cannot_end_with_a_throttle_hold_rpm(self, write: Write) -> None:
        log = read_csv(write(text(*(row(i) + ",5010,5020,5030,5040" for i in range(3)))))
        assert log["motor4_rpm"].tolist() == [5040.0] * 3
        assert "rotor speeds" in log.notes[0]

    @pytest.mark.parametrize("n_columns", [5, 13, 16, 18, 22, 24, 26])
    def test_other_numbers_of_columns_are_refused(self, write: Write, n_columns: int) -> None:
        message = sentence_of(write(text(*rows(4, n_columns))))
        assert f"has no header and {n_columns} columns, expected" in message
        assert "17 columns" in message
        assert "25 for 4 rotors" in message

    def test_semicolons_are_named(self, write: Write) -> None:
        assert "1 column, separated by ';'" in sentence_of(write(text("0;1;2", "1;1;2")))

    def test_rows_before_the_first_position_are_left_out(self, write: Write) -> None:
        lines = [f"{i / 50},nan,nan,-nan," + ",".join(["0"] * 21) for i in range(3)]
        log = read_csv(write(text(*lines, row(0.06, 25), row(0.08, 25, z_m="nan"))))
        assert log.time_s.tolist() == [0.06, 0.08]
        assert np.isnan(log["z_m"][1]), "a later gap stays"
        assert log.notes == ["3 rows before the first known position left out (from line 1)"]

    def test_a_log_without_any_position_is_refused(self, write: Write) -> None:
        assert "no row has time and position" in sentence_of(write(text(row(0, 25, "nan"), row(1, 25, "-nan"))))

    def test_last_line_filled_up_with_commas_is_a_cut_one(self, write: Write) -> None:
        log = read_csv(write(text(*rows(3, 25), row(9, 13) + "," * 12)))
        assert len(log) == 3
        assert log.notes == ["the last line (4) is cut short and was left out"]


class TestLastLine:
    @pytest.mark.parametrize("keep", range(1, len(row(2 / 50))))
    def test_cut_anywhere_it_is_left_out(self, write: Write, keep: int) -> None:
        log = read_csv(write(text(HEADER, *rows(2)) + rows(3)[2][:keep]))
        assert len(log) == 2
        assert log.notes == ["the last line (4) is cut short and was left out"]

    def test_complete_but_without_line_end_cannot_be_told_from_a_cut_one(self, write: Write) -> None:
        assert len(read_csv(write(text(HEADER, *rows(2)).removesuffix("\n")))) == 1

    def test_zeros_of_a_power_cut_are_left_out(self, write: Write) -> None:
        log = read_csv(write(text(HEADER, *rows(3)).encode() + b"\0" * 4096))
        assert len(log) == 3

    def test_cut_inside_a_character_is_left_out(self, write: Write) -> None:
        log = read_csv(write(text(HEADER + ",phase", *(line + ",höhe" for line in rows(2))).encode() + b"0.1,\xc3"))
        assert len(log) == 2

    def test_a_growing_file_is_read_again_and_again(self, write: Write) -> None:
        content = text(HEADER, *rows(5))
        start = len(text(HEADER, *rows(1)))
        lengths = [len(read_csv(write(content[:end]))) for end in range(start, len(content) + 1)]
        assert lengths == sorted(lengths)
        assert (lengths[0], lengths[-1]) == (1, 5)


class TestDamage:
    def test_lines_with_other_numbers_of_fields_are_counted(self, write: Write) -> None:
        log = read_csv(write(text(HEADER, *rows(3), "0.1,2", row(0.2, 14), row(0.3))))
        assert log.time_s.tolist() == [0.0, 0.02, 0.04, 0.3]
        assert log.notes == ["2 damaged lines left out (line 5: 2 fields instead of 13)"]

    def test_lines_with_text_in_a_number_are_counted(self, write: Write) -> None:
        log = read_csv(write(text(HEADER, *rows(3), row(0.2, z_m="1.2.3"), row(0.3))))
        assert log.time_s.tolist() == [0.0, 0.02, 0.04, 0.3]
        assert log.notes == ["1 damaged line left out (line 5: z_m is '1.2.3' instead of a number)"]

    def test_bytes_that_are_no_text_damage_their_line_only(self, write: Write) -> None:
        lines = text(HEADER, *rows(3)).encode() + b"\xff\x00\xfe,\x00\n" + text(row(0.3)).encode()
        log = read_csv(write(lines))
        assert len(log) == 4
        assert log.notes == ["1 damaged line left out (line 5: 2 fields instead of 13)"]

    def test_a_long_damaged_value_is_shown_shortened(self, write: Write) -> None:
        log = read_csv(write(text(HEADER, *rows(3), row(0.2, z_m="9" * 500 + "x"), row(0.3))))
        assert len(log) == 4
        assert len(log.notes[0]) < 120

    def test_an_open_quote_damages_its_line_only(self, write: Write) -> None:
        log = read_csv(write(text(HEADER, row(0), '"0.01,1,2', row(0.02), row(0.04))))
        assert log.time_s.tolist() == [0.0, 0.02, 0.04]

    def test_text_in_most_of_a_column_names_line_column_value_and_expectation(self, write: Write) -> None:
        message = sentence_of(write(text(HEADER, row(0), *(row(i, z_m="high") for i in range(1, 4)))))
        assert message.endswith("line 3: column 'z_m' holds 'high', expected a number")

    def test_a_file_that_is_mostly_damage_is_refused(self, write: Write) -> None:
        message = sentence_of(write(text(HEADER, row(0), *["1,2"] * 3)))
        assert "3 of 4 lines are damaged (line 3: 2 fields instead of 13)" in message

    def test_header_that_does_not_fit_its_rows_is_refused(self, write: Write) -> None:
        assert "14 fields instead of 13" in sentence_of(write(text(HEADER, *rows(3, 14))))


class TestTime:
    def test_rows_with_the_time_of_the_row_before_are_left_out(self, write: Write) -> None:
        log = read_csv(write(text(HEADER, row(0), row(1), row(1, z_m=7), row(2))))
        assert log.time_s.tolist() == [0.0, 1.0, 2.0]
        assert log["z_m"].tolist() == [1.0, 1.0, 1.0], "the first of equals is kept"
        assert log.notes == ["1 row in which time does not increase left out, the first is line 4 (time_s = 1)"]

    @pytest.mark.parametrize("glitch", [-5.0, 0.5, 1e9])
    def test_a_glitch_costs_only_itself(self, write: Write, glitch: float) -> None:
        log = read_csv(write(text(HEADER, *(row(t) for t in (0, 1, 2, glitch, 3, 4, 5)))))
        assert log.time_s.tolist() == [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]

    def test_a_second_flight_in_the_file_is_refused(self, write: Write) -> None:
        message = sentence_of(write(text(HEADER, *rows(300), *rows(100))))
        assert "time does not increase in 100 rows of 400, the first is line 302 (time_s = 0)" in message

    @pytest.mark.parametrize("times", [[0] * 9, list(range(9, 0, -1))])
    def test_time_that_mostly_does_not_increase_is_refused(self, write: Write, times: list[int]) -> None:
        assert "time does not increase in 8 rows of 9" in sentence_of(write(text(HEADER, *map(row, times))))

    def test_the_most_rows_are_kept(self) -> None:
        time_s = np.array([0.0, 8.0, 1.0, np.nan, 2.0, 2.0, 9.0, 3.0])
        assert np.flatnonzero(increasing(time_s)).tolist() == [0, 2, 4, 7]


class TestNotALog:
    @pytest.mark.parametrize(
        ("content", "expected"),
        [
            (b"", "is empty"),
            (b"\n \r\n", "is empty"),
            (b"\x00\x01\x02binary", "is not a text file"),
            (b"\0" * 100, "is not a text file"),
            (HEADER.encode(), "no complete line yet"),
            (HEADER.encode() + b"\n", "has a header and no complete row"),
            (HEADER.encode() + b"\n0.0,1.0", "has a header and no complete row"),
            (b"hello\nworld\n", "has no header and 1 column"),
            (b"a,b,c\n1,2,3\n", "the header lacks time_s"),
            (b'{"a": "' + b"x" * 200_000 + b'", "b": 1}\n', "expected"),
        ],
    )
    def test_is_said_in_one_sentence(self, write: Write, content: bytes, expected: str) -> None:
        assert expected in sentence_of(write(content))

    def test_missing_file(self, tmp_path: Path) -> None:
        assert sentence_of(tmp_path / "no.csv").endswith("there is no such file")

    def test_directory(self, tmp_path: Path) -> None:
        assert "is a directory" in sentence_of(tmp_path)


class TestReadLog:
    def test_missing_file_of_another_format_is_missing_first(self, tmp_path: Path) -> None:
        with pytest.raises(LogError, match="there is no such file"):
            read_log(tmp_path / "a.ulg")

    def test_several_come_in_order_by_file_name(self, tmp_path: Path) -> None:
        for name in ("b.csv", "a.csv"):
            (tmp_path / name).write_text(text(HEADER, *rows(2)))
        assert [log.name for log in read_logs([tmp_path / "b.csv", tmp_path / "a.csv"])] == ["b.csv", "a.csv"]

    def test_the_same_flight_twice_is_refused(self, write: Write) -> None:
        path = write(text(HEADER, *rows(2)))
        with pytest.raises(LogError, match="is given twice"):
            read_logs([path, path.parent / "." / path.name])


class TestFlightLog:
    nan = np.nan

    def log(self, **columns: list[float]) -> FlightLog:
        n = len(next(iter(columns.values())))
        return FlightLog(
            "a.csv", None, {"time_s": np.arange(n, dtype=float), **{k: np.array(v) for k, v in columns.items()}}
        )

    def test_updates_are_the_rows_where_a_held_value_changes(self) -> None:
        log = self.log(z_m=[1.0, 1.0, 2.0, 2.0, 2.0, 1.0])
        assert log.updates("z_m").tolist() == [0, 2, 5]

    def test_missing_values_are_no_updates_and_the_first_finite_one_is(self) -> None:
        log = self.log(z_m=[self.nan, self.nan, 1.0, self.nan, 1.0, 2.0, self.nan])
        assert log.updates("z_m").tolist() == [2, 5]

    def test_parts_that_arrive_together_update_together(self) -> None:
        log = self.log(x_m=[1.0, 2.0, 2.0, 2.0], y_m=[0.0, 0.0, 0.0, 0.0], z_m=[5.0, 5.0, 5.0, 6.0])
        assert log.updates(*POSITION).tolist() == [0, 1, 3]
        assert log.updates("y_m").tolist() == [0]

    def test_a_channel_without_values_has_no_updates(self) -> None:
        assert self.log(z_m=[self.nan] * 3).updates("z_m").tolist() == []

    def test_unknown_column_is_named_with_the_nearest(self) -> None:
        with pytest.raises(LogError, match=r"a\.csv: has no column 'z_n' \(did you mean 'z_m'\?\)"):
            self.log(z_m=[1.0])["z_n"]

    def test_a_column_of_nan_is_not_had(self) -> None:
        log = self.log(z_m=[1.0, self.nan], battery_v=[self.nan, self.nan])
        assert (log.has("z_m"), log.has("battery_v"), log.has("x_m")) == (True, False, False)

    def test_columns_of_other_lengths_are_refused(self) -> None:
        with pytest.raises(LogError, match="'z_m' has 2 values, expected 3"):
            FlightLog("a.csv", None, {"time_s": np.zeros(3), "z_m": np.zeros(2)})

    def test_selected_rows_keep_columns_and_phase_together(self) -> None:
        log = FlightLog("a", None, {"time_s": np.arange(4.0)}, np.array(["a", "b", "b", "c"]))
        part = log.rows(np.array([False, True, False, True]))
        assert part.phase is not None
        assert (part.time_s.tolist(), part.phase.tolist(), len(log)) == ([1.0, 3.0], ["b", "c"], 4)


@needs_raptor
class TestRaptor:
    @pytest.mark.parametrize("path", sorted(RAPTOR.glob("*.csv")), ids=lambda path: path.stem)
    def test_every_file_loses_its_cut_last_line_and_nothing_else_but_rows_before_the_first_fix(
        self, path: Path
    ) -> None:
        lines = path.read_bytes().count(b"\n") + (not path.read_bytes().endswith(b"\n"))
        log = read_log(path)
        assert len(log) == lines - (11 if path.stem == "HOVERING" else 1)
        assert f"the last line ({lines}) is cut short and was left out" in log.notes
        assert np.all(np.diff(log.time_s) > 0)
        assert all(np.isfinite(values).all() for values in log.columns.values())

    def test_hovering_holds_about_430_samples_of_rotor_speed_in_flight(self) -> None:
        log = read_log(RAPTOR / "HOVERING.csv")
        assert log.n_rotors == 4
        assert "10 rows before the first known position left out (from line 1)" in log.notes
        in_flight = log.rows(log["motor1_rpm"] > 3000.0)
        assert 400 <= len(in_flight.updates("motor1_rpm")) <= 460
        assert 1500 <= len(log.updates(*POSITION)) <= 1600, "and some 10 positions a second"

    def test_step_responses_hold_commands_and_no_rotor_speed(self) -> None:
        log = read_log(RAPTOR / "APPIUS_02.csv")
        assert log.n_rotors == 0
        assert log["throttle_cmd"].mean() == pytest.approx(0.5, abs=0.05)
        assert np.abs(log["roll_cmd_deg"]).max() < 5.0
        assert log.time_s[-1] == 44.04
