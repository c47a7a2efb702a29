"""The end of a flight: the autopilot lands, or somebody else flies. A mode is never taken back from them."""

from quadctl.flight.pilot.guards import Answer, Breach
from quadctl.flight.pilot.progress import Progress
from quadctl.flight.pilot.reasons import Kind, Reason, reason
from quadctl.flight.pilot.steering import Steering
from quadctl.flight.pilot.supervisor import Supervisor
from quadctl.flight.pilot.tick import Decision, Request, Stage
from quadctl.state import Setpoint, VehicleState

HOLD_S = 2.0
"""Longest time for which the position is held while the autopilot enters its land mode."""
ASK_AGAIN_S = 2.0
"""Time after which a failed request to land (a pulled plug) is repeated, while the mode is known to be ours."""
TRIES = 4
"""Number of requests to land without an answer after which the landing has failed: each waits for half a second."""
LANDED_NEWS_S = 0.3
"""Longest time by which the news that it has landed may be behind the news of its mode: they are asked for at 5 Hz."""
LET_GO_S = 1.0
"""Longest time for which a second Ctrl-C waits for the autopilot to enter its land mode."""
UNCONFIRMED_S = 5.0
"""Time after which an autopilot that stays up for our heartbeats, and whose own are lost, no longer gets ours."""
GIVEN_BACK_S = 2.0
"""Time after which a mode of ours that somebody has taken and given back counts as left to nobody."""
LINK_TIMEOUT_S = 60.0
"""Longest wait for a link that is lost while somebody else flies."""


