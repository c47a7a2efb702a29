"""Expected gain of each mission for the open questions."""

import numpy as np
from matplotlib.figure import Figure

from quadctl.lab.planning.suggestion import Suggestion
from quadctl.lab.plots.style import BLUE, GREEN, ORANGE, panel, styled

QUESTIONS = (
    ("confounded effects distinguished", BLUE),
    ("widest interval narrowed", ORANGE),
    ("untried effects shown", GREEN),
)
MOST_MISSIONS = 12


@styled
def mission_gains(suggestion: Suggestion) -> Figure:
    """Expected gain of each mission for each open question, the best mission first; 1 means fully answered."""
    options = suggestion.options[:MOST_MISSIONS]
    figure, ax = panel(1.3 + 0.5 * len(options))
    rows = np.arange(len(options))
    for i, (question, colour) in enumerate(QUESTIONS):
        ax.barh(rows + 0.26 * (i - 1), [o.gains[i] for o in options], 0.24, color=colour, label=question)
    ax.set_yticks(rows, [option.mission.name for option in options])
    ax.set_ylim(len(options) - 0.4, -0.6)
    ax.set_xlim(0.0, 1.02)
    ax.grid(axis="y", visible=False)
    ax.set_xlabel("expected gain (1: question answered)")
    figure.legend(loc="outside upper left")
    return figure
