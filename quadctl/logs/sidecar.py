"""The sidecar file of a flight log, `NAME.meta.yaml` (docs/log-format.md)."""

from pathlib import Path
from typing import Any

import yaml


def meta_path(path: Path) -> Path:
    """The sidecar file of a log: `hover.csv` has `hover.meta.yaml`."""
    return path.with_suffix(".meta.yaml")


def read_meta(path: Path, notes: list[str]) -> dict[str, Any]:
    """Read the sidecar of the log at `path`, {} if there is none; a damaged one costs a note, not the flight."""
    sidecar = meta_path(path)
    try:
        meta = yaml.safe_load(sidecar.read_text(encoding="utf-8"))
    except FileNotFoundError:
        return {}
    except (OSError, UnicodeDecodeError, yaml.YAMLError, RecursionError):
        meta = None
    if isinstance(meta, dict):
        return meta
    notes.append(f"{sidecar.name} beside it is not a readable YAML mapping and was left out")
    return {}
