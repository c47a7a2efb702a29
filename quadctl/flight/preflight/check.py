"""Check of a mission with this vehicle, compensator and limits, from the files alone: is it fit to be flown?"""

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

from quadctl.compensator import Compensator, check_compensator
from quadctl.control import ControllerSettings
from quadctl.control.attitude import attitude_for_force, limit_tilt, upright_axis
from quadctl.control.throttle import throttle_for_thrust
from quadctl.effects.ground_effect_surfaces import Surfaces
from quadctl.errors import SettingsError
from quadctl.flight.pilot.guards import GuardLimits
from quadctl.flight.pilot.settings import FlightSettings
from quadctl.flight.preflight.attitude import check_look_ahead
from quadctl.flight.preflight.facts import Kind
from quadctl.flight.preflight.findings import Finding, Verdict, judged
from quadctl.flight.preflight.lateral import check_rotors
from quadctl.flight.preflight.plan import FlightPlan
from quadctl.flight.preflight.rate import Axes, check_rate, needed_rate, place
from quadctl.frames import GRAVITY_M_S2
from quadctl.missions import Mission
from quadctl.missions.profile import Sample, flown_heights_m, sampled
from quadctl.settings import Settings
from quadctl.state import Vec3, VehicleState
from quadctl.vehicle import Vehicle
from quadctl.words import Fact, fact

THRUST_MARGIN = 0.85
"""Share of the largest thrust beyond which a mission leaves little for attitude control."""
SPEED_MARGIN = 0.8
"""Share of a guard's speed that a mission may use without a warning, as the vehicle overshoots."""
CLEARANCE_M = 0.05
"""Clearance between the lowest rotor tip and the ground: the accuracy of height control near the ground."""
ENDURANCE_MARGIN = 0.8


class Demand(NamedTuple):
    """Demand of one sample of a mission on the vehicle."""

    sample: Sample
    tilt_rad: float
    """Tilt for the reference's acceleration, the controller's answer to a jump and the compensator's force."""
    thrust_n: float
    """Thrust to ask of all rotors together, within the controller's limit of tilt, by the compensator's ratio."""
    thrust_ratio: float
    """Thrust ratio of the compensator."""
    axis: Vec3 = (0.0, 0.0, -1.0)
    """Direction of the thrust axis, NED."""


def check_flight(plan: FlightPlan) -> list[Finding]:
    """All findings about the plan of a flight."""
    mission, settings, vehicle = plan.mission, plan.settings, plan.body.vehicle
    samples = sampled(mission)
    every = [sample for of_phase in samples for sample in of_phase]
    findings = [_mission(mission, samples), *_compensator(plan)]
    fit = all(finding.verdict is not Verdict.REFUSED for finding in findings)
    compensator = Compensator(plan.compensator if fit else plan.body, settings.compensator_limits)
    demands = [_demand(sample, vehicle, settings.controller, compensator) for sample in every]
    in_air = demands[len(samples[0]) - 1 :]  # without the climb from the ground
    return [
        *findings,
        _ground(in_air, vehicle, settings),
        *_ceiling(mission, samples, vehicle),
        _fence(mission, every),
        *check_rotors(plan),
        *_demanded(plan, demands),
        check_look_ahead(plan),
        *_band(in_air, settings),
        *_guards(settings.guards),
        _battery(mission, vehicle, settings),
    ]


def demands_of(plan: FlightPlan) -> list[Demand]:
    """Demands of a mission on its vehicle, with a compensator that is fit to fly."""
    samples = [sample for of_phase in sampled(plan.mission) for sample in of_phase]
    compensator = Compensator(plan.compensator, plan.settings.compensator_limits)
    return [_demand(sample, plan.body.vehicle, plan.settings.controller, compensator) for sample in samples]


def needed_rate_rad_s(plan: FlightPlan) -> float:
    """Largest rate with which the mission turns the thrust axis."""
    return needed_rate(_axes(demands_of(plan)), plan)[0]


def check_demands(plan: FlightPlan) -> list[Finding]:
    """Findings about what the reference asks of vehicle and controller in speed, tilt, rate and thrust."""
    return _demanded(plan, demands_of(plan))


def _demanded(plan: FlightPlan, demands: Sequence[Demand]) -> list[Finding]:
    return [
        _speed(demands, plan),
        _tilt(demands, plan),
        check_rate(_axes(demands), plan),
        _thrust(demands, plan),
    ]


def _axes(demands: Sequence[Demand]) -> Axes:
    return [(demand.sample.time_s, demand.axis) for demand in demands]


