"""Small multiples: one quantity of every vehicle, flight by flight, on the same scales."""

import math
from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from quadctl.fleet.changes import Change, Series
from quadctl.lab.plots.style import BLACK, GREY, LIGHT, VERMILION, WIDE_PX, styled
from quadctl.lab.random_effects import Population

COLUMNS = 8
PANEL_HEIGHT_PX = 84
OUTLIERS = 0.01
"""Share of the values at either end that may lie outside of the panels."""


@styled
def small_multiples(series: Sequence[Series], changes: Sequence[Change], population: Population | None) -> Figure:
    """Panels of the series of one quantity; those of vehicles that changed come first, and are marked.

    The grey line is the mean of the population, the band what a vehicle that has not been measured would have with
    95 % probability.
    """
    changed = {change.vehicle: change for change in changes}
    order = sorted(series, key=lambda one: changed[one.vehicle].p_value if one.vehicle in changed else 2.0)
    rows = math.ceil(len(order) / COLUMNS)
    height = rows * PANEL_HEIGHT_PX + 40
    figure = Figure(figsize=(WIDE_PX / 72.0, height / 72.0))
    panels = np.atleast_1d(figure.subplots(rows, min(COLUMNS, len(order)), sharex=True, sharey=True)).ravel()
    ends = [OUTLIERS, 1.0 - OUTLIERS]
    shown = [np.quantile(np.concatenate([one.values for one in order]), ends)]
    shown += [np.quantile(one.values, ends) for one in order if one.vehicle in changed]
    low, high = float(np.min(shown)), float(np.max(shown))
    margin = 0.08 * max(high - low, 1e-9)
    for ax, one in zip(panels, order, strict=False):
        _panel(ax, one, changed.get(one.vehicle), population)
        ax.set_ylim(low - margin, high + margin)
    for ax in panels[len(order) :]:
        ax.set_visible(False)
    figure.supxlabel("flight", fontsize=10.5)
    return figure


def _panel(ax: Axes, series: Series, change: Change | None, population: Population | None) -> None:
    if population is not None:
        ax.axhspan(*population.next_ci95, color=LIGHT, alpha=0.35, linewidth=0.0)
        ax.axhline(population.mean, color=GREY, linewidth=0.8)
    ax.plot(series.number, series.values, ".", color=BLACK, markersize=3.0)
    ax.set_title(series.vehicle, fontsize=9.5, color=VERMILION if change else BLACK)
    ax.tick_params(labelsize=8.5)
    if change is None:
        return
    if change.kind == "drift":
        middle = np.median(series.values - change.size / 10.0 * series.number)
        ax.plot(series.number, middle + change.size / 10.0 * series.number, color=VERMILION)
        return
    at = series.flights.index(change.since)
    for part in (slice(None, at), slice(at, None)):
        level = float(np.median(series.values[part]))
        ax.plot(series.number[part], np.full(len(series.number[part]), level), color=VERMILION)
