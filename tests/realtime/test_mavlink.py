"""The real MAVSDK against a PX4 on the wire: what the adapter reads, sends, and refuses to send."""

import asyncio
import errno
import math
import termios
import threading
from collections.abc import Awaitable, Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from quadctl.errors import FlightError, LinkError
from quadctl.flight.autopilot.mavsdk_autopilot import MavsdkAutopilot
from quadctl.frames import quaternion_from_euler
from quadctl.sitl.rules.px4 import SimulatedAutopilot
from quadctl.sitl.server.faults import nan_position
from quadctl.sitl.server.px4 import MavlinkPx4
from quadctl.sitl.vehicle.hidden import HiddenTruth
from quadctl.sitl.vehicle.hidden import Telemetry as SimulatedTelemetry
from quadctl.state import AttitudeTarget, VehicleState
from quadctl.vehicle import Vehicle, load_vehicle
from studies.serial_line import SerialLine
from tests.support.links import (
    IDLE,
    LEVEL,
    RAPTOR,
    TIMEOUT_S,
    Link,
    connected,
    free_port,
    mock,
    streaming,
)

pytestmark = pytest.mark.realtime


@pytest.fixture
def vehicle() -> Vehicle:
    return load_vehicle(RAPTOR)


@pytest.fixture
def link(vehicle: Vehicle) -> Iterator[Link]:
    with connected(SimulatedAutopilot(vehicle)) as link:
        yield link


# --- telemetry ---------------------------------------------------------------------------------------------------


class PosedAutopilot(SimulatedAutopilot):
    """Reports a state in which every number is different."""

    pose = VehicleState(
        time_s=0.0,
        position_ned_m=(1.5, -2.5, -3.25),
        velocity_ned_m_s=(0.5, -0.75, 1.25),
        attitude=quaternion_from_euler(0.1, 0.2, 0.3),
        rates_rad_s=(0.25, -0.5, 0.125),
        rotor_rpm=(1001.0, 2002.0, 3003.0, 4004.0, 5005.0, 6006.0),
        battery_v=15.321,
        armed=True,
        landed=False,
        mode="POSCTL",
    )

    def estimate(self) -> VehicleState:
        now = super().estimate()
        return replace(self.pose, time_s=now.time_s, received_s=now.received_s)


def test_every_part_of_the_state_arrives_in_its_place(vehicle: Vehicle) -> None:
    pose = PosedAutopilot.pose
    with connected(PosedAutopilot(vehicle), n_rotors=6) as link:
        link.wait(lambda: all(link.adapter.state().age_s(p) < 1.0 for p in ("position", "attitude", "rpm", "battery")))
        link.wait(lambda: not link.adapter.state().landed)
        state = link.adapter.state()
    assert state.position_ned_m == pose.position_ned_m
    assert state.velocity_ned_m_s == pose.velocity_ned_m_s
    assert state.attitude == pytest.approx(pose.attitude, abs=1e-6)
    assert state.rates_rad_s == pose.rates_rad_s
    assert state.rotor_rpm == pose.rotor_rpm
    assert len(state.motor_voltage_v) == 6
    assert all(map(math.isnan, state.motor_voltage_v))
    assert state.battery_v == pytest.approx(15.321)
    assert (state.armed, state.landed, state.mode, state.connected) == (True, False, "POSCTL", True)
    assert 0.0 <= state.control_age_s < 1.0


RATES_ASKED_FOR = {
    "position": (75, 105),  # 30 by default
    "attitude": (75, 105),  # 50 by default
    "rpm": (20, 28),  # 10 by default; 50 are asked for, the motors report 25
    "mode": (9, 14),  # 20 are asked for and two come, and each heartbeat tells it too
}
"""Least and largest number of messages in a second."""


def test_the_rates_asked_for_are_the_rates_that_come(link: Link) -> None:
    """In one second of five: on a busy machine this test itself misses messages."""
    asyncio.run(link.adapter.request_telemetry())
    assert link.adapter.warnings == []
    for _ in range(5):
        counts = messages_in_a_second(link)
        if all(low <= counts[part] <= high for part, (low, high) in RATES_ASKED_FOR.items()):
            return
    raise AssertionError(f"in the last of five seconds came {counts}")


