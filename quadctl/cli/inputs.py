"""Files that commands read: those where the user is, else those installed with quadctl; and one line on which."""

from collections.abc import Sequence
from pathlib import Path

import typer

from quadctl.cli.output import say
from quadctl.cli.overwriting import check_read
from quadctl.installed import describe, is_installed, locate


def find(path: Path | None) -> Path | None:
    """Callback of an argument or option that names a file or folder: says so where the installed one is used."""
    if path is None:
        return None
    found = locate(path)
    if is_installed(found):
        say(describe(str(path), found))
    return found


def find_all(paths: list[Path]) -> list[Path]:
    """Callback of an argument that names several files, as `find`."""
    return [found for path in paths if (found := find(path)) is not None]


def find_first(paths: list[Path]) -> list[Path]:
    """Callback of an argument that names a model or vehicle file and then logs, as `find`."""
    return [find(paths[0]) or paths[0], *paths[1:]]


def model_and_logs(files: Sequence[Path]) -> tuple[Path, list[Path]]:
    """The model file and the logs after it.

    Raises
    ------
    BadParameter
        There is no log.
    """
    model, *logs = files
    if not logs:
        raise no_log()
    return model, logs


def no_log() -> typer.BadParameter:
    """The refusal of a command without a flight log."""
    return typer.BadParameter("no flight log is given", param_hint="'LOG...'")


def find_mission(path: Path) -> Path:
    """Callback of an argument that names a mission file, as `find`; `figure8` stands for missions/figure8.yaml, too."""
    named = Path("missions") / f"{path.name.removesuffix('.yaml')}.yaml"
    bare = len(path.parts) == 1 and not path.exists() and locate(named).is_file()
    return find(named if bare else path) or path


def find_configuration(given: Path | None, mission: Path) -> Path:
    """The flight configuration for a mission; says which one is used."""
    from quadctl.flight.pilot.settings import find_config

    path = find_config(given, mission)
    check_read(path)
    say(describe("configuration", path))
    return path
