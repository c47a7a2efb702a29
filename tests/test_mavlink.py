"""The real MAVSDK against a PX4 on the wire: what the adapter reads, sends, and refuses to send."""

import asyncio
import math
import os
import select
import socket
import threading
import tty
from collections.abc import AsyncIterator, Awaitable, Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import asynccontextmanager, contextmanager, suppress
from dataclasses import replace
from pathlib import Path

import pytest
from mavsdk.component_type import ComponentType
from mavsdk.mavsdk import Configuration, Mavsdk
from mavsdk.plugins.param import Param
from pymavlink.dialects.v20 import common as mavlink

from quadctl.errors import FlightError, LinkError
from quadctl.flight import px4
from quadctl.flight.autopilot import Autopilot
from quadctl.flight.mavsdk_autopilot import MavsdkAutopilot
from quadctl.flight.telemetry import Telemetry
from quadctl.frames import quaternion_from_euler
from quadctl.state import AttitudeTarget, VehicleState
from quadctl.vehicle import Vehicle, load_vehicle
from sitl import dialect
from sitl.autopilot import SimulatedAutopilot
from sitl.faults import nan_position
from sitl.mavlink_px4 import MavlinkPx4

RAPTOR = Path(__file__).parents[1] / "config" / "vehicles" / "raptor.yaml"
LEVEL = (1.0, 0.0, 0.0, 0.0)
IDLE = AttitudeTarget(LEVEL, 0.0)
TIMEOUT_S = 15.0


def free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def hover_throttle(vehicle: Vehicle) -> float:
    return vehicle.throttle.offset + vehicle.throttle.per_newton * vehicle.weight_n


class Link:
    """One vehicle and one connected adapter."""

    def __init__(self, px: MavlinkPx4, adapter: MavsdkAutopilot) -> None:
        self.px = px
        self.adapter = adapter

    def wait(self, condition: Callable[[], bool]) -> None:
        assert self.px.wait_until(condition, TIMEOUT_S), f"still {self.adapter.state()}"

    async def until(self, condition: Callable[[VehicleState], bool]) -> VehicleState:
        """Wait until the adapter's state is such; the loop runs on."""
        await asyncio.to_thread(self.wait, lambda: condition(self.adapter.state()))
        return self.adapter.state()

    async def pass_time(self, seconds: float) -> None:
        """Let the vehicle's clock run."""
        end_s = self.px.autopilot.time_s + seconds
        await asyncio.to_thread(self.wait, lambda: self.px.autopilot.time_s >= end_s)


@contextmanager
def connected(autopilot: SimulatedAutopilot, n_rotors: int = 4) -> Iterator[Link]:
    port = free_port()
    adapter = MavsdkAutopilot(f"udpin://127.0.0.1:{port}", n_rotors)
    try:
        with MavlinkPx4(autopilot, port, heartbeat_hz=10.0) as px:  # PX4's 1 Hz would only make the tests wait
            asyncio.run(adapter.connect())
            yield Link(px, adapter)
    finally:
        asyncio.run(adapter.close())


class Stick:
    """Sends its target at 50 Hz."""

    def __init__(self, adapter: Autopilot) -> None:
        self._adapter = adapter
        self.target = IDLE
        self.sent = 0

    async def run(self) -> None:
        while True:
            self._adapter.send(self.target)
            self.sent += 1
            await asyncio.sleep(0.02)


@asynccontextmanager
async def streaming(link: Link) -> AsyncIterator[Stick]:
    """A stick whose targets have begun to arrive, released at the end."""
    stick = Stick(link.adapter)
    before = len(link.px.setpoints_received)
    task = asyncio.create_task(stick.run())
    try:
        await asyncio.to_thread(link.wait, lambda: len(link.px.setpoints_received) > before + 3)
        yield stick
    finally:
        task.cancel()
        with suppress(asyncio.CancelledError):
            await task


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


def test_the_rates_asked_for_are_the_rates_that_come(link: Link) -> None:
    asyncio.run(link.adapter.request_telemetry())
    assert link.adapter.warnings == []
    seen: dict[str, set[float]] = {"position": set(), "attitude": set(), "rpm": set(), "heartbeat": set()}
    begin_s = link.px.autopilot.time_s

    def one_second_watched() -> bool:
        for part, receipts in seen.items():
            receipts.add(link.adapter.state().received_s[part])
        return link.px.autopilot.time_s >= begin_s + 1.0

    link.wait(one_second_watched)
    counts = {part: len(receipts) for part, receipts in seen.items()}
    assert 75 <= counts["position"] <= 105  # 30 by default
    assert 75 <= counts["attitude"] <= 105  # 50 by default
    assert 20 <= counts["rpm"] <= 28  # 10 by default; 50 are asked for, the motors report 25
    assert 4 <= counts["heartbeat"] <= 7  # 10 before


def test_an_optional_message_refused_is_a_warning(link: Link) -> None:
    link.px.faults.withheld = frozenset({"ESC_STATUS"})
    asyncio.run(link.adapter.request_telemetry())
    (warning,) = link.adapter.warnings
    assert "ESC_STATUS at 50 Hz: FAILED" in warning


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


def test_without_heartbeats_the_link_counts_as_lost_though_data_come() -> None:
    telemetry = Telemetry(n_rotors=4)
    telemetry.receive("HEARTBEAT", {"autopilot": 12, "base_mode": 129, "custom_mode": 6 << 16}, now_s=10.0)
    telemetry.receive("SYS_STATUS", {"voltage_battery": 15000}, now_s=12.9)
    assert telemetry.state(now_s=12.9).connected
    telemetry.receive("SYS_STATUS", {"voltage_battery": 15000}, now_s=13.1)
    state = telemetry.state(now_s=13.1)
    assert not state.connected
    assert state.age_s("heartbeat") == pytest.approx(3.1)
    assert state.age_s("battery") == 0.0


