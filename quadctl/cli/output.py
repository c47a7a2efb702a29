"""Files and lines that all commands write alike."""

import json
from pathlib import Path
from typing import Annotated, Any

import typer

from quadctl.cli.app import console
from quadctl.cli.overwriting import Writes
from quadctl.errors import QuadctlError
from quadctl.files import write_text

JsonOption = Annotated[Path | None, Writes(), typer.Option("--json", metavar="OUT", help="Write the result as JSON.")]


PlotOption = Annotated[
    Path | None,
    Writes(),
    typer.Option("--plot", metavar="FILE.png", help="Draw the measured points and the fitted curves."),
]
ForceOption = Annotated[bool, typer.Option("--force", help="Overwrite files of earlier runs.")]


def say(*lines: object, style: str | None = None) -> None:
    """Print lines as they are, without wrapping them."""
    console.print("\n".join(map(str, lines)), style=style, soft_wrap=True, markup=False, highlight=False)


def print_saved(path: Path) -> None:
    say(f"Saved: {path}")


def print_warning(sentence: str) -> None:
    say(f"warning: {sentence}", style="yellow")


def refuse_existing(force: bool, *outputs: Path | None) -> None:
    """Refuse to overwrite a file of an earlier run, unless `force` says so.

    Raises
    ------
    QuadctlError
        One of the files is there.
    """
    for path in () if force else outputs:
        if path is not None and path.exists():
            raise QuadctlError(f"{path}: is there already, expected a new file (or --force)")


def write_json(path: Path | None, result: dict[str, Any]) -> None:
    if path is not None:
        write_text(path, json.dumps(result, indent=1, allow_nan=False) + "\n")
