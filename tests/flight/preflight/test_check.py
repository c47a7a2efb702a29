"""`quadctl check` passes fit flights before anything moves, and refuses unfit ones, each for its reason."""

import asyncio
import itertools
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import pytest
import yaml

from quadctl.effects.ground_effect import Hayden
from quadctl.errors import FlightError, SettingsError
from quadctl.flight.autopilot.ardupilot import ARDUPILOT
from quadctl.flight.autopilot.firmware import Check, Firmware, Requirement
from quadctl.flight.autopilot.px4 import PX4
from quadctl.flight.preflight.check import check_flight
from quadctl.flight.preflight.findings import Finding, Verdict
from quadctl.flight.preflight.inquiry import inspect_autopilot
from quadctl.flight.preflight.plan import FlightPlan, read_flight
from quadctl.model import Model, Provenance, save_model
from quadctl.state import VehicleState
from quadctl.thrust_chain import ardupilot
from quadctl.thrust_chain.chain import Addition, Ambient
from quadctl.vehicle import AttitudeResponse, AxisResponse, load_vehicle
from tests.support.places import ROOT

UP = {"name": "up", "kind": "move", "to_m": [0, 0, 1], "speed_m_s": 0.5}
LIMITS = {"min_z_m": 0.05, "max_z_m": 2.0, "max_distance_m": 20.0}


def planned(where: Path, *phases: dict[str, Any], model: str = "none", config: Any = None, **limits: Any) -> FlightPlan:
    """A flight of these phases after a climb to 1 m; `config` overwrites keys of the flight configuration."""
    mission, flight = where / "m.yaml", where / "flight.yaml"
    mission.write_text(yaml.safe_dump({"phases": [UP, *phases], "limits": {**LIMITS, **limits}}))
    flight.write_text(yaml.safe_dump({"vehicle": str(ROOT / "config/vehicles/raptor.yaml"), **(config or {})}))
    return read_flight(mission, flight, model, None)


def found(findings: list[Finding], verdict: Verdict) -> dict[str, str]:
    return {finding.topic: finding.text for finding in findings if finding.verdict is verdict}


def with_vehicle(plan: FlightPlan, **keys: Any) -> FlightPlan:
    vehicle = plan.body.vehicle.model_copy(update=keys)
    return plan._replace(
        body=replace(plan.body, vehicle=vehicle), compensator=replace(plan.compensator, vehicle=vehicle)
    )


# --- before the link -------------------------------------------------------------------------------------------------


def test_a_fit_flight_passes_with_its_numbers(tmp_path: Path) -> None:
    hover = {"kind": "hold", "duration_s": 10}
    plan = with_vehicle(planned(tmp_path, hover, config={"guards": {"min_battery_v": 14}}), endurance_s=300.0)
    findings = check_flight(plan)
    assert {finding.verdict for finding in findings} == {Verdict.OK}
    texts = found(findings, Verdict.OK)
    # climb with 2 m/s^2: 1.5 kg (9.81 + 2.0) = 17.7 N of 4 x 8.9764 N
    assert texts["thrust"].startswith("up to 17.7 N, 49% of the most that the rotors give, with throttle 0.59")
    assert texts["speed"].startswith("up to 0.50 m/s (climb 0.50, descent 0.00, setpoint steps not counted)")
    assert texts["battery"] == "12 s of flight, the vehicle hovers for 300 s, lands below 14 V"


def test_a_vehicle_file_that_is_not_of_the_vehicle_of_the_model_is_refused(tmp_path: Path) -> None:
    """The vehicle of the model flies; the attitude's response, which a fit adds to it, makes it no other."""
    vehicles, mission, config = ROOT / "config/vehicles", ROOT / "missions/figure8.yaml", ROOT / "config/flight.yaml"
    fitted = Model(load_vehicle(vehicles / "raptor.yaml")).plus(Hayden())
    answer = AxisResponse(frequency_rad_s=9.0, damping=1.0, delay_s=0.0)
    quick = fitted.vehicle.model_copy(update={"attitude_response": AttitudeResponse(roll=answer, pitch=answer)})
    save_model(replace(fitted, vehicle=quick), tmp_path / "fitted.yaml")
    model = str(tmp_path / "fitted.yaml")
    assert read_flight(mission, config, model, None, (), vehicles / "raptor.yaml").body.vehicle == quick
    with pytest.raises(SettingsError, match=r"x500\.yaml: holds 'x500', but the model that flies holds 'raptor'"):
        read_flight(mission, config, model, None, (), vehicles / "x500.yaml")


