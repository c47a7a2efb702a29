"""The residual over one variable: binned means with bands, over a cloud of samples."""

import numpy as np

from quadctl.lab.comparison.comparison import Comparison
from quadctl.lab.comparison.failures import Profile
from quadctl.lab.comparison.wording import label_of
from quadctl.lab.flights.prediction import AXES
from quadctl.web.elements.figure import Figure, axis, faded, figure
from quadctl.web.elements.theme import Theme

CLOUD = 1500
"""Most samples that are drawn."""


def profile_figure(comparison: Comparison, profile: Profile, theme: Theme, height: int = 260) -> Figure:
    """Residual of one axis over one variable, m/s²; of a complete model, all means are on the zero line."""
    x = comparison.dataset.variable(profile.variable)
    values = comparison.residual[:, AXES.index(profile.axis)]
    if x is None:
        raise ValueError(f"{profile.variable} has a profile, but no flight has it")
    some = slice(None, None, max(1, len(x) // CLOUD))
    low, high = profile.mean - 1.96 * profile.error, profile.mean + 1.96 * profile.error
    band = faded(theme.before, 0.22)
    data = [
        {
            "type": "scatter", "mode": "markers", "name": "samples", "x": x[some], "y": values[some],
            "marker": {"color": faded(theme.muted, 0.35), "size": 3}, "hoverinfo": "skip",
        },
        {
            "type": "scatter", "mode": "lines", "x": np.concatenate([profile.centre, profile.centre[::-1]]),
            "y": np.concatenate([high, low[::-1]]), "fill": "toself", "fillcolor": band, "line": {"width": 0},
            "hoverinfo": "skip", "name": "95% band of the mean",
        },
        {
            "type": "scatter", "mode": "lines+markers", "name": "mean", "x": profile.centre, "y": profile.mean,
            "line": {"color": theme.before, "width": 2}, "marker": {"color": theme.before, "size": 6},
            "hovertemplate": "%{x:.3g}: %{y:.3f} m/s²<extra></extra>",
        },
    ]  # fmt: skip
    reach = 1.15 * max(float(np.quantile(np.abs(values), 0.98)), float(np.max(np.abs([low, high]))))
    return figure(
        data,
        theme,
        height,
        xaxis=axis(label_of(profile.variable), theme),
        yaxis=axis(f"residual {profile.axis} / m/s²", theme, range=[-reach, reach]),
        showlegend=False,
        dragmode="select",
        selectdirection="h",
    )
