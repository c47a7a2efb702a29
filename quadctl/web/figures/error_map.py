"""Map of the mean residual over two variables."""

from typing import Any

import numpy as np

from quadctl.lab.arrays import Floats
from quadctl.lab.comparison.comparison import Comparison
from quadctl.lab.comparison.wording import label_of
from quadctl.lab.flights.prediction import AXES
from quadctl.web.elements.figure import Figure, axis, faded, figure
from quadctl.web.elements.theme import Theme

CELLS = 12
CLOUD = 3000
"""Most samples that are drawn."""
LEAST_SAMPLES = 2
"""Fewest samples of a cell that is drawn."""


def error_map(comparison: Comparison, axis_name: str, over: tuple[str, str], theme: Theme) -> Figure:
    """Mean residual in cells of two variables, m/s²; blue: less than predicted, vermilion: more."""
    x, y = (comparison.dataset.variable(name) for name in over)
    if x is None or y is None:
        raise ValueError(f"a map over {' and '.join(over)} is asked for, expected variables that all flights have")
    values = comparison.residual[:, AXES.index(axis_name)]
    edges = [_edges(v) for v in (x, y)]
    count, _, _ = np.histogram2d(x, y, bins=edges)
    total, _, _ = np.histogram2d(x, y, bins=edges, weights=values)
    with np.errstate(invalid="ignore"):
        mean = np.where(count >= LEAST_SAMPLES, total / count, np.nan)
    reach = float(np.nanmax(np.abs(mean))) if np.isfinite(mean).any() else 1.0
    centres = [0.5 * (e[1:] + e[:-1]) for e in edges]
    some = slice(None, None, max(1, len(x) // CLOUD))
    data: list[dict[str, Any]] = [
        {
            "type": "heatmap", "x": centres[0], "y": centres[1], "z": mean.T, "zmin": -reach, "zmax": reach,
            "name": "mean residual", "colorscale": [[0, "#0072B2"], [0.5, theme.surface], [1, "#D55E00"]],
            "colorbar": {"title": {"text": f"residual {axis_name}<br>m/s²"}, "thickness": 12, "outlinewidth": 0},
            "hovertemplate": "%{x:.3g}, %{y:.3g}: %{z:.3f} m/s²<extra></extra>",
        },
        {
            "type": "scatter", "mode": "markers", "x": x[some], "y": y[some], "hoverinfo": "skip",
            "marker": {"color": faded(theme.muted, 0.35), "size": 2}, "name": "samples",
        },
    ]  # fmt: skip
    x_title, y_title = label_of(over[0]), label_of(over[1])
    return figure(
        data, theme, 330, xaxis=axis(x_title, theme, zeroline=False), yaxis=axis(y_title, theme, zeroline=False),
        dragmode="select", showlegend=False,
    )  # fmt: skip


def _edges(values: Floats) -> Floats:
    low, high = np.quantile(values, [0.005, 0.995])
    return np.linspace(float(low), float(high), CELLS + 1)
