"""Style of all figures: sizes, colours, and common parts.

Sizes are in CSS pixels and fonts are drawn at their size on screen, so that text stays legible where a figure is shown
at its own width. The colours are those of Okabe and Ito, which colour-blind readers can distinguish: black is measured,
vermilion is before, blue is after (with the added effect), green is the reference error.
"""

from collections.abc import Callable
from functools import wraps
from typing import Any, ParamSpec

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from quadctl.lab.arrays import Floats

WIDE_PX, PANEL_PX, NARROW_PX = 980, 440, 360
MAX_DRAWN = 4000
"""Number of points beyond which lines are drawn as pixels and clouds are thinned out, so that a page stays small."""
BLACK, ORANGE, SKY, GREEN, BLUE, VERMILION, PURPLE, GREY = (
    *("#222222", "#E69F00", "#56B4E9", "#009E73", "#0072B2", "#D55E00", "#CC79A7", "#8A8A8A"),
)
LIGHT = "#C4C4C4"
BEFORE, AFTER, FLOOR = VERMILION, BLUE, GREEN
FLIGHT_COLOURS = (VERMILION, ORANGE, BLUE, GREEN, PURPLE, SKY)
TEXTBOOK = {"cheeseman": (ORANGE, "--"), "hayden": (PURPLE, "-."), "sanchez": (GREEN, ":")}
STYLE: dict[Any, Any] = {
    "font.size": 11.0,
    "axes.titlesize": 11.5,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.labelsize": 11.0,
    "xtick.labelsize": 10.5,
    "ytick.labelsize": 10.5,
    "legend.fontsize": 10.5,
    "legend.frameon": False,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": "#666666",
    "axes.labelcolor": BLACK,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#E4E4E4",
    "grid.linewidth": 0.7,
    "lines.linewidth": 1.4,
    "figure.facecolor": "white",
    "figure.dpi": 72.0,
    "figure.constrained_layout.use": True,
    "svg.fonttype": "none",
    "text.parse_math": False,  # a dollar sign in the name of a file is a dollar sign
}
_P = ParamSpec("_P")


def styled(draw: Callable[_P, Figure]) -> Callable[_P, Figure]:
    """Apply the common style to the figures that `draw` makes, whatever the caller's style is."""

    @wraps(draw)
    def styled(*args: _P.args, **kwargs: _P.kwargs) -> Figure:
        with mpl.rc_context(STYLE):
            return draw(*args, **kwargs)

    return styled


def panel(height_in: float = 4.0, width_px: float = PANEL_PX) -> tuple[Figure, Axes]:
    figure = Figure(figsize=(width_px / 72, height_in))
    return figure, figure.subplots()


def beside(ax: Axes, x: float, row: int, text: str) -> None:
    """Write a note to the right of the end of a bar."""
    white = {"facecolor": "white", "edgecolor": "none", "pad": 1.0}
    ax.annotate(
        text, (x, row), (5, 0), textcoords="offset points", va="center", fontsize=10.0, color="#333333", bbox=white
    )


def legend_name(name: str) -> str:
    """Make a legend name visible that begins with an underscore, which matplotlib would leave out."""
    return f"\u200b{name}" if name.startswith("_") else name


def legend_above(ax: Axes, columns: int) -> None:
    ax.legend(
        loc="lower left",
        bbox_to_anchor=(0.0, 1.0),
        ncols=columns,
        borderaxespad=0.2,
        handlelength=1.5,
        columnspacing=1.2,
    )


def cloud(ax: Axes, x: Floats, y: Floats, colour: str) -> None:
    some = slice(None, None, max(1, len(x) // MAX_DRAWN))
    ax.scatter(x[some], y[some], s=5, color=colour, alpha=0.25, linewidths=0, rasterized=True)


def points(
    ax: Axes, x: Floats, mean: Floats, error: Floats, colour: str, label: str | None = None, marker: str = "o"
) -> None:
    """Draw means with 95% error bars."""
    ax.errorbar(
        x, mean, 1.96 * error, fmt=marker, color=colour, label=label, markersize=5, linewidth=1.4, capsize=2, zorder=4
    )


def limits(ax: Axes, values: Floats, whole: bool = False) -> None:
    """Set the y limits so that zero and all but the most extreme values are visible."""
    low, high = np.quantile(values, [0.0, 1.0] if whole else [0.002, 0.998])
    low, high = min(low, 0.0), max(high, 0.0)
    room = 0.08 * max(float(high - low), 1e-3)
    ax.set_ylim(float(low) - room, float(high) + room)


def inner_range(x: Floats) -> tuple[float, float]:
    low, high = np.quantile(x, [0.001, 0.999])
    room = 0.03 * max(float(high - low), 1e-6)
    return float(low) - room, float(high) + room
