"""PX4 and ArduPilot Copter: each flies by its own rules, over real MAVLink, through the same command."""

import asyncio
import math
import os
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest
import yaml

from quadctl.errors import FlightError
from quadctl.flight.autopilot.ardupilot import throttle_of_pulse
from quadctl.flight.autopilot.telemetry import Telemetry
from quadctl.flight.pilot.guards import GuardLimits
from quadctl.flight.pilot.pilot import Pilot
from quadctl.flight.pilot.tick import Request, Stage, Tick
from quadctl.flight.preflight.preparation import prepare_flight
from quadctl.flight.preflight.requirements import requirements_met
from quadctl.lab.comparison.comparison import compare
from quadctl.lab.flights.channels import ROTOR_SPEED, signals_of
from quadctl.lab.interface import prepare_flights
from quadctl.logs.flight_log import FlightLog
from quadctl.logs.read import read_log
from quadctl.model import load_model
from quadctl.sitl.rules.copter import Guided, SimulatedCopter
from quadctl.sitl.rules.px4 import SimulatedAutopilot
from quadctl.sitl.run import fly_lockstep
from quadctl.sitl.server.ardupilot import pulse_us
from quadctl.sitl.vehicle.hidden import load_hidden
from quadctl.state import AttitudeTarget
from quadctl.vehicle import load_vehicle
from tests.support.links import LEVEL, RAPTOR, TIMEOUT_S, Link, SerialLine, connected, free_port, hover_throttle, mock
from tests.support.places import ROOT

pytestmark = pytest.mark.realtime

LIKE_SIH = ROOT / "sitl" / "px4" / "like_sih.yaml"
VEHICLE = load_vehicle(RAPTOR)
ARDUPILOT = {"autopilot": 3, "base_mode": 1, "custom_mode": 4}


# --- flights -----------------------------------------------------------------------------------------------------


class Flight:
    """`quadctl fly` in a process of its own, on the autopilot at a link."""

    def __init__(self, where: Path, url: str, *words: str, mission: str = "short_hop") -> None:
        where.mkdir(exist_ok=True)
        settings = yaml.safe_load((ROOT / "config" / "flight.yaml").read_text())
        settings |= {"vehicle": str(RAPTOR), "height_datum": "takeoff"}
        (where / "flight.yaml").write_text(yaml.safe_dump(settings))
        fly = ["fly", f"missions/{mission}.yaml", "--link", url, "--config", str(where / "flight.yaml"), *words]
        code = "from quadctl.cli import main; main()"
        self.where = where
        self.process = subprocess.Popen(
            [sys.executable, "-c", code, *fly, "--log-dir", str(where)],
            cwd=ROOT,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )

    def until_recorded(self, phase: str) -> None:
        end_s = time.monotonic() + TIMEOUT_S
        while not any(f",{phase}\n" in path.read_text() for path in self.where.glob("*.csv")):
            assert self.process.poll() is None, self.process.communicate()
            assert time.monotonic() < end_s, "it takes too long"
            time.sleep(0.05)

    def ended(self) -> tuple[FlightLog, str]:
        """The log, and all that was printed."""
        out, err = self.process.communicate(timeout=60.0)
        (path,) = self.where.glob("*.csv")
        return read_log(path), out + err


def stages(log: FlightLog) -> list[str]:
    assert log.phase is not None
    return [stage for stage in dict.fromkeys(log.phase.tolist()) if stage != "wait"]


SHORTER = ("--set", "settle_s=4", "--set", "step_s=9")


