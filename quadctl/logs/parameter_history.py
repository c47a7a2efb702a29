"""Parameters of an autopilot over the time of a log: each part of a log is converted with those that held then."""

import bisect
import itertools
import math
from collections.abc import Iterable, Iterator, Mapping
from typing import NamedTuple

from quadctl.logs.findings import Finding, Kind, finding


class Change(NamedTuple):
    """Change of a parameter."""

    time_s: float
    """On the log's clock."""
    name: str
    before: float
    after: float


class Period(NamedTuple):
    """Time in which some parameters stay as they are."""

    begin_s: float
    end_s: float
    values: Mapping[str, float]


class ParameterHistory:
    """Values of parameters by time; the first value of each that a log says holds from its begin."""

    def __init__(
        self, entries: Iterable[tuple[float, str, float]] = (), initial: Mapping[str, float] | None = None
    ) -> None:
        """
        Parameters
        ----------
        entries
            Time, s, name and value, whenever the log says one.
        initial
            Values from before the log.
        """
        self._values: dict[str, list[tuple[float, float]]] = {
            name: [(-math.inf, float(value))] for name, value in (initial or {}).items()
        }
        for time_s, name, value in sorted(entries, key=lambda entry: entry[0]):
            own = self._values.setdefault(name, [])
            if not own:
                own.append((-math.inf, float(value)))
            elif own[-1][1] != value:
                own.append((float(time_s), float(value)))

    @property
    def last(self) -> dict[str, float]:
        """Last value of each."""
        return {name: own[-1][1] for name, own in self._values.items()}

    def at(self, time_s: float) -> dict[str, float]:
        """Value of each at a time."""
        return {name: own[bisect.bisect_right(own, (time_s, math.inf)) - 1][1] for name, own in self._values.items()}

    def changes(self, names: Iterable[str] | None = None) -> list[Change]:
        """Changes of some parameters, or of all, in the order of time."""
        chosen = self._values if names is None else [name for name in names if name in self._values]
        found = [
            Change(time_s, name, before, after)
            for name in chosen
            for (_, before), (time_s, after) in itertools.pairwise(self._values[name])
        ]
        return sorted(found)

    def periods(self, names: Iterable[str]) -> Iterator[Period]:
        """Periods between the changes of some parameters, with the values of all that are known."""
        edges = [-math.inf, *sorted({change.time_s for change in self.changes(names)}), math.inf]
        for begin_s, end_s in itertools.pairwise(edges):
            yield Period(begin_s, end_s, self.at(begin_s))


def change_findings(history: ParameterHistory, names: Iterable[str]) -> list[Finding]:
    """Findings on changes of parameters on which the meaning of a log's channels depends."""
    return [
        finding(
            Kind.PARAMETER_CHANGED,
            [(change.time_s, change.time_s)],
            name=change.name,
            before=change.before,
            after=change.after,
        )
        for change in history.changes(names)
    ]
