"""Choices of one tab, and the query of the address that holds them: a link to a state of the page."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from urllib.parse import parse_qsl, urlencode

from quadctl.lab.flights.flight import VARIABLE_NAMES
from quadctl.lab.flights.prediction import AXES

Brush = Mapping[str, tuple[float, float]]
"""Selected ranges, by the names of their variables."""
FIRST_CHANNELS = ("z_m", "z_ref_m")
FILE = "file"
"""Value of `Choices.beside` for the model of a file."""
MOST_CHARACTERS = 4000
"""Longest query that is read."""


@dataclass(frozen=True)
class Choices:
    """All that a person can choose in one tab without changing the analysis."""

    show: str = "missing"
    """Name of the part of the page."""
    axis: str = ""
    """Axis that is shown; empty where none was chosen: that with the largest error."""
    flight: str = ""
    """Name of the flight that was chosen; empty where none was: the first."""
    channels: tuple[str, ...] = FIRST_CHANNELS
    """Columns of the logs that are shown over time."""
    over_each_other: bool = False
    """Show these channels of all flights, not only of the chosen one."""
    beside: str = ""
    """Model that is drawn beside the others: the number of a step of the model sequence, `FILE`, or empty for none."""
    evidence: str = ""
    """Name of the effect whose evidence is open; empty where none is."""
    brush: Brush = field(default_factory=dict)

    def query(self) -> str:
        """The choices that differ from those of a new tab, as the query of an address; `show` is always said."""
        first = Choices()
        said = [("show", self.show)]
        said += [(name, getattr(self, name)) for name in _TEXTS if getattr(self, name) != getattr(first, name)]
        if self.channels != first.channels:
            said.append(("channels", ",".join(self.channels)))
        if self.over_each_other:
            said.append(("over", "1"))
        said += [("brush", f"{name}:{low:.6g}:{high:.6g}") for name, (low, high) in self.brush.items()]
        return urlencode(said, safe=":,")


_TEXTS = ("axis", "flight", "beside", "evidence")


def choices_of(query: str) -> Choices:
    """Choices of the query of an address; anything in it that is unknown or wrong is as in a new tab."""
    pairs = parse_qsl(query[:MOST_CHARACTERS].lstrip("?"), keep_blank_values=True)
    said = dict(pairs)
    first = Choices()
    texts = {name: said.get(name, getattr(first, name)) for name in _TEXTS}
    if texts["axis"] not in AXES:
        texts["axis"] = first.axis
    channels = tuple(filter(None, said["channels"].split(","))) if "channels" in said else first.channels
    brush = dict(found for name, text in pairs if name == "brush" and (found := _range(text)) is not None)
    return Choices(
        said.get("show", first.show), channels=channels, over_each_other="over" in said, brush=brush, **texts
    )


def _range(text: str) -> tuple[str, tuple[float, float]] | None:
    name, _, ends = text.partition(":")
    try:
        low, high = (float(end) for end in ends.split(":"))
    except ValueError:
        return None
    known = name in VARIABLE_NAMES and math.isfinite(low) and math.isfinite(high)
    return (name, (low, high)) if known else None
