"""PX4 and ArduPilot Copter: each flies by its own rules, over real MAVLink, through the same command."""

import asyncio
import math
import re
from collections.abc import Callable
from pathlib import Path

import pytest

from quadctl.errors import FlightError
from quadctl.flight.preflight.changed_parameters import Change, ChangedParameters, still_changed
from quadctl.flight.preflight.requirements import requirements_met
from quadctl.lab.comparison.comparison import compare
from quadctl.lab.flights.channels import ROTOR_SPEED, signals_of
from quadctl.lab.study import prepare_flights
from quadctl.logs.flight_log import FlightLog
from quadctl.model import load_model
from quadctl.sitl.rules.copter import Guided, SimulatedCopter, SimulatedCopter47
from quadctl.sitl.rules.px4 import SimulatedAutopilot
from quadctl.sitl.vehicle.hidden import load_hidden
from quadctl.vehicle import load_vehicle
from studies.serial_line import SerialLine
from tests.support.commands import Result
from tests.support.flight_process import Flight
from tests.support.links import RAPTOR, TIMEOUT_S, Link, connected, free_port, meet_requirements, mock
from tests.support.places import ROOT

pytestmark = pytest.mark.realtime

LIKE_SIH = ROOT / "sitl" / "px4" / "like_sih.yaml"
VEHICLE = load_vehicle(RAPTOR)


# --- flights -----------------------------------------------------------------------------------------------------


def stages(log: FlightLog) -> list[str]:
    assert log.phase is not None
    return [stage for stage in dict.fromkeys(log.phase.tolist()) if stage != "wait"]


SHORTER = ("--set", "settle_s=4", "--set", "step_s=9", "--offset-up", "0.5")
"""And higher: an estimate that is off by decimetres, as a real PX4's is, may put a low vehicle on the ground."""


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
    meet_requirements(copter)
    copter.parameters |= {"GUID_TIMEOUT": 3.0, "FS_GCS_TIMEOUT": 15.0}  # it levels, and does not land yet
    copter.ready_after_s = 3.0  # the flight waits for the autopilot's own checks
    with SerialLine(tmp_path / "tty", port) as line, mock(copter, port) as wire:
        flight = Flight(tmp_path / "log", f"serial://{line.device}:921600")
        flight.until_recorded("hover")
        line.unplug()
        assert wire.wait_until(lambda: copter.guided is Guided.LEVEL, TIMEOUT_S)  # its own failsafe
        line.plug()
        log, says = flight.ended()
        assert line.least_read == 1  # set on the new device too
    assert re.search(r"the (position|attitude) is 1\.[0-2]\d s old, allowed are 1 s", says)
    assert copter.mode == "LAND"  # asked for again, once there was a line
    assert not copter.armed
    assert stages(log)[-3:] == ["hover", "land", "done"]
    assert log["telemetry_age_s"].max() > 2.5
    assert log["telemetry_age_s"][-1] < 1.0  # within what is allowed, again
    assert log["z_m"][-1] == pytest.approx(0.05, abs=0.02)


@pytest.mark.parametrize("system_id", [1, 255])
def test_killed_in_flight_ardupilot_lands_only_if_its_failsafe_watches_our_heartbeats(
    system_id: int, tmp_path: Path
) -> None:
    """Measured on the real one: on its way down after 2.7 s with our id, hovering until landed by hand with 255."""
    copter, port = SimulatedCopter(VEHICLE), free_port()
    meet_requirements(copter)
    copter.parameters["SYSID_MYGCS"] = float(system_id)
    with mock(copter, port) as wire:
        flight = Flight(tmp_path, f"udpin://127.0.0.1:{port}", "--without-failsafe")
        flight.until_recorded("hover")
        flight.process.kill()
        flight.process.communicate()
        killed_s = copter.time_s
        lands = wire.wait_until(lambda: copter.mode == "LAND" or copter.time_s > killed_s + 6.0, TIMEOUT_S)
        assert lands
        assert (copter.mode == "LAND") == (system_id == 1)
        if system_id == 1:
            assert 1.5 < copter.time_s - killed_s < 3.5
        else:
            assert (copter.mode, copter.guided) == ("GUIDED", Guided.LEVEL)


def test_a_flight_after_whose_death_nobody_would_land_is_refused_unless_that_is_accepted() -> None:
    says: list[str] = []

    async def fly(link: Link, without_failsafe: bool) -> None:
        async with requirements_met(link.adapter, False, says.append, without_failsafe):
            says.append("it flies")

    with connected(SimulatedCopter(VEHICLE)) as link:
        meet_requirements(link.px.autopilot)
        for name, value in (("FS_GCS_ENABLE", 0.0), ("SYSID_MYGCS", 255.0)):
            kept, link.px.autopilot.parameters[name] = link.px.autopilot.parameters[name], value
            with pytest.raises(FlightError, match=f"{name} is {value:g} .*; --without-failsafe flies all the same"):
                asyncio.run(fly(link, without_failsafe=False))
            assert says == []
            asyncio.run(fly(link, without_failsafe=True))
            assert says[0].startswith(f"{name} is {value:g} on ArduPilot")
            assert says[1:] == ["it flies"]
            says.clear()
            link.px.autopilot.parameters[name] = kept


