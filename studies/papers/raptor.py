"""The public flight logs of Appius' thesis, and its vehicle."""

from pathlib import Path

from quadctl.logs.flight_log import FlightLog
from quadctl.logs.read import read_log
from quadctl.vehicle import Vehicle, load_vehicle
from studies.page import ROOT

LOGS = ROOT.parent / "shared" / "data" / "raptor"
"""From github.com/aurelappius/quad_logs."""


def raptor() -> Vehicle:
    return load_vehicle(ROOT / "config" / "vehicles" / "raptor.yaml")


def log(name: str, folder: Path = LOGS) -> FlightLog:
    """One of the logs by its name without extension.

    Raises
    ------
    LogError
        It is not there, or cannot be read.
    """
    return read_log(folder / f"{name}.csv")
