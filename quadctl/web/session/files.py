"""Files in the one folder that the page writes to: names, limits, and checks of dropped files."""

import hashlib
import re
from collections.abc import Iterator, Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any

from quadctl.errors import QuadctlError
from quadctl.lab.symbolic.effect_file import as_effect_file
from quadctl.lab.symbolic.formula import Symbolic
from quadctl.logs.formats import suffixes
from quadctl.model import Model
from quadctl.vehicle import Vehicle, load_vehicle

MAX_UPLOAD_BYTES = 512 * 2**20
LOG_SUFFIXES = suffixes()
SETTINGS_SUFFIXES = (".yaml", ".yml")
UPLOADS = "uploads"
"""Folder of the files that were dropped, in that of the page."""
OWN_VEHICLES = "vehicles"
"""Folder of the vehicles that were made on the page, in that of the page."""
EXPRESSION = "unexplained"
"""Family of the effects that come from an expression."""
_UNUSUAL = re.compile(r"[^\w.+ -]")


def upload_path(folder: Path, name: str) -> Path:
    """Path for a dropped file: inside `folder`, whatever its name says.

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


def vehicle_path(folder: Path, name: object) -> Path:
    """Path of the file of one's own vehicle of this name, inside `folder`, whatever the name is."""
    safe = _UNUSUAL.sub("_", str(name or "")).strip(" .") or "vehicle"
    return folder / OWN_VEHICLES / f"{safe}.yaml"


def vehicle_in(path: Path) -> Vehicle | None:
    """The vehicle in a file; None where it holds none, or cannot be read."""
    try:
        return _vehicle(path, path.stat().st_mtime_ns)
    except OSError:
        return None


@lru_cache(maxsize=100)
def _vehicle(path: Path, changed_ns: int) -> Vehicle | None:
    try:
        return load_vehicle(path)
    except QuadctlError:
        return None


def sha256_of(path: Path) -> str:
    """SHA-256 of a file; empty where it cannot be read."""
    try:
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError:
        return ""


def changed_logs(hashes: Mapping[Path, str]) -> dict[Path, str]:
    """Sentences for the logs that are not what they were when their session was saved; a log that is gone is none."""
    changed = {}
    for path, expected in hashes.items():
        found = sha256_of(path)
        if found and found != expected:
            changed[path] = (
                f"{path.name}: has the SHA-256 {found[:12]}, expected {expected[:12]} as when the session was saved: "
                "it is another file, and was left out"
            )
    return changed


def places_of(logs: Sequence[Path], folders: Sequence[Path]) -> dict[Path, Path]:
    """New places of the logs that are not where a session says: in the first of `folders` that holds one so named."""
    places = {}
    for log in logs:
        found = next((folder / log.name for folder in folders if (folder / log.name).is_file()), None)
        if found is not None and not log.is_file():
            places[log] = found
    return places


def is_inside(folder: Path, path: Path) -> bool:
    """Tell whether `path` is in `folder`, links followed."""
    return path.resolve().is_relative_to(folder.resolve())


def require_inside(folder: Path, paths: tuple[Path, ...]) -> None:
    """Refuse paths that lead out of `folder`, links followed.

    Raises
    ------
    QuadctlError
        One does.
    """
    for path in paths:
        if not is_inside(folder, path):
            raise QuadctlError(f"{path}: is outside {folder}, the folder of this page: drop the file itself instead")


def keep_expression(symbolic: Symbolic, model: Model, folder: Path) -> Path:
    """Write an expression that was found as an effect of one's own, to be added to `model`; nothing is overwritten.

    Raises
    ------
    QuadctlError
        It cannot be written.
    """
    number = 1 + sum(effect.family().startswith(EXPRESSION) for effect in model.effects)
    family = EXPRESSION if number == 1 else f"{EXPRESSION}_{number}"
    text = as_effect_file(symbolic, f"{family}.expression")
    path, copy = folder / f"{family}.py", 1
    try:
        folder.mkdir(parents=True, exist_ok=True)
        while path.exists() and path.read_text(encoding="utf-8") != text:
            copy += 1
            path = folder / f"{family}-{copy}.py"
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise QuadctlError(f"{path}: cannot be written ({error.strerror})") from None
    return path


def own_effects(settings: Any) -> Iterator[str]:
    """Python files that a model, or a session, names for its effects: loading the model would run them."""
    if isinstance(settings, dict):
        named = settings.get("effect_files")
        yield from map(str, named if isinstance(named, list) else [])
        yield from own_effects(list(settings.values()))
    elif isinstance(settings, list):
        for value in settings:
            yield from own_effects(value)
