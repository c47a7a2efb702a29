"""Specification of the choice between effects that explain a flight equally well."""

from dataclasses import replace

import pytest

from quadctl.lab.selection.candidate import Candidate
from quadctl.lab.selection.diagnosis import Diagnosis
from quadctl.lab.selection.rule import (
    is_measured,
    is_supported,
    without_stand_ins,
)


@pytest.fixture(scope="module")
def tried(nothing: Diagnosis) -> dict[str, Candidate]:
    """Candidates by the name of their effect, as if each took 40 % off the same error."""
    ranking = nothing.ranking
    after = {axis: 0.6 * error for axis, error in ranking[0].before.items()}
    same = {"after": after, "residual": ranking[0].residual, "p_value": 1e-6, "believable": True, "distinct": True}
    return {c.effect.name: replace(c, **same, determined=True, at_bound=False, implied=False) for c in ranking}


@pytest.mark.parametrize(("share", "stays"), [(0.9, False), (1.1, True)])
def test_nothing_stands_in_for_a_better_explanation_that_is_too_small_to_be_missing(
    tried: dict[str, Candidate], share: float, stays: bool
) -> None:
    """`share` is the error with the small effect over that with the other one."""
    drag, scale = tried["rotor_drag.linear"], tried["thrust_scale.constant"]
    drag = replace(drag, effect=type(drag.effect)(1.0, 1.0, 1.0))
    scale = replace(scale, effect=type(scale.effect)(1.001), residual=share * drag.residual)
    assert is_supported(drag)
    assert is_measured(scale) and not is_supported(scale)
    assert without_stand_ins([drag], [drag, scale]) == ([drag] if stays else [])


@pytest.mark.parametrize(("left", "missing"), [(0.6, False), (0.4, True)])
def test_an_effect_as_small_as_on_any_vehicle_is_missing_where_it_is_most_of_the_error(
    tried: dict[str, Candidate], left: float, missing: bool
) -> None:
    """`left` is the share of the error that is left with an exponent that is within the usual."""
    c = tried["thrust_curve.power"]
    c = replace(c, effect=type(c.effect)(1.9), after={axis: left * error for axis, error in c.before.items()})
    assert c.effect.negligible() and is_measured(c)
    assert is_supported(c) is missing
