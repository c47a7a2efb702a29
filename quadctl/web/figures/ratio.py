"""A model as a compensator: the thrust ratio that it inverts, over height and over speed."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from quadctl.effects import CATALOG
from quadctl.lab.arrays import Floats
from quadctl.lab.comparison.wording import label_of
from quadctl.lab.effect_curves import Binned, far_ratio, hover_ratio, measured_ratio, ratio_as_flown
from quadctl.lab.flights.dataset import Dataset
from quadctl.model import Model
from quadctl.web.elements.figure import Figure, axis, figure
from quadctl.web.elements.theme import Theme

TEXTBOOK = ("cheeseman", "hayden", "sanchez")
LOWEST = 0.6
"""Lowest height that is drawn, in rotor radii."""
EDGE = 0.02
"""Room for the half of a dot at the highest height, as a share of the axis."""
MARGIN = 0.15
"""Margin above the heights flown, as a share of the highest."""


def ratio_over_height(model: Model, dataset: Dataset, theme: Theme, height_px: int = 380) -> Figure:
    """Thrust ratio in hover over height, relative to that far from the ground: of the model, of the textbook's ground
    effects, and as measured."""
    radius = model.vehicle.rotor.radius_m
    flown = [h / radius for h in dataset.heights_m]
    lowest = max(LOWEST, min(0.75 * flown[0], 1.0))
    x = np.geomspace(lowest, max((1.0 + MARGIN) * flown[1], 2.0 * lowest), 200)  # dense where the curve bends
    still = np.zeros_like(x)
    curves = [
        _curve(x, _ratio(Model(model.vehicle).plus(CATALOG[f"ground_effect.{name}"]()), x * radius, still),
               f"{name.capitalize()}, textbook", colour, dash)
        for name, colour, dash in zip(TEXTBOOK, theme.others, ("dash", "dashdot", "dot"), strict=False)
    ]  # fmt: skip
    far = far_ratio(model)
    own = _curve(x, _ratio(model, x * radius, still) / far, "this model", theme.after, "solid", 3.0)
    points = _points(_relative(measured_ratio(dataset, "height_over_radius"), far), theme)
    top = _top([own, *points])
    return figure(
        [*curves, own, *points],
        theme,
        height_px,
        xaxis=axis(
            label_of("height_over_radius"), theme, range=[float(x[0]), float(x[-1] + EDGE * np.ptp(x))], zeroline=False
        ),
        yaxis=axis("thrust ratio (1 = this model far from the ground)", theme, range=top),
        shapes=[_trusted(flown, x, theme), _one(theme)],
        annotations=[_trusted_in_words(flown, x, theme)],
    )


def ratio_over_speed(model: Model, dataset: Dataset, theme: Theme, height_px: int = 380) -> Figure | None:
    """Thrust ratio over forward speed, of the model and as measured, each at the heights flown at that speed; None
    where the flights have hardly moved."""
    measured, modelled = measured_ratio(dataset, "speed_forward"), ratio_as_flown(model, dataset, "speed_forward")
    if measured is None or modelled is None or dataset.span("speed_forward") < 1.0:
        return None
    own = _curve(modelled.x, modelled.mean, "this model, at the heights flown", theme.after, "solid", 3.0)
    points = _points(measured, theme)
    y = axis("thrust ratio", theme, range=_top([own, *points]))
    data = [own, *points]
    return figure(data, theme, height_px, xaxis=axis(label_of("speed_forward"), theme), yaxis=y, shapes=[_one(theme)])


def _relative(measured: Binned | None, far: float) -> Binned | None:
    return None if measured is None else replace(measured, mean=measured.mean / far, error=measured.error / far)


def _ratio(model: Model, height_m: Floats, forward_m_s: Floats) -> Floats:
    with np.errstate(all="ignore"):  # a formula may have a pole in what is drawn: then there is no curve
        return hover_ratio(model, height_m, forward_m_s)


def _curve(x: Floats, y: Floats, name: str, colour: str, dash: str, width: float = 1.5) -> dict[str, Any]:
    line = {"color": colour, "dash": dash, "width": width}
    hover = "%{x:.2f}: %{y:.3f}"
    return {"type": "scatter", "mode": "lines", "name": name, "x": x, "y": y, "line": line, "hovertemplate": hover}


def _points(measured: Binned | None, theme: Theme) -> list[dict[str, Any]]:
    if measured is None:
        return []
    return [
        {
            "type": "scatter", "mode": "markers", "x": measured.x, "y": measured.mean,
            "name": "measured, mean and 95% interval",
            "marker": {"color": theme.measured, "size": 7}, "hovertemplate": "%{x:.2f}: %{y:.3f}",
            "error_y": {"type": "data", "array": 1.96 * measured.error, "color": theme.measured, "thickness": 1.2},
        }
    ]  # fmt: skip


def _top(shown: Sequence[dict[str, Any]]) -> list[float]:
    """Range of the vertical axis, for the model and the data with their intervals; textbook curves may leave it."""
    ends = [trace["y"] + sign * trace.get("error_y", {"array": 0.0})["array"] for trace in shown for sign in (-1, 1)]
    values = np.concatenate(ends)
    values = values[np.isfinite(values)]
    low, high = min(float(values.min()), 1.0), max(float(values.max()), 1.0)
    room = 0.25 * max(high - low, 0.04)
    return [low - room, high + room]


def _trusted(flown: Sequence[float], x: Floats, theme: Theme) -> dict[str, Any]:
    return {
        "type": "rect", "x0": max(flown[0], float(x[0])), "x1": min(flown[1], float(x[-1])), "yref": "paper", "y0": 0,
        "y1": 1, "fillcolor": theme.band, "line": {"width": 0}, "layer": "below",
    }  # fmt: skip


def _trusted_in_words(flown: Sequence[float], x: Floats, theme: Theme) -> dict[str, Any]:
    """Name of the band, on a ground of its own: no line of the grid strikes it out."""
    return {
        "text": "heights flown", "x": min(flown[1], float(x[-1])), "xanchor": "right", "yref": "paper", "y": 0.01,
        "yanchor": "bottom", "showarrow": False, "font": {"color": theme.muted}, "bgcolor": theme.surface,
        "borderpad": 2,
    }  # fmt: skip


def _one(theme: Theme) -> dict[str, Any]:
    line = {"color": theme.muted, "width": 1}
    return {"type": "line", "xref": "paper", "x0": 0, "x1": 1, "y0": 1, "y1": 1, "line": line, "layer": "below"}
