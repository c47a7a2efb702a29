"""The commands: parse, call, print; the work is done elsewhere."""

import functools
import os
import sys
from collections.abc import Callable
from importlib import import_module
from pkgutil import iter_modules
from typing import Annotated, NoReturn

import typer
from rich.console import Console

from quadctl import __version__
from quadctl.cli.app import app, console
from quadctl.cli.encoding import print_what_the_encoding_has
from quadctl.errors import QuadctlError

__all__ = ["app", "main"]

for _module in iter_modules(__path__):  # each registers its commands with the application
    import_module(f"{__name__}.{_module.name}")

INTERRUPTED = 130
"""Exit status with which typer ends on Ctrl-C."""

LAB_PACKAGES = ("scipy", "joblib", "polars", "matplotlib", "jinja2", "pyulog", "mcap", "pysindy", "casadi")
"""Packages of the extra `lab`, which the companion computer does not have."""
WEB_PACKAGES = ("nicegui", "cloudpickle")
"""Packages of the extra `web`."""


def _print_version(wanted: bool) -> None:
    if wanted:
        console.print(f"quadctl {__version__}", highlight=False)
        raise typer.Exit


@app.callback()
def options(
    version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version and exit.")
    ] = False,
) -> None:
    """Fly a multirotor from a companion computer, and find out which physics its model is missing."""


def main() -> NoReturn:
    """Entry point: errors that the user can mend are one sentence and exit status 1."""
    print_what_the_encoding_has()
    try:
        _command()()
    except QuadctlError as error:
        _fail(str(error), 1)
    except ModuleNotFoundError as error:
        package = (error.name or "").partition(".")[0]
        if package == "mavsdk":
            from quadctl.flight.preflight.computer import NO_MAVSDK

            _fail(f"this command needs {NO_MAVSDK}", 1)
        if package not in (*LAB_PACKAGES, *WEB_PACKAGES):
            raise
        extras = "lab,web" if package in WEB_PACKAGES else "lab"
        _fail(f"this command needs {error.name}, which the lean install leaves out: pip install 'quadctl[{extras}]'", 1)
    except MemoryError:
        _fail("there is not enough memory for a file of this size", 1)
    except OSError as error:
        # Whoever opens a file says which one; what is left is the output, such as a full disk behind `> file`.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        _fail(f"{error.filename or 'the output'}: {error.strerror or error}", 1)
    except SystemExit as ended:
        if ended.code == INTERRUPTED:
            _fail("interrupted", 1)
        raise
    sys.exit(0)


@functools.cache
def _command() -> Callable[[], None]:
    """All commands as they are parsed: a process that runs many builds them once."""
    return typer.main.get_command(app)


def _fail(sentence: str, status: int) -> NoReturn:
    Console(stderr=True, soft_wrap=True, markup=False, highlight=False).print(f"quadctl: {sentence}")
    sys.exit(status)
