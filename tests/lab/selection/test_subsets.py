"""Specification of subsets: what is left of one that does not hold, and the number tried that a p-value counts."""

from collections.abc import Collection, Mapping
from types import SimpleNamespace
from typing import Any

import pytest

from quadctl.effects import Effect
from quadctl.effects.battery_sag import PowerSag
from quadctl.effects.ground_effect import Exponential
from quadctl.effects.imu_bias import ConstantBias
from quadctl.effects.rotor_drag import LinearDrag
from quadctl.effects.thrust_scale import ConstantScale
from quadctl.effects.wind import SteadyWind, WindOfEachFlight
from quadctl.lab.fitting.fitted_model import fit_model
from quadctl.lab.flights.dataset import Dataset
from quadctl.lab.selection import subsets as module
from quadctl.lab.selection.rule import RULE
from quadctl.lab.selection.search import _simplest
from quadctl.lab.selection.subsets import Subset, Subsets
from quadctl.model import Model
from quadctl.vehicle import Vehicle
from tests.lab.fitting.test_fitter import seen

__all__ = ["seen"]
NONE: Subset = frozenset()
SCALE_AND_BIAS: Subset = frozenset({ConstantScale, ConstantBias})
SCALE_AND_SAG: Subset = frozenset({ConstantScale, PowerSag})


class Stubbed(Subsets):
    """Subsets whose effects hold where the effects that they need are beside them, and that are not `implied`."""

    def __init__(
        self, needs: Mapping[type[Effect], Collection[type[Effect]]], implied: Collection[type[Effect]]
    ) -> None:
        self.pool, self.stand_ins, self._with_implied = [ConstantScale, ConstantBias, PowerSag], set(), {}
        self.needs, self.implied = needs, implied

    def fit(self, subset: Subset) -> Any:
        return SimpleNamespace(held_out_residual=subset)

    def score(self, subset: Subset) -> float:
        return -float(len(subset))

    def beside(self, subset: Subset, kind: type[Effect]) -> Any:
        return kind

    def _is_only_implied(self, c: Any) -> bool:
        return c in self.implied

    def _passes(self, subset: Subset, kind: type[Effect], test: object) -> bool:
        return kind not in self.implied and set(self.needs.get(kind, ())) <= subset


def test_an_effect_that_is_implied_is_no_part_of_a_subset_but_of_its_residual() -> None:
    subsets = Stubbed({}, implied=[ConstantBias])
    assert subsets.pruned(SCALE_AND_BIAS) == {ConstantScale}
    assert subsets.residual(frozenset({ConstantScale})) == SCALE_AND_BIAS


def test_it_is_gone_with_what_implies_it() -> None:
    subsets = Stubbed({ConstantScale: [ConstantBias]}, implied=[ConstantBias])
    assert subsets.pruned(SCALE_AND_BIAS) == NONE
    assert subsets.residual(NONE) == NONE


def test_effects_that_hide_each_other_are_kept_beside_each_other() -> None:
    subsets = Stubbed({ConstantScale: [PowerSag], PowerSag: [ConstantScale]}, implied=[])
    assert subsets.pruned(SCALE_AND_SAG) == SCALE_AND_SAG
    assert subsets.pruned(frozenset({ConstantScale})) == NONE


class Doubted(Stubbed):
    """Subsets of which the drag is plausible only beside the scale, in whose place it stands without it."""

    def __init__(self, passing: Collection[tuple[Subset, type[Effect]]]) -> None:
        super().__init__({}, [])
        self.rule, self.passing = RULE, passing

    def beside(self, subset: Subset, kind: type[Effect]) -> Any:
        return subset, kind

    def _passes(self, subset: Subset, kind: type[Effect], test: object = None) -> bool:
        return Subsets._passes(self, subset, kind, lambda c, rule: c in self.passing)

    def _doubtful(self, subset: Subset) -> Subset:
        return subset - {ConstantScale} if ConstantScale not in subset else NONE


