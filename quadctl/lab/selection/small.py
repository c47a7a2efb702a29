"""Small effects: those that the data show beyond doubt beside what is missing, and that are too small to be missing.

Several effects may each stand for the same small cause. So the one that explains most is taken, and the others are
tried again beside it, until nothing is measured any more. What is as small as on any vehicle is taken, too, as another
effect may stand for it, but is not called small.
"""

from collections.abc import Container, Sequence

from quadctl.lab.fitting.fitted_model import FittedModel
from quadctl.lab.fitting.initial_guesses import Unmodelled
from quadctl.lab.selection.candidate import Candidate
from quadctl.lab.selection.rule import are_alike, is_as_good, is_measured, is_supported, is_usual, score
from quadctl.lab.selection.search import Selection
from quadctl.lab.selection.trial import try_effect


def measured_of(ranking: Sequence[Candidate], missing: Container[str]) -> list[Candidate]:
    """Candidates that the data show, but that are too small to be called missing; the best of each family.

    An effect of variables on which an effect that was found depends is none of them: it may be the error of the form of
    that effect. Nor is one of which bounds hold every parameter: what is fitted is that it is not there.
    """
    found: dict[str, Candidate] = {}
    explained = {name for c in ranking if c.family in missing for name in c.effect.depends_on}
    for c in sorted(ranking, key=lambda c: c.p_value):
        of_a_form = c.effect.depends_on and set(c.effect.depends_on) <= explained
        at_bounds = [getattr(c.effect, name) in ci for name, ci in c.ci95.items()] or [False]
        if not (c.family in missing or of_a_form or all(at_bounds)) and is_measured(c) and not is_supported(c):
            found.setdefault(c.family, c)
    return list(found.values())


def small_beside(selection: Selection, measured: Sequence[Candidate]) -> list[list[Candidate]]:
    """Groups of small effects in the order of adding, each on top of those before it: one effect, then those from which
    the data do not tell it."""
    groups: list[list[Candidate]] = []
    found = _tried(selection, selection.current, measured, 0)
    while found:
        best = found[0]
        alike = [
            c for c in found if c is best or are_alike(best.residual, c.residual, selection.dataset, selection.rule)
        ]
        as_good = [c for c in alike if is_as_good(c.residual, best.residual, selection.dataset, selection.rule)]
        chosen = min(as_good, key=lambda c: c.n_seen)
        rest = [c for c in found if c is not chosen]
        found = _tried(selection, chosen.fit(selection.dataset), rest, len(groups) + 1)
        still = {c.family for c in found}
        if not is_usual(chosen, selection.rule):
            groups.append([chosen, *(c for c in alike if c is not chosen and c.family not in still)])
    return groups


def _tried(
    selection: Selection, beside: FittedModel, candidates: Sequence[Candidate], n_before: int
) -> list[Candidate]:
    """Candidates that are measured on top of a fitted model, and not implied by it; the best first."""
    if not candidates:
        return []
    left, n_tried = Unmodelled(beside), len(selection.latest) * (len(selection.missing) + 1 + n_before)
    again = [try_effect(type(c.effect), left, n_tried, selection.rule) for c in candidates]
    return sorted(
        (c for c in again if is_measured(c, selection.rule) and not c.implied),
        key=lambda c: score(c.residual, selection.rule),
    )
