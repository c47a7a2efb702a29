"""The pilot: what to do at each tick of a flight, from the first message to the disarmed motors.

A state machine without clock and without I/O: the real-time loop and the lockstep simulation call `tick` with the
state and carry out what it asks for. So both fly the very same flight.
"""

import enum
import math
from typing import NamedTuple

from quadctl.compensator import Compensator
from quadctl.control import ControlOutput, Memory, control
from quadctl.flight.guards import Answer, Breach, defect, inspect
from quadctl.flight.settings import FlightSettings
from quadctl.frames import euler_from_quaternion
from quadctl.missions import Mission
from quadctl.model import Model
from quadctl.state import NAN, AttitudeTarget, Quat, Setpoint, Vec3, VehicleState

READY_TIMEOUT_S = 15.0
BOOT_TIMEOUT_S = 60.0
"""For an autopilot that says of itself that it is not ready, as it does for some time after boot."""
START_TIMEOUT_S = 8.0
LAND_MODE_TIMEOUT_S = 2.0
LAND_TIMEOUT_S = 60.0
LAND_AGAIN_S = 2.0
"""A landing that could not be asked for (a pulled plug) is asked for again, while nobody else has taken the mode."""
CLIMB_TIMEOUT_S = 20.0
CLIMBED_SHARE, CLIMBED_M_S = 0.9, 0.2
"""Of its height and its vertical speed, when an autopilot's own take-off is over."""
ARM_SETTLE_S = 2.0
"""An arming that was asked for may still come so long after it was given up."""
STREAM_FIRST_S = 1.0
"""Idle setpoints before offboard is asked for: autopilots want a stream first."""
SPOOL_UP_S = 1.0
"""Throttle rises from idle to half of hover while the vehicle still stands."""


class Stage(enum.Enum):
    """Where the flight is."""

    WAIT = "waiting for telemetry"
    STREAM = "streaming idle setpoints"
    START = "offboard and arming"
    SPOOL_UP = "spooling up"
    CLIMB = "taking off by the autopilot"
    FLY = "flying"
    LAND = "landing"
    RELEASED = "released"
    DONE = "done"


class Request(enum.Enum):
    """What the pilot wants the autopilot to do; carried out beside the loop."""

    OFFBOARD = "enter offboard"
    ARM = "arm"
    TAKE_OFF = "take off"
    LAND = "land"


class Tick(NamedTuple):
    """What one tick decided."""

    time_s: float
    stage: Stage
    phase: str
    target: AttitudeTarget | None
    """To be sent now; None: silence."""
    requests: tuple[Request, ...]
    state: VehicleState
    setpoint: Setpoint | None
    output: ControlOutput | None
    ground_down_m: float
    late_s: float


