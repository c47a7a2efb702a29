"""Step responses."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from quadctl.lab.plots.style import BLACK, FLIGHT_COLOURS, PANEL_PX, legend_above, legend_name, limits, panel, styled
from quadctl.lab.tracking.metrics import Tracking


@styled
def step_heights(tracks: Mapping[str, Tracking], width_px: float = PANEL_PX) -> Figure:
    """Height over time of step responses, with the reference."""
    figure, ax = panel(4.2, width_px)
    _draw_steps(ax, tracks)
    ax.set_ylabel("height / m")
    return figure


@styled
def step_tail(tracks: Mapping[str, Tracking], width_px: float = PANEL_PX) -> Figure:
    """Height above the reference after the step, mm."""
    figure, ax = panel(4.2, width_px)
    settled = []
    for i, (name, track) in enumerate(tracks.items()):
        error_mm = 1000.0 * track.error_m
        ax.plot(track.time_s, error_mm, label=legend_name(name), **_step_line(i))
        settled.append(error_mm[track.time_s > 0.2 * track.time_s[-1]])
    ax.axhline(0.0, color=BLACK, linewidth=1.0, linestyle="--")
    end = max(float(track.time_s[-1]) for track in tracks.values())
    ax.set_xlim(0.1 * end, end)
    limits(ax, np.concatenate(settled), whole=True)
    ax.set_xlabel("time since the step / s")
    ax.set_ylabel("height above the setpoint / mm")
    legend_above(ax, columns=2)
    return figure


def _draw_steps(ax: Axes, tracks: Mapping[str, Tracking]) -> None:
    first = next(iter(tracks.values()))
    ax.plot(first.time_s, first.reference_m, color=BLACK, linewidth=1.0, linestyle="--", label="setpoint")
    for i, (name, track) in enumerate(tracks.items()):
        ax.plot(track.time_s, track.position_m, label=legend_name(name), **_step_line(i))
    ax.set_xlim(0.0, max(float(track.time_s[-1]) for track in tracks.values()))
    ax.set_xlabel("time since the step / s")
    legend_above(ax, columns=2)


def _step_line(i: int) -> dict[str, Any]:
    return {"color": FLIGHT_COLOURS[i % len(FLIGHT_COLOURS)], "linewidth": 1.5, "zorder": 3.0 - 0.01 * i}
