"""The second ten traps, of other kinds than the first. The honest answers were written before the lab saw a flight."""

from dataclasses import replace

import numpy as np

from quadctl.logs.flight_log import FlightLog
from quadctl.vehicle import load_vehicle
from studies.worlds.traps.flights import all_round, back_and_forth, listed, staircase
from studies.worlds.traps.judgement import Honest, Trap
from studies.worlds.traps.simulation import (
    OUTDOORS,
    VEHICLES,
    WEIGHT_M_S2,
    Body,
    Floats,
    Leg,
    World,
    fly,
    heading,
    rotation,
)

SECOND: list[Trap] = []
CLEAN = {"none", "unexplained"}
"""Verdicts that are true of a clean vehicle whose log is odd."""

RAPTOR = load_vehicle(VEHICLES / "raptor.yaml")


def with_columns(log: FlightLog, columns: dict[str, Floats]) -> FlightLog:
    """The log with some of its columns replaced."""
    return replace(log, columns={**log.columns, **columns})


def table(log: FlightLog, *names: str) -> Floats:
    """Columns of a log side by side, shape (n, names)."""
    return np.column_stack([log[name] for name in names])


def attitude(roll_deg: float, pitch_deg: float, yaw_deg: float) -> Floats:
    """Rotation from body to world of Euler angles, shape (3, 3)."""
    roll, pitch, yaw = np.radians([roll_deg, pitch_deg, yaw_deg])
    pitched = rotation(np.array([0.0, pitch, 0.0])) @ rotation(np.array([roll, 0.0, 0.0]))
    result: Floats = heading(yaw) @ pitched
    return result


CLOCK = 0.94
"""Seconds of the logger in a second."""


@listed(SECOND, "raptor", Honest("none, or unexplained", verdicts=CLEAN))
def slow_clock(name: str, vehicle: str) -> FlightLog:
    """A logger without a quartz stamps the time, its clock 6 % slow: speeds change 6 % faster than they did, as if
    thrust grew with more than the square of the rotor speed. Quick steps of height and runs; the vehicle is clean."""
    bobbing = [leg for _ in range(7) for leg in staircase((0.8, 2.2), 1.6, 1.2)]
    log = fly(name, vehicle, [*bobbing, *back_and_forth(1.2, 1.5, 2.2, 1.5, 4), *bobbing])
    return with_columns(log, {"time_s": log.time_s * CLOCK})


SLOPE = np.array([0.017, 0.011])
"""Fall of the floor to the north and east."""


@listed(SECOND, "raptor", Honest("none, or unexplained", verdicts=CLEAN))
def sloping_floor(name: str, vehicle: str) -> FlightLog:
    """The motion capture was levelled on a hall floor that falls 2 % towards its drain, so that all poses are askew by
    1.2° and weight has a part to the side, 0.2 m/s², whatever the heading: as a wind. The vehicle is clean."""
    down = np.array([*SLOPE, 1.0])
    sideways = 9.81 * down / np.linalg.norm(down) - WEIGHT_M_S2
    return fly(name, vehicle, [*all_round(), *all_round()[4:]], World(force_n=lambda time_s, body: 1.5 * sideways))


WIRE_OFF_S = 9.96


@listed(SECOND, "raptor", Honest("none, or unexplained", verdicts=CLEAN))
def telemetry_wire_off(name: str, vehicle: str) -> FlightLog:
    """The telemetry wire of motor 3 comes off as the vehicle climbs away, and the log repeats its last speed, 6.7 %
    above hover, for the rest of the flight: rotor 3 seems to turn fast for little thrust. The vehicle is clean."""
    log = fly(name, vehicle, [*staircase((0.8, 0.8, 2.0, 1.4), 1.8, 4.0), *all_round()[4:]])
    held = int(np.searchsorted(log.time_s, WIRE_OFF_S))
    rpm = log["motor3_rpm"].copy()
    rpm[held:] = rpm[held]
    return with_columns(log, {"motor3_rpm": rpm})


DECK_M, DECK_NORTH_M, DECK_EDGE_M = 1.0, 1.0, 0.05


