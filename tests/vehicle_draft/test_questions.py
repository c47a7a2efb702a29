"""Sentences of a form about the answers on a vehicle: all that is wrong at once, in the words of its labels."""

import math

from quadctl.vehicle_draft.questions import ITS_NUMBERS, NEW_VEHICLE, in_words_of_the_form, wrong

RIGHT = {"mass_kg": 1.5, "propeller_m": 0.25, "diagonal_m": 0.4, "hover_throttle": 0.4, "hover_rpm": None}


def test_all_that_is_wrong_is_said_at_once() -> None:
    assert wrong(NEW_VEHICLE, RIGHT) == {}
    answers = RIGHT | {"mass_kg": None, "propeller_m": 12.0, "hover_throttle": 1.0, "hover_rpm": -3.0}
    assert wrong(NEW_VEHICLE, answers) == {
        "mass_kg": "expected a number above 0 and below 1000",
        "propeller_m": "expected metres, at most 2: 12 inches are 0.3048 m",
        "hover_throttle": "expected a number above 0 and below 1",
        "hover_rpm": "expected a number above 0, or nothing",
    }
    assert wrong(NEW_VEHICLE, RIGHT | {"diagonal_m": None}) == {}


def test_what_is_not_asked_is_not_wrong() -> None:
    assert wrong(NEW_VEHICLE, {name: value for name, value in RIGHT.items() if name != "diagonal_m"}) == {}


def test_a_number_is_none_of_the_forms_where_it_is_no_number() -> None:
    assert "mass_kg" in wrong(ITS_NUMBERS, {"mass_kg": math.nan})


def test_a_sentence_about_the_file_is_said_in_the_words_of_the_form() -> None:
    assert in_words_of_the_form("throttle.max_thrust_per_rotor_n is 1, expected more") == (
        "Most thrust of a rotor / N is 1, expected more"
    )


def test_a_propeller_in_inches_is_told_in_metres() -> None:
    assert wrong(NEW_VEHICLE, RIGHT | {"propeller_m": 7.0}) == {
        "propeller_m": "expected metres, at most 2: 7 inches are 0.1778 m"
    }
