"""The latest state that the autopilot has sent: MAVLink messages in, one snapshot out."""

import math
import threading
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple

from quadctl.flight.autopilot import mavlink
from quadctl.flight.autopilot.firmware import Firmware, share_of_pulse
from quadctl.flight.autopilot.firmwares import FIRMWARES
from quadctl.flight.autopilot.link_clock import LinkClock
from quadctl.flight.autopilot.px4_events import ArmingReport
from quadctl.flight.autopilot.round_trips import RoundTrips
from quadctl.flight.autopilot.status_texts import StatusTexts
from quadctl.state import NAN, NO_VECTOR, Quat, StatusText, Vec3, VehicleState
from quadctl.thrust_chain.atmosphere import Air, Version, air_density_ratio, atmosphere_of, version_of_number
from quadctl.thrust_chain.chain import Ambient, Parameters

WORD_TIMEOUT_S = 3.0
"""MAVLink's usual time after which a silent autopilot counts as lost: the age of the latest word about its mode."""
HEARTBEAT_TIMEOUT_S = 6.0
"""Time without heartbeats after which it is lost though CURRENT_MODE comes: where a fifth of all is lost, three of
PX4's heartbeats in a row are lost every three minutes, and six every five hours."""

ESCS_PER_MESSAGE = 4
MILLIVOLTS_UNKNOWN = 65535
ESTIMATOR_GOOD, ESTIMATOR_POSITION = 0b111, 0b11000
"""Flags of ESTIMATOR_STATUS and EKF_STATUS_REPORT: attitude and velocities; position, relative or absolute."""

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
    """One message about four motors."""

    received_s: float = -math.inf
    rpm: tuple[float, ...] = (NAN,) * ESCS_PER_MESSAGE
    voltage_v: tuple[float, ...] = (NAN,) * ESCS_PER_MESSAGE
    current_a: tuple[float, ...] = (NAN,) * ESCS_PER_MESSAGE


class _Outputs(NamedTuple):
    """Motor outputs on the scale of the throttle target."""

    received_s: float = -math.inf
    value: tuple[float, ...] = ()


class _Heartbeat(NamedTuple):
    received_s: float = -math.inf
    autopilot: int = 0
    armed: bool = False