@pytest.mark.parametrize(
    ("topic", "phase", "said"),
    [
        # atan(9 / 9.81) = 43 deg, of which the controller leans 35; reach of a rotor tip 0.124 sqrt 2 + 0.12 = 0.295 m
        ("ground", {"kind": "move", "to_m": [9, 0, 0.06], "acceleration_m_s2": 9}, "it touches the ground"),
        (
            "speed",
            {"kind": "move", "to_m": [18, 0, 1], "speed_m_s": 9, "acceleration_m_s2": 5},
            "would end the mission",
        ),
        ("thrust", {"kind": "cosine", "centre_z_m": 1.5, "amplitude_m": 0.4, "period_s": 1}, "the rotors give 35.9 N"),
    ],
)
def test_what_the_vehicle_cannot_do_is_refused(tmp_path: Path, topic: str, phase: dict[str, Any], said: str) -> None:
    refused = found(check_flight(planned(tmp_path, phase)), Verdict.REFUSED)
    assert set(refused) == {topic}
    assert said in refused[topic]


def test_a_jump_of_the_reference_counts_with_the_controllers_answer(tmp_path: Path) -> None:
    """A step of 4 m north: 2 / s x 0.8 / s x 4 m = 6.4 m/s^2, atan(6.4 / 9.81) = 33 deg."""
    findings = check_flight(planned(tmp_path, {"kind": "step", "to_m": [4, 0, 1], "duration_s": 5}))
    assert found(findings, Verdict.OK)["tilt"].startswith("up to 33 deg")


def test_limits_that_contradict_each_other_are_refused(tmp_path: Path) -> None:
    guards = {"guards": {"max_tilt_deg": 30}}
    refused = found(check_flight(planned(tmp_path, config=guards)), Verdict.REFUSED)
    assert "the controller may lean further than the guard allows" in refused["tilt"]
    datum = {"height_datum": "takeoff", "rest_height_m": 0.3}
    low = {"kind": "move", "to_m": [0, 0, 0.2]}
    refused = found(check_flight(planned(tmp_path, low, config=datum)), Verdict.REFUSED)
    assert "z = 0.20 m is below rest_height_m = 0.3" in refused["ground"]


def test_a_ceiling_is_kept_away_from_by_mission_and_guard(tmp_path: Path) -> None:
    plan = planned(tmp_path)
    assert (
        "the guard ends a climb at z = 2.5 m"
        in found(check_flight(with_vehicle(plan, ceiling_m=2.4)), Verdict.WARNING)["ceiling"]
    )
    assert "ceiling at 1.1 m" in found(check_flight(with_vehicle(plan, ceiling_m=1.1)), Verdict.REFUSED)["ceiling"]
    assert "ceiling" in found(check_flight(with_vehicle(plan, ceiling_m=2.6)), Verdict.OK)


def test_guards_that_are_turned_off_are_named(tmp_path: Path) -> None:
    guards = {"following": {"max_contact_s": 0, "max_saturated_s": 0}, "max_estimator_ratio": 0}
    findings = check_flight(planned(tmp_path, config={"guards": guards}))
    assert found(findings, Verdict.WARNING)["guards"] == (
        "turned off: max_estimator_ratio, following.max_contact_s, following.max_saturated_s: "
        "each is 0, which is for tests without propellers"
    )
    assert "guards" not in found(check_flight(planned(tmp_path)), Verdict.WARNING)


def test_a_battery_that_does_not_last_is_refused(tmp_path: Path) -> None:
    plan = planned(tmp_path, {"kind": "hold", "duration_s": 90})
    for endurance_s, verdict in ((80.0, Verdict.REFUSED), (100.0, Verdict.WARNING)):
        assert "battery" in found(check_flight(with_vehicle(plan, endurance_s=endurance_s)), verdict)


def test_a_descent_faster_than_the_controller_flies_is_a_warning(tmp_path: Path) -> None:
    down = {"kind": "move", "to_m": [0, 0, 0.1], "speed_m_s": 1.2, "acceleration_m_s2": 4}
    warned = found(check_flight(planned(tmp_path, down)), Verdict.WARNING)
    assert "max_down_m_s = 1 m/s and falls behind 1.20 m/s" in warned["speed"]


# --- compensators ----------------------------------------------------------------------------------------------------


