"""Specification of how a diagnosis says what it found."""

from dataclasses import replace
from typing import Any

import pytest

from quadctl.effects.payload import MassStep
from quadctl.effects.rotor_fault import WeakRotor
from quadctl.effects.rotor_interaction import FrontWake
from quadctl.lab.comparison.wording import parameters_in_words, share_of_g
from quadctl.lab.finding import Finding, Kind, parameters_of
from quadctl.lab.selection.candidate import Candidate
from quadctl.lab.selection.diagnosis import Diagnosis
from quadctl.lab.selection.wording import error_in_table, reason_against


def test_parameters_that_the_data_choose_stand_beside_those_that_are_fitted() -> None:
    weak = parameters_of(WeakRotor(0.05, 3.0), {"loss": (0.04, 0.06)})["parameters"]
    assert parameters_in_words(weak) == "loss = 0.050 [0.040, 0.060], rotor = 3 (chosen)"
    step = parameters_of(MassStep(-0.09, time_s=41.0, flight=2.0), {"mass_kg": (-0.1, -0.08)})["parameters"]
    assert (
        parameters_in_words(step) == "mass_kg = -0.090 kg [-0.100, -0.080], time_s = 41 s (chosen), flight = 2 (chosen)"
    )


@pytest.mark.parametrize(
    ("error", "words"), [(1.8240, "1.824"), (0.148, "0.148"), (0.0242, "0.024"), (0.0024, "0.0024")]
)
def test_small_errors_keep_two_digits(error: float, words: str) -> None:
    assert error_in_table(error) == words


@pytest.mark.parametrize(("error", "words"), [(1.3, "13%"), (0.402, "4.1%"), (0.005, "0.05%")])
def test_an_acceleration_is_said_as_a_share_of_gravity(error: float, words: str) -> None:
    assert share_of_g(error) == words


def test_a_sentence_about_nothing_missing_names_no_effect(nothing: Diagnosis) -> None:
    assert nothing.answer[0] == Finding(Kind.NONE)
    assert not {Kind.SMALL, Kind.USUAL} & {note.kind for note in nothing.notes}


def test_what_is_as_small_as_a_bias_is_said_to_be_there(nothing: Diagnosis) -> None:
    weak = next(c for c in nothing.ranking if c.family == "rotor_fault")
    there = replace(weak, effect=WeakRotor(0.01, 2.0), p_value=1e-6, after={k: 0.9 * v for k, v in weak.before.items()})
    ranking = [there, *(c for c in nothing.ranking if c is not weak)]
    (note,) = (n for n in replace(nothing, ranking=ranking).notes if n.kind is Kind.USUAL)
    assert note.facts["effect"] == "rotor_fault.weak"
    assert {name: p["value"] for name, p in note.facts["parameters"].items()} == {"loss": 0.01, "rotor": 2.0}


class TestReasonAgainst:
    """The first predicate of the decision rule that fails."""

    @pytest.fixture
    def supported(self, nothing: Diagnosis) -> Candidate:
        """A drag that halves the error of every axis."""
        tried = next(c for c in nothing.ranking if c.family == "rotor_drag")
        effect = type(tried.effect).from_values({p.name: 0.3 for p in tried.effect.parameters()}, "test")
        after = {axis: 0.5 * error for axis, error in tried.before.items()}
        good = {
            "fitted": True,
            "believable": True,
            "distinct": True,
            "implied": False,
            "at_bound": False,
            "determined": True,
        }
        return replace(tried, effect=effect, after=after, p_value=1e-6, worst_flight=0.0, **good)

    @pytest.mark.parametrize(
        ("change", "kind"),
        [
            ({"fitted": False}, Kind.NOT_FITTED),
            ({"p_value": 0.3}, Kind.NOT_SIGNIFICANT),
            ({"determined": False}, Kind.UNDETERMINED),
            ({"at_bound": True}, Kind.AT_BOUND),
            ({"believable": False}, Kind.IMPLAUSIBLE),
            ({"implied": True}, Kind.IMPLIED),
            ({"distinct": False}, Kind.NOT_DISTINCT),
            ({}, Kind.OTHER_FORM),
        ],
    )
    def test_each_predicate_has_its_reason(self, supported: Candidate, change: dict[str, Any], kind: Kind) -> None:
        assert reason_against(replace(supported, **change), supported).kind is kind

    def test_an_effect_that_may_be_none_is_told_by_the_parameter(self, supported: Candidate) -> None:
        wake = replace(supported, effect=FrontWake(), determined=False)
        assert reason_against(wake, supported) == Finding(Kind.ZERO, {"parameters": ["loss"]})

    def test_an_effect_that_does_not_help_needs_no_other_reason(self, supported: Candidate) -> None:
        useless = replace(supported, after=supported.before, p_value=0.9)
        assert reason_against(useless, supported).kind is Kind.NO_DROP

    def test_a_small_effect_is_said_to_be_there_with_what_was_expected(self, supported: Candidate) -> None:
        small = replace(supported, after={axis: 0.999 * error for axis, error in supported.before.items()})
        found = reason_against(small, supported)
        assert found.kind is Kind.TOO_SMALL
        assert found.facts["share"] == pytest.approx(0.001)

    def test_another_family_is_not_needed_beside_what_was_chosen(self, supported: Candidate) -> None:
        other = replace(supported, effect=WeakRotor(0.5, 3.0))
        assert reason_against(supported, other).facts["chosen"] == "rotor_fault.weak"
