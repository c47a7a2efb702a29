"""`quadctl fit` of a bare vehicle file finds the attitude's lag, which needs no effect."""

from collections.abc import Callable
from pathlib import Path

import pytest

from quadctl.flight.preflight.preparation import prepare_flight
from quadctl.model import load_model
from quadctl.sitl.run import simulate
from tests.support.commands import Result
from tests.support.places import ROOT


def test_the_lag_of_a_bare_vehicle_is_found_and_the_effects_are_left_to_discover(
    quadctl: Callable[..., Result], tmp_path: Path
) -> None:
    plan = prepare_flight(ROOT / "missions" / "excitation.yaml", ROOT / "config" / "flight.yaml", "none", None)
    log = simulate(plan, tmp_path, None, seed=3).log
    vehicle, output = str(ROOT / "config" / "vehicles" / "raptor.yaml"), tmp_path / "lag.yaml"
    fitted = quadctl("fit", vehicle, log, "-o", str(output))
    assert fitted.status == 0
    assert "holds no effect to fit: quadctl discover finds them." in fitted.out
    response = load_model(output).vehicle.attitude_response
    assert response is not None
    assert response.lag_s == pytest.approx(0.16, abs=0.03)
    assert f"The attitude follows its setpoint {response.lag_s:.2f} s later, which {output} holds" in fitted.out
    again = tmp_path / "again.yaml"
    refused = quadctl("fit", vehicle, log, "-o", str(again), "--unseen", log)
    assert refused.status == 2 and "holds no effect to fit" in refused.err and not again.exists()