def test_an_unphysical_compensator_is_refused(tmp_path: Path) -> None:
    assert "ground_effect.kan" in found(check_flight(planned(tmp_path, model="kan")), Verdict.REFUSED)["compensator"]
    pole = planned(tmp_path, model="nobahari")  # at z = 0.625 R = 0.075 m, above min_z_m
    assert "not safe to fly" in found(check_flight(pole), Verdict.REFUSED)["compensator"]


def test_a_compensator_beyond_its_data_or_its_band_is_a_warning(tmp_path: Path) -> None:
    plan = planned(tmp_path, {"kind": "move", "to_m": [0, 0, 0.1]}, model="sanchez")
    assert "it asks for more than the limit" in found(check_flight(plan), Verdict.WARNING)["compensator"]
    fitted = replace(plan.compensator.stack[0], fitted=Provenance(height_m=(0.3, 1.0)))
    partial = plan._replace(compensator=replace(plan.compensator, stack=(fitted,)))
    texts = [finding.text for finding in check_flight(partial) if finding.verdict is Verdict.WARNING]
    assert any(
        "fitted to rotor heights of 0.30 to 1.00 m: the mission's limits go beyond them" in text for text in texts
    )


# --- the autopilot ---------------------------------------------------------------------------------------------------

GOOD = {
    "COM_OF_LOSS_T": 0.5,
    "COM_OBL_RC_ACT": 4.0,
    "COM_RC_IN_MODE": 0.0,
    "COM_RC_OVERRIDE": 3.0,
    "NAV_RCL_ACT": 3.0,
    "COM_RCL_EXCEPT": 0.0,
    "COM_LOW_BAT_ACT": 2.0,
    "RTL_RETURN_ALT": 2.0,
    "EKF2_NOAID_TOUT": 1e6,
    "MPC_THR_HOVER": 0.5,
}


@dataclass
class FakeAutopilot:
    """Time passes by 2 ms with each look at the state; messages come at `rate_hz`."""

    standing: VehicleState
    rate_hz: float = 100.0
    values: dict[str, float] = field(default_factory=lambda: dict(GOOD))
    refusal: str = ""
    warnings: list[str] = field(default_factory=list)
    description: str = "an autopilot"
    requirements: Sequence[Requirement] = field(default_factory=lambda: PX4.requirements(1))
    firmware: Firmware = PX4

    def __post_init__(self) -> None:
        self._looks = itertools.count()

    async def request_telemetry(self) -> None:
        if self.refusal:
            raise FlightError(self.refusal)

    def thrust_additions(self, hover: float) -> list[Addition]:
        return ardupilot.additions(hover, {"ATC_ANGLE_BOOST": 1.0}, Ambient(density_ratio=0.9))

    async def run_checks(self) -> None: ...

    def state(self) -> VehicleState:
        now = 100.0 + 0.002 * next(self._looks)
        latest = math.floor(now * self.rate_hz) / self.rate_hz
        parts = dict.fromkeys(("position", "attitude", "rates", "rpm", "battery", "heartbeat"), latest)
        return replace(self.standing, time_s=now, received_s=parts)

    async def parameters(self, names: Iterable[str]) -> dict[str, float]:
        return {name: self.values[name] for name in names if name in self.values}


STANDING = VehicleState(
    0.0, (0.0, 0.0, -0.05), (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0), battery_v=16.0, mode="HOLD",
    connected=True,
)  # fmt: skip


@pytest.fixture(autouse=True)
def _no_waiting(monkeypatch: pytest.MonkeyPatch) -> None:
    """The fake autopilot's time passes by itself."""
    monkeypatch.setattr("quadctl.flight.preflight.inquiry.LOOK_EVERY_S", 0.0)


def asked(where: Path, autopilot: FakeAutopilot, config: Any = None) -> list[Finding]:
    return asyncio.run(inspect_autopilot(planned(where, config=config), autopilot, 0.5))


def test_a_ready_autopilot_passes(tmp_path: Path) -> None:
    findings = asked(tmp_path, FakeAutopilot(STANDING))
    assert {finding.verdict for finding in findings} == {Verdict.OK}
    texts = [finding.text for finding in findings]
    assert "position at 100 Hz, up to 8 ms old" in texts  # looked at every 2 ms
    assert "COM_OBL_RC_ACT: when setpoints stop it goes to Land (4)" in texts


