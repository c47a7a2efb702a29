"""Files and lines that all commands write alike; no result ever overwrites a flight log."""

import json
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import typer

from quadctl.cli.app import console
from quadctl.errors import QuadctlError
from quadctl.logs.formats import suffixes

LOG_SUFFIXES = suffixes()
"""A flight cannot be flown again: no result is ever written to a file that is named like a flight log."""

JsonOption = Annotated[Path | None, typer.Option("--json", metavar="OUT", help="Write the result as JSON.")]


def print_saved(path: Path) -> None:
    console.print(f"Saved: {path}", soft_wrap=True, markup=False, highlight=False)


def print_warning(sentence: str) -> None:
    console.print(f"warning: {sentence}", style="yellow", soft_wrap=True, markup=False, highlight=False)


def check_outputs(inputs: Sequence[Path | None], *outputs: Path | None) -> None:
    """Refuse an output file that would destroy something, or that cannot be one, before any work is done.

    Raises
    ------
    QuadctlError
        An output is a directory, named like a flight log, one of the inputs, or the same as another output.
    """
    taken = {os.path.realpath(path): "is read by this command" for path in inputs if path is not None}
    for path in outputs:
        if path is None:
            continue
        if path.is_dir():
            raise QuadctlError(f"{path}: is a directory, expected the name of a file to write")
        if path.suffix.lower() in LOG_SUFFIXES:
            raise QuadctlError(f"{path}: is the name of a flight log, expected another file to write the result to")
        place = os.path.realpath(path)
        if place in taken:
            raise QuadctlError(f"{path}: {taken[place]}, expected another file to write the result to")
        taken[place] = "is written by this command already"


def write_json(path: Path | None, result: dict[str, Any]) -> None:
    if path is not None:
        write_text(path, json.dumps(result, indent=1, allow_nan=False) + "\n")


def write_text(path: Path, text: str) -> None:
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise QuadctlError(f"{path}: cannot be written ({error.strerror})") from None