def test_a_hexarotors_configuration_on_a_quadrotor_is_not_flown(tmp_path: Path) -> None:
    copter, port = SimulatedCopter(VEHICLE), free_port()
    meet_requirements(copter)
    copter.parameters["FRAME_CLASS"] = 2.0
    copter.remote = False
    with mock(copter, port):
        _, said = Flight(tmp_path, f"udpin://127.0.0.1:{port}").process.communicate(timeout=60.0)
    assert "quadctl: parameters: FRAME_CLASS: 6 rotors (2): the vehicle file 'raptor' has 4." in said
    assert not list(tmp_path.glob("*.csv"))


def test_a_throttle_stick_off_neutral_is_told_and_nothing_is_armed(tmp_path: Path) -> None:
    copter, port = SimulatedCopter47(VEHICLE), free_port()
    meet_requirements(copter)
    copter.stick_neutral = False
    with mock(copter, port):
        _, said = Flight(tmp_path, f"udpin://127.0.0.1:{port}").process.communicate(timeout=60.0)
    assert "Arm: Throttle (RC3) is not neutral" in said.split("the flight was not completed")[1]
    assert not copter.armed


class AnotherNumber(SimulatedCopter47):
    version = (4, 5)


@pytest.mark.parametrize("kind", [SimulatedCopter47, AnotherNumber], ids=["4.7 says so", "another number"])
def test_an_ardupilot_that_has_renamed_its_parameters_is_asked_for_the_newer_names(kind: type[SimulatedCopter]) -> None:
    """A name that it does not know is never answered, so the name of its version comes first."""
    copter, says = kind(VEHICLE), list[str]()
    meet_requirements(copter)
    copter.parameters["MAV_GCS_SYSID"] = 255.0

    async def fly(link: Link) -> None:
        assert await link.adapter.parameters(["RTL_ALT", "SYSID_MYGCS"]) == {"RTL_ALT": 1500.0, "SYSID_MYGCS": 255.0}
        async with requirements_met(link.adapter, True, says.append):
            assert link.px.autopilot.parameters["MAV_GCS_SYSID"] == 1.0

    with connected(copter) as link:
        asyncio.run(fly(link))
        assert link.px.autopilot.parameters["MAV_GCS_SYSID"] == 255.0
        assert ("SYSID_MYGCS" in link.px.parameters_asked_for) == (kind is AnotherNumber)
        assert "SYSID_MYGCS" not in link.px.autopilot.parameters


def test_parameters_that_a_killed_flight_left_are_named_at_the_next_contact_and_restored(
    quadctl: Callable[..., Result], tmp_path: Path
) -> None:
    copter, port = SimulatedCopter(VEHICLE), free_port()
    before = dict(copter.parameters)
    url, logs = f"udpin://127.0.0.1:{port}", tmp_path / "logs"
    check = ("check", "missions/short_hop.yaml", "--link", url, "--seconds", "1", "--log-dir", str(logs))
    ChangedParameters(logs, "system 9").note("RTL_ALT", Change(was=1500.0, set_to=0.0))
    with mock(copter, port) as wire:
        flight = Flight(logs, url, "--set-params")
        flight.until_recorded("hover")
        flight.process.kill()
        flight.process.communicate()
        assert wire.wait_until(lambda: not copter.armed, 30.0)  # its failsafe has landed it
        assert copter.parameters["GUID_OPTIONS"] == 8.0
        named = quadctl(*check)
        left = "GUID_OPTIONS = 8 was set for an earlier flight, which ended without restoring it: it was 0"
        assert f"warning  parameters   {left}, --restore-params restores it" in named.out.splitlines()
        assert "keeps old values for another vehicle too (system 9)" in named.out
        restored = quadctl(*check, "--restore-params")
        assert "ok       parameters   GUID_OPTIONS is 0 again." in restored.out.splitlines()
        assert copter.parameters == before
        kept = ChangedParameters(logs, "system 1, hardware 0000000000000001")
        assert (kept.read(), kept.others) == ({}, ["system 9"])
        assert "earlier flight" not in quadctl(*check).out


def test_a_flight_restores_what_an_earlier_one_left_behind(tmp_path: Path) -> None:
    says: list[str] = []

    async def fly(link: Link) -> None:
        async with requirements_met(link.adapter, True, says.append, kept=kept):
            assert kept.read()["SYSID_MYGCS"].was == 255.0  # before anything else happens

    with connected(SimulatedCopter(VEHICLE)) as link:
        kept = ChangedParameters(tmp_path, asyncio.run(link.adapter.identity()))
        kept.note("GUID_OPTIONS", Change(was=3.0, set_to=11.0))
        link.px.autopilot.parameters["GUID_OPTIONS"] = 11.0
        asyncio.run(fly(link))
        assert link.px.autopilot.parameters["GUID_OPTIONS"] == 3.0
    assert kept.read() == {}


