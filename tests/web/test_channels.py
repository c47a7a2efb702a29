"""Any channel of a log over time: its name, its pane, its spectrum and its statistics."""

from dataclasses import replace

import numpy as np
import pytest

from quadctl.effects.ground_effect import Exponential
from quadctl.lab.flights.dataset import load_dataset
from quadctl.logs.flight_log import FlightLog
from quadctl.model import Model
from quadctl.vehicle import Vehicle
from quadctl.web.elements.theme import LIGHT
from quadctl.web.figures.channels import (
    channel_timeline,
    channels_of,
    filter_response,
    marks_of,
    spectrum,
    spectrum_figure,
    statistics,
)
from tests.support.flights import obedient

SHAKE_HZ = 13.0


@pytest.fixture
def log() -> FlightLog:
    """A log of 20 s at 100 Hz: a vibration of 0.5 m/s^2 at 13 Hz, and a voltage that is logged at 2 Hz."""
    time_s = np.arange(0.0, 20.0, 0.01)
    shake = 0.5 * np.sin(2.0 * np.pi * SHAKE_HZ * time_s) - 9.81
    columns = {
        "time_s": time_s, "z_m": 1.0 + 0.0 * time_s, "z_ref_m": 1.1 + 0.0 * time_s, "imu_z_m_s2": shake,
        "battery_v": 16.0 - np.floor(2.0 * time_s) / 100.0, "motor1_rpm": time_s, "motor2_rpm": 2.0 * time_s,
        "ax_m_s2": np.full(len(time_s), np.nan),
    }  # fmt: skip
    events = [{"time_s": 3.0, "what": "mode POSCTL"}, {"what": "no time"}, {"time_s": float("nan"), "what": "x"}]
    return FlightLog("a.csv", None, columns, np.repeat(["hover", "land"], len(time_s) // 2), {"events": events})


def test_channels_have_names_to_search_by_and_empty_ones_are_left_out(log: FlightLog) -> None:
    offered = channels_of([log])
    assert "ax_m_s2" not in offered and "time_s" not in offered
    assert offered["z_ref_m"] == "height, setpoint (z_ref_m)"
    assert offered["motor2_rpm"] == "motor 2 speed (motor2_rpm)"


def test_a_setpoint_shares_the_pane_of_what_is_measured_and_each_motor_has_a_line(log: FlightLog) -> None:
    drawn = channel_timeline([log], ["z_m", "motor1_rpm", "z_ref_m", "motor2_rpm"], LIGHT)
    assert drawn.panes == ["m", "rpm"]
    assert [series.pane for series in drawn.series] == ["m", "rpm", "m", "rpm"]


def test_flights_lie_over_each_other_under_their_names(log: FlightLog) -> None:
    drawn = channel_timeline([log, replace(log, name="b.csv")], ["z_m"], LIGHT)
    assert [series.name for series in drawn.series] == ["a.csv: height (z_m)", "b.csv: height (z_m)"]
    assert len({series.colour for series in drawn.series}) == 2


def test_phases_and_events_are_marks_on_the_axis_of_time(log: FlightLog) -> None:
    drawn = channel_timeline([log], ["z_m"], LIGHT)
    assert [name for name, _, _ in drawn.phases] == ["hover", "land"]
    assert marks_of(log) == [("mode POSCTL", 3.0)]
    assert "mode POSCTL" in [note["text"] for note in drawn.figure(LIGHT)["layout"]["annotations"]]


def test_marks_too_close_to_be_read_are_one_and_the_mode_is_its_text(log: FlightLog) -> None:
    events = [
        {"time_s": t, "what": w} for t, w in ((3.0, "Armed"), (3.1, "mode OFFBOARD"), (3.2, "x"), (9.0, "Landed"))
    ]
    assert marks_of(replace(log, meta={"events": events})) == [("mode OFFBOARD (+2)", 3.0), ("Landed", 9.0)]


def test_a_vibration_stands_at_its_frequency_with_its_amplitude(log: FlightLog) -> None:
    found = spectrum(log, "imu_z_m_s2")
    assert found is not None
    frequency_hz, density = found
    assert frequency_hz[np.argmax(density)] == pytest.approx(SHAKE_HZ, abs=0.3)
    rms = np.sqrt(np.sum(density**2) * (frequency_hz[1] - frequency_hz[0]))
    assert rms == pytest.approx(0.5 / np.sqrt(2.0), rel=0.02)


def test_a_channel_that_is_held_counts_its_updates_only(log: FlightLog) -> None:
    assert spectrum(log, "battery_v") is None
    found = statistics(log, "battery_v")
    assert found.rate_hz == pytest.approx(2.0, rel=0.02)
    assert (found.least, found.largest) == (15.61, 16.0)
    assert np.isnan(statistics(log, "z_m").rate_hz)


def test_the_filter_of_the_analysis_is_drawn_into_the_spectrum(raptor: Vehicle, log: FlightLog) -> None:
    flown = obedient(Model(raptor).plus(Exponential(a=0.3, b=5.0)), 30.0)
    (flight,) = load_dataset([flown], raptor).flights
    frequency_hz, gain = filter_response(flight)
    assert gain[0] == pytest.approx(1.0)
    assert np.interp(flight.bandwidth_hz, frequency_hz, gain) < 0.9
    assert gain[frequency_hz > 4.0 * flight.bandwidth_hz].max() < 0.1
    drawn = spectrum_figure([log], "imu_z_m_s2", flight, LIGHT)
    assert drawn is not None
    assert [curve["name"] for curve in drawn["data"]] == ["a.csv", "filter of the analysis: gain"]
