"""Targets from mission and state: the mission is placed where the vehicle took off, and control follows it."""

import math
from dataclasses import dataclass

from quadctl.compensator import Compensator
from quadctl.control import Memory, control
from quadctl.control.lags import Lags, eased, lags, preview, smoothed, turn_lag_s
from quadctl.flight.pilot.settings import FlightSettings
from quadctl.flight.pilot.tick import Decision
from quadctl.frames import euler_from_quaternion
from quadctl.missions import Mission
from quadctl.state import NAN, AttitudeTarget, Setpoint, Vec3, VehicleState
from quadctl.vehicle import Vehicle


@dataclass
class Home:
    """Place of take-off: the origin of the mission, in the autopilot's frame (NED)."""

    position_ned_m: Vec3 = (0.0, 0.0, 0.0)
    ground_down_m: float = 0.0
    heading_rad: float = 0.0

    @property
    def rest_height_m(self) -> float:
        """Height at which the vehicle stood before take-off."""
        return self.ground_down_m - self.position_ned_m[2]

    def height_m(self, state: VehicleState) -> float:
        """Height of the vehicle above the ground."""
        return self.ground_down_m - state.position_ned_m[2]

    def distance_m(self, state: VehicleState) -> float:
        """Horizontal distance from the take-off point."""
        return math.dist(state.position_ned_m[:2], self.position_ned_m[:2])


class Steering:
    """Makes the targets of one flight."""

    def __init__(
        self, mission: Mission, vehicle: Vehicle, settings: FlightSettings, compensator: Compensator, home: Home
    ) -> None:
        self._mission = mission
        self._vehicle = vehicle
        self._settings = settings
        self._compensator = compensator
        self._home = home
        self._yaw_rad = 0.0
        self._memory = Memory()
        self._turn_s = turn_lag_s(compensator.model, settings.controller)
        self._delay_s = 0.0

    def start_at(self, state: VehicleState) -> None:
        """Make the place of the standing vehicle the home of the flight."""
        self._home.position_ned_m = state.position_ned_m
        if self._settings.height_datum == "takeoff":
            self._home.ground_down_m = state.position_ned_m[2] + self._settings.rest_height_m
        self._home.heading_rad = self._yaw_rad = euler_from_quaternion(state.attitude)[2]

    def forget(self) -> None:
        """Forget the controller's state from the ground."""
        self._memory = Memory()

    def standing(self, share_of_hover: float) -> Decision:
        """Level target in the present heading, with a share of the throttle of hover; 0: no thrust."""
        half_rad, throttle = 0.5 * self._home.heading_rad, share_of_hover * self._vehicle.hover_throttle
        return Decision(AttitudeTarget((math.cos(half_rad), 0.0, 0.0, math.sin(half_rad)), throttle))

    def along(self, t_s: float, begin_s: float, state: VehicleState, dt: float) -> Decision:
        """Follow the mission, which began at `begin_s`, at its time `t_s`.

        The state is compared with the reference of its own time; what the vehicle is told now, it does later.
        """
        at = self._lags(state)
        self._yaw_rad = self._mission.yaw_rad(t_s, self._home.heading_rad)
        here = self._setpoint(max(t_s - at.age_s, begin_s))
        ahead = here if at.ahead_s is None else self._setpoint(t_s + at.ahead_s)
        return self._steer(here, ahead, at, state, dt)

    def towards(self, setpoint: Setpoint, state: VehicleState, dt: float) -> Decision:
        """Make one step of control towards a `setpoint` that stays, `dt` after the last."""
        return self._steer(setpoint, setpoint, self._lags(state), state, dt)

    def place_of(self, state: VehicleState) -> Setpoint:
        """Setpoint to stay at the place of `state`, in the last heading."""
        return Setpoint(state.position_ned_m, yaw_rad=self._yaw_rad)

    def _lags(self, state: VehicleState) -> Lags:
        return lags(state, self._turn_s, self._vehicle.rotor.time_constant_s, self._settings.controller)

    def _setpoint(self, t_s: float) -> Setpoint:
        """Reference of the mission at its time `t_s`, in the autopilot's frame."""
        position, velocity, acceleration, free = self._mission.reference(t_s)
        north, east, _ = self._home.position_ned_m
        n = NAN if free[0] else north + position[0]
        e = NAN if free[1] else east + position[1]
        d = NAN if free[2] else self._home.ground_down_m - position[2]
        return Setpoint(
            (n, e, d),
            (velocity[0], velocity[1], -velocity[2]),
            (acceleration[0], acceleration[1], -acceleration[2]),
            self._yaw_rad,
        )

    def _steer(self, here: Setpoint, ahead: Setpoint, at: Lags, state: VehicleState, dt: float) -> Decision:
        controller, rotors_s = self._settings.controller, self._vehicle.rotor.time_constant_s
        self._delay_s = smoothed(self._delay_s, at, dt)
        output = control(
            here,
            state,
            self._memory,
            dt,
            self._home.ground_down_m,
            self._vehicle,
            controller,
            self._compensator,
            preview(ahead, at, eased(self._delay_s, self._turn_s, rotors_s, controller)),
        )
        self._memory = output.memory
        return Decision(output.target, (), here, output)
