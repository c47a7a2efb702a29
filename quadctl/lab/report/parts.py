"""Parts of a report."""

from dataclasses import dataclass, field
from typing import NamedTuple

from markupsafe import Markup
from matplotlib.figure import Figure as Drawing

from quadctl.lab import plots
from quadctl.lab.comparison.comparison import Comparison
from quadctl.lab.selection.addition import Addition
from quadctl.lab.selection.diagnosis import Diagnosis
from quadctl.lab.tracking.step_response import StepResponses
from quadctl.vehicle import Vehicle


class Shown(NamedTuple):
    """Numbers and words of the page that a report is saved from, and that it repeats."""

    said: tuple[str, ...] = ()
    """Verdict in words, the main sentence first; empty where there is none yet."""
    condition: Vehicle | None = None
    """Vehicle of which nobody has said that it flew, or that the flights contradict."""
    floor_m_s2: float | None = None
    """Lowest noise floor of all steps of the error ladder."""
    errors_m_s2: tuple[float, float | None] | None = None
    """Errors of the first and of the current step; None for the second where there is only one step."""
    where: str = ""
    """Data that these errors are computed on."""
    on_unseen: bool = False
    """True where these are flights held out of all fits."""


class Results(NamedTuple):
    """Results that a page is made from."""

    comparison: Comparison
    diagnosis: Diagnosis | None = None
    addition: Addition | None = None
    before_unseen: Comparison | None = None
    after: Comparison | None = None
    steps: StepResponses | None = None
    shown: Shown = Shown()
    floors: dict[str, float] | None = None
    """Noise floor of the flights of the fit per axis and total, m/s^2; see `lowest_floors`."""


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
