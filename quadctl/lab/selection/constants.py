"""Effects of a variable beside the constant that is left of them where the variable hardly changes.

A thrust that falls with the voltage is, over a short flight, a thrust that is too low. Where these data do not show
that the variable acts, beside a free constant, the constant is the finding; where they show both, both are named.
"""

from collections.abc import Sequence
from dataclasses import replace

from quadctl.effects import Effect
from quadctl.lab.fitting.fitted_model import FittedModel
from quadctl.lab.fitting.initial_guesses import Unmodelled
from quadctl.lab.selection.candidate import Candidate
from quadctl.lab.selection.rule import is_plausible, score
from quadctl.lab.selection.search import Path, taken
from quadctl.lab.selection.trial import fit_on_top, try_effect


def with_constants_told(path: Path, pool: Sequence[type[Effect]]) -> Path:
    """Path in which a constant stands for what the data do not show to vary; where they do not tell how much of a
    constant varies, the pair is confounded."""
    kinds = {kind.name: kind for kind in pool}
    for family in dict.fromkeys(kind.family() for kind in pool if kind.if_constant in kinds):
        alone = [c for c in path.at_start.values() if c.family == family]
        (constant,) = {kinds[type(c.effect).if_constant] for c in alone}
        found = {constant.family(), family} & set(path.missing)
        if found == {family}:
            path = _with_constant(path, family, constant)
        elif found == {constant.family()}:
            path = _with_doubt(path, constant, min(alone, key=lambda c: score(c.residual, path.rule)))
    return path


def _with_constant(path: Path, family: str, constant: type[Effect]) -> Path:
    """Path with `constant` in the place of a family, where beside it the data do not show that one; or with both, where
    they show both."""
    joint, _ = fit_on_top(constant, Unmodelled(path.current))
    shown = joint.determined(_place(joint, family))
    if shown and not _is_shown_beside(joint):
        return path
    other = path.restarted()
    for found in (c for c in path.chosen if c.family in path.missing):
        both = [constant, type(found.effect)] if shown else [constant]
        for kind in both if found.family == family else [type(found.effect)]:
            tried = _tried(other, kind)
            if kind is constant and not is_plausible(tried, path.rule):
                return path
            other = taken(other, tried)
    if shown:
        return replace(other, confounded=path.confounded, implied=path.implied)
    kept = [pair for pair in path.confounded if family not in pair]
    return replace(other, confounded=(*kept, (constant.family(), family)), implied=path.implied)


def _is_shown_beside(joint: FittedModel) -> bool:
    """Tell whether the last effect of a fit is more than the others imply, anywhere in its interval."""
    effect, others = joint.model.effects[-1], joint.model.effects[:-1]
    intervals = joint.ci95(len(others)).items()
    defaults = {p.name: p.default for p in effect.parameters()}
    least = type(effect)(**(effect.values() | {n: min(max(defaults[n], low), high) for n, (low, high) in intervals}))
    return not least.implied_by(others, [f.conditions for f in joint.flights], joint.model.vehicle)


def _with_doubt(path: Path, constant: type[Effect], alone: Candidate) -> Path:
    """Path with the pair confounded, where the data allow beside the constant what the other effect must be `alone`, in
    its place."""
    pair = constant.family(), alone.family
    if pair in path.confounded:
        return path
    joint, _ = fit_on_top(type(alone.effect), Unmodelled(path.current))
    ci95 = joint.ci95(_place(joint, alone.family))
    values = {name: getattr(alone.effect, name) for name in alone.effect.essential}
    allowed = all(ci95[name][0] <= value <= ci95[name][1] for name, value in values.items())
    return replace(path, confounded=(*path.confounded, pair)) if allowed else path


def _tried(path: Path, kind: type[Effect]) -> Candidate:
    """Trial of an effect on top of a path's current model."""
    if path.current is path.start and kind.name in path.at_start:
        return path.at_start[kind.name]
    return try_effect(kind, Unmodelled(path.current), len(path.latest), path.rule)


def _place(fit: FittedModel, family: str) -> int:
    return [effect.family() for effect in fit.model.effects].index(family)