class _Mode(NamedTuple):
    """Flight mode, from whichever message told it last."""

    received_s: float = -math.inf
    name: str = ""


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
        self._raw_rpm = [(-math.inf, NAN)] * n_rotors
        self._outputs = _Outputs()
        self._estimator_ok = True
        self._prearm_ok = True
        self._checks_off = False
        self._health = (0, 0)
        """Flags of SYS_STATUS: parts in use, and healthy ones."""
        self._failing: tuple[str, ...] = ()
        self._report = ArmingReport()
        self._refusals: tuple[str, ...] = ()
        self._battery = (-math.inf, NAN)
        self._resting_v = NAN
        self._remaining = NAN
        self._charge: dict[int, int] = {}
        """MAV_BATTERY_CHARGE_STATE by number of the battery."""
        self._remote: bool | None = None
        self._air = Air(NAN, NAN, 0.0, NAN)
        """Air at the ground, as it was told first."""
        self._version: Version | None = None
        self.thrust_parameters: Parameters = {}
        """Parameters of the firmware's thrust chain, by which its motor outputs become thrusts."""
        self._landed = True
        self._heartbeat = _Heartbeat()
        self._mode = _Mode()
        self.has_version = False
        """True once AUTOPILOT_VERSION has come."""
        self.hardware = ""
        """Id of the autopilot's hardware, in hexadecimal digits; empty where it tells none."""
        self._estimator_ratio = NAN
        self._std_m = (NAN, NAN)
        self._healthy_aids = 0
        """Sensors of the position that SYS_STATUS calls healthy."""
        self._has_fix = True
        """False when the GPS says that it has no fix."""
        self._aided = self._aid_lost = False
        self._clock = LinkClock()
        self.round_trips = RoundTrips()
        """Questions about the link's delay, whose answers `receive` takes in."""
        self._texts = StatusTexts()
        self._news = threading.Condition()
        self._handlers: dict[str, Callable[[Fields, float], None]] = {
            "LOCAL_POSITION_NED": self._on_position,
            "ATTITUDE_QUATERNION": self._on_attitude,
            "ESC_STATUS": self._on_esc_status,
            "ESC_TELEMETRY_1_TO_4": partial(self._on_esc_telemetry, 0),
            "ESC_TELEMETRY_5_TO_8": partial(self._on_esc_telemetry, 1),
            "RAW_RPM": self._on_raw_rpm,
            "ACTUATOR_OUTPUT_STATUS": self._on_actuators,
            "SERVO_OUTPUT_RAW": self._on_servos,
            "ESTIMATOR_STATUS": partial(self._on_estimator, ("vel_ratio", "pos_horiz_ratio", "pos_vert_ratio")),
            "EKF_STATUS_REPORT": partial(
                self._on_estimator, ("velocity_variance", "pos_horiz_variance", "pos_vert_variance")
            ),
            "SCALED_PRESSURE": self._on_pressure,
            "GLOBAL_POSITION_INT": self._on_global_position,
            "SYS_STATUS": self._on_sys_status,
            "GPS_RAW_INT": self._on_gps,
            "BATTERY_STATUS": self._on_battery,
            "EXTENDED_SYS_STATE": self._on_extended_state,
            "HEARTBEAT": self._on_heartbeat,
            "CURRENT_MODE": self._on_current_mode,
            "AUTOPILOT_VERSION": self._on_version,
            "TIMESYNC": self._on_timesync,
            "STATUSTEXT": self._on_text,
            "EVENT": self._on_event,
        }

    @property
    def messages(self) -> tuple[str, ...]:
        """Names of the messages that `receive` understands."""
        return tuple(self._handlers)

    def receive(self, name: str, fields: Fields, now_s: float) -> None:
        """Take in one message as it arrives; null stands for nan."""
        self._handlers[name](fields, now_s)

    def state(self, now_s: float) -> VehicleState:
        """Latest state, at `now_s` on the clock of `receive`."""
        position, attitude, escs, heartbeat = self._position, self._attitude, tuple(self._escs), self._heartbeat
        battery_s, battery_v = self._battery
        mode_s, mode = self._mode
        rpm_s, rpm = self._rpm()
        n, firmware = self._n_rotors, self.firmware
        tells_readiness = firmware is not None and firmware.tells_readiness(mode) and not self._checks_off
        return VehicleState(
            time_s=now_s,
            position_ned_m=position.position_ned_m,
            velocity_ned_m_s=position.velocity_ned_m_s,
            attitude=attitude.attitude,
            rates_rad_s=attitude.rates_rad_s,
            rotor_rpm=rpm,
            motor_voltage_v=tuple(v for group in escs for v in group.voltage_v)[:n],
            motor_current_a=tuple(v for group in escs for v in group.current_a)[:n],
            motor_output=self._outputs.value,
            battery_v=battery_v,
            battery_remaining=self._remaining,
            battery_alarm=mavlink.BATTERY_ALARMS.get(max(map(_gravity, self._charge.values()), default=0), ""),
            armed=heartbeat.armed,
            landed=self._landed,
            mode=mode,
            offboard_mode="" if firmware is None else firmware.offboard_mode,
            estimator_ok=self._estimator_ok,
            ready_to_arm=self._prearm_ok or not tells_readiness,
            tells_readiness=tells_readiness,
            remote=self._remote,
            checks_off=self._checks_off,
            failing=self._failing,
            refusals=self._refusals,
            connected=now_s - mode_s < WORD_TIMEOUT_S and now_s - heartbeat.received_s < HEARTBEAT_TIMEOUT_S,
            received_s={
                "position": position.received_s,
                "attitude": attitude.received_s,
                "rates": attitude.received_s,
                "rpm": rpm_s,
                "battery": battery_s,
                "heartbeat": heartbeat.received_s,
                "mode": mode_s,
            },
            setpoint_delay_s=self._clock.setpoint_delay_s,
            boots=self._clock.restarts,
            estimator_ratio=self._estimator_ratio,
            horizontal_std_m=self._std_m[0],
            vertical_std_m=self._std_m[1],
            aid_lost=self._aid_lost,
            texts=self._texts.texts,
        )

    @property
    def firmware(self) -> Firmware | None:
        """Firmware whose heartbeats arrive; None before the first, and for one that quadctl does not fly."""
        return FIRMWARES.get(self._heartbeat.autopilot)

    @property
    def attitude(self) -> Quat:
        """Attitude that arrived last; nan before the first."""
        return self._attitude.attitude

    @property
    def ambient(self) -> Ambient:
        """Voltage of the battery at rest, as it was before arming, and density of the air when it was told first.

        A board of version 4.6 or later counts as one that takes the standard atmosphere: most do, and none tells.
        """
        atmosphere = atmosphere_of(self._version, is_standard=True)
        return Ambient(self._resting_v, air_density_ratio(self._air, atmosphere), atmosphere=atmosphere)

    @property
    def version(self) -> Version | None:
        """Version of the firmware; None where it was not told."""
        return self._version

    @property
    def knows_air(self) -> bool:
        return math.isfinite(self.ambient.density_ratio)

    def throttle_of(self, output: float) -> float:
        """Throttle target that gives a motor this output, in the autopilot's own unit."""
        firmware, value = self.firmware, share_of_pulse(output)
        if firmware is None:
            return value
        return float(firmware.thrust_chain.thrust_of_output(value, self.thrust_parameters, self.ambient))

    @property
    def has_rpm(self) -> bool:
        """True when rotor speeds have arrived."""
        return math.isfinite(self._rpm()[0])

    @property
    def has_outputs(self) -> bool:
        """True when motor outputs have arrived."""
        return math.isfinite(self._outputs.received_s)

    @property
    def autopilot(self) -> int:
        """MAV_AUTOPILOT of the last heartbeat, 0 before the first."""
        return self._heartbeat.autopilot

    @property
    def armed(self) -> bool:
        """True when the last heartbeat says armed."""
        return self._heartbeat.armed

    @property
    def mode(self) -> str:
        """Mode that the autopilot told last; empty before the first heartbeat."""
        return self._mode.name

    @property
    def measures_delay(self) -> bool:
        """True when the autopilot's answers tell the delay of the link."""
        return self._clock.measured

    def texts_since(self, since_s: float) -> list[StatusText]:
        """Texts of the autopilot since `since_s`, oldest first."""
        with self._news:
            return self._texts.since(since_s)

    def settle_texts(self, now_s: float) -> None:
        """End a text of which no more is to be expected; to be called now and then."""
        with self._news:
            self._texts.settle(now_s)

    def wait_for(self, condition: Callable[[], bool], timeout_s: float) -> bool:
        """Block until a heartbeat, a mode, a version, a round trip, a pressure or a text makes `condition` true; False
        when the time is up."""
        with self._news:
            return self._news.wait_for(condition, timeout_s)

    def _on_position(self, fields: Fields, now_s: float) -> None:
        sampled_s = self._clock.sampled_s(0.001 * fields["time_boot_ms"], now_s)
        self._position = _Position(sampled_s, _vector(fields, "x", "y", "z"), _vector(fields, "vx", "vy", "vz"))

    def _on_attitude(self, fields: Fields, now_s: float) -> None:
        quaternion = (_number(fields["q1"]), *_vector(fields, "q2", "q3", "q4"))
        sampled_s = self._clock.sampled_s(0.001 * fields["time_boot_ms"], now_s)
        self._attitude = _Attitude(sampled_s, quaternion, _vector(fields, "rollspeed", "pitchspeed", "yawspeed"))

    def _rpm(self) -> tuple[float, tuple[float, ...]]:
        """Time of arrival and rotor speeds, from the speed controllers, or else from rpm sensors."""
        escs = tuple(self._escs)
        received_s = min(group.received_s for group in escs)
        if math.isfinite(received_s):
            return received_s, tuple(v for group in escs for v in group.rpm)[: self._n_rotors]
        return min(at for at, _ in self._raw_rpm), tuple(rpm for _, rpm in self._raw_rpm)

    def _on_esc_status(self, fields: Fields, now_s: float) -> None:
        group = int(fields["index"]) // ESCS_PER_MESSAGE
        if group < len(self._escs):
            rpm, voltage, current = (tuple(map(_number, fields[key])) for key in ("rpm", "voltage", "current"))
            self._escs[group] = _Escs(now_s, rpm, voltage, current)

    def _on_esc_telemetry(self, group: int, fields: Fields, now_s: float) -> None:
        """Take in speeds, and hundredths of volt and ampere. An autopilot without speed sensors sends zeros for all."""
        if group < len(self._escs):
            rpm = tuple(map(float, fields["rpm"])) if any(fields["rpm"]) else _Escs().rpm
            voltage, current = (tuple(0.01 * v for v in fields[key]) for key in ("voltage", "current"))
            self._escs[group] = _Escs(now_s, rpm, voltage, current)

    def _on_raw_rpm(self, fields: Fields, now_s: float) -> None:
        rotor = int(fields["index"])
        if rotor < self._n_rotors:
            self._raw_rpm[rotor] = (now_s, _number(fields["frequency"]))

    def _on_actuators(self, fields: Fields, now_s: float) -> None:
        self._take_outputs(now_s, list(map(_number, fields["actuator"])))

    def _on_servos(self, fields: Fields, now_s: float) -> None:
        pulses: Sequence[float] = [float(fields[f"servo{i}_raw"]) for i in range(1, 17)]
        if fields["port"] == 0:  # outputs 1 to 16
            self._take_outputs(now_s, pulses)

    def _take_outputs(self, now_s: float, values: Sequence[float]) -> None:
        """Take in motor outputs in the autopilot's own unit; converted here and not at every tick."""
        self._outputs = _Outputs(now_s, tuple(map(self.throttle_of, values[: self._n_rotors])))

    def _on_estimator(self, ratios: Sequence[str], fields: Fields, now_s: float) -> None:
        """Take in the estimator's flags, and the largest of the innovation test ratios in the fields `ratios`.

        Each ratio is the root of innovation^2 / (gate^2 variance), so a measurement is rejected from 1 on. PX4 sends
        what `Ekf::get_innovation_test_status` gives, nan for a sensor that is not used; ArduPilot what
        `NavEKF3_core::getVariances` gives, and calls it a variance.
        ArduPilot's own failsafe (FS_EKF_THRESH, 0.8 of the same scale) wants two of them, for a second.

        Neither ratios nor flags tell that a sensor has gone: there is no innovation then. PX4 states the standard
        deviation of its position too, which grows from the first second on.
        """
        del now_s
        known = [ratio for name in ratios if math.isfinite(ratio := _number(fields[name]))]
        self._estimator_ratio = max(known, default=NAN)
        flags = int(fields["flags"])
        self._estimator_ok = flags & ESTIMATOR_GOOD == ESTIMATOR_GOOD and flags & ESTIMATOR_POSITION != 0
        self._std_m = _number(fields.get("pos_horiz_accuracy")), _number(fields.get("pos_vert_accuracy"))

    def _on_sys_status(self, fields: Fields, now_s: float) -> None:
        present, enabled, health = (
            int(fields[f"onboard_control_sensors_{kind}"]) for kind in ("present", "enabled", "health")
        )
        check, firmware = mavlink.MAV_SYS_STATUS_PREARM_CHECK, self.firmware
        listed = firmware is None or firmware.lists_prearm
        # ArduPilot with ARMING_CHECK 0 lists the check as one that is not in use, and never as healthy.
        self._checks_off = listed and bool(present & check) and not enabled & check
        told = not listed or bool(present & enabled & check)
        self._prearm_ok = not told or bool(health & check)
        if (enabled, health) != self._health:
            self._health = enabled, health
            self._failing = mavlink.failing_parts(enabled, health)
        if firmware is not None and firmware.tells_aids:
            self._healthy_aids = health & (mavlink.GPS | mavlink.VISION_POSITION)
            self._notice_aids()
        self._remote = bool(present & health & mavlink.RC_RECEIVER)
        percent = fields["battery_remaining"]
        self._remaining = 0.01 * percent if percent >= 0 else NAN
        millivolts = fields["voltage_battery"]
        if millivolts != MILLIVOLTS_UNKNOWN:
            self._battery = (now_s, 0.001 * millivolts)
            if not self._heartbeat.armed:
                self._resting_v = 0.001 * millivolts

    def _on_pressure(self, fields: Fields, now_s: float) -> None:
        """Take in the first pressure, hPa, and temperature, hundredths of a degree, at the ground."""
        del now_s
        pressure_pa = 100.0 * _number(fields["press_abs"])
        if math.isnan(self._air.pressure_pa) and pressure_pa > 0.0:
            with self._news:
                temperature_c = 0.01 * fields["temperature"]
                self._air = self._air._replace(pressure_pa=pressure_pa, ground_temperature_c=temperature_c)
                self._news.notify_all()

    def _on_global_position(self, fields: Fields, now_s: float) -> None:
        """Take in the first altitude above the sea, mm."""
        del now_s
        if math.isnan(self._air.altitude_m):
            with self._news:
                self._air = self._air._replace(altitude_m=0.001 * fields["alt"])
                self._news.notify_all()

    def _on_battery(self, fields: Fields, now_s: float) -> None:
        del now_s
        self._charge = {**self._charge, int(fields["id"]): int(fields.get("charge_state") or 0)}

    def _on_gps(self, fields: Fields, now_s: float) -> None:
        del now_s
        firmware = self.firmware
        if firmware is not None and firmware.tells_aids:
            self._has_fix = int(fields["fix_type"]) >= mavlink.GPS_FIX_3D
            self._notice_aids()

    def _notice_aids(self) -> None:
        """Note if a source of position works; one that never worked is not lost."""
        working = self._healthy_aids if self._has_fix else self._healthy_aids & ~mavlink.GPS
        aided = working != 0
        self._aided = self._aided or aided
        self._aid_lost = self._aided and not aided

    def _on_extended_state(self, fields: Fields, now_s: float) -> None:
        del now_s
        self._landed = fields["landed_state"] == mavlink.MAV_LANDED_STATE_ON_GROUND

    def _on_heartbeat(self, fields: Fields, now_s: float) -> None:
        armed = bool(fields["base_mode"] & mavlink.MAV_MODE_FLAG_SAFETY_ARMED)
        # It carries no time of its own: as late as the stamped messages that it travels with.
        heartbeat = _Heartbeat(now_s - self._clock.delay_s, fields["autopilot"], armed)
        with self._news:
            self._heartbeat = heartbeat
            self._mode = self._told_mode(fields, now_s)
            self._news.notify_all()

    def _on_current_mode(self, fields: Fields, now_s: float) -> None:
        with self._news:
            self._mode = self._told_mode(fields, now_s)
            self._news.notify_all()

    def _on_version(self, fields: Fields, now_s: float) -> None:
        """Take in the version, and the hardware's id: 18 bytes, or where those are all 0 a number of 64 bits."""
        del now_s
        long, short = bytes(fields.get("uid2") or ()), int(fields.get("uid") or 0)
        with self._news:
            self.hardware = long.hex() if any(long) else f"{short:016x}" if short else ""
            self._version = version_of_number(int(fields.get("flight_sw_version") or 0))
            self.has_version = True
            self._news.notify_all()

    def _told_mode(self, fields: Fields, now_s: float) -> _Mode:
        firmware = self.firmware
        name = "" if firmware is None else firmware.mode_name(fields["custom_mode"])
        return _Mode(now_s - self._clock.delay_s, name)

    def _on_timesync(self, fields: Fields, now_s: float) -> None:
        trip = self.round_trips.answered(fields, now_s)
        if trip is not None:
            with self._news:
                self._clock.exchanged(*trip)
                self._news.notify_all()

    def _on_event(self, fields: Fields, now_s: float) -> None:
        """Take in an event: PX4's reasons against the present mode, and against the one that it is to fly."""
        del now_s
        self._report.take(fields)
        firmware = self.firmware
        self._refusals = () if firmware is None else self._report.against(self._mode.name, firmware.offboard_mode)

    def _on_text(self, fields: Fields, now_s: float) -> None:
        firmware = self.firmware
        with self._news:
            if firmware is not None and firmware.disarming_text and fields["text"].startswith(firmware.disarming_text):
                self._heartbeat = self._heartbeat._replace(armed=False)  # until a heartbeat says otherwise
            self._texts.take(fields, now_s)
            self._news.notify_all()


def _gravity(charge_state: int) -> int:
    """Charge state where it is an alarm, else 0."""
    return charge_state if charge_state in mavlink.BATTERY_ALARMS else 0


def _number(value: float | None) -> float:
    """Number of a message; null stands for nan."""
    return NAN if value is None else float(value)


def _vector(fields: Fields, first: str, second: str, third: str) -> Vec3:
    return _number(fields[first]), _number(fields[second]), _number(fields[third])
