"""Configurations of flights for the tests."""

from pathlib import Path
from typing import Any

import yaml

from tests.support.places import ROOT

CONFIG = ROOT / "config" / "flight.yaml"
FORGIVING = {"max_state_age_s": 1.0, "max_tick_late_s": 1.0}
"""Guards of flights that test something else than time: a machine that stands still for a moment does not end them."""


def configuration(where: Path, **changes: Any) -> Path:
    """Write the configuration that ships, with other settings, to the folder `where`."""
    settings = yaml.safe_load(CONFIG.read_text())
    settings["vehicle"] = str(CONFIG.parent / settings["vehicle"])
    for name, value in changes.items():
        settings[name] = settings[name] | value if isinstance(value, dict) else value
    path = where / "flight.yaml"
    path.write_text(yaml.safe_dump(settings))
    return path


def forgiving_config(where: Path, **changes: Any) -> Path:
    """The same with `FORGIVING` guards."""
    return configuration(where, guards=FORGIVING, **changes)