def _demand(sample: Sample, vehicle: Vehicle, controller: ControllerSettings, compensator: Compensator) -> Demand:
    north, east, up = (
        own + answer
        for own, answer in zip(sample.reference.acceleration_m_s2, _answer(sample.jump_m, controller), strict=True)
    )
    force_ned: Vec3 = (
        vehicle.mass_kg * north,
        vehicle.mass_kg * east,
        -vehicle.mass_kg * max(up + GRAVITY_M_S2, 0.0),
    )
    x, y, z = sample.reference.position_m
    u, v, w = sample.reference.velocity_m_s
    state = VehicleState(sample.time_s, (x, y, -z), (u, v, -w), attitude_for_force(force_ned, 0.0))
    here = compensator.surroundings(state, 0.0)
    fx, fy, fz = compensator.force_ned_n(here, vehicle.weight_n)
    force_ned = (force_ned[0] - fx, force_ned[1] - fy, force_ned[2] - fz)
    tilt_rad = math.atan2(math.hypot(force_ned[0], force_ned[1]), max(-force_ned[2], 0.0))
    axis = force_ned
    if controller.actuation == "full":
        tilt_rad = max(0.0, tilt_rad - vehicle.allocation.widest_angle_rad(math.hypot(*force_ned)))
        axis = upright_axis(force_ned, vehicle.allocation)
    given_n = math.hypot(*limit_tilt(force_ned, math.radians(controller.max_tilt_deg))) / vehicle.axial_share
    ratio = compensator.thrust_ratio(here, given_n)
    return Demand(sample, tilt_rad, given_n / ratio, ratio, axis)


def _answer(jump_m: Vec3, controller: ControllerSettings) -> Vec3:
    """Acceleration (north, east, up) with which the controller answers a jump of the reference."""
    north, east, up = (
        p * jump
        for p, jump in zip((*(controller.position_p,) * 2, controller.position_p_vertical), jump_m, strict=True)
    )
    level, upright = controller.velocity_horizontal.p, controller.velocity_vertical.p
    climb = min(max(up, -controller.max_down_m_s), controller.max_up_m_s)
    rise = min(max(upright * climb, -controller.max_acceleration_down_m_s2), controller.max_acceleration_up_m_s2)
    return level * north, level * east, rise


def _mission(mission: Mission, samples: Sequence[Sequence[Sample]]) -> Finding:
    lowest, highest = flown_heights_m(samples)
    limits = mission.limits
    return judged(
        "mission",
        fact(
            Kind.MISSION,
            name=mission.name,
            duration_s=mission.duration_s,
            time_scale=mission.time_scale,
            phases=len(mission.phases),
            lowest_m=lowest,
            highest_m=highest,
            min_z_m=limits.min_z_m,
            max_z_m=limits.max_z_m,
            until=mission.until,
        ),
    )


def _compensator(plan: FlightPlan) -> Iterator[Finding]:
    model = plan.compensator
    if not model.stack:
        yield judged("compensator", Fact(Kind.NO_COMPENSATOR))
        return
    low, high = plan.rotor_heights_m
    try:
        warnings = check_compensator(model, low, high, model.name)
    except SettingsError as error:
        yield Finding(Verdict.REFUSED, "compensator", fact(Kind.TOLD, text=str(error)))
        return
    yield judged(
        "compensator",
        fact(Kind.COMPENSATOR, effects=[effect.name for effect in model.effects], low_m=low, high_m=high),
        warning=fact(Kind.SEVERAL, facts=[*map(str, warnings)]) if warnings else None,
    )
    yield from _surfaces(plan)
    for item in model.stack:
        fitted = item.fitted.height_m if item.fitted is not None else None
        if fitted is None or "height_over_radius" not in item.effect.depends_on:
            continue
        outside = low < fitted[0] - 1e-6 or high > fitted[1] + 1e-6
        fade = plan.settings.compensator_limits.fade_m
        yield judged(
            "compensator",
            fact(Kind.FITTED_HEIGHTS, effect=item.effect.name, low_m=fitted[0], high_m=fitted[1]),
            warning=fact(Kind.BEYOND_FITTED, fade_m=fade) if outside else None,
        )


def _surfaces(plan: FlightPlan) -> Iterator[Finding]:
    """Surfaces of the mission, with a warning where the compensator does not know them."""
    effects = [effect for effect in plan.compensator.effects if isinstance(effect, Surfaces)]
    place = plan.mission.place
    for effect in effects:
        known = list(effect.surfaces)
        if place is None:
            warning = fact(Kind.PLACE_UNKNOWN, known=known)
            yield judged("surfaces", fact(Kind.SURFACES, names=known), warning=warning)
            continue
        unknown = [name for name in place.surfaces if name not in effect.surfaces]
        warning = fact(Kind.SURFACES_UNKNOWN, known=known, unknown=unknown)
        below = fact(Kind.SURFACES, names=list(place.surfaces))
        yield judged("surfaces", below, warning=warning if unknown else None)


