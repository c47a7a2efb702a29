"""Onset: the moment of a flight from which an effect acts, and the moments at which a fit looks for it."""

from collections.abc import Mapping, Sequence
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from quadctl.effects.base import Conditions, Effect
from quadctl.effects.per_flight import PerFlight, own_name, with_own_values
from quadctl.numeric import Number, step

MARGIN_S = 5.0
COARSE_S, FINE_S = 4.0, 0.5
"""Distance of the moments that a fit may start from: first all over the flights, then about the best of them. A step
explains little less of another one that is a few seconds off."""


class Sudden(PerFlight):
    """Base of effects that begin at one moment: `time_s` of the log of flight number `flight`, or of every one (0).

    Where it is every one, each may have a moment of its own, as a load that is dropped once in each flight.
    """

    per_flight: ClassVar[tuple[str, ...]] = ("time_s",)

    def begun(self, c: Conditions) -> Number:
        """1 from the moment on, else 0."""
        return since(self.of_flight("time_s", c.flight), self.values()["flight"], c)

    def closer(self, flights: Sequence[Conditions]) -> Sequence[Effect]:
        """The same at moments near its own; where flights have their own, at each moment near that in one flight."""
        values = self.values()
        if not self.numbers:
            return [self._at(time_s, values["flight"]) for time_s in onsets_near(*self._moment, flights)]
        return [
            self._at(time_s, number)
            for number in self.numbers
            for time_s in onsets_near(self.of_flight("time_s", number), number, flights)
        ]

    @classmethod
    def joined(cls, explained: Mapping[Effect, float]) -> Sequence[Effect]:
        """The best of the guesses for each single flight, joined: all flights, each at a moment of its own."""
        best: dict[float, dict[float, Sudden]] = {}
        for guess in sorted(explained, key=explained.__getitem__):
            if isinstance(guess, Sudden) and not guess.numbers:
                best.setdefault(guess.values().get("rotor", 0.0), {})[guess._moment[1]] = guess
        return [_joined(alone) for alone in best.values() if len([n for n in alone if n > 0.0]) > 1]

    def moments_of(self, flight: float) -> list[float]:
        """Times of the log at which it begins in the flight with this number; none where it does not."""
        if self.numbers:
            return [self.of_flight("time_s", flight)] if flight in self.numbers else []
        time_s, number = self._moment
        return [time_s] if number in (0.0, flight) or flight == 0.0 else []

    @property
    def _moment(self) -> tuple[float, float]:
        values = self.values()
        return values["time_s"], values["flight"]

    def _at(self, time_s: float, flight: float) -> Effect:
        """The same effect at one moment only."""
        return self.plain()(**(self.common_values() | {"time_s": time_s, "flight": float(flight)}))


def _joined(alone: Mapping[float, Sudden]) -> Effect:
    """One effect that begins in each flight at the moment at which it does in `alone`."""
    times = {int(number): guess.values()["time_s"] for number, guess in sorted(alone.items()) if number > 0.0}
    first = next(guess for number, guess in sorted(alone.items()) if number > 0.0)
    own = {own_name("time_s", number): time_s for number, time_s in times.items()}
    every = {"time_s": min(times.values()), "flight": 0.0}
    return with_own_values(type(first), tuple(times))(**(first.values() | every | own))


def since(time_s: float, flight: float, c: Conditions) -> Number:
    """1 from `time_s` of the log on, else 0, in the flight with this number; 0 in the others. Flight 0 is every one."""
    return step(c.time_s - time_s) if flight in (0.0, c.flight) else 0.0


def onsets(flights: Sequence[Conditions]) -> list[tuple[float, float]]:
    """Moments all over the flights: time of the log, s, and number of the flight. None is near the ends of a flight,
    where an effect would look like one that lasts, or like none; nor in a gap of the data."""
    return [(float(t), float(c.flight)) for c in flights for t in _searched(c)[:: _samples(COARSE_S, c)]]


def onsets_near(time_s: float, flight: float, flights: Sequence[Conditions]) -> list[float]:
    """Times of the log, s, about one of `onsets`, in the flights with its number."""
    found: list[float] = []
    for c in flights:
        if c.flight == flight:
            times, every, reach = _searched(c), _samples(FINE_S, c), _samples(COARSE_S, c)
            middle = int(np.searchsorted(times, time_s))
            near = np.arange(middle - reach + every, middle + reach, every)
            found += [float(t) for t in times[near[(near >= 0) & (near < len(times))]] if t != time_s]
    return found


def _searched(c: Conditions) -> NDArray[np.float64]:
    """Moments of one flight, s, that are looked at: those of its data, but for the ends."""
    times = np.asarray(c.time_s)
    margin = _samples(MARGIN_S, c)
    return times[margin : len(times) - margin - 1]


def _samples(seconds: float, c: Conditions) -> int:
    """Number of moments of the data within some seconds, at least 1."""
    return max(1, round(seconds / float(np.median(np.diff(c.time_s)))))
