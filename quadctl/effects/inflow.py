"""Inflow: at the same rotor speed a climbing rotor gives less thrust, a sinking one more."""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

from quadctl.effects.base import Conditions, ThrustRatio, parameter
from quadctl.numeric import Number, clip
from quadctl.vehicle import Vehicle

RATIO_LIMIT = 0.5
"""The linear law is cut where it would change the thrust by more than half."""
LEAST = 0.02
"""Smallest loss that counts, a tenth of what rotors have: at an induced velocity of 5 m/s it is the drag along body z
that does not count either (see `rotor_drag`), and in one flight the two are the same."""
DRAG_SHOWS_M_S = 1.0
"""Span of the horizontal speed above which a flight shows a drag, if there is one."""


@dataclass(frozen=True)
class AxialInflow(ThrustRatio):
    """K = 1 - k V_c / v_h, V_c being the velocity along the thrust axis and v_h the induced velocity in hover.

    Linearised blade-element momentum theory at constant rotor speed; k follows from solidity and tip speed and lies
    between 0.2 and 0.6 for small rotors. Valid for |V_c| below about v_h (beyond it a sinking rotor enters its wake).
    """

    name: ClassVar[str] = "inflow.axial"
    source: ClassVar[str] = "Leishman, Principles of Helicopter Aerodynamics, 2nd ed., sec. 3.3 (linearised)"
    formula: ClassVar[str] = r"K = 1 - k \, V_c / v_h"
    depends_on: ClassVar[tuple[str, ...]] = ("climb_rate",)
    physics: ClassVar[str] = (
        "In a climb the blades meet the air at a smaller angle of attack: the same rotor speed gives less thrust."
    )
    distinguished_by: ClassVar[str] = "climbs and descents at several rates, away from the ground"
    mission: ClassVar[str] = "missions/vertical_runs.yaml"

    k: float = parameter(0.3, 0.0, 2.0, "", "loss of thrust, as a fraction, at a climb rate of v_h")

    def negligible(self) -> bool:
        return self.k < LEAST

    def inseparable_from(
        self, missing: Collection[str], ci95: Mapping[str, tuple[float, float]], span: Callable[[str], float]
    ) -> Sequence[str]:
        """A drag along body z, unless the flights show that there is a drag along the other axes, or none."""
        told = "rotor_drag" in missing or "body_drag" in missing or span("speed") >= DRAG_SHOWS_M_S
        return [] if told else ["rotor_drag"]

    def ratio(self, c: Conditions, vehicle: Vehicle) -> Number:
        climb_m_s = -c.velocity_body_m_s[2]
        return 1.0 - clip(self.k * climb_m_s / vehicle.hover_induced_velocity_m_s, -RATIO_LIMIT, RATIO_LIMIT)
