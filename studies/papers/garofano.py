"""Garofano-Soldado et al.: the curves of figure 6 from tables I to III, and whether their sections meet."""

from typing import NamedTuple

import numpy as np

from quadctl.effects import Conditions
from quadctl.effects.ground_effect_hexarotor import HIGHEST_HEIGHT_OVER_RADIUS, Hexarotor, HexarotorTilted
from quadctl.logs.flight_log import Floats
from quadctl.settings import validate
from quadctl.vehicle import Vehicle
from studies.page import save

RADIUS_M, ADJACENT_M = 0.1194, 0.28
"""Table I."""
TILTS_DEG = (0.0, 10.0, 20.0, 30.0)
"""Cant and dihedral alike, as on the authors' vehicle."""
UNEQUAL = ((30.0, 0.0), (0.0, 30.0))
BOUNDARIES = (HexarotorTilted.LOW_ENDS, HexarotorTilted.HIGH_BEGINS, HIGHEST_HEIGHT_OVER_RADIUS)
"""Heights at which a section of the model ends, in rotor radii."""


def hexarotor(cant_deg: float = 0.0, dihedral_deg: float = 0.0) -> Vehicle:
    """A vehicle of the paper's geometry; mass, thrust and throttle are ours, as ground effect does not see them."""
    rotors = [
        {
            "position_m": [ADJACENT_M * np.cos(angle), ADJACENT_M * np.sin(angle), 0.0],
            "spin": "cw" if i % 2 else "ccw",
            "cant_deg": cant_deg,
            "dihedral_deg": dihedral_deg,
        }
        for i, angle in enumerate(np.radians(30.0 + 60.0 * np.arange(6)))
    ]
    keys = {
        "name": "hexarotor",
        "mass_kg": 2.5,
        "rotor": {"radius_m": RADIUS_M, "thrust_n_per_rpm2": 1.2e-7},
        "rotors": rotors,
        "throttle": {"per_newton": 0.0153, "offset": 0.15, "max_thrust_per_rotor_n": 9.0},
    }
    return validate(keys, Vehicle, "the hexarotor of the papers")


def ratio(radii: Floats, cant_deg: float, dihedral_deg: float) -> Floats:
    """K of eq. 10 to 13 at heights in rotor radii, shape (n,)."""
    still = Conditions(radii * RADIUS_M, (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0))
    return np.asarray(HexarotorTilted().ratio(still, hexarotor(cant_deg, dihedral_deg)))


def flat_ratio(radii: Floats) -> Floats:
    """K of eq. 9, untilted, shape (n,)."""
    still = Conditions(radii * RADIUS_M, (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0))
    return np.asarray(Hexarotor().ratio(still, hexarotor()))


class Jump(NamedTuple):
    """K on both sides of a boundary."""

    below: float
    above: float

    @property
    def size(self) -> float:
        return self.above - self.below


def jumps(cant_deg: float, dihedral_deg: float) -> list[Jump]:
    """At each of `BOUNDARIES`."""
    sides = [ratio(np.array([b - 1e-9, b + 1e-9]), cant_deg, dihedral_deg) for b in BOUNDARIES]
    return [Jump(float(below), float(above)) for below, above in sides]


def section() -> str:
    """The part of the page."""
    alike = max(abs(j.size) for tilt in TILTS_DEG for j in jumps(tilt, tilt)[:2])
    unequal = max(abs(j.size) for pair in UNEQUAL for j in jumps(*pair)[:2])
    end = jumps(0.0, 0.0)[2]
    radii = np.linspace(0.25, 2.4, 2000)
    flat = flat_ratio(radii)
    peak = int(np.argmax(flat))
    return f"""## Garofano-Soldado et al.: figure 6 from tables I to III

{_figure()}

- Where cant and dihedral are alike, K jumps by at most {alike:.4f} at 2.5 R and 3 R; where they differ, by up to
  {unequal:.2f}: never use the formula with only one of the two angles.
- At 8 R the firmware switches the effect off: without tilt a step of {end.below - 1.0:.1%} of the weight.
- Eq. 9 has its maximum, K = {flat[peak]:.3f}, at {radii[peak]:.2f} R: it must not be used below. Without tilt,
  eq. 10 to
  13 do not become eq. 9: K at 1 R is {ratio(np.array([1.0]), 0.0, 0.0)[0]:.3f} and not
  {flat_ratio(np.array([1.0]))[0]:.3f}.
"""


def _figure() -> str:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.0, 3.4), layout="constrained")
    radii = np.linspace(0.25, 9.0, 2000)
    left, right = figure.subplots(1, 2, sharey=True)
    left.plot(radii, flat_ratio(radii), "k--", label="eq. 9, untilted")
    for tilt in TILTS_DEG:
        left.plot(radii, ratio(radii, tilt, tilt), label=f"eq. 10 to 13, {tilt:.0f}°")
    left.set(title="cant = dihedral", xlabel="z/R", ylabel="K", ylim=(0.9, 1.45))
    for cant, dihedral in UNEQUAL:
        right.plot(radii, ratio(radii, cant, dihedral), label=f"cant {cant:.0f}°, dihedral {dihedral:.0f}°")
    right.set(title="cant and dihedral differ", xlabel="z/R")
    for axes in (left, right):
        for boundary in BOUNDARIES:
            axes.axvline(boundary, color="0.8", linewidth=0.8, zorder=0)
        axes.legend(fontsize="small")
        axes.grid(alpha=0.3)
    return save(figure, "garofano", "Thrust ratio of the tilted hexarotor over height")
