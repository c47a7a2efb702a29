"""A model with values of single flights, on flights that are others, or stand in another order."""

from dataclasses import replace

import pytest

from quadctl.effects.payload import MassStep
from quadctl.effects.wind import SteadyWind, WindOfEachFlight
from quadctl.lab.comparison.comparison import values_of_other_flights
from quadctl.model import Model, Provenance, StackedEffect
from quadctl.vehicle import Vehicle

DAYS = {"north_m_s": -4.0, "north_2_m_s": 0.0, "east_m_s": 0.0, "east_2_m_s": 2.5}


@pytest.mark.parametrize(
    ("flights", "told"), [(["a.csv", "b.csv"], 0), (["a.csv"], 0), (["b.csv", "a.csv"], 1), (["c.csv"], 1)]
)
def test_their_values_are_told_to_be_of_others(raptor: Vehicle, flights: list[str], told: int) -> None:
    fitted = Provenance(logs=("a.csv", "b.csv"))
    item = StackedEffect(WindOfEachFlight.from_values(DAYS, "model.yaml"), fitted)
    said = values_of_other_flights(replace(Model(raptor), stack=(item,)), flights)
    assert len(said) == told
    assert all(note.facts["effect"] == "wind.each_flight" and note.facts["flights"] == flights for note in said)
    drop = StackedEffect(MassStep(0.2, 9.0, flight=2.0), fitted)
    assert len(values_of_other_flights(replace(Model(raptor), stack=(drop,)), flights)) == told
    every = StackedEffect(MassStep(0.2, 9.0), fitted)
    assert values_of_other_flights(replace(Model(raptor), stack=(every,)), flights) == []
    common = StackedEffect(SteadyWind(-4.0, 0.0), fitted)
    assert values_of_other_flights(replace(Model(raptor), stack=(common,)), flights) == []