def test_the_same_command_flies_a_stock_px4_and_a_stock_ardupilot_into_the_lab(tmp_path: Path) -> None:
    """A step, shortened by its parameters, at the same time on both, because they take real time."""
    px4, copter = SimulatedAutopilot(VEHICLE, load_hidden(LIKE_SIH), seed=1), SimulatedCopter(VEHICLE)
    ports = free_port(), free_port()
    with mock(px4, ports[0]), mock(copter, ports[1]):
        on_px4, on_copter = (
            Flight(tmp_path / name, f"udpin://127.0.0.1:{port}", *words, *SHORTER, mission="step_response")
            for name, port, words in (("px4", ports[0], ()), ("ardupilot", ports[1], ("--set-params",)))
        )
        px4_log, px4_says = on_px4.ended()
        copter_log, copter_says = on_copter.ended()
    for autopilot, says in ((px4, px4_says), (copter, copter_says)):
        assert "step_response: completed" in says
        assert autopilot.landed
        assert not autopilot.armed
    assert "sends no rotor speeds" in px4_says
    assert stages(px4_log) == ["stream", "start", "spool_up", "takeoff", "settle", "step", "land", "done"]
    assert stages(copter_log) == ["stream", "start", "climb", "settle", "step", "land", "done"]
    assert copter.parameters["GUID_OPTIONS"] == 0.0
    for log, source in ((px4_log, "motor output"), (copter_log, ROTOR_SPEED)):
        signals = signals_of(log, VEHICLE, [])
        assert signals.thrust_source == source
        hovering = log.time_s[log.phase == "settle"][100:]  # settled
        thrust_n = sum(float(channel.at(hovering).mean()) for channel in signals.rotor)
        assert thrust_n == pytest.approx(VEHICLE.weight_n, rel=0.1)
    for name, rmse in (("px4", 1.5), ("ardupilot", 0.5)):  # the one has drag and a poor estimator, the other neither
        flights = prepare_flights(list((tmp_path / name).glob("*.csv")), VEHICLE, "blocks")
        assert compare(load_model(RAPTOR), flights).rmse["total"] < rmse


def test_ctrl_c_in_flight_lands_and_restores_the_parameters(tmp_path: Path) -> None:
    copter, port = SimulatedCopter(VEHICLE), free_port()
    with mock(copter, port):
        flight = Flight(tmp_path, f"udpin://127.0.0.1:{port}", "--set-params")
        flight.until_recorded("hover")
        assert copter.parameters["GUID_OPTIONS"] == 8.0
        flight.process.send_signal(2)
        log, says = flight.ended()
    assert "asked to land by SIGINT" in says
    assert "GUID_OPTIONS is 0 again" in says
    assert copter.parameters["GUID_OPTIONS"] == 0.0
    assert not copter.armed
    assert stages(log)[-2:] == ["land", "done"]


def test_a_plug_pulled_in_flight_ends_in_a_landing_all_of_it_recorded(tmp_path: Path) -> None:
    copter, port = SimulatedCopter(VEHICLE), free_port()
    copter.parameters["GUID_OPTIONS"] = 8.0
    copter.ready_after_s = 3.0  # the flight waits for the autopilot's own checks
    with SerialLine(tmp_path / "tty", port) as line, mock(copter, port) as wire:
        flight = Flight(tmp_path / "log", f"serial://{line.device}:921600")
        flight.until_recorded("hover")
        line.unplug()
        assert wire.wait_until(lambda: copter.guided is Guided.LEVEL, TIMEOUT_S)  # its own failsafe
        line.plug()
        log, says = flight.ended()
    assert "the position is 0.2" in says
    assert copter.mode == "LAND"  # asked for again, once there was a line
    assert not copter.armed
    assert stages(log)[-3:] == ["hover", "land", "done"]
    assert log["telemetry_age_s"].max() > 2.5
    assert log["telemetry_age_s"][-1] < 0.2
    assert log["z_m"][-1] == pytest.approx(0.05, abs=0.02)


def test_the_check_of_real_simulators_says_when_there_is_none() -> None:
    done = subprocess.run(
        [ROOT / "sitl" / "check.sh"], env={"PATH": os.environ["PATH"]}, capture_output=True, text=True, check=False
    )
    assert done.returncode == 1
    assert done.stderr.startswith("no autopilot to check: say PX4=DIRECTORY, ARDUPILOT=DIRECTORY or LINK=URL")


