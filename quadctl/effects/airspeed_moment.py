"""Airspeed moment: the air turns a vehicle that moves through it, as its drag does not act at the centre of mass."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from quadctl.effects.base import Conditions, Effect, ThrustRatio, parameter
from quadctl.numeric import Number, Vector
from quadctl.vehicle import Vehicle

LEAST_MM_PER_M_S = 0.1
"""Smallest moment that counts, over thrust: a drag of 0.2 1/s whose centre is half a centimetre off makes as much. It
takes away moments that at 5 m/s equal a centre of mass 0.5 mm off."""
IMPLIED = 0.5
"""Least share of the moment that an inflow gives by itself where it is no discovery of its own."""


@dataclass(frozen=True)
class IsotropicMoment(Effect):
    """A moment T_total k (-v, u, 0): the thrust acts as far from its place as the airspeed says.

    A drag d at the height h above the centre of mass gives k = d h / g, and rotors whose discs flap give the same form:
    both moments are linear in the airspeed and grow with the thrust. One coefficient serves roll and pitch, as most
    vehicles are nearly alike from all sides, and runs in one direction show no second one. A Crazyflie 2.1 has 0.8 mm
    per m/s in roll and 1.0 in pitch, or 13 and 16 rad/s^2 per m/s.
    """

    name: ClassVar[str] = "airspeed_moment.isotropic"
    source: ClassVar[str] = "hub force and flapping moment, first order: Mahony, Kumar & Corke 2012, eq. 12-15, r x F"
    formula: ClassVar[str] = r"M = T \, k \, (-v, u, 0)"
    depends_on: ClassVar[tuple[str, ...]] = ("speed_forward", "speed_right")
    physics: ClassVar[str] = (
        "The drag acts above or below the centre of mass, and the rotors' discs flap: in fast flight this "
        "turns the vehicle."
    )
    distinguished_by: ClassVar[str] = (
        "moments in runs in both directions that go on growing with the speed; a wake also takes thrust"
    )
    mission: ClassVar[str] = "missions/forward_runs.yaml"
    needs: ClassVar[dict[str, float]] = {"speed": 0.7}

    k: float = parameter(0.0, -20.0, 20.0, "mm per m/s", "pitch moment over thrust, per airspeed forward")

    def negligible(self) -> bool:
        return abs(self.k) < LEAST_MM_PER_M_S

    def implied_by(self, others: Sequence[Effect], flights: Sequence[Conditions], vehicle: Vehicle) -> bool:
        """True where an inflow of the model, on each rotor at its own velocity, gives at least half of this moment.

        Rotors that climb as the body turns lose thrust (Pounds, Mahony & Corke 2010). A vehicle that flies to and fro
        turns in time with its speed, so that this damping looks like a moment by the airspeed.
        """
        inflow = [e for e in others if isinstance(e, ThrustRatio) and "climb_rate" in e.depends_on]
        if not inflow:
            return False
        own, implied = [], []
        for c in flights:
            thrust_n = [np.full_like(c.time_s, vehicle.weight_n / vehicle.n_rotors)] * vehicle.n_rotors
            own += [np.asarray(moment) for moment in self.torque(thrust_n, c, vehicle)[:2]]
            implied += _hub_moments(inflow, c, vehicle)
        this = np.concatenate(own)
        return bool(this @ np.concatenate(implied) > IMPLIED * (this @ this))

    def torque(self, thrust_n: Sequence[Number], c: Conditions, vehicle: Vehicle) -> Vector:
        u, v, _ = c.velocity_body_m_s
        lever_m = 1e-3 * self.k
        return -lever_m * sum(thrust_n) * v, lever_m * sum(thrust_n) * u, 0.0 * sum(thrust_n)


def _hub_moments(effects: Sequence[ThrustRatio], c: Conditions, vehicle: Vehicle) -> list[NDArray[np.float64]]:
    """Moments about roll and pitch by effects on each rotor at its own velocity, in hover, N m, shape (n,) each."""
    (u, v, w), (p, q, r) = c.velocity_body_m_s, c.rates_rad_s
    found = [np.zeros(np.shape(c.time_s)), np.zeros(np.shape(c.time_s))]
    for rotor, arms in zip(vehicle.rotors, vehicle.moment_arms_m, strict=True):
        x, y, z = rotor.position_m
        hub = replace(c, velocity_body_m_s=(u + q * z - r * y, v + r * x - p * z, w + p * y - q * x))
        thrust_n = vehicle.weight_n / vehicle.n_rotors * sum(e.ratio(hub, vehicle) for e in effects)
        found = [moment + arm * thrust_n for moment, arm in zip(found, arms[:2], strict=True)]
    return found
