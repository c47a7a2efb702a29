"""Random-effects model of values that are measured with errors: spread of the members, members drawn to the mean."""

import numpy as np
import pytest

from quadctl.lab.random_effects import Population, variance_between


class TestPopulation:
    def test_equal_members_have_no_spread(self) -> None:
        found = Population.of(np.array([0.5, 0.5, 0.5]), np.array([0.01, 0.01, 0.01]))
        assert found.mean == pytest.approx(0.5)
        assert found.spread == 0.0
        assert found.standard_error == pytest.approx(0.1 / 3**0.5)

    def test_by_hand(self) -> None:
        """Values 0 and 1 with variance 0.1: Q = 5, tau^2 = (5 - 1) / 10 = 0.4, standard error sqrt(0.5 / 2)."""
        found = Population.of(np.array([0.0, 1.0]), np.array([0.1, 0.1]))
        assert (found.mean, found.spread**2, found.standard_error) == pytest.approx((0.5, 0.4, 0.5))
        assert found.shrunk(1.0, 0.1) == pytest.approx((0.9, 0.08**0.5))

    def test_a_new_member_is_less_certain_than_the_mean(self) -> None:
        found = Population.of(np.array([1.0, 2.0]), np.array([0.01, 0.01]))
        low, high = found.next_ci95
        assert high - low > 2 * 1.96 * found.standard_error


class TestVarianceBetween:
    def test_the_variance_is_that_of_dersimonian_and_laird(self) -> None:
        """Two estimates 0.01 and 0.03 with a standard error of 0.001: Q = 200, C = 1e6, (Q - 1) / C = 1.99e-4."""
        found = variance_between(np.array([0.01, 0.03]), np.full(2, 1e-6))
        assert found == pytest.approx(1.99e-4)

    def test_members_that_agree_do_not_differ(self) -> None:
        assert variance_between(np.array([0.02, 0.0201]), np.full(2, 1e-6)) == 0.0
