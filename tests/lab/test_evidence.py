"""Evidence for an effect: all numbers are of one fit, that of all effects together."""

from dataclasses import replace

import numpy as np
import pytest

from quadctl.effects.ground_effect import Exponential
from quadctl.effects.thrust_scale import ConstantScale
from quadctl.errors import SettingsError
from quadctl.lab.evidence import evidence_for
from quadctl.lab.fitting.fitted_model import FittedModel, fit_model
from quadctl.lab.flights.dataset import load_dataset
from quadctl.model import Model
from quadctl.vehicle import Vehicle
from tests.support.flights import obedient


@pytest.fixture(scope="module")
def fit(raptor: Vehicle) -> FittedModel:
    truth = Model(raptor).plus(ConstantScale(1.1)).plus(Exponential(a=0.3, b=5.0))
    return fit_model(truth, load_dataset([obedient(truth, 40.0, noise_m_s=0.01)], raptor))


class TestEvidence:
    @pytest.mark.parametrize("place", [0, 1])
    def test_the_errors_are_those_of_the_fit_with_all_effects_and_of_a_refit_without_this_one(
        self, fit: FittedModel, place: int
    ) -> None:
        name = fit.model.effects[place].name
        found = evidence_for(name, fit)
        stack = tuple(item for item in fit.model.stack if item.effect.name != name)
        assert found.after == fit.held_out_rmse
        assert found.before == fit_model(replace(fit.model, stack=stack), fit.dataset).held_out_rmse
        assert found.beside == (fit.model.effects[1 - place].family(),)
        assert found.effect == fit.model.effects[place]
        low, high = found.drop_ci95
        assert low < 1.0 - found.after["total"] / found.before["total"] < high

    def test_the_curve_is_apart_from_the_other_effects_and_from_the_bias(self, fit: FittedModel) -> None:
        (curve,) = evidence_for("ground_effect.exponential", fit).curves
        assert np.abs(curve.after.mean()) < 0.02  # a thrust scale of 1.1 would be 1 m/s²
        assert np.corrcoef(curve.binned_before.mean, curve.fitted.mean)[0, 1] > 0.99

    def test_an_effect_that_the_model_does_not_hold_has_none(self, fit: FittedModel) -> None:
        with pytest.raises(SettingsError, match="holds no effect"):
            evidence_for("inflow.axial", fit)
