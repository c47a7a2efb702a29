"""The plan of a drawn flight: its mission and settings as files, read as a user's are."""

from pathlib import Path

import yaml

from quadctl.flight.preflight.plan import FlightPlan
from quadctl.flight.preflight.preparation import prepare_flight

from ..faults.scene import CONFIG, VEHICLES
from .draw import Sequence


def write_files(sequence: Sequence, folder: Path) -> tuple[Path, Path]:
    """Write the mission and the flight configuration of a sequence; their paths."""
    settings = yaml.safe_load(CONFIG.read_text())
    settings["vehicle"] = str(VEHICLES / f"{sequence.vehicle}.yaml")
    settings["guards"] |= dict(sequence.guards)
    mission, config = folder / "random.yaml", folder / "flight.yaml"
    mission.write_text(yaml.safe_dump(dict(sequence.mission)))
    config.write_text(yaml.safe_dump(settings))
    return mission, config


def plan_of(sequence: Sequence, folder: Path) -> FlightPlan:
    """Plan of a sequence whose files go into `folder`; raises FlightError where the check refuses it."""
    mission, config = write_files(sequence, folder)
    return prepare_flight(mission, config, None, None)
