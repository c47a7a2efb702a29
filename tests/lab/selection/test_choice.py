"""Specification of the choice between effects that explain a flight equally well."""

from dataclasses import replace

import pytest

from quadctl.effects.wind import WindOfEachFlight
from quadctl.lab.flights.dataset import Dataset
from quadctl.lab.selection.candidate import Candidate
from quadctl.lab.selection.diagnosis import Diagnosis
from quadctl.lab.selection.rule import (
    choose,
    is_measured,
    is_supported,
    without_needless_differences,
    without_stand_ins,
)

ACROSS = (0.0, 1.1)
"""Interval of a lateral drag, 1/s, that a vertical flight does not show: it begins at the parameter's lower bound."""


@pytest.fixture(scope="module")
def dataset(nothing: Diagnosis) -> Dataset:
    return nothing.dataset


@pytest.fixture(scope="module")
def tried(nothing: Diagnosis) -> dict[str, Candidate]:
    """Candidates by the name of their effect, as if each took 40 % off the same error."""
    ranking = nothing.ranking
    after = {axis: 0.6 * error for axis, error in ranking[0].before.items()}
    same = {"after": after, "residual": ranking[0].residual, "p_value": 1e-6, "believable": True, "distinct": True}
    return {c.effect.name: replace(c, **same, determined=True, at_bound=False, implied=False) for c in ranking}


@pytest.mark.parametrize(
    ("d_x", "d_y", "n_seen", "chosen"),
    [
        (ACROSS, ACROSS, 1, "rotor_drag.linear"),  # as simple as the other one: the first of them, which is the better
        ((0.8, 1.1), (0.8, 1.1), 3, "inflow.axial"),
    ],
    ids=["vertical flight", "all directions"],
)
def test_a_parameter_that_the_data_do_not_show_makes_no_effect_less_simple(
    dataset: Dataset,
    tried: dict[str, Candidate],
    d_x: tuple[float, float],
    d_y: tuple[float, float],
    n_seen: int,
    chosen: str,
) -> None:
    drag = tried["rotor_drag.linear"]
    drag = replace(drag, effect=type(drag.effect)(1.0, 1.0, 1.0), ci95={"d_x": d_x, "d_y": d_y, "d_z": (0.8, 1.1)})
    inflow = tried["inflow.axial"]
    inflow = replace(inflow, effect=type(inflow.effect)(0.4), ci95={"k": (0.4, 0.5)})
    best, alike = choose([drag, inflow], [], dataset)
    assert (drag.n_seen, inflow.n_seen) == (n_seen, 1)
    assert best.effect.name == chosen
    assert alike == sorted({"rotor_drag", "inflow"} - {best.family})


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


@pytest.mark.parametrize(("worse", "kept"), [(1.005, False), (1.03, True)])
def test_a_wind_of_each_flight_must_be_better_than_a_common_one(
    tried: dict[str, Candidate], worse: float, kept: bool
) -> None:
    """The common one counts even where it is not supported: its speed, a mean of the two, may be that of no wind."""
    common = replace(tried["wind.steady"], believable=False, residual=worse * tried["wind.steady"].residual)
    own = replace(tried["wind.steady"], effect=WindOfEachFlight())
    assert (without_needless_differences([own], [common, own]) == [own]) is kept
    assert without_needless_differences([common], [common, own]) == [common]