def over_deck(time_s: float, body: Body) -> Floats:
    """Thrust ratio of each rotor of RAPTOR, K = 1 + 0.35 exp(-0.9 h/R), h above the deck or, south of it, the floor."""
    arms = np.array([rotor.position_m for rotor in RAPTOR.rotors]) @ body.attitude.T
    places = body.position_m + arms
    over = 1.0 / (1.0 + np.exp((DECK_NORTH_M - places[:, 0]) / DECK_EDGE_M))
    floor, deck = (0.35 * np.exp(-0.9 * (-places[:, 2] - up_m) / 0.12) for up_m in (0.0, DECK_M))
    result: Floats = 1.0 + (1.0 - over) * floor + over * np.minimum(deck, 0.35)
    return result


@listed(
    SECOND,
    "raptor",
    Honest(
        "ground_effect (b, if it is named, 7.5 1/m), or unexplained",
        {"ground_effect"},
        {"unexplained"},
        {"ground_effect.exponential b": (7.5, 7.5)},
    ),
)
def landing_deck(name: str, vehicle: str) -> FlightLog:
    """A hover close above a landing deck 1 m high, after 50 s at 1.15 m to 2 m above the floor, until the log ends; in
    the deck's ground effect, K = 1 + 0.35 exp(-0.9 h/R), thrust grows by 11 %, as if a load was dropped."""
    before = [*staircase((1.4, 1.15, 1.6, 1.25, 2.0, 1.15), 2.5, 4.5), *back_and_forth(0.6, 1.3, 2.5, 1.5, 1)]
    heights = (1.3, 1.17, 1.14, 1.18, 1.15, 1.13, 1.16, 1.14)
    after = [Leg(2.0, 0.1 * (-1) ** i, height, 2.5, 4.0) for i, height in enumerate(heights)]
    return fly(name, vehicle, [*before, *after], World(thrust_ratio=over_deck))


def thin_air(time_s: float, body: Body) -> Floats:
    """Thrust ratio of each rotor in the standard atmosphere, whose density falls 2.8 % in the first 300 m."""
    return np.full(4, (1.0 + 2.2558e-5 * float(body.position_m[2])) ** 4.256)


@listed(
    SECOND,
    "x500",
    Honest(
        "unexplained, or a thrust_scale between the ends of the profile, 0.97 to 1",
        {"thrust_scale"},
        {"unexplained"},
        {"thrust_scale.constant factor": (0.971, 1.03)},
    ),
)
def air_sounding(name: str, vehicle: str) -> FlightLog:
    """A weather flight to 300 m and back in calm air, hovering every 60 m. The air's density, and thrust with it, falls
    2.8 % on the way up: as a hanging cable of 300 m, a loss that grows with altitude and comes back."""
    heights = (2.0, 62.0, 122.0, 182.0, 242.0, 302.0, 242.0, 182.0, 122.0, 62.0, 2.0)
    return fly(name, vehicle, staircase(heights, 20.0, 5.0), World(thrust_ratio=thin_air), OUTDOORS)


WARM, WARM_UP_S = 0.018, 35.0
"""Share by which a warm controller tells too high a rotor speed, and how fast it warms up."""


@listed(
    SECOND,
    "raptor",
    Honest(
        "none, or unexplained, or a thrust_scale between 0.96 and 1",
        {"thrust_scale"},
        CLEAN,
        {"thrust_scale.constant factor": (0.96, 1.04)},
    ),
)
def warm_controllers(name: str, vehicle: str) -> tuple[FlightLog, FlightLog]:
    """Motor controllers count time by an oscillator that drifts as they warm up: rotor speeds read up to 1.8 % too
    high. Two flights, a fresh battery between, the controllers still half warm: thrust seems to fall with the voltage,
    and not to recover with the battery. The vehicle is clean."""
    logs = []
    for number, cold in enumerate((1.0, 0.5), start=1):
        log = fly(f"{name}_{number}", vehicle, all_round()[:: 1 if number == 1 else -1])
        drift = 1.0 + WARM * (1.0 - cold * np.exp(-log.time_s / WARM_UP_S))
        logs.append(with_columns(log, {f"motor{i}_rpm": np.round(log[f"motor{i}_rpm"] * drift) for i in range(1, 5)}))
    return logs[0], logs[1]


