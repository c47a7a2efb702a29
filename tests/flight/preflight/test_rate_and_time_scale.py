"""A reference that is faster than the vehicle is told with number, time and phase, and slowed until it fits."""

import asyncio
import math
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from quadctl.errors import SettingsError
from quadctl.flight.autopilot.ardupilot import ARDUPILOT
from quadctl.flight.autopilot.firmware import Firmware
from quadctl.flight.autopilot.px4 import PX4
from quadctl.flight.preflight.check import check_flight, needed_rate_rad_s
from quadctl.flight.preflight.facts import Kind
from quadctl.flight.preflight.findings import Finding, Verdict
from quadctl.flight.preflight.plan import FlightPlan, read_flight
from quadctl.flight.preflight.rate import ask_about_rate, fastest_turn
from quadctl.flight.preflight.time_scale import with_time_scale
from quadctl.vehicle import AttitudeResponse, AxisResponse
from tests.support.places import ROOT


def flight(*overrides: str, config: str = "flight.yaml", mission: str = "figure8") -> FlightPlan:
    return read_flight(ROOT / f"missions/{mission}.yaml", ROOT / "config" / config, "none", None, overrides)


def answering(plan: FlightPlan, frequency: float, damping: float = 1.0) -> FlightPlan:
    axis = AxisResponse(frequency_rad_s=frequency, damping=damping)
    vehicle = plan.body.vehicle.model_copy(update={"attitude_response": AttitudeResponse(roll=axis, pitch=axis)})
    body = replace(plan.body, vehicle=vehicle)
    return plan._replace(body=body, compensator=body)


def about(findings: Sequence[Finding], topic: str) -> Finding:
    (finding,) = (f for f in findings if f.topic == topic)
    return finding


class Told:
    """An autopilot that tells these parameters."""

    def __init__(self, firmware: Firmware, **values: float) -> None:
        self.firmware = firmware
        self._values = values

    async def parameters(self, names: Iterable[str]) -> dict[str, float]:
        return {name: self._values[name] for name in names if name in self._values}


def test_the_rate_of_an_axis_that_turns_evenly_is_its_rate() -> None:
    """0.4 rad/s about an axis in the north-east, from 3 s to 5 s."""

    def axis(t: float) -> tuple[float, float, float]:
        tilt = 0.4 * min(max(t - 3.0, 0.0), 2.0)
        return 0.6 * math.sin(tilt), -0.8 * math.sin(tilt), -math.cos(tilt)

    rate, at_s = fastest_turn([(0.05 * k, axis(0.05 * k)) for k in range(160)], 0.25)
    assert rate == pytest.approx(0.4, rel=1e-6)
    assert 3.0 <= at_s <= 4.75


def test_an_axis_that_jumps_turns_within_the_lag() -> None:
    level, leaning = (0.0, 0.0, -1.0), (0.0, math.sin(0.2), -math.cos(0.2))
    axes = [(0.05 * k, level if k < 40 else leaning) for k in range(80)]
    assert fastest_turn(axes, 0.2)[0] == pytest.approx(1.0, rel=1e-6)


def test_each_limit_is_told_with_its_time_and_phase() -> None:
    findings = check_flight(flight("lap_s=3"))
    assert about(findings, "rate").fact.facts["phase"] == "figure8"
    assert about(findings, "tilt").verdict is Verdict.WARNING
    for topic in ("speed", "tilt", "thrust"):
        assert about(findings, topic).fact.facts["phase"] == "figure8"


def test_a_slow_attitude_leaves_more_than_the_mission_tolerates() -> None:
    """9.81 tan(11.33 deg) = 1.966 m/s2; zeta 2, 2 rad/s: (2 x 4 - 1) / 4 x 1.966 = 3.44 m; 1, 12 rad/s: 0.014 m."""
    slow = about(check_flight(answering(flight(), 2.0, 2.0)), "rate")
    assert slow.verdict is Verdict.WARNING
    assert slow.fact.facts["left_m"] == pytest.approx(3.44, abs=0.005)
    quick = about(check_flight(answering(flight(), 12.0)), "rate")
    assert quick.verdict is Verdict.OK
    assert quick.fact.facts["left_m"] == pytest.approx(0.014, abs=0.001)


