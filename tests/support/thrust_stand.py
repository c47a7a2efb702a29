"""Measurements of a thrust stand, made up from the vehicle file."""

import numpy as np

from quadctl.thrust_stand.measurement import Point
from quadctl.vehicle import load_vehicle
from tests.support.links import RAPTOR

VEHICLE = load_vehicle(RAPTOR)
K = VEHICLE.rotor.thrust_n_per_rpm2
THROTTLES = np.linspace(0.25, 0.9, 14)


def measured(exponent: float = 2.0, offset_n: float = 0.0, noise_n: float = 0.02, seed: int = 0) -> list[Point]:
    """The vehicle's own throttle line; thrust that grows with rpm^exponent and is right at 8000 rpm."""
    random = np.random.default_rng(seed)
    points = []
    for u in THROTTLES:
        thrust = (u - VEHICLE.throttle.offset) / (VEHICLE.throttle.per_newton * 4)
        rpm = 8000.0 * (thrust / (K * 8000.0**2)) ** (1.0 / exponent)
        points.append(Point(float(u), float(rpm), float(thrust + offset_n + noise_n * random.standard_normal())))
    return points
