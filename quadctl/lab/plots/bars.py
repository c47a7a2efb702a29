"""Bars of the error before and after a change of the model."""

from collections.abc import Mapping

import numpy as np
from matplotlib.figure import Figure

from quadctl.lab.flights.prediction import AXES
from quadctl.lab.plots.style import (
    AFTER,
    BEFORE,
    FLOOR,
    legend_above,
    panel,
    styled,
)


@styled
def before_after(before: Mapping[str, float], after: Mapping[str, float], floor: Mapping[str, float] | None) -> Figure:
    """Error per axis and total, before and after; the reference error where it is known for these data."""
    figure, ax = panel()
    names = (*AXES, "total")
    x = np.arange(len(names))
    for offset, values, colour, label in ((-0.2, before, BEFORE, "before"), (0.2, after, AFTER, "after")):
        heights = [values[name] for name in names]
        ax.bar(x + offset, heights, 0.38, color=colour, label=label)
        tops = heights if floor is None else [max(h, floor[name]) for h, name in zip(heights, names, strict=True)]
        for place, height, top in zip(x + offset, heights, tops, strict=True):
            ax.annotate(f"{height:#.2g}", (place, top), (0, 2), textcoords="offset points", ha="center", fontsize=9.5)
    if floor is not None:
        heights = [floor[name] for name in names]
        ax.hlines(heights, x - 0.42, x + 0.42, color=FLOOR, linewidth=2.2, label="reference error")
    ax.set_xticks(x, names)
    ax.grid(axis="x", visible=False)
    ax.margins(y=0.1)
    ax.set_ylabel("acceleration error (RMSE) / m/s²")
    legend_above(ax, columns=3)
    return figure
