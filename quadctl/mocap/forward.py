"""Poses from a source to the autopilot's estimator, each judged before it leaves.

They leave as VISION_POSITION_ESTIMATE, the one message of its kind that both PX4's EKF2 and ArduPilot's EKF3 take.
"""

import asyncio
import math
import signal
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from functools import partial
from types import FrameType
from typing import Any, NamedTuple

from rich.console import Console

from quadctl.errors import FlightError, LinkError
from quadctl.flight.autopilot import mavlink
from quadctl.flight.autopilot.mavsdk_link import MavsdkLink
from quadctl.flight.autopilot.telemetry import Telemetry
from quadctl.frames import euler_from_quaternion
from quadctl.mocap.agreement import Motion, tilt_problem, yaw_problem
from quadctl.mocap.axes import FRAMES, to_ned
from quadctl.mocap.findings import Kind
from quadctl.mocap.gate import Gate, Pose
from quadctl.mocap.sources import Source
from quadctl.mocap.statistics import Flow
from quadctl.state import NAN, Quat, Vec3, VehicleState
from quadctl.words import Fact

STREAMS = {"ATTITUDE_QUATERNION": (31, 20.0), "LOCAL_POSITION_NED": (32, 10.0)}
"""Messages that are compared with the poses: id and rate, Hz."""
ORIGIN = "GPS_GLOBAL_ORIGIN"
MESSAGES = (*STREAMS, "HEARTBEAT")
CONNECT_S = 10.0
FIRST_POSE_S = 10.0
LOST_S = 0.2
"""Without a pose that may pass, so long, the body counts as lost."""
ATTITUDE_AGE_S = 0.5
ATTITUDE_WAIT_S = 1.0
"""For the first attitude, so that the first pose is compared already."""
DISAGREE_S = 0.5
"""For so long the tilts may disagree: a quick turn is no wrong axis."""
LEAST_HZ = 50.0
ORIGIN_WAIT_S = 0.5
"""For the autopilot to tell its origin, after each question."""
ORIGIN_TRIES = 3
RATE_AFTER = 100
"""Poses, until the rate is judged."""
SHOW_EVERY_S = 0.5


class Origin(NamedTuple):
    """Place of the origin of the autopilot's frame on the globe."""

    latitude_deg: float
    longitude_deg: float
    altitude_m: float
    """Above the sea."""

    def fields(self, system_id: int) -> dict[str, int]:
        """Fields of SET_GPS_GLOBAL_ORIGIN."""
        return {
            "target_system": system_id,
            "latitude": round(1e7 * self.latitude_deg),
            "longitude": round(1e7 * self.longitude_deg),
            "altitude": round(1e3 * self.altitude_m),
        }


