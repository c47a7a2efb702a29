"""Rotors by blade-element and momentum theory with uniform inflow.

Symbols as in Leishman, Principles of Helicopter Aerodynamics (2nd ed. 2006): C_T = T / (rho A (Omega R)^2), solidity
sigma, lift slope a, pitch theta, advance ratio mu = V_edge / (Omega R), inflow ratio
lambda = (V_axial + v_i) / (Omega R).
"""

from dataclasses import dataclass

import numpy as np

from studies.worlds.blade.rotation import Array


@dataclass(frozen=True)
class Blades:
    """Blade numbers of rotors; each an array that fits the rotors' shape."""

    radius_m: Array
    air_density: Array
    lift: Array
    """sigma a."""
    pitch_rad: Array


def hover_inflow(thrust_coefficient: Array | float) -> Array:
    """Inflow ratio in hover, sqrt(C_T / 2) (Leishman, section 2.3)."""
    return np.sqrt(np.asarray(thrust_coefficient) / 2.0)


def pitch_for(thrust_coefficient: Array | float, lift: Array | float) -> Array:
    """Pitch of untwisted blades that gives C_T in hover.

    C_T = sigma a / 2 (theta / 3 - lambda / 2) (Leishman, section 3.3).
    """
    return 3.0 * (2.0 * np.asarray(thrust_coefficient) / lift + hover_inflow(thrust_coefficient) / 2.0)


def induced_ratio(blades: Blades, mu: Array, axial: Array) -> Array:
    """Induced inflow ratio at advance ratio mu and axial (climb) ratio, by Glauert's momentum theory.

    Newton's method on C_T = 2 lambda_i sqrt(mu^2 + (axial + lambda_i)^2) (Leishman, section 2.14), with C_T(lambda_i)
    by blade elements. Valid in climb and in slow descent; not in the vortex ring.
    """
    s = blades.lift / 2.0
    constant = s * blades.pitch_rad / 3.0 * (1.0 + 1.5 * mu**2)
    x = 0.5 * (-s / 4.0 + np.sqrt((s / 4.0) ** 2 + 2.0 * constant))  # hover
    x = np.sqrt(np.maximum((np.sqrt(mu**4 + 4 * x**4) - mu**2) / 2.0, 1e-10))  # first guess at this speed
    for _ in range(5):
        total = axial + x
        root = np.sqrt(mu**2 + total**2 + 1e-12)
        error = 2.0 * x * root - constant + s * total / 2.0
        x = np.maximum(x - error / (2.0 * root + 2.0 * x * total / root + s / 2.0), 1e-4)
    ratio: Array = x
    return ratio


def thrust_coefficient(blades: Blades, mu: Array, climb: Array) -> Array:
    """Thrust coefficient by blade elements at an advance ratio and an axial (climb) ratio."""
    inflow = climb + induced_ratio(blades, mu, climb)
    return blades.lift / 2.0 * (blades.pitch_rad / 3.0 * (1.0 + 1.5 * mu**2) - inflow / 2.0)


def thrust_ratio(blades: Blades, speed: Array, edge: Array, axial: Array) -> Array:
    """Thrust over that in hover at the same rotor speed (rad/s), at edgewise and axial (climb) airspeed (m/s)."""
    tip = np.maximum(speed, 1.0) * blades.radius_m
    return thrust_coefficient(blades, edge / tip, axial / tip) / hover_coefficient(blades)


def hover_coefficient(blades: Blades, share: Array | float = 1.0) -> Array:
    """Thrust coefficient in hover where the blades see the share of the induced velocity.

    Blade elements see lambda = share x, momentum theory keeps C_T = 2 x^2: a quadratic in x.
    """
    slope = blades.lift / 4.0 * share
    x = (-slope + np.sqrt(slope**2 + 4.0 * blades.lift * blades.pitch_rad / 3.0)) / 4.0
    return 2.0 * x * x


def thrust_ratio_reduced_inflow(blades: Blades, reduction: Array) -> Array:
    """Hover thrust over its free value where a boundary takes the share `reduction` of the induced velocity away."""
    return hover_coefficient(blades, 1.0 - np.clip(reduction, -2.0, 0.9)) / hover_coefficient(blades)


def hover_induced_velocity(thrust_n: Array | float, radius_m: Array | float, air_density: Array | float) -> Array:
    """Induced velocity in hover, sqrt(T / (2 rho A)) (Leishman, section 2.2)."""
    return np.sqrt(np.asarray(thrust_n) / (2.0 * air_density * np.pi * np.asarray(radius_m) ** 2))
