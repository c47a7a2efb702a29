"""Measured against predicted acceleration over time."""

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from quadctl.lab.arrays import Floats
from quadctl.lab.flights.flight import Flight
from quadctl.lab.flights.prediction import AXES
from quadctl.lab.plots.style import (
    AFTER,
    BEFORE,
    BLACK,
    GREY,
    MAX_DRAWN,
    WIDE_PX,
    legend_above,
    legend_name,
    limits,
    styled,
)


@styled
def acceleration_over_time(
    flight: Flight, measured: Floats, predicted: Mapping[str, Floats], width_px: float = WIDE_PX
) -> Figure:
    """Measured acceleration of one flight and predictions of one or two models, shape (n, 3) each; the height below."""
    figure = Figure(figsize=(width_px / 72, 6.6))
    axes = figure.subplots(4, 1, sharex=True, height_ratios=[2.4, 1.0, 1.0, 0.8])
    pixels = len(flight.time_s) > MAX_DRAWN or width_px < WIDE_PX
    # A gap in time is a gap in the line.
    gaps = np.flatnonzero(np.diff(flight.time_s) > 3.0 * np.median(np.diff(flight.time_s))) + 1
    time = np.insert(flight.time_s, gaps, np.nan)
    colours = (BEFORE, AFTER) if len(predicted) > 1 else (BEFORE,)

    def line(ax: Axes, values: Floats, colour: str, label: str | None = None, width: float = 1.1) -> None:
        ax.plot(time, np.insert(values, gaps, np.nan), color=colour, label=label, linewidth=width, rasterized=pixels)

    for ax, axis in zip(axes, ("up", "north", "east"), strict=False):
        column = AXES.index(axis)
        line(ax, measured[:, column], BLACK, "measured", 1.5)
        for (label, values), colour in zip(predicted.items(), colours, strict=False):
            line(ax, values[:, column], colour, legend_name(label))
        shown = np.concatenate([measured[:, column], *(values[:, column] for values in predicted.values())])
        limits(ax, shown)
        ax.set_ylabel(f"{axis} / m/s²")
        ax.yaxis.set_major_locator(MaxNLocator(4 if axis == "up" else 3))
    legend_above(axes[0], columns=3)
    line(axes[3], flight.filtered(flight.conditions.height_m), GREY)
    axes[3].set_ylabel("height / m")
    axes[3].yaxis.set_major_locator(MaxNLocator(3))
    axes[3].set_xlabel("time in the log / s")
    axes[3].set_xlim(flight.time_s[0], flight.time_s[-1])
    figure.align_ylabels(axes)
    return figure
