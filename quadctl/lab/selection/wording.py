"""Candidates in words and as JSON."""

from collections.abc import Sequence
from typing import Any

from quadctl.lab.finding import Finding, Kind
from quadctl.lab.selection.candidate import Candidate
from quadctl.lab.selection.rule import (
    RULE,
    is_harmful,
    is_plausible,
    is_significant,
    is_supported,
    is_there,
    is_trim,
    is_usual,
    shows_in_moments,
)
from quadctl.lab.words import Answer
from quadctl.words import fact

UNITS = {"total": "m/s^2", "turning": "N m", "sensing": "m/s^2"}
"""Unit of the error of each measured group."""
NO_GAIN = 0.005
"""Relative drop of the error that rounds to 0 %."""
SMALL_ERROR = 0.0095
"""Error below which three decimals hide a change."""


def unit_of(group: str) -> str:
    """Unit of a measured group, as it is printed: `m/s²`."""
    return UNITS[group].replace("^2", "²")


def candidate_in_words(c: Candidate) -> str:
    """Sentences on a candidate: the physics of its effect, its held-out improvement, and remarks on its parameters."""
    weak = Answer.NO_LARGER if is_trim(c) else Answer.NOT_SUPPORTED
    improvement = fact(
        Answer.SUPPORTED if is_supported(c) else Answer.NOT_SEPARATE if is_plausible(c) else weak,
        drop=c.held_out_drop,
        axis=c.axis,
        largest_drop=c.largest_drop,
        distinguished_by=c.effect.distinguished_by,
    )
    return " ".join(map(str, [c.effect.physics, improvement, *(fact(Answer.NOTE, remark=r) for r in c.remarks)]))


def rival_of(candidate: Candidate, winners: Sequence[Candidate]) -> Candidate | None:
    """The winner that a candidate lost against: another form of its own effect, else the first; None without any."""
    return next((c for c in winners if c.family == candidate.family), winners[0] if winners else None)


def reason_against(c: Candidate, chosen: Candidate | None) -> Finding:
    """Reason why the decision rule has not called `c` missing beside, or instead of, `chosen`: the first predicate of
    the rule that fails, with the number that was found and the one that was expected.

    `chosen` is None where nothing was called missing.
    """
    if not c.fitted:
        is_form = chosen is not None and chosen.family == c.family
        return Finding(Kind.NOT_FITTED, {"chosen": chosen.effect.name} if chosen is not None and is_form else {})
    if c.held_out_drop <= 0.0 or (c.held_out_drop < NO_GAIN and not is_significant(c.p_value)):
        return Finding(Kind.NO_DROP)
    if not is_significant(c.p_value):
        return Finding(Kind.NOT_SIGNIFICANT, {"p": c.p_value, "limit": RULE.significant})
    essential = list(c.effect.essential)
    if not c.determined and essential:
        return Finding(Kind.ZERO, {"parameters": essential})
    for fails, kind in (
        (not c.determined, Kind.UNDETERMINED),
        (c.at_bound, Kind.AT_BOUND),
        (not c.believable, Kind.IMPLAUSIBLE),
        (is_harmful(c), Kind.HARMFUL),
        (not shows_in_moments(c), Kind.NOT_IN_MOMENTS),
        (is_usual(c), Kind.AS_USUAL),
        (c.implied, Kind.IMPLIED),
    ):
        if fails:
            return Finding(kind)
    if is_there(c) and not is_plausible(c):
        found = {"share": c.largest_drop, "explained": c.explained_m_s2}
        return Finding(
            Kind.TOO_SMALL,
            {**found, "least_share": RULE.material, "least": RULE.least_m_s2, "enough": RULE.material_m_s2},
        )
    if not c.distinct:
        return Finding(Kind.NOT_DISTINCT, {"distinguished_by": c.effect.distinguished_by})
    if chosen is None:
        return Finding(Kind.SMALLER_THAN_SMALL)
    beside = {"chosen": chosen.effect.name, "drop": c.held_out_drop, "chosen_drop": chosen.held_out_drop}
    return Finding(Kind.OTHER_FORM if c.family == chosen.family else Kind.NOT_NEEDED, beside)


def p_in_table(p_value: float) -> str:
    return "< 1e-4" if p_value < 1e-4 else f"{p_value:.2g}"


def error_in_table(error: float) -> str:
    """Format an RMSE with three decimals; a small one with two digits."""
    return f"{error:.3f}" if error >= SMALL_ERROR else f"{error:.2g}"


def candidate_to_dict(c: Candidate) -> dict[str, Any]:
    """An entry of `ranking` in the JSON of a diagnosis."""
    return measured_to_dict(c) | {
        "rmse_before": c.before[c.measure],
        "rmse_after": c.after[c.measure],
        "unit": UNITS[c.measure],
        "held_out_drop": c.held_out_drop,
        "p_value": c.p_value,
        "text": candidate_in_words(c),
    }


def measured_to_dict(c: Candidate) -> dict[str, Any]:
    """An entry of `measured` in the JSON of a diagnosis."""
    return {
        "family": c.family,
        "effect": c.effect.name,
        "parameters": c.effect.values(),
        "ci95": {name: list(ci) for name, ci in c.ci95.items()},
    }
