"""What the page begins with."""

from collections.abc import Sequence
from pathlib import Path

from quadctl.errors import LogError
from quadctl.model import load_model
from quadctl.web.session import Session, load_session

VEHICLES = Path("config/vehicles")


def vehicle_files() -> list[Path]:
    """Vehicle files to choose from."""
    return sorted(VEHICLES.glob("*.yaml"))


def first_session(logs: Sequence[Path], model: Path | None, session: Path | None) -> Session:
    """A session that goes on, or one with `logs` and `model`; where the vehicle can only be one, it is taken.

    Raises
    ------
    SettingsError
        A settings file cannot be read.
    LogError
        There is no such log. What is in a log, the page says.
    """
    if session is not None:
        return load_session(session)
    for log in logs:
        if not log.is_file():
            raise LogError(f"{log}: there is no such file, expected a flight log")
    known = vehicle_files()
    begin = model if model is not None else known[0] if len(known) == 1 else None
    begun = Session().with_logs(logs)
    return begun if begin is None else begun.begun_with(load_model(begin))
