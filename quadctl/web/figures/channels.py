"""Any logged channel over time, its spectrum with the filter of the analysis, and its statistics."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from quadctl.lab.arrays import Floats
from quadctl.lab.flights.flight import Flight
from quadctl.logs.columns import column_order, motor_of
from quadctl.logs.events import Event, events_of
from quadctl.logs.flight_log import FlightLog
from quadctl.web.elements.figure import Figure, axis, figure
from quadctl.web.elements.theme import Theme
from quadctl.web.figures.timeline import Series, Timeline, line, phases_of

UNITS = {
    "_rad_s": "rad/s", "_m_s2": "m/s²", "_m_s": "m/s", "_deg": "°", "_rpm": "rpm", "_v": "V", "_a": "A", "_n": "N",
    "_m": "m", "_s": "s",
}  # fmt: skip
"""Units by the end of a column's name; the longer ends stand first."""
WORDS = {
    "x_m": "position north", "y_m": "position east", "z_m": "height",
    "x_ref_m": "position north, setpoint", "y_ref_m": "position east, setpoint", "z_ref_m": "height, setpoint",
    "vx_m_s": "velocity north", "vy_m_s": "velocity east", "vz_m_s": "velocity up",
    "vx_ref_m_s": "velocity north, setpoint", "vy_ref_m_s": "velocity east, setpoint",
    "vz_ref_m_s": "velocity up, setpoint",
    "roll_deg": "roll", "pitch_deg": "pitch", "yaw_deg": "yaw",
    "roll_cmd_deg": "roll, setpoint", "pitch_cmd_deg": "pitch, setpoint", "yaw_cmd_deg": "yaw, setpoint",
    "roll_rate_rad_s": "roll rate", "pitch_rate_rad_s": "pitch rate", "yaw_rate_rad_s": "yaw rate",
    "imu_x_m_s2": "accelerometer forward", "imu_y_m_s2": "accelerometer right", "imu_z_m_s2": "accelerometer down",
    "ax_m_s2": "acceleration north", "ay_m_s2": "acceleration east", "az_m_s2": "acceleration up",
    "battery_v": "battery voltage", "thrust_cmd_n": "thrust command", "throttle_cmd": "throttle command",
    "thrust_ratio": "thrust ratio of the compensator", "compensator_trust": "share of the compensator in use",
    "telemetry_age_s": "age of the state", "tick_late_s": "lateness of the loop",
    "residual_x_m_s2": "beyond the model, forward", "residual_y_m_s2": "beyond the model, right",
    "residual_z_m_s2": "beyond the model, down", "residual_north_m_s2": "beyond the model, north",
    "residual_east_m_s2": "beyond the model, east", "residual_up_m_s2": "beyond the model, up",
}  # fmt: skip
MOTOR_WORDS = {"rpm": "speed", "voltage_v": "voltage", "current_a": "current", "output": "command"}
SEGMENT_S = 5.0
"""Length of the segments whose spectra are averaged."""
LEAST_UPDATES = 64
"""Fewest updates of a channel for a spectrum."""
NEAR = 0.02
"""Least distance of two marks on the axis of time, as a share of the flight."""
MARK_LENGTH = 28
"""Longest text of a mark on the axis of time."""


class Statistics(NamedTuple):
    """Statistics of the updates of one channel, in its unit; the rate in Hz, NaN where there are not two updates."""

    mean: float
    std: float
    least: float
    largest: float
    rate_hz: float


def channels_of(logs: Sequence[FlightLog]) -> dict[str, str]:
    """Columns that hold a value in any of the logs, in the order of the file, with their names in words."""
    found = {name for log in logs for name in log.columns if name != "time_s" and log.has(name)}
    return {name: in_words(name) for name in sorted(found, key=column_order)}


def in_words(column: str) -> str:
    """`height (z_m)` for `z_m`."""
    motor = motor_of(column)
    if motor is not None:
        return f"motor {motor} {MOTOR_WORDS[column.partition('_')[2]]} ({column})"
    return f"{WORDS[column]} ({column})" if column in WORDS else column


def unit(column: str) -> str:
    """Unit of a column; empty where it has none."""
    return next((unit for end, unit in UNITS.items() if column.endswith(end)), "")


def channel_timeline(logs: Sequence[FlightLog], columns: Sequence[str], theme: Theme) -> Timeline:
    """Chosen channels of one or several flights over time; those of one unit share a pane.

    Phases and marks are those of the first flight.
    """
    colours = (theme.measured, theme.before, theme.after, *theme.others)
    panes: list[str] = []
    series: list[Series] = []
    for log in logs:
        for column in columns:
            if not log.has(column):
                continue
            pane = unit(column) or column
            if pane not in panes:
                panes.append(pane)
            name = in_words(column) if len(logs) == 1 else f"{log.name}: {in_words(column)}"
            series.append(line(pane, name, colours[len(series) % len(colours)], log.time_s, log[column]))
    first = logs[0] if logs else None
    return Timeline(panes, series, phases_of(first), [] if first is None else marks_of(first), legend_of_all=True)