def test_a_silent_link_ages(link: Link) -> None:
    link.wait(lambda: link.adapter.state().control_age_s < 0.1)
    link.px.faults.silent = True
    link.wait(lambda: link.adapter.state().control_age_s > 0.3)


def test_before_the_first_message_nothing_looks_like_data() -> None:
    state = Telemetry(n_rotors=4).state(now_s=100.0)
    assert not state.finite
    assert not state.connected
    assert len(state.rotor_rpm) == 4
    assert all(map(math.isnan, (*state.rotor_rpm, state.battery_v)))
    assert state.control_age_s == math.inf


def test_mode_names_are_read_from_the_custom_mode() -> None:
    assert px4.mode_name(6 << 16) == "OFFBOARD"
    assert px4.mode_name(4 << 16 | 6 << 24) == "LAND"
    assert px4.mode_name(9 << 16 | 1 << 24) == "9/1"


# --- connecting --------------------------------------------------------------------------------------------------


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


@contextmanager
def serial_line(port: int) -> Iterator[str]:
    """A serial device's name; what the autopilot sends to the UDP `port` comes out of it, and back."""
    autopilot_end, device = os.openpty()
    tty.setraw(device)
    stop_read, stop_write = os.pipe()
    udp = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    udp.bind(("127.0.0.1", port))

    def carry() -> None:
        peer = None
        while True:
            ready, _, _ = select.select([udp.fileno(), autopilot_end, stop_read], [], [])
            if stop_read in ready:
                return
            if udp.fileno() in ready:
                data, peer = udp.recvfrom(65536)
                os.write(autopilot_end, data)
            if autopilot_end in ready and peer is not None:
                udp.sendto(os.read(autopilot_end, 65536), peer)

    thread = threading.Thread(target=carry)
    thread.start()
    try:
        yield os.ttyname(device)
    finally:
        os.write(stop_write, b"x")
        thread.join()
        udp.close()
        for descriptor in (autopilot_end, device, stop_read, stop_write):
            os.close(descriptor)


def test_a_serial_link_carries_state_commands_and_targets(vehicle: Vehicle) -> None:
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

    with serial_line(port) as device, MavlinkPx4(SimulatedAutopilot(vehicle), port, heartbeat_hz=10.0) as px:
        asyncio.run(use(Link(px, MavsdkAutopilot(f"serial://{device}:921600", 4))))
    assert px.autopilot.mode == "OFFBOARD"


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


def test_an_autopilot_that_is_not_px4_is_left_alone(vehicle: Vehicle, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mavlink, "MAV_AUTOPILOT_PX4", mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA)
    with (
        pytest.raises(LinkError, match="is not PX4: its heartbeat says MAV_AUTOPILOT 3"),
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


def test_offboard_without_a_stream_is_refused_with_the_reason(link: Link) -> None:
    message = refusal(link.adapter.start_offboard)
    assert "refused to enter OFFBOARD: TEMPORARILY_REJECTED; no offboard setpoints are arriving." in message
    assert link.px.autopilot.mode == "HOLD"


def test_arming_in_offboard_without_a_stream_is_refused(link: Link) -> None:
    link.px.autopilot.parameters["COM_OF_LOSS_T"] = 60.0

    async def lose_the_stream() -> None:
        async with streaming(link):
            await link.adapter.start_offboard()
        await link.pass_time(0.6)
        await link.adapter.arm()

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
    hover = hover_throttle(link.px.autopilot.vehicle)

    async def fly() -> None:
        await link.adapter.request_telemetry()
        async with streaming(link) as stick:
            await link.adapter.start_offboard()
            assert link.adapter.state().mode == "OFFBOARD"
            await link.adapter.arm()
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


# --- the PX4 on the wire -----------------------------------------------------------------------------------------


def test_parameters_are_served_as_px4_does(vehicle: Vehicle) -> None:
    port = free_port()
    mavsdk = Mavsdk(Configuration.create_with_component_type(ComponentType.GROUND_STATION))
    try:
        mavsdk.add_any_connection_with_handle(f"udpin://127.0.0.1:{port}")
        with MavlinkPx4(SimulatedAutopilot(vehicle), port) as px:
            param = Param(mavsdk.first_autopilot(TIMEOUT_S))
            assert param.get_param_float("COM_OF_LOSS_T") == 1.0
            assert param.get_param_int("COM_OBL_RC_ACT") == 3
            param.set_param_float("COM_OF_LOSS_T", 2.5)
            param.set_param_int("COM_OBL_RC_ACT", 4)
            assert px.autopilot.parameters["COM_OF_LOSS_T"] == 2.5
            assert px.autopilot.parameters["COM_OBL_RC_ACT"] == 4.0
    finally:
        mavsdk.destroy()


def test_esc_status_survives_the_wire_of_pymavlink() -> None:
    dialect.register(mavlink)
    sent = dialect.EscStatus(4, 123456, [1, -2, 3, 40000], [16.5, 0.0, 1.0, 2.0], [0.5, 1.5, 2.5, 3.5])
    data = sent.pack(mavlink.MAVLink(None, srcSystem=1, srcComponent=1))
    (received,) = mavlink.MAVLink(None).parse_buffer(data)
    assert received.get_type() == "ESC_STATUS"
    assert (received.index, received.time_usec) == (4, 123456)
    assert received.rpm == [1, -2, 3, 40000]
    assert received.voltage == [16.5, 0.0, 1.0, 2.0]
    assert received.current == [0.5, 1.5, 2.5, 3.5]