def messages_in_a_second(link: Link) -> dict[str, int]:
    seen: dict[str, set[float]] = {part: set() for part in RATES_ASKED_FOR}
    begin_s = link.px.autopilot.time_s

    def one_second_watched() -> bool:
        for part, receipts in seen.items():
            receipts.add(link.adapter.state().received_s[part])
        return link.px.autopilot.time_s >= begin_s + 1.0

    link.wait(one_second_watched)
    return {part: len(receipts) for part, receipts in seen.items()}


def test_an_optional_message_refused_is_a_warning(link: Link) -> None:
    link.px.faults.withheld = frozenset({"SYS_STATUS"})
    asyncio.run(link.adapter.request_telemetry())
    (warning,) = link.adapter.warnings
    assert "SYS_STATUS at 5 Hz: FAILED" in warning


def test_without_rotor_speeds_the_source_of_thrust_is_named(vehicle: Vehicle) -> None:
    silent_motors = HiddenTruth(telemetry=SimulatedTelemetry(rotor_speeds=False))
    with connected(SimulatedAutopilot(vehicle, silent_motors)) as link:
        asyncio.run(link.adapter.request_telemetry())
        (warning,) = link.adapter.warnings
        state = link.adapter.state()
    assert "sends no rotor speeds: in the log, thrust is known from motor outputs." in warning
    assert all(map(math.isnan, state.rotor_rpm))
    assert state.motor_output == (0.0, 0.0, 0.0, 0.0)


def test_a_required_message_refused_is_an_error(link: Link) -> None:
    link.px.faults.withheld = frozenset({"LOCAL_POSITION_NED"})
    with pytest.raises(FlightError, match=r"refused to send LOCAL_POSITION_NED at 100 Hz: FAILED\.$"):
        asyncio.run(link.adapter.request_telemetry())


def test_a_position_of_nan_is_seen_as_such(link: Link) -> None:
    link.wait(lambda: link.adapter.state().finite)
    link.px.faults.distort = nan_position
    link.wait(lambda: not link.adapter.state().finite)
    assert all(map(math.isnan, link.adapter.state().position_ned_m))
    assert all(map(math.isfinite, link.adapter.state().velocity_ned_m_s))


def test_a_silent_link_ages(link: Link) -> None:
    link.wait(lambda: link.adapter.state().control_age_s < 0.1)
    link.px.faults.silent = True
    link.wait(lambda: link.adapter.state().control_age_s > 0.3)


# --- connecting --------------------------------------------------------------------------------------------------


def test_a_second_autopilot_on_the_port_is_a_warning(vehicle: Vehicle) -> None:
    with connected(SimulatedAutopilot(vehicle)) as link:
        second = mock(SimulatedAutopilot(vehicle), link.px.address[1])
        second._mav.srcSystem = 2
        with second:
            link.wait(lambda: link.adapter._link.other_autopilots == [2])
            asyncio.run(link.adapter.request_telemetry())
    (warning,) = [said for said in link.adapter.warnings if "Another autopilot" in said]
    assert "(system 2)" in warning
    assert "quadctl flies system 1" in warning


@pytest.mark.parametrize("url", ["udpin://127.0.0.1:99999", "tcpout://127.0.0.1:0", "udpout://127.0.0.1:65536"])
def test_a_port_that_does_not_exist_is_said(url: str) -> None:
    assert connect_error(url).endswith("expected one from 1 to 65535.")


def connect_error(url: str) -> str:
    async def attempt() -> None:
        adapter = MavsdkAutopilot(url, 4, connect_timeout_s=0.3)
        try:
            await adapter.connect()
        finally:
            await adapter.close()

    with pytest.raises(LinkError) as error:
        asyncio.run(attempt())
    return str(error.value)


@pytest.mark.parametrize("scheme", ["udpin", "tcpout"])
def test_nobody_answers(scheme: str) -> None:
    url = f"{scheme}://127.0.0.1:{free_port()}"
    assert connect_error(url).startswith(f"No autopilot answers at {url} within 0.3 s: check ")


