"""A model whose rotors stand around its centre of mass, for targets that know an offset by the rotors' places only."""

from dataclasses import replace

from quadctl.effects.centre_of_mass import FixedOffset
from quadctl.model import Model
from quadctl.vehicle import Vehicle


def centred(model: Model) -> Model:
    """The same model, with the offset of its centre of mass in the places of its rotors instead of an effect."""
    x_m = 1e-3 * sum(e.forward_mm for e in model.effects if isinstance(e, FixedOffset))
    y_m = 1e-3 * sum(e.right_mm for e in model.effects if isinstance(e, FixedOffset))
    if x_m == y_m == 0.0:
        return model
    written = model.vehicle.model_dump(exclude_none=True)
    for rotor in written["rotors"]:
        x, y, z = rotor["position_m"]
        rotor["position_m"] = x - x_m, y - y_m, z
    stack = tuple(item for item in model.stack if not isinstance(item.effect, FixedOffset))
    return replace(model, vehicle=Vehicle.model_validate(written), stack=stack)