def _ground(demands: Sequence[Demand], vehicle: Vehicle, settings: FlightSettings) -> Finding:
    """Finding about the lowest rotor of the tilted vehicle, which must not touch the ground."""
    reach = max(math.hypot(r.position_m[0], r.position_m[1]) for r in vehicle.rotors) + vehicle.rotor.radius_m
    most = math.radians(settings.controller.max_tilt_deg)

    def clearance_m(demand: Demand) -> float:
        plane = demand.sample.reference.position_m[2] + vehicle.rotor_height_m
        return plane - reach * math.sin(min(demand.tilt_rad, most))

    worst = min(demands, key=clearance_m)
    z, gap, lean = worst.sample.reference.position_m[2], clearance_m(worst), min(worst.tilt_rad, most)
    refused = warning = None
    lowest = min(demand.sample.reference.position_m[2] for demand in demands)
    if gap <= 0.0:
        refused = Fact(Kind.TOUCHES_GROUND)
    elif settings.height_datum == "takeoff" and lowest < settings.rest_height_m:
        refused = fact(Kind.BELOW_REST, z_m=lowest, rest_m=settings.rest_height_m)
    elif gap < CLEARANCE_M:
        warning = fact(Kind.LITTLE_CLEARANCE, least_m=CLEARANCE_M)
    found = fact(Kind.CLEARANCE, gap_m=gap, z_m=z, tilt_deg=math.degrees(lean))
    return judged("ground", found, refused=refused, warning=warning)


def _ceiling(mission: Mission, samples: Sequence[Sequence[Sample]], vehicle: Vehicle) -> Iterator[Finding]:
    if vehicle.ceiling_m is None:
        return
    highest = flown_heights_m(samples)[1] + vehicle.rotor_height_m
    guard = mission.limits.max_z_m + mission.limits.margin_m
    refused = warning = None
    if highest > vehicle.ceiling_m - vehicle.rotor.radius_m:
        refused = fact(Kind.NEAR_CEILING, radius_m=vehicle.rotor.radius_m)
    elif guard + vehicle.rotor_height_m > vehicle.ceiling_m:
        warning = fact(Kind.GUARD_ABOVE_CEILING, guard_m=guard)
    found = fact(Kind.CEILING, highest_m=highest, ceiling_m=vehicle.ceiling_m)
    yield judged("ceiling", found, refused=refused, warning=warning)


def _fence(mission: Mission, samples: Sequence[Sample]) -> Finding:
    farthest = max(math.hypot(*sample.reference.position_m[:2]) for sample in samples)
    fence = mission.limits.max_distance_m + mission.limits.margin_m
    return judged("fence", fact(Kind.FENCE, farthest_m=farthest, fence_m=fence))


def _speed(demands: Sequence[Demand], plan: FlightPlan) -> Finding:
    guard, controller = plan.settings.guards.max_speed_m_s, plan.settings.controller
    samples = [demand.sample for demand in demands]
    fastest = max(samples, key=lambda sample: sample.speed_m_s)
    top = fastest.speed_m_s
    level = max(math.hypot(*sample.reference.velocity_m_s[:2]) for sample in samples)
    climb = max(max(0.0, sample.reference.velocity_m_s[2]) for sample in samples)
    sink = max(max(0.0, -sample.reference.velocity_m_s[2]) for sample in samples)
    lags = [
        fact(Kind.FALLS_BEHIND, name=name, limit_m_s=limit, speed_m_s=speed)
        for name, speed, limit in (
            ("max_horizontal_m_s", level, controller.max_horizontal_m_s),
            ("max_up_m_s", climb, controller.max_up_m_s),
            ("max_down_m_s", sink, controller.max_down_m_s),
        )
        if speed > limit + 1e-6
    ]
    near = fact(Kind.NEAR_SPEED_GUARD, margin=1.0 - SPEED_MARGIN) if top > SPEED_MARGIN * guard else None
    return judged(
        "speed",
        fact(
            Kind.SPEED,
            top_m_s=top,
            climb_m_s=climb,
            descent_m_s=sink,
            most_m_s=guard,
            **place(plan.mission, fastest.time_s),
        ),
        refused=Fact(Kind.SPEED_BEYOND_GUARD) if top >= guard else None,
        warning=fact(Kind.SEVERAL, facts=lags) if lags else near,
    )


