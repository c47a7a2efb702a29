"""The strip charts: curves over the last minute while a flight goes on, over all of it afterwards."""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

from quadctl.web.elements.figure import Figure, axis, figure, stacked
from quadctl.web.elements.theme import Theme
from quadctl.web.live.history import Row

WINDOW_ROWS = 600
"""One minute of rows."""
PANE_PX, FIRST_PANE_PX = 84, 130
NAMED_SHARE = 0.03
"""Shortest phase that gets its name, as a share of the time shown."""


class Curve(NamedTuple):
    name: str
    value: str
    """Field of a `Row`."""
    colour: str
    """Field of a `Theme`."""


DASHED = ("reference", "expected", "expected, below")
"""Names of the curves that say how it was to be."""

Panes = dict[str, list[Curve]]
"""Curves by the title of their axis."""

FLIGHT: Panes = {
    "height / m": [Curve("height", "height_m", "measured"), Curve("reference", "height_ref_m", "after")],
    "speed / m/s": [Curve("speed", "speed_m_s", "measured")],
    "tilt / °": [Curve("tilt", "tilt_deg", "measured")],
    "throttle / 1": [Curve("throttle", "throttle", "measured")],
    "residual / m/s²": [
        Curve("residual forward", "residual_forward", "measured"),
        Curve("right", "residual_right", "before"),
        Curve("down", "residual_down", "after"),
        Curve("expected", "expected", "muted"),
        Curve("expected, below", "expected_below", "muted"),
    ],
}
MACHINE: Panes = {
    "lateness / ms": [Curve("tick lateness", "late_ms", "before")],
    "state age / ms": [Curve("state age", "state_age_ms", "measured")],
    "link age / ms": [Curve("link age", "link_age_ms", "measured")],
    "battery / V": [Curve("battery", "battery_v", "measured")],
}


def strips(panes: Panes, rows: Sequence[Row], phases: Sequence[tuple[float, str]], theme: Theme) -> Figure:
    """Figure of the panes below each other, over a common time."""
    heights = [FIRST_PANE_PX, *[PANE_PX] * (len(panes) - 1)]
    domains, total = stacked(heights)
    layout: dict[str, Any] = {
        "xaxis": axis("time since the first tick / s", theme, anchor="free", position=0, showgrid=False),
        "hovermode": "x",
        "hoversubplots": "axis",
        **marks(phases, theme),
    }
    xs, ys = points(panes, rows)
    data: list[dict[str, Any]] = []
    for i, ((title, curves), domain) in enumerate(zip(panes.items(), domains, strict=True)):
        number = "" if i == 0 else str(i + 1)
        layout[f"yaxis{number}"] = axis(title, theme, domain=domain, nticks=4, fixedrange=True)
        for curve in curves:
            colour = getattr(theme, curve.colour)
            dash = "dash" if curve.name in DASHED else "solid"
            data.append(
                {
                    "type": "scatter",
                    "mode": "lines",
                    "name": curve.name,
                    "x": xs[len(data)],
                    "y": ys[len(data)],
                    "yaxis": f"y{number}",
                    "line": {"color": colour, "width": 1.6, "dash": dash},
                    "showlegend": len(curves) > 1 and curve.value != "expected_below",
                    "hovertemplate": "%{y:.3~g}",
                }
            )
    return figure(data, theme, total + 84, **layout)


def points(panes: Panes, rows: Sequence[Row]) -> tuple[list[list[float]], list[list[float | None]]]:
    """Times and values of every curve; unknown values are None, which is a gap."""
    curves = [curve for shown in panes.values() for curve in shown]
    times = [row.time_s for row in rows]
    values = [[_known(getattr(row, curve.value)) for row in rows] for curve in curves]
    return [times] * len(curves), values


def marks(phases: Sequence[tuple[float, str]], theme: Theme) -> dict[str, Any]:
    """Lines at the begin of each phase, with their names at the top."""
    line = {"color": theme.muted, "width": 1, "dash": "dot"}
    shapes = [{"type": "line", "x0": t, "x1": t, "yref": "paper", "y0": 0, "y1": 1, "line": line} for t, _ in phases]
    ends = [*[t for t, _ in phases[1:]], math.inf]
    least_s = NAMED_SHARE * (phases[-1][0] - phases[0][0]) if phases else 0.0
    names = [
        {
            "x": t, "y": 1, "yref": "paper", "text": name, "showarrow": False, "xanchor": "left", "yanchor": "top",
            "font": {"size": 10, "color": theme.muted}, "xshift": 3, "textangle": 90,
        }
        for (t, name), end in zip(phases, ends, strict=False)
        if end - t > least_s
    ]  # fmt: skip
    return {"shapes": shapes, "annotations": names}


def _known(value: float) -> float | None:
    return value if math.isfinite(value) else None
