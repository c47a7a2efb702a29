"""The pilot: decides at each tick of a flight, from the first message to the disarmed motors.

A state machine without clock and without I/O: the real-time loop and the lockstep simulation call `tick` with the
state and carry out what it asks for. So both fly the very same flight.
"""

import math
from collections.abc import Callable

from quadctl.compensator import Compensator
from quadctl.flight.model_watch.watch import NO_ERROR, ModelWatch
from quadctl.flight.pilot.following import Following
from quadctl.flight.pilot.guards import Answer, Breach, Guard, patience_s, unfit
from quadctl.flight.pilot.landing import Landing
from quadctl.flight.pilot.model_guard import ModelGuard
from quadctl.flight.pilot.progress import Progress
from quadctl.flight.pilot.reasons import Kind, Reason, reason
from quadctl.flight.pilot.settings import FlightSettings
from quadctl.flight.pilot.steering import Home, Steering
from quadctl.flight.pilot.supervisor import Supervisor
from quadctl.flight.pilot.tick import Decision, Request, Stage, Tick
from quadctl.missions import Mission
from quadctl.model import Model
from quadctl.state import StatusText, VehicleState

CHECKS_EVERY_S = 5.0
"""Interval at which an autopilot that is not ready is asked for the reasons."""
REASONS_S = 10.0
"""Largest age of the texts that may be those reasons."""
START_TIMEOUT_S = 8.0
TRIES = 8
"""Number of requests to arm or to take off without an answer after which the start has failed: each waits for half a
second."""
ARM_AGAIN_S = 1.0
"""Time after which a refused arming is asked for again: PX4 checks offboard up to 0.6 s after it has entered it."""
STAND_DOWN_S = 2.0
"""Longest wait for the autopilot to leave offboard after a start that was given up."""
CLIMB_TIMEOUT_S = 20.0
CLIMBED_SHARE, CLIMBED_M_S = 0.9, 0.2
"""Share of the height, and vertical speed, at which the autopilot's own take-off counts as finished."""
STREAM_FIRST_S = 1.0
"""Time of idle setpoints before offboard is asked for: autopilots want a stream first."""
END_EARLY = "end early"
"""Answer to what a mission was flown for being known."""
OFF_GROUND_M = 0.1
"""Climb above the place of take-off from which on the flight is compared with the model."""
SPOOL_UP_S = 1.0
"""Time in which the throttle rises from idle to half of hover while the vehicle still stands."""

_Step = Callable[[VehicleState, float], Decision]
"""Function of a stage: (state, time since the last tick) -> decision."""
_NOTHING = Decision()