def test_the_table_of_what_the_autopilot_adds_is_among_the_findings(tmp_path: Path) -> None:
    heading, boost, *_, air = [f.text for f in asked(tmp_path, FakeAutopilot(STANDING)) if f.topic == "thrust chain"]
    assert heading.split() == ["your", "autopilot", "adds", "at", "hover", "at", "15", "deg"]
    assert boost.split()[:4] == ["ATC_ANGLE_BOOST", "1", "+0.0%", "+3.5%"]
    assert air.startswith("air density 0.900 of sea level")
    assert "+11.1%" in air


@pytest.mark.parametrize(
    ("topic", "wrong", "said"),
    [
        ("mode", {"armed": True}, "expected a vehicle that is disarmed"),
        ("mode", {"ready_to_arm": False}, "its own checks do not pass"),
        ("estimator", {"estimator_ok": False}, "does not trust its attitude"),
        ("estimator", {"position_ned_m": (math.nan, 0.0, 0.0)}, "not a number"),
        ("standing", {"attitude": (math.cos(0.1), math.sin(0.1), 0.0, 0.0)}, "11.5 deg tilt"),
        ("standing", {"velocity_ned_m_s": (0.4, 0.0, 0.0)}, "expected at most 0.3 m/s"),
        ("standing", {"position_ned_m": (0.0, 0.0, -1.0)}, "height_datum: frame takes z = 0 for the ground"),
        ("battery", {"battery_v": 13.0}, "13.00 V: expected 14 V or more"),
        ("battery", {"battery_v": math.nan}, "guards.min_battery_v needs it"),
        ("battery", {"battery_remaining": 0.0}, "16.00 V, 0 % left: 0 % of the battery is left"),
        ("battery", {"battery_alarm": "critical"}, "16.00 V: the autopilot calls the battery critical"),
    ],
    ids=str,
)
def test_an_autopilot_that_is_not_ready_is_refused(
    tmp_path: Path, topic: str, wrong: dict[str, Any], said: str
) -> None:
    findings = asked(tmp_path, FakeAutopilot(replace(STANDING, **wrong)), {"guards": {"min_battery_v": 14}})
    assert said in found(findings, Verdict.REFUSED)[topic]


def test_a_vehicle_without_a_remote_control_is_warned_of(tmp_path: Path) -> None:
    warned = found(asked(tmp_path, FakeAutopilot(replace(STANDING, remote=False))), Verdict.WARNING)
    assert "nobody can take the vehicle with one" in warned["remote"]
    for remote in (True, None):
        assert "remote" not in found(asked(tmp_path, FakeAutopilot(replace(STANDING, remote=remote))), Verdict.WARNING)


@pytest.mark.parametrize(
    ("firmware", "values", "said"),
    [
        (PX4, {"CA_ROTOR_COUNT": 6.0}, "CA_ROTOR_COUNT: 6 rotors (6): the vehicle file 'raptor' has 4"),
        (ARDUPILOT, {"FRAME_CLASS": 2.0}, "FRAME_CLASS: 6 rotors (2): the vehicle file 'raptor' has 4"),
        (PX4, {"CA_ROTOR_COUNT": 4.0}, None),
        (ARDUPILOT, {"FRAME_CLASS": 1.0}, None),
        (ARDUPILOT, {"FRAME_CLASS": 15.0}, None),  # by a script
    ],
)
def test_an_autopilot_that_drives_another_number_of_rotors_is_refused(
    tmp_path: Path, firmware: Firmware, values: dict[str, float], said: str | None
) -> None:
    autopilot = FakeAutopilot(STANDING, values=GOOD | values, firmware=firmware)
    assert found(asked(tmp_path, autopilot), Verdict.REFUSED).get("parameters") == said


def test_messages_that_come_too_seldom_are_refused_and_slow_ones_a_warning(tmp_path: Path) -> None:
    seldom = [f for f in asked(tmp_path, FakeAutopilot(STANDING, rate_hz=4.0)) if f.topic == "messages"]
    assert [finding.verdict for finding in seldom[:2]] == [Verdict.REFUSED] * 2
    slow = [f for f in asked(tmp_path, FakeAutopilot(STANDING, rate_hz=30.0)) if f.topic == "messages"]
    assert [finding.verdict for finding in slow[:2]] == [Verdict.WARNING] * 2
    assert "control runs at 50 Hz" in slow[0].text


