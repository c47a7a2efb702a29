"""Agreement of single flights with each other on the parameters of what was found: several flights are one question.

The model found is fitted to each flight alone. The true values of flights of one vehicle are alike where the weighted
sum of the squares of their differences is one of chi squared (Cochran 1954, Biometrics 10, 101-129).
"""

from collections.abc import Sequence

import numpy as np
from scipy import special

from quadctl.effects.onset import Sudden
from quadctl.lab.finding import Finding, Kind
from quadctl.lab.fitting.fitted_model import FittedModel, fit_model
from quadctl.lab.fitting.parameters import undetermined
from quadctl.lab.random_effects import Z95
from quadctl.lab.selection.rule import RULE, is_significant

Single = tuple[str, float, tuple[float, float]]
"""Name of a flight, with value and 95 % interval by it alone."""


def of_single_flights(found: FittedModel, missing: Sequence[str]) -> list[Finding]:
    """Findings on the parameters of the `missing` families in which single flights differ by more than their intervals;
    none of one flight."""
    if len(found.dataset.flights) < 2 or not missing:
        return []
    values: dict[tuple[str, str], list[Single]] = {}
    for number, flight in enumerate(found.dataset.flights):
        fit = fit_model(found.model, found.dataset.samples(found.dataset.flight_index == number))
        blind = undetermined(fit.free, fit.intervals)
        for free, ci95 in zip(fit.free, fit.intervals, strict=True):
            effect = fit.model.effects[free.effect]
            common = not (isinstance(effect, Sudden) or effect.only_of_several_flights)
            value = getattr(effect, free.parameter.name)
            if effect.family() in missing and common and free not in blind and ci95[0] < value < ci95[1]:
                values.setdefault((effect.name, free.parameter.name), []).append((flight.name, value, ci95))
    found_different = []
    for (name, parameter), singles in values.items():
        p_value = min(1.0, _p_of_difference(singles) * len(values))
        if is_significant(p_value, RULE):
            by_flight = {flight: {"value": value, "ci95": list(ci95)} for flight, value, ci95 in singles}
            facts = {"effect": name, "parameter": parameter, "flights": by_flight, "p": p_value}
            found_different.append(Finding(Kind.FLIGHTS_DIFFER, facts))
    return found_different


def _p_of_difference(singles: Sequence[Single]) -> float:
    """p-value of equal true values; 1 for a single one."""
    values = np.array([value for _, value, _ in singles])
    weights = np.array([(2.0 * Z95 / (high - low)) ** 2 for _, _, (low, high) in singles])
    mean = float(weights @ values / weights.sum())
    return float(special.chdtrc(len(singles) - 1, weights @ (values - mean) ** 2)) if len(singles) > 1 else 1.0