def test_a_serial_link_carries_state_commands_and_targets(vehicle: Vehicle, tmp_path: Path) -> None:
    port = free_port()

    async def use(link: Link) -> None:
        try:
            await link.adapter.connect()
            await link.adapter.request_telemetry()
            await link.until(lambda s: s.finite)
            async with streaming(link):
                await link.adapter.start_offboard()
        finally:
            await link.adapter.close()

    with SerialLine(tmp_path / "tty", port) as line, mock(SimulatedAutopilot(vehicle), port) as px:
        adapter = MavsdkAutopilot(f"serial://{line.device}:921600", 4)
        asyncio.run(use(Link(px, adapter)))
        assert line.least_read == 1  # with 0, MAVSDK reads nothing without end
    assert px.autopilot.mode == "OFFBOARD"
    assert adapter.warnings == []


def test_a_serial_line_that_costs_a_core_is_a_warning(
    vehicle: Vehicle, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object) -> None:
        raise termios.error(errno.EIO, "Input/output error")

    port = free_port()
    with SerialLine(tmp_path / "tty", port) as line, mock(SimulatedAutopilot(vehicle), port):
        monkeypatch.setattr(termios, "tcsetattr", refuse)
        adapter = MavsdkAutopilot(f"serial://{line.device}:921600", 4)
        try:
            asyncio.run(adapter.connect())
        finally:
            asyncio.run(adapter.close())
    (warning,) = adapter.warnings
    assert warning.startswith(f"{line.device} does not let reads wait for data (VMIN 1 cannot be set): ")


def test_a_serial_device_that_is_not_there() -> None:
    message = connect_error("serial:///dev/no-such-tty:921600")
    assert message.startswith("The link serial:///dev/no-such-tty:921600 cannot be opened (")
    assert "baud rate" in message


@pytest.mark.parametrize(
    "url", ["", "14540", "udpin://:14540", "udpin://127.0.0.1", "serial:///dev/ttyAMA0", "http://host:80"]
)
def test_a_url_that_is_none(url: str) -> None:
    assert f"The link {url!r} is not one that can be opened: expected udpin://" in connect_error(url)


def test_the_outdated_scheme_names_its_successor() -> None:
    assert "say udpin://0.0.0.0:14540 " in connect_error("udp://:14540")


def test_an_autopilot_of_an_unknown_kind_is_left_alone(vehicle: Vehicle, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mavlink, "MAV_AUTOPILOT_PX4", mavlink.MAV_AUTOPILOT_PPZ)
    with (
        pytest.raises(LinkError, match=r"its heartbeat says MAV_AUTOPILOT 9, expected 12 \(PX4\) or 3 \(ArduPilot\)"),
        connected(SimulatedAutopilot(vehicle)),
    ):
        pass


def test_before_connecting_nothing_can_be_sent() -> None:
    adapter = MavsdkAutopilot("udpin://127.0.0.1:14540", 4)
    with pytest.raises(LinkError, match="connect first"):
        adapter.send(IDLE)


# --- commanding --------------------------------------------------------------------------------------------------


def refusal(request: Callable[[], Awaitable[None]]) -> str:
    async def ask() -> None:
        await request()

    with pytest.raises(FlightError) as error:
        asyncio.run(ask())
    return str(error.value)


def test_offboard_without_a_stream_is_refused_with_the_reason_once_it_is_armed(link: Link) -> None:
    asyncio.run(link.adapter.arm())
    message = refusal(link.adapter.start_offboard)
    assert "refused to enter OFFBOARD: TEMPORARILY_REJECTED; no offboard setpoints are arriving." in message
    assert link.px.autopilot.mode == "HOLD"


def test_arming_in_offboard_without_a_stream_is_refused(link: Link) -> None:
    link.px.autopilot.parameters["COM_OF_LOSS_T"] = 60.0

    async def lose_the_stream() -> None:
        async with streaming(link):
            await link.adapter.start_offboard()
        await link.pass_time(0.6)
        await link.arm()

    assert "refused to arm: TEMPORARILY_REJECTED; no offboard setpoints" in refusal(lose_the_stream)
    assert not link.px.autopilot.armed