class Pilot:
    """Flies one mission once."""

    def __init__(
        self,
        mission: Mission,
        body: Model,
        settings: FlightSettings,
        compensator: Compensator,
        autopilot_takes_off: bool = False,
    ) -> None:
        self.mission = mission
        self.vehicle = body.vehicle
        self.settings = settings
        self.compensator = compensator
        self.stage = Stage.WAIT
        self.ended = ""
        """How the flight ended: `completed`, or the reason why it did not."""
        self.phases_flown: list[str] = []
        self.flight_s = 0.0
        self._autopilot_takes_off = autopilot_takes_off
        first = mission.phases[0]
        self.take_off_m = mission.reference(first.end_s)[0][2]
        """The autopilot's own take-off takes the place of the mission's first phase: it ends where that ends."""
        self._begin_at_s = first.end_s if autopilot_takes_off else 0.0
        self._land_asked_s = 0.0
        self._land_failed = False
        self._began_s: float | None = None
        self._stage_s = 0.0
        self._last_s = 0.0
        self._home: Vec3 = (0.0, 0.0, 0.0)
        self._ground_down_m = 0.0
        self._heading_rad = 0.0
        self._yaw_rad = 0.0
        self._memory = Memory()
        self._hold: Setpoint | None = None
        self._want_land: str | None = None
        self._refusal: str | None = None
        self._failure: str | None = None
        self._arm_asked = False
        self._offboard_seen = False
        self._armed_seen = False
        self._silent = False

    @property
    def done(self) -> bool:
        return self.stage is Stage.DONE

    def ask_to_land(self, reason: str) -> None:
        """Land at the next tick (Ctrl-C, SIGTERM, a button)."""
        self._want_land = reason

    def request_failed(self, request: Request, reason: str) -> None:
        """The autopilot refused. Before the flight that ends it; a refused landing is answered by silence."""
        if request is not Request.LAND:
            self._refusal = reason
        elif self.stage is Stage.LAND:
            self._silent = self._land_failed = True
            if self._armed_seen and reason not in self.ended:
                self.ended = f"{self.ended}; {reason}"

    def fail(self, reason: str) -> None:
        """A target could not be sent: no more targets, let the autopilot land."""
        self._failure = reason

    def tick(self, state: VehicleState, late_s: float) -> Tick:
        """Decide what to do now. `late_s`: how late this tick is."""
        now = state.time_s
        if self._began_s is None:
            self._began_s = self._stage_s = self._last_s = now
        dt = max(now - self._last_s, 0.0)
        self._last_s = now
        self._armed_seen = self._armed_seen or state.armed
        step = {
            Stage.WAIT: self._wait,
            Stage.STREAM: self._stream,
            Stage.START: self._start,
            Stage.SPOOL_UP: self._spool_up,
            Stage.CLIMB: self._climb,
            Stage.FLY: self._fly,
            Stage.LAND: self._land,
            Stage.RELEASED: self._released,
            Stage.DONE: self._idle,
        }[self.stage]
        target, requests, setpoint, output = step(state, now, dt, late_s)
        if target is not None and not all(map(math.isfinite, (*target.attitude, target.throttle))):
            # Whatever a compensator makes of a state that is good, it does not reach the motors.
            self._failure = "control gave a value that is not a number"
            if self.stage is Stage.LAND:
                target, self._silent = None, True
            else:
                target, requests, setpoint, output = self._answer(Breach(Answer.HAND_OVER, self._failure), state, now)
        phase = self.phases_flown[-1] if self.stage is Stage.FLY and self.phases_flown else self.stage.name.lower()
        return Tick(
            now - self._began_s,
            self.stage,
            phase,
            target,
            requests,
            state,
            setpoint,
            output,
            self._ground_down_m,
            late_s,
        )

    # --- stages: (state, now, dt, late) -> (target, requests, setpoint, output) ----------------------------------

    def _wait(self, state: VehicleState, now: float, dt: float, late_s: float) -> "_Decision":
        problem = self._defect(state)
        if self._want_land:
            self._end(self._want_land)
        elif problem is None and state.armed:
            self._end("the vehicle is armed already, expected it to stand disarmed on the ground")
        elif problem is None:
            self._remember_home(state)
            self._enter(Stage.STREAM, now)
        else:
            patience_s = READY_TIMEOUT_S if state.ready_to_arm and state.estimator_ok else BOOT_TIMEOUT_S
            if now - self._stage_s > patience_s:
                self._end(f"no usable state came from the autopilot in {patience_s:g} s: {problem}")
        return _NOTHING

    def _stream(self, state: VehicleState, now: float, dt: float, late_s: float) -> "_Decision":
        problem = "somebody else armed the vehicle" if state.armed else self._objection(state)
        if problem is not None:  # nothing has been asked for yet, so there is nothing to undo
            self._end(problem)
            return _NOTHING
        if now - self._stage_s < STREAM_FIRST_S:
            return _Decision(self._idle_target())
        self._enter(Stage.START, now)
        return _Decision(self._idle_target(), (Request.OFFBOARD,))

    def _start(self, state: VehicleState, now: float, dt: float, late_s: float) -> "_Decision":
        in_offboard = state.offboard
        if not in_offboard and (self._offboard_seen or state.armed):
            return self._answer(
                Breach(Answer.RELEASE, f"the autopilot went to {state.mode or 'an unknown mode'}"), state, now
            )
        self._offboard_seen = in_offboard
        problem = self._objection(state)
        if problem is None and now - self._stage_s > START_TIMEOUT_S:
            problem = (
                f"the autopilot did not get ready in {START_TIMEOUT_S:g} s: "
                f"armed is {state.armed}, mode is {state.mode or 'unknown'}, expected {state.offboard_mode}"
            )
        if problem is not None and not (state.armed or self._arm_asked):
            self._end(problem)
            return _NOTHING
        if problem is not None:  # it may be armed by now: see to it that it is disarmed
            return self._answer(Breach(Answer.HAND_OVER, problem), state, now)
        requests: tuple[Request, ...] = ()
        if state.armed:
            self._remember_home(state)
            if self._autopilot_takes_off:
                self._enter(Stage.CLIMB, now)
                return _Decision(None, (Request.TAKE_OFF,))
            self._enter(Stage.SPOOL_UP, now)
        elif in_offboard and not self._arm_asked:
            # Not before: armed in another mode, the vehicle would follow that mode's idea of a take-off.
            self._arm_asked = True
            requests = (Request.ARM,)
        return _Decision(self._idle_target(), requests)

    def _spool_up(self, state: VehicleState, now: float, dt: float, late_s: float) -> "_Decision":
        breach = self._inspect(state, late_s, dt)
        if breach is not None:
            return self._answer(breach, state, now)
        share = (now - self._stage_s) / SPOOL_UP_S
        if share >= 1.0:
            self._enter(Stage.FLY, now)
            self._memory = Memory()
            return self._fly(state, now, 0.0, late_s)
        curve = self.vehicle.throttle
        hover = curve.offset + curve.per_newton * self.vehicle.weight_n
        return _Decision(AttitudeTarget(_heading(self._heading_rad), 0.5 * share * hover))

    def _climb(self, state: VehicleState, now: float, dt: float, late_s: float) -> "_Decision":
        """The autopilot takes off, and we are silent: a target would break its take-off off."""
        breach = self._inspect(state, late_s, dt)
        if breach is None and self._refusal is not None:
            breach = Breach(Answer.HAND_OVER, self._refusal)
        if breach is None and now - self._stage_s > CLIMB_TIMEOUT_S:
            breach = Breach(Answer.HAND_OVER, f"the autopilot did not take off in {CLIMB_TIMEOUT_S:g} s")
        if breach is not None:  # no targets yet, so none while the landing is asked for either
            answer = Answer.HAND_OVER if breach.answer is Answer.LAND else breach.answer
            return self._answer(Breach(answer, breach.reason), state, now)
        climbed_m = self._home[2] - state.position_ned_m[2]
        if climbed_m < CLIMBED_SHARE * self.take_off_m or abs(state.velocity_ned_m_s[2]) > CLIMBED_M_S:
            return _NOTHING
        self._enter(Stage.FLY, now)
        self._memory = Memory()
        return self._fly(state, now, 0.0, late_s)

    def _fly(self, state: VehicleState, now: float, dt: float, late_s: float) -> "_Decision":
        self.flight_s = now - self._stage_s + self._begin_at_s
        breach = self._inspect(state, late_s, dt)
        if breach is not None:
            return self._answer(breach, state, now)
        phase = self.mission.phase_at(self.flight_s)
        if not self.phases_flown or self.phases_flown[-1] != phase.name:
            self.phases_flown.append(phase.name)
        if self.flight_s >= self.mission.duration_s:
            return self._begin_landing("completed", state, now)
        setpoint = self._setpoint(self.flight_s)
        output = self._control(setpoint, state, dt)
        return _Decision(output.target, (), setpoint, output)

    def _land(self, state: VehicleState, now: float, dt: float, late_s: float) -> "_Decision":
        """The autopilot lands. Until it has taken the mode we hold our place, while our state is good, not for long."""
        if self._over(state, now):
            self._enter(Stage.DONE, now)
            return _NOTHING
        if now - self._stage_s > LAND_TIMEOUT_S:
            self._end(f"{self.ended}; the autopilot did not land and disarm in {LAND_TIMEOUT_S:g} s")
            return _NOTHING
        breach = self._inspect(state, late_s, dt)
        if self._land_failed and state.connected and state.offboard and now - self._land_asked_s > LAND_AGAIN_S:
            self._land_failed, self._land_asked_s = False, now
            return _Decision(None, (Request.LAND,))
        good = breach is None or breach.answer is Answer.LAND
        waiting = good and now - self._stage_s < LAND_MODE_TIMEOUT_S
        if waiting and not self._silent and self._hold is not None:
            output = self._control(self._hold, state, dt)
            return _Decision(output.target, (), self._hold, output)
        self._silent = True
        return _NOTHING

    def _released(self, state: VehicleState, now: float, dt: float, late_s: float) -> "_Decision":
        """Somebody else flies: record until the vehicle is disarmed, never take the mode back."""
        if self._over(state, now) or not state.connected or self._want_land:
            self._enter(Stage.DONE, now)
        return _NOTHING

    def _idle(self, state: VehicleState, now: float, dt: float, late_s: float) -> "_Decision":
        return _NOTHING

    # --- inside --------------------------------------------------------------------------------------------------

    def _defect(self, state: VehicleState) -> str | None:
        """Why the flight cannot stand on this state, or None."""
        guards = self.settings.guards
        if guards.min_battery_v > 0.0 and not state.battery_v >= guards.min_battery_v:
            return f"the battery is at {state.battery_v:.2f} V, expected {guards.min_battery_v:g} V or more"
        if not (state.ready_to_arm or state.armed):
            return "the autopilot is not ready to arm"
        if not state.estimator_ok:
            return "the autopilot's estimator does not trust its attitude, velocity or position"
        return defect(state, guards)

    def _objection(self, state: VehicleState) -> str | None:
        """Why the flight must not begin, or None."""
        return self._want_land or self._refusal or self._failure or self._defect(state)

    def _over(self, state: VehicleState, now: float) -> bool:
        """The motors are off, and no arming of ours is under way that could still turn them on."""
        under_way = self._arm_asked and not self._armed_seen and now - self._stage_s < ARM_SETTLE_S
        return not state.armed and not under_way

    def _inspect(self, state: VehicleState, late_s: float, dt: float) -> Breach | None:
        north, east, down = state.position_ned_m
        breach = inspect(
            state,
            self.flight_s,
            self.mission.duration_s,
            self._ground_down_m - down,
            math.hypot(north - self._home[0], east - self._home[1]),
            self.settings.guards,
            self.mission.limits,
        )
        if breach is not None and breach.answer is Answer.RELEASE:  # goes before our own troubles
            return breach
        if self._failure is not None:
            return Breach(Answer.HAND_OVER, self._failure)
        stalled_s = max(late_s, dt - 1.0 / self.settings.controller.rate_hz)
        if stalled_s > self.settings.guards.max_tick_late_s:
            return Breach(Answer.HAND_OVER, f"the control loop stalled for {stalled_s:.2f} s")
        if breach is None and self._want_land and self.stage is not Stage.LAND:
            return Breach(Answer.LAND, self._want_land)
        return breach

    def _answer(self, breach: Breach, state: VehicleState, now: float) -> "_Decision":
        if breach.answer is Answer.RELEASE:
            self.ended = breach.reason
            self._want_land = None  # it cannot be done any more; a later one ends the recording
            self._enter(Stage.RELEASED, now)
            return _NOTHING
        self._silent = breach.answer is Answer.HAND_OVER
        return self._begin_landing(breach.reason, state, now)

    def _begin_landing(self, reason: str, state: VehicleState, now: float) -> "_Decision":
        self.ended = reason
        self._hold = Setpoint(state.position_ned_m, yaw_rad=self._yaw_rad)
        self._enter(Stage.LAND, now)
        self._land_asked_s = now
        if self._silent:
            return _Decision(None, (Request.LAND,))
        output = self._control(self._hold, state, 0.0)
        return _Decision(output.target, (Request.LAND,), self._hold, output)

    def _control(self, setpoint: Setpoint, state: VehicleState, dt: float) -> ControlOutput:
        output = control(
            setpoint,
            state,
            self._memory,
            dt,
            self._ground_down_m,
            self.vehicle,
            self.settings.controller,
            self.compensator,
        )
        self._memory = output.memory
        return output

    def _setpoint(self, t_s: float) -> Setpoint:
        position, velocity, acceleration, by_velocity = self.mission.reference(t_s)
        north, east, _ = self._home
        place = (north + position[0], east + position[1], self._ground_down_m - position[2])
        n, e, d = (NAN if free else at for at, free in zip(place, by_velocity, strict=True))
        self._yaw_rad = self.mission.yaw_rad(t_s, self._heading_rad)
        return Setpoint(
            (n, e, d),
            (velocity[0], velocity[1], -velocity[2]),
            (acceleration[0], acceleration[1], -acceleration[2]),
            self._yaw_rad,
        )

    def _remember_home(self, state: VehicleState) -> None:
        self._home = state.position_ned_m
        if self.settings.height_datum == "takeoff":
            self._ground_down_m = self._home[2] + self.settings.rest_height_m
        self._heading_rad = euler_from_quaternion(state.attitude)[2]
        self._yaw_rad = self._heading_rad

    def _idle_target(self) -> AttitudeTarget | None:
        """No thrust, the heading we stand in; silence where a target would stand in the way of the take-off."""
        return None if self._autopilot_takes_off else AttitudeTarget(_heading(self._heading_rad), 0.0)

    def _enter(self, stage: Stage, now: float) -> None:
        self.stage = stage
        self._stage_s = now

    def _end(self, reason: str) -> None:
        self.ended = reason
        self.stage = Stage.DONE


class _Decision(NamedTuple):
    target: AttitudeTarget | None = None
    requests: tuple[Request, ...] = ()
    setpoint: Setpoint | None = None
    output: ControlOutput | None = None


_NOTHING = _Decision()


def _heading(yaw_rad: float) -> Quat:
    return math.cos(0.5 * yaw_rad), 0.0, 0.0, math.sin(0.5 * yaw_rad)
