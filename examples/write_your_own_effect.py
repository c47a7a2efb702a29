"""Write an effect of your own, fit it, and compare it with an effect of the catalogue on held-out data."""

import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

from simulator import VEHICLE, fly

from quadctl.effects import Conditions, ThrustRatio, parameter
from quadctl.lab import add, load_model, prepare_flights
from quadctl.numeric import Number, exp
from quadctl.vehicle import Vehicle


@dataclass(frozen=True)
class GroundBell(ThrustRatio):
    """K = 1 + gain exp(-(h / (width R))^2), with the height h of the rotor plane and the rotor radius R."""

    name: ClassVar[str] = "ground_bell.gaussian"
    source: ClassVar[str] = "examples/write_your_own_effect.py"
    depends_on: ClassVar[tuple[str, ...]] = ("height_over_radius",)
    physics: ClassVar[str] = "Near the ground the rotors give more thrust, in the shape of a bell."
    distinguished_by: ClassVar[str] = "hover at many heights"
    mission: ClassVar[str] = "missions/hover_staircase.yaml"

    gain: float = parameter(0.1, 0.0, 1.0, "", "share of thrust that is added at the ground")
    width: float = parameter(2.0, 0.5, 10.0, "", "height in rotor radii at which it has fallen to 37 %")

    def ratio(self, c: Conditions, vehicle: Vehicle) -> Number:
        return 1.0 + self.gain * exp(-((c.height_m / (self.width * vehicle.rotor.radius_m)) ** 2))


folder = Path(tempfile.mkdtemp(prefix="quadctl-"))
rigid_body = load_model(VEHICLE)
flights = prepare_flights(fly("hover_staircase", folder), rigid_body.vehicle)

for effect in (GroundBell, "ground_effect.hayden", "ground_effect.exponential"):
    addition = add(effect, rigid_body, flights)
    fitted = addition.model.effects[0]
    values = ", ".join(f"{name} = {value:.3g}" for name, value in fitted.values().items())
    print(f"{fitted.name:26} held-out error {addition.after['total']:.4f} m/s^2   {values}")
