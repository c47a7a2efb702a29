"""A model that turns as flights do: numbers of the vehicle, effects on the moments, thrust map and drag."""

from collections.abc import Iterable
from dataclasses import replace

from pydantic import ValidationError

from quadctl.effects import Effect
from quadctl.effects.airspeed_moment import IsotropicMoment
from quadctl.effects.centre_of_mass import FixedOffset
from quadctl.effects.motor_lag import FirstOrderLag
from quadctl.effects.rate_damping import ProportionalDamping
from quadctl.effects.rotor_drag import LinearDrag
from quadctl.effects.rotor_fault import UnequalRotors
from quadctl.effects.rotor_reaction import InertialReaction
from quadctl.effects.thrust_map import LineMap, VoltageMap
from quadctl.errors import SettingsError
from quadctl.lab.rotation.parameters import AXES, Rotation, together
from quadctl.lab.rotation.value import Value
from quadctl.model import Model, Provenance, StackedEffect
from quadctl.vehicle import Vehicle

OF_THRUST = {"thrust_map", "thrust_scale", "thrust_curve", "battery_sag"}
OF_DRAG = {"rotor_drag", "body_drag"}
"""Families of effects beside which none of the kind is added."""
UNBALANCED = {FixedOffset.family(), UnequalRotors.family()}
"""Families of which the mean commands hold the sum."""


def with_rotation(model: Model, found: Rotation) -> Model:
    """The model with all that the flights identify of its rotation; the rest stays.

    Inertia and, where commands were logged, lag and delay of the rotors are numbers of the vehicle, which the new file
    holds itself; `rate_damping`, `airspeed_moment`, `rotor_reaction` and `centre_of_mass` or `rotor_fault.unequal` are
    effects, and take the place of those in the model, as far as their intervals leave out 0 or a share of 1. The moment
    by airspeed has one coefficient for roll and pitch, weighted by their intervals. Of the last two, which turn the
    vehicle alike about roll and pitch, it is the rotors where there is a moment about yaw, too.

    Thrust map and drag are of the accelerometer; where the model has some of its own, these stay. A `motor_lag` of the
    model is part of the lag that is identified.

    Raises
    ------
    SettingsError
        Nothing is identified, or no body has such an inertia.
    """
    vehicle = _vehicle(model.vehicle, found)
    turning = (_damping(found), _airspeed(found, model.vehicle), _reaction(found), _balance(found))
    if not any(turning) and vehicle == model.vehicle:
        raise SettingsError(
            f"{', '.join(found.names)}: nothing of the rotation is identified, so there is no new model"
        )
    own = {effect.family() for effect in model.effects}
    first = None if own & OF_THRUST else _thrust(found, model.vehicle)
    last = None if own & OF_DRAG else _drag(found)
    told = None if found.measured else found.delay
    delay_s = None if told is None else (told.value, told.low, told.high)

    def stacked(fitted: Iterable[Fitted | None]) -> tuple[StackedEffect, ...]:
        return tuple(
            StackedEffect(of[0], Provenance(logs=found.names, ci95=of[1], command_delay_s=delay_s))
            for of in fitted
            if of is not None
        )

    new = stacked((*turning, last))
    replaced = {item.effect.family() for item in new}
    replaced |= UNBALANCED if replaced & UNBALANCED else set()
    if vehicle.rotor != model.vehicle.rotor:
        replaced.add(FirstOrderLag.family())
    kept = (item for item in model.stack if item.effect.family() not in replaced)
    return replace(model, stack=(*stacked((first,)), *kept, *new), vehicle=vehicle, vehicle_path=None)


def _vehicle(vehicle: Vehicle, found: Rotation) -> Vehicle:
    own = dict(zip(AXES, vehicle.principal_inertia_kg_m2, strict=True))
    inertia = own | {axis: value.value for axis, value in found.inertia.items()}
    written = vehicle.model_dump(exclude_none=True)
    if found.inertia:
        written["inertia_kg_m2"] = tuple(inertia.values())
    if found.lag is not None and not found.measured:
        written["rotor"]["time_constant_s"] = found.lag.value
        written["rotor"]["delay_s"] = 0.0 if found.delay is None else found.delay.value
    try:
        return Vehicle.model_validate(written)
    except ValidationError as error:
        shown = ", ".join(f"{axis} {value:.3g}" for axis, value in inertia.items())
        raise SettingsError(
            f"{', '.join(found.names)}: the inertia would be {shown} kg m², expected that of a body: look at "
            "the arms and torque_to_thrust_m of the vehicle file"
        ) from error


