"""The flight's end of the live view: records go out ten times a second, a wish may come in, and nothing blocks.

A pair of sockets that have no address, so that nobody but the flight and its viewer can speak on them: what a viewer
does not take is dropped, and a viewer that is dead costs one failing call.
"""

import contextlib
import math
import pickle
import socket
from typing import NamedTuple, TypeAlias

from quadctl.flight.pilot.pilot import Pilot
from quadctl.flight.pilot.tick import Event, Stage, Tick
from quadctl.frames import tilt
from quadctl.state import NAN, NO_VECTOR, Quat, Vec3

SEND_S = 0.1
"""Interval of the records: as often as a page can show them, so that most ticks cost nothing."""
EVENTS_KEPT = 20
"""Number of last events in every record, so that none is lost with a record that is dropped."""
LANDED_BY = "asked to land on the live view"
WISH_TO_LAND = b"land"
WORD_BYTES, RECORD_BYTES = 16, 65_536
"""Size of the buffer, bytes: more than any word or record has."""

ViewEnd: TypeAlias = socket.socket
"""One end of the link: a non-blocking socket for datagrams."""


class Record(NamedTuple):
    """A tick as the viewer gets it; height and distance from the ground at take-off, ages against the tick's time."""

    time_s: float
    """Time since the first tick."""
    stage: str
    """Name of a `Stage`."""
    phase: str
    flight_s: float
    """Time in the mission, s."""
    height_m: float
    height_ref_m: float
    north_m: float
    """Position in the frame of the autopilot, as `east_m` and their setpoints."""
    east_m: float
    north_ref_m: float
    east_ref_m: float
    attitude: Quat
    """From body (FRD) to world (NED)."""
    distance_m: float
    """Horizontal distance from the take-off point."""
    speed_m_s: float
    tilt_deg: float
    throttle: float
    thrust_n: float
    battery_v: float
    late_s: float
    """Largest lateness since the last record that was not dropped."""
    state_age_s: float
    """Age of the older one of position and attitude."""
    link_age_s: float
    """Age of the latest word of the autopilot about its mode."""
    estimator_ratio: float
    horizontal_std_m: float
    vertical_std_m: float
    residual_m_s2: Vec3
    """Specific force beyond the model that flies, FRD."""
    expected_m_s2: float
    """Half of the 95 % interval in which that was for the data of the fit; nan where it is not known."""
    changes: tuple[str, ...]
    """Changes of the vehicle against the model."""
    armed: bool
    mode: str
    ended: str
    """Reason why the flight ends; empty while it goes on."""
    events: tuple[Event, ...]


def connected_ends() -> tuple[ViewEnd, ViewEnd]:
    """Make the flight's end and the viewer's end."""
    flight, viewer = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)
    flight.setblocking(False)
    viewer.setblocking(False)
    return flight, viewer


def next_record(viewer: ViewEnd) -> Record | None:
    """The oldest record that waits; None where none does. Raises OSError where the flight's end is closed."""
    try:
        record: Record = pickle.loads(viewer.recv(RECORD_BYTES))  # nobody else can have sent it
    except BlockingIOError:
        return None
    return record


class ViewLink:
    """Listener of the loop that never blocks and never raises, so that the view cannot disturb the flight."""

    def __init__(self, end: ViewEnd, pilot: Pilot) -> None:
        self._end = end
        self._pilot = pilot
        self._events: tuple[Event, ...] = ()
        self._late_s = 0.0
        """Largest lateness of the ticks since the last record that was sent."""
        self._due_s = -math.inf
        self._asked = False

    def __call__(self, tick: Tick) -> None:
        self._events = (*self._events, *tick.events)[-EVENTS_KEPT:]
        self._late_s = max(self._late_s, tick.late_s)
        if tick.time_s < self._due_s and tick.stage is not Stage.DONE:
            return
        self._due_s = tick.time_s + SEND_S
        with contextlib.suppress(Exception):  # nobody there, no room, or a defect of ours
            self._send(tick)
        with contextlib.suppress(Exception):  # most of the time: nothing came
            self._hear()

    def _send(self, tick: Tick) -> None:
        record = _record(tick, self._late_s, self._pilot, self._events)
        self._end.send(pickle.dumps(record, pickle.HIGHEST_PROTOCOL))
        self._late_s = 0.0

    def _hear(self) -> None:
        """Read at most one word. A wish counts once: repeated after a release, it would end the recording."""
        word = self._end.recv(WORD_BYTES)
        if word == WISH_TO_LAND and not self._asked:
            self._asked = True
            self._pilot.ask_to_land(LANDED_BY)


def _record(tick: Tick, late_s: float, pilot: Pilot, events: tuple[Event, ...]) -> Record:
    state = tick.state
    north, east, down = state.position_ned_m
    north_ref, east_ref, down_ref = tick.setpoint.position_ned_m if tick.setpoint else NO_VECTOR
    return Record(
        time_s=tick.time_s,
        stage=tick.stage.name,
        phase=tick.phase,
        flight_s=pilot.flight_s,
        height_m=tick.ground_down_m - down,
        height_ref_m=tick.ground_down_m - down_ref,
        north_m=north,
        east_m=east,
        north_ref_m=north_ref,
        east_ref_m=east_ref,
        attitude=state.attitude,
        distance_m=pilot.distance_m(state),
        speed_m_s=math.hypot(*state.velocity_ned_m_s),
        tilt_deg=math.degrees(tilt(state.attitude)),
        throttle=tick.target.throttle if tick.target else NAN,
        thrust_n=tick.output.thrust_n if tick.output else NAN,
        battery_v=state.battery_v,
        late_s=late_s,
        state_age_s=state.control_age_s,
        link_age_s=state.age_s("mode"),
        estimator_ratio=state.estimator_ratio,
        horizontal_std_m=state.horizontal_std_m,
        vertical_std_m=state.vertical_std_m,
        residual_m_s2=tick.model_error.body_m_s2,
        expected_m_s2=tick.model_error.expected_m_s2,
        changes=tuple(map(str, tick.model_error.changes)),
        armed=state.armed,
        mode=state.mode,
        ended=pilot.ended,
        events=events,
    )
