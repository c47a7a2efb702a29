"""Thrust curve and throttle line: fits that find known truths, with intervals that hold them."""

import math
from collections.abc import Sequence

import pytest

from quadctl.thrust_stand.curves import fit_throttle_line, fit_thrust_curve
from quadctl.thrust_stand.measurement import Point
from tests.support.thrust_stand import VEHICLE, K, measured


def test_intervals_hold_the_truth_in_95_of_100_measurements() -> None:
    held = {"k": 0, "per_newton": 0, "offset": 0}
    for seed in range(150):
        points = measured(seed=seed)
        curve, line = fit_thrust_curve(points, VEHICLE), fit_throttle_line(points, VEHICLE)
        assert curve is not None
        for name, estimate, truth in (
            ("k", curve.k, K),
            ("per_newton", line.per_newton, VEHICLE.throttle.per_newton),
            ("offset", line.offset, VEHICLE.throttle.offset),
        ):
            low, high = estimate.ci95
            held[name] += low <= truth <= high
    assert all(0.9 < count / 150 <= 1.0 for count in held.values()), held


def test_one_k_is_called_too_little_only_where_it_is() -> None:
    def verdict(points: Sequence[Point]) -> str:
        curve = fit_thrust_curve(points, VEHICLE)
        assert curve is not None
        return "enough" if curve.better is None else curve.better.law

    assert [verdict(measured(seed=seed)) for seed in range(200)].count("enough") >= 196
    assert {verdict(measured(exponent=2.3, seed=seed)) for seed in range(20)} == {"power"}
    assert {verdict(measured(offset_n=0.6, seed=seed)) for seed in range(20)} == {"offset"}
    # Sure, but too small to matter
    assert verdict(measured(exponent=2.01, noise_n=1e-5)) == "enough"


def test_where_thrust_follows_another_power_the_exponent_is_found_and_k_is_right_in_hover() -> None:
    curve = fit_thrust_curve(measured(exponent=2.3, noise_n=0.01), VEHICLE)
    assert curve is not None
    assert curve.better is not None
    low, high = curve.better.parameter.ci95
    assert low < 2.3 < high < 2.4
    hover_n = VEHICLE.weight_n / 4
    hover_rpm = 8000.0 * (hover_n / (K * 8000.0**2)) ** (1 / 2.3)
    assert curve.k_to_fly * hover_rpm**2 == pytest.approx(hover_n, rel=5e-3)


def test_the_throttle_line_is_of_all_rotors_together_and_of_the_thrusts_that_are_flown() -> None:
    # The curve bends below and above: only what is flown counts.
    bent = [Point(0.05, math.nan, 0.0), Point(0.1, math.nan, 0.01), *measured(noise_n=0.0), Point(1.0, math.nan, 8.0)]
    line = fit_throttle_line(bent, VEHICLE)
    assert line.per_newton.value == pytest.approx(VEHICLE.throttle.per_newton)
    assert line.offset.value == pytest.approx(VEHICLE.throttle.offset)
    assert (line.max_thrust_per_rotor_n, line.reached_full) == (8.0, True)
