"""Frame, axes and buttons of a figure, and its numbers as CSV."""

import csv
import io
from collections.abc import Mapping, Sequence
from typing import Any, TypeAlias

import numpy as np

from quadctl.web.elements.theme import Theme

Figure: TypeAlias = dict[str, Any]
"""`data`, `layout` and `config`, as plotly.js takes them."""

GAP_PX = 10
"""Gap between axes below each other."""
MORE_CURVES = "and {more} more curves"
SAID_CURVES = 6
"""Most curves of a figure that are read aloud."""
UNWANTED_BUTTONS = ["toImage", "lasso2d", "autoScale2d", "zoomIn2d", "zoomOut2d", "toggleSpikelines"]


def figure(data: Sequence[Mapping[str, Any]], theme: Theme, height: int, **layout: Any) -> Figure:
    """A figure in the house style, `height` pixels high and as wide as there is room.

    Raises
    ------
    ValueError
        A curve has no name: the legend and the CSV file need one.
    """
    for number, trace in enumerate(data):
        if not trace.get("name"):
            raise ValueError(f"curve {number} of a figure has no name, expected one for the legend and the CSV file")
    base = {
        "height": height,
        "margin": {"l": 58, "r": 14, "t": 30, "b": 44},
        "paper_bgcolor": theme.surface,
        "plot_bgcolor": theme.surface,
        "font": {"family": "system-ui, sans-serif", "size": 12, "color": theme.ink},
        "hoverlabel": {"bgcolor": theme.surface, "bordercolor": theme.grid, "font": {"color": theme.ink}},
        "legend": {"orientation": "h", "x": 0, "y": 1, "yanchor": "bottom", "bgcolor": "rgba(0,0,0,0)"},
        "modebar": {"bgcolor": "rgba(0,0,0,0)", "color": theme.muted, "activecolor": theme.after},
        "uirevision": "kept",
    }
    config = {"displaylogo": False, "responsive": True, "modeBarButtonsToRemove": UNWANTED_BUTTONS}
    return {"data": [_sendable(trace) for trace in data], "layout": {**base, **layout}, "config": config}


def _sendable(trace: Mapping[str, Any]) -> dict[str, Any]:
    """Make arrays contiguous: the encoder of the page takes no others."""
    return {key: np.ascontiguousarray(v) if isinstance(v, np.ndarray) else v for key, v in trace.items()}


def axis(title: str, theme: Theme, **more: Any) -> dict[str, Any]:
    """An axis with its title, which holds the unit."""
    return {
        "title": {"text": title, "font": {"size": 12}, "standoff": 6},
        "gridcolor": theme.grid,
        "zerolinecolor": theme.muted,
        "zerolinewidth": 1,
        "linecolor": theme.muted,
        "tickfont": {"color": theme.muted},
        "automargin": True,
        **more,
    }


def stacked(heights_px: Sequence[int]) -> tuple[list[list[float]], int]:
    """Domains of y axes of such heights below each other, from the top, and their height in all, px."""
    total = sum(heights_px) + GAP_PX * (len(heights_px) - 1)
    domains, top = [], total
    for height in heights_px:
        domains.append([(top - height) / total, top / total])
        top -= height + GAP_PX
    return domains, total


def faded(colour: str, alpha: float) -> str:
    """`#rrggbb` as a colour that lets through."""
    red, green, blue = (int(colour[i : i + 2], 16) for i in (1, 3, 5))
    return f"rgba({red},{green},{blue},{alpha})"


def to_csv(drawn: Figure) -> str:
    """The numbers of a figure: one block of columns for each curve, headed by its name and the titles of the axes."""
    columns: list[tuple[str, Sequence[Any]]] = []
    for trace in drawn["data"]:
        name = trace["name"]
        for letter in ("x", "y", "z"):
            if letter in trace:
                columns += [
                    (f"{name}: {head}", values)
                    for head, values in _columns(trace, letter, _title(drawn["layout"], trace, letter))
                ]
    rows = max((len(values) for _, values in columns), default=0)
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow([name for name, _ in columns])
    for row in range(rows):
        writer.writerow([values[row] if row < len(values) else "" for _, values in columns])
    return out.getvalue()


def in_a_sentence(drawn: Figure) -> str:
    """The values of a figure for those who cannot see it: the range of each curve, with the titles of the axes."""
    said = []
    for trace in drawn["data"][:SAID_CURVES]:
        ranges = [_range(trace, letter, _title(drawn["layout"], trace, letter)) for letter in ("x", "y", "z")]
        said.append(f"{trace['name']}: {', '.join(text for text in ranges if text)}")
    more = len(drawn["data"]) - SAID_CURVES
    return "; ".join([*said, *([MORE_CURVES.format(more=more)] if more > 0 else [])]) + "."


def _range(trace: Mapping[str, Any], letter: str, title: str) -> str:
    """`height / m from 0.1 to 1.2`; empty where the curve has no numbers there."""
    try:
        values = np.asarray(trace.get(letter, ()), dtype=float)
    except (TypeError, ValueError):
        return ""
    known = values[np.isfinite(values)]
    return f"{title} from {known.min():.3g} to {known.max():.3g}" if known.size else ""


def _columns(trace: Mapping[str, Any], letter: str, title: str) -> list[tuple[str, Sequence[Any]]]:
    values = np.asarray(trace[letter])
    if values.ndim == 2:
        return [(f"{title} row {i + 1}", row.tolist()) for i, row in enumerate(values)]
    return [(title, values.tolist())]


def _title(layout: Mapping[str, Any], trace: Mapping[str, Any], letter: str) -> str:
    axes = layout.get("scene", layout)
    name = trace.get(f"{letter}axis", letter)
    number = name[1:] if isinstance(name, str) else ""
    found = axes.get(f"{letter}axis{number}", {}).get("title", {}).get("text", letter)
    return str(found)
