"""Motor outputs of real ArduPilot logs are the thrust that was commanded, and the rigid body explains the flight."""

import numpy as np
import pytest

from quadctl.lab.comparison.comparison import compare
from quadctl.lab.flights.channels import signals_of
from quadctl.lab.study import prepare_flights
from quadctl.logs.read import read_log
from quadctl.model import load_model
from tests.support.places import DATA

REAL = DATA / "real" / "ardupilot"
pytestmark = pytest.mark.skipif(not REAL.is_dir(), reason="the recordings of a real ArduPilot are not here")

FLIGHTS = {
    "vertical_runs": "vehicle",
    "forward_runs": "vehicle",
    "excitation": "vehicle",
    "hexa_staircase": "hexa_vehicle",
}


@pytest.mark.parametrize(("name", "vehicle"), FLIGHTS.items())
def test_outputs_are_the_command_of_our_own_log_of_the_same_flight(name: str, vehicle: str) -> None:
    """The firmware corrects for the ground below a metre: compared above, level, where neither boost nor that acts."""
    theirs, ours = read_log(REAL / f"{name}.bin"), read_log(REAL / f"{name}.csv")
    n = 6 if vehicle == "hexa_vehicle" else 4
    outputs = np.mean([theirs[f"motor{i}_output"] for i in range(1, n + 1)], axis=0)
    high = (theirs["z_m"] > 1.0) & (np.hypot(theirs["roll_deg"], theirs["pitch_deg"]) < 3.0)
    flown = (
        (ours["z_m"] > 1.0) & (np.hypot(ours["roll_deg"], ours["pitch_deg"]) < 3.0) & np.isfinite(ours["throttle_cmd"])
    )
    assert np.nanmedian(outputs[high]) == pytest.approx(np.nanmedian(ours["throttle_cmd"][flown]), rel=0.006)


@pytest.mark.parametrize(("name", "vehicle"), FLIGHTS.items())
def test_the_vertical_error_is_no_longer_that_of_the_compensations(name: str, vehicle: str) -> None:
    """1.1 to 1.2 m/s^2 with the curve alone removed. The climbs of vertical_runs keep their drag."""
    model = load_model(REAL / f"{vehicle}.yaml")
    flights = prepare_flights([REAL / f"{name}.bin"], model.vehicle, "blocks")
    assert signals_of(read_log(REAL / f"{name}.bin"), model.vehicle, []).thrust_source == "motor output"
    assert compare(model, flights).rmse["up"] < (0.25 if name == "vertical_runs" else 0.07)


def test_a_staircase_toward_the_ground_shows_no_false_ground_effect() -> None:
    """The firmware divides its outputs near the ground, by 1.117 at 0.1 m; the world has no ground effect."""
    model = load_model(REAL / "vehicle.yaml")
    flights = prepare_flights([REAL / "hover_staircase.bin"], model.vehicle, "blocks")
    result = compare(model, flights)
    assert result.rmse["up"] < 0.03
    assert not [found for found in result.fails_where if found.variable == "height_over_radius" and found.axis == "up"]
