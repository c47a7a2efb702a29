"""Files that ship with quadctl: flight configuration, vehicles, missions, and the scripts around real autopilots.

They are written and edited at the top of the repository (`config/`, `missions/`, `sitl/`); the links beside this module
pack them into the wheel. A command takes a file that is where the user is; only where there is none, the installed one.
"""

import shutil
from pathlib import Path

from quadctl.errors import SettingsError
from quadctl.files import writing

_HERE = Path(__file__).parent
FOLDERS = {
    "config": _HERE / "config",
    "missions": _HERE / "missions",
    "sitl": _HERE.parent / "sitl",
}
"""Installed folders, by their names where the user is."""
_CODE = (".py", ".pyc")
"""Suffixes of the simulator's own code, which nobody edits in a copy."""


def locate(path: Path) -> Path:
    """`path` where it is there, else the installed file or folder of that name; `path` itself where neither is."""
    if path.exists() or not path.parts or path.parts[0] not in FOLDERS or ".." in path.parts:
        return path
    installed = FOLDERS[path.parts[0]].joinpath(*path.parts[1:])
    return installed if installed.exists() else path


def is_installed(path: Path) -> bool:
    """True for what `locate` found among the installed files."""
    return any(path.is_relative_to(folder) for folder in FOLDERS.values())


def name_of(path: Path) -> Path:
    """The path by which `locate` finds `path`: short, and right in any folder."""
    for name, folder in FOLDERS.items():
        if path.is_relative_to(folder):
            return Path(name) / path.relative_to(folder)
    return path


def describe(what: str, path: Path) -> str:
    """One line that says which file or folder a command uses: `configuration: config/flight.yaml`."""
    if not is_installed(path):
        return f"{what}: {path}"
    which, them = ("those", "them") if path.is_dir() else ("the one", "it")
    return f"{what}: {which} installed with quadctl (quadctl init DIR copies {them} for editing)"


def write_copies(directory: Path) -> list[Path]:
    """Copy the installed folders into `directory`, for editing, and return where each went.

    Raises
    ------
    SettingsError
        One of them is there already (then nothing is written), or cannot be written.
    """
    targets = {directory / name: folder for name, folder in FOLDERS.items()}
    for target in targets:
        if target.exists():
            raise SettingsError(f"{target}: is there already and would be overwritten, expected another directory")
    with writing(directory, SettingsError):
        for target, folder in targets.items():
            for file in sorted(folder.rglob("*")):
                if file.is_file() and file.suffix not in _CODE:
                    copy = target / file.relative_to(folder)
                    copy.parent.mkdir(parents=True, exist_ok=True)
                    shutil.copy(file, copy)
    return list(targets)
