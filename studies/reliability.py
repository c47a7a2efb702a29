"""Reliability of the names that the lab gives: of those with a p-value, how many are of effects that are there."""

from collections.abc import Container, Iterable, Mapping, Sequence
from dataclasses import dataclass

from quadctl.lab.selection.diagnosis import Diagnosis
from studies.page import share, table

CLASSES = (("below 1e-8", 0.0, 1e-8), ("1e-8 to 1e-4", 1e-8, 1e-4), ("1e-4 to 0.01", 1e-4, 0.01))
"""Ranges of the p-value: the label, and from which value to below which."""


@dataclass(frozen=True)
class Named:
    """A family that a diagnosis calls missing, and whether it is there."""

    family: str
    p_value: float
    is_there: bool


def names_in(
    diagnosis: Diagnosis, there: Container[str], indistinguishable: Iterable[frozenset[str]] = ()
) -> tuple[Named, ...]:
    """Families that a diagnosis calls missing, compared with those that are `there`.

    A family counts as there, too, where a pair of `indistinguishable` ones holds it and one that is there.
    """
    alike = {family for pair in indistinguishable if any(f in there for f in pair) for family in pair}
    p_values = {c.family: c.p_value for c in reversed(diagnosis.ranking)}
    return tuple(Named(f, p_values[f], f in there or f in alike) for f in diagnosis.missing)


def reliability(groups: Mapping[str, Sequence[Named]]) -> str:
    """Table of the share of names that are there, for each class of p-values and each group of flights."""
    rows = [
        (label, *(share([n.is_there for n in named if low <= n.p_value < high]) for named in groups.values()))
        for label, low, high in CLASSES
    ]
    every = ("all", *(share([n.is_there for n in named]) for named in groups.values()))
    return table(("p-value of a name", *groups), [*rows, every])
