"""The interval of the attitude's lag holds the true one, in flights of worlds whose answer is known."""

from pathlib import Path

import pytest
import yaml

import quadctl.sitl.run
from quadctl.flight.preflight.preparation import prepare_flight
from quadctl.lab.tracking.attitude_response import attitude_response
from quadctl.logs.read import read_log
from tests.support.places import ROOT

SEEDS = 20


def assert_intervals_of_twenty_noisy_flights_hold_the_true_lag(
    tmp_path: Path, frequency: float, delay_s: float
) -> None:
    """In 95 % of the cases and more; and they are no wider than a row of the log."""
    hidden = tmp_path / "hidden.yaml"
    answer = {"frequency_rad_s": frequency, "damping": 1.0, "delay_s": delay_s}
    noise = {"attitude_deg": 0.1, "attitude_drift_deg": [0.2, 0.2, 0.5]}
    world = {"autopilot": {"attitude": answer}, "telemetry": {"delay_s": 0.0}, "noise": noise}
    hidden.write_text(yaml.safe_dump(world))
    plan = prepare_flight(ROOT / "missions/excitation.yaml", ROOT / "config/flight.yaml", "none", None)
    lag_s, held, widths_s = delay_s + 2.0 / frequency, 0, []
    for seed in range(SEEDS):
        found = attitude_response([read_log(quadctl.sitl.run.simulate(plan, tmp_path, hidden, seed).log)])
        assert found is not None
        for axis in (found.roll, found.pitch):
            assert axis.lag_interval_s is not None
            low_s, high_s = axis.lag_interval_s
            held += low_s <= lag_s <= high_s
            widths_s.append(high_s - low_s)
    assert held >= 0.95 * 2 * SEEDS, held
    assert max(widths_s) < 0.025


# A class each, so that two processes can share them.
@pytest.mark.long
class TestLateAnswer:
    def test_intervals_hold_the_true_lag(self, tmp_path: Path) -> None:
        assert_intervals_of_twenty_noisy_flights_hold_the_true_lag(tmp_path, frequency=10.0, delay_s=0.05)


@pytest.mark.long
class TestAnswerWithoutDelay:
    def test_intervals_hold_the_true_lag(self, tmp_path: Path) -> None:
        assert_intervals_of_twenty_noisy_flights_hold_the_true_lag(tmp_path, frequency=12.0, delay_s=0.0)