@pytest.mark.parametrize("alone", [True, False])
def test_an_effect_whose_rival_is_implausible_without_it_is_judged_without_that(alone: bool) -> None:
    both: Subset = frozenset({ConstantScale, LinearDrag})
    passing = {(both, LinearDrag), *([(frozenset({ConstantScale}), ConstantScale)] if alone else [])}
    subsets = Doubted(passing)
    assert subsets._passes(both, ConstantScale) is alone
    assert subsets._passes(both, LinearDrag)


class Ranked(Stubbed):
    """Subsets with their scores, of which all or none are told apart, and one of whose effects shows two parameters."""

    def __init__(self, scores: Mapping[Subset, float], alike: bool) -> None:
        super().__init__({}, [])
        self.rule, self.scores, self.all_alike = RULE, scores, alike

    def score(self, subset: Subset) -> float:
        return self.scores[subset]

    def rank(self, subset: Subset) -> float:
        return self.scores[subset]

    def alike(self, one: Subset, other: Subset) -> bool:
        return self.all_alike

    def n_seen(self, subset: Subset) -> int:
        return len(subset) + (LinearDrag in subset)


SCALE, SAG, DRAG, BIAS = (frozenset({kind}) for kind in (ConstantScale, PowerSag, LinearDrag, ConstantBias))


@pytest.mark.parametrize(
    ("scores", "alike", "chosen"),
    [
        ({NONE: 0.0, DRAG: -0.50, SCALE: -0.2}, False, DRAG),
        ({NONE: 0.0, DRAG: -0.500, BIAS: -0.495}, True, BIAS),
        ({NONE: 0.0, DRAG: -0.500, BIAS: -0.480}, True, DRAG),
        ({NONE: 0.0, DRAG | SCALE: -0.50, BIAS: -0.30}, True, BIAS),
        ({NONE: 0.0, DRAG | SCALE: -0.50, SCALE: -0.50}, True, DRAG | SCALE),
        ({NONE: 0.0, SAG: -0.50, SCALE: -0.20}, True, SCALE),
        ({NONE: 0.0, SAG: -0.50, SCALE: -0.20}, False, SAG),
    ],
    ids=[
        "told apart",
        "as good, fewer parameters",
        "better by more than equal",
        "fewer effects",
        "part of another",
        "the constant of what varies",
        "what varies, and shows it",
    ],
)
def test_the_simplest_is_chosen_of_those_that_are_not_told_apart(
    scores: dict[Subset, float], alike: bool, chosen: Subset
) -> None:
    assert _simplest(Ranked(scores, alike), list(scores)) == chosen


@pytest.mark.parametrize(("common", "gives_way"), [(-0.495, True), (-0.48, False)])
def test_values_of_each_flight_give_way_to_common_ones_that_do_as_well(common: float, gives_way: bool) -> None:
    own: Subset = frozenset({WindOfEachFlight})
    subsets = Ranked({own: -0.5, frozenset({SteadyWind}): common}, alike=True)
    subsets.pool = [SteadyWind, WindOfEachFlight]
    assert subsets._differs_needlessly(own, WindOfEachFlight) is gives_way
    assert not subsets._differs_needlessly(frozenset({SteadyWind}), SteadyWind)


def test_the_number_tried_does_not_depend_on_what_was_fitted_before(
    raptor: Vehicle, seen: Dataset, monkeypatch: pytest.MonkeyPatch
) -> None:
    start = fit_model(Model(raptor), seen)
    monkeypatch.setattr(module, "Unmodelled", lambda fit: SimpleNamespace(forms=None, alone=fit is start))
    monkeypatch.setattr(module, "fit_on_top", lambda kind, left: (object(), 5 if left.alone else 1000))
    monkeypatch.setattr(module, "judged", lambda fit, family, left, forms, n_tried, rule: n_tried)

    def tried(*before: type[Effect]) -> object:
        subsets = Subsets(start, [LinearDrag, ConstantScale, Exponential], RULE)
        subsets.fit(frozenset(before))
        return subsets.beside(frozenset({Exponential}), Exponential)

    assert tried() == tried(LinearDrag, Exponential) == 3 * 5
