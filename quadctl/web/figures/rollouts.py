"""Errors of forecasts of the whole state over the horizon, beside those of a state that is held and of a model."""

from quadctl.lab.rotation.rollout_errors import FORECAST, FORECAST_OF, HELD, HORIZONS_S, REFERENCE, SAVED, Unseen
from quadctl.web.elements.figure import Figure, axis, figure
from quadctl.web.elements.theme import Theme


def rollout_figure(unseen: Unseen, quantity: int, theme: Theme) -> Figure:
    """Mean error in one of `QUANTITIES` over the horizon, both on logarithmic axes."""
    data = []
    lines = {
        HELD: (theme.before, "dot"),
        SAVED: (theme.muted, "dash"),
        FORECAST: (theme.after, "solid"),
        REFERENCE: (theme.highlight, "dashdot"),
    }
    for model in unseen.errors:
        colour, dash = lines[model]
        values = [unseen.mean(model, h, quantity) for h in range(len(HORIZONS_S))]
        reach = {"array": [v.high - v.value for v in values], "color": colour}
        data.append(
            {
                "type": "scatter", "mode": "lines+markers", "name": model, "x": list(HORIZONS_S),
                "y": [v.value for v in values], "error_y": reach,
                "line": {"color": colour, "dash": dash, "width": 2},
            }
        )  # fmt: skip
    over = axis("horizon / s", theme, type="log", tickvals=list(HORIZONS_S))
    named = axis(f"error of {FORECAST_OF[quantity].replace(', ', ' / ')}", theme, type="log")
    return figure(data, theme, 240, xaxis=over, yaxis=named)
