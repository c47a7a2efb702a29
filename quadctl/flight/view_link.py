"""The flight's end of the live view: a record of each tick goes out, one wish may come in, and nothing ever waits.

Two UDP sockets of this machine's loopback, connected to each other: what a viewer does not take is dropped, and a
viewer that is dead costs one failing call. The wish to land counts only with the token that the flight made.
"""

import contextlib
import hmac
import json
import math
import secrets
import socket
from typing import NamedTuple

from quadctl.flight.pilot import Pilot
from quadctl.flight.tick import Event, Tick
from quadctl.frames import tilt
from quadctl.state import NAN

EVENTS_KEPT = 20
"""Every record holds the last events, so that none is lost with a record that is dropped."""
LANDED_BY = "asked to land on the live view"
TOKEN_BYTES = 16
WISH_BYTES = 256
LOOPBACK = "127.0.0.1"


class Record(NamedTuple):
    """One tick as the viewer gets it; height and distance from the ground at take-off, ages against the tick's time."""

    time_s: float
    """Since the first tick."""
    stage: str
    """Name of a `Stage`."""
    phase: str
    flight_s: float
    """Time in the mission."""
    height_m: float
    height_ref_m: float
    distance_m: float
    """Horizontal, from the take-off point."""
    speed_m_s: float
    tilt_deg: float
    throttle: float
    thrust_n: float
    battery_v: float
    late_s: float
    state_age_s: float
    """Of the older one of position and attitude."""
    link_age_s: float
    """Since the last heartbeat."""
    estimator_ratio: float
    armed: bool
    mode: str
    ended: str
    """Why the flight ends; empty while it goes on."""
    events: tuple[Event, ...]


class ViewEnd(NamedTuple):
    """One end of the link, and the word that counts on it."""

    socket: socket.socket
    token: str

    def wish_to_land(self) -> bytes:
        return f"land {self.token}".encode()


def connected_ends() -> tuple[ViewEnd, ViewEnd]:
    """The flight's end and the viewer's; the kernel lets nobody else's datagrams through."""
    token = secrets.token_hex(TOKEN_BYTES)
    flight, viewer = (ViewEnd(socket.socket(socket.AF_INET, socket.SOCK_DGRAM), token) for _ in range(2))
    for end in (flight, viewer):
        end.socket.bind((LOOPBACK, 0))
        end.socket.setblocking(False)
    flight.socket.connect(viewer.socket.getsockname())
    viewer.socket.connect(flight.socket.getsockname())
    return flight, viewer


def encoded(record: Record) -> bytes:
    return json.dumps(record).encode()


def decoded(data: bytes) -> Record:
    record = Record(*json.loads(data))
    return record._replace(events=tuple(Event(*event) for event in record.events))


class ViewLink:
    """A listener of the loop that never blocks and never raises: a view is not worth a flight."""

    def __init__(self, end: ViewEnd, pilot: Pilot) -> None:
        self._socket = end.socket
        self._wish = end.wish_to_land()
        self._pilot = pilot
        self._events: tuple[Event, ...] = ()
        self._asked = False

    def __call__(self, tick: Tick) -> None:
        with contextlib.suppress(Exception):  # nobody there, no room, or a defect of ours
            self._send(tick)
        with contextlib.suppress(Exception):  # most of the time: nothing came
            self._hear()

    def _send(self, tick: Tick) -> None:
        if tick.events:
            self._events = (*self._events, *tick.events)[-EVENTS_KEPT:]
        self._socket.send(encoded(_record(tick, self._pilot, self._events)))

    def _hear(self) -> None:
        """At most one word a tick. The wish counts once: repeated after a release, it would end the recording."""
        word = self._socket.recv(WISH_BYTES)
        if hmac.compare_digest(word, self._wish) and not self._asked:
            self._asked = True
            self._pilot.ask_to_land(LANDED_BY)


def _record(tick: Tick, pilot: Pilot, events: tuple[Event, ...]) -> Record:
    state = tick.state
    return Record(
        time_s=tick.time_s,
        stage=tick.stage.name,
        phase=tick.phase,
        flight_s=pilot.flight_s,
        height_m=tick.ground_down_m - state.position_ned_m[2],
        height_ref_m=tick.ground_down_m - tick.setpoint.position_ned_m[2] if tick.setpoint else NAN,
        distance_m=pilot.distance_m(state),
        speed_m_s=math.hypot(*state.velocity_ned_m_s),
        tilt_deg=math.degrees(tilt(state.attitude)),
        throttle=tick.target.throttle if tick.target else NAN,
        thrust_n=tick.output.thrust_n if tick.output else NAN,
        battery_v=state.battery_v,
        late_s=tick.late_s,
        state_age_s=state.control_age_s,
        link_age_s=state.age_s("heartbeat"),
        estimator_ratio=state.estimator_ratio,
        armed=state.armed,
        mode=state.mode,
        ended=pilot.ended,
        events=events,
    )
