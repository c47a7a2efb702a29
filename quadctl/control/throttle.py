"""Thrust in newtons to throttle 0..1 and back, by the line of the vehicle file."""

from quadctl.vehicle import Vehicle


def throttle_for_thrust(thrust_n: float, vehicle: Vehicle, low: float = 0.0, high: float = 1.0) -> float:
    """Throttle that gives `thrust_n` in all rotors together, within [low, high]."""
    curve = vehicle.throttle
    return min(max(curve.offset + curve.per_newton * thrust_n, low), high)


def lateral_throttle(force_n: tuple[float, float], vehicle: Vehicle) -> tuple[float, float]:
    """Lateral throttle of an `AttitudeTarget`, -1..1, that gives the lateral force `force_n`; forward and right."""
    per_rotor_n = vehicle.throttle.per_newton * vehicle.n_rotors
    (forward, right), (x_n, y_n) = vehicle.allocation.lateral_scale, force_n
    return per_rotor_n * forward * x_n, per_rotor_n * right * y_n


def thrust_for_throttle(throttle: float, vehicle: Vehicle) -> float:
    """Thrust of all rotors together, N, not below 0."""
    curve = vehicle.throttle
    return max(0.0, (throttle - curve.offset) / curve.per_newton)
