"""Pieces of the pages that studies write: tables in Markdown, numbers with their intervals, and the files."""

import textwrap
from collections.abc import Container, Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.figure import Figure

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
WIDTH = 120
NOTES = "## Notes"
"""Heading of what is written by hand below a page."""


def table(headings: Sequence[str], rows: Iterable[Sequence[str]], texts: Container[int] = (0,)) -> str:
    """A Markdown table; the columns `texts` are text, the others numbers."""
    rule = ["---" if i in texts else "---:" for i in range(len(headings))]
    return "\n".join(map(row, (headings, rule, *rows)))


def row(cells: Iterable[str]) -> str:
    """One line of a table."""
    return f"| {' | '.join(cells)} |"


def share(right: Sequence[bool]) -> str:
    """Count and share of what is right."""
    return f"{sum(right)}/{len(right)} = {sum(right) / len(right):.0%}" if right else "-"


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


def write_page(path: Path, text: str) -> None:
    """Write a page, and keep the notes of the page that is there."""
    _, heading, notes = path.read_text(encoding="utf-8").partition(NOTES) if path.exists() else ("", "", "")
    path.write_text(text.rstrip() + "\n" + (f"\n{heading}{notes}" if heading else ""), encoding="utf-8")


def write_part(path: Path, begin: str, end: str, text: str) -> None:
    """Put `text` between the marks of a page."""
    before, _, rest = path.read_text(encoding="utf-8").partition(begin)
    _, mark, after = rest.partition(end)
    if not mark:
        raise ValueError(f"{path} has no {begin} and {end}")
    path.write_text(f"{before}{begin}\n\n{text}\n\n{mark}{after}", encoding="utf-8")


def save(figure: "Figure", name: str, alt: str) -> str:
    """Write a figure beside the page; gives the Markdown that shows it."""
    DOCS.mkdir(exist_ok=True)
    file = f"papers-{name}.png"
    figure.savefig(DOCS / file, dpi=110, metadata={"Software": None})
    return f"![{alt}]({file})"
