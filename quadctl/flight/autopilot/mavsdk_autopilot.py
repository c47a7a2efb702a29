"""A real autopilot, PX4 or ArduPilot, over MAVSDK.

Targets leave as single SET_ATTITUDE_TARGET messages. MAVSDK's own offboard plugin is not used: it goes on re-sending
the last target by itself, so that the autopilot would not notice a companion that hangs.
"""

import asyncio
import contextlib
import math
import threading
import time
from collections.abc import Callable, Iterable, Sequence
from functools import partial

from quadctl.errors import FlightError, LinkError, RefusalError
from quadctl.flight.autopilot import mavlink, round_trips
from quadctl.flight.autopilot.firmware import Firmware, Renamed, Requirement, Stream
from quadctl.flight.autopilot.firmwares import FIRMWARES
from quadctl.flight.autopilot.mavsdk_link import MavsdkLink, tried_again
from quadctl.flight.autopilot.telemetry import Telemetry
from quadctl.frames import cos_tilt
from quadctl.state import AttitudeTarget, Vec3, VehicleState
from quadctl.thrust_chain.chain import Addition

HEARTBEAT_WAIT_S = 3.0
"""Longest wait for the next heartbeat after an autopilot is found, and for one that shows an accepted request."""
REASON_WAIT_S = 0.3
"""Longest wait for the text that explains a refusal: it comes just before or after the acknowledgement."""
MORE_REASONS_S = 0.1
"""Time in which further texts follow the first."""
HEARTBEAT_EVERY_S = 0.5
"""Interval of our heartbeats, beside those of MAVSDK, which come once a second: of a link that loses a fifth, three of
those in a row are lost now and then, and ArduPilot's failsafe lands the vehicle."""
VERSION_WAIT_S = 1.0
"""Longest wait for the message with the hardware id."""
ROTORS_WAIT_S = 0.5
"""Longest wait for the first rotor speeds: autopilots without speed sensors accept the request too."""
AIR_WAIT_S = 1.2
"""Longest wait for the first pressure, which comes every second."""
ROUND_TRIP_WAIT_S = 1.0
"""Longest wait for the first answer to TIMESYNC: longer than the delay of any link on which a flight is possible."""
UNIT_TOLERANCE = 1e-3


