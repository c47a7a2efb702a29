"""Ridge regression of a change of state, on flights that it did not see."""

import numpy as np
import pytest

from quadctl.lab.arrays import Floats
from quadctl.lab.rotation.regression import CHANGED, COMMANDED, Features, fit_ridge, with_motions
from quadctl.lab.rotation.rollout import Track
from tests.lab.rotation.closed_loop import VEHICLE

MOTIONS = COMMANDED * 10


def flights(count: int, *, coupled: bool) -> tuple[list[Features], list[Floats]]:
    """Changes that follow from columns of their own motion, or from those of all, and noise."""
    random = np.random.default_rng(3)
    truth = np.random.default_rng(7).normal(0.5, 1.0, (len(MOTIONS), len(CHANGED)))
    if not coupled:
        truth *= np.array(MOTIONS)[:, None] == np.array(CHANGED)
    x = [random.normal(size=(60, len(MOTIONS))) for _ in range(count)]
    return [Features(f, MOTIONS) for f in x], [f @ truth + 4.0 * random.normal(size=(60, len(CHANGED))) for f in x]


class TestFitRidge:
    @pytest.mark.parametrize("coupled", [False, True])
    def test_motions_apart_are_found_apart_and_coupled_ones_together(self, coupled: bool) -> None:
        x, y = flights(24, coupled=coupled)
        seen, unseen = slice(0, 4), slice(4, None)
        ridge = fit_ridge(x[seen], y[seen])
        other = np.array(MOTIONS)[:, None] != np.array(CHANGED)
        across = float(np.abs(ridge.weights[other]).mean() / np.abs(ridge.weights[~other]).mean())
        left = np.concatenate([b - ridge.predict(a.values) for a, b in zip(x[unseen], y[unseen], strict=True)])
        # The noise alone is 4.0; 40 weights from 240 rows add a tenth to it, 10 weights a fortieth.
        if coupled:
            assert across > 0.7
            assert np.std(left) < 4.8
        else:
            assert across < 0.1
            assert np.std(left) < 4.2

    def test_noise_is_not_found(self) -> None:
        random = np.random.default_rng(4)
        x = [Features(random.normal(size=(300, 4)), COMMANDED) for _ in range(5)]
        y = [random.normal(size=(300, len(CHANGED))) for _ in range(5)]
        assert np.abs(fit_ridge(x, y).weights).max() < 0.15

    def test_its_offset_is_that_of_the_changes(self) -> None:
        x, y = flights(6, coupled=False)
        moved = [b + 7.0 for b in y]
        one, two = fit_ridge(x, y), fit_ridge(x, moved)
        np.testing.assert_allclose(two.predict(x[0].values) - one.predict(x[0].values), 7.0, rtol=1e-6)


class TestWithMotions:
    def test_commands_are_those_of_all_rotors_and_of_their_differences(self) -> None:
        # Rotors of `VEHICLE`: front right, back right, back left, front left; the left ones lift more: a roll right.
        command = np.array([[0.5, 0.5, 0.7, 0.7], [0.6, 0.4, 0.4, 0.6], [0.7, 0.5, 0.7, 0.5]])
        still = np.zeros((3, 3))
        track = Track("", 0.01, still, still, np.zeros((3, 4)), still, command)
        by_motion = with_motions(track, VEHICLE).command
        np.testing.assert_allclose(by_motion, [[0.6, 0.1, 0, 0], [0.5, 0, 0.1, 0], [0.6, 0, 0, 0.1]], atol=1e-12)
