"""Rotor drag: blade flapping and induced drag give a force against the body's velocity, linear in it."""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from quadctl.effects.base import Conditions, Effect, parameter
from quadctl.numeric import Number, Vector
from quadctl.vehicle import Vehicle

LEAST_1_S = 0.04
"""Smallest rate that counts: every rotor drags, and at 2 m/s a trim of 0.5 degrees makes as much."""

SIDEWAYS = 0.1
"""Least drag along body x or y, as a share of that along z: a force along the thrust axis alone is an `inflow`."""
FLOWN_M_S = 1.0
"""Span of the horizontal speed that shows whether there is a drag along body x and y."""
LIKE_THE_OTHERS = 0.3
"""Least drag along body z, as a share of the largest, that may be an inflow; blades and frame alone give less."""


@dataclass(frozen=True)
class LinearDrag(Effect):
    """F = -m D v in body axes, D = diag(d_x, d_y, d_z).

    d_z has another cause than the others, which in near-hover flight acts alike: `inflow`.
    """

    name: ClassVar[str] = "rotor_drag.linear"
    source: ClassVar[str] = "Faessler et al. 2018, IEEE RA-L 3(2), eq. 2-3"
    formula: ClassVar[str] = r"\mathbf{f} = -m \, \mathrm{diag}(d_x, d_y, d_z) \, \mathbf{v}"
    depends_on: ClassVar[tuple[str, ...]] = ("speed_forward", "speed_right")
    physics: ClassVar[str] = (
        "Blade flapping and the rotors' induced drag push against the flight velocity, in proportion to it."
    )
    distinguished_by: ClassVar[str] = (
        "steady runs at several speeds, both ways, so that wind and a tilted thrust cancel"
    )
    mission: ClassVar[str] = "missions/forward_runs.yaml"

    d_x: float = parameter(0.3, 0.0, 3.0, "1/s", "deceleration per forward velocity")
    d_y: float = parameter(0.3, 0.0, 3.0, "1/s", "deceleration per sideward velocity")
    d_z: float = parameter(0.0, 0.0, 3.0, "1/s", "deceleration per velocity along body z")

    def negligible(self) -> bool:
        return max(self.d_x, self.d_y, self.d_z) < LEAST_1_S

    def believable(self, flights: Sequence[Conditions], vehicle: Vehicle) -> bool:
        return acts_sideways(self.d_x, self.d_y, self.d_z, flights)

    def implied_by(self, others: Sequence[Effect], flights: Sequence[Conditions], vehicle: Vehicle) -> bool:
        """True where it acts along the thrust axis alone, beside an inflow: then the form of that one is off."""
        return is_of_inflow(self.d_x, self.d_y, self.d_z, others)

    def inseparable_from(
        self, missing: Collection[str], ci95: Mapping[str, tuple[float, float]], span: Callable[[str], float]
    ) -> Sequence[str]:
        return may_be_inflow("d_z", self, missing, ci95)

    def force(self, total_thrust_n: Number, c: Conditions, vehicle: Vehicle) -> Vector:
        u, v, w = c.velocity_body_m_s
        m = vehicle.mass_kg
        return -m * self.d_x * u, -m * self.d_y * v, -m * self.d_z * w


def acts_sideways(x: float, y: float, z: float, flights: Sequence[Conditions]) -> bool:
    """Tell whether a drag with these coefficients along the body axes acts along x or y, too, where that was flown."""
    return max(x, y) >= SIDEWAYS * z or not any(_span_m_s(c) > FLOWN_M_S for c in flights)


def is_of_inflow(x: float, y: float, z: float, others: Sequence[Effect]) -> bool:
    """Tell whether a drag with these coefficients along the body axes is a part of an inflow of the model."""
    return max(x, y) < SIDEWAYS * z and any(effect.family() == "inflow" for effect in others)


def may_be_inflow(
    along_z: str, drag: Effect, missing: Collection[str], ci95: Mapping[str, tuple[float, float]]
) -> Sequence[str]:
    """Inflow, where the parameter `along_z` of a drag is too large for blades and frame, and no inflow was found."""
    if "inflow" in missing or along_z not in ci95:
        return []
    return ["inflow"] if ci95[along_z][0] > LIKE_THE_OTHERS * max(drag.values().values()) else []


def _span_m_s(c: Conditions) -> float:
    u, v, _ = c.velocity_body_m_s
    return float(np.ptp(np.quantile(np.hypot(u, v), (0.05, 0.95))))