def _tilt(demands: Sequence[Demand], plan: FlightPlan) -> Finding:
    steepest = max(demands, key=lambda demand: demand.tilt_rad)
    top, where = math.degrees(steepest.tilt_rad), place(plan.mission, steepest.sample.time_s)
    limit, guard = plan.settings.controller.max_tilt_deg, plan.settings.guards.max_tilt_deg
    refused = warning = None
    if limit >= guard:
        refused = Fact(Kind.TILT_BEYOND_GUARD)
    elif top > limit:
        warning = Fact(Kind.LEANS_LESS)
    found = fact(Kind.TILT, top_deg=top, limit_deg=limit, guard_deg=guard, **where)
    return judged("tilt", found, refused=refused, warning=warning)


def _thrust(demands: Sequence[Demand], plan: FlightPlan) -> Finding:
    vehicle, controller = plan.body.vehicle, plan.settings.controller
    peak = max(demands, key=lambda demand: demand.thrust_n)
    share, hover = peak.thrust_n / vehicle.max_thrust_n, vehicle.weight_n / vehicle.max_thrust_n
    throttle = throttle_for_thrust(peak.thrust_n, vehicle, high=math.inf)
    refused = warning = None
    if share > 1.0 or throttle > controller.max_throttle:
        refused = fact(Kind.TOO_WEAK, most_n=vehicle.max_thrust_n, max_throttle=controller.max_throttle)
    elif share > THRUST_MARGIN:
        warning = fact(Kind.LITTLE_THRUST, margin=THRUST_MARGIN)
    return judged(
        "thrust",
        fact(
            Kind.THRUST,
            thrust_n=peak.thrust_n,
            most_n=vehicle.max_thrust_n,
            share=share,
            hover=hover,
            throttle=throttle,
            **place(plan.mission, peak.sample.time_s),
        ),
        refused=refused,
        warning=warning,
    )


def _band(demands: Sequence[Demand], settings: FlightSettings) -> Iterator[Finding]:
    """Range of the compensator's correction, with a warning where its limits cut it off."""
    ratios = [demand.thrust_ratio for demand in demands]
    if all(ratio == 1.0 for ratio in ratios):
        return
    low, high, band = min(ratios), max(ratios), settings.compensator_limits.band
    cut = high >= 1.0 + band - 1e-9 or low <= 1.0 - band + 1e-9
    yield judged(
        "compensator",
        fact(Kind.RATIO, low=low, high=high, least=1.0 - band, most=1.0 + band),
        warning=Fact(Kind.RATIO_CUT) if cut else None,
    )


def _guards(guards: GuardLimits) -> Iterator[Finding]:
    """Finding about guards that somebody has turned off, as for a test on the bench, and may have forgotten."""
    parts = {"": guards, "continuity.": guards.continuity, "following.": guards.following}
    off = [name for where, limits in parts.items() for name in _turned_off(limits, where)]
    if off:
        yield judged("guards", fact(Kind.GUARDS_OFF, names=off), warning=Fact(Kind.FOR_THE_BENCH))


def _turned_off(limits: Settings, where: str) -> list[str]:
    """Names of the limits that are 0 and are not by default."""
    fields = type(limits).model_fields
    return [f"{where}{name}" for name, field in fields.items() if getattr(limits, name) == 0.0 != field.default]


def _battery(mission: Mission, vehicle: Vehicle, settings: FlightSettings) -> Finding:
    limit_v, endurance_s = settings.guards.min_battery_v, vehicle.endurance_s
    flight = {"duration_s": mission.duration_s, "endurance_s": endurance_s}
    if endurance_s is not None and mission.duration_s > endurance_s:
        return judged("battery", fact(Kind.ENDURANCE, **flight), refused=Fact(Kind.DOES_NOT_LAST))
    if endurance_s is not None and mission.duration_s > ENDURANCE_MARGIN * endurance_s:
        little = fact(Kind.LITTLE_BATTERY, margin=1.0 - ENDURANCE_MARGIN)
        return judged("battery", fact(Kind.ENDURANCE, **flight), warning=little)
    objections = [] if limit_v else [Fact(Kind.VOLTAGE_UNGUARDED)]
    if endurance_s is None:
        objections.append(Fact(Kind.ENDURANCE_UNKNOWN))
    return judged(
        "battery",
        fact(Kind.ENDURANCE, **flight, least_v=limit_v),
        warning=fact(Kind.BOTH, facts=objections) if objections else None,
    )
