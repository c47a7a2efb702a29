"""Candidates in words and as JSON."""

from typing import Any

from quadctl.lab.selection.candidate import Candidate
from quadctl.lab.selection.rule import is_plausible, is_significant, is_supported


def candidate_in_words(c: Candidate) -> str:
    """The physics of a candidate's effect, what held-out data say of it, and remarks on its parameters."""
    axis = max(c.drops, key=c.drops.__getitem__)
    helps = f"It takes {c.held_out_drop:.0%} off the unseen error, {c.largest_drop:.0%} on the {axis} axis."
    verdict = (
        helps
        if is_supported(c)
        else f"{helps} These data cannot tell it from what looks like it (told by {c.effect.told_apart_by})."
        if is_plausible(c)
        else "It is within the trims of any real vehicle."
        if c.effect.negligible() and is_significant(c.p_value)
        else "The unseen data do not support it."
    )
    return " ".join([c.effect.physics, verdict, *(f"Note: {remark}." for remark in c.remarks)])


def candidate_to_dict(c: Candidate) -> dict[str, Any]:
    """An entry of `ranking` in the JSON of a diagnosis."""
    return {
        "family": c.family,
        "effect": c.effect.name,
        "parameters": c.effect.values(),
        "ci95": {name: list(ci) for name, ci in c.ci95.items()},
        "rmse_before": c.before[c.measure],
        "rmse_after": c.after[c.measure],
        "held_out_drop": c.held_out_drop,
        "p_value": c.p_value,
        "text": candidate_in_words(c),
    }
