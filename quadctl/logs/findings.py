"""Findings about the record of a flight: facts with their figures and times, for the code that acts on them.

A finding is a value. Its sentence is made once, at the edge, by `worded`.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from quadctl.logs.words import Kind, Span
from quadctl.words import Facts

__all__ = ["Finding", "Kind", "Span", "finding", "of_kind", "worded"]

WANDERING_S = 0.01
"""Change of a delay within a flight from which on it is told."""
_DERIVED: Mapping[Kind, Callable[[Facts], Facts]] = {
    Kind.RESET: lambda f: {"size": max((abs(by) for by in f.get("by", []) if by), default=0.0)},
    Kind.DELAY: lambda f: {"wanders": 1000.0 * f["most_s"] - 1000.0 * f["least_s"] > 1000.0 * WANDERING_S},
    Kind.WITNESSES_DISAGREE: lambda f: {
        "by": ", ".join(f"{axis} by {m_s2:.2g}" for axis, m_s2 in zip(f["axes"], f["difference_m_s2"], strict=True))
    },
}
"""Further facts that the templates of a kind need."""


@dataclass(frozen=True)
class Finding:
    """Fact about a record."""

    kind: Kind
    figures: Mapping[str, Any] = field(default_factory=dict)
    """By name; units in the names."""
    times_s: tuple[Span, ...] = ()
    """Times that it concerns; empty for the whole log."""

    def to_dict(self) -> dict[str, Any]:
        """Form in JSON."""
        return {
            "kind": self.kind.name.lower(),
            **({"times_s": [list(span) for span in self.times_s]} if self.times_s else {}),
        } | {"figures": dict(self.figures)}

    def later(self, by_s: float) -> "Finding":
        """The same on a clock that shows more by `by_s`."""
        return replace(self, times_s=tuple((begin + by_s, end + by_s) for begin, end in self.times_s))

    def touches(self, begin_s: float, end_s: float) -> bool:
        """Tell whether it concerns a stretch of time."""
        return not self.times_s or any(begin <= end_s and end >= begin_s for begin, end in self.times_s)


def finding(kind: Kind, times_s: Iterable[Span] = (), **figures: Any) -> Finding:
    """Make a finding of its figures."""
    return Finding(kind, figures, tuple(times_s))


def of_kind(findings: Iterable[Finding], *kinds: Kind) -> list[Finding]:
    """Findings of some kinds, in their order."""
    return [found for found in findings if found.kind in kinds]


def worded(found: Finding) -> str:
    """Sentence of a finding, without the log's name, a capital and a full stop."""
    derived = _DERIVED[found.kind](found.figures) if found.kind in _DERIVED else {}
    return found.kind.said({**found.figures, "spans": found.times_s, **derived})
