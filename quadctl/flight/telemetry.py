"""The latest word of the autopilot: MAVLink messages in, one snapshot out."""

import math
import threading
from collections import deque
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from quadctl.flight import px4
from quadctl.flight.link_clock import LinkClock
from quadctl.state import NAN, NO_VECTOR, Quat, Vec3, VehicleState

HEARTBEAT_TIMEOUT_S = 3.0
"""MAVLink's usual time after which a silent autopilot counts as lost."""

ESCS_PER_MESSAGE = 4
MILLIVOLTS_UNKNOWN = 65535

Fields = Mapping[str, Any]


class _Position(NamedTuple):
    received_s: float = -math.inf
    position_ned_m: Vec3 = NO_VECTOR
    velocity_ned_m_s: Vec3 = NO_VECTOR


class _Attitude(NamedTuple):
    received_s: float = -math.inf
    attitude: Quat = (NAN, NAN, NAN, NAN)
    rates_rad_s: Vec3 = NO_VECTOR


class _Escs(NamedTuple):
    """One ESC_STATUS: four motors."""

    received_s: float = -math.inf
    rpm: tuple[float, ...] = (NAN,) * ESCS_PER_MESSAGE
    voltage_v: tuple[float, ...] = (NAN,) * ESCS_PER_MESSAGE
    current_a: tuple[float, ...] = (NAN,) * ESCS_PER_MESSAGE


class _Heartbeat(NamedTuple):
    received_s: float = -math.inf
    autopilot: int = 0
    armed: bool = False
    mode: str = ""


class StatusText(NamedTuple):
    """What the autopilot told the pilot."""

    received_s: float
    severity: int
    text: str


