"""Page of a benchmark: its table is written anew with every run, the notes below the table are written by hand."""

from pathlib import Path

NOTES = "## Notes"


def write_page(path: Path, measured: str) -> None:
    """Write `measured` as Markdown to `path`, and keep the notes of the page that is there."""
    _, heading, notes = path.read_text(encoding="utf-8").partition(NOTES) if path.exists() else ("", "", "")
    path.write_text(measured.rstrip() + "\n" + (f"\n{heading}{notes}" if heading else ""), encoding="utf-8")
