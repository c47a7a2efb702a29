"""Questions of a form about a vehicle: its labels, the ranges of its numbers, and what is wrong with the answers."""

import math
from collections.abc import Mapping
from typing import NamedTuple

from quadctl.settings import limits
from quadctl.vehicle import Rotor, ThrottleCurve, Vehicle


class Question(NamedTuple):
    """One number that a form asks for; its answer lies between `low` and `high`."""

    label: str
    """As it stands above the field, with the unit."""
    low: float
    high: float
    optional: bool = False
    hint: str = ""
    """Help with the unit or the meaning, below the field."""


LARGEST_PROPELLER_M = 2.0
"""Largest diameter that a form takes; a larger number is one in inches."""
METRES_PER_INCH = 0.0254
_MASS, _RADIUS = limits(Vehicle, "mass_kg"), limits(Rotor, "radius_m")
_DIAMETER = 2.0 * _RADIUS[0], 2.0 * _RADIUS[1]
MASS = Question("Mass with battery / kg", *_MASS)
PROPELLER = Question("Propeller diameter / m", *_DIAMETER, hint="10 inches are 0.254 m")
NEW_VEHICLE = {
    "mass_kg": MASS,
    "propeller_m": PROPELLER,
    "diagonal_m": Question("Diagonal, motor to motor / m, if known", 0.0, 40.0, optional=True),
    "hover_throttle": Question("Throttle in hover, 0 to 1", 0.0, 1.0),
    "hover_rpm": Question("Rotor speed in hover / rpm, if known", 0.0, math.inf, optional=True),
}
"""Questions about a new vehicle, by the fields of `Answers`; twice the arm is asked for, as frames are sold."""
ITS_NUMBERS = {
    "mass_kg": MASS,
    "propeller_m": PROPELLER,
    "thrust_n_per_rpm2": Question("Thrust of a rotor / N per rpm²", *limits(Rotor, "thrust_n_per_rpm2")),
    "per_newton": Question("Throttle per newton of thrust", *limits(ThrottleCurve, "per_newton")),
    "offset": Question("Throttle at zero thrust", *limits(ThrottleCurve, "offset")),
    "max_thrust_per_rotor_n": Question("Most thrust of a rotor / N", *limits(ThrottleCurve, "max_thrust_per_rotor_n")),
}
"""Questions about the numbers of a known vehicle."""
_IN_WORDS = {
    "rotor.thrust_n_per_rpm2": ITS_NUMBERS["thrust_n_per_rpm2"].label,
    "throttle.max_thrust_per_rotor_n": ITS_NUMBERS["max_thrust_per_rotor_n"].label,
    "offset + per_newton * weight": "throttle without thrust + throttle per newton * weight",
    "rotor.radius_m": "half the propeller diameter / m",
    "radius_m": "half the propeller diameter",
    "air_density_kg_m3": "the density of the air",
    "mass_kg": MASS.label,
}
"""Keys of a vehicle file that a sentence about several of its numbers may name, in the words of the forms."""


def wrong(questions: Mapping[str, Question], answers: Mapping[str, float | None]) -> dict[str, str]:
    """Expectations of the answers that are not possible, all of them, by the names of their questions."""
    found = {
        name: _expected(question)
        for name, question in questions.items()
        if name in answers and not _is_possible(question, answers[name])
    }
    propeller = answers.get("propeller_m")
    if "propeller_m" in questions and propeller is not None and propeller > LARGEST_PROPELLER_M:
        inches = f"{propeller:g} inches are {METRES_PER_INCH * propeller:.4g} m"
        found["propeller_m"] = f"expected metres, at most {LARGEST_PROPELLER_M:g}: {inches}"
    return found


def in_words_of_the_form(sentence: str) -> str:
    """A sentence about a vehicle file, with the labels of the forms instead of the keys of the file."""
    for key, words in _IN_WORDS.items():
        sentence = sentence.replace(key, words)
    return sentence


def _is_possible(question: Question, answer: float | None) -> bool:
    if answer is None:
        return question.optional
    return question.low < answer < question.high


def _expected(question: Question) -> str:
    above = f"a number above {question.low:g}"
    range_ = above if math.isinf(question.high) else f"{above} and below {question.high:g}"
    return f"expected {range_}{', or nothing' if question.optional else ''}"
