"""Parameters of which each flight may have a value of its own, as the moment of a drop or the wind of the day."""

import re
from collections.abc import Collection, Mapping
from dataclasses import fields, make_dataclass
from functools import cache
from typing import Any, ClassVar, Self, cast

from quadctl.effects.base import Effect, parameter


class PerFlight(Effect):
    """Base of effects with parameters that may differ from flight to flight.

    Beside `time_s` there may be `time_2_s`, which takes its place in flight number 2. `with_own_values` makes the class
    that has these parameters; so does `from_values`, from those that are named.
    """

    per_flight: ClassVar[tuple[str, ...]]
    """Names of the parameters that may differ; a unit follows the first word of each."""
    numbers: ClassVar[tuple[int, ...]] = ()
    """Numbers of the flights that have values of their own."""

    @classmethod
    def from_values(cls, values: Mapping[str, Any], source: str) -> Self:
        parts = [name.partition("_")[::2] for name in cls.per_flight]
        own = [re.compile(rf"{word}_([1-9]\d*)_{unit}") for word, unit in parts]
        numbers = {int(found[1]) for name in values for pattern in own if (found := pattern.fullmatch(name))}
        # Every class that `with_own_values` makes is a subclass of this one, and has the inherited method.
        return cast(Self, super(PerFlight, with_own_values(cls.plain(), numbers)).from_values(values, source))

    @classmethod
    def plain(cls) -> "type[PerFlight]":
        """The class without values of single flights."""
        return cast("type[PerFlight]", cls.__bases__[0]) if cls.numbers else cls

    def of_flight(self, name: str, flight: float) -> float:
        """Value of a parameter in the flight with this number."""
        value: float = getattr(self, own_name(name, int(flight)) if flight in self.numbers else name)
        return value

    def common_values(self) -> dict[str, float]:
        """Values without those of single flights."""
        return {field.name: getattr(self, field.name) for field in fields(self.plain())}

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickled by its numbers: a class with values of flights is in no module."""
        return _restored, (self.plain(), self.numbers, self.values())


def own_name(name: str, flight: int) -> str:
    """Name of the parameter that takes the place of `name` in the flight with this number: `time_2_s` for `time_s`."""
    word, _, unit = name.partition("_")
    return f"{word}_{flight}_{unit}"


def with_own_values(kind: type[PerFlight], numbers: Collection[int]) -> type[PerFlight]:
    """`kind` with values of its own for each of these flights."""
    return _made((kind, tuple(sorted(numbers)))) if numbers else kind


@cache
def _made(of: tuple[type[PerFlight], tuple[int, ...]]) -> type[PerFlight]:
    kind, numbers = of
    declared = {p.name: p for p in kind.parameters()}
    own = [
        (
            own_name(name, number),
            float,
            parameter(p.default, p.low, p.high, p.unit, f"{name} of flight {number} instead", fitted=p.fitted),
        )
        for number in numbers
        for name in kind.per_flight
        for p in (declared[name],)
    ]
    essential = [own_name(name, number) for number in numbers for name in kind.per_flight if name in kind.essential]
    namespace = {"numbers": numbers, "essential": (*kind.essential, *essential)}
    return make_dataclass(kind.__name__, own, bases=(kind,), frozen=True, namespace=namespace)


def _restored(kind: type[PerFlight], numbers: tuple[int, ...], values: dict[str, float]) -> PerFlight:
    return with_own_values(kind, numbers)(**values)
