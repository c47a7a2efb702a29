"""Held-out improvement by each candidate."""

import numpy as np
from matplotlib.figure import Figure

from quadctl.lab.comparison.wording import change_in_words, p_in_words
from quadctl.lab.plots.style import AFTER, BLACK, FLOOR, LIGHT, SKY, beside, panel, styled
from quadctl.lab.selection.diagnosis import Diagnosis
from quadctl.lab.selection.rule import is_supported


def chosen(diagnosis: Diagnosis) -> set[str]:
    """Names of the missing effects."""
    return {step.effect for step in diagnosis.steps[1:]}


@styled
def ranking(diagnosis: Diagnosis, floor_total: float) -> Figure:
    """Drop of the held-out error with each candidate that was fitted, and the drop that the reference error allows."""
    candidates = [c for c in diagnosis.ranking if c.fitted]
    figure, ax = panel(0.9 + 0.36 * (len(candidates) + 1))
    drops = [*(100.0 * c.held_out_drop for c in candidates), 0.0]
    low = max(-20.0, min(0.0, *drops) - 2.0)
    colours = [AFTER if c.effect.name in chosen(diagnosis) else SKY if is_supported(c) else LIGHT for c in candidates]
    possible = 100.0 * (1.0 - floor_total / diagnosis.steps[0].rmse["total"])
    ax.axvline(possible, color=FLOOR, linestyle="--", label="drop to the reference error")
    ax.axvline(0.0, color=BLACK, linewidth=0.8)
    ax.barh(range(len(drops)), np.maximum(drops, low), color=[*colours, LIGHT], height=0.66)
    notes = [f"{change_in_words(c.held_out_drop)}, p {p_in_words(c.p_value)}" for c in candidates]
    for row, (drop, note) in enumerate(zip(drops, [*notes, "the given model"], strict=True)):
        beside(ax, max(drop, 0.0), row, note)
    ax.set_yticks(range(len(drops)), [*(c.effect.name for c in candidates), "none"])
    ax.set_xlim(low, max(possible, 5.0, *drops) * 1.05 + 38.0)
    ax.set_ylim(len(drops) - 0.5, -0.6)
    ax.grid(axis="y", visible=False)
    ax.set_xlabel("drop of the held-out error / %")
    figure.legend(loc="outside upper left")
    return figure