class Pilot:
    """Flies one mission once."""

    def __init__(
        self,
        mission: Mission,
        body: Model,
        settings: FlightSettings,
        compensator: Compensator,
        autopilot_takes_off: bool = False,
        autopilot_stays_up: bool = False,
    ) -> None:
        """`autopilot_stays_up`: without targets it stays in the air for as long as it hears this program."""
        self.mission = mission
        self.settings = settings
        self.phases_flown: list[str] = []
        self._autopilot_takes_off = autopilot_takes_off
        first = mission.phases[0]
        self.take_off_m = mission.reference(first.end_s)[0][2]
        """Height of the autopilot's own take-off, which replaces the mission's first phase and ends at its end."""
        self._begin_at_s = first.end_s if autopilot_takes_off else 0.0
        self._home = Home()
        self._progress = Progress()
        self._watch = Supervisor(mission, settings, self._home)
        self._steering = Steering(mission, body.vehicle, settings, compensator, self._home)
        self._following = Following(settings.guards.following, settings.controller, body.vehicle)
        self._model = ModelWatch(compensator.model, mission.place)
        self._model_guard = ModelGuard(settings.guards.model_error)
        self._landing = Landing(self._progress, self._watch, self._steering, autopilot_stays_up)
        self._last: tuple[VehicleState, Decision] = VehicleState(0.0), _NOTHING
        self._offboard_seen = False
        self._faded = False
        self._texts: tuple[StatusText, ...] = ()
        self._gone = False
        self._checks_asked_s = -math.inf
        self._arm_refused: tuple[float, str] | None = None
        """Time and reason of the last refusal to arm."""
        self._unanswered = 0
        self._lost: Request | None = None
        """Request to arm or to take off that was not answered, and may have arrived all the same."""
        self._take_off_refused: str | None = None
        """Reason for which a repeated take-off was refused."""
        self._steps: dict[Stage, _Step] = {
            Stage.WAIT: self._wait,
            Stage.STREAM: self._stream,
            Stage.START: self._start,
            Stage.STAND_DOWN: self._stand_down,
            Stage.SPOOL_UP: self._spool_up,
            Stage.CLIMB: self._climb,
            Stage.FLY: self._fly,
            Stage.LAND: self._landing.land,
            Stage.RELEASED: self._landing.released,
            Stage.DONE: lambda state, dt: _NOTHING,
        }

    @property
    def stage(self) -> Stage:
        return self._progress.stage

    @property
    def done(self) -> bool:
        return self.stage is Stage.DONE

    @property
    def ended(self) -> str:
        """End of the flight, in words: `completed`, or the reason why it was not; empty before."""
        gone = self.done and self._watch.gone
        return f"{self._progress.ended}; {Reason(Kind.GONE_AT_END)}" if gone else self._progress.ended

    @property
    def autopilot_gone(self) -> bool:
        """True when nothing at all comes from the autopilot any more."""
        return self._watch.gone

    @property
    def flight_s(self) -> float:
        """Time in the mission."""
        return self._progress.flight_s

    def distance_m(self, state: VehicleState) -> float:
        """Horizontal distance from the take-off point."""
        return self._home.distance_m(state)

    def ask_to_land(self, why: str) -> None:
        """Land at the next tick (Ctrl-C, SIGTERM, a button)."""
        self._watch.want_land = reason(Kind.TOLD, text=why)

    def ask_to_let_go(self, why: str) -> None:
        """Hand over at the next tick (a second Ctrl-C): no more targets, the autopilot lands, and we are gone."""
        wish = reason(Kind.TOLD, text=why)
        self._watch.want_land = self._watch.want_land or wish
        self._landing.let_go(wish)

    def request_failed(self, request: Request, why: str, refused: bool = True) -> None:
        """Note that a request failed; `refused`: by an answer, so that nothing was done.

        A refused arming is asked for again for some seconds; an arming, a take-off or a landing that was not answered
        some times. A take-off is refused to a vehicle in the air, so the refusal of a repeated one counts only when the
        vehicle does not climb. Any other failure of a start ends the flight, and a failed landing the targets.
        """
        if request in (Request.CHECKS, Request.LEAVE_OFFBOARD):
            return
        if request is Request.LAND:
            if self.stage is Stage.LAND:
                self._landing.failed(reason(Kind.TOLD, text=why), refused)
        elif request is Request.ARM and refused:
            self._watch.arm_asked = False
            self._arm_refused = self._progress.now_s, why
        elif request in (Request.ARM, Request.TAKE_OFF) and not refused and self._unanswered < TRIES - 1:
            self._unanswered += 1
            self._lost = request
        elif request is Request.TAKE_OFF and refused and self._unanswered:
            self._take_off_refused = why
        else:
            self._watch.refusal = reason(Kind.TOLD, text=why)

    def fail(self, why: str) -> None:
        """Note that a target could not be sent: no more targets, and the autopilot lands."""
        self._watch.failure = reason(Kind.TOLD, text=why)

    def tick(self, state: VehicleState, late_s: float) -> Tick:
        """Decide what to do now. `late_s`: how late this tick is."""
        dt = self._progress.advance(state.time_s)
        self._watch.look(state, late_s, dt)
        decision = self._sound(self._steps[self.stage], state, dt)
        self._notice_fading(decision)
        self._notice_silence()
        self._last = state, decision
        texts = self._notice_texts(state)
        flies = self.stage is Stage.FLY and bool(self.phases_flown)
        return Tick(
            self._progress.time_s,
            self.stage,
            self.phases_flown[-1] if flies else self.stage.name.lower(),
            decision.target,
            decision.requests,
            state,
            decision.setpoint,
            decision.output,
            self._home.ground_down_m,
            late_s,
            self._progress.take_events(),
            texts,
            self._model.error if flies else NO_ERROR,
        )

    def reflect(self) -> None:
        """Compare the last tick with the model that flies, off the ground, and note what has changed.

        To be called when the target of the tick is out, which must not wait for it.
        """
        state, decision = self._last
        climbed_m = self._home.position_ned_m[2] - state.position_ned_m[2]
        if self.stage is not Stage.FLY or state.landed or not state.finite or climbed_m < OFF_GROUND_M:
            self._model.pause()
            return
        try:
            news = self._model.look(state, self._home.ground_down_m, self._progress.time_s)
        except (ArithmeticError, ValueError):  # a model beyond its range is no reason to end a flight
            self._model.pause()
            return
        for change in news.begun:
            self._progress.note(reason(Kind.CHANGED, change=change), "")
        for name in news.over:
            self._progress.note(reason(Kind.AS_MODELLED, name=name), "")
        if decision.target is not None and decision.setpoint is not None:
            self._model.sent(state.time_s, decision.target, decision.setpoint)

    def _sound(self, step: _Step, state: VehicleState, dt: float) -> Decision:
        """Decision of the present stage, with a target only if it is fit to reach the motors."""
        decision = _NOTHING
        try:
            decision = step(state, dt)
            problem = decision.target and unfit(
                decision.target, self.settings.guards, self.settings.controller.max_throttle
            )
            if not problem:
                return decision
        except (ArithmeticError, ValueError) as error:
            problem = reason(Kind.CONTROL_FAILED, error=error)
        self._watch.failure = problem
        if self.stage is Stage.LAND:
            return self._landing.unsound(problem, decision, state)
        return self._landing.answer(Breach(Answer.HAND_OVER, problem), state)

    # --- stages: (state, time since the last tick) ---------------------------------------------------------------

    def _wait(self, state: VehicleState, dt: float) -> Decision:
        problem = self._watch.unready(state) or self._watch.defect(state)
        if problem is None and not state.armed:
            problem = self._watch.unsettled(state)
        allowed_s = patience_s(state)
        if self._watch.want_land:
            self._progress.end(self._watch.want_land)
        elif problem is None and state.armed:
            self._progress.end(Reason(Kind.ARMED_ALREADY))
        elif problem is None:
            self._steering.start_at(state)
            self._progress.enter(Stage.STREAM)
        elif self._progress.in_stage_s > allowed_s:
            reasons = [] if state.ready_to_arm else self._reasons(state)
            self._progress.end(reason(Kind.NO_USABLE_STATE, waited_s=allowed_s, problem=problem, texts=reasons))
        elif not state.ready_to_arm and self._progress.now_s - self._checks_asked_s > CHECKS_EVERY_S:
            self._checks_asked_s = self._progress.now_s
            return Decision(requests=(Request.CHECKS,))
        return _NOTHING

    def _stream(self, state: VehicleState, dt: float) -> Decision:
        problem = self._watch.objection(state) or self._watch.unready(state)
        problem = Reason(Kind.ARMED_BY_OTHERS) if state.armed else problem
        if problem is not None:  # nothing has been asked for yet, so there is nothing to undo
            self._progress.end(problem)
            return _NOTHING
        if self._progress.in_stage_s < STREAM_FIRST_S:
            return self._idle()
        self._progress.enter(Stage.START)
        return self._idle((Request.OFFBOARD,))

    def _start(self, state: VehicleState, dt: float) -> Decision:
        if not state.offboard and (self._offboard_seen or state.armed):
            return self._landing.answer(Breach(Answer.RELEASE, reason(Kind.WENT_TO, mode=state.mode)), state)
        self._offboard_seen = state.offboard
        problem = self._watch.objection(state)
        if problem is None and self._progress.in_stage_s > START_TIMEOUT_S:
            problem = self._why_not_started(state)
        if problem is not None and not (state.armed or self._watch.arm_asked):
            return self._give_up(problem, state)
        if problem is not None:  # it may be armed by now: see to it that it is disarmed
            return self._landing.answer(Breach(Answer.HAND_OVER, problem), state)
        if state.armed:
            self._steering.start_at(state)
            if not self._autopilot_takes_off:
                self._progress.enter(Stage.SPOOL_UP)
                return self._idle()
            self._progress.enter(Stage.CLIMB)
            self._progress.take_off()
            self._unanswered, self._lost = 0, None
            return self._idle((Request.TAKE_OFF,))
        if state.offboard and self._lost is Request.ARM:
            self._lost = None
            return self._idle((Request.ARM,))
        if state.offboard and not self._watch.arm_asked:
            # Not before: armed in another mode, the vehicle would follow that mode's idea of a take-off.
            return self._idle(self._ask_to_arm())
        return self._idle()

    def _stand_down(self, state: VehicleState, dt: float) -> Decision:
        """One tick of STAND_DOWN: nothing is sent, and the flight ends when offboard has been left."""
        if not state.offboard or state.armed or self._progress.in_stage_s > STAND_DOWN_S:
            self._progress.enter(Stage.DONE)
        return _NOTHING

    def _spool_up(self, state: VehicleState, dt: float) -> Decision:
        breach = self._breach(state)
        if breach is not None:
            return self._landing.answer(breach, state)
        share = self._progress.in_stage_s / SPOOL_UP_S
        if share < 1.0:
            return self._steering.standing(0.5 * share)
        self._steering.start_at(state)  # again: the ground is where the estimate has it at take-off
        return self._lift_off(state)

    def _climb(self, state: VehicleState, dt: float) -> Decision:
        """One tick of CLIMB: the autopilot takes off, and we are silent, as a target would end its take-off."""
        breach = self._breach(state)
        if breach is None and self._watch.refusal is not None:
            breach = Breach(Answer.HAND_OVER, self._watch.refusal)
        if breach is None and self._progress.in_stage_s > CLIMB_TIMEOUT_S:
            told = self._take_off_refused
            why = reason(Kind.TOLD, text=told) if told else reason(Kind.NO_TAKE_OFF, waited_s=CLIMB_TIMEOUT_S)
            breach = Breach(Answer.HAND_OVER, why)
        if breach is not None:  # no targets yet, so none while the landing is asked for either
            silent = Answer.HAND_OVER if breach.answer is Answer.LAND else breach.answer
            return self._landing.answer(breach._replace(answer=silent), state)
        if self._lost is Request.TAKE_OFF and state.landed:
            self._lost = None
            return Decision(requests=(Request.TAKE_OFF,))
        climbed_m = self._home.position_ned_m[2] - state.position_ned_m[2]
        if climbed_m < CLIMBED_SHARE * self.take_off_m or abs(state.velocity_ned_m_s[2]) > CLIMBED_M_S:
            return _NOTHING
        return self._lift_off(state)

    def _lift_off(self, state: VehicleState) -> Decision:
        self._progress.enter(Stage.FLY)
        self._progress.take_off()
        self._steering.forget()
        return self._fly(state, 0.0)

    def _fly(self, state: VehicleState, dt: float) -> Decision:
        t_s = self._progress.flight_s = self._begin_at_s + self._progress.in_stage_s
        breach = self._breach(state)
        if breach is not None:
            return self._landing.answer(breach, state)
        phase = self.mission.phase_at(t_s)
        if not self.phases_flown or self.phases_flown[-1] != phase.name:
            self.phases_flown.append(phase.name)
        if t_s >= self.mission.duration_s or self._knows_enough():
            return self._landing.begin(self._verdict(), state)
        decision = self._steering.along(t_s, self._begin_at_s, state, dt)
        assert decision.target is not None
        assert decision.setpoint is not None
        rest_down_m = self._home.position_ned_m[2]
        problem = self._following.defect(state, decision.setpoint, decision.target, rest_down_m)
        if problem is not None:
            return self._landing.answer(Breach(Answer.HAND_OVER, problem), state)
        return decision

    # --- inside --------------------------------------------------------------------------------------------------

    def _ask_to_arm(self) -> tuple[Request, ...]:
        """Request to arm; after a refusal the reasons are asked for, and it is repeated when its time has come."""
        if self._arm_refused is None:
            self._watch.arm_asked = True
            return (Request.ARM,)
        refused_s, now_s = self._arm_refused[0], self._progress.now_s
        if self._checks_asked_s < refused_s:
            self._checks_asked_s = now_s
            return (Request.CHECKS,)
        if now_s - refused_s < ARM_AGAIN_S:
            return ()
        self._watch.arm_asked = True
        return (Request.ARM,)

    def _why_not_started(self, state: VehicleState) -> Reason:
        if self._arm_refused is None:
            waited = {"waited_s": START_TIMEOUT_S, "armed": state.armed, "mode": state.mode}
            return reason(Kind.NOT_STARTED, **waited, expected=state.offboard_mode)
        refusal = self._arm_refused[1].rstrip(".")
        return reason(Kind.REFUSED, text=refusal, texts=[text for text in self._reasons(state) if text not in refusal])

    def _give_up(self, why: Reason, state: VehicleState) -> Decision:
        """End a flight before anything was armed, out of offboard again if it was entered for it."""
        self._progress.end(why)
        if not state.offboard:
            return _NOTHING
        self._progress.enter(Stage.STAND_DOWN)
        return Decision(requests=(Request.LEAVE_OFFBOARD,))

    def _breach(self, state: VehicleState) -> Breach | None:
        """Breach because of which the flight must not go on, or None; a wish to land counts."""
        other_vehicle = self._model_guard.defect(self._model.error, state.time_s)
        found = self._watch.breach(state, self._progress.in_air_s, off_ground=self.stage is Stage.FLY)
        if found is None and self._watch.want_land:
            return Breach(Answer.LAND, self._watch.want_land)
        if found is None and other_vehicle:
            return Breach(Answer.LAND, other_vehicle, Guard.MODEL)
        return found

    def _knows_enough(self) -> bool:
        """True once the quantities that the mission is flown for are known as well as it asks for."""
        if not self.mission.until:
            return False
        known = self._model.known
        if not all(known[name].share <= most for name, most in self.mission.until.items()):
            return False
        found = {name: known[name] for name in self.mission.until}
        self._progress.note(reason(Kind.KNOWN, known=found), END_EARLY)
        return True

    def _verdict(self) -> Reason:
        """End of a mission that was flown to its last phase: completed, if it was followed."""
        error_m, allowed_m = self._following.error_rms_m, self.mission.limits.tolerance_m
        if error_m > allowed_m:
            return reason(Kind.NOT_FOLLOWED, error_m=error_m, most_m=allowed_m)
        return Reason(Kind.COMPLETED)

    def _notice_fading(self, decision: Decision) -> None:
        """Note once, for the log, that the compensator has faded."""
        if decision.output is not None and decision.output.compensation.trust < 1.0 and not self._faded:
            self._faded = True
            self._progress.note(Reason(Kind.FADED), "fade out")

    def _notice_silence(self) -> None:
        """Note for the log when the autopilot falls silent altogether, and when it is heard again."""
        if self._watch.gone != self._gone:
            self._gone = self._watch.gone
            self._progress.note(Reason(Kind.GONE if self._gone else Kind.HEARD_AGAIN), "")

    def _notice_texts(self, state: VehicleState) -> tuple[StatusText, ...]:
        """Texts that are new, which are noted for the log."""
        if state.texts is self._texts:
            return ()
        new = tuple(text for text in state.texts if text not in self._texts)
        self._texts = state.texts
        for text in new:
            self._progress.note(reason(Kind.TOLD, text=text), "")
        return new

    def _reasons(self, state: VehicleState) -> list[str]:
        """Latest warnings and errors of an autopilot that does not arm, each once, and its other reasons."""
        since_s = state.time_s - REASONS_S
        told = dict.fromkeys(text.text for text in state.texts if text.grave and text.received_s > since_s)
        return [*told, *state.why_not_ready]

    def _idle(self, requests: tuple[Request, ...] = ()) -> Decision:
        """Level target without thrust; none where the autopilot takes off itself, which a target would prevent."""
        if self._autopilot_takes_off:
            return Decision(requests=requests)
        return self._steering.standing(0.0)._replace(requests=requests)
