"""Lateral force before a flight with `actuation: full`: can the rotors give it, and will the autopilot?"""

import math
from collections.abc import Iterator

from quadctl.flight.autopilot.port import Autopilot
from quadctl.flight.preflight.facts import Kind
from quadctl.flight.preflight.findings import Finding, judged
from quadctl.flight.preflight.plan import FlightPlan
from quadctl.vehicle import Vehicle
from quadctl.words import Fact, fact

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
    found, refused = fact(Kind.LATERAL, reach_n=reach_n, share=reach_n / vehicle.weight_n), None
    if not any(rotor.cant_deg or rotor.dihedral_deg for rotor in vehicle.rotors):
        found, refused = Fact(Kind.FULL), fact(Kind.UPRIGHT, vehicle=vehicle.name)
    elif not allocation.fully_actuated:
        found = Fact(Kind.FULL)
        refused = fact(Kind.TOO_FEW_DIRECTIONS, vehicle=vehicle.name, rank=allocation.rank)
    yield judged(TOPIC, found, refused=refused, warning=None if reach_n else Fact(Kind.NO_RESERVE))


async def ask_about_lateral_force(plan: FlightPlan, autopilot: Autopilot) -> list[Finding]:
    """Findings about what the autopilot will do with lateral force; none where the flight does not ask for it."""
    if plan.settings.controller.actuation != "full":
        return []
    names = autopilot.firmware.rotor_axis_parameters
    if names is None:
        full = fact(Kind.FULL_ON, autopilot=autopilot.description)
        return [judged(TOPIC, full, refused=Fact(Kind.NO_LATERAL_SETPOINT))]
    vehicle = plan.body.vehicle
    by_rotor = [names(rotor) for rotor in range(vehicle.n_rotors)]
    values = await autopilot.parameters(["CA_AIRFRAME", *(name for axis in by_rotor for name in axis)])
    return [judged(TOPIC, Fact(Kind.ALLOCATION), refused=_unlike(vehicle, by_rotor, values))]


def _unlike(vehicle: Vehicle, by_rotor: list[tuple[str, str, str]], values: dict[str, float]) -> Fact | None:
    """Difference of the autopilot's rotors from those of the vehicle file, or None."""
    if missing := [name for name in ("CA_AIRFRAME", *sum(by_rotor, ())) if name not in values]:
        return fact(Kind.AXES_UNTOLD, name=missing[0], rotors=vehicle.n_rotors)
    if values["CA_AIRFRAME"] != 0.0:
        return fact(Kind.NO_MULTIROTOR, airframe=values["CA_AIRFRAME"])
    for number, (rotor, names) in enumerate(zip(vehicle.rotors, by_rotor, strict=True), start=1):
        theirs = [values[name] for name in names]
        along = sum(a * b for a, b in zip(theirs, rotor.axis, strict=True)) / max(math.hypot(*theirs), 1e-9)
        if math.degrees(math.acos(min(max(along, -1.0), 1.0))) > MAX_AXIS_DIFFERENCE_DEG:
            axes = {"found": theirs, "expected": rotor.axis}
            return fact(Kind.OTHER_AXIS, name=names[0], **axes, rotor=number, vehicle=vehicle.name)
    return None
