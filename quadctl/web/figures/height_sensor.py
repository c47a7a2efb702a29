"""A height sensor minus its reference, over one variable: as read, and with the named errors taken away."""

from quadctl.effects.sensor_error import SensorError
from quadctl.lab.sensors.comparison import UNITS, over
from quadctl.lab.sensors.diagnosis import SensorDiagnosis
from quadctl.web.elements.figure import Figure, axis, faded, figure
from quadctl.web.elements.theme import Theme

CLOUD = 1200
"""Most rows that are drawn."""


def sensor_figure(found: SensorDiagnosis, variable: str, theme: Theme, height: int = 260) -> Figure:
    """Difference over `variable`, m: rows, and the means of bins; of a right sensor all means are on the zero line."""
    curves: list[tuple[str, tuple[SensorError, ...], str]] = [("as read", (), theme.before)]
    if found.missing:
        curves.append(("errors taken away", tuple(one.error for one in found.missing), theme.after))
    data: list[dict[str, object]] = []
    for name, errors, colour in curves:
        drawn = over(found.flights, errors, variable)
        some = slice(None, None, max(1, len(drawn.value) // CLOUD))
        if not errors:
            data.append(
                {
                    "type": "scatter", "mode": "markers", "name": "rows of half a second", "x": drawn.value[some],
                    "y": drawn.difference_m[some], "marker": {"color": faded(theme.muted, 0.35), "size": 3},
                    "hoverinfo": "skip",
                }
            )  # fmt: skip
        data.append(
            {
                "type": "scatter", "mode": "lines+markers", "name": name, "x": drawn.middle, "y": drawn.mean_m,
                "line": {"color": colour, "width": 2}, "marker": {"color": colour, "size": 6},
                "hovertemplate": "%{x:.3g}: %{y:.3f} m<extra></extra>",
            }
        )  # fmt: skip
    unit = UNITS[variable]
    return figure(
        data,
        theme,
        height,
        xaxis=axis(f"{variable} / {unit}" if unit else f"{variable} over that of hover", theme),
        yaxis=axis(f"{found.sensor} minus reference / m", theme),
    )