Fitted = tuple[Effect, dict[str, tuple[float, float]]]
"""An effect, and the 95 % intervals of its parameters."""


def _thrust(found: Rotation, vehicle: Vehicle) -> Fitted | None:
    """Line from command to thrust through that of level hover, or map with the voltage where the thrust follows it."""
    e, level, line = found.thrust.found, found.level, vehicle.throttle
    if e is None or level is None or found.measured:
        return None
    if found.thrust.by_voltage:
        over = vehicle.hover_throttle / level.value
        mapped = VoltageMap((2.0 - e.value) * over, (e.value - 1.0) * over**2, found.hover / found.hover_drive)
        return mapped, {
            "linear": ((2.0 - e.high) * over, (2.0 - e.low) * over),
            "square": ((e.low - 1.0) * over**2, (e.high - 1.0) * over**2),
        }
    slope, share = line.per_newton * vehicle.weight_n / level.value, 1.0 - line.offset / level.value
    values = {"factor": (e.low * slope, e.high * slope), "offset": (1.0 - e.high * share, 1.0 - e.low * share)}
    return LineMap(e.value * slope, 1.0 - e.value * share), values


def _drag(found: Rotation) -> Fitted | None:
    drags = {name: fit.values["drag_1_s"] for name, fit in found.drag.items() if fit.white}
    told = {name: value for name, value in drags.items() if value.low > 0.0}
    if not told:
        return None
    drag = LinearDrag(**dict.fromkeys(("d_x", "d_y"), 0.0) | {name: value.value for name, value in told.items()})
    return drag, {name: (value.low, value.high) for name, value in told.items()}


def _damping(found: Rotation) -> Fitted | None:
    told = {axis: found.told(axis).get("damping_1_s") for axis in AXES}
    values = {f"{axis}_1_s": value for axis, value in told.items() if value is not None and value.low > 0.0}
    if not values:
        return None
    effect = ProportionalDamping(**{name: value.value for name, value in values.items()})
    return effect, {name: (value.low, value.high) for name, value in values.items()}


def _airspeed(found: Rotation, vehicle: Vehicle) -> Fitted | None:
    """Moment by airspeed over the weight, mm per m/s: against roll, with pitch."""
    one = []
    for axis, sign in (("roll", -1.0), ("pitch", 1.0)):
        told = found.told(axis)
        if "airspeed" in told and axis in found.inertia:
            scale = sign * 1e3 * found.inertia[axis].value / vehicle.weight_n
            low, high = sorted((scale * told["airspeed"].low, scale * told["airspeed"].high))
            one.append(Value(scale * told["airspeed"].value, low, high))
    if not one:
        return None
    k = together(one)
    return None if k.low <= 0.0 <= k.high else (IsotropicMoment(k.value), {"k": (k.low, k.high)})


def _reaction(found: Rotation) -> Fitted | None:
    lead = found.told("yaw").get("lead_s")
    if lead is None or lead.low <= 0.0:
        return None
    return InertialReaction(lead.value), {"lead_s": (lead.low, lead.high)}


def _balance(found: Rotation) -> Fitted | None:
    if found.shares is not None and found.shares.turns:
        shares = found.shares.told
        effect = UnequalRotors.of({number: share.value for number, share in shares.items()})
        return effect, {f"share_{number}": (share.low, share.high) for number, share in shares.items()}
    told = {f"{name}_mm": value for name, value in found.centre_m.items() if not value.low <= 0.0 <= value.high}
    if not told:
        return None
    offset = FixedOffset(**{name: 1e3 * value.value for name, value in told.items()})
    return offset, {name: (1e3 * value.low, 1e3 * value.high) for name, value in told.items()}
