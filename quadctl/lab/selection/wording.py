"""Candidates in words and as JSON."""

from typing import Any

from quadctl.lab.selection.candidate import Candidate
from quadctl.lab.selection.rule import is_plausible, is_supported, is_trim

UNITS = {"total": "m/s^2", "turning": "N m", "sensing": "m/s^2"}
"""Unit of the error of each measured group."""
SMALL_ERROR = 0.0095
"""Error below which three decimals hide a change."""


def candidate_in_words(c: Candidate) -> str:
    """Sentences on a candidate: the physics of its effect, its held-out improvement, and remarks on its parameters."""
    axis = max(c.drops, key=c.drops.__getitem__)
    helps = f"It lowers the held-out error by {c.held_out_drop:.0%}, on the {axis} axis by {c.largest_drop:.0%}."
    verdict = (
        helps
        if is_supported(c)
        else f"{helps} These data do not separate it from look-alikes (distinguished by {c.effect.distinguished_by})."
        if is_plausible(c)
        else "It is no larger than the trim errors of any real vehicle."
        if is_trim(c)
        else "The held-out data do not support it."
    )
    return " ".join([c.effect.physics, verdict, *(f"Note: {remark}." for remark in c.remarks)])


def p_in_table(p_value: float) -> str:
    return "< 1e-4" if p_value < 1e-4 else f"{p_value:.2g}"


def error_in_table(error: float) -> str:
    """Format an RMSE with three decimals; a small one with two digits."""
    return f"{error:.3f}" if error >= SMALL_ERROR else f"{error:.2g}"


def candidate_to_dict(c: Candidate) -> dict[str, Any]:
    """An entry of `ranking` in the JSON of a diagnosis."""
    return {
        "family": c.family,
        "effect": c.effect.name,
        "parameters": c.effect.values(),
        "ci95": {name: list(ci) for name, ci in c.ci95.items()},
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
