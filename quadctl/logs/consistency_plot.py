"""A figure on which a wrong frame or unit is seen at once: each channel over what the others make of it."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from quadctl.errors import LogError
from quadctl.files import writing
from quadctl.frames import GRAVITY_M_S2, body_rates
from quadctl.logs.flight_log import ATTITUDE, IMU, RATES, FlightLog, Floats
from quadctl.logs.kinematics import MOTION, force_in_world

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def draw(log: FlightLog, path: Path) -> None:
    """Draw velocity, body rates and specific force (solid), and what position, attitude and gravity say (dashed).

    Raises
    ------
    LogError
        The figure cannot be written.
    """
    from matplotlib.figure import Figure

    has_force = all(log.has(name) for name in IMU)
    rows = 3 if has_force else 2
    figure = Figure(figsize=(11, 2.7 * rows), layout="constrained")
    axes = figure.subplots(rows, 3, sharex=True)
    roll, pitch, yaw = (np.radians(log[name]) for name in ATTITUDE)
    rates = body_rates(roll, pitch, *_slopes(log, [np.unwrap(np.nan_to_num(angle)) for angle in (roll, pitch, yaw)]))
    moving = _slopes(log, [log[name] for name in MOTION.levels])
    for column in range(3):
        _pair(axes[0][column], log, MOTION.needed[column], moving[column], "slope of the position")
        _pair(axes[1][column], log, RATES[column], rates[column], "slope of the attitude")
    if has_force:
        for axis, name, force in zip(axes[2], ("north", "east", "up"), force_in_world(log.columns), strict=True):
            axis.plot(log.time_s, force, lw=0.8, label=f"specific force {name}, m/s²")
            axis.axhline(GRAVITY_M_S2 if name == "up" else 0.0, color="k", ls="--", lw=0.8, label="of hover")
            axis.legend(fontsize=7)
    for axis in axes[-1]:
        axis.set_xlabel("time, s")
    for axis in axes.flat:
        _show_the_flight(axis)
    figure.suptitle(f"{log.name}: where the lines part, a frame or a unit is wrong")
    with writing(path, LogError):
        figure.savefig(path, dpi=100)


def _show_the_flight(axis: "Axes") -> None:
    """Limit the axis to all but the hundredth furthest values: one touch-down would set its scale."""
    values = np.concatenate([np.asarray(line.get_ydata(), dtype=np.float64) for line in axis.lines])
    values = values[np.isfinite(values)]
    if len(values) == 0:
        return
    low, high = np.percentile(values, (0.5, 99.5))
    if high > low:
        axis.set_ylim(low - 0.3 * (high - low), high + 0.3 * (high - low))


def _slopes(log: FlightLog, values: list[Floats]) -> list[Floats]:
    """Slopes over a fifth of a second: differences of single updates are mostly noise."""
    time_s = log.time_s
    grid = np.arange(time_s[0], time_s[-1], 0.2)
    if len(grid) < 3:
        return [np.full(len(time_s), np.nan) for _ in values]
    return [np.interp(time_s, grid, np.gradient(np.interp(grid, time_s, v), 0.2)) for v in values]


def _pair(axis: "Axes", log: FlightLog, name: str, other: Floats, label: str) -> None:
    if log.has(name):
        axis.plot(log.time_s, log[name], lw=0.8, label=name)
    axis.plot(log.time_s, other, "k--", lw=0.8, label=label)
    axis.legend(fontsize=7)
