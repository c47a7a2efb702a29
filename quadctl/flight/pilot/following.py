"""Guards that compare the flight with its reference: tracking error, contact with the ground, saturation."""

import math

from pydantic import Field

from quadctl.control import ControllerSettings
from quadctl.flight.pilot.reasons import Kind, Reason, reason
from quadctl.flight.pilot.timer import Timer
from quadctl.frames import cos_tilt, tilt
from quadctl.settings import Settings
from quadctl.state import AttitudeTarget, Setpoint, VehicleState
from quadctl.vehicle import Vehicle

SLOW_M_S = 0.5
"""Speed at which a vehicle makes up for a jump of its reference, at least."""
JUMP_M = 0.1
"""Change of the reference between two ticks that counts as a jump."""
STILL_M_S = 0.5
"""Largest vertical speed of a vehicle that does not fall: without its rotors it is passed after 0.05 s."""
GROUND_M, WANTED_M = 0.1, 0.3
"""Largest height above the place of take-off of a vehicle that has not left it, and the height that the reference has
by then."""
TILT_EDGE_DEG = 0.5
"""Distance to the controller's largest tilt within which a target counts as saturated."""


class FollowingLimits(Settings):
    """Limits of these guards, in YAML under `guards: following`; 0 turns a guard off."""

    max_horizontal_error_m: float = Field(default=2.0, ge=0.0)
    """Largest horizontal position error that may last for `max_error_s`."""
    max_vertical_error_m: float = Field(default=0.75, ge=0.0)
    """Largest error of the height that may last for `max_error_s`."""
    max_error_s: float = Field(default=1.0, gt=0.0, le=60.0)
    min_thrust_share: float = Field(default=0.65, ge=0.0, lt=1.0)
    """Smallest share of the weight that the vertical thrust carries for `max_contact_s` without the vehicle falling:
    below it, something else carries the vehicle. Strong ground effects leave 0.75."""
    max_contact_s: float = Field(default=1.5, ge=0.0, le=60.0)
    """Longest contact with the ground in flight, by thrust, by the autopilot's landed state, or without lift-off."""
    max_saturated_s: float = Field(default=2.0, ge=0.0, le=60.0)
    """Longest time for which tilt or throttle may stay at its limit."""


