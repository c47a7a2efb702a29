"""Pieces of the page: tables in Markdown, and numbers with their intervals."""

import textwrap
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.figure import Figure

REPOSITORY = Path(__file__).parents[2]
DOCS = REPOSITORY / "docs"
PAGE = DOCS / "papers.md"
WIDTH = 120


def table(headings: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A Markdown table; the first column is text, the others are numbers."""
    rule = ["---", *["---:"] * (len(headings) - 1)]
    return "\n".join("| " + " | ".join(cells) + " |" for cells in (headings, rule, *rows))


def with_interval(value: float, low: float, high: float, digits: int = 3) -> str:
    """The value and its 95 % interval."""
    return f"{value:.{digits}f} [{low:.{digits}f}, {high:.{digits}f}]"


def with_deviation(values: Sequence[float], digits: int = 3) -> str:
    """Mean and population standard deviation, as the thesis gives them."""
    mean = sum(values) / len(values)
    deviation = (sum((v - mean) ** 2 for v in values) / len(values)) ** 0.5
    return f"{mean:.{digits}f} ± {deviation:.{digits}f}"


def wrapped(text: str) -> str:
    """Markdown with its paragraphs and list items broken at `WIDTH`; tables, headings and figures stay as they are."""
    blocks = text.strip().split("\n\n")
    return "\n\n".join(_wrapped_block(block) for block in blocks) + "\n"


def _wrapped_block(block: str) -> str:
    if block.startswith(("#", "|", "!")):
        return block
    items = block.removeprefix("- ").split("\n- ") if block.startswith("- ") else [block]
    first, later = ("- ", "  ") if block.startswith("- ") else ("", "")
    return "\n".join(
        textwrap.fill(
            " ".join(item.split()),
            WIDTH,
            initial_indent=first,
            subsequent_indent=later,
            break_long_words=False,
            break_on_hyphens=False,
        )
        for item in items
    )


def save(figure: "Figure", name: str, alt: str) -> str:
    """Write a figure beside the page; gives the Markdown that shows it."""
    DOCS.mkdir(exist_ok=True)
    file = f"papers-{name}.png"
    figure.savefig(DOCS / file, dpi=110, metadata={"Software": None})
    return f"![{alt}]({file})"
