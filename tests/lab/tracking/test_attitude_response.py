"""The attitude's answer to its setpoint is found in a log."""

import numpy as np
import pytest

from quadctl.lab.tracking.attitude_response import attitude_response
from quadctl.logs.flight_log import FlightLog, Floats

TIME_S = np.arange(0.0, 60.0, 0.02)


def flown(frequency: float, damping: float, delay_s: float, setpoint: Floats, age_s: float = 0.0) -> FlightLog:
    """A log in which both angles follow the setpoint, held for a tick, by integration in steps of 1 ms."""
    angle, rate, at = 2.0, 0.0, []
    for k in range(round(TIME_S[-1] / 0.001) + 21):
        at.append(angle)
        told = setpoint[max(0, min(int((k * 0.001 - delay_s) / 0.02 + 1e-9), len(setpoint) - 1))]
        rate += 0.001 * (frequency**2 * (told + 2.0 - angle) - 2.0 * damping * frequency * rate)
        angle += 0.001 * rate
    seen = np.interp(TIME_S - age_s, 0.001 * np.arange(len(at)), at)
    same = {"roll_deg": seen, "pitch_deg": seen, "roll_cmd_deg": setpoint, "pitch_cmd_deg": setpoint}
    z = np.where(TIME_S < 1.0, 0.0, 1.2)
    return FlightLog("made.csv", None, {"time_s": TIME_S, "z_m": z, "telemetry_age_s": age_s + 0.0 * z, **same})


def waves(seed: int = 4) -> Floats:
    rng = np.random.default_rng(seed)
    rates = rng.uniform(0.5, 8.0, 8)
    return np.sum(
        [2.0 * np.sin(rate * TIME_S + phase) for rate, phase in zip(rates, rng.uniform(0, 6, 8), strict=True)], axis=0
    )


@pytest.mark.parametrize(("frequency", "damping", "delay_s"), [(12.0, 1.0, 0.0), (10.0, 0.8, 0.05), (18.0, 1.1, 0.03)])
def test_lag_and_its_interval_hold_the_truth(frequency: float, damping: float, delay_s: float) -> None:
    found = attitude_response([flown(frequency, damping, delay_s, waves())])
    assert found is not None
    lag_s = delay_s + 2.0 * damping / frequency
    assert found.lag_s == pytest.approx(lag_s, abs=0.006)
    assert found.roll.lag_interval_s is not None
    low_s, high_s = found.roll.lag_interval_s
    assert low_s - 0.006 < lag_s < high_s + 0.006


def test_the_age_of_the_telemetry_is_not_a_lag_of_the_attitude() -> None:
    found = attitude_response([flown(12.0, 1.0, 0.0, waves(), age_s=0.04)])
    assert found is not None
    assert found.lag_s == pytest.approx(0.167, abs=0.006)


def test_a_flight_that_never_leans_shows_no_lag() -> None:
    assert attitude_response([flown(12.0, 1.0, 0.0, 0.02 * waves())]) is None
