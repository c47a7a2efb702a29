"""The session that the page begins with, from the arguments of the command."""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

from quadctl.errors import LogError, SettingsError
from quadctl.flight.pilot.settings import DEFAULT_CONFIG, load_flight_settings
from quadctl.installed import locate
from quadctl.logs.formats import format_of_folder
from quadctl.logs.read import read_log, require_file
from quadctl.model import load_model, model_to_dict
from quadctl.web.session.files import LOG_SUFFIXES, SETTINGS_SUFFIXES, UPLOADS, changed_logs, places_of
from quadctl.web.session.session import AUTOSAVED, Session, load_session

VEHICLES = Path("config/vehicles")


def vehicle_files() -> list[Path]:
    """Vehicle files to choose from: those here, else those installed with quadctl."""
    return sorted(locate(VEHICLES).glob("*.yaml"))


def own_vehicle() -> Path | None:
    """Vehicle file of the vehicle that the user flies, by config/flight.yaml; else the only one; else None."""
    config = locate(DEFAULT_CONFIG)
    with suppress(SettingsError):  # whoever flies is told; here a vehicle can be chosen
        named = config.parent / load_flight_settings(config).vehicle
        if named.is_file():
            return named
    known = vehicle_files()
    return known[0] if len(known) == 1 else None


def check_folders(out: Path, missions: Path) -> None:
    """Check that neither `out` nor `missions` is a file; they need not exist.

    Raises
    ------
    SettingsError
        One of them is a file.
    """
    for option, folder in (("--out", out), ("--missions", missions)):
        if folder.exists() and not folder.is_dir():
            raise SettingsError(f"{option}: {folder} is a file, expected a folder")


def first_session(logs: Sequence[Path], model: Path | None, session: Path | None) -> Session:
    """Load `session`, or begin one with `logs` and `model`, or without a model with the user's own vehicle.

    Raises
    ------
    SettingsError
        A settings file cannot be read.
    LogError
        A log does not exist, or neither its name nor its content is that of a log.
    """
    if session is not None:
        return _loaded(session)
    for log in logs:
        if log.is_dir():
            if format_of_folder(log) is None:
                raise LogError(f"{log}: is a directory, expected the flight logs in it, {log}/*.csv for example")
            continue
        if not log.exists():
            raise LogError(f"{log}: there is no such file, expected a flight log")
        require_file(log)
        if log.suffix.lower() in SETTINGS_SUFFIXES:
            raise LogError(f"{log}: is settings by its name, expected a flight log, or --model {log.name} or --session")
        if log.suffix.lower() not in LOG_SUFFIXES:
            read_log(log)  # probably none: then it is better said now than on the page
    begin = model if model is not None else own_vehicle()
    begun = Session().with_logs(logs)
    if begin is None:
        return begun
    return replace(begun.begun_with(load_model(begin)), vehicle_assumed=model is None)


def kept_session(folder: Path, begun: Session, model_given: bool) -> Session | None:
    """Session that the page kept in `folder`, if it goes on with what was begun: the same logs and more, unchanged.

    Where a model was given, its sequence must begin with that one. None where it is about something else, or cannot be
    read: then another begins.
    """
    try:
        kept = _loaded(folder / AUTOSAVED)
    except SettingsError:
        return None
    if not kept.logs or not kept.sequence or not {log.resolve() for log in begun.logs} <= set(kept.logs):
        return None
    if model_given and model_to_dict(kept.sequence[0].model, None) != model_to_dict(begun.sequence[0].model, None):
        return None
    if changed_logs(kept.hashes):
        return None
    return replace(kept, vehicle_assumed=kept.vehicle_assumed and not model_given)


def _loaded(path: Path) -> Session:
    """Session in a file, with its logs where they are now: where it says, or beside it.

    Raises
    ------
    SettingsError
        It cannot be read.
    """
    loaded = load_session(path)
    return loaded.moved(places_of(loaded.logs, [path.parent, path.parent / UPLOADS]))
