"""Failures in words: every number of the fact is in its sentence."""

from dataclasses import replace

import pytest

from quadctl.lab.comparison.failures import Failure, Stretch

LOW = Failure("up", "height_over_radius", 0.8, 2.0, 1.1767, 14.0, 100, "range", 138.0, at_edge=(True, False))
IN_LOW = Stretch("low-1.csv", 4.2, 21.0, 0.9, whole=False)
IN_HIGH = Stretch("high.csv", 0.0, 60.0, 0.1, whole=True)


def test_a_range_tells_where_and_by_how_much_of_the_weight() -> None:
    said = (
        "At a rotor height below 2 rotor radii the vehicle gets more thrust than the model says, by 12.0% of its weight"
    )
    assert str(LOW.said) == said
    beside = replace(LOW, average=0.49, stretches=(IN_LOW,))
    assert str(beside.said) == f"{said} (on average over all samples: 5.0%), mostly in low-1.csv (4 to 21 s)"


@pytest.mark.parametrize(
    ("at_edge", "where"),
    [((True, False), "below \u22122"), ((False, True), "above \u22128"), ((True, True), "from \u22128 to \u22122")],
)
def test_limits_are_named_where_they_are_none_of_the_data(at_edge: tuple[bool, bool], where: str) -> None:
    pushed = replace(LOW, axis="east", low=-8.0, high=-2.0, mean_residual=-0.3, at_edge=at_edge)
    said = f"At a rotor height {where} rotor radii the vehicle is pushed west by 0.30 m/s² more than the model says"
    assert str(pushed.said) == said


def test_of_several_flights_those_with_most_of_it_are_named() -> None:
    said = str(replace(LOW, stretches=(IN_HIGH, IN_LOW)).said)
    assert said.endswith(", throughout high.csv and mostly in low-1.csv (4 to 21 s)")
    said = str(replace(LOW, stretches=(IN_LOW, IN_HIGH, IN_HIGH)).said)
    assert said.endswith(", in 3 flights, mostly in low-1.csv (4 to 21 s)")
    offset = replace(LOW, kind="offset", flights=2, mean_residual=-0.196, stretches=(IN_HIGH,))
    said = "On average over all flights the vehicle gets less thrust than the model says, by 2.0% of its weight"
    assert str(offset.said) == f"{said}, most of it in high.csv"


def test_a_dependence_tells_both_ends_and_its_share() -> None:
    depends = replace(LOW, kind="dependence", variable="climb_rate", extremes=((-1.5, -0.4), (1.0, 0.6)), share=0.75)
    ends = "mean \u22120.40 m/s² at \u22121.5 m/s and +0.60 m/s² at 1 m/s"
    said = f"The up residual depends on the climb rate ({ends}): 75% of the squared error of this axis"
    assert str(depends.said) == said
