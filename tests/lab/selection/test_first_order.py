"""Specification of the first-order search: what is expected of a subset, and which subsets are worth a fit."""

import dataclasses

import numpy as np
import pytest

from quadctl.effects import CATALOG, Effect
from quadctl.effects.ground_effect import Exponential
from quadctl.effects.payload import MassStep
from quadctl.effects.rotor_drag import LinearDrag
from quadctl.effects.tether import HangingTether
from quadctl.effects.thrust_scale import ConstantScale
from quadctl.effects.thrust_tilt import FixedTilt
from quadctl.lab.fitting.fitted_model import fit_model
from quadctl.lab.flights.dataset import Dataset, load_dataset
from quadctl.lab.selection.first_order import FirstOrder
from quadctl.lab.selection.rule import RULE, score
from quadctl.lab.selection.search import HOPELESS
from quadctl.model import Model
from quadctl.vehicle import Vehicle
from tests.lab.fitting.test_fitter import NOISE_M_S, SCALE_AND_GROUND, data_of, seen, shaken, stacked
from tests.support.flights import obedient, to_and_fro

__all__ = ["seen"]
PAIR = frozenset({ConstantScale, Exponential})


def about(model: Model, dataset: Dataset, *pool: type[Effect]) -> FirstOrder:
    return FirstOrder(fit_model(model, dataset), pool, RULE)


@pytest.mark.parametrize("subset", [frozenset(), {ConstantScale}, PAIR])
def test_the_expected_score_is_about_that_of_a_fit(
    raptor: Vehicle, seen: Dataset, subset: frozenset[type[Effect]]
) -> None:
    fitted = fit_model(stacked(raptor, *(kind() for kind in subset)), seen)
    expected = about(Model(raptor), seen, ConstantScale, Exponential).score(frozenset(subset))
    assert expected == pytest.approx(score(fitted.held_out_residual), abs=0.1)


def test_the_true_subset_is_the_first_that_is_worth_a_fit(raptor: Vehicle, seen: Dataset) -> None:
    pool = (ConstantScale, HangingTether, LinearDrag, MassStep, Exponential)
    first_order = about(Model(raptor), seen, *pool)
    _, first = first_order.promising()[0]
    assert first == PAIR and first_order.all_help(first)
    assert not first_order.all_help(PAIR | {HangingTether})


def test_an_effect_of_the_wrong_sign_is_expected_to_explain_nothing(raptor: Vehicle) -> None:
    """A vehicle that leans as if the air pushed it along, the faster it flies."""
    log = to_and_fro(obedient(Model(raptor), 60.0, noise_m_s=NOISE_M_S), 2.0)
    lean = np.degrees(np.arctan(0.3 * log["vx_m_s"] / 9.81))

    def explained(sign: float) -> float:
        leant = {**log.columns, "pitch_deg": log["pitch_deg"] + sign * lean}
        flown = load_dataset([shaken(dataclasses.replace(log, columns=leant))], raptor)
        first_order = about(Model(raptor), flown, LinearDrag)
        return first_order.score(frozenset()) - first_order.score(frozenset({LinearDrag}))

    assert min(map(explained, (-1.0, 1.0))) < 0.01
    assert max(map(explained, (-1.0, 1.0))) > 0.2


class TestOfOne:
    """p-value of one effect, by which it is fitted on top of what was found, or not."""

    @pytest.mark.parametrize("truth", [ConstantScale(0.93), Exponential(a=0.3, b=6.0), MassStep(0.2, 31.0)])
    def test_the_true_effect_is_fitted(self, raptor: Vehicle, truth: Effect) -> None:
        assert about(Model(raptor), data_of(stacked(raptor, truth)), type(truth)).p_value(type(truth)) < 1e-3

    def test_what_the_model_holds_is_not(self, raptor: Vehicle, seen: Dataset) -> None:
        model = stacked(raptor, *SCALE_AND_GROUND)
        assert about(model, seen, ConstantScale).p_value(ConstantScale) > HOPELESS

    def test_most_others_are_not_beside_the_true_effects(self, raptor: Vehicle, seen: Dataset) -> None:
        others = [k for k in CATALOG.values() if k.applies_to(raptor) and k not in PAIR]
        others = [kind for kind in others if kind.family() not in {own.family() for own in PAIR}]
        beside = about(stacked(raptor, *SCALE_AND_GROUND), seen, *others)
        assert sum(beside.p_value(kind) > HOPELESS for kind in others) > len(others) // 2

    def test_a_tilt_beyond_the_trims_is_fitted(self, raptor: Vehicle) -> None:
        """Trims take the most of it, up to their bound: what they leave tells of it."""
        log = shaken(obedient(Model(raptor), 60.0, noise_m_s=NOISE_M_S))
        leant = dataclasses.replace(log, columns={**log.columns, "pitch_deg": log["pitch_deg"] + 2.5})
        assert about(Model(raptor), load_dataset([leant], raptor), FixedTilt).p_value(FixedTilt) < 1e-3
