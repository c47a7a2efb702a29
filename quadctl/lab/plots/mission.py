"""Figure of a mission: height, speed and tilt over time, the path from above, each with its limits."""

import math
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from quadctl.errors import SettingsError
from quadctl.files import writing
from quadctl.lab.arrays import Floats
from quadctl.lab.plots.style import BLUE, GREY, LIGHT, STYLE, VERMILION
from quadctl.missions import Mission
from quadctl.missions.profile import sampled

MAX_NAMED = 12
"""Largest number of phases that are named; more are only shaded, because the names would overlap."""
NARROW_SHARE = 0.03
"""Least share of the flight's time of a phase whose name is shown."""
LEGIBLE = {"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 1.0}
"""Background of a name that may lie on a line."""
NEAR = 1.6
"""Largest ratio of a limit to the peak of the curve at which the limit is drawn; others are named in the title only."""


def mission_figure(mission: Mission, max_speed_m_s: float, max_tilt_deg: float) -> Figure:
    """Draw `mission`; the limits of speed and tilt are those of the flight, the others the mission's."""
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(13.6, 7.4))
        grid = figure.add_gridspec(3, 2, width_ratios=(2.2, 1.0), height_ratios=(1.6, 1.0, 1.0))
        height, speed, tilt = over_time = [figure.add_subplot(grid[row, 0]) for row in range(3)]
        samples = [sample for of_phase in sampled(mission) for sample in of_phase]
        time = np.array([sample.time_s for sample in samples])
        place = np.array([sample.reference.position_m for sample in samples])
        limits = mission.limits
        _curve(height, time, place[:, 2], "height / m", {"min_z_m": limits.min_z_m, "max_z_m": limits.max_z_m})
        _curve(speed, time, np.array([s.speed_m_s for s in samples]), "speed / m/s", {"guard": max_speed_m_s})
        leans = np.array([math.degrees(sample.tilt_rad) for sample in samples])
        _curve(tilt, time, leans, "tilt demanded / deg", {"limit": max_tilt_deg})
        tilt.set_xlabel("time since lift-off / s")
        for ax in over_time:
            ax.set_xlim(0.0, mission.duration_s)
        _shade_phases(over_time, mission)
        _from_above(figure.add_subplot(grid[:, 1]), mission, place)
        figure.suptitle(f"{mission.name}: {mission.description}", x=0.01, ha="left", fontsize=12.5, fontweight="bold")
        figure.align_ylabels(over_time)
        return figure


def save_mission_plot(mission: Mission, max_speed_m_s: float, max_tilt_deg: float, path: Path) -> None:
    """Write the figure as PNG; raises SettingsError when `path` does not end in .png or cannot be written."""
    if path.suffix.lower() != ".png":
        raise SettingsError(f"{path}: ends in '{path.suffix}', expected .png")
    with writing(path, SettingsError):
        mission_figure(mission, max_speed_m_s, max_tilt_deg).savefig(path, dpi=110)


def _curve(ax: Axes, time: Floats, values: Floats, label: str, limits: dict[str, float]) -> None:
    """Draw a curve over time with those limits that lie near it."""
    ax.plot(time, values, color=BLUE)
    peak = max(float(np.max(values)), 1e-3)
    far = []
    for name, limit in limits.items():
        if limit > NEAR * peak:
            far.append(f"{name} {limit:g}")
            continue
        ax.axhline(limit, color=VERMILION, linestyle="--", linewidth=1.0)
        ax.annotate(f" {name} {limit:g}", (1.0, limit), xycoords=("axes fraction", "data"), color=VERMILION,
                    fontsize=9.5, va="center", annotation_clip=False)  # fmt: skip
    ax.set_ylabel(label)
    ax.set_ylim(bottom=0.0, top=1.12 * max([peak, *(limit for limit in limits.values() if limit <= NEAR * peak)]))
    if far:
        ax.set_title(", ".join(far), loc="right", fontsize=9.5, fontweight="normal", color=GREY)


def _shade_phases(axes: list[Axes], mission: Mission) -> None:
    for i, phase in enumerate(mission.phases):
        for ax in axes:
            if i % 2:
                ax.axvspan(phase.start_s, phase.end_s, color=LIGHT, alpha=0.25, linewidth=0.0)
        share = (phase.end_s - phase.start_s) / mission.duration_s
        if len(mission.phases) <= MAX_NAMED and share > NARROW_SHARE:
            middle = 0.5 * (phase.start_s + phase.end_s)
            rotation = 0.0 if share > 0.012 * len(phase.name) else 90.0
            axes[0].annotate(phase.name, (middle, 0.02), xycoords=("data", "axes fraction"), ha="center", va="bottom",
                             rotation=rotation, fontsize=9.0, color=GREY, bbox=LEGIBLE)  # fmt: skip


def _from_above(ax: Axes, mission: Mission, place: Floats) -> None:
    fence = mission.limits.max_distance_m
    around = np.linspace(0.0, 2.0 * np.pi, 200)
    ax.plot(fence * np.sin(around), fence * np.cos(around), color=VERMILION, linestyle="--", linewidth=1.0)
    ax.plot(place[:, 1], place[:, 0], color=BLUE)
    ax.plot(place[0, 1], place[0, 0], "o", color=BLUE, markersize=5)
    ax.set_aspect("equal")
    ax.set_xlabel("east / m")
    ax.set_ylabel("north / m")
    ax.set_title(f"from above; fence {fence:g} m")
