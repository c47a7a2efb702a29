"""Verdict of a search beside the error of the model: what is missing, or what limits the answer that nothing is."""

from collections.abc import Collection
from dataclasses import replace
from typing import NamedTuple

from quadctl.lab.comparison.agreement import flights_of_the_fit
from quadctl.lab.comparison.wording import ERRORS
from quadctl.lab.evaluation import Evaluation
from quadctl.lab.finding import Finding, Kind
from quadctl.lab.selection.diagnosis import Diagnosis
from quadctl.lab.words import Answer, in_words
from quadctl.model import Model
from quadctl.words import Fact, fact


class Statement(NamedTuple):
    """A verdict, and what is said below it."""

    verdict: Finding
    more: list[Finding | Fact]


def statement(
    diagnosis: Diagnosis,
    model: Model | None,
    unseen: Collection[str],
    evaluation: Evaluation | None = None,
    floor_m_s2: float | None = None,
) -> Statement:
    """State what a search on `model` has found.

    `unseen` are the names of the flights held out of all fits; `floor_m_s2` is the lowest reference error that is
    known, and `evaluation` that of the model.
    """
    verdict = diagnosis.answer[0]
    if diagnosis.verdict == "missing":
        return Statement(verdict, _missing(diagnosis, unseen))
    left = None
    if evaluation is not None and floor_m_s2 is not None:
        left = replace(evaluation.remainder, floor_m_s2=floor_m_s2)
    stands = evaluation is not None and evaluation.kind == "as it stands"
    judged = None if evaluation is None else evaluation.unseen
    more: list[Finding | Fact] = []
    if stands:
        more = [fact(Answer.AS_AT_STEP)]
    elif left is not None:
        more = [left.said(() if judged is None else judged.dataset.names)]
    small = left is not None and left.is_near_the_floor
    if diagnosis.verdict == "unexplained":
        return Statement(Finding(Kind.LITTLE_UNEXPLAINED) if small else verdict, [*more, fact(Answer.NO_FORM)])
    if diagnosis.verdict == "small":
        return Statement(verdict, [*(found for found in diagnosis.answer if found.kind is Kind.SMALL), *more])
    flights = diagnosis.dataset.names
    used, new = ([], []) if model is None else flights_of_the_fit(model, flights)
    known = sorted(set(unseen) & set(used))
    more.insert(0, fact(Answer.NONE_HELPS))
    if known:
        return Statement(Finding(Kind.NONE_BUT_FITTED_TO_HELD_OUT, {"flights": known}), more)
    if used and (stands or new):
        return Statement(Finding(Kind.NONE_BUT_FITTED_TO_OTHERS, {"flights": used}), more)
    if stands:
        return Statement(Finding(Kind.NONE_BUT_NOT_FITTED), more)
    if small:
        return Statement(Finding(Kind.NOTHING_SIGNIFICANT), more)
    if left is not None and judged is not None:
        return Statement(Finding(Kind.NONE_BUT_LARGER_HELD_OUT, {"flights": list(flights)}), more)
    return Statement(Finding(Kind.NONE_BUT_MORE_THAN_NOISE), more)


def _missing(diagnosis: Diagnosis, unseen: Collection[str]) -> list[Finding | Fact]:
    """Findings below the verdict on what is missing."""
    more: list[Finding | Fact] = [found for found in diagnosis.answer if found.kind is Kind.ERROR]
    if unseen:
        more = [fact(Answer.FOR_FITTING, finding=in_words(found)) for found in more]
    more += [
        fact(Answer.OTHER_ERROR, family=c.family, drop=c.held_out_drop, error=ERRORS[c.measure])
        for c in diagnosis.chosen
        if c.measure != "total"
    ]
    return [*more, *(found for found in diagnosis.answer if found.kind is Kind.PART_UNEXPLAINED)]