class Forwarder:
    """Judges, converts and sends poses; keeps what there is to say."""

    def __init__(
        self, send: Callable[[dict[str, object]], None], state: Callable[[], VehicleState], frame: str, yaw_rad: float
    ) -> None:
        self.flow = Flow()
        self.problem: Fact | None = None
        """The axes contradict the autopilot's attitude: nothing is sent as long as this says so."""
        self.agreed = False
        """The tilts have been compared and agree."""
        self._send = send
        self._state = state
        self._frame = frame
        self._yaw_rad = yaw_rad
        self._gate = Gate()
        self._motion = Motion()
        self._agreed_s = math.nan
        self._heading_checked = False
        self._heard = True

    def take(self, pose: Pose, now_s: float) -> list[Fact]:
        """One pose: send it or withhold it. Gives warnings, nearly always none."""
        objection = self._gate.objection(pose, now_s)
        if objection is not None:
            self.flow.withheld[objection] += 1
            return []
        position, attitude = to_ned(pose.position, pose.quaternion, FRAMES[self._frame], self._yaw_rad)
        warnings = self._compared(pose, position, attitude)
        if self.problem:
            self.flow.withheld[Kind.OTHER_AXES] += 1
        elif self._sent(pose, position, attitude):
            self.flow.add(now_s, self._gate.age_s(pose, now_s))
        else:
            self.flow.withheld[Kind.LINK_DOWN] += 1
        return [warning for warning in warnings if warning is not None]

    def _compared(self, pose: Pose, position: Vec3, attitude: Quat) -> list[Fact | None]:
        """Differences between the autopilot's estimate and the pose."""
        state = self._state()
        warnings: list[Fact | None] = []
        if state.connected != self._heard:
            self._heard = state.connected
            warnings.append(Fact(Kind.HEARD_AGAIN if self._heard else Kind.SILENT))
        if state.age_s("attitude") < ATTITUDE_AGE_S and all(map(math.isfinite, state.attitude)):
            self._judge_tilt(tilt_problem(pose.quaternion, self._frame, state.attitude), pose.received_s)
            if not self._heading_checked:
                self._heading_checked = True
                warnings.append(yaw_problem(attitude, state.attitude))
        if not self.problem:
            warnings.append(self._motion.problem(position, state.position_ned_m))
        return warnings

    def _sent(self, pose: Pose, position: Vec3, attitude: Quat) -> bool:
        """False where the link is down: a serial line that was pulled out is opened again when it is back."""
        roll, pitch, heading = euler_from_quaternion(attitude)
        x, y, z = position
        fields = {"usec": int(1e6 * pose.received_s), "x": x, "y": y, "z": z, "roll": roll, "pitch": pitch}
        unknown = [None] * 21  # covariance: null is MAVLink's nan
        try:
            self._send({**fields, "yaw": heading, "covariance": unknown, "reset_counter": 0})
        except LinkError:
            return False
        return True

    def _judge_tilt(self, problem: Fact | None, now_s: float) -> None:
        if problem is None:
            self.agreed, self._agreed_s, self.problem = True, now_s, None
        elif not self.agreed or now_s - self._agreed_s > DISAGREE_S:
            self.problem = problem


def forward(
    url: str,
    source: Source,
    frame: str,
    yaw_rad: float,
    console: Console,
    stop: threading.Event,
    origin: Origin | None = None,
) -> Flow:
    """Forward poses to the autopilot at `url` until `stop`, Ctrl-C or SIGTERM.

    An autopilot whose frame has no place on the globe is given `origin`.

    Raises
    ------
    LinkError
        The autopilot or the motion-capture system does not answer.
    FlightError
        The axes contradict the autopilot's attitude from the beginning.
    """
    telemetry = Telemetry(n_rotors=4)
    told = threading.Event()

    def receive(name: str, fields: Mapping[str, Any], now_s: float) -> None:
        if name == ORIGIN:
            told.set()
        else:
            telemetry.receive(name, fields, now_s)

    link = MavsdkLink(url, receive, mavlink.MOCAP_SYSTEM_ID)
    try:
        with console.status("waiting for the autopilot"):
            asyncio.run(_open(link, telemetry))
            said = _give_origin(link, origin, told)
        console.print(str(said), soft_wrap=True, markup=False, highlight=False)
        forwarder = Forwarder(
            partial(link.send, "VISION_POSITION_ESTIMATE"),
            lambda: telemetry.state(time.monotonic()),
            frame,
            yaw_rad,
        )
        with source, _stopping_on_signals(stop):
            _run(forwarder, source, console, stop)
        return forwarder.flow
    finally:
        asyncio.run(link.close())


async def _open(link: MavsdkLink, telemetry: Telemetry) -> None:
    await link.open((*MESSAGES, ORIGIN), CONNECT_S)
    for name, (number, rate_hz) in STREAMS.items():
        ask = partial(link.command, mavlink.CMD_SET_MESSAGE_INTERVAL, number, 1e6 / rate_hz, what=f"send {name}")
        await link.run(ask)
    end_s = time.monotonic() + ATTITUDE_WAIT_S
    while time.monotonic() < end_s and not all(map(math.isfinite, telemetry.state(0.0).attitude)):
        await asyncio.sleep(0.02)


