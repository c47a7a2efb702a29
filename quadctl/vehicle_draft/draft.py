"""Text of a vehicle file, in which a comment beside each number says where it comes from."""

import math
from collections.abc import Mapping
from enum import unique
from typing import NamedTuple

import yaml

from quadctl.errors import SettingsError
from quadctl.frames import GRAVITY_M_S2
from quadctl.settings import validate
from quadctl.vehicle import Assumable, Vehicle
from quadctl.vehicle_draft.frames import (
    APART,
    FRAMES,
    Place,
    ardupilot_frame,
    are_alike,
    are_relative,
    arm_m_of,
    assumed_arm_m,
    frame_places,
    px4_frame,
    px4_places,
    scaled_to,
)
from quadctl.words import Fact, Kinds, fact

AIR_DENSITY_KG_M3 = 1.225
THRUST_COEFFICIENT = 0.011
"""C_T = T / (rho A (omega R)²) where nothing is known: propellers of multirotors have 0.007 to 0.015."""
PX4_HOVER, ARDUPILOT_HOVER, OLDER_HOVER = "MPC_THR_HOVER", "MOT_THST_HOVER", "THR_MID"
HOVERS = {PX4_HOVER: 1.0, ARDUPILOT_HOVER: 1.0, OLDER_HOVER: 1e-3}
"""Parameters that hold the throttle of hover, with their unit; the last is that of ArduPilot up to Copter 3.3."""

DRAFT = """\
# Each number says where it comes from; what is assumed is worth measuring.
name: {name}
mass_kg: {mass_kg:g}
# inertia_kg_m2: [0.01, 0.01, 0.02]  # not known: taken from mass and arm length until it is given
rotor:
  radius_m: {radius_m:g}
  thrust_n_per_rpm2: {coefficient:.4g}  # {coefficient_source}
  torque_to_thrust_m: 0.016  # assumed, as most propellers
  time_constant_s: 0.04  # assumed; quadctl discover finds a motor lag
rotors:  # FRD, m; order = motor 1, 2, ...; {places_source}
{places}
rotor_height_m: 0.0  # assumed; height of the rotor plane above the logged position
throttle: {line}  # {line_source}
assumed: [{assumed}]  # take away what you have measured
"""


@unique
class Source(Kinds):
    """Sources of the numbers of the draft, each with the template of its words."""

    PLACES_TOLD = "from CA_ROTOR*, where PX4 needs no true distances: measure them"
    DIRECTIONS_TOLD = "as CA_ROTOR*"
    GIVEN = "as given"
    FRAME_TOLD = "frame from {parameter}"
    ARM_GIVEN = "{frame}, the arm as given"
    ARM_ASSUMED = "{frame}, the arm assumed, so that the propellers are {apart:g} diameters apart; only moments need it"
    HOVER_GIVEN = "hover throttle as given"
    HOVER_TOLD = "hover throttle from {parameter}"
    ARDUPILOTS_LINE = "{hover}; ArduPilot makes thrust proportional to throttle (MOT_THST_EXPO)"
    PX4S_LINE = "{hover}; PX4 makes thrust proportional to throttle (THR_MDL_FAC)"
    SQUARE = "{hover}; thrust taken as throttle²"
    HOVER_SPEED = "from {rpm:g} rpm in hover"
    COEFFICIENT_ASSUMED = "assumed, C_T = {coefficient:g}; only rotor speeds need it"


class Answers(NamedTuple):
    """Facts about a vehicle; None where its user has not said."""

    name: str
    mass_kg: float | None = None
    """Take-off mass, with battery."""
    propeller_m: float | None = None
    """Diameter."""
    frame: str | None = None
    arm_m: float | None = None
    """From the centre to a rotor's axis; to the farthest one where the parameters place the rotors. Assumed from the
    propellers where neither says it, as moments need it, but forces hardly do."""
    hover_throttle: float | None = None
    hover_rpm: float | None = None


class Missing(NamedTuple):
    """A fact that the parameters do not hold and that the user must say."""

    field: str
    """Name of the field of `Answers`."""
    question: str


class Told(NamedTuple):
    """Facts about a vehicle that an autopilot's parameters hold; None where they do not."""

    places: tuple[Place, ...] | None
    """Places of the rotors, which make frame and arm needless; an arm that is given scales them."""
    frame: str | None
    hover_throttle: float | None
    frame_source: str = ""
    """Parameters that hold the frame."""
    hover_source: str = ""
    """Parameter that holds the throttle of hover."""