DAYS_M_S = (np.array([-4.0, 0.0, 0.0]), np.array([0.0, 2.5, 0.0]))
"""Air velocity of each day: from the north, then from the west."""
DRAG_1_S = 0.25


@listed(
    SECOND,
    "x500",
    Honest(
        "rotor_drag with 0.25 1/s, or the wind of one of the days, (-4, 0) or (0, 2.5) m/s, or both, or unexplained",
        {"rotor_drag", "wind"},
        {"unexplained"},
        {
            **{f"rotor_drag.linear d_{axis}": (DRAG_1_S, DRAG_1_S) for axis in "xyz"},
            "wind.steady drag": (DRAG_1_S, DRAG_1_S),
        },
        {
            f"wind.{effect} {axis}_m_s": values
            for effect in ("steady", "both_drags")
            for axis, values in (("north", (-4.0, 0.0)), ("east", (0.0, 2.5)))
        },
    ),
)
def another_day(name: str, vehicle: str) -> tuple[FlightLog, FlightLog]:
    """Two flights of one vehicle with rotor drag of 0.25 1/s on two days: wind of 4 m/s from the north on the first, of
    2.5 m/s from the west on the second. One wind for both logs, the mean of the two, blew on neither day."""
    runs = [*back_and_forth(6.0, 5.0, 5.0, 3.0, 2), *back_and_forth(6.0, 5.0, 5.0, 3.0, 2, axis="east")]
    turned = [replace(leg, yaw_deg=90.0) for leg in runs]
    logs = []
    for number, air in enumerate(DAYS_M_S, start=1):

        def drag(time_s: float, body: Body, air: Floats = air) -> Floats:
            result: Floats = -2.064 * DRAG_1_S * (body.velocity_m_s - air)
            return result

        logs.append(fly(f"{name}_{number}", vehicle, [*runs, *turned], World(force_n=drag), OUTDOORS))
    return logs[0], logs[1]


BOX_AREA_M2, BOX_UP_M = 0.035, 0.18
"""Drag area (coefficient times area) of the parachute's box, and its height above the centre of mass."""


def box_drag(time_s: float, body: Body) -> Floats:
    """Drag of the box, NED, N."""
    velocity = body.velocity_m_s + body.attitude @ np.cross(body.rates_rad_s, [0.0, 0.0, -BOX_UP_M])
    result: Floats = -0.5 * 1.225 * BOX_AREA_M2 * np.linalg.norm(velocity) * velocity
    return result


def box_moment(time_s: float, body: Body) -> Floats:
    """Moment of the box's drag about the centre of mass, FRD, N m."""
    result: Floats = np.cross([0.0, 0.0, -BOX_UP_M], body.attitude.T @ box_drag(time_s, body))
    return result


@listed(
    SECOND,
    "x500",
    Honest(
        "body_drag with an area_x of 0.035 m² (10 % for the air's density), and its moment, or unexplained",
        {"body_drag", "airspeed_moment"},
        {"unexplained"},
        {"body_drag.quadratic area_x_m2": (0.0315, 0.0385)},
    ),
)
def parachute_on_a_mast(name: str, vehicle: str) -> FlightLog:
    """A parachute's box, drag area 0.035 m², on a mast 0.18 m above the centre of mass. Always nose first at up to
    9 m/s, its drag pitches the nose up, and the rear rotors turn faster, as if they were in the wake of the others."""
    legs = [Leg(0.0, 0.0, 8.0, 0.0, 4.0)]
    for run_s in (14.0, 18.0, 24.0):
        legs += [Leg(68.0, 0.0, 8.0, run_s, 3.0), Leg(68.0, 0.0, 8.0, 3.0, 2.0, yaw_deg=180.0)]
        legs += [Leg(0.0, 0.0, 8.0, run_s, 3.0, yaw_deg=180.0), Leg(0.0, 0.0, 8.0, 3.0, 2.0)]
    return fly(name, vehicle, legs, World(force_n=box_drag, moment_n_m=box_moment), OUTDOORS)