def test_what_the_autopilot_says_about_a_refusal_reaches_the_user(link: Link) -> None:
    link.px.faults.refuse_arming = "Preflight Fail: no valid position"
    assert "refused to arm: TEMPORARILY_REJECTED; Preflight Fail: no valid position." in refusal(link.adapter.arm)


def test_an_autopilot_that_does_not_answer_a_command(link: Link) -> None:
    link.px.faults.deaf = True
    assert "was asked to arm: no answer; check the link." in refusal(link.adapter.arm)


def test_offboard_arm_climb_roll_land(link: Link) -> None:
    link.px.autopilot.parameters["COM_DISARM_LAND"] = 0.3
    hover = link.px.autopilot.vehicle.hover_throttle

    async def fly() -> None:
        await link.adapter.request_telemetry()
        async with streaming(link) as stick:
            await link.adapter.start_offboard()
            assert link.adapter.state().mode == "OFFBOARD"
            await link.arm()
            assert link.adapter.state().armed
            stick.target = AttitudeTarget(LEVEL, 1.12 * hover)
            climbing = await link.until(lambda s: s.position_ned_m[2] < -0.6)
            assert climbing.velocity_ned_m_s[2] < 0.0
            assert min(climbing.rotor_rpm) > 1000.0
            assert not (await link.until(lambda s: not s.landed)).landed
            stick.target = AttitudeTarget(quaternion_from_euler(math.radians(12.0), 0.0, 0.0), hover)
            rolling = await link.until(lambda s: s.attitude[1] > math.sin(math.radians(4.0)))
            assert rolling.rates_rad_s[0] > 0.0
            await link.until(lambda s: s.velocity_ned_m_s[1] > 0.3)  # roll right goes east when facing north
            await link.adapter.land()
            assert link.adapter.state().mode == "LAND"
        down = await link.until(lambda s: s.landed and not s.armed)
        assert abs(down.position_ned_m[2]) < 0.2

    asyncio.run(fly())


def test_a_crowded_executor_delays_no_command(link: Link) -> None:
    async def ask() -> None:
        crowded = ThreadPoolExecutor(1)
        asyncio.get_running_loop().set_default_executor(crowded)
        release = threading.Event()
        crowded.submit(release.wait)
        try:
            await asyncio.wait_for(link.adapter.land(), TIMEOUT_S)
        finally:
            release.set()

    asyncio.run(ask())
    assert link.adapter.state().mode == "LAND"


@pytest.mark.parametrize("what", ["land", "arm"])
def test_a_request_that_nobody_answers_leaves_once(link: Link, what: str) -> None:
    """A repetition would take the mode back from whoever has taken it since, or arm what was disarmed."""
    heard: list[int] = []
    link.px._on_message["COMMAND_LONG"] = lambda message: heard.append(message.command)

    async def ask() -> None:
        with pytest.raises(LinkError, match="no answer"):
            await getattr(link.adapter, what)()
        await link.pass_time(1.2)  # MAVSDK repeats its commands after 0.5 s

    asyncio.run(ask())
    assert len(heard) == 1


def test_hold_hands_over(link: Link) -> None:
    async def hand_over() -> None:
        async with streaming(link):
            await link.adapter.start_offboard()
            await link.adapter.hold()

    asyncio.run(hand_over())
    assert link.adapter.state().mode == "HOLD"


# --- setpoints ---------------------------------------------------------------------------------------------------


def test_a_target_arrives_as_it_was_sent(link: Link) -> None:
    target = AttitudeTarget(quaternion_from_euler(0.1, -0.2, 0.3), 0.625)
    link.adapter.send(target)
    link.wait(lambda: len(link.px.setpoints_received) == 1)
    received = link.px.setpoints_received[0].target
    assert received.attitude == pytest.approx(target.attitude, abs=1e-6)
    assert received.throttle == target.throttle


