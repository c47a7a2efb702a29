"""The one folder that the page writes to, and what may be dropped into it."""

import re
from pathlib import Path

from quadctl.errors import QuadctlError

MAX_UPLOAD_BYTES = 512 * 2**20
LOG_SUFFIXES = (".csv", ".ulg", ".bin", ".tlog")
SETTINGS_SUFFIXES = (".yaml", ".yml")
_UNUSUAL = re.compile(r"[^\w.+ -]")


def upload_path(folder: Path, name: str) -> Path:
    """Where a file that was dropped goes: into `folder`, whatever its name says.

    Raises
    ------
    QuadctlError
        It is neither a log nor a settings file by its name.
    """
    last = name.replace("\\", "/").rsplit("/", 1)[-1]
    safe = _UNUSUAL.sub("_", last).lstrip(".")
    if Path(safe).suffix.lower() not in (*LOG_SUFFIXES, *SETTINGS_SUFFIXES):
        raise QuadctlError(
            f"{last or 'a file without a name'}: is no flight log by its name, expected {', '.join(LOG_SUFFIXES)}, "
            f"or a model, vehicle or session (.yaml)"
        )
    return folder / safe


def require_inside(folder: Path, paths: tuple[Path, ...]) -> None:
    """Refuse paths that lead out of `folder`, links followed.

    Raises
    ------
    QuadctlError
        One does.
    """
    root = folder.resolve()
    for path in paths:
        if not path.resolve().is_relative_to(root):
            raise QuadctlError(f"{path}: is outside {folder}, the folder of this page: drop the file itself instead")


def too_large(name: str, size: float) -> str:
    """What is said of a file that is refused for its size."""
    return (
        f"{name}: has {size / 2**20:,.0f} MB, expected at most {MAX_UPLOAD_BYTES / 2**20:.0f} MB: "
        f"name it on the command line instead, quadctl lab {name}"
    )