@pytest.mark.parametrize("autopilot", ["px4", "ardupilot"])
def test_a_start_script_says_what_it_misses(autopilot: str, tmp_path: Path) -> None:
    start = ROOT / "sitl" / autopilot / "start.sh"
    done = subprocess.run([start, tmp_path], capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert done.stderr.startswith(f"{tmp_path}/b")
    assert "is not there; usage: start.sh DIRECTORY" in done.stderr


# --- ArduPilot's rules -------------------------------------------------------------------------------------------


def warn_not(sentence: str) -> None:
    raise AssertionError(sentence)


def test_thrust_as_a_climb_rate_is_refused_with_the_way_out() -> None:
    async def attempt(link: Link) -> None:
        async with requirements_met(link.adapter, False, warn_not):
            raise AssertionError("it flies")

    with connected(SimulatedCopter(VEHICLE)) as link, pytest.raises(FlightError) as error:
        asyncio.run(attempt(link))
    assert "GUID_OPTIONS is 0 on ArduPilot" in str(error.value)
    assert "expected 8: with bit 3 (value 8) clear, ArduPilot takes thrust for a climb rate." in str(error.value)
    assert "--set-params" in str(error.value)


def test_only_the_bit_that_is_needed_is_set() -> None:
    says: list[str] = []

    async def fly(link: Link) -> float:
        async with requirements_met(link.adapter, True, says.append):
            return link.px.autopilot.parameters["GUID_OPTIONS"]

    with connected(SimulatedCopter(VEHICLE)) as link:
        link.px.autopilot.parameters["GUID_OPTIONS"] = 3.0
        assert asyncio.run(fly(link)) == 11.0
        assert link.px.autopilot.parameters["GUID_OPTIONS"] == 3.0
    assert says == [
        "GUID_OPTIONS is set from 3 to 11 for this flight.",
        "GUID_TIMEOUT is set from 3 to 0.5 for this flight.",
        "GUID_OPTIONS is 3 again.",
        "GUID_TIMEOUT is 3 again.",
    ]


def test_what_had_better_be_set_is_a_warning() -> None:
    says: list[str] = []

    async def fly(link: Link) -> None:
        async with requirements_met(link.adapter, False, says.append):
            assert link.px.autopilot.parameters["GUID_TIMEOUT"] == 3.0

    with connected(SimulatedCopter(VEHICLE)) as link:
        link.px.autopilot.parameters["GUID_OPTIONS"] = 8.0
        asyncio.run(fly(link))
    (warning,) = says
    assert "GUID_TIMEOUT is 3 on ArduPilot" in warning
    assert "expected 0.5: for so many seconds ArduPilot keeps its last tilt when setpoints stop." in warning


def test_parameters_of_a_vehicle_that_still_flies_are_left_and_that_is_said() -> None:
    says: list[str] = []

    async def fly(link: Link) -> None:
        async with requirements_met(link.adapter, True, says.append):
            await link.adapter.start_offboard()
            await link.adapter.arm()

    with connected(SimulatedCopter(VEHICLE)) as link:
        asyncio.run(fly(link))
        assert link.px.autopilot.parameters["GUID_OPTIONS"] == 8.0
    assert says[-2] == "GUID_OPTIONS could not be restored; set it to 0 by hand: the vehicle is still armed."


def test_a_fresh_ardupilot_sends_only_heartbeats_until_it_is_asked() -> None:
    with connected(SimulatedCopter(VEHICLE)) as link:
        asyncio.run(link.pass_time(1.0))
        assert not link.adapter.state().finite
        asyncio.run(link.adapter.request_telemetry())
        link.wait(lambda: link.adapter.state().finite)
        assert link.adapter.warnings == []


def test_refusals_come_with_ardupilots_reason() -> None:
    with connected(SimulatedCopter(VEHICLE)) as link:
        link.px.autopilot.ready_after_s = math.inf
        with pytest.raises(FlightError, match="refused to arm: FAILED; PreArm: EKF attitude is bad"):
            asyncio.run(link.adapter.arm())
        with pytest.raises(FlightError, match=r"refused to take off to 1 m: FAILED; Take-off needs GUIDED, armed"):
            asyncio.run(link.adapter.take_off(1.0))


# --- the simulated Copter ------------------------------------------------------------------------------------------


def copter_in_guided() -> SimulatedCopter:
    copter = SimulatedCopter(VEHICLE)
    copter.parameters["GUID_OPTIONS"] = 8.0
    assert copter.request_mode("GUIDED") is None
    assert copter.request_arm() is None
    return copter


def run(copter: SimulatedCopter, seconds: float, target: AttitudeTarget | None = None) -> None:
    for _ in range(round(seconds / 0.02)):
        if target is not None:
            copter.set_attitude_target(target)
        copter.step(copter.time_s + 0.02)


def test_a_target_in_the_middle_of_a_take_off_ends_it() -> None:
    copter = copter_in_guided()
    assert copter.request_take_off(1.0) is None
    run(copter, 0.1, AttitudeTarget(LEVEL, 0.0))
    run(copter, 2.0, AttitudeTarget(LEVEL, 0.0))
    assert copter.landed
    run(copter, 9.0, AttitudeTarget(LEVEL, 0.0))
    assert not copter.armed  # DISARM_DELAY


def test_without_targets_it_levels_after_its_time_out_and_stays() -> None:
    copter = copter_in_guided()
    copter.request_take_off(1.0)
    run(copter, 4.0)
    assert -copter.body.position[2] == pytest.approx(1.05, abs=0.15)
    tilted = AttitudeTarget((math.cos(0.05), math.sin(0.05), 0.0, 0.0), hover_throttle(VEHICLE))
    run(copter, 0.5, tilted)
    run(copter, 2.9)
    assert abs(copter.body.attitude[1]) > 0.03
    run(copter, 1.0)
    assert abs(copter.body.attitude[1]) < 0.01
    run(copter, 3.0)
    assert copter.mode == "GUIDED"
    assert not copter.landed


def test_thrust_is_a_climb_rate_with_the_bit_clear() -> None:
    copter = copter_in_guided()
    copter.request_take_off(1.0)
    run(copter, 4.0)
    copter.parameters["GUID_OPTIONS"] = 0.0
    run(copter, 2.0, AttitudeTarget(LEVEL, 0.6))  # a tenth over the middle of the range: 0.5 m/s
    assert copter.body.velocity[2] == pytest.approx(-0.5, abs=0.1)


def test_lifting_off_by_targets_blocks_the_next_arming() -> None:
    copter = copter_in_guided()
    run(copter, 1.5, AttitudeTarget(LEVEL, 1.1 * hover_throttle(VEHICLE)))
    assert not copter.landed
    copter.request_mode("LAND")
    run(copter, 10.0)
    assert not copter.armed
    copter.request_mode("GUIDED")
    assert copter.request_arm() == "PreArm: Internal errors 0x4000000"


# --- the pilot of an autopilot that takes off by itself ---------------------------------------------------------------


def flown_in_lockstep(copter: SimulatedCopter, guards: GuardLimits | None = None) -> tuple[Pilot, list[Tick]]:
    plan = prepare_flight(ROOT / "missions" / "short_hop.yaml", ROOT / "config" / "flight.yaml", None, None)
    if guards is not None:
        plan = plan._replace(settings=plan.settings.model_copy(update={"guards": guards}))
    copter.parameters["GUID_OPTIONS"] = 8.0
    pilot, ticks = plan.pilot(autopilot_takes_off=True), list[Tick]()
    fly_lockstep(copter, pilot, plan.settings.controller.rate_hz, [ticks.append])
    return pilot, ticks


def test_it_is_silent_until_the_autopilot_has_taken_off() -> None:
    pilot, ticks = flown_in_lockstep(SimulatedCopter(VEHICLE))
    assert pilot.ended == "completed"
    first = next(tick for tick in ticks if tick.target is not None)
    assert first.stage is Stage.FLY
    assert first.phase == "hover"
    assert -first.state.position_ned_m[2] == pytest.approx(0.6, abs=0.1)


@pytest.mark.parametrize(
    ("answer", "reason"),
    [
        ("Take-off is not allowed here", "Take-off is not allowed here"),
        (None, "the autopilot did not take off in 20 s"),
    ],
)
def test_a_take_off_that_does_not_come_ends_disarmed_without_a_target(answer: str | None, reason: str) -> None:
    class StayingCopter(SimulatedCopter):
        def request_take_off(self, height_m: float) -> str | None:
            return answer

    copter = StayingCopter(VEHICLE)
    copter.parameters["DISARM_DELAY"] = 25.0  # it does not end the wait by itself
    pilot, ticks = flown_in_lockstep(copter)
    assert pilot.ended.endswith(reason)
    assert [request for tick in ticks for request in tick.requests][-1] is Request.LAND
    assert all(tick.target is None for tick in ticks)
    assert not copter.armed


def test_a_flight_that_a_slow_take_off_makes_too_long_lands() -> None:
    """Twelve seconds of mission, of which the take-off is a good one."""

    class SlowCopter(SimulatedCopter):
        climbs_s = math.inf
        height_m = 0.0

        def request_take_off(self, height_m: float) -> str | None:
            self.climbs_s, self.height_m = self.time_s + 7.0, height_m
            return None

        def step(self, until_s: float) -> None:
            if until_s > self.climbs_s:
                self.climbs_s = math.inf
                assert super().request_take_off(self.height_m) is None
            super().step(until_s)

    pilot, ticks = flown_in_lockstep(SlowCopter(VEHICLE), GuardLimits(max_over_time_s=4.0))
    assert pilot.ended == f"the flight lasts 16 s, the mission {pilot.mission.duration_s:.0f} s"
    (asked,) = [tick for tick in ticks if Request.LAND in tick.requests]
    assert asked.target is not None
    assert not ticks[-1].state.armed
    assert flown_in_lockstep(SlowCopter(VEHICLE))[0].ended == "completed"


# --- rotor speeds and motor outputs ----------------------------------------------------------------------------------


def heard(*messages: tuple[str, dict[str, Any]]) -> Telemetry:
    telemetry = Telemetry(n_rotors=4)
    telemetry.receive("HEARTBEAT", ARDUPILOT, now_s=1.0)
    for name, fields in messages:
        telemetry.receive(name, fields, now_s=1.0)
    return telemetry


def test_rotor_speeds_come_from_esc_telemetry() -> None:
    fields = {"rpm": [1, 2, 3, 4], "voltage": [1600] * 4, "current": [250] * 4}
    state = heard(("ESC_TELEMETRY_1_TO_4", fields)).state(1.0)
    assert state.rotor_rpm == (1.0, 2.0, 3.0, 4.0)
    assert state.motor_voltage_v == (16.0,) * 4
    assert state.motor_current_a == (2.5,) * 4


def test_zeros_for_all_rotors_are_no_speeds() -> None:
    fields = {"rpm": [0] * 4, "voltage": [1600] * 4, "current": [250] * 4}
    assert all(map(math.isnan, heard(("ESC_TELEMETRY_1_TO_4", fields)).state(1.0).rotor_rpm))


def test_rotor_speeds_come_from_rpm_sensors_where_there_is_nothing_else() -> None:
    state = heard(*(("RAW_RPM", {"index": i, "frequency": 1000.0 + i}) for i in range(4))).state(1.0)
    assert state.rotor_rpm == (1000.0, 1001.0, 1002.0, 1003.0)
    assert state.age_s("rpm") == 0.0


@pytest.mark.parametrize("throttle", [0.0, 0.1, 0.5, 1.0])
def test_a_pulse_gives_back_the_throttle_that_it_was_made_of(throttle: float) -> None:
    assert throttle_of_pulse(pulse_us(throttle)) == pytest.approx(throttle, abs=1e-9)


def test_motor_outputs_come_from_servo_pulses() -> None:
    pulses = {f"servo{i}_raw": round(pulse_us(0.1 * i)) if i <= 4 else 0 for i in range(1, 17)}
    state = heard(("SERVO_OUTPUT_RAW", {"port": 0, **pulses})).state(1.0)
    assert state.motor_output == pytest.approx((0.1, 0.2, 0.3, 0.4), abs=0.002)


def test_an_estimator_in_doubt_is_seen() -> None:
    tests = {"velocity_variance": 0.1, "pos_horiz_variance": 1.5, "pos_vert_variance": 0.2}
    good = heard(("EKF_STATUS_REPORT", {"flags": 0b11_1111, **tests})).state(1.0)
    assert good.estimator_ok
    assert good.estimator_ratio == 1.5
    assert not heard(("EKF_STATUS_REPORT", {"flags": 0b10_0111, **tests})).state(1.0).estimator_ok
