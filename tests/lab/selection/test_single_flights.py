"""Specification of several flights as one question: where single flights differ, that is a finding."""

import pytest

from quadctl.effects.thrust_scale import ConstantScale
from quadctl.lab.finding import Kind
from quadctl.lab.flights.dataset import load_dataset
from quadctl.lab.selection.diagnosis import Diagnosis, diagnose
from quadctl.model import Model
from quadctl.vehicle import Vehicle
from tests.support.flights import obedient


def diagnosed(raptor: Vehicle, *factors: float) -> Diagnosis:
    """Diagnosis of flights of which each has its own thrust scale."""
    truths = [Model(raptor).plus(ConstantScale(factor)) for factor in factors]
    logs = [obedient(m, 40.0, noise_m_s=0.01, seed=i, name=f"flight_{i}.csv") for i, m in enumerate(truths)]
    return diagnose(Model(raptor), load_dataset(logs, raptor), [ConstantScale])


@pytest.mark.parametrize("factors", [(0.9, 0.9, 0.905), (0.9,)])
def test_flights_that_agree_say_nothing(raptor: Vehicle, factors: tuple[float, ...]) -> None:
    found = diagnosed(raptor, *factors)
    assert found.missing == ["thrust_scale"]
    assert found.apart == []


def test_a_flight_of_another_thrust_is_told_with_the_value_of_each(raptor: Vehicle) -> None:
    found = diagnosed(raptor, 0.9, 0.8, 0.9)
    (apart,) = (f for f in found.answer if f.kind is Kind.FLIGHTS_DIFFER)
    assert (apart.facts["effect"], apart.facts["parameter"]) == ("thrust_scale.constant", "factor")
    values = [entry["value"] for entry in apart.facts["flights"].values()]
    assert values == pytest.approx([0.9, 0.8, 0.9], abs=0.005)
    assert apart.facts["p"] < 1e-4