class Telemetry:
    """Keeps the latest message of each kind. `receive` is called on the link's thread, the rest on any thread.

    Each message becomes one immutable tuple, put in place by one assignment: a snapshot never mixes two messages of a
    kind, and neither side waits for the other.
    """

    def __init__(self, n_rotors: int) -> None:
        self._n_rotors = n_rotors
        self._position = _Position()
        self._attitude = _Attitude()
        self._escs = [_Escs()] * math.ceil(n_rotors / ESCS_PER_MESSAGE)
        self._battery = (-math.inf, NAN)
        self._landed = True
        self._heartbeat = _Heartbeat()
        self._estimator_ratio = NAN
        self._clock = LinkClock()
        self._texts: deque[StatusText] = deque(maxlen=50)
        self._news = threading.Condition()
        self._handlers: dict[str, Callable[[Fields, float], None]] = {
            "LOCAL_POSITION_NED": self._on_position,
            "ATTITUDE_QUATERNION": self._on_attitude,
            "ESC_STATUS": self._on_escs,
            "SYS_STATUS": self._on_sys_status,
            "EXTENDED_SYS_STATE": self._on_extended_state,
            "HEARTBEAT": self._on_heartbeat,
            "ESTIMATOR_STATUS": self._on_estimator_status,
            "STATUSTEXT": self._on_text,
        }

    @property
    def messages(self) -> tuple[str, ...]:
        """Names of the messages that `receive` understands."""
        return tuple(self._handlers)

    def receive(self, name: str, fields: Fields, now_s: float) -> None:
        """Take in one message as it arrives; null stands for nan."""
        self._handlers[name](fields, now_s)

    def state(self, now_s: float) -> VehicleState:
        """The latest of everything, at `now_s` on the clock of `receive`."""
        position, attitude, escs, heartbeat = self._position, self._attitude, tuple(self._escs), self._heartbeat
        battery_s, battery_v = self._battery
        n = self._n_rotors
        return VehicleState(
            time_s=now_s,
            position_ned_m=position.position_ned_m,
            velocity_ned_m_s=position.velocity_ned_m_s,
            attitude=attitude.attitude,
            rates_rad_s=attitude.rates_rad_s,
            rotor_rpm=tuple(v for group in escs for v in group.rpm)[:n],
            motor_voltage_v=tuple(v for group in escs for v in group.voltage_v)[:n],
            motor_current_a=tuple(v for group in escs for v in group.current_a)[:n],
            battery_v=battery_v,
            armed=heartbeat.armed,
            landed=self._landed,
            mode=heartbeat.mode,
            connected=now_s - heartbeat.received_s < HEARTBEAT_TIMEOUT_S,
            received_s={
                "position": position.received_s,
                "attitude": attitude.received_s,
                "rates": attitude.received_s,
                "rpm": min(group.received_s for group in escs),
                "battery": battery_s,
                "heartbeat": heartbeat.received_s,
            },
            boots=self._clock.restarts,
            estimator_ratio=self._estimator_ratio,
        )

    @property
    def autopilot(self) -> int:
        """MAV_AUTOPILOT of the last heartbeat, 0 before the first."""
        return self._heartbeat.autopilot

    @property
    def armed(self) -> bool:
        """As the last heartbeat says."""
        return self._heartbeat.armed

    @property
    def mode(self) -> str:
        """As the last heartbeat says; empty before the first."""
        return self._heartbeat.mode

    def warnings_since(self, since_s: float) -> list[str]:
        """What the autopilot complained about from `since_s` on, oldest first."""
        return [t.text for t in list(self._texts) if t.received_s >= since_s and t.severity <= px4.MAV_SEVERITY_WARNING]

    def wait_for(self, condition: Callable[[], bool], timeout_s: float) -> bool:
        """Block until a heartbeat or a status text makes `condition` true; False when the time is up."""
        with self._news:
            return self._news.wait_for(condition, timeout_s)

    def _on_position(self, fields: Fields, now_s: float) -> None:
        sampled_s = self._clock.sampled_s(0.001 * fields["time_boot_ms"], now_s)
        self._position = _Position(sampled_s, _vector(fields, "x", "y", "z"), _vector(fields, "vx", "vy", "vz"))

    def _on_attitude(self, fields: Fields, now_s: float) -> None:
        quaternion = (_number(fields["q1"]), *_vector(fields, "q2", "q3", "q4"))
        sampled_s = self._clock.sampled_s(0.001 * fields["time_boot_ms"], now_s)
        self._attitude = _Attitude(sampled_s, quaternion, _vector(fields, "rollspeed", "pitchspeed", "yawspeed"))

    def _on_escs(self, fields: Fields, now_s: float) -> None:
        group = int(fields["index"]) // ESCS_PER_MESSAGE
        if group < len(self._escs):
            rpm, voltage, current = (tuple(map(_number, fields[key])) for key in ("rpm", "voltage", "current"))
            self._escs[group] = _Escs(now_s, rpm, voltage, current)

    def _on_sys_status(self, fields: Fields, now_s: float) -> None:
        millivolts = fields["voltage_battery"]
        if millivolts != MILLIVOLTS_UNKNOWN:
            self._battery = (now_s, 0.001 * millivolts)

    def _on_extended_state(self, fields: Fields, now_s: float) -> None:
        del now_s
        self._landed = fields["landed_state"] == px4.MAV_LANDED_STATE_ON_GROUND

    def _on_heartbeat(self, fields: Fields, now_s: float) -> None:
        armed = bool(fields["base_mode"] & px4.MAV_MODE_FLAG_SAFETY_ARMED)
        # It carries no time of its own: as late as the stamped messages that it travels with.
        sampled_s = now_s - self._clock.delay_s
        heartbeat = _Heartbeat(sampled_s, fields["autopilot"], armed, px4.mode_name(fields["custom_mode"]))
        with self._news:
            self._heartbeat = heartbeat
            self._news.notify_all()

    def _on_estimator_status(self, fields: Fields, now_s: float) -> None:
        del now_s
        ratios = [_number(fields[key]) for key in ("vel_ratio", "pos_horiz_ratio", "pos_vert_ratio")]
        self._estimator_ratio = max((r for r in ratios if math.isfinite(r)), default=NAN)

    def _on_text(self, fields: Fields, now_s: float) -> None:
        with self._news:
            # PX4 ends a text with a tab when the same is sent as an event too
            self._texts.append(StatusText(now_s, fields["severity"], fields["text"].strip("\0\t ")))
            self._news.notify_all()


def _number(value: float | None) -> float:
    """A number of a message; nan travels as null."""
    return NAN if value is None else float(value)


def _vector(fields: Fields, first: str, second: str, third: str) -> Vec3:
    return _number(fields[first]), _number(fields[second]), _number(fields[third])
