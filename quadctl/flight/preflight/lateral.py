"""Lateral force before a flight with `actuation: full`: can the rotors give it, and will the autopilot?"""

import math
from collections.abc import Iterator

from quadctl.flight.autopilot.port import Autopilot
from quadctl.flight.preflight.findings import Finding, judged
from quadctl.flight.preflight.plan import FlightPlan
from quadctl.vehicle import Vehicle

TOPIC = "actuation"
MAX_AXIS_DIFFERENCE_DEG = 5.0
"""Largest angle between a rotor's axis in the autopilot's parameters and in the vehicle file: it is a side force of a
tenth of that rotor's thrust."""


def check_rotors(plan: FlightPlan) -> Iterator[Finding]:
    """Findings about the rotors of a flight with full actuation."""
    vehicle, allocation = plan.body.vehicle, plan.body.vehicle.allocation
    if plan.settings.controller.actuation != "full":
        return
    reach_n = allocation.lateral_reach_n(vehicle.weight_n)
    text = f"full, lateral force up to {reach_n:.1f} N in hover ({reach_n / vehicle.weight_n:.0%} of the weight)"
    refused = None
    if not any(rotor.cant_deg or rotor.dihedral_deg for rotor in vehicle.rotors):
        text = "full"
        refused = f"lateral force is asked of upright rotors, expected actuation: tilt, as '{vehicle.name}' tilts none"
    elif not allocation.fully_actuated:
        text = "full"
        refused = (
            f"the rotors of '{vehicle.name}' give force and moment in {allocation.rank} independent directions, "
            "expected 6 (neighbours that cant to opposite sides), or actuation: tilt"
        )
    yield judged(TOPIC, text, refused=refused, warning=None if reach_n else "hover takes all that the rotors give")


async def ask_about_lateral_force(plan: FlightPlan, autopilot: Autopilot) -> list[Finding]:
    """Findings about what the autopilot will do with lateral force; none where the flight does not ask for it."""
    if plan.settings.controller.actuation != "full":
        return []
    names = autopilot.firmware.rotor_axis_parameters
    if names is None:
        refused = "it has no setpoint of lateral force and would fly without it, expected PX4, or actuation: tilt"
        return [judged(TOPIC, f"full on {autopilot.description}", refused=refused)]
    vehicle = plan.body.vehicle
    by_rotor = [names(rotor) for rotor in range(vehicle.n_rotors)]
    values = await autopilot.parameters(["CA_AIRFRAME", *(name for axis in by_rotor for name in axis)])
    return [judged(TOPIC, "control allocation of the autopilot", refused=_unlike(vehicle, by_rotor, values))]


def _unlike(vehicle: Vehicle, by_rotor: list[tuple[str, str, str]], values: dict[str, float]) -> str | None:
    """Difference of the autopilot's rotors from those of the vehicle file, or None."""
    if missing := [name for name in ("CA_AIRFRAME", *sum(by_rotor, ())) if name not in values]:
        return f"it does not tell {missing[0]}, expected the axes of all {vehicle.n_rotors} rotors"
    if values["CA_AIRFRAME"] != 0.0:
        return (
            f"CA_AIRFRAME is {values['CA_AIRFRAME']:g}, expected 0 (multirotor), whose rotors are mixed by their axes"
        )
    for number, (rotor, names) in enumerate(zip(vehicle.rotors, by_rotor, strict=True), start=1):
        theirs = [values[name] for name in names]
        along = sum(a * b for a, b in zip(theirs, rotor.axis, strict=True)) / max(math.hypot(*theirs), 1e-9)
        if math.degrees(math.acos(min(max(along, -1.0), 1.0))) > MAX_AXIS_DIFFERENCE_DEG:
            found, expected = (", ".join(f"{part:.3f}" for part in axis) for axis in (theirs, rotor.axis))
            return (
                f"{names[0]}, _AY, _AZ are {found}, expected {expected}, the axis of rotor {number} of "
                f"'{vehicle.name}': it would mix lateral force for other rotors"
            )
    return None
