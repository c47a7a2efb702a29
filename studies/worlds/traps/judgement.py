"""Judgement of what `quadctl diagnose` answers to a trap, by what an honest answer would be."""

from collections.abc import Callable, Iterable, Mapping, Sequence, Set
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any

from quadctl.logs.flight_log import FlightLog


class Outcome(StrEnum):
    """Judgement of an answer: fooled by a false statement; missed where it is silent about something large."""

    HONEST = "no"
    MISSED = "missed"
    FOOLED = "yes"


@dataclass(frozen=True)
class Honest:
    """Answers that are true."""

    words: str
    families: Set[str] = frozenset()
    """Families that may be named, each alone or with others of them; another one only as half of a pair with one."""
    verdicts: Set[str] = frozenset()
    """Verdicts that are true beside `missing`: `none` where the vehicle is clean, `unexplained`."""
    intervals: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    """Lowest and highest true value by `effect parameter`: the 95 % interval must hold at least one between them."""
    either: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    """True values by `effect parameter` where flights differ or two conventions are right: it must hold one of them."""
    beyond: bool = False
    """Much is missing that no family explains: to name families and not to call the rest unexplained is to miss it."""


@dataclass(frozen=True)
class Trap:
    """One flight or more, the vehicle file that the lab gets, and what it may say."""

    name: str
    vehicle: str | Mapping[str, Any]
    """Name of a file that comes with quadctl, or the content of a file of the user's own."""
    honest: Honest
    text: str
    generate: Callable[[], Sequence[FlightLog]]


def judge(honest: Honest, result: Mapping[str, Any]) -> Outcome:
    """Compare the JSON result of `quadctl diagnose` with the honest answers; a refusal says nothing of the physics, as
    `unexplained` does."""
    if result["verdict"] == "refused":
        return Outcome.HONEST if "unexplained" in honest.verdicts else Outcome.MISSED
    if result["verdict"] != "missing":
        if result["verdict"] in honest.verdicts:
            return Outcome.HONEST
        return Outcome.FOOLED if "none" in honest.verdicts else Outcome.MISSED
    pairs = [frozenset(pair) for pair in result["confounded"]]
    for family in result["missing"]:
        if family not in honest.families and not any(family in pair and pair & honest.families for pair in pairs):
            return Outcome.FOOLED
    for effect, parameter, (low, high) in intervals(result):
        lowest, highest = honest.intervals.get(f"{effect} {parameter}", (low, high))
        if high < lowest or low > highest:
            return Outcome.FOOLED
        values = honest.either.get(f"{effect} {parameter}", (low,))
        if not any(low <= value <= high for value in values):
            return Outcome.FOOLED
    return Outcome.MISSED if honest.beyond and not result["unexplained"] else Outcome.HONEST


def intervals(result: Mapping[str, Any]) -> Iterable[tuple[str, str, tuple[float, float]]]:
    """Effect, parameter and 95 % interval of every parameter of the effects that are called missing.

    The interval of a parameter that is not fitted, as the number of a rotor, is its value twice.
    """
    named = {step["effect"] for step in result["ladder"] if step["family"]}
    for entry in result["ranking"]:
        if entry["effect"] in named:
            for parameter, value in entry["parameters"].items():
                low, high = entry["ci95"].get(parameter, (value, value))
                yield entry["effect"], parameter, (low, high)


def said(result: Mapping[str, Any]) -> str:
    """Answer of the lab in words, for the page."""
    if result["verdict"] == "refused":
        return f"refused: {result['sentence']}"
    parts = [" + ".join(result["missing"]) or str(result["verdict"])]
    for effect, name, (low, high) in intervals(result):
        parts.append(f"{effect} {name} " + (f"{low:.3g}" if low == high else f"[{low:.3g}, {high:.3g}]"))
    parts += [f"cannot tell {' from '.join(sorted(pair))}" for pair in result["confounded"]]
    if result["missing"] and result["unexplained"]:
        parts.append("and something unexplained")
    if result["measured"]:
        parts.append("there but small: " + ", ".join(entry["effect"] for entry in result["measured"]))
    return "; ".join(parts)
