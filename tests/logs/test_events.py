"""Events of an autopilot's log: its modes, its messages, and the parameters that were changed."""

from pathlib import Path

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from quadctl.logs.events import Event, events_in_meta, mode_changes, parameter_changes, said
from quadctl.logs.parameter_history import ParameterHistory
from quadctl.logs.read import read_log
from tests.support.log_files import telemetry, tlog_bytes
from tests.support.places import DATA

REAL = DATA / "real"


def test_the_first_mode_and_every_change_are_events() -> None:
    found = mode_changes([0.0, 1.0, 2.0, 3.0], [4, 4, 14, 99], {4: "AUTO.LOITER", 14: "OFFBOARD"})
    assert found == [Event(0.0, "mode AUTO.LOITER"), Event(2.0, "mode OFFBOARD"), Event(3.0, "mode number 99")]


def test_a_parameter_that_is_said_for_the_first_time_or_again_has_not_changed() -> None:
    history = ParameterHistory([(0.0, "A", 1.0), (1.0, "A", 1.0), (2.0, "B", 3.0)], {"B": 2.0})
    assert parameter_changes(history) == [Event(2.0, "B = 3 (was 2)")]
    assert (history.at(0.0), history.at(2.0)) == ({"A": 1.0, "B": 2.0}, {"A": 1.0, "B": 3.0})


def test_messages_have_no_colours_and_come_once() -> None:
    assert said([1.0, 1.0, 2.0], ["\x1b[32mReady\x1b[0m\t", "Ready", " "]) == [Event(1.0, "Ready")]


def test_times_count_from_the_first_row_and_what_is_outside_is_left_out() -> None:
    events = [Event(12.0, "late"), Event(9.5, "at the begin"), Event(2.0, "long before"), Event(30.0, "after")]
    assert events_in_meta(events, 10.0, 20.0) == [
        {"time_s": 0.0, "what": "at the begin"},
        {"time_s": 2.0, "what": "late"},
    ]


def test_a_telemetry_log_says_its_modes_messages_and_parameters(tmp_path: Path) -> None:
    records = telemetry()
    after = records[-1][0]
    for value in (0.5, 0.6):
        records.append((after, mavlink.MAVLink_param_value_message(b"MOT_THST_EXPO", value, 9, 1, 0)))
    records.append((after, mavlink.MAVLink_statustext_message(6, b"Crash: Disarming")))
    path = tmp_path / "a.tlog"
    path.write_bytes(tlog_bytes(records))
    whats = [event["what"] for event in read_log(path).meta["events"]]
    assert whats[0].startswith("mode ")
    assert {"MOT_THST_EXPO = 0.6 (was 0.5)", "Crash: Disarming"} <= set(whats)


@pytest.mark.skipif(not REAL.is_dir(), reason="the flights of real autopilots are not here")
@pytest.mark.parametrize(
    ("name", "mode", "at_s", "message"),
    [
        ("px4/excitation.ulg", "mode OFFBOARD", 26.5, "[commander] Takeoff detected"),
        ("ardupilot/excitation.bin", "mode LAND", 68.207, "SIM Hit ground at 0.561619 m/s"),
    ],
)
def test_real_logs_say_when_the_mode_changed(name: str, mode: str, at_s: float, message: str) -> None:
    events = read_log(REAL / name).meta["events"]
    assert {"time_s": at_s, "what": mode} in events
    assert message in [event["what"] for event in events]
