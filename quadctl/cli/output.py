"""Files and lines that all commands write alike."""

import json
from pathlib import Path
from typing import Annotated, Any

import typer

from quadctl.cli.app import console
from quadctl.cli.overwriting import Writes
from quadctl.files import write_text

JsonOption = Annotated[Path | None, Writes(), typer.Option("--json", metavar="OUT", help="Write the result as JSON.")]


def print_saved(path: Path) -> None:
    console.print(f"Saved: {path}", soft_wrap=True, markup=False, highlight=False)


def print_warning(sentence: str) -> None:
    console.print(f"warning: {sentence}", style="yellow", soft_wrap=True, markup=False, highlight=False)


def write_json(path: Path | None, result: dict[str, Any]) -> None:
    if path is not None:
        write_text(path, json.dumps(result, indent=1, allow_nan=False) + "\n")
