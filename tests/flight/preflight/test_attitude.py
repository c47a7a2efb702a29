"""The attitude's lag before a flight: configured, shown by a log, and by what has changed since."""

import asyncio
from collections.abc import Iterable
from dataclasses import replace

import pytest

from quadctl.effects.rotor_drag import LinearDrag
from quadctl.flight.autopilot.ardupilot import ARDUPILOT
from quadctl.flight.autopilot.firmware import Firmware
from quadctl.flight.autopilot.px4 import PX4
from quadctl.flight.preflight.attitude import LastFlight, ask_about_attitude, check_look_ahead, compare_with_log
from quadctl.flight.preflight.facts import Kind
from quadctl.flight.preflight.findings import Finding, Verdict
from quadctl.flight.preflight.plan import FlightPlan, read_flight
from quadctl.vehicle import AttitudeResponse, AxisResponse
from quadctl.words import fact
from tests.support.places import ROOT


def response(lag_s: float, half_s: float | None = 0.02) -> AttitudeResponse:
    interval_s = None if half_s is None else (lag_s - half_s, lag_s + half_s)
    axis = AxisResponse(frequency_rad_s=2.0 / lag_s, lag_interval_s=interval_s)
    return AttitudeResponse(roll=axis, pitch=axis)


def configured(lag: AttitudeResponse | None, drag: bool = False) -> FlightPlan:
    plan = read_flight(ROOT / "missions/figure8.yaml", ROOT / "config/flight.yaml", "none", None)
    vehicle = plan.body.vehicle.model_copy(update={"attitude_response": lag})
    body = replace(plan.body, vehicle=vehicle)
    return plan._replace(body=body, compensator=body.plus(LinearDrag(0.3, 0.3, 0.0)) if drag else body)


def test_a_lag_that_differs_from_the_configured_one_is_told() -> None:
    found = compare_with_log(configured(response(0.17, None)), LastFlight("last.csv", response(0.25)))
    assert found.verdict is Verdict.WARNING
    assert found.text.startswith("attitude lag 0.25 s [0.23, 0.27] in last.csv, configured 0.17: the lag may differ")


@pytest.mark.parametrize(
    ("lag_s", "half_s", "told"),
    [
        (0.195, 0.001, True),  # outside of the interval, and by more than a tick of 0.02 s
        (0.185, 0.001, False),  # a setpoint is held for longer than that
        (0.23, 0.07, False),  # the log cannot tell
        (0.12, 0.01, True),
    ],
)
def test_lags_agree_within_the_interval_or_a_tick(lag_s: float, half_s: float, told: bool) -> None:
    found = compare_with_log(configured(response(0.17, None)), LastFlight("last.csv", response(lag_s, half_s)))
    assert (found.verdict is Verdict.WARNING) is told


def test_what_a_flight_without_a_known_lag_gives_is_said() -> None:
    found = compare_with_log(configured(None), LastFlight("last.csv", response(0.25)))
    assert (found.verdict, found.fact.facts["configured_s"]) == (Verdict.OK, None)
    assert check_look_ahead(configured(None)).fact.kind is Kind.NO_RESPONSE
    assert check_look_ahead(configured(response(0.25))).fact == fact(Kind.NO_DRAG, lag_s=0.25)
    ahead = check_look_ahead(configured(response(0.25), drag=True)).fact
    assert ahead == fact(Kind.AHEAD, lag_s=pytest.approx(0.25))


def test_a_log_that_shows_no_lag_is_a_warning() -> None:
    assert compare_with_log(configured(None), LastFlight("hover.csv", None)).verdict is Verdict.WARNING


# --- parameters ------------------------------------------------------------------------------------------------------


class Told:
    def __init__(self, firmware: Firmware, **values: float) -> None:
        self.firmware = firmware
        self.asked: list[str] = []
        self._values = values

    async def parameters(self, names: Iterable[str]) -> dict[str, float]:
        self.asked = list(names)
        return {name: self._values[name] for name in self.asked if name in self._values}


def compared(autopilot: Told, **flown: float) -> list[Finding]:
    return asyncio.run(ask_about_attitude(LastFlight("last.ulg", None, flown), autopilot))


def test_a_parameter_that_has_changed_since_the_log_is_told() -> None:
    px4 = Told(PX4, MC_ROLL_P=8.0, MC_PITCH_P=6.5, MPC_THR_HOVER=0.6)
    (changed,) = compared(px4, MC_ROLL_P=6.5, MC_PITCH_P=6.5, MPC_THR_HOVER=0.5)
    assert changed.verdict is Verdict.WARNING
    assert changed.fact == fact(Kind.PARAMETER_CHANGED, name="MC_ROLL_P", was=6.5, log="last.ulg", now=8.0)
    assert px4.asked == ["MC_ROLL_P", "MC_PITCH_P"]  # a name that is not known would be waited for


def test_the_same_number_in_single_precision_has_not_changed() -> None:
    (same,) = compared(Told(ARDUPILOT, ATC_INPUT_TC=0.15000000596046448), ATC_INPUT_TC=0.15)
    assert same.verdict is Verdict.OK
    assert same.fact == fact(Kind.PARAMETERS_KEPT, parameters=1, log="last.ulg")


def test_a_log_without_parameters_is_no_news() -> None:
    (found,) = compared(Told(PX4, MC_ROLL_P=8.0))
    assert found.verdict is Verdict.OK
    assert "does not hold the parameters" in found.text
