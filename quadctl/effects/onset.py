"""Onset: the moment of a flight from which an effect acts, and the moments at which a fit looks for it."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import make_dataclass
from functools import cache
from typing import Any, ClassVar, Self, cast

import numpy as np
from numpy.typing import NDArray

from quadctl.effects.base import Conditions, Effect, parameter
from quadctl.numeric import Number, step

OWN_TIME = re.compile(r"time_([1-9]\d*)_s")

MARGIN_S = 5.0
COARSE_S, FINE_S = 4.0, 0.5
"""Distance of the moments that a fit may start from: first all over the flights, then about the best of them. A step
explains little less of another one that is a few seconds off."""


class Sudden(Effect):
    """Base of effects that begin at one moment: `time_s` of the log of flight number `flight`, or of every one (0).

    Where it is every one, each may have a moment of its own, as a load that is dropped once in each flight: with
    `time_2_s` that of the second flight takes the place of `time_s`. `at_own_times` makes the class that has these
    parameters.
    """

    numbers: ClassVar[tuple[int, ...]] = ()
    """Numbers of the flights that have a moment of their own."""

    @classmethod
    def from_values(cls, values: Mapping[str, Any], source: str) -> Self:
        own = sorted(int(found[1]) for name in values if (found := OWN_TIME.fullmatch(name)))
        # Every class that `at_own_times` makes is a subclass of this one, and has the inherited method.
        return cast(Self, super(Sudden, at_own_times(cls._plain(), tuple(own))).from_values(values, source))

    def begun(self, c: Conditions) -> Number:
        """1 from the moment on, else 0."""
        values = self.values()
        return since(values.get(f"time_{c.flight}_s", values["time_s"]), values["flight"], c)

    def closer(self, flights: Sequence[Conditions]) -> Sequence[Effect]:
        """The same at moments near its own; where flights have their own, at each moment near that in one flight."""
        values = self.values()
        if not self.numbers:
            return [self._at(time_s, values["flight"]) for time_s in onsets_near(*self._moment, flights)]
        return [
            self._at(time_s, number)
            for number in self.numbers
            for time_s in onsets_near(values[f"time_{number}_s"], number, flights)
        ]

    @classmethod
    def joined(cls, explained: Mapping[Effect, float]) -> Sequence[Effect]:
        """The best of the guesses for each single flight, joined: all flights, each at a moment of its own."""
        best: dict[float, dict[float, Sudden]] = {}
        for guess in sorted(explained, key=explained.__getitem__):
            if isinstance(guess, Sudden) and not guess.numbers:
                best.setdefault(guess.values().get("rotor", 0.0), {})[guess._moment[1]] = guess
        return [_joined(alone) for alone in best.values() if len([n for n in alone if n > 0.0]) > 1]

    @property
    def _moment(self) -> tuple[float, float]:
        values = self.values()
        return values["time_s"], values["flight"]

    def _at(self, time_s: float, flight: float) -> Effect:
        """The same effect at one moment only."""
        values = {name: value for name, value in self.values().items() if not OWN_TIME.fullmatch(name)}
        kind = self._plain()
        return kind(**(values | {"time_s": time_s, "flight": float(flight)}))

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickled by its numbers: a class with moments of flights is in no module."""
        return _restored, (self._plain(), self.numbers, self.values())

    @classmethod
    def _plain(cls) -> "type[Sudden]":
        """The class without moments of single flights."""
        return cast("type[Sudden]", cls.__bases__[0]) if cls.numbers else cls


def _joined(alone: Mapping[float, Sudden]) -> Effect:
    """One effect that begins in each flight at the moment at which it does in `alone`."""
    times = {int(number): guess.values()["time_s"] for number, guess in sorted(alone.items()) if number > 0.0}
    first = next(guess for number, guess in sorted(alone.items()) if number > 0.0)
    own = {f"time_{number}_s": time_s for number, time_s in times.items()}
    every = {"time_s": min(times.values()), "flight": 0.0}
    return at_own_times(type(first), tuple(times))(**(first.values() | every | own))


def at_own_times(kind: type[Sudden], numbers: tuple[int, ...]) -> type[Sudden]:
    """`kind` with a moment of its own for each of these flights."""
    return _made((kind, numbers)) if numbers else kind


@cache
def _made(of: tuple[type[Sudden], tuple[int, ...]]) -> type[Sudden]:
    kind, numbers = of
    fields = [
        (f"time_{n}_s", float, parameter(0.0, 0.0, 1e6, "s", f"time_s of flight {n} instead", fitted=False))
        for n in numbers
    ]
    return make_dataclass(kind.__name__, fields, bases=(kind,), frozen=True, namespace={"numbers": numbers})


def _restored(kind: type[Sudden], numbers: tuple[int, ...], values: dict[str, float]) -> Sudden:
    return at_own_times(kind, numbers)(**values)


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
