"""The guards with what they must remember: the state before, a floor once passed, what failed and what was asked."""

import math

from quadctl.flight.continuity import Continuity
from quadctl.flight.guards import Answer, Breach, defect, floor, inspect
from quadctl.flight.settings import FlightSettings
from quadctl.missions import Mission
from quadctl.state import Vec3, VehicleState


class Supervisor:
    """Says at every tick whether the flight may begin, or go on."""

    def __init__(self, mission: Mission, settings: FlightSettings) -> None:
        self._mission = mission
        self._guards = settings.guards
        self._period_s = 1.0 / settings.controller.rate_hz
        self.home: Vec3 = (0.0, 0.0, 0.0)
        """Where the vehicle took off, NED."""
        self.ground_down_m = 0.0
        self.want_land: str | None = None
        """Why somebody wants the flight to end."""
        self.refusal: str | None = None
        """Why the autopilot refused what a start needs."""
        self.failure: str | None = None
        """Why we cannot go on commanding."""
        self.restarted = False
        """The autopilot's clock has begun anew: it has forgotten what we asked of it."""
        self._boots: int | None = None
        self._continuity = Continuity(settings.guards.continuity)
        self._above_floor = False

    def look(self, state: VehicleState) -> None:
        """At every tick, before anything is asked."""
        self._boots = state.boots if self._boots is None else self._boots
        self.restarted = self.restarted or state.boots != self._boots

    def defect(self, state: VehicleState) -> str | None:
        """Why the flight cannot stand on this state, or None."""
        least_v = self._guards.min_battery_v
        if least_v > 0.0 and not state.battery_v >= least_v:
            return f"the battery is at {state.battery_v:.2f} V, expected {least_v:g} V or more"
        return defect(state, self._guards)

    def objection(self, state: VehicleState) -> str | None:
        """Why the flight must not begin, or None."""
        restarted = "the autopilot restarted" if self.restarted else None
        return self.want_land or self.refusal or self.failure or restarted or self.defect(state)

    def breach(self, state: VehicleState, flight_s: float, late_s: float, dt: float, off_ground: bool) -> Breach | None:
        """Why the flight must not go on as it does, or None.

        `late_s` and `dt` are the lateness of this tick and its distance from the last; `off_ground` is False for a
        vehicle that stands, whose state need not move. A wish to land is not among the reasons.
        """
        north, east, down = state.position_ned_m
        height_m = self.ground_down_m - down
        self._above_floor = self._above_floor or height_m >= max(floor(self._mission.limits), 0.0)
        found = inspect(
            state,
            flight_s,
            self._mission.duration_s,
            height_m,
            math.hypot(north - self.home[0], east - self.home[1]),
            self._guards,
            self._mission.limits,
            self._above_floor,
        )
        stall = self._stall(late_s, dt)
        if found is not None and found.answer is Answer.RELEASE:  # goes before our own troubles
            return found if stall is None else found._replace(reason=f"{stall}, then {found.reason}")
        if self.restarted:
            return Breach(Answer.RELEASE, "the autopilot restarted")
        problem = self.failure or stall
        if problem is not None:
            return Breach(Answer.HAND_OVER, problem)
        if found is not None and found.answer is Answer.HAND_OVER:
            return found
        broken = self._continuity.defect(state) if off_ground else None
        return found if broken is None else Breach(Answer.HAND_OVER, broken)

    def _stall(self, late_s: float, dt: float) -> str | None:
        """Why this tick comes too late to go on, or None."""
        stalled_s = max(late_s, dt - self._period_s)
        return f"the control loop stalled for {stalled_s:.2f} s" if stalled_s > self._guards.max_tick_late_s else None
