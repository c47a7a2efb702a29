"""Words of facts: the formatter of templates that all tables of words share.

A table maps each kind of fact to a template such as `"the tilt is {tilt_deg:.0f} deg"`; it stands at the edge of its
room, and nothing but the table makes sentences of the facts.
"""

import difflib
import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from enum import Enum
from string import Formatter
from typing import Any, NamedTuple, TypeAlias

Facts: TypeAlias = Mapping[str, Any]
"""Facts by name, units in the names."""
NO_FACTS: Facts = {}
Format: TypeAlias = "Callable[[Any], str] | Mapping[Any, str]"
"""Words of one value: a function, or all values with their words."""
Template: TypeAlias = "str | By | When | tuple[Template, ...]"
"""Text with fields in braces, a choice between such texts, or several in a row."""


@dataclass(frozen=True)
class By:
    """Template that the value of a fact chooses."""

    fact: str
    templates: Mapping[Any, Template]
    otherwise: Template = ""
    """Template for all other values, and where the fact is absent."""


@dataclass(frozen=True)
class When:
    """Template where a fact is there and is neither zero nor empty."""

    fact: str
    then: Template
    otherwise: Template = ""


class Words(Formatter):
    """Formatter whose fields may name a format of the table, as in `{share:percent}`, or count: `{rows:count row}`."""

    def __init__(self, formats: Mapping[str, Format] | None = None) -> None:
        self._formats: Mapping[str, Format] = {"list": _list, "and": _and} | dict(formats or {})

    def say(self, template: Template, facts: Facts) -> str:
        """Fill a template with facts."""
        if isinstance(template, str):
            return self.vformat(template, (), facts)
        if isinstance(template, By):
            return self.say(template.templates.get(facts.get(template.fact), template.otherwise), facts)
        if isinstance(template, When):
            return self.say(template.then if facts.get(template.fact) else template.otherwise, facts)
        return "".join(self.say(part, facts) for part in template)

    def format_field(self, value: Any, format_spec: str) -> str:
        if format_spec.startswith("count "):
            return count(value, format_spec.removeprefix("count "))
        found = self._formats.get(format_spec)
        if found is None:
            return str(super().format_field(value, format_spec))
        return found[value] if isinstance(found, Mapping) else found(value)


_WORDS: dict[type[Enum], Words] = {}
"""Words by the kinds that have formats of their own."""


class Kinds(Enum):
    """Base of the kinds of facts of one room, each with the template of its words; `words` has formats of the room."""

    def __init_subclass__(cls, words: Words | None = None) -> None:
        _WORDS[cls] = words or Words()

    def said(self, facts: Facts) -> str:
        """Words of a fact of this kind."""
        return _WORDS[type(self)].say(self.value, facts)


class Fact(NamedTuple):
    """A fact of one kind, with its figures and names; `str` words it."""

    kind: Kinds
    facts: Facts = NO_FACTS

    def __str__(self) -> str:
        return self.kind.said(self.facts)

    def to_dict(self) -> dict[str, Any]:
        """Form in JSON."""
        return {"kind": self.kind.name.lower(), "figures": plain(self.facts)}


def fact(kind: Kinds, /, **facts: Any) -> Fact:
    """Make a fact of its figures and names."""
    return Fact(kind, facts)


def plain(value: Any) -> Any:
    """Value as JSON can hold it: null for a number that is not finite, words for what is none of its types."""
    if isinstance(value, Fact):
        return value.to_dict()
    if isinstance(value, Mapping):
        return {str(name): plain(part) for name, part in value.items()}
    if isinstance(value, list | tuple):
        return [plain(part) for part in value]
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return value if value is None or isinstance(value, bool | int | str) else str(value)


def _list(values: Iterable[Any]) -> str:
    return ", ".join(map(str, values))


def _and(values: Iterable[Any]) -> str:
    return " and ".join(map(str, values))


def count(n: int, what: str) -> str:
    """Number of things: `1 row`, `2 rows`."""
    return f"{n} {what}{'s' if n != 1 else ''}"


def nearest(word: str, known: Iterable[str]) -> str:
    """ " (did you mean 'x'?)", or nothing when no known word is near."""
    matches = difflib.get_close_matches(word, list(known), n=1, cutoff=0.5)
    return f" (did you mean '{matches[0]}'?)" if matches else ""


NEARLY_ZERO = 1e-6
"""Largest size of a number that stands for 0, which a solver has not quite reached."""


def estimate(value: float, ci95: tuple[float, float]) -> tuple[str, str]:
    """An estimate and its 95 % interval, `0.114` and `[0.100, 0.121]`, both to the decimal of the second digit of half
    the interval, as more would be noise, and with four digits at most; but an end that is not 0 is not shown as 0.

    That of a parameter at a bound has one end, `(at its bound; at most 0.120)`.
    """
    low, high = ci95
    first_digits = [_decimals(abs(end)) - 1 for end in ci95 if abs(end) > NEARLY_ZERO]
    decimals = max([_decimals(0.5 * (high - low)), *first_digits])

    def shown(x: float) -> str:
        return _with_decimals(x, decimals)

    if low < high and value in ci95:
        end = f"at most {shown(high)}" if value == low else f"at least {shown(low)}"
        return shown(value), f"(at its bound; {end})"
    return shown(value), f"[{shown(low)}, {shown(high)}]"


def _decimals(size: float) -> int:
    """Decimals with which a number of this size has two digits; many for 0, or what is no number."""
    # A difference such as 0.12 - 0.10 is a rounding below 0.02.
    return 1 - math.floor(math.log10(size) + 1e-9) if 0.0 < size < math.inf else 9


def _with_decimals(x: float, decimals: int) -> str:
    """Format with so many decimals, negative ones before the point, but with four significant digits at most."""
    most = 3 - math.floor(math.log10(abs(x))) if x and math.isfinite(x) else 0
    decimals = min(decimals, most)
    is_usual = 1e-4 <= abs(x) < 1e4
    return f"{round(x, decimals) + 0.0:.{decimals}f}" if is_usual and decimals > 0 else f"{round(x, decimals):.4g}"
