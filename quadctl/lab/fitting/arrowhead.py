"""Normal equations of many flights: parameters that all flights share, and a few unknowns that each has for itself.

The matrix is an arrow: what one flight has for itself meets the shared parameters and nothing of another flight. So the
flights' own unknowns are eliminated flight by flight (Schur complement), in time and memory linear in the flights.
"""

from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from quadctl.lab.arrays import Floats, Mask

_T = TypeVar("_T", bound=np.generic)

MAX_NEWTON_STEPS = 100
CLOSE = 1e-12
"""To a bound, or to where a step began, in the units of the unknowns."""


@dataclass(frozen=True, eq=False)
class Arrow:
    """a x = b, where x holds p shared unknowns and then k of each flight; further axes in front are further equations.

    `a` is symmetric and positive definite.
    """

    shared: Floats
    """Of `a`: (..., p, p)."""
    coupled: Floats
    """(..., flights, k, p)."""
    own: Floats
    """(..., flights, k, k)."""
    shared_rhs: Floats
    """Of `b`: (..., p)."""
    own_rhs: Floats
    """(..., flights, k)."""

    @classmethod
    def of_gram_matrices(cls, gram: Floats, p: int) -> "Arrow":
        """From the gram of squares and products that each flight gives, shape (..., flights, p + k + 1, p + k + 1).

        The columns are the slopes to the shared unknowns, to the flight's own, and the residual.
        """
        own = slice(p, -1)
        return cls(
            shared=gram[..., :p, :p].sum(axis=-3),
            coupled=gram[..., own, :p],
            own=gram[..., own, own],
            shared_rhs=gram[..., :p, -1].sum(axis=-2),
            own_rhs=gram[..., own, -1],
        )

    @property
    def rhs(self) -> Floats:
        """b, shape (..., p + flights * k)."""
        return self._joined(self.shared_rhs, self.own_rhs)

    def with_rhs(self, rhs: Floats) -> "Arrow":
        """The same matrix with another b, shape (..., p + flights * k)."""
        shared_rhs, own_rhs = self._parted(rhs)
        return replace(self, shared_rhs=shared_rhs, own_rhs=own_rhs)

    def ridged(self) -> "Arrow":
        """With a tiny ridge, which decides only directions that the data do not see at all."""
        return replace(self, shared=_ridged(self.shared), own=_ridged(self.own))

    def times(self, x: Floats) -> Floats:
        """a x, shape (..., p + flights * k)."""
        shared, own = self._parted(x)
        to_shared = np.einsum("...pq,...q->...p", self.shared, shared)
        to_shared = to_shared + np.einsum("...fkp,...fk->...p", self.coupled, own)
        to_own = np.einsum("...fkp,...p->...fk", self.coupled, shared)
        return self._joined(to_shared, to_own + np.einsum("...fkl,...fl->...fk", self.own, own))

    def solve(self, free: Mask) -> Floats:
        """x, where only the unknowns `free`, shape (p + flights * k,), differ from 0; shape (..., p + flights * k)."""
        shared_free, own_free = self._parted(free)
        own = _only(own_free, self.own)
        right = np.concatenate([self.coupled, self.own_rhs[..., None]], axis=-1) * own_free[..., None]
        solved = np.linalg.solve(own, right)
        by_shared, alone = solved[..., :-1], solved[..., -1]
        reduced = self.shared - np.einsum("...fkp,...fkq->...pq", self.coupled, by_shared)
        rhs = self.shared_rhs - np.einsum("...fkp,...fk->...p", self.coupled, alone)
        shared = np.linalg.solve(_only(shared_free, reduced), (rhs * shared_free)[..., None])[..., 0]
        return self._joined(shared, alone - np.einsum("...fkp,...p->...fk", by_shared, shared))

    def within(self, low: Floats, high: Floats) -> Floats:
        """The least of x a x / 2 - b x with `low` <= x <= `high`, which hold 0 between them; shape (p + flights * k,).

        Projected Newton steps (Bertsekas 1982, SIAM J. Control Optim. 20): many unknowns reach or leave their bounds
        in one step, so that there are few steps, however many flights there are.
        """
        x = np.zeros_like(low)
        gradient = -self.rhs
        for _ in range(MAX_NEWTON_STEPS):
            step = self._step_within(x - low < CLOSE, high - x < CLOSE, gradient)
            room = np.where(step > 0.0, high - x, x - low)
            moving = np.abs(step) > 0.0
            # Up to the first bound on its way a Newton step leads downhill, projected beyond it perhaps.
            sure = float(np.min(room[moving] / np.abs(step[moving]), initial=1.0))
            share = 1.0
            while True:
                moved = np.clip(x + share * step, low, high) - x
                change = self.times(moved)
                if share <= sure or moved @ (gradient + 0.5 * change) < 0.0:
                    break
                share = max(0.5 * share, sure)
            x, gradient = x + moved, gradient + change
            if np.max(np.abs(moved), initial=0.0) < CLOSE:
                break
        return np.clip(x, low, high)

    def _step_within(self, at_low: Mask, at_high: Mask, gradient: Floats) -> Floats:
        """The Newton step of all unknowns but those that are at a bound and pressed against it."""
        leaving = (at_low & (gradient < 0.0)) | (at_high & (gradient > 0.0))
        strongest = leaving & (np.arange(len(gradient)) == np.argmax(np.abs(gradient) * leaving))
        downhill = self.with_rhs(-gradient)
        step = np.zeros_like(gradient)
        # Together those that leave their bounds may push one another out; the strongest alone cannot for ever.
        for released in (leaving, strongest, np.zeros_like(leaving)):
            step = downhill.solve(released | ~(at_low | at_high))
            if not np.any((at_low & (step < 0.0)) | (at_high & (step > 0.0))):
                break
        return step

    def _parted(self, x: NDArray[_T]) -> tuple[NDArray[_T], NDArray[_T]]:
        """The shared and the flights' own part of a vector."""
        p, flights = self.shared.shape[-1], self.own_rhs.shape[-2]
        return x[..., :p], x[..., p:].reshape(*x.shape[:-1], flights, -1)

    def _joined(self, shared: Floats, own: Floats) -> Floats:
        return np.concatenate([shared, own.reshape(*shared.shape[:-1], -1)], axis=-1)


def _ridged(matrix: Floats) -> Floats:
    ridge = 1e-9 * np.diagonal(matrix, axis1=-2, axis2=-1) + 1e-6
    return np.asarray(matrix + ridge[..., None] * np.eye(matrix.shape[-1]))


def _only(free: Mask, matrix: Floats) -> Floats:
    """`matrix`, (..., k, k), for the unknowns that move; those that do not have an equation of their own, x = 0."""
    both = free[..., :, None] & free[..., None, :]
    return np.where(both, matrix, np.eye(free.shape[-1]))
