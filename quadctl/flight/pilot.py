"""The pilot: what to do at each tick of a flight, from the first message to the disarmed motors.

A state machine without clock and without I/O: the real-time loop and the lockstep simulation call `tick` with the
state and carry out what it asks for. So both fly the very same flight.
"""

import math
from collections.abc import Callable

from quadctl.compensator import Compensator
from quadctl.control import ControlOutput, Memory, control
from quadctl.flight.guards import Answer, Breach, unfit
from quadctl.flight.settings import FlightSettings
from quadctl.flight.supervisor import Supervisor
from quadctl.flight.tick import Decision, Event, Request, Stage, Tick
from quadctl.frames import euler_from_quaternion
from quadctl.missions import Mission
from quadctl.model import Model
from quadctl.state import AttitudeTarget, Quat, Setpoint, VehicleState

READY_TIMEOUT_S = 15.0
START_TIMEOUT_S = 8.0
LAND_MODE_TIMEOUT_S = 2.0
MODE_FRESH_S = 0.5
"""A mode is asked for only while a heartbeat as recent as this shows that it is still ours to change."""
LET_GO_S = 1.0
"""How long a second Ctrl-C waits for the autopilot to take its land mode."""
LAND_TIMEOUT_S = 60.0
ARM_SETTLE_S = 2.0
"""An arming that was asked for may still come so long after it was given up."""
STREAM_FIRST_S = 1.0
"""Idle setpoints before offboard is asked for: autopilots want a stream first."""
SPOOL_UP_S = 1.0
"""Throttle rises from idle to half of hover while the vehicle still stands."""


