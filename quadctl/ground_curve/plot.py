"""The figure of the papers: thrust ratio over z/R, points with bars, curves, boundaries of the formulas' sections."""

from dataclasses import replace
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from quadctl.errors import LogError
from quadctl.files import writing
from quadctl.ground_curve.curves import LEVEL, Fit, Table, effects_of
from quadctl.ground_curve.result import GroundCurve
from quadctl.lab.plots.style import BLACK, FLIGHT_COLOURS, GREY, LIGHT, PANEL_PX, legend_above, panel, styled

CURVES = 5
"""Best formulas that are drawn."""
MARKERS = "osD^v<>p"


def draw(result: GroundCurve, path: Path) -> None:
    """Write the figure to `path` (PNG, SVG or PDF by its suffix).

    Raises
    ------
    LogError
        It cannot be written.
    """
    figure = ratio_over_height(result)
    with writing(path, LogError):
        path.parent.mkdir(parents=True, exist_ok=True)
        figure.savefig(path, dpi=120)


@styled
def ratio_over_height(result: GroundCurve) -> Figure:
    """Measured ratios (mean and 95 % interval of each height and surface) and the best formulas."""
    figure, ax = panel(5.0, 1.6 * PANEL_PX)
    table, radius_m = Table(result.measurement, result.vehicle), result.vehicle.rotor.radius_m
    shown = [fit for fit in result.fits if np.isfinite(fit.held_out) and fit.formula.effect is not None][:CURVES]
    for i, cell in enumerate(table.cells):
        _draw_points(ax, table, cell.rows, result.best, MARKERS[i % len(MARKERS)], _label(cell.surface, i))
    low, high = float(table.height_m.min()), float(table.height_m.max())
    z = np.geomspace(0.9 * low, 1.05 * high, 400)
    for fit, colour in zip(shown, FLIGHT_COLOURS, strict=False):
        for j, (surface, effect) in enumerate(effects_of(fit).items()):
            assert effect is not None
            one = np.ones(1)
            with np.errstate(all="ignore"):
                k = effect.rotor_thrust([one], replace(LEVEL, height_m=z), table.vehicles[0])[0]
            name = fit.formula.name.partition(".")[2] + (f", {surface}" if surface else "")
            ax.plot(z / radius_m, k, ("-", "--", ":", "-.")[j % 4], color=colour, label=name)
    sections = {b for fit in shown if fit.formula.effect for b in fit.formula.effect.sections_over_radius}
    for boundary in sorted(b for b in sections if low / radius_m < b < high / radius_m):
        ax.axvline(boundary, color=LIGHT, linestyle="--", linewidth=1.0, zorder=0)
        top = ax.get_xaxis_transform()
        ax.text(boundary, 0.98, f"{boundary:g} R", transform=top, ha="right", va="top", fontsize=9.5, color=GREY)
    ax.axhline(1.0, color=GREY, linewidth=0.8)
    ax.set_xlabel("height of the rotor plane over rotor radius, z/R")
    ax.set_ylabel("thrust ratio K")
    legend_above(ax, 3)
    return figure


def _draw_points(ax: Axes, table: Table, rows: np.ndarray, best: Fit, marker: str, label: str) -> None:
    ratio = table.thrust / best.far[table.tilt]
    here = [np.intersect1d(group, rows) for group in table.groups]
    here = [group for group in here if len(group)]
    x = np.array([table.height_m[group].mean() for group in here]) / table.vehicles[0].rotor.radius_m
    mean = np.array([ratio[group].mean() for group in here])
    error = np.array([ratio[g].std(ddof=1) / np.sqrt(len(g)) if len(g) > 1 else 0.0 for g in here])
    ax.errorbar(x, mean, 1.96 * error, fmt=marker, color=BLACK, markersize=5, capsize=2, label=label, zorder=4)


def _label(surface: str, i: int) -> str:
    return surface or ("measured" if i == 0 else f"measured, tilt {i + 1}")
