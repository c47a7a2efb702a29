"""Files and lines that all commands write alike."""

import json
from pathlib import Path
from typing import Annotated, Any

import typer

from quadctl.cli.app import console
from quadctl.cli.overwriting import Writes
from quadctl.files import write_text

JsonOption = Annotated[Path | None, Writes(), typer.Option("--json", metavar="OUT", help="Write the result as JSON.")]
CurvesOption = Annotated[
    Path | None,
    Writes(),
    typer.Option("--plot", metavar="FILE.png", help="Draw the measured points and the fitted curves."),
]
ForceOption = Annotated[bool, typer.Option("--force", help="Overwrite files of earlier runs.")]


def say(*lines: object, style: str | None = None, end: str = "\n") -> None:
    """Print lines as they are: long ones stay whole, and nothing in them is taken for markup."""
    console.print("\n".join(map(str, lines)), style=style, end=end, soft_wrap=True, markup=False, highlight=False)


def tell(*sentences: object) -> None:
    """Print sentences, one a line, on a terminal wrapped at its width."""
    for sentence in sentences:
        console.print(str(sentence), soft_wrap=not console.is_terminal, markup=False, highlight=False)


def print_saved(path: Path) -> None:
    say(f"Saved: {path}")


def print_warning(sentence: str) -> None:
    say(f"warning: {sentence}", style="yellow")


def write_json(path: Path | None, result: dict[str, Any]) -> None:
    if path is not None:
        write_text(path, json.dumps(result, indent=1, allow_nan=False) + "\n")