def told(parameters: Mapping[str, float]) -> Told:
    """Facts that `draft` takes from the parameters.

    Raises
    ------
    SettingsError
        The parameters describe a vehicle that this cannot draw.
    """
    hover = next((name for name in HOVERS if name in parameters), "")
    throttle = HOVERS[hover] * parameters[hover] if hover else None
    frame, source = ardupilot_frame(parameters), "FRAME_CLASS and FRAME_TYPE"
    if frame is not None and "FRAME" in parameters:
        source = "FRAME and the message of the log"
    if frame is None:
        frame, source = px4_frame(parameters) or (None, "")
    return Told(px4_places(parameters), frame, throttle, source, hover)


def answers_of(vehicle: Vehicle) -> Answers:
    """Answers from which `draft` would make the numbers of `vehicle` again.

    The frame is None where its rotors are on no regular frame; the arm and the rotor speed in hover where they were not
    said.
    """
    places = [Place(rotor.position_m, rotor.spin, rotor.cant_deg, rotor.dihedral_deg) for rotor in vehicle.rotors]
    arm_m = arm_m_of(places)
    each_n = vehicle.weight_n / vehicle.n_rotors
    assumed = vehicle.assumed or ()
    return Answers(
        vehicle.name,
        mass_kg=vehicle.mass_kg,
        propeller_m=2.0 * vehicle.rotor.radius_m,
        frame=next((frame for frame in FRAMES if are_alike(places, frame_places(frame, arm_m))), None),
        arm_m=None if "rotors" in assumed else arm_m,
        hover_throttle=vehicle.hover_throttle,
        hover_rpm=None if "rotor.thrust_n_per_rpm2" in assumed else math.sqrt(each_n / vehicle.rotor.thrust_n_per_rpm2),
    )


def missing(answers: Answers, parameters: Mapping[str, float]) -> list[Missing]:
    """Facts that a vehicle file still needs, in the order in which to ask.

    Raises
    ------
    SettingsError
        The parameters describe a vehicle that this cannot draw.
    """
    questions = [
        Missing("mass_kg", "take-off mass with battery, kg"),
        Missing("propeller_m", "diameter of a propeller, m (10 inches are 0.254)"),
    ]
    known = _told_beside(answers, parameters)
    if known.places is None and known.frame is None:
        *others, last = FRAMES
        questions.append(Missing("frame", f"frame: {', '.join(others)} or {last}"))
    if known.hover_throttle is None:
        questions.append(Missing("hover_throttle", "throttle in hover, 0 to 1"))
    return [question for question in questions if getattr(answers, question.field) is None]


def _told_beside(answers: Answers, parameters: Mapping[str, float]) -> Told:
    """Facts of the parameters that a vehicle needs beside the answers; a frame that is given stands for theirs."""
    if answers.frame is None:
        return told(parameters)
    return told({name: value for name, value in parameters.items() if name != "FRAME_CLASS"})


def draft(answers: Answers, parameters: Mapping[str, float]) -> str:
    """Text of the vehicle file.

    Parameters
    ----------
    answers
        With every fact that `missing` names; they win over the parameters.
    parameters
        The autopilot's, by name; none where it is empty.

    Raises
    ------
    SettingsError
        A fact is missing, or the numbers make no vehicle.
    """
    if absent := missing(answers, parameters):
        raise SettingsError(f"the vehicle's {absent[0].field} is not known, expected the {absent[0].question}")
    mass_kg, diameter_m = _positive(answers.mass_kg, "mass_kg"), _positive(answers.propeller_m, "propeller_m")
    places, places_source = _places(answers, parameters, diameter_m)
    line, line_source = _throttle(answers, parameters, mass_kg * GRAVITY_M_S2, len(places))
    coefficient, coefficient_source = _coefficient(answers, 0.5 * diameter_m, mass_kg, len(places))
    text = DRAFT.format(
        name=answers.name,
        mass_kg=mass_kg,
        radius_m=0.5 * diameter_m,
        coefficient=coefficient,
        coefficient_source=coefficient_source,
        places="\n".join(f"  - {_place(place)}" for place in places),
        places_source=places_source,
        line=line,
        line_source=line_source,
        assumed=", ".join(_assumed(answers, parameters)),
    )
    validate(yaml.safe_load(text), Vehicle, "the new vehicle")
    return text


def _assumed(answers: Answers, parameters: Mapping[str, float]) -> list[Assumable]:
    """Fields of the draft that rest on no answer and on no parameter."""
    found: list[Assumable] = ["rotor.torque_to_thrust_m", "rotor.time_constant_s", "rotor_height_m"]
    if not _is_proportional(parameters):
        found.insert(0, "throttle")
    if answers.hover_rpm is None:
        found.insert(0, "rotor.thrust_n_per_rpm2")
    if _assumes_arm(answers, parameters):
        found.append("rotors")
    return found


