"""Normal equations of many flights, compared with the same equations as one dense matrix."""

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from quadctl.lab.fitting.arrowhead import Arrow

KINDS = 7


def columns(seed: int, p: int, flights: int) -> np.ndarray:
    """Jacobian and residual of each flight, shape (flights, 40, p + kinds + 1), badly scaled and nearly collinear."""
    random = np.random.default_rng(seed)
    found = random.standard_normal((flights, 40, p + KINDS + 1)) * 10.0 ** random.uniform(-1.5, 1.5, p + KINDS + 1)
    found[..., 0] = found[..., p] + 0.03 * found[..., 0]  # a parameter that a nuisance nearly stands for
    return found


def dense(each: np.ndarray, p: int) -> tuple[np.ndarray, np.ndarray]:
    """Dense Jacobian of all flights, shape (flights * 40, p + flights * kinds), and the residuals."""
    flights, n, _ = each.shape
    jacobian = np.zeros((flights, n, p + flights * KINDS))
    for i, flight in enumerate(each):
        jacobian[i, :, :p] = flight[:, :p]
        jacobian[i, :, p + i * KINDS : p + (i + 1) * KINDS] = flight[:, p:-1]
    return jacobian.reshape(flights * n, -1), each[..., -1].ravel()


def arrow(each: np.ndarray, p: int) -> Arrow:
    return Arrow.of_gram_matrices(np.einsum("fni,fnj->fij", each, each), p)


SIZES = pytest.mark.parametrize(("p", "flights"), [(1, 1), (2, 3), (4, 8)])


@SIZES
def test_flights_are_eliminated_as_a_dense_solution_would(p: int, flights: int) -> None:
    each = columns(0, p, flights)
    jacobian, residual = dense(each, p)
    expected = np.linalg.lstsq(jacobian, residual, rcond=None)[0]
    everything = np.ones(len(expected), dtype=bool)
    assert arrow(each, p).solve(everything) == pytest.approx(expected, rel=1e-7, abs=1e-9)


@SIZES
def test_what_does_not_move_stays_and_the_others_know(p: int, flights: int) -> None:
    each = columns(1, p, flights)
    jacobian, residual = dense(each, p)
    free = np.random.default_rng(2).random(jacobian.shape[1]) < 0.6
    expected = np.zeros(jacobian.shape[1])
    expected[free] = np.linalg.lstsq(jacobian[:, free], residual, rcond=None)[0]
    assert arrow(each, p).solve(free) == pytest.approx(expected, rel=1e-7, abs=1e-9)


@SIZES
def test_many_equations_are_solved_at_once(p: int, flights: int) -> None:
    draws = [columns(seed, p, flights) for seed in range(3)]
    together = Arrow.of_gram_matrices(np.array([np.einsum("fni,fnj->fij", each, each) for each in draws]), p)
    free = np.ones(p + flights * KINDS, dtype=bool)
    assert together.solve(free) == pytest.approx(np.array([arrow(each, p).solve(free) for each in draws]))


@SIZES
@pytest.mark.parametrize("tightness", [0.01, 0.3, 3.0])
def test_the_least_within_bounds_is_that_of_dense_bounded_least_squares(p: int, flights: int, tightness: float) -> None:
    for seed in range(10):
        each = columns(seed, p, flights)
        jacobian, residual = dense(each, p)
        random = np.random.default_rng(seed)
        size = tightness * np.median(np.abs(np.linalg.lstsq(jacobian, residual, rcond=None)[0]))
        low, high = -size * random.random(jacobian.shape[1]), size * random.random(jacobian.shape[1])
        expected = lsq_linear(jacobian, residual, (low, high), method="bvls", tol=1e-14, max_iter=1000).x
        found = arrow(each, p).within(low, high)
        assert np.all((low <= found) & (found <= high))
        assert found == pytest.approx(expected, abs=1e-5 * size)