class MavsdkAutopilot:
    """An autopilot at the other end of `url`; implements the port `Autopilot`."""

    def __init__(
        self, url: str, n_rotors: int, connect_timeout_s: float = 10.0, own_system_id: int = mavlink.OWN_SYSTEM_ID
    ) -> None:
        """Raises LinkError when `url` is not one that MAVSDK can open."""
        self._connect_timeout_s = connect_timeout_s
        self._telemetry = Telemetry(n_rotors)
        self._link = MavsdkLink(url, self._telemetry.receive, own_system_id)
        self._thrust_parameters: dict[str, float] = {}
        """Parameters of the firmware's thrust chain that it has told."""
        self._newer: dict[str, Renamed] = {}
        """Newer names that this autopilot has for parameters, by the older ones."""
        self._mode_before = ""
        """Mode that it was in before offboard was asked for."""
        self._link.on_reopened = self._ask_again
        self._start_s = time.monotonic()
        self._shown_s = self._start_s
        """Time of our last heartbeat."""
        self._closing = threading.Event()
        # On a thread of its own: a question must not wait for a tick, nor a tick for a question.
        self._asker = threading.Thread(target=self._keep_talking, name="round trips", daemon=True)
        self.warnings: list[str] = []
        """One sentence for each thing that the autopilot does not provide and the flight can do without."""

    @property
    def description(self) -> str:
        """Kind and address of the autopilot, for the log."""
        firmware = self._telemetry.firmware
        name = "autopilot" if firmware is None else firmware.name
        return f"{name} (system {self._link.system_id}) at {self._link.url}"

    @property
    def firmware(self) -> Firmware:
        """Description of its firmware; raises LinkError before it is connected."""
        if self._telemetry.firmware is None:
            raise LinkError(f"The link {self._link.url} is not open: connect first.")
        return self._telemetry.firmware

    @property
    def requirements(self) -> Sequence[Requirement]:
        """Parameters that must have certain values before a flight."""
        return self.firmware.requirements(self._link.own_system_id)

    async def connect(self) -> None:
        """Open the link and wait for a heartbeat; raises LinkError when none comes."""
        await self._link.open(self._telemetry.messages, self._connect_timeout_s)
        self.warnings += self._link.warnings
        if not await self._await(lambda: self._telemetry.autopilot != 0, HEARTBEAT_WAIT_S):
            raise LinkError(f"The autopilot at {self._link.url} went silent after its first heartbeat: check the link.")
        kind = self._telemetry.autopilot
        if kind not in FIRMWARES:
            expected = " or ".join(f"{number} ({firmware.name})" for number, firmware in FIRMWARES.items())
            raise LinkError(
                f"The autopilot at {self._link.url} is of an unknown kind: its heartbeat says MAV_AUTOPILOT {kind}, "
                f"expected {expected}."
            )
        self._show_ourselves()
        self._asker.start()

    async def identity(self) -> str:
        """System id of the vehicle, and the id of its hardware where it tells one (AUTOPILOT_VERSION).

        It asks at the first call. Raises LinkError when no answer comes.
        """
        await self._ask_for_version()
        hardware = self._telemetry.hardware
        return f"system {self._link.system_id}{f', hardware {hardware}' if hardware else ''}"

    async def request_telemetry(self) -> None:
        """Ask for the message rates that control needs.

        Raises FlightError when a message that control stands on is refused; others are noted in `warnings`.
        """
        for stream in self.firmware.streams:
            result = await self._link.run(partial(self._request_stream, stream))
            if result == mavlink.ACCEPTED or stream.alternative:
                continue
            sentence = (
                f"{self.description} refused to send {stream.name} at {stream.rate_hz:g} Hz: "
                f"{mavlink.result_name(result)}."
            )
            if stream.required:
                raise FlightError(sentence)
            self.warnings.append(f"{sentence} {stream.without}".rstrip())
        for other in self._link.other_autopilots:
            self.warnings.append(
                f"Another autopilot (system {other}) is heard at {self._link.url}: quadctl flies system "
                f"{self._link.system_id}, which was heard first."
            )
        talker = mavlink.TALKERS.get(self._link.own_system_id)
        if talker is not None and self.firmware.stays_up:
            self.warnings.append(
                f"This flight has the system id {self._link.own_system_id}, which {talker} too: heartbeats of that "
                f"would keep {self.firmware.name} in the air after the flight has died."
            )
        await self._ask_for_thrust_chain()
        if not await self._await(lambda: self._telemetry.has_rpm, ROTORS_WAIT_S):
            instead = "motor outputs" if self._telemetry.has_outputs else "the throttle"
            self.warnings.append(
                f"{self.description} sends no rotor speeds: in the log, thrust is known from {instead}."
            )
        if not await self._await(lambda: self._telemetry.measures_delay, ROUND_TRIP_WAIT_S):
            self.warnings.append(
                f"{self.description} does not answer TIMESYNC: a delay of the link that is constant or grows slowly "
                "is not seen, so keep the link short."
            )

    def state(self) -> VehicleState:
        """The latest state, at once; parts that never arrived are nan."""
        return self._telemetry.state(time.monotonic())

    def tell(self, name: str, vector: Vec3) -> None:
        """Show a vector to ground stations as a DEBUG_VECT, once; one that cannot be sent is lost."""
        since_us = int(1e6 * (time.monotonic() - self._start_s))
        with contextlib.suppress(LinkError):
            self._link.send(
                "DEBUG_VECT", {"name": name, "time_usec": since_us, **dict(zip("xyz", vector, strict=True))}
            )

    def send(self, target: AttitudeTarget) -> None:
        """Put one target on the wire, at once, once.

        The thrust is divided by the factor with which the firmware multiplies it at the present tilt.

        Raises FlightError, and sends nothing, when the target is not a unit quaternion and a throttle in 0..1, with a
        lateral throttle in -1..1 where it has one.
        """
        thrust = _checked_throttle(target) / self._boost()
        lateral = _checked_lateral(target)
        mask = mavlink.ATTITUDE_TARGET_IGNORE_RATES
        fields = {
            "time_boot_ms": int(1000.0 * (time.monotonic() - self._start_s)) & 0xFFFFFFFF,
            "target_system": self._link.system_id,
            "target_component": mavlink.MAV_COMP_ID_AUTOPILOT,
            "type_mask": mask if lateral is None else mask | mavlink.ATTITUDE_TARGET_THRUST_BODY_SET,
            "q": _checked_attitude(target),
            "body_roll_rate": 0.0,
            "body_pitch_rate": 0.0,
            "body_yaw_rate": 0.0,
            "thrust": thrust,
            "thrust_body": (0.0, 0.0, 0.0) if lateral is None else (*lateral, -thrust),
        }
        self._link.send("SET_ATTITUDE_TARGET", fields)

    def thrust_additions(self, hover: float) -> list[Addition]:
        """Table of what the firmware adds to thrust, for a vehicle that hovers at the throttle `hover`."""
        return self.firmware.thrust_chain.additions(hover, self._thrust_parameters, self._telemetry.ambient)

    async def arm(self) -> None:
        """Arm the motors, asked for once; returns when the heartbeat shows it."""
        await self._request(
            "arm", mavlink.CMD_COMPONENT_ARM_DISARM, 1.0, until=lambda: self._telemetry.armed, once=True
        )

    async def start_offboard(self) -> None:
        """Enter the mode that follows our targets."""
        self._mode_before = self._telemetry.mode
        await self._enter(self.firmware.offboard_mode)

    async def leave_offboard(self) -> None:
        """Enter the mode that it was in before, or its hold mode where that is not known."""
        known = self._mode_before in self.firmware.modes.keys() - {self.firmware.offboard_mode}
        await self._enter(self._mode_before if known else self.firmware.hold_mode)

    async def take_off(self, height_m: float) -> None:
        """Have the armed autopilot climb to `height_m` above where it stands; asked for once, returns when accepted."""
        nothing = (0.0,) * 6
        await self._request(f"take off to {height_m:g} m", mavlink.CMD_NAV_TAKEOFF, *nothing, height_m, once=True)

    async def land(self) -> None:
        """Enter the autopilot's own land mode: asked for once, as somebody may take the vehicle at any moment."""
        await self._enter(self.firmware.land_mode, once=True)

    async def hold(self) -> None:
        """Hand over: enter the autopilot's own hold mode."""
        await self._enter(self.firmware.hold_mode)

    async def run_checks(self) -> None:
        """Have the autopilot run its own checks before arming, and say as texts which of them fail.

        Raises LinkError when no answer comes; one that does not know the request is silent.
        """
        await self._link.run(lambda: self._link.command(mavlink.CMD_RUN_PREARM_CHECKS, what="run its checks"))

    async def parameters(self, names: Iterable[str]) -> dict[str, float]:
        """Values of the parameters by name, integers too as floats; those for which no answer comes are left out.

        One that the autopilot knows by its newer name keeps the name and the unit that it is asked by.
        """
        names = list(names)
        await self._learn_names(names)
        found = {name: await self._link.run(partial(self._read_parameter, name)) for name in names}
        return {name: value for name, value in found.items() if value is not None}

    async def set_parameter(self, name: str, value: float) -> None:
        """Set a parameter, as an integer where the autopilot holds one.

        Raises FlightError when the autopilot does not confirm it.
        """
        if name in self.firmware.renamed and name not in self._newer:
            await self._learn_names([name])
            await self._link.run(partial(self._read_parameter, name))
        known = self._newer.get(name, Renamed(name, (0, 0)))
        await self._link.run(lambda: self._link.write_parameter(known.name, value / known.unit))

    async def close(self) -> None:
        """Let go of the link. Waits for commands under way, which MAVSDK gives up by itself after some seconds."""
        self._closing.set()
        if self._asker.ident is not None:
            self._asker.join()
        await self._link.close()

    # --- inside ------------------------------------------------------------------------------------------------

    async def _learn_names(self, names: Sequence[str]) -> None:
        """Ask for the version where it decides by which names to ask for parameters."""
        if self.firmware.renamed.keys() & set(names):
            with contextlib.suppress(LinkError):  # then each name is tried
                await self._ask_for_version()

    def _read_parameter(self, name: str) -> float | None:
        for known in self._names_of(name):
            value = self._link.read_parameter(known.name)
            if value is not None:
                if known.name != name:
                    self._newer[name] = known
                return float(value) * known.unit
        return None

    def _names_of(self, name: str) -> Sequence[Renamed]:
        """Names by which to ask for a parameter, the likeliest first: a name that is not known is waited for."""
        older, newer = Renamed(name, (0, 0)), self.firmware.renamed.get(name)
        if newer is None:
            return (older,)
        if name in self._newer:
            return (newer,)
        version = self._telemetry.version
        return (newer, older) if version is not None and version >= newer.since else (older, newer)

    def _request_stream(self, stream: Stream) -> int:
        interval_us = 1e6 / stream.rate_hz
        number, what = mavlink.CMD_SET_MESSAGE_INTERVAL, f"send {stream.name}"
        return tried_again(lambda: self._link.command(number, stream.message_id, interval_us, what=what))

    async def _ask_for_version(self) -> None:
        """Ask for the version and the hardware's id, where they have not been told."""
        if self._telemetry.has_version:
            return
        await self._link.run(
            lambda: self._link.command(
                mavlink.CMD_REQUEST_MESSAGE, mavlink.AUTOPILOT_VERSION_ID, what="tell its hardware"
            )
        )
        await self._await(lambda: self._telemetry.has_version, VERSION_WAIT_S)

    async def _ask_for_thrust_chain(self) -> None:
        """Ask for the parameters between throttle and motors, and for the pressure where the firmware uses it."""
        chain = self.firmware.thrust_chain
        self._thrust_parameters = await self.parameters(chain.parameters)
        self._telemetry.thrust_parameters = {**chain.defaults, **self._thrust_parameters}
        if missing := [name for name in chain.parameters if name not in self._thrust_parameters]:
            self.warnings.append(
                f"{self.description} does not tell {', '.join(missing)}: what it adds to the thrust is not all known."
            )
        if any(stream.name == "SCALED_PRESSURE" for stream in self.firmware.streams):
            await self._ask_for_version()  # by which it takes the density of the air
            await self._await(lambda: self._telemetry.knows_air, AIR_WAIT_S)

    def _boost(self) -> float:
        """Factor with which the firmware multiplies the thrust at the attitude that arrived last."""
        upright = cos_tilt(self._telemetry.attitude)
        if not math.isfinite(upright):
            return 1.0
        return float(self.firmware.thrust_chain.boost(upright, self._thrust_parameters))

    def _ask_again(self) -> None:
        """Request the rates again after a silence of the line: an autopilot without power has forgotten them."""
        try:
            for stream in self.firmware.streams:
                self._request_stream(stream)
        except LinkError:
            return  # gone again; when it is back we are called again

    def _keep_talking(self) -> None:
        while not self._closing.wait(round_trips.EVERY_S):
            self._talk(time.monotonic())

    def _talk(self, now_s: float) -> None:
        """Ask for a round trip, and be heard."""
        self._telemetry.settle_texts(now_s)
        if not self._telemetry.state(now_s).connected:  # nobody to ask, and MAVSDK would complain of each question
            return
        with contextlib.suppress(LinkError):  # the guards notice what that means
            self._link.send("TIMESYNC", self._telemetry.round_trips.question(now_s))
            if now_s - self._shown_s >= HEARTBEAT_EVERY_S:
                self._show_ourselves()

    def _show_ourselves(self) -> None:
        self._shown_s = time.monotonic()
        self._link.send("HEARTBEAT", {"type": self.firmware.heartbeat_type, **mavlink.HEARTBEAT})

    async def _enter(self, mode: str, once: bool = False) -> None:
        await self._request(
            f"enter {mode}",
            mavlink.CMD_DO_SET_MODE,
            mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED,
            *self.firmware.set_mode_parameters(self.firmware.modes[mode]),
            until=lambda: self._telemetry.mode == mode,
            once=once,
        )

    async def _request(
        self, what: str, command: int, *parameters: float, until: Callable[[], bool] | None = None, once: bool = False
    ) -> None:
        """Send a command, and return when a heartbeat shows its effect: until then the state contradicts the answer.

        Where the answer was lost, the effect answers. `once`: without the repetitions of a command that is not
        acknowledged.
        """
        asked_s = time.monotonic()
        send = self._link.command_once if once else self._link.command
        try:
            result = await self._link.run(lambda: send(command, *parameters, what=what))
        except LinkError:
            if until is None or not until():
                raise
            return
        if result != mavlink.ACCEPTED:
            reasons = "; ".join([mavlink.result_name(result), *await self._reasons(asked_s)])
            raise RefusalError(f"{self.description} refused to {what}: {reasons}.")
        if until is not None and not await self._await(until, HEARTBEAT_WAIT_S):
            reasons = "".join(f"; {reason}" for reason in await self._reasons(asked_s))
            raise FlightError(
                f"{self.description} accepted to {what}, but no heartbeat shows it within {HEARTBEAT_WAIT_S:g} s"
                f"{reasons}."
            )

    async def _reasons(self, since_s: float) -> list[str]:
        """Warnings and errors of the autopilot since `since_s`, and of the next moment, and the other reasons that it
        tells."""

        def given() -> list[str]:
            return [text.text for text in self._telemetry.texts_since(since_s) if text.grave]

        if await self._await(lambda: bool(given()), REASON_WAIT_S):
            await asyncio.sleep(MORE_REASONS_S)
        return [*given(), *self.state().why_not_ready]

    async def _await(self, condition: Callable[[], bool], timeout_s: float) -> bool:
        return await self._link.run(lambda: self._telemetry.wait_for(condition, timeout_s))


def _checked_attitude(target: AttitudeTarget) -> tuple[float, float, float, float]:
    q = target.attitude
    norm = math.sqrt(sum(c * c for c in q))
    if not abs(norm - 1.0) <= UNIT_TOLERANCE:  # a nan is refused too
        raise FlightError(f"The attitude target {q} was not sent: expected a unit quaternion, its norm is {norm:g}.")
    return q


def _checked_throttle(target: AttitudeTarget) -> float:
    if not 0.0 <= target.throttle <= 1.0:  # a nan is refused too
        raise FlightError(f"The throttle target {target.throttle} was not sent: expected a number from 0 to 1.")
    return target.throttle


def _checked_lateral(target: AttitudeTarget) -> tuple[float, float] | None:
    if target.lateral is not None and not all(-1.0 <= part <= 1.0 for part in target.lateral):  # a nan is refused too
        raise FlightError(f"The lateral throttle {target.lateral} was not sent: expected numbers from -1 to 1.")
    return target.lateral
