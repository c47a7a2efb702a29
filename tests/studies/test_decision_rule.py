"""The study of the decision rule moves every threshold, and remembers what another setting has computed."""

from dataclasses import asdict

from quadctl.effects.ground_effect import Exponential
from quadctl.effects.thrust_scale import ConstantScale
from quadctl.lab.fitting.fitted_model import fit_model
from quadctl.lab.flights.dataset import load_dataset
from quadctl.lab.selection.diagnosis import diagnose_fit
from quadctl.lab.selection.rule import RULE
from quadctl.model import Model
from quadctl.vehicle import Vehicle
from studies.decision_rule import MOVED, moved_rule, remembered
from tests.support.flights import obedient


def test_every_threshold_of_the_rule_is_moved_to_both_sides() -> None:
    thresholds = asdict(RULE)
    assert thresholds.keys() == MOVED.keys()
    assert len(thresholds) <= 12
    for name, values in MOVED.items():
        assert min(values) < thresholds[name] < max(values), name


def test_a_rule_that_is_passed_decides(raptor: Vehicle) -> None:
    truth = Model(raptor).plus(Exponential(a=0.3, b=6.0))
    fit = fit_model(Model(raptor), load_dataset([obedient(truth, 40.0, noise_m_s=0.01)], raptor))
    assert diagnose_fit(fit, [Exponential]).missing == ["ground_effect"]
    assert diagnose_fit(fit, [Exponential], rule=moved_rule("significant", 0.0)).missing == []


def test_what_is_remembered_leads_to_the_same_verdict(raptor: Vehicle) -> None:
    truth = Model(raptor).plus(Exponential(a=0.3, b=6.0))
    fit = fit_model(Model(raptor), load_dataset([obedient(truth, 40.0, noise_m_s=0.01)], raptor))
    expected = diagnose_fit(fit, [ConstantScale, Exponential])
    with remembered():
        again = [diagnose_fit(fit, [ConstantScale, Exponential]) for _ in range(2)]
    assert [found.missing for found in again] == [expected.missing] * 2