@pytest.mark.parametrize("rpm", [0.0, math.nan])
def test_rotor_speeds_that_are_all_zero_are_not_called_measured(tmp_path: Path, rpm: float) -> None:
    """ArduPilot without speed sensors sends zeros, which count as unknown."""
    findings = asked(tmp_path, FakeAutopilot(replace(STANDING, rotor_rpm=(rpm,) * 4)))
    warning = found(findings, Verdict.WARNING)["messages"]
    assert warning == "rotor speeds at 100 Hz: all are zero, so it will show when the motors turn if they are measured"
    turning = asked(tmp_path, FakeAutopilot(replace(STANDING, rotor_rpm=(900.0,) * 4)))
    assert "messages" not in found(turning, Verdict.WARNING)


def test_an_autopilot_that_refuses_a_message_is_refused(tmp_path: Path) -> None:
    findings = asked(tmp_path, FakeAutopilot(STANDING, refusal="it refused to send LOCAL_POSITION_NED"))
    assert found(findings, Verdict.REFUSED) == {"messages": "it refused to send LOCAL_POSITION_NED"}


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"COM_OF_LOSS_T": 5.0}, "acts 5 s after the last setpoint: expected at most 1 s"),
        ({"NAV_RCL_ACT": 1.0}, "when the remote control is lost it goes to Hold (1): expected 3 (Land)"),
        ({"COM_RCL_EXCEPT": 4.0}, "offboard flies on without a remote control (4): then nobody can take the vehicle"),
        ({"COM_RC_IN_MODE": 4.0}, "sticks are not read (4): nobody can take the vehicle with a remote control"),
        ({"COM_RC_OVERRIDE": 1.0}, "moving the sticks does not end offboard (1): only the mode switch does"),
        ({"COM_LOW_BAT_ACT": 0.0}, "with a low battery it only says so (0): expected 2 (Land)"),
        ({"RTL_RETURN_ALT": 30.0}, "a return climbs to up to 30 m first: there is a ceiling at 2.6 m"),
        ({"MPC_THR_HOVER": 0.3}, "hovers at 0.30, the vehicle file at 0.52: one of them is wrong"),
    ],
)
def test_parameters_that_make_silence_dangerous_are_warnings(
    tmp_path: Path, values: dict[str, float], said: str
) -> None:
    findings = asked(tmp_path, FakeAutopilot(STANDING, values={**GOOD, **values}))
    assert said in found(findings, Verdict.WARNING)["parameters"]
    assert not found(findings, Verdict.REFUSED)


@pytest.mark.parametrize(
    ("action", "said"),
    [
        (0.0, "it goes to Position, where a pilot has to fly (0): expected 4"),
        (5.0, "it goes to Hold (5): expected 4"),  # for as long as the battery lasts
        (7.0, "it goes to Disarm (7): expected 4"),
    ],
)
def test_a_px4_that_nobody_would_land_after_our_death_is_refused_unless_that_is_accepted(
    tmp_path: Path, action: float, said: str
) -> None:
    autopilot = FakeAutopilot(STANDING, values={**GOOD, "COM_OBL_RC_ACT": action})
    refused = found(asked(tmp_path, autopilot), Verdict.REFUSED)["parameters"]
    assert said in refused
    assert "when quadctl dies, nobody would land the vehicle" in refused
    accepted = asyncio.run(inspect_autopilot(planned(tmp_path), autopilot, 0.5, without_failsafe=True))
    assert not found(accepted, Verdict.REFUSED)
    assert said in found(accepted, Verdict.WARNING)["parameters"]


def test_what_is_judged_of_a_parameter_belongs_to_the_autopilot(tmp_path: Path) -> None:
    patience = Check(
        "ACME_PATIENCE",
        finding="waits {value:g} s",
        poor=lambda seconds, _: seconds > 1.0,
        objection="expected 1 s",
    )
    values = {"ACME_PATIENCE": 3.0, "COM_OF_LOSS_T": 5.0}
    autopilot = FakeAutopilot(STANDING, values=values, requirements=(), firmware=replace(PX4, checks=[patience]))
    findings = [finding for finding in asked(tmp_path, autopilot) if finding.topic == "parameters"]
    assert [str(finding) for finding in findings] == ["parameters: ACME_PATIENCE: waits 3 s: expected 1 s"]


def test_a_mission_that_may_end_early_says_for_what(tmp_path: Path) -> None:
    plan = planned(tmp_path, {"kind": "hold", "duration_s": 10})
    early = plan._replace(mission=plan.mission._replace(until={"drag": 0.1, "thrust": 0.005}))
    said = found(check_flight(early), Verdict.OK)["mission"]
    assert said.endswith("; it ends earlier once the flight knows drag to 10 % and thrust to 0.5 %")
    assert "it ends earlier" not in found(check_flight(plan), Verdict.OK)["mission"]