def test_what_a_flight_of_one_vehicle_left_behind_is_not_offered_to_another(tmp_path: Path) -> None:
    async def left(link: Link) -> dict[str, Change]:
        return await still_changed(link.adapter, ChangedParameters(tmp_path, await link.adapter.identity()))

    ChangedParameters(tmp_path, "system 1, hardware 000000000000002a").note("GUID_OPTIONS", Change(was=3.0, set_to=0.0))
    for hardware, named in ((7, False), (42, True)):
        with connected(SimulatedCopter(VEHICLE), hardware=hardware) as link:
            assert ("GUID_OPTIONS" in asyncio.run(left(link))) == named
    with connected(SimulatedCopter(VEHICLE), hardware=0) as link:  # it tells none
        assert asyncio.run(link.adapter.identity()) == "system 1"


def test_the_failsafe_is_asked_to_watch_the_system_id_that_we_chose() -> None:
    says: list[str] = []

    async def fly(link: Link) -> None:
        async with requirements_met(link.adapter, True, says.append):
            assert link.px.autopilot.parameters["SYSID_MYGCS"] == 42.0

    with connected(SimulatedCopter(VEHICLE), own_system_id=42) as link:
        assert link.px.wait_until(lambda: bool(link.px.heartbeats_heard), TIMEOUT_S)
        assert {system for system, _ in link.px.heartbeats_heard} == {42}
        asyncio.run(fly(link))


@pytest.mark.parametrize(("system_id", "warned"), [(1, False), (250, True), (255, True)])
def test_a_system_id_that_others_use_is_a_warning(system_id: int, warned: bool) -> None:
    with connected(SimulatedCopter(VEHICLE), own_system_id=system_id) as link:
        asyncio.run(link.adapter.request_telemetry())
        assert any("would keep ArduPilot in the air" in warning for warning in link.adapter.warnings) == warned


def test_px4_is_told_to_trust_dead_reckoning_for_a_second_and_no_longer() -> None:
    says: list[str] = []

    async def fly(link: Link, set_parameters: bool) -> float:
        async with requirements_met(link.adapter, set_parameters, says.append):
            return link.px.autopilot.parameters["EKF2_NOAID_TOUT"]

    with connected(SimulatedAutopilot(VEHICLE)) as link:
        assert asyncio.run(fly(link, set_parameters=False)) == 5e6
        (warning,) = says
        assert warning.startswith("EKF2_NOAID_TOUT is 5000000 on PX4")
        assert "expected 1000000: the time in microseconds for which PX4 flies on by dead reckoning when GPS" in warning
        says.clear()
        assert asyncio.run(fly(link, set_parameters=True)) == 1e6
        assert link.px.autopilot.parameters["EKF2_NOAID_TOUT"] == 5e6
    assert says == [
        "EKF2_NOAID_TOUT is set from 5000000 to 1000000 for this flight.",
        "EKF2_NOAID_TOUT is 5000000 again.",
    ]


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
        "FS_GCS_ENABLE is set from 0 to 5 for this flight.",
        "SYSID_MYGCS is set from 255 to 1 for this flight.",
        "FS_GCS_TIMEOUT is set from 5 to 3 for this flight.",
        "GUID_OPTIONS is 3 again.",
        "GUID_TIMEOUT is 3 again.",
        "FS_GCS_ENABLE is 0 again.",
        "SYSID_MYGCS is 255 again.",
        "FS_GCS_TIMEOUT is 5 again.",
    ]


def test_what_had_better_be_set_is_a_warning() -> None:
    says: list[str] = []

    async def fly(link: Link) -> None:
        async with requirements_met(link.adapter, False, says.append):
            assert link.px.autopilot.parameters["GUID_TIMEOUT"] == 3.0

    with connected(SimulatedCopter(VEHICLE)) as link:
        meet_requirements(link.px.autopilot)
        link.px.autopilot.parameters["GUID_TIMEOUT"] = 3.0
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
    assert says[-5] == "GUID_OPTIONS could not be restored; set it to 0 by hand: the vehicle is still armed."


def test_a_fresh_ardupilot_sends_only_heartbeats_until_it_is_asked() -> None:
    with connected(SimulatedCopter(VEHICLE)) as link:
        asyncio.run(link.pass_time(1.0))
        assert not link.adapter.state().finite
        asyncio.run(link.adapter.request_telemetry())
        link.wait(lambda: link.adapter.state().finite)
        assert link.adapter.warnings == []
        assert link.adapter.state().texts == ()  # of nothing that it does not know


def test_refusals_come_with_ardupilots_reason() -> None:
    with connected(SimulatedCopter(VEHICLE)) as link:
        link.px.autopilot.ready_after_s = math.inf
        with pytest.raises(FlightError, match="refused to arm: FAILED; PreArm: EKF attitude is bad"):
            asyncio.run(link.adapter.arm())
        with pytest.raises(FlightError, match=r"refused to take off to 1 m: FAILED; Take-off needs GUIDED, armed"):
            asyncio.run(link.adapter.take_off(1.0))