TRACKER_KG, ARM_M = 0.055, np.array([0.124, 0.124, 0.0])
CENTRE_M = ARM_M * TRACKER_KG / (1.5 + TRACKER_KG)
"""Centre of mass with the tracker, from that without it, FRD."""


def tracker_moment(time_s: float, body: Body) -> Floats:
    """Addition of the moved centre of mass to the moment of the rotors about it, FRD, N m."""
    thrust_n = RAPTOR.rotor.thrust_n_per_rpm2 * float((body.speeds_rpm**2).sum())
    result: Floats = np.cross(-CENTRE_M, [0.0, 0.0, -thrust_n])
    return result


@listed(
    SECOND,
    "raptor",
    Honest(
        "thrust_scale with a factor of 0.965 (1.037 of mass), or payload of 0.055 kg, a pair with one, or unexplained",
        {"thrust_scale", "payload"},
        {"unexplained"},
        {"payload.step mass_kg": (0.05, 0.06)},
        {"thrust_scale.constant factor": (1.5 / (1.5 + TRACKER_KG), (1.5 + TRACKER_KG) / 1.5)},
    ),
)
def tracker_on_the_arm(name: str, vehicle: str) -> FlightLog:
    """A tracker of 55 g is clamped on the arm at rotor 1 for the whole flight, and the vehicle file does not know it.
    Force, roll and pitch are those of a rotor 1 that lost 13 % of its thrust; yaw is not, and all four are sound."""
    reduced = 1.5 * TRACKER_KG / (1.5 + TRACKER_KG)
    inertia = np.diag(RAPTOR.principal_inertia_kg_m2) + reduced * (
        float(ARM_M @ ARM_M) * np.eye(3) - np.outer(ARM_M, ARM_M)
    )
    world = World(moment_n_m=tracker_moment, mass_kg=lambda time_s: 1.5 + TRACKER_KG, inertia_kg_m2=inertia)
    # The logged point is the centre of the rotors, 6 mm from the centre of mass.
    log = fly(name, vehicle, all_round(), world)
    up = np.array([1.0, 1.0, -1.0])
    turns = np.array([attitude(*angles) for angles in table(log, "roll_deg", "pitch_deg", "yaw_deg")])
    rates = table(log, "roll_rate_rad_s", "pitch_rate_rad_s", "yaw_rate_rad_s")
    place = table(log, "x_m", "y_m", "z_m") - up * (turns @ CENTRE_M)
    speed = table(log, "vx_m_s", "vy_m_s", "vz_m_s") - up * np.einsum("nij,nj->ni", turns, np.cross(rates, CENTRE_M))
    names = ("x_m", "y_m", "z_m", "vx_m_s", "vy_m_s", "vz_m_s")
    return with_columns(log, dict(zip(names, np.hstack([place, speed]).T, strict=True)))


BEAM_M, LINE_M, STRETCH_N_M = 2.6, 0.7, 1.0
"""Height of the beam that the safety line hangs from, length of the line at rest, and its stiffness."""


def safety_line(time_s: float, body: Body) -> Floats:
    """Pull of the elastic line on the vehicle, NED, N; it stretches and does not push."""
    line = np.array([0.0, 0.0, -BEAM_M]) - body.position_m
    length = float(np.linalg.norm(line))
    result: Floats = STRETCH_N_M * max(length - LINE_M, 0.0) * line / length
    return result


@listed(
    SECOND,
    "raptor",
    Honest("tether (a line is there, though it hangs from above), or unexplained", {"tether"}, {"unexplained"}),
)
def line_from_a_beam(name: str, vehicle: str) -> FlightLog:
    """A first flight on an elastic safety line (1 N/m) from a beam at 2.6 m. It is slack above 1.9 m and pulls up by
    1.5 N, a tenth of the weight, at 0.4 m: the lower, the more lift, as in ground effect."""
    heights = (2.1, 1.9, 1.6, 1.3, 1.0, 0.7, 0.5, 0.4, 0.6, 0.8, 1.1, 1.4, 1.7, 2.0)
    legs = [*staircase(heights, 2.0, 4.0), *back_and_forth(0.3, 1.2, 2.0, 2.0, 2)]
    return fly(name, vehicle, legs, World(force_n=safety_line))
