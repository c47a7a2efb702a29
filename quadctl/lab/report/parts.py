"""Parts of a report."""

from dataclasses import dataclass, field
from typing import NamedTuple

from markupsafe import Markup
from matplotlib.figure import Figure as Drawing

from quadctl.lab import plots


class Cell(NamedTuple):
    """Cell of a table, with an optional note in smaller text."""

    text: str
    note: str = ""


@dataclass(frozen=True)
class Table:
    """Table; columns after the first `words` hold numbers."""

    head: list[str]
    rows: list[list[Cell]]
    words: int = 1
    marked: frozenset[int] = frozenset()
    """Indices of the highlighted rows."""


@dataclass(frozen=True)
class Figure:
    """SVG figure for a screen, and a narrow one for a telephone where the wide one would be too small."""

    svg: Markup
    caption: str
    narrow: Markup | None = None
    whole_width: bool = False


@dataclass(frozen=True)
class Section:
    """Section with sentences, then figures, lists, and tables."""

    anchor: str
    title: str
    text: list[str]
    figures: list[Figure] = field(default_factory=list)
    points: list[str] = field(default_factory=list)
    tables: list[Table] = field(default_factory=list)
    after_text: list[str] = field(default_factory=list)


class Tile(NamedTuple):
    """One number at the top of the page, with its name."""

    value: str
    name: str


@dataclass(frozen=True)
class Headline:
    """Main number of the page: the error before and after, with sentences about it."""

    before: str
    after: str
    change: str
    what: str
    sentences: list[str]
    tiles: list[Tile]


def figure(drawing: Drawing, name: str, caption: str) -> Figure:
    return Figure(Markup(plots.to_svg(drawing, name)), caption)


def both_widths(name: str, caption: str, wide: Drawing, narrow: Drawing) -> Figure:
    return Figure(
        Markup(plots.to_svg(wide, f"{name}-wide")), caption, Markup(plots.to_svg(narrow, f"{name}-narrow")), True
    )
