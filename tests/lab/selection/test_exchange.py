"""An effect that was found first because it has a little of two others gives way to them."""

from pathlib import Path

import pytest

from quadctl.lab.flights.dataset import load_dataset
from quadctl.lab.selection.diagnosis import diagnose
from quadctl.logs.read import read_logs
from quadctl.model import Model, load_model
from studies.blind_cases.cases import all_cases
from studies.blind_cases.fly import fly_case
from tests.support.places import ROOT


@pytest.mark.long
def test_a_wind_with_its_drag_gives_way_to_a_drag_and_a_tilted_thrust(tmp_path: Path) -> None:
    """The wind alone explains a part of both; beside the drag it is not told from the tilt but by what that adds."""
    (case,) = (c for c in all_cases("tuning") if c.truths == ("HubForce", "BentArms") and c.strength == 1.0)
    vehicle = load_model(ROOT / "config/vehicles/raptor.yaml").vehicle
    assert case.vehicle == vehicle.name
    found = diagnose(Model(vehicle), load_dataset(read_logs(fly_case(case, tmp_path).seen), vehicle))
    assert sorted(found.missing) == ["rotor_drag", "thrust_tilt"]
    (wind,) = (c for c in found.ranking if c.effect.name == "wind.steady")
    assert wind.p_value > 0.01
