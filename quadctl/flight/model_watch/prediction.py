"""The acceleration that a model predicts in flight, from the targets that were sent and the state that came back."""

import math
from collections import deque
from typing import NamedTuple

from quadctl.control.throttle import thrust_for_throttle
from quadctl.effects import Conditions
from quadctl.flight.model_watch.followed_velocity import FollowedVelocity
from quadctl.frames import GRAVITY_M_S2, rotate, rotate_inverse
from quadctl.model import Model, conditions
from quadctl.state import AttitudeTarget, Setpoint, Vec3, VehicleState
from quadctl.surfaces import Place

LONGEST_WAY_S = 1.0
"""Longest time for which a target that was sent is remembered."""


class Prediction(NamedTuple):
    """Prediction of one instant: the time at which the state was true."""

    true_s: float
    dt: float
    """Time since the prediction before."""
    acceleration_ned: Vec3
    """Kinematic acceleration, m/s^2."""
    rotors_body: Vec3
    """Specific force of the rotors, FRD, m/s^2."""
    air_body: Vec3
    """Velocity relative to the air, FRD, m/s, by `FollowedVelocity`."""


class Predictor:
    """Predicts by a model from the throttle sent, through the delay of the link and the lag of the rotors."""

    def __init__(self, model: Model, place: Place | None = None) -> None:
        self._model = model
        self._place = place
        self._sent: deque[tuple[float, AttitudeTarget]] = deque()
        self._reference = Setpoint((0.0, 0.0, 0.0))
        self._followed = FollowedVelocity()
        self._true_s = math.nan
        self._thrust_n = math.nan

    def sent(self, time_s: float, target: AttitudeTarget, reference: Setpoint) -> None:
        """Take in a target that goes out at `time_s`, and the reference that it follows."""
        self._reference = reference
        self._sent.append((time_s, target))
        while self._sent[0][0] < time_s - LONGEST_WAY_S:
            self._sent.popleft()

    def forget(self) -> None:
        """Begin anew, with the next state."""
        self._true_s = self._thrust_n = math.nan

    def predict(self, state: VehicleState, ground_down_m: float) -> Prediction | None:
        """Prediction for the time of `state`; None for a state that was seen before, and for the first one.

        The rotors are a lag of first order behind the target that has arrived by then.
        """
        true_s = state.time_s - state.age_s("position")
        target, dt = self._arrived(true_s - state.setpoint_delay_s), true_s - self._true_s
        if target is None or dt <= 0.0:
            return None
        first, self._true_s = math.isnan(dt), true_s
        asked_n = thrust_for_throttle(target.throttle, self._model.vehicle)
        if first:
            self._thrust_n = asked_n
            return None
        lag_s = self._model.vehicle.rotor.time_constant_s
        followed = 1.0 - math.exp(-dt / lag_s) if lag_s > 0.0 else 1.0
        self._thrust_n += followed * (asked_n - self._thrust_n)
        return self._at(state, ground_down_m, target, true_s, dt)

    def _at(
        self, state: VehicleState, ground_down_m: float, target: AttitudeTarget, true_s: float, dt: float
    ) -> Prediction:
        model, (north, east, down) = self._model, state.position_ned_m
        vehicle, place = model.vehicle, self._place
        velocity, position = rotate_inverse(state.attitude, state.velocity_ned_m_s), (north, east)
        over_ground = conditions(
            vehicle, ground_down_m - down, velocity, state.attitude, true_s, state.battery_v, position, place
        )
        c: Conditions = model.in_air(over_ground)
        thrust = model.rotor_thrust(self._nominal_n(target), c)
        (rx, ry, rz), (sx, sy, sz), m = (
            vehicle.rotor_force(thrust),
            model.side_force(sum(thrust), c),
            vehicle.mass_kg,
        )
        north, east, down = rotate(state.attitude, ((rx + sx) / m, (ry + sy) / m, (rz + sz) / m))
        acceleration = north, east, down + GRAVITY_M_S2
        self._followed.take(state.velocity_ned_m_s, self._reference, dt)
        expected = rotate_inverse(state.attitude, self._followed.expected(self._reference))
        air = _plus(expected, c.velocity_body_m_s, velocity)
        return Prediction(true_s, dt, acceleration, (rx / m, ry / m, rz / m), air)

    def _nominal_n(self, target: AttitudeTarget) -> list[float]:
        """Nominal thrust of each rotor, N: shared equally, and changed by the lateral command."""
        vehicle = self._model.vehicle
        share = self._thrust_n / vehicle.n_rotors
        if target.lateral is None:
            return [share] * vehicle.n_rotors
        per_command_n = 1.0 / (vehicle.throttle.per_newton * vehicle.n_rotors)
        x, y = target.lateral
        return [share + per_command_n * (a * x + b * y) for a, b in vehicle.allocation.lateral_mix]

    def _arrived(self, time_s: float) -> AttitudeTarget | None:
        """Last target that was sent before `time_s`."""
        for sent_s, target in reversed(self._sent):
            if sent_s <= time_s:
                return target
        return None


def _plus(a: Vec3, b: Vec3, less: Vec3) -> Vec3:
    return a[0] + b[0] - less[0], a[1] + b[1] - less[1], a[2] + b[2] - less[2]


class Slopes(NamedTuple):
    """Slopes of a model's force with the velocity in level hover, per mass, 1/s: its drag, and its inflow."""

    forward: float
    right: float
    down: float


def slopes(model: Model, battery_v: float) -> Slopes:
    """Slopes of `model` between 1 m/s one way and the other, at this voltage of the battery.

    They are positive where the force acts against the velocity, and nan where an effect has no value there.
    """

    def slope(axis: int) -> float:
        try:
            ahead, back = (_force_at(model, axis, speed, battery_v)[axis] for speed in (1.0, -1.0))
        except (ArithmeticError, ValueError):
            return math.nan
        return (back - ahead) / (2.0 * model.vehicle.mass_kg)

    return Slopes(*(slope(axis) for axis in range(3)))


def _force_at(model: Model, axis: int, speed_m_s: float, battery_v: float) -> Vec3:
    """Force, FRD, N, in level flight at `speed_m_s` along an axis of the body, high above the ground."""
    vehicle = model.vehicle
    x, y, z = (speed_m_s if i == axis else 0.0 for i in range(3))
    c = conditions(vehicle, 100.0 * vehicle.rotor.radius_m, (x, y, z), (1.0, 0.0, 0.0, 0.0), 0.0, battery_v)
    fx, fy, fz = model.body_force([vehicle.weight_n / vehicle.n_rotors] * vehicle.n_rotors, c)
    return float(fx), float(fy), float(fz)