class Landing:
    """The stages LAND and RELEASED, and the transitions into them."""

    def __init__(self, progress: Progress, watch: Supervisor, steering: Steering, stays_up: bool) -> None:
        self._progress = progress
        self._watch = watch
        self._steering = steering
        self._stays_up = stays_up
        self._hold: Setpoint | None = None
        self._silent = False
        self._landing_seen = False
        self._left_s: float | None = None
        """Time at which the autopilot left the modes of a landing: nothing is sent or asked for from then on."""
        self._asked_s: float | None = None
        self._failed = False
        self._unanswered = 0
        self._let_go: Reason | None = None
        self._let_go_s: float | None = None
        self._given_back_s: float | None = None
        """Time since which the mode that somebody had taken is ours again; None: it is not."""

    # --- transitions ---------------------------------------------------------------------------------------------

    def begin(self, why: Reason, state: VehicleState) -> Decision:
        """Begin to land from a valid state."""
        return self.answer(Breach(Answer.LAND, why), state)

    def answer(self, breach: Breach, state: VehicleState) -> Decision:
        """End the flight as a breach demands."""
        self._progress.note(breach.reason, breach.answer.value, breach.guard)
        self._progress.ends = (breach.reason,)
        if breach.answer is Answer.RELEASE:
            return self._release()
        self._silent = breach.answer is Answer.HAND_OVER
        self._hold = self._steering.place_of(state)
        self._progress.enter(Stage.LAND)
        return self._wait_for_mode(state, 0.0)

    def let_go(self, why: Reason) -> None:
        """Stop sending targets at the next tick, and end as soon as the autopilot lands."""
        self._let_go = why

    # --- stages: (state, time since the last tick) ---------------------------------------------------------------

    def land(self, state: VehicleState, dt: float) -> Decision:
        """One tick of LAND: the autopilot lands. Until it has entered the mode, and for HOLD_S at most, the position is
        held, if the state is valid."""
        if self._watch.motors_off(state, self._progress.in_stage_s):
            self._note_disarming(state)
            self._progress.enter(Stage.DONE)
            return Decision()
        if self._let_go is not None:
            return self._leave(self._let_go, state)
        self._landing_seen = self._landing_seen or state.mode == "LAND"
        if self._left_s is not None or not (state.offboard or state.mode == "LAND"):
            return self._yield(state)
        if self._unconfirmed(state):
            self._let_go = Reason(Kind.UNCONFIRMED)
            return self._leave(self._let_go, state)
        if self._too_long():
            return Decision()
        breach = self._watch.breach(state, self._progress.in_air_s)
        if breach is not None and breach.answer is not Answer.LAND:
            if breach.answer is Answer.HAND_OVER and not self._silent:
                self._progress.note(breach.reason, "silence", breach.guard)
            self._silent = True
        return self._wait_for_mode(state, dt)

    def released(self, state: VehicleState, dt: float) -> Decision:
        """One tick of RELEASED: somebody else flies; record until the vehicle is disarmed, never take the mode back."""
        if not state.connected and self._progress.in_stage_s > LINK_TIMEOUT_S:
            self._progress.end(*self._progress.ends, reason(Kind.LINK_NOT_BACK, waited_s=LINK_TIMEOUT_S))
        elif self._given_back(state):
            self._progress.end(*self._progress.ends, reason(Kind.GIVEN_BACK, mode=state.mode))
        elif self._watch.motors_off(state, self._progress.in_stage_s) or self._watch.want_land:
            self._progress.enter(Stage.DONE)
        return Decision()

    # --- failures ------------------------------------------------------------------------------------------------

    def failed(self, why: Reason, refused: bool) -> None:
        """The request to land failed: fall silent, so that the autopilot's own failsafe acts.

        One that was not `refused` but lost is made again first, if the mode is still known to be ours.
        """
        if not refused:
            self._unanswered += 1
            if self._unanswered < TRIES:
                self._asked_s = None
                if self._unanswered == 1:
                    self._progress.note(why, "")
                return
        self._silent = self._failed = True
        if str(why) not in self._progress.ended:
            self._progress.note(why, "silence")
            if self._watch.armed_seen:
                self._progress.ends += (why,)

    def unsound(self, problem: Reason, decision: Decision, state: VehicleState) -> Decision:
        """Land without control, which has failed; the requests of `decision` are kept."""
        self._progress.note(problem, "silence")
        self._silent = True
        return Decision(None, decision.requests + self._request(state))

    # --- inside --------------------------------------------------------------------------------------------------

    def _release(self) -> Decision:
        self._watch.want_land = None  # it cannot be done any more; a later one ends the recording
        self._progress.enter(Stage.RELEASED)
        return Decision()

    def _note_disarming(self, state: VehicleState) -> None:
        """Note that somebody else has disarmed the vehicle, if no landing has."""
        if self._watch.armed_seen and state.offboard and not self._landing_seen:
            self._progress.note(Reason(Kind.DISARMED), Answer.RELEASE.value)
            self._progress.ends += (Reason(Kind.DISARMED),)

    def _wait_for_mode(self, state: VehicleState, dt: float) -> Decision:
        if self._progress.in_stage_s >= HOLD_S:
            self._silent = True
        if self._silent or self._hold is None:
            return Decision(None, self._request(state))
        held = self._steering.towards(self._hold, state, dt)
        return held._replace(requests=self._request(state))

    def _yield(self, state: VehicleState) -> Decision:
        """Release the vehicle to whoever has taken the mode, unless the landing is over.

        An autopilot leaves its land mode when it disarms on the ground, and the messages that say so come later.
        """
        self._left_s = self._progress.now_s if self._left_s is None else self._left_s
        if self._landing_seen and (state.landed or self._progress.now_s - self._left_s < LANDED_NEWS_S):
            self._too_long()
            return Decision()
        self._progress.note(reason(Kind.WENT_TO, mode=state.mode), Answer.RELEASE.value)
        return self._release()

    def _unconfirmed(self, state: VehicleState) -> bool:
        """True when nobody can tell whether the autopilot lands, and our heartbeats would keep it in the air."""
        unheard = not (state.connected or self._landing_seen)
        return self._stays_up and unheard and self._progress.in_stage_s > UNCONFIRMED_S

    def _given_back(self, state: VehicleState) -> bool:
        """True when somebody has given the mode back to us, who do not fly any more, and our heartbeats would keep the
        vehicle in the air."""
        if not (self._stays_up and state.armed and state.offboard):
            self._given_back_s = None
            return False
        now_s = self._progress.now_s
        self._given_back_s = now_s if self._given_back_s is None else self._given_back_s
        return now_s - self._given_back_s > GIVEN_BACK_S

    def _too_long(self) -> bool:
        """True, and the flight is over, when the autopilot has not come down and disarmed in time."""
        if self._progress.in_stage_s <= self._watch.max_over_time_s:
            return False
        given_up = reason(Kind.NOT_LANDED, waited_s=self._watch.max_over_time_s)
        self._progress.end(*self._progress.ends, given_up)
        return True

    def _leave(self, why: Reason, state: VehicleState) -> Decision:
        now_s = self._progress.now_s
        if self._let_go_s is None:
            self._progress.note(why, Answer.HAND_OVER.value)
            self._progress.ends += (why,)
            self._let_go_s = now_s
        if not state.offboard or now_s - self._let_go_s > LET_GO_S:
            self._progress.enter(Stage.DONE)
            return Decision()
        return Decision(None, self._request(state))

    def _request(self, state: VehicleState) -> tuple[Request, ...]:
        """Request to land: made while the motors are on, or may get on, when the mode is known to be ours (after a
        stall somebody else may have taken it), and repeated after a failure."""
        if self._watch.motors_off(state, self._progress.in_stage_s):
            return ()
        now_s = self._progress.now_s
        due = self._asked_s is None or (self._failed and now_s - self._asked_s > ASK_AGAIN_S)
        if not due or not self._watch.mode_is_ours(state):
            return ()
        self._asked_s, self._failed = now_s, False
        return (Request.LAND,)