def _give_origin(link: MavsdkLink, origin: Origin | None, told: threading.Event) -> Fact:
    """Give the autopilot's frame a place on the globe, if it has none; return what was done."""
    if _has_origin(link, told):
        return Fact(Kind.HAS_ORIGIN)
    if origin is None:
        return Fact(Kind.NO_ORIGIN)
    for _ in range(ORIGIN_TRIES):
        with suppress(LinkError):
            link.send("SET_GPS_GLOBAL_ORIGIN", origin.fields(link.system_id))
        if _has_origin(link, told):
            return Fact(Kind.TOOK_ORIGIN)
    return Fact(Kind.ORIGIN_UNTOLD)


def _has_origin(link: MavsdkLink, told: threading.Event) -> bool:
    """True when the autopilot tells its origin, after a question."""
    with suppress(LinkError):
        link.command(mavlink.CMD_REQUEST_MESSAGE, mavlink.GPS_GLOBAL_ORIGIN_ID, what="tell its origin")
    return told.wait(ORIGIN_WAIT_S)


def _run(forwarder: Forwarder, source: Source, console: Console, stop: threading.Event) -> None:
    def say(sentence: str, style: str = "yellow") -> None:
        console.print(sentence, style=style, soft_wrap=True, markup=False, highlight=False)

    begin_s = time.monotonic()
    first_pose_s = math.inf
    sent_s, lost, slow_said, shown_s = NAN, False, False, begin_s
    with console.status("waiting for the first pose") as status:
        while not stop.is_set():
            pose = source.receive(0.05)
            now_s = time.monotonic()
            if pose is not None:
                first_pose_s = min(first_pose_s, now_s)
            before = forwarder.flow.sent
            for warning in forwarder.take(pose, now_s) if pose is not None else ():
                say(f"warning: {warning}")
            if forwarder.flow.sent > before:
                if before == 0:
                    say("forwarding" if forwarder.agreed else "forwarding, with axes not compared yet", "green")
                elif lost:
                    say(f"back after {now_s - sent_s:.2f} s", "green")
                sent_s, lost = now_s, False
            elif before == 0:
                _check_beginning(forwarder, source, now_s - begin_s, now_s - first_pose_s)
            elif not lost and now_s - sent_s > LOST_S:
                lost = True
                why = forwarder.problem or "no new pose comes that may pass"
                say(f"lost: {why}; nothing is sent, and the autopilot's own failsafe acts", "red")
            if not slow_said and forwarder.flow.sent > RATE_AFTER and forwarder.flow.rate_hz() < 0.95 * LEAST_HZ:
                slow_said = True
                say(f"warning: poses come at {forwarder.flow.rate_hz():.0f} Hz, expected {LEAST_HZ:g} Hz or more")
            if now_s - shown_s > SHOW_EVERY_S:
                shown_s = now_s
                status.update(forwarder.flow.line())


def _check_beginning(forwarder: Forwarder, source: Source, waited_s: float, since_first_s: float) -> None:
    """Before the first pose was sent: refuse what will not become right by itself."""
    if forwarder.problem and since_first_s > DISAGREE_S:
        raise FlightError(f"Nothing is forwarded: {forwarder.problem}.")
    if waited_s > FIRST_POSE_S:
        withheld = forwarder.flow.withheld_in_words()
        others = ", ".join(sorted(source.others)[:5]) or "nothing at all"
        seen = f"what came was withheld: {withheld}" if withheld else f"seen: {others}"
        raise LinkError(f"No pose that may pass came within {FIRST_POSE_S:g} s ({seen}): check --body and --source.")


@contextmanager
def _stopping_on_signals(stop: threading.Event) -> Iterator[None]:
    """Ctrl-C and SIGTERM are the ordinary end. Only the main thread may catch them."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def handler(_: int, __: FrameType | None) -> None:
        stop.set()

    before = {number: signal.signal(number, handler) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield
    finally:
        for number, old in before.items():
            signal.signal(number, old)
