"""Remaining error of a model: how far it is above the reference error, and which logged variables explain that part."""

from collections.abc import Sequence
from dataclasses import dataclass

from quadctl.lab.arrays import Floats
from quadctl.lab.comparison.agreement import CLOSE
from quadctl.lab.comparison.wording import Said
from quadctl.lab.fitting.flexible_regression import flexible_residual, noise_floor
from quadctl.lab.flights.dataset import Dataset
from quadctl.lab.flights.prediction import AXES, rmse
from quadctl.words import Fact, fact


@dataclass(frozen=True)
class Remainder:
    """Errors (RMSE) of all axes, m/s^2."""

    error_m_s2: float
    by_causes_m_s2: float
    """Error that a regression on the variables that can be a cause leaves (see `Dataset.causes`)."""
    floor_m_s2: float
    """Reference error: what a regression on all logged variables leaves."""
    others: tuple[str, ...]
    """Logged variables that only the second regression sees: they pass by themselves or follow disturbances."""
    axis: str
    """Axis on which the second regression explains the most."""

    @property
    def is_near_the_floor(self) -> bool:
        """Tell whether the error is the reference error, as nearly as two errors are called the same."""
        return self.error_m_s2 <= (1.0 + CLOSE) * self.floor_m_s2

    @property
    def above_the_floor(self) -> float:
        """Error above the reference error, as a share of that; negative below it."""
        return self.error_m_s2 / self.floor_m_s2 - 1.0

    @property
    def explained(self) -> float:
        """Share of the squared error that a regression on all logged variables explains."""
        return self._share(self.floor_m_s2)

    @property
    def explained_by_causes(self) -> float:
        """Share of the squared error that a regression on the variables that can be a cause explains."""
        return self._share(self.by_causes_m_s2)

    def said(self, flights: Sequence[str] = ()) -> Fact:
        """Distance of the error from the reference error, and what explains it; `flights` are those held
        out of all fits."""
        near = Said.NEAR_FLOOR if self.is_near_the_floor else Said.REMAINS
        shares = {"above": self.above_the_floor, "explained": self.explained, "by_causes": self.explained_by_causes}
        others = () if self.explained_by_causes > 0.5 * self.explained else self.others
        facts = vars(self) | shares | {"flights": flights, "others": others}
        return fact(Said.IS_FLOOR if self.above_the_floor <= 0.0 else near, **facts)

    def _share(self, left_m_s2: float) -> float:
        return max(0.0, 1.0 - (left_m_s2 / self.error_m_s2) ** 2)


def remainder(residual: Floats, dataset: Dataset, floor: dict[str, float]) -> Remainder:
    """Remainder of a held-out residual acceleration, m/s^2, shape (n, 3).

    `floor` is the reference error per axis and total, m/s^2.
    """
    error, causes = rmse(residual), dataset.causes
    by_causes = rmse(noise_floor(residual, flexible_residual(residual, dataset, causes))) if causes else error
    axis = max(AXES, key=lambda axis: error[axis] ** 2 - floor[axis] ** 2)
    return Remainder(error["total"], by_causes["total"], floor["total"], tuple(dataset.followers), axis)
