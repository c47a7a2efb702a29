"""The study of the decision rule moves every threshold, and remembers what another setting has computed."""

import pytest

from quadctl.effects.ground_effect import Exponential
from quadctl.effects.thrust_scale import ConstantScale
from quadctl.lab.fitting.fitted_model import fit_model
from quadctl.lab.flights.dataset import load_dataset
from quadctl.lab.selection import rule
from quadctl.lab.selection.diagnosis import diagnose_fit
from quadctl.model import Model
from quadctl.vehicle import Vehicle
from studies.decision_rule import MOVED, remembered
from tests.support.flights import obedient


def test_every_threshold_of_the_rule_is_moved_to_both_sides() -> None:
    thresholds = {
        name: value for name, value in vars(rule).items() if name.isupper() and isinstance(value, int | float)
    }
    thresholds.pop("LEAST_ERROR")  # only keeps a denominator from 0
    assert thresholds.keys() == MOVED.keys()
    for name, value in thresholds.items():
        assert min(MOVED[name]) < value < max(MOVED[name]), name


def test_where_no_effect_may_be_replaced_a_look_alike_replaces_nothing(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(rule, "REPLACED", 0)
    assert not rule.is_replaceable([])


def test_what_is_remembered_leads_to_the_same_verdict(raptor: Vehicle) -> None:
    truth = Model(raptor).plus(Exponential(a=0.3, b=6.0))
    fit = fit_model(Model(raptor), load_dataset([obedient(truth, 40.0, noise_m_s=0.01)], raptor))
    expected = diagnose_fit(fit, [ConstantScale, Exponential])
    with remembered():
        again = [diagnose_fit(fit, [ConstantScale, Exponential]) for _ in range(2)]
    assert [found.missing for found in again] == [expected.missing] * 2
