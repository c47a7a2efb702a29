"""The guards and their memory: the last state, whether the floor was passed, failures, and requests to land."""

import math

from quadctl.flight.pilot.continuity import Continuity
from quadctl.flight.pilot.guards import Answer, Breach, Guard, defect, inspect
from quadctl.flight.pilot.reasons import Kind, Reason, reason
from quadctl.flight.pilot.settings import FlightSettings
from quadctl.flight.pilot.standing import not_standing, posture
from quadctl.flight.pilot.steering import Home
from quadctl.missions import Mission
from quadctl.state import VehicleState

ARM_SETTLE_S = 2.0
"""Longest time after which an arming request that was given up may still take effect."""
MODE_FRESH_S = 0.7
"""Largest age of the word on the mode that shows that the mode is still ours to change: PX4 tells it every 0.51 s, and
within 0.06 s of a change."""
HEARTBEAT_S = 1.0
"""Interval of heartbeats, which some autopilots do not change; others tell the mode more often."""

SILENT_S, GONE_S = 1.0, 2.0
"""Silence after which the loop's own time is counted, and that time until the autopilot counts as gone: so a stall of
the loop is not taken for a silence."""
LEFT_GROUND_M = 0.1
"""Climb above the height at rest after which the vehicle has left the ground, and its height is guarded."""


class Supervisor:
    """Decides at every tick if the flight may begin, or go on."""

    def __init__(self, mission: Mission, settings: FlightSettings, home: Home) -> None:
        self._mission = mission
        self._guards = settings.guards
        self._height_datum = settings.height_datum
        self._period_s = 1.0 / settings.controller.rate_hz
        self._home = home
        self.arm_asked = False
        self.armed_seen = False
        self.want_land: Reason | None = None
        """Reason why somebody wants the flight to end."""
        self.refusal: Reason | None = None
        """Reason why the autopilot refused a request that a start needs."""
        self.failure: Reason | None = None
        """Reason why we cannot go on commanding."""
        self.restarted = False
        """True when the autopilot has restarted, and forgotten our requests."""
        self._boots: int | None = None
        self._continuity = Continuity(settings.guards.continuity)
        self._cleared = False
        self._stall: Reason | None = None
        self._unheard_s = 0.0
        self._stalled_s = -math.inf
        """Time at which the last stall was noticed."""

    @property
    def max_over_time_s(self) -> float:
        return self._guards.max_over_time_s

    def look(self, state: VehicleState, late_s: float, dt: float) -> None:
        """Take in the state, at every tick, before any question. `late_s`: its lateness; `dt`: time since the last."""
        self.armed_seen = self.armed_seen or state.armed
        stalled_s = max(late_s, dt - self._period_s)
        stalled = stalled_s > self._guards.max_tick_late_s
        self._stall = reason(Kind.STALLED, stalled_s=stalled_s) if stalled else None
        self._stalled_s = state.time_s if stalled else self._stalled_s
        heard = not SILENT_S < state.silence_s < math.inf  # or never yet
        self._unheard_s = 0.0 if heard else self._unheard_s + min(dt, self._guards.max_tick_late_s)
        self._boots = state.boots if self._boots is None else self._boots
        self.restarted = self.restarted or state.boots != self._boots

    @property
    def gone(self) -> bool:
        """True when nothing at all has come from the autopilot for three seconds."""
        return self._unheard_s > GONE_S

    def defect(self, state: VehicleState) -> Reason | None:
        """Reason why a flight cannot begin with this state, or None."""
        least_v = self._guards.min_battery_v
        if least_v > 0.0 and not state.battery_v >= least_v:
            return reason(Kind.BATTERY_AT_START, battery_v=state.battery_v, least_v=least_v)
        if state.why_battery_empty is not None:
            return reason(Kind.TOLD, text=state.why_battery_empty)
        found = defect(state, self._guards)
        return found.reason if found else None

    def unready(self, state: VehicleState) -> Reason | None:
        """Reason why the autopilot would not arm in the mode that it is in, or None.

        Not to be asked while a change of mode is under way: its readiness is about a mode that it has not told yet.
        """
        if state.ready_to_arm or state.armed:
            return None
        return reason(Kind.NOT_READY, mode=state.mode)

    def unsettled(self, state: VehicleState) -> Reason | None:
        """Reason why a vehicle that is to take off does not seem to stand on the ground, or None."""
        expected = not_standing(state, self._height_datum)
        return expected and reason(Kind.NOT_STANDING, posture=posture(state), expected=expected)

    def objection(self, state: VehicleState) -> Reason | None:
        """Reason why the flight must not begin, or None."""
        restarted = Reason(Kind.RESTARTED) if self.restarted else None
        return self.want_land or self.refusal or self.failure or restarted or self.defect(state)

    def mode_is_ours(self, state: VehicleState) -> bool:
        """True when nobody else can be thought to have the mode, so that another may be asked for.

        A fresh word on the mode shows it, as a change is told at once; after a stall, one that has not waited in a
        queue with an old state. So does a line that has just gone silent, if the loop has kept time since the last
        word: the other direction may still work. After a stall, the last word may be a thing of the past.
        """
        told_s = state.time_s - state.mode_age_s
        current = state.control_age_s <= self._guards.max_state_age_s
        silent_s = min(state.age_s("position"), state.age_s("attitude"), state.mode_age_s)
        just_silent = silent_s > self._guards.max_state_age_s and state.mode_age_s <= HEARTBEAT_S + MODE_FRESH_S
        if told_s > self._stalled_s:
            return state.offboard and (state.mode_age_s <= MODE_FRESH_S or just_silent)
        return state.offboard and state.mode_age_s <= MODE_FRESH_S and current

    def motors_off(self, state: VehicleState, given_up_s: float) -> bool:
        """True when the vehicle is disarmed and no arming request, given up `given_up_s` ago, can still take effect."""
        under_way = self.arm_asked and not self.armed_seen and given_up_s < ARM_SETTLE_S
        return not state.armed and not under_way

    @property
    def _clear_height_m(self) -> float:
        """Height at which a vehicle has left the ground and passed the floor, in spite of an estimate that wanders."""
        return max(self._mission.limits.min_z_m, self._home.rest_height_m + LEFT_GROUND_M)

    def breach(self, state: VehicleState, in_air_s: float, off_ground: bool = True) -> Breach | None:
        """Breach because of which the flight must not go on as it does, or None.

        `off_ground` is False for a vehicle that stands, whose state need not move. A wish to land is not among the
        reasons.
        """
        height_m = self._home.height_m(state)
        self._cleared = self._cleared or height_m >= self._clear_height_m
        found = inspect(
            state,
            in_air_s,
            self._mission.duration_s,
            height_m,
            self._home.distance_m(state),
            self._guards,
            self._mission.limits,
            self._cleared,
        )
        if found is not None and found.answer is Answer.RELEASE:  # goes before our own troubles
            if self._stall is None:
                return found
            return found._replace(reason=reason(Kind.STALLED_BEFORE, **self._stall.facts, reason=found.reason))
        if self.restarted:
            return Breach(Answer.RELEASE, Reason(Kind.RESTARTED))
        if self.failure is not None:
            return Breach(Answer.HAND_OVER, self.failure)
        if self._stall is not None:
            return Breach(Answer.HAND_OVER, self._stall, Guard.TICK_LATE)
        if found is not None and found.answer is Answer.HAND_OVER:
            return found
        broken = self._continuity.defect(state) if off_ground else None
        return found if broken is None else Breach(Answer.HAND_OVER, broken)