def _assumes_arm(answers: Answers, parameters: Mapping[str, float]) -> bool:
    """Tell whether neither an answer nor the parameters say how far the rotors are from the centre."""
    places = px4_places(parameters) if answers.frame is None else None
    return answers.arm_m is None and (places is None or are_relative(places))


def _is_proportional(parameters: Mapping[str, float]) -> bool:
    """Tell whether the autopilot makes thrust proportional to throttle."""
    return ARDUPILOT_HOVER in parameters or OLDER_HOVER in parameters or parameters.get("THR_MDL_FAC", 0.0) > 0.0


def _positive(value: float | None, field: str) -> float:
    if value is None or not (math.isfinite(value) and value > 0.0):
        raise SettingsError(f"the vehicle's {field} is {value}, expected a number above 0")
    return value


def _places(answers: Answers, parameters: Mapping[str, float], propeller_m: float) -> tuple[tuple[Place, ...], Fact]:
    """Places of the rotors and their source."""
    known = _told_beside(answers, parameters)
    if answers.frame is None and known.places is not None:
        if answers.arm_m is None and not are_relative(known.places):
            return known.places, Fact(Source.PLACES_TOLD)
        places, source = known.places, Fact(Source.DIRECTIONS_TOLD)
    else:
        frame = answers.frame or known.frame
        if frame is None:
            raise SettingsError("the vehicle's frame is not known: say it")
        told_by = fact(Source.FRAME_TOLD, parameter=known.frame_source)
        places, source = frame_places(frame, 1.0), Fact(Source.GIVEN) if answers.frame else told_by
    if answers.arm_m is not None:
        return scaled_to(places, _positive(answers.arm_m, "arm_m")), fact(Source.ARM_GIVEN, frame=source)
    assumed = fact(Source.ARM_ASSUMED, frame=source, apart=APART)
    return scaled_to(places, assumed_arm_m(places, propeller_m)), assumed


def _place(place: Place) -> str:
    x, y, z = (round(value, 4) + 0.0 for value in place.position_m)
    tilt = ""
    if abs(place.cant_deg) > 0.01 or abs(place.dihedral_deg) > 0.01:
        tilt = f", cant_deg: {place.cant_deg:.2f}, dihedral_deg: {place.dihedral_deg:.2f}"
    return f"{{position_m: [{x:g}, {y:g}, {z:g}], spin: {place.spin}{tilt}}}"


def _throttle(answers: Answers, parameters: Mapping[str, float], weight_n: float, rotors: int) -> tuple[str, Fact]:
    """The throttle line and its source.

    Where the autopilot makes thrust proportional to throttle, the line goes through zero. Where nobody does, thrust
    grows about as the square of the throttle, and the line is the tangent to T = W (u / u_hover)² in hover.
    """
    known = _told_beside(answers, parameters)
    hover, source = answers.hover_throttle, Fact(Source.HOVER_GIVEN)
    if hover is None:
        hover, source = known.hover_throttle, fact(Source.HOVER_TOLD, parameter=known.hover_source)
    hover = _positive(hover, "hover_throttle")
    if hover >= 1.0:
        raise SettingsError(f"the vehicle's hover_throttle is {hover:g}, expected less than 1 ({source})")
    proportional = _is_proportional(parameters)
    if ARDUPILOT_HOVER in parameters or OLDER_HOVER in parameters:
        kind = Source.ARDUPILOTS_LINE
    else:
        kind = Source.PX4S_LINE if proportional else Source.SQUARE
    per_newton, offset = (hover / weight_n, 0.0) if proportional else (0.5 * hover / weight_n, 0.5 * hover)
    most_n = (1.0 - offset) / per_newton / rotors
    numbers = f"{{per_newton: {per_newton:.4g}, offset: {offset:.4g}, max_thrust_per_rotor_n: {most_n:.4g}}}"
    return numbers, fact(kind, hover=source)


def _coefficient(answers: Answers, radius_m: float, mass_kg: float, rotors: int) -> tuple[float, Fact]:
    if answers.hover_rpm is not None:
        rpm = _positive(answers.hover_rpm, "hover_rpm")
        return mass_kg * GRAVITY_M_S2 / rotors / rpm**2, fact(Source.HOVER_SPEED, rpm=rpm)
    per_coefficient = AIR_DENSITY_KG_M3 * math.pi * radius_m**4 * (math.pi / 30.0) ** 2
    return THRUST_COEFFICIENT * per_coefficient, fact(Source.COEFFICIENT_ASSUMED, coefficient=THRUST_COEFFICIENT)
