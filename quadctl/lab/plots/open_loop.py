"""Open-loop error over the time simulated."""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.figure import Figure

from quadctl.lab.comparison.open_loop import OpenLoop
from quadctl.lab.plots.style import AFTER, BEFORE, GREY, legend_above, legend_name, panel, styled


@styled
def open_loop_errors(models: Mapping[str, Sequence[OpenLoop]]) -> Figure:
    """Error of the predicted position of one or two models at each horizon, and of a constant velocity."""
    figure, ax = panel()
    held = next(iter(models.values()))
    curves = {"no model (constant velocity)": [e.held_position["total"] for e in held]}
    curves |= {legend_name(name): [e.position["total"] for e in errors] for name, errors in models.items()}
    for (name, ends), colour, marker in zip(curves.items(), (GREY, BEFORE, AFTER), "so^", strict=False):
        x = [e.horizon_s for e in held[: len(ends)]]
        y = np.array([end.rmse for end in ends])
        low, high = np.array([end.ci95 or (end.rmse, end.rmse) for end in ends]).T
        ax.errorbar(x, y, [y - low, high - y], color=colour, marker=marker, label=name, capsize=2, markersize=5)
    ax.set_yscale("log")
    ax.yaxis.set_major_formatter("{x:g}")
    ax.set_xticks([e.horizon_s for e in held])
    ax.set_xlabel("time simulated / s")
    ax.set_ylabel("position error (RMSE) / m")
    legend_above(ax, columns=3)
    return figure
