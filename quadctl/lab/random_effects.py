"""Random-effects model: values that are measured with errors scatter about a common mean (DerSimonian & Laird 1986,
Controlled Clinical Trials 7)."""

import math
from typing import NamedTuple

from quadctl.lab.arrays import Floats

Z95 = 1.96


def variance_between(values: Floats, variances: Floats) -> float:
    """Variance between the true values, by the method of moments (eq. 8); `variances` are those of the errors."""
    weights = 1.0 / variances
    mean = float(weights @ values / weights.sum())
    excess = float(weights @ (values - mean) ** 2) - (len(values) - 1)
    return max(excess / max(float(weights.sum() - (weights @ weights) / weights.sum()), 1e-12), 0.0)


class Population(NamedTuple):
    """Distribution of a value over a population, from the members that were measured."""

    mean: float
    standard_error: float
    """Standard error of the mean."""
    spread: float
    """Standard deviation between members, errors of measurement excluded."""

    @classmethod
    def of(cls, values: Floats, variances: Floats) -> "Population":
        """Estimate from the value of each member and the variance of its error, shape (members,) each."""
        between = variance_between(values, variances)
        weights = 1.0 / (variances + between)
        return cls(float(weights @ values / weights.sum()), float(weights.sum() ** -0.5), math.sqrt(between))

    @property
    def next_ci95(self) -> tuple[float, float]:
        """95 % interval of a member that was not measured."""
        reach = Z95 * math.hypot(self.standard_error, self.spread)
        return self.mean - reach, self.mean + reach

    def shrunk(self, value: float, variance: float) -> tuple[float, float]:
        """Value of a measured member drawn toward the mean by the error of its measurement, and its deviation."""
        between = self.spread**2
        share = between / (between + variance)
        return self.mean + share * (value - self.mean), math.sqrt(share * variance)
