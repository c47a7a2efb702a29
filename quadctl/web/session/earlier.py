"""Earlier sessions: those that are kept in the folder of the page beside the present one."""

from contextlib import suppress
from dataclasses import dataclass
from datetime import datetime
from functools import lru_cache
from pathlib import Path

from quadctl.errors import QuadctlError, SettingsError
from quadctl.lab.comparison.wording import listed, plain, quantity
from quadctl.settings import read_yaml, validate
from quadctl.web.session.session import AUTOSAVED, SUFFIX, SessionFile

PREVIOUS = "previous"
"""Beginning of the names of the files that hold sessions before the present one, in the folder of the page."""
NO_EFFECT = "no effect added"
MOST = 8
"""Number of sessions that are listed, the latest first."""


@dataclass(frozen=True)
class Earlier:
    """One earlier session, with what a person knows it by."""

    path: Path
    saved: datetime
    flights: tuple[str, ...]
    """Names of its logs."""
    vehicle: str
    effects: tuple[str, ...]
    """Families of the effects in its model."""
    error_m_s2: float | None

    @property
    def title(self) -> str:
        """Its flights, or its vehicle where it has none."""
        return listed(self.flights) if self.flights else f"{self.vehicle}, without a flight"

    @property
    def details(self) -> str:
        """Time at which it was saved, its vehicle, the effects in the model and the error."""
        model = listed([plain(family) for family in self.effects]) if self.effects else NO_EFFECT
        error = "" if self.error_m_s2 is None else f", error {quantity(self.error_m_s2)}"
        return f"{self.saved:%d %B %Y, %H:%M}: {self.vehicle}, {model}{error}"


def free_name(folder: Path) -> str:
    """Name of a file in `folder` that does not exist yet, for the session before the present one: `previous.lab.yaml`,
    or with the next number."""
    name, number = f"{PREVIOUS}{SUFFIX}", 1
    while (folder / name).exists():
        number += 1
        name = f"{PREVIOUS}-{number}{SUFFIX}"
    return name


def set_aside(folder: Path) -> Path | None:
    """Keep the session of `folder` in a file of its own, as another begins; None where there is none, or none with a
    flight. One that cannot be read may be of another version of quadctl, and is kept.

    Raises
    ------
    SettingsError
        The file cannot be moved.
    """
    present = folder / AUTOSAVED
    if not present.is_file():
        return None
    with suppress(SettingsError):
        if not validate(read_yaml(present), SessionFile, str(present)).logs:
            return None
    kept = folder / free_name(folder)
    try:
        return present.replace(kept)
    except OSError as error:
        raise SettingsError(f"{present}: cannot be moved to {kept.name} ({error.strerror})") from None


def earlier_sessions(folder: Path) -> tuple[Earlier, ...]:
    """The sessions that `folder` holds, apart from the present one; what cannot be read as one is left out."""
    found = []
    for path in folder.glob(f"*{SUFFIX}"):
        try:
            changed_ns = path.stat().st_mtime_ns
        except OSError:
            continue
        if path.name != AUTOSAVED:
            found.append((changed_ns, path))
    latest = sorted(found, reverse=True)[:MOST]
    return tuple(one for changed_ns, path in latest if (one := _earlier(path, changed_ns)) is not None)


@lru_cache(maxsize=100)
def _earlier(path: Path, changed_ns: int) -> Earlier | None:
    """Content of the file as it is written: to load a model of it would run the effects of one's own that it names."""
    try:
        session = validate(read_yaml(path), SessionFile, str(path))
        model = session.rungs[session.current].model
        vehicle, effects = model["vehicle"]["name"], [entry["effect"] for entry in model["effects"]]
    except (QuadctlError, IndexError, KeyError, TypeError):
        return None
    return Earlier(
        path=path,
        saved=datetime.fromtimestamp(changed_ns / 1e9).astimezone(),
        flights=tuple(Path(log).name for log in session.logs),
        vehicle=str(vehicle),
        effects=tuple(str(effect).split(".")[0] for effect in effects),
        error_m_s2=session.rungs[session.current].error_m_s2,
    )
