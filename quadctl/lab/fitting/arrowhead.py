"""Normal equations of many flights, with p parameters that all flights share and k nuisances of each flight.

The normal matrix has the shape of an arrowhead: nuisances of one flight are coupled with the shared parameters and with
each other, not with those of another flight. The nuisances are eliminated flight by flight (Schur complement), so that
time and memory are linear in the number of flights.
"""

from dataclasses import dataclass, field, replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from quadctl.lab.arrays import Floats, Mask

_T = TypeVar("_T", bound=np.generic)

MAX_NEWTON_STEPS = 100
CLOSE = 1e-12
"""Distance below which an unknown is at its bound and a step is zero, in the units of the unknowns."""


@dataclass(frozen=True, eq=False)
class Arrow:
    """Normal equations a x = b, where x holds p shared unknowns and then k of each flight; leading axes are further
    equations.

    `a` is symmetric and positive definite.
    """

    shared: Floats
    """Block of `a` for the shared unknowns, shape (..., p, p)."""
    coupled: Floats
    """Blocks of `a` that couple each flight's unknowns with the shared ones, shape (..., flights, k, p)."""
    own: Floats
    """Block of `a` for each flight's unknowns, shape (..., flights, k, k)."""
    shared_rhs: Floats
    """Part of `b` for the shared unknowns, shape (..., p)."""
    own_rhs: Floats
    """Part of `b` for each flight's unknowns, shape (..., flights, k)."""
    _kept: dict[bytes, tuple[Floats, Floats, Floats, Floats]] = field(default_factory=dict, init=False)

    @classmethod
    def of_gram_matrices(cls, gram: Floats, p: int) -> "Arrow":
        """Build the equations from the Gram matrix of each flight, shape (..., flights, p + k + 1, p + k + 1).

        Its rows and columns: the Jacobian of the shared unknowns, that of the flight's unknowns, and the residual.
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
        """Right-hand side b, shape (..., p + flights * k)."""
        return self._joined(self.shared_rhs, self.own_rhs)

    def with_rhs(self, rhs: Floats) -> "Arrow":
        """Replace b, shape (..., p + flights * k); the matrix stays the same."""
        shared_rhs, own_rhs = self._parted(rhs)
        return replace(self, shared_rhs=shared_rhs, own_rhs=own_rhs)

    def ridged(self) -> "Arrow":
        """Add a tiny ridge, which matters only in directions that the data do not determine."""
        return replace(self, shared=_ridged(self.shared), own=_ridged(self.own))

    def times(self, x: Floats) -> Floats:
        """Product a x, shape (..., p + flights * k)."""
        shared, own = self._parted(x)
        to_shared = np.einsum("...pq,...q->...p", self.shared, shared)
        to_shared = to_shared + np.einsum("...fkp,...fk->...p", self.coupled, own)
        to_own = np.einsum("...fkp,...p->...fk", self.coupled, shared)
        return self._joined(to_shared, to_own + np.einsum("...fkl,...fl->...fk", self.own, own))

    def solve(self, free: Mask) -> Floats:
        """Solve for x with all unknowns outside the mask `free`, shape (p + flights * k,), kept at 0; shape (..., p +
        flights * k)."""
        shared_free, own_free = self._parted(free)
        by_shared, alone, reduced, rhs = self._eliminated(own_free)
        shared = np.asarray(np.linalg.solve(_only(shared_free, reduced), (rhs * shared_free)[..., None])[..., 0])
        return self._joined(shared, alone - np.einsum("...fkp,...p->...fk", by_shared, shared))

    def _eliminated(self, own_free: Mask) -> tuple[Floats, Floats, Floats, Floats]:
        """Unknowns of the flights by the shared ones, and alone; then the equations that are left of the shared ones.
        They are kept: draws are solved with several masks of the shared unknowns."""
        key = own_free.tobytes()
        if key not in self._kept:
            right = np.concatenate([self.coupled, self.own_rhs[..., None]], axis=-1) * own_free[..., None]
            solved = np.linalg.solve(_only(own_free, self.own), right)
            by_shared, alone = solved[..., :-1], solved[..., -1]
            reduced = self.shared - np.einsum("...fkp,...fkq->...pq", self.coupled, by_shared)
            rhs = self.shared_rhs - np.einsum("...fkp,...fk->...p", self.coupled, alone)
            self._kept[key] = by_shared, alone, reduced, rhs
        return self._kept[key]

    def within(self, low: Floats, high: Floats) -> Floats:
        """Minimise x a x / 2 - b x subject to `low` <= x <= `high`, where `low` <= 0 <= `high`; shape (p + flights *
        k,).

        Projected Newton steps (Bertsekas 1982, SIAM J. Control Optim. 20): many unknowns reach or leave their bounds in
        one step, so that few steps are needed, however many flights there are.
        """
        x = np.zeros_like(low)
        gradient = -self.rhs
        for _ in range(MAX_NEWTON_STEPS):
            step = self._step_within(x - low < CLOSE, high - x < CLOSE, gradient)
            room = np.where(step > 0.0, high - x, x - low)
            moving = np.abs(step) > 0.0
            # Up to the first bound a Newton step is a descent step; beyond it the projected step may not be.
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
        """Newton step of all unknowns except those that are held at a bound by the gradient."""
        leaving = (at_low & (gradient < 0.0)) | (at_high & (gradient > 0.0))
        strongest = leaving & (np.arange(len(gradient)) == np.argmax(np.abs(gradient) * leaving))
        downhill = self.with_rhs(-gradient)
        step = np.zeros_like(gradient)
        # Several unknowns that leave their bounds together may push one another out; then only the one with the largest
        # gradient is released.
        for released in (leaving, strongest, np.zeros_like(leaving)):
            step = downhill.solve(released | ~(at_low | at_high))
            if not np.any((at_low & (step < 0.0)) | (at_high & (step > 0.0))):
                break
        return step

    def _parted(self, x: NDArray[_T]) -> tuple[NDArray[_T], NDArray[_T]]:
        """Split a vector into its shared part and the part of each flight."""
        p, flights = self.shared.shape[-1], self.own_rhs.shape[-2]
        return x[..., :p], x[..., p:].reshape(*x.shape[:-1], flights, -1)

    def _joined(self, shared: Floats, own: Floats) -> Floats:
        return np.concatenate([shared, own.reshape(*shared.shape[:-1], -1)], axis=-1)


def _ridged(matrix: Floats) -> Floats:
    ridge = 1e-9 * np.diagonal(matrix, axis1=-2, axis2=-1) + 1e-6
    return np.asarray(matrix + ridge[..., None] * np.eye(matrix.shape[-1]))


def _only(free: Mask, matrix: Floats) -> Floats:
    """Copy of `matrix`, shape (..., k, k), in which every unknown outside the mask `free` has the equation x = 0."""
    both = free[..., :, None] & free[..., None, :]
    return np.where(both, matrix, np.eye(free.shape[-1]))
