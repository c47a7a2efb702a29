"""Conversion of a figure to SVG for a page."""

import io
import re

import matplotlib as mpl
from matplotlib.figure import Figure

from quadctl.lab.plots.style import (
    STYLE,
)

_GROUP_ID = re.compile(r' id="[a-zA-Z0-9.]+_[0-9]+"')
_PATH = re.compile(r' d="[^"]*"')
_LONG_NUMBER = re.compile(r"-?\d+\.\d{3,}")


def to_svg(figure: Figure, name: str) -> str:
    """Convert a figure to an SVG element for a page: text as text, no addresses, ids that are unique to `name`."""
    out = io.StringIO()
    with mpl.rc_context({**STYLE, "svg.hashsalt": name}):
        nothing = dict.fromkeys(("Date", "Creator", "Format", "Type"))
        figure.savefig(out, format="svg", metadata=nothing, dpi=120)
    svg = out.getvalue()
    svg = svg[svg.index("<svg") :].strip()
    # A page knows these namespaces; the size is the page's affair; the ids of matplotlib's groups repeat per figure.
    head, _, body = svg.partition(">")
    view = re.search(r'viewBox="0 0 ([\d.]+) [\d.]+"', head)
    width = f"{float(view[1]):.0f}px" if view else "100%"
    head = f'<svg {view[0] if view else ""} style="max-width:calc({width}*1.15)" aria-hidden="true"'
    body = _PATH.sub(
        lambda path: _LONG_NUMBER.sub(_rounded, path[0]).replace("\n", "").replace("L ", "L"), _GROUP_ID.sub("", body)
    )
    return f"{head}>{body}"


def _rounded(digits: re.Match[str]) -> str:
    """Round to a tenth of a pixel, which is as much as can be seen."""
    return f"{float(digits[0]):.1f}"
