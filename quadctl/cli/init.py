"""The command that copies what is installed with quadctl for editing."""

from pathlib import Path
from typing import Annotated

import typer

from quadctl.cli.app import app
from quadctl.cli.output import print_saved
from quadctl.cli.overwriting import WritesInto
from quadctl.installed import write_copies


@app.command()
def init(
    directory: Annotated[
        Path, WritesInto(), typer.Argument(metavar="DIR", help="Folder to write to; it is made where needed.")
    ],
) -> None:
    """Copy missions, vehicles and settings to edit them.

    The flight configuration and the simulator scripts are copied, too.
    """
    for written in write_copies(directory):
        print_saved(written)
