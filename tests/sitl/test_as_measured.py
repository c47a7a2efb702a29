"""The mocks behave as the real autopilots were measured: each fact, and the same missions as recorded."""

from pathlib import Path

import numpy as np
import pytest

from quadctl.errors import SettingsError
from quadctl.logs.columns import RESIDUAL_COLUMNS
from quadctl.sitl.rules.px4 import SimulatedAutopilot
from quadctl.sitl.vehicle.hidden import AutopilotTruth, HiddenTruth
from quadctl.vehicle import load_vehicle
from studies.autopilots.flights import CHANNELS, DATA, MISSIONS, Flown, mean_error, recorded, simulated
from studies.autopilots.measured import NAMES, Fact, load_measured
from studies.autopilots.probes import PROBES
from tests.support.places import ROOT

FACTS = [(name, fact) for name in NAMES for fact in load_measured(name).facts if fact.probe]


@pytest.mark.parametrize(("name", "fact"), FACTS, ids=[f"{name}: {fact.what}" for name, fact in FACTS])
def test_the_mock_obeys_each_measured_fact(name: str, fact: Fact) -> None:
    found = PROBES[fact.probe](name)
    assert fact.is_met(found), f"{fact.what}: {fact.value} {fact.unit} measured, {found} on the mock"


def test_a_parameter_that_the_mock_does_not_have_is_said() -> None:
    truth = HiddenTruth(autopilot=AutopilotTruth(parameters={"MPC_NONSENSE": 1.0}))
    with pytest.raises(
        SettingsError, match=r"truth\.yaml: autopilot\.parameters: the simulated PX4 has no MPC_NONSENSE"
    ):
        SimulatedAutopilot(load_vehicle(ROOT / "sitl/px4/vehicle.yaml"), truth, source="truth.yaml")


Flights = dict[str, tuple[Flown, Flown]]


@pytest.fixture(scope="module", params=NAMES)
def flights(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Flights:
    """By mission: the real flight and that of the mock."""
    if not DATA.is_dir():
        pytest.skip("the recordings of real autopilots are not here")
    where: Path = tmp_path_factory.mktemp("mock")
    return {m: (recorded(request.param, m), simulated(request.param, m, where)) for m in MISSIONS}


@pytest.mark.long
def test_the_log_has_the_same_columns_at_the_same_rate(flights: Flights) -> None:
    """The recordings are older than the residual of the model, which every log holds since."""
    for real, mock in flights.values():
        assert {*real.log.columns, *RESIDUAL_COLUMNS} == set(mock.log.columns)
        assert np.median(np.diff(mock.log.time_s)) == pytest.approx(np.median(np.diff(real.log.time_s)), rel=0.01)


@pytest.mark.long
def test_the_mission_is_tracked_about_as_well(flights: Flights) -> None:
    """Within 60 % or 1.5 cm along each axis; without drag and drifts the mock's error was a third of the real one."""
    for mission, (real, mock) in flights.items():
        for theirs, ours in zip(real.rmse_m, mock.rmse_m, strict=True):
            assert max(theirs, ours) < 1.6 * min(theirs, ours) + 0.015, (mission, real.rmse_m, mock.rmse_m)


@pytest.mark.long
def test_the_error_of_the_estimate_has_the_same_size_and_colour(flights: Flights) -> None:
    """Within a factor of 2.5 of the size, over all missions, and of 4 of the correlation time, where it is slow."""
    for channel in range(len(CHANNELS)):
        real = mean_error([real for real, _ in flights.values()], channel)
        mock = mean_error([mock for _, mock in flights.values()], channel)
        assert 0.4 < mock.std / real.std < 2.5, (CHANNELS[channel], real, mock)
        assert 0.25 < mock.time_s / real.time_s < 4.0, (CHANNELS[channel], real, mock)