class Following:
    """Compares each tick of a flight with its reference; its numbers must be finite, or an axis' reference nan."""

    def __init__(self, limits: FollowingLimits, controller: ControllerSettings, vehicle: Vehicle) -> None:
        self._limits = limits
        self._controller = controller
        self._vehicle = vehicle
        self._off_horizontally, self._off_vertically = Timer(), Timer()
        self._carried, self._landed, self._left_behind = Timer(), Timer(), Timer()
        self._leaning, self._pushing = Timer(), Timer()
        self._reference: Setpoint | None = None
        self._grace_until_s = -math.inf
        self._airborne_seen = False
        self._square_sum_m2 = 0.0
        self._ticks = 0

    @property
    def error_rms_m(self) -> float:
        """Position error over the flight, RMS, without the time in which a jump is made up for; an axis that is
        flown by velocity has none."""
        return math.sqrt(self._square_sum_m2 / self._ticks) if self._ticks else 0.0

    def defect(
        self, state: VehicleState, setpoint: Setpoint, target: AttitudeTarget, rest_down_m: float
    ) -> Reason | None:
        """Reason why control does not fly this vehicle, or None.

        `target` is sent now, to bring a vehicle at `state` to `setpoint` (NED); it took off from `rest_down_m`, the
        vertical coordinate at rest, down.
        """
        errors = self._errors_m(state, setpoint)
        if state.time_s >= self._grace_until_s:
            self._square_sum_m2 += errors[0] ** 2 + errors[1] ** 2 + errors[2] ** 2
            self._ticks += 1
        return (
            self._contact(state, setpoint, target, rest_down_m)
            or self._saturation(target, state.time_s)
            or self._tracking(errors, state.time_s)
        )

    def _errors_m(self, state: VehicleState, setpoint: Setpoint) -> tuple[float, float, float]:
        at, wanted = state.position_ned_m, setpoint.position_ned_m
        n, e, d = _off(at[0], wanted[0]), _off(at[1], wanted[1]), _off(at[2], wanted[2])
        jump_m = self._jump_m(setpoint, (n, e, d))
        if jump_m > JUMP_M:
            self._grace_until_s = max(self._grace_until_s, state.time_s + jump_m / SLOW_M_S)
        self._reference = setpoint
        return n, e, d

    def _jump_m(self, setpoint: Setpoint, errors_m: tuple[float, float, float]) -> float:
        """Length of the jump of the reference since the last tick.

        After a run that was flown by velocity, the reference of an axis jumps to a place where the vehicle never had to
        be.
        """
        if self._reference is None or setpoint.position_ned_m == self._reference.position_ned_m:
            return 0.0
        axes = zip(setpoint.position_ned_m, self._reference.position_ned_m, errors_m, strict=True)
        jumps = (error if math.isnan(before) else now - before for now, before, error in axes if not math.isnan(now))
        return math.hypot(*jumps)

    def _tracking(self, errors_m: tuple[float, float, float], now_s: float) -> Reason | None:
        if now_s < self._grace_until_s:
            self._off_horizontally.forget()
            self._off_vertically.forget()
            return None
        level_m, height_m = math.hypot(errors_m[0], errors_m[1]), abs(errors_m[2])
        most_level_m, most_height_m = self._limits.max_horizontal_error_m, self._limits.max_vertical_error_m
        longest_s = self._limits.max_error_s
        if self._off_horizontally.held_s(0.0 < most_level_m < level_m, now_s) > longest_s:
            return reason(Kind.ASTRAY, part="horizontal", error_m=level_m, most_m=most_level_m, longest_s=longest_s)
        if self._off_vertically.held_s(0.0 < most_height_m < height_m, now_s) > longest_s:
            return reason(Kind.ASTRAY, part="vertical", error_m=height_m, most_m=most_height_m, longest_s=longest_s)
        return None

    def _contact(
        self, state: VehicleState, setpoint: Setpoint, target: AttitudeTarget, rest_down_m: float
    ) -> Reason | None:
        now_s, longest_s = state.time_s, self._limits.max_contact_s
        climbed_m, wanted_m = rest_down_m - state.position_ned_m[2], rest_down_m - setpoint.position_ned_m[2]
        self._airborne_seen = self._airborne_seen or not state.landed
        share = self._carried_share(state, target)
        supported = share < self._limits.min_thrust_share and abs(state.velocity_ned_m_s[2]) < STILL_M_S
        carried_s = self._carried.held_s(supported, now_s)
        landed_s = self._landed.held_s(self._airborne_seen and state.landed, now_s)
        behind_s = self._left_behind.held_s(climbed_m < GROUND_M and wanted_m > WANTED_M, now_s)
        if longest_s == 0.0:
            return None
        if carried_s > longest_s:
            return reason(Kind.CARRIED, share=share)
        if landed_s > longest_s:
            return reason(Kind.CALLED_LANDED, landed_s=landed_s)
        if behind_s > longest_s:
            return reason(Kind.NOT_LIFTED, climbed_m=climbed_m, wanted_m=wanted_m)
        return None

    def _carried_share(self, state: VehicleState, target: AttitudeTarget) -> float:
        """Share of the weight that the thrust of `target` carries in the present attitude."""
        vehicle = self._vehicle
        thrust_n = (target.throttle - vehicle.throttle.offset) / vehicle.throttle.per_newton * vehicle.axial_share
        return float(thrust_n * cos_tilt(state.attitude) / vehicle.weight_n)

    def _saturation(self, target: AttitudeTarget, now_s: float) -> Reason | None:
        longest_s, controller = self._limits.max_saturated_s, self._controller
        tilt_deg = math.degrees(tilt(target.attitude))
        leaning_s = self._leaning.held_s(tilt_deg > controller.max_tilt_deg - TILT_EDGE_DEG, now_s)
        pushing_s = self._pushing.held_s(target.throttle >= controller.max_throttle, now_s)
        if 0.0 < longest_s < leaning_s:
            return reason(Kind.TILT_SATURATED, most_deg=controller.max_tilt_deg, held_s=leaning_s)
        if 0.0 < longest_s < pushing_s:
            return reason(Kind.THROTTLE_SATURATED, most=controller.max_throttle, held_s=pushing_s)
        return None


def _off(at: float, wanted: float) -> float:
    """Error of one axis; none where there is no place to be."""
    return 0.0 if math.isnan(wanted) else at - wanted