def test_when_the_calls_stop_the_wire_is_silent_and_px4_notices(link: Link) -> None:
    async def stop_sending() -> int:
        async with streaming(link) as stick:
            await link.adapter.start_offboard()
            await link.arm()
        await link.until(lambda s: s.mode == "RTL")
        await link.pass_time(0.5)
        return int(stick.sent)

    assert asyncio.run(stop_sending()) == len(link.px.setpoints_received)


BAD_TARGETS = [
    AttitudeTarget((math.nan, 0.0, 0.0, 0.0), 0.5),
    AttitudeTarget((math.inf, 0.0, 0.0, 0.0), 0.5),
    AttitudeTarget((0.0, 0.0, 0.0, 0.0), 0.5),
    AttitudeTarget((1.0, 0.1, 0.0, 0.0), 0.5),
    AttitudeTarget(LEVEL, math.nan),
    AttitudeTarget(LEVEL, math.inf),
    AttitudeTarget(LEVEL, -0.01),
    AttitudeTarget(LEVEL, 1.01),
]


def test_what_cannot_be_flown_never_leaves(link: Link) -> None:
    for target in BAD_TARGETS:
        with pytest.raises(FlightError, match="was not sent: expected"):
            link.adapter.send(target)
    link.adapter.send(IDLE)
    link.wait(lambda: len(link.px.setpoints_received) > 0)
    assert [s.target for s in link.px.setpoints_received] == [IDLE]


# --- the mode ------------------------------------------------------------------------------------------------------


def test_between_two_heartbeats_a_mode_taken_for_a_moment_is_seen(vehicle: Vehicle) -> None:
    """Heartbeats come every second, and PX4 does not let that be changed."""
    port = free_port()

    async def watch(px: MavlinkPx4, adapter: MavsdkAutopilot) -> None:
        try:
            await adapter.connect()
            await adapter.request_telemetry()
            assert adapter.warnings == []
            link, sent = Link(px, adapter), px.heartbeats_sent
            await asyncio.to_thread(link.wait, lambda: px.heartbeats_sent > sent)
            assert px.autopilot.request_mode("POSCTL") is None
            await link.until(lambda s: s.mode == "POSCTL")
            assert px.autopilot.request_mode("HOLD") is None
            await link.until(lambda s: s.mode == "HOLD")
            assert px.heartbeats_sent == sent + 1
        finally:
            await adapter.close()

    with MavlinkPx4(SimulatedAutopilot(vehicle), port) as px:
        asyncio.run(watch(px, MavsdkAutopilot(f"udpin://127.0.0.1:{port}", 4)))


def test_where_heartbeats_alone_tell_the_mode_that_is_a_warning(link: Link) -> None:
    link.px.faults.withheld = frozenset({"CURRENT_MODE"})
    asyncio.run(link.adapter.request_telemetry())
    (warning,) = link.adapter.warnings
    assert warning.endswith(
        "refused to send CURRENT_MODE at 20 Hz: FAILED. "
        "A change of mode is seen after up to a second, a short one never."
    )


# --- the PX4 on the wire -----------------------------------------------------------------------------------------


def test_parameters_are_read_and_set_whatever_their_type(link: Link) -> None:
    parameters = link.px.autopilot.parameters
    parameters["COM_OBL_RC_ACT"] = -1.0  # an integer, whose bytes are no number as a float

    async def use() -> dict[str, float]:
        before = await link.adapter.parameters(["COM_OF_LOSS_T", "COM_OBL_RC_ACT"])
        await link.adapter.set_parameter("COM_OF_LOSS_T", 2.5)
        await link.adapter.set_parameter("COM_OBL_RC_ACT", 4.0)
        return before

    assert asyncio.run(use()) == {"COM_OF_LOSS_T": 1.0, "COM_OBL_RC_ACT": -1.0}
    assert (parameters["COM_OF_LOSS_T"], parameters["COM_OBL_RC_ACT"]) == (2.5, 4.0)
    assert "did not tell its NO_SUCH_THING" in refusal(lambda: link.adapter.set_parameter("NO_SUCH_THING", 1.0))
