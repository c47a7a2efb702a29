"""Held-out error after each selection step."""

import numpy as np
from matplotlib.figure import Figure

from quadctl.lab.plots.style import AFTER, BEFORE, FLOOR, beside, panel, styled
from quadctl.lab.selection.diagnosis import Diagnosis


@styled
def model_sequence(diagnosis: Diagnosis, floor_total: float) -> Figure:
    """Held-out error of the given model, then with each missing family, in the order of adding."""
    figure, ax = panel(0.9 + 0.46 * len(diagnosis.steps))
    totals = [step.rmse["total"] for step in diagnosis.steps]
    names = [diagnosis.model.name, *(f"+ {step.effect}" for step in diagnosis.steps[1:])]
    rows = np.arange(len(totals))
    ax.barh(rows, totals, color=[BEFORE] + [AFTER] * (len(totals) - 1), height=0.62)
    for row, total in enumerate(totals):
        beside(ax, total, row, f"{total:#.3g}")
    ax.axvline(floor_total, color=FLOOR, linestyle="--", label="reference error")
    ax.set_yticks(rows, names)
    ax.set_ylim(len(rows) - 0.5, -0.6)
    ax.set_xlim(0.0, 1.14 * max(*totals, floor_total))
    ax.grid(axis="y", visible=False)
    ax.set_xlabel("held-out acceleration error (RMSE) / m/s²")
    figure.legend(loc="outside upper left")
    return figure