class Pilot:
    """Flies one mission once."""

    def __init__(self, mission: Mission, body: Model, settings: FlightSettings, compensator: Compensator) -> None:
        self.mission = mission
        self.vehicle = body.vehicle
        self.settings = settings
        self.compensator = compensator
        self.stage = Stage.WAIT
        self.ended = ""
        """How the flight ended: `completed`, or the reason why it did not."""
        self.phases_flown: list[str] = []
        self.flight_s = 0.0
        self._steps: dict[Stage, _Step] = {
            Stage.WAIT: self._wait,
            Stage.STREAM: self._stream,
            Stage.START: self._start,
            Stage.SPOOL_UP: self._spool_up,
            Stage.FLY: self._fly,
            Stage.LAND: self._land,
            Stage.RELEASED: self._released,
            Stage.DONE: self._idle,
        }
        self._watch = Supervisor(mission, settings)
        self._began_s: float | None = None
        self._stage_s = 0.0
        self._last_s = 0.0
        self._heading_rad = 0.0
        self._yaw_rad = 0.0
        self._memory = Memory()
        self._hold: Setpoint | None = None
        self._let_go: str | None = None
        self._let_go_s = 0.0
        self._faded = False
        self._events: list[Event] = []
        self._arm_asked = False
        self._land_asked = False
        self._offboard_seen = False
        self._armed_seen = False
        self._silent = False

    @property
    def done(self) -> bool:
        return self.stage is Stage.DONE

    def ask_to_land(self, reason: str) -> None:
        """Land at the next tick (Ctrl-C, SIGTERM, a button)."""
        self._watch.want_land = reason

    def ask_to_let_go(self, reason: str) -> None:
        """Hand over at the next tick (a second Ctrl-C): no more targets, the autopilot lands, and we are gone."""
        self._watch.want_land = self._watch.want_land or reason
        self._let_go = reason

    def request_failed(self, request: Request, reason: str) -> None:
        """The autopilot refused. Before the flight that ends it; a refused landing is answered by silence."""
        if request is not Request.LAND:
            self._watch.refusal = reason
        elif self.stage is Stage.LAND:
            self._note(reason, "silence")
            self._silent = True
            if self._armed_seen:
                self.ended = f"{self.ended}; {reason}"

    def fail(self, reason: str) -> None:
        """A target could not be sent: no more targets, let the autopilot land."""
        self._watch.failure = reason

    def tick(self, state: VehicleState, late_s: float) -> Tick:
        """Decide what to do now. `late_s`: how late this tick is."""
        now = state.time_s
        if self._began_s is None:
            self._began_s = self._stage_s = self._last_s = now
        dt = max(now - self._last_s, 0.0)
        self._last_s = now
        self._armed_seen = self._armed_seen or state.armed
        self._watch.look(state)
        decision = self._sound(self._steps[self.stage], state, now, dt, late_s)
        events, self._events = tuple(self._events), []
        return Tick(
            now - self._began_s,
            self.stage,
            self.phases_flown[-1] if self.stage is Stage.FLY and self.phases_flown else self.stage.name.lower(),
            decision.target,
            decision.requests,
            state,
            decision.setpoint,
            decision.output,
            self._watch.ground_down_m,
            late_s,
            events,
        )

    def _sound(self, step: "_Step", state: VehicleState, now: float, dt: float, late_s: float) -> Decision:
        """The decision of a stage. Whatever a compensator makes of a good state, it does not reach the motors."""
        requests: tuple[Request, ...] = ()
        try:
            decision = step(state, now, dt, late_s)
            problem = decision.target and unfit(
                decision.target, self.settings.guards, self.settings.controller.max_throttle
            )
            if not problem:
                return decision
            requests = decision.requests
        except (ArithmeticError, ValueError) as error:
            problem = f"control failed ({error})"
        self._watch.failure = problem
        if self.stage is not Stage.LAND:
            return self._answer(Breach(Answer.HAND_OVER, problem), state, now)
        self._note(problem, "silence")
        self._silent = True
        return Decision(None, requests + self._land_request(state))

    # --- stages: (state, now, dt, late) -> (target, requests, setpoint, output) ----------------------------------

    def _wait(self, state: VehicleState, now: float, dt: float, late_s: float) -> Decision:
        problem = self._watch.defect(state)
        if self._watch.want_land:
            self._end(self._watch.want_land)
        elif problem is None and state.armed:
            self._end("the vehicle is armed already, expected it to stand disarmed on the ground")
        elif problem is None:
            self._remember_home(state)
            self._enter(Stage.STREAM, now)
        elif now - self._stage_s > READY_TIMEOUT_S:
            self._end(f"no usable state came from the autopilot in {READY_TIMEOUT_S:g} s: {problem}")
        return _NOTHING

    def _stream(self, state: VehicleState, now: float, dt: float, late_s: float) -> Decision:
        problem = "somebody else armed the vehicle" if state.armed else self._watch.objection(state)
        if problem is not None:  # nothing has been asked for yet, so there is nothing to undo
            self._end(problem)
            return _NOTHING
        if now - self._stage_s < STREAM_FIRST_S:
            return Decision(self._idle_target())
        self._enter(Stage.START, now)
        return Decision(self._idle_target(), (Request.OFFBOARD,))

    def _start(self, state: VehicleState, now: float, dt: float, late_s: float) -> Decision:
        in_offboard = state.mode == "OFFBOARD"
        if not in_offboard and (self._offboard_seen or state.armed):
            return self._answer(
                Breach(Answer.RELEASE, f"the autopilot went to {state.mode or 'an unknown mode'}"), state, now
            )
        self._offboard_seen = in_offboard
        problem = self._watch.objection(state)
        if problem is None and now - self._stage_s > START_TIMEOUT_S:
            problem = (
                f"the autopilot did not get ready in {START_TIMEOUT_S:g} s: "
                f"armed is {state.armed}, mode is {state.mode or 'unknown'}, expected OFFBOARD"
            )
        if problem is not None and not (state.armed or self._arm_asked):
            self._end(problem)
            return _NOTHING
        if problem is not None:  # it may be armed by now: see to it that it is disarmed
            return self._answer(Breach(Answer.HAND_OVER, problem), state, now)
        requests: tuple[Request, ...] = ()
        if state.armed:
            self._remember_home(state)
            self._enter(Stage.SPOOL_UP, now)
        elif in_offboard and not self._arm_asked:
            # Not before: armed in another mode, the vehicle would follow that mode's idea of a take-off.
            self._arm_asked = True
            requests = (Request.ARM,)
        return Decision(self._idle_target(), requests)

    def _spool_up(self, state: VehicleState, now: float, dt: float, late_s: float) -> Decision:
        breach = self._breach(state, late_s, dt)
        if breach is not None:
            return self._answer(breach, state, now)
        share = (now - self._stage_s) / SPOOL_UP_S
        if share >= 1.0:
            self._enter(Stage.FLY, now)
            self._memory = Memory()
            return self._fly(state, now, 0.0, late_s)
        curve = self.vehicle.throttle
        hover = curve.offset + curve.per_newton * self.vehicle.weight_n
        return Decision(AttitudeTarget(_heading(self._heading_rad), 0.5 * share * hover))

    def _fly(self, state: VehicleState, now: float, dt: float, late_s: float) -> Decision:
        self.flight_s = now - self._stage_s
        breach = self._breach(state, late_s, dt)
        if breach is not None:
            return self._answer(breach, state, now)
        phase = self.mission.phase_at(self.flight_s)
        if not self.phases_flown or self.phases_flown[-1] != phase.name:
            self.phases_flown.append(phase.name)
        if self.flight_s >= self.mission.duration_s:
            return self._begin_landing("completed", state, now)
        setpoint = self._setpoint(self.flight_s)
        output = self._control(setpoint, state, dt)
        return Decision(output.target, (), setpoint, output)

    def _land(self, state: VehicleState, now: float, dt: float, late_s: float) -> Decision:
        """The autopilot lands. Until it has taken the mode we hold our place, while our state is good, not for long."""
        if self._over(state, now):
            self._enter(Stage.DONE, now)
            return _NOTHING
        if self._let_go is not None:
            return self._leave(self._let_go, state, now)
        if state.mode not in ("OFFBOARD", "LAND"):
            self._note(f"the autopilot went to {state.mode or 'an unknown mode'}", "release")
            self._watch.want_land = None
            self._enter(Stage.RELEASED, now)
            return _NOTHING
        if now - self._stage_s > LAND_TIMEOUT_S:
            self._end(f"{self.ended}; the autopilot did not land and disarm in {LAND_TIMEOUT_S:g} s")
            return _NOTHING
        breach = self._breach(state, late_s, dt)
        if breach is not None and breach.answer is Answer.HAND_OVER and not self._silent:
            self._note(breach.reason, "silence")
        if breach is not None and breach.answer is not Answer.LAND:
            self._silent = True
        if now - self._stage_s < LAND_MODE_TIMEOUT_S and not self._silent and self._hold is not None:
            output = self._control(self._hold, state, dt)
            return Decision(output.target, self._land_request(state), self._hold, output)
        self._silent = True
        return Decision(None, self._land_request(state))

    def _leave(self, reason: str, state: VehicleState, now: float) -> Decision:
        """No more targets, and gone as soon as the autopilot has taken its land mode, or does not answer."""
        if not self._let_go_s:
            self._note(reason, "hand over")
            self.ended = f"{self.ended}; {reason}"
            self._let_go_s = now
        if state.mode != "OFFBOARD" or now - self._let_go_s > LET_GO_S:
            self._enter(Stage.DONE, now)
            return _NOTHING
        return Decision(None, self._land_request(state))

    def _released(self, state: VehicleState, now: float, dt: float, late_s: float) -> Decision:
        """Somebody else flies: record until the vehicle is disarmed, never take the mode back."""
        if not state.connected and now - self._stage_s > LAND_TIMEOUT_S:
            self._end(f"{self.ended}; the link did not come back in {LAND_TIMEOUT_S:g} s")
        elif self._over(state, now) or self._watch.want_land:
            self._enter(Stage.DONE, now)
        return _NOTHING

    def _idle(self, state: VehicleState, now: float, dt: float, late_s: float) -> Decision:
        return _NOTHING

    # --- inside --------------------------------------------------------------------------------------------------

    def _over(self, state: VehicleState, now: float) -> bool:
        """The motors are off, and no arming of ours is under way that could still turn them on."""
        under_way = self._arm_asked and not self._armed_seen and now - self._stage_s < ARM_SETTLE_S
        return not state.armed and not under_way

    def _breach(self, state: VehicleState, late_s: float, dt: float) -> Breach | None:
        found = self._watch.breach(state, self.flight_s, late_s, dt, self.stage is not Stage.SPOOL_UP)
        if found is None and self._watch.want_land and self.stage is not Stage.LAND:
            return Breach(Answer.LAND, self._watch.want_land)
        return found

    def _answer(self, breach: Breach, state: VehicleState, now: float) -> Decision:
        if breach.answer is Answer.RELEASE:
            self._note(breach.reason, breach.answer.value)
            self.ended = breach.reason
            self._watch.want_land = None  # it cannot be done any more; a later one ends the recording
            self._enter(Stage.RELEASED, now)
            return _NOTHING
        self._silent = breach.answer is Answer.HAND_OVER
        return self._begin_landing(breach.reason, state, now)

    def _begin_landing(self, reason: str, state: VehicleState, now: float) -> Decision:
        self._note(reason, Answer.HAND_OVER.value if self._silent else Answer.LAND.value)
        self.ended = reason
        self._hold = Setpoint(state.position_ned_m, yaw_rad=self._yaw_rad)
        self._enter(Stage.LAND, now)
        if self._silent:
            return Decision(None, self._land_request(state))
        output = self._control(self._hold, state, 0.0)
        return Decision(output.target, self._land_request(state), self._hold, output)

    def _land_request(self, state: VehicleState) -> tuple[Request, ...]:
        """Asked for once, when the mode is known to be ours: after a stall somebody else may have taken it."""
        if self._land_asked or not self._mode_is_ours(state):
            return ()
        self._land_asked = True
        return (Request.LAND,)

    def _mode_is_ours(self, state: VehicleState) -> bool:
        return state.mode == "OFFBOARD" and state.age_s("heartbeat") <= MODE_FRESH_S

    def _control(self, setpoint: Setpoint, state: VehicleState, dt: float) -> ControlOutput:
        output = control(
            setpoint,
            state,
            self._memory,
            dt,
            self._watch.ground_down_m,
            self.vehicle,
            self.settings.controller,
            self.compensator,
        )
        self._memory = output.memory
        if output.compensation.trust < 1.0 and not self._faded:
            self._faded = True
            self._note("the compensator is beyond the heights of its data", "fade out")
        return output

    def _setpoint(self, t_s: float) -> Setpoint:
        position, velocity, acceleration = self.mission.reference(t_s)
        north, east, _ = self._watch.home
        return Setpoint(
            (north + position[0], east + position[1], self._watch.ground_down_m - position[2]),
            (velocity[0], velocity[1], -velocity[2]),
            (acceleration[0], acceleration[1], -acceleration[2]),
            self._yaw_rad,
        )

    def _remember_home(self, state: VehicleState) -> None:
        self._watch.home = state.position_ned_m
        if self.settings.height_datum == "takeoff":
            self._watch.ground_down_m = self._watch.home[2] + self.settings.rest_height_m
        self._heading_rad = euler_from_quaternion(state.attitude)[2]
        self._yaw_rad = self._heading_rad if self.mission.yaw_rad is None else self.mission.yaw_rad

    def _idle_target(self) -> AttitudeTarget:
        """No thrust, the heading we stand in."""
        return AttitudeTarget(_heading(self._heading_rad), 0.0)

    def _note(self, what: str, answer: str) -> None:
        self._events.append(Event(self._last_s - (self._began_s or 0.0), what, answer))

    def _enter(self, stage: Stage, now: float) -> None:
        self.stage = stage
        self._stage_s = now

    def _end(self, reason: str) -> None:
        self._note(reason, "end")
        self.ended = reason
        self.stage = Stage.DONE


_NOTHING = Decision()
_Step = Callable[[VehicleState, float, float, float], Decision]
"""A stage: (state, now, dt, late)."""


def _heading(yaw_rad: float) -> Quat:
    return math.cos(0.5 * yaw_rad), 0.0, 0.0, math.sin(0.5 * yaw_rad)
