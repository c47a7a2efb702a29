"""The sidecar file of a flight log, `NAME.meta.yaml` (docs/log-format.md)."""

from pathlib import Path
from typing import Any

import yaml

from quadctl.logs.findings import Finding, Kind, finding


def meta_path(path: Path) -> Path:
    """The sidecar file of a log: `hover.csv` has `hover.meta.yaml`."""
    return path.with_suffix(".meta.yaml")


def read_meta(path: Path, findings: list[Finding]) -> dict[str, Any]:
    """Read the sidecar of the log at `path`, {} if there is none; a damaged one costs a finding, not the flight."""
    sidecar = meta_path(path)
    try:
        meta = yaml.safe_load(sidecar.read_text(encoding="utf-8"))
    except FileNotFoundError:
        return {}
    except (OSError, UnicodeDecodeError, yaml.YAMLError, RecursionError):
        meta = None
    if isinstance(meta, dict):
        return meta
    findings.append(finding(Kind.SIDECAR_UNREADABLE, file=sidecar.name))
    return {}