def test_the_autopilots_own_limit_of_the_rates_is_compared() -> None:
    needed = needed_rate_rad_s(flight("lap_s=3"))
    px4 = Told(PX4, MC_ROLLRATE_MAX=220.0, MC_PITCHRATE_MAX=400.0)
    roll, pitch = asyncio.run(ask_about_rate(needed, px4))
    assert (roll.verdict, pitch.verdict) == (Verdict.WARNING, Verdict.OK)
    assert roll.fact.kind is Kind.RATE_LIMIT
    assert (roll.fact.facts["name"], roll.fact.facts["most_deg_s"]) == ("MC_ROLLRATE_MAX", 220.0)
    assert roll.fact.facts["needed_deg_s"] == pytest.approx(284, abs=6)
    unlimited = Told(ARDUPILOT, ATC_RATE_R_MAX=0.0, ATC_RATE_P_MAX=0.0)
    assert asyncio.run(ask_about_rate(needed, unlimited)) == []


def test_a_level_vehicle_that_pushes_to_the_side_need_not_turn() -> None:
    tilting = flight(mission="sidestep", config="flight_f550_tilted.yaml")
    settings = tilting.settings
    leaning = settings.model_copy(update={"controller": settings.controller.model_copy(update={"actuation": "tilt"})})
    assert needed_rate_rad_s(tilting) < 0.5 * needed_rate_rad_s(tilting._replace(settings=leaning))


# --- time scale ------------------------------------------------------------------------------------------------------


def objections(plan: FlightPlan) -> list[str]:
    topics = ("speed", "tilt", "rate", "thrust")
    return [f.topic for f in check_flight(plan) if f.topic in topics and f.verdict is not Verdict.OK]


def test_fit_is_the_least_factor_that_is_within_the_limits() -> None:
    plan = flight("lap_s=3")
    assert objections(plan) == ["tilt"]
    fitted = with_time_scale(plan, "fit")
    factor = fitted.mission.time_scale
    assert 1.2 < factor < 1.6
    assert objections(fitted) == []
    assert objections(with_time_scale(plan, f"{factor - 0.01:.2f}")) == ["tilt"]


def test_a_mission_within_its_limits_is_flown_as_it_is() -> None:
    assert with_time_scale(flight(), "fit").mission.time_scale == 1.0
    assert with_time_scale(flight(), None).mission == flight().mission


@pytest.mark.parametrize("wanted", ["0", "-2", "nan", "100", "slow"])
def test_a_factor_that_is_none_is_refused(wanted: str) -> None:
    with pytest.raises(SettingsError, match=r"--time-scale is '.*', expected a factor from 0.1 to 20, or fit"):
        with_time_scale(flight(), wanted)


def test_a_mission_that_then_lasts_too_long_is_refused() -> None:
    with pytest.raises(
        SettingsError, match=r"'figure8' then lasts 164 s, expected at most limits.max_duration_s = 120"
    ):
        with_time_scale(flight(), "3")


def test_a_jump_that_no_factor_helps_is_named(tmp_path: Path) -> None:
    mission: dict[str, Any] = {
        "limits": {"max_z_m": 2, "max_distance_m": 20},
        "phases": [
            {"kind": "move", "to_m": [0, 0, 1]},
            {"name": "far", "kind": "step", "to_m": [3, 5, 1], "duration_s": 5},
        ],
    }
    path = tmp_path / "far.yaml"
    path.write_text(str(mission).replace("'", '"'))
    with pytest.raises(SettingsError, match=r"a slower 'far' does not help: tilt: up to 4. deg at .* \(far\)"):
        with_time_scale(read_flight(path, ROOT / "config/flight.yaml", "none", None), "fit")


def test_the_factor_goes_into_the_logs_sidecar(tmp_path: Path) -> None:
    recorder = with_time_scale(flight(), "1.5").recorder(tmp_path, "none")
    recorder.close("completed")
    assert "time_scale: 1.5" in recorder.meta_path.read_text()
