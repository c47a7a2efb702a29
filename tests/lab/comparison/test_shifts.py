"""Shifts: errors of one size and of opposite signs are no agreement."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from quadctl.effects.ground_effect import Exponential
from quadctl.lab.arrays import Floats
from quadctl.lab.comparison.agreement import Agreement, Errors, agreement, least_alike
from quadctl.lab.comparison.comparison import compare
from quadctl.lab.comparison.shifts import LEVEL, Shift, Signed, shifts
from quadctl.lab.comparison.wording import Said
from quadctl.lab.flights.dataset import load_dataset
from quadctl.model import Model
from quadctl.vehicle import Vehicle
from tests.support.flights import obedient

LENGTH = 600


def drifting(seed: int, memory: float) -> Floats:
    """Noise of unit size; `memory` is its correlation from one sample to the next."""
    white = np.random.default_rng(seed).standard_normal((LENGTH, 3))
    return lfilter([math.sqrt(1.0 - memory**2)], [1.0, -memory], white, axis=0)


def signed(mean_m_s2: float, seed: int, slope: float = 0.0, memory: float = 0.8, turns: float = 6.0) -> Signed:
    """A flight of waves over height, with noise of 0.05 m/s^2, and this residual up at the mean height."""
    height = 3.0 + 2.0 * np.sin(np.linspace(0.0, 2.0 * np.pi * turns, LENGTH))
    residual = 0.05 * drifting(seed, memory)
    residual[:, 2] += mean_m_s2 + slope * (height - 3.0)
    return Signed(residual, [slice(0, LENGTH)], {"height_over_radius": height})


def errors(name: str, of: Signed) -> Errors:
    n = len(of.residual)
    return Errors((name,), np.sum(of.residual**2, axis=1), np.arange(n) // 20, np.zeros(n, dtype=np.int64), of)


class TestShifts:
    @pytest.mark.parametrize(("memory", "turns"), [(0.0, 6.0), (0.8, 6.0), (0.98, 6.0), (0.98, 0.5)])
    def test_noise_that_drifts_is_no_shift(self, memory: float, turns: float) -> None:
        """The level is 5 %, which 400 pairs show to 1.1 %; three times that is allowed."""
        pairs = [[signed(0.0, 2 * seed + i, memory=memory, turns=turns) for i in (0, 1)] for seed in range(400)]
        clear = [any(each.is_clear for each in shifts(*pair)) for pair in pairs]
        assert np.mean(clear) <= LEVEL + 3.0 * math.sqrt(LEVEL * (1.0 - LEVEL) / len(pairs))

    def test_opposite_signs_of_one_size_do_not_agree(self) -> None:
        found = agreement(errors("a.csv", signed(0.3, 0)), errors("b.csv", signed(-0.3, 1)))
        assert found.verdict == "otherwise"
        assert found.answer.kind is Said.DIFFER
        said = str(found.said)
        assert "The model predicts b.csv otherwise than a.csv: the mean residual up is \u22120." in said
        assert "m/s² on b.csv and +0." in said and "a difference of \u22120." in said
        assert found.shift is not None and found.shift.axis == "up" and not found.shift.variable

    def test_nor_do_opposite_slopes_over_height(self) -> None:
        found = agreement(errors("a.csv", signed(0.0, 0, 0.15)), errors("b.csv", signed(0.0, 1, -0.15)))
        assert found.verdict == "otherwise"
        assert found.shift is not None and found.shift.variable == "height_over_radius"
        assert "the mean residual up at a rotor height from" in str(found.said)

    def test_the_variable_that_explains_the_most_is_named_not_that_with_the_highest_peak(self) -> None:
        differences = {"height_over_radius": (0.0, 0.0, 0.0, 0.0, 0.6), "speed_forward": (-0.5, -0.3, 0.0, 0.3, 0.5)}
        ranges = tuple(
            Shift("up", name, i, i + 1.0, 0.0, size, (size - 0.1, size + 0.1))
            for name, sizes in differences.items()
            for i, size in enumerate(sizes)
        )
        found = Agreement(("a.csv",), ("b.csv",), 0.3, 0.3, (-0.1, 0.1), shifts=ranges)
        assert found.shift is not None
        assert (found.shift.variable, abs(found.shift.difference_m_s2)) == ("speed_forward", 0.5)

    def test_the_same_residual_agrees_within_a_bound_that_is_said(self) -> None:
        found = agreement(errors("a.csv", signed(0.3, 0)), errors("b.csv", signed(0.3, 1)))
        assert found.verdict == "as well"
        assert found.answer.kind is Said.AGREE
        assert found.parts[-1].kind is Said.NO_SHIFT

    def test_where_the_means_are_uncertain_agreement_is_not_said_of_them(self) -> None:
        found = agreement(errors("a.csv", signed(0.0, 0, memory=0.98)), errors("b.csv", signed(0.0, 1, memory=0.98)))
        assert found.widest is not None and found.widest.reach_m_s2 > found.limit_m_s2
        assert "otherwise" not in found.verdict
        as_well = replace(found, ci95=(-0.001, 0.001))
        assert as_well.answer.kind is Said.AS_LARGE and as_well.parts[-1].kind is Said.MAY_SHIFT

    def test_the_spread_of_several_flights_counts_for_the_next_one(self) -> None:
        means = (-0.3, -0.1, 0.1, 0.3)
        flights = [signed(mean, i) for i, mean in enumerate(means)]
        several = Signed(
            np.concatenate([flight.residual for flight in flights]),
            [slice(i * LENGTH, (i + 1) * LENGTH) for i in range(len(means))],
            {"height_over_radius": np.concatenate([flight.variables["height_over_radius"] for flight in flights])},
        )
        new = signed(0.35, 9)
        up = next(each for each in shifts(several, new) if each.axis == "up")
        assert not up.is_clear
        assert next(each for each in shifts(several.some([1]), new) if each.axis == "up").is_clear

    def test_the_flight_with_another_sign_is_the_one_that_differs_most(self) -> None:
        parts = [signed(0.3, 0), signed(0.3, 1), signed(-0.3, 2)]
        all_ = Errors(
            ("a", "b", "c"),
            np.concatenate([np.sum(part.residual**2, axis=1) for part in parts]),
            np.arange(3 * LENGTH) // 20,
            np.repeat(np.arange(3), LENGTH),
            Signed(
                np.concatenate([part.residual for part in parts]),
                [slice(i * LENGTH, (i + 1) * LENGTH) for i in range(3)],
                {},
            ),
        )
        found = least_alike(all_)
        assert found is not None and found.judged == ("c",) and found.shift is not None
        assert found.shift.difference_m_s2 == pytest.approx(-0.6, abs=0.05)


class TestOfFlights:
    def test_the_residual_is_turned_to_the_heading(self, raptor: Vehicle) -> None:
        dataset = load_dataset([obedient(Model(raptor), 30.0, noise_m_s=0.01)], raptor)
        north = np.tile([1.0, 0.0, 0.0], (len(dataset.measured), 1))
        turned = Signed.of(north, dataset)
        assert np.hypot(turned.residual[:, 0], turned.residual[:, 1]) == pytest.approx(1.0)
        assert "height_over_radius" in turned.variables

    def test_a_comparison_says_it(self, raptor: Vehicle) -> None:
        up, down = (
            obedient(Model(raptor).plus(Exponential(a=a, b=5.0)), 60.0, noise_m_s=0.005, seed=i, name=f"{i}.csv")
            for i, a in enumerate((0.2, 0.4))
        )
        found = compare(Model(raptor).plus(Exponential(a=0.3, b=5.0)), load_dataset([up, down], raptor))
        assert found.agreement is not None and found.agreement.shift is not None
        assert found.to_dict()["agreement"]["shift"]["axis"] == "up"
        assert "the mean residual up" in str(found)