def marks_of(log: FlightLog) -> list[tuple[str, float]]:
    """Events of a log as texts that fit on the axis of time; those too close to be read share a mark."""
    near_s = NEAR * float(log.time_s[-1] - log.time_s[0]) if len(log) else 0.0
    groups: list[list[Event]] = []
    for event in events_of(log.meta):
        if groups and event.time_s - groups[-1][0].time_s < near_s:
            groups[-1].append(event)
        else:
            groups.append([event])
    marks = []
    for group in groups:
        modes = [event.what for event in group if event.what.startswith("mode ")]
        text = modes[-1] if modes else group[0].what
        more = f" (+{len(group) - 1})" if len(group) > 1 else ""
        room = MARK_LENGTH - len(more)
        marks.append(((text if len(text) <= room else f"{text[: room - 1]}\u2026") + more, group[0].time_s))
    return marks


def statistics(log: FlightLog, column: str) -> Statistics:
    """Statistics of one channel, over its updates."""
    rows = log.updates(column)
    values, time_s = log[column][rows], log.time_s[rows]
    rate = (len(rows) - 1) / (time_s[-1] - time_s[0]) if len(rows) > 1 else np.nan
    known = log[column][np.isfinite(log[column])]
    return Statistics(float(known.mean()), float(known.std()), float(values.min()), float(values.max()), float(rate))


def spectrum(log: FlightLog, column: str) -> tuple[Floats, Floats] | None:
    """Frequencies, Hz, and amplitude spectral density of a channel, its unit/sqrt(Hz), by Welch's method.

    The channel is taken at its updates, on an even clock of their median interval; None where it has too few.
    """
    rows = log.updates(column)
    if len(rows) < LEAST_UPDATES:
        return None
    time_s, values = log.time_s[rows], log[column][rows]
    step_s = float(np.median(np.diff(time_s)))
    from scipy.signal import welch  # it loads scipy.stats, which takes a third of a second and 25 MB at every start

    grid_s = np.arange(time_s[0], time_s[-1], step_s)
    even = np.interp(grid_s, time_s, values)
    length = min(len(even), max(LEAST_UPDATES, round(SEGMENT_S / step_s)))
    frequency_hz, power = welch(even, fs=1.0 / step_s, nperseg=length, detrend="constant")
    return np.asarray(frequency_hz[1:], dtype=float), np.sqrt(np.asarray(power[1:], dtype=float))


def filter_response(flight: Flight) -> tuple[Floats, Floats]:
    """Frequencies, Hz, and gain of the filter through which the analysis sees the signals of a flight."""
    row = flight.smooth[flight.smooth.shape[0] // 2]
    step_s = float(np.median(np.diff(flight.grid_s)))
    weights = np.asarray(row.data)
    length = max(4096, len(weights))
    gain = np.abs(np.fft.rfft(weights, length)) / abs(float(weights.sum()))
    return np.asarray(np.fft.rfftfreq(length, step_s)), np.asarray(gain, dtype=float)


def spectrum_figure(logs: Sequence[FlightLog], column: str, flight: Flight, theme: Theme) -> Figure | None:
    """Spectrum of a channel of each flight, and the gain of the filter; None where no log holds enough of it."""
    colours = (theme.measured, theme.before, theme.after, *theme.others)
    data = []
    last_hz = 0.0
    for log, colour in zip(logs, colours * (1 + len(logs) // len(colours)), strict=False):
        found = spectrum(log, column) if log.has(column) else None
        if found is not None:
            frequency_hz, density = found
            last_hz = max(last_hz, float(frequency_hz[-1]))
            data.append(_curve(log.name, frequency_hz, density, colour))
    if not data:
        return None
    frequency_hz, gain = filter_response(flight)
    shown = frequency_hz <= last_hz
    passed = _curve("filter of the analysis: gain", frequency_hz[shown], gain[shown], theme.floor)
    data.append({**passed, "yaxis": "y2", "line": {"color": theme.floor, "width": 1.6, "dash": "dash"}})
    return figure(
        data,
        theme,
        300,
        xaxis=axis("frequency / Hz", theme),
        yaxis=axis(f"{unit(column)}/√Hz" if unit(column) else "1/√Hz", theme, type="log", exponentformat="power"),
        yaxis2=axis("gain of the filter", theme, overlaying="y", side="right", range=[0.0, 1.1], showgrid=False),
        margin={"l": 58, "r": 58, "t": 30, "b": 44},
    )


def _curve(name: str, x: Floats, y: Floats, colour: str) -> dict[str, object]:
    return {
        "type": "scatter", "mode": "lines", "name": name, "x": x, "y": y, "line": {"color": colour, "width": 1.3},
        "hovertemplate": "%{x:.3~g} Hz: %{y:.3~g}",
    }  # fmt: skip


def statistics_of(logs: Sequence[FlightLog], columns: Sequence[str]) -> Mapping[tuple[str, str], Statistics]:
    """Statistics by the names of flight and column."""
    return {(log.name, column): statistics(log, column) for column in columns for log in logs if log.has(column)}
