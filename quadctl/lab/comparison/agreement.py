"""Agreement of flights: does one model predict one set of flights as well as another?

The mean squared errors of the two sets are compared like two independent samples of unequal variance (Welch 1947,
Biometrika 34). Their units are blocks of time; where the reference has several flights that differ by more than their
blocks do, the units are flights, and a further flight is expected to differ as much. The signed residuals are compared,
too (see `shifts`): errors of one size can have opposite signs.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from scipy import special

from quadctl.lab.arrays import Floats
from quadctl.lab.comparison.shifts import Shift, Signed, shifts
from quadctl.lab.comparison.wording import Said, plus
from quadctl.lab.fitting.bootstrap import FEWEST_BLOCKS
from quadctl.lab.fitting.significance import LEAST_FLIGHTS
from quadctl.lab.flights.dataset import Dataset
from quadctl.model import Model
from quadctl.words import Fact, fact

CLOSE = 0.25
"""Largest difference of two errors, as a share of the error of the reference, that counts as none where the whole
interval lies within it (equivalence test: Schuirmann 1987, J. Pharmacokinet. Biopharm. 15)."""
LEAST_SQUARE = 1e-18
"""Least mean square in a denominator, m^2/s^4; only synthetic logs have less."""

TWO_DECIMALS_M_S2 = 0.05
"""Difference of two mean residuals from which on they are told with two decimals instead of three."""

Fitted = Literal["", "these", "others", "all"]
"""Flights that the model was fitted to: none of these, or not known; those of the reference alone; for each flight the
others; all."""


@dataclass(frozen=True, eq=False)
class Errors:
    """Squared errors of a model on one set of flights."""

    flights: tuple[str, ...]
    squares: Floats
    """Squared error of all axes, m^2/s^4, shape (n,)."""
    block: NDArray[np.int64]
    """Number of the block of time of each sample, shape (n,)."""
    flight: NDArray[np.int64]
    """Number of the flight of each sample, shape (n,)."""
    signed: Signed | None = None
    """The residual itself; None where only its size is known."""

    @classmethod
    def of(cls, residual: Floats, dataset: Dataset) -> "Errors":
        """Errors of a residual acceleration, m/s^2, shape (n, 3), on all flights of `dataset`."""
        signed = Signed.of(residual, dataset)
        return cls(tuple(dataset.names), np.sum(residual**2, axis=1), dataset.block, dataset.flight_index, signed)

    def some(self, numbers: Sequence[int]) -> "Errors":
        """Errors on the flights with these numbers."""
        inside = np.isin(self.flight, numbers)
        names = tuple(self.flights[number] for number in numbers)
        signed = None if self.signed is None else self.signed.some(sorted(numbers))
        return Errors(names, self.squares[inside], self.block[inside], self.flight[inside], signed)

    @property
    def rmse(self) -> float:
        return float(np.sqrt(self.squares.mean()))


@dataclass(frozen=True)
class Agreement:
    """Errors of one model on two sets of flights, m/s^2."""

    reference: tuple[str, ...]
    """Names of the flights that the others are compared with."""
    judged: tuple[str, ...]
    reference_m_s2: float
    judged_m_s2: float
    ci95: tuple[float, float] | None
    """95 % interval of the error of the judged flights minus that of the reference; None where one of the two sets has
    too few blocks of time."""
    fitted: Fitted = ""
    differs_most: bool = False
    """True where the judged flight was chosen because it differs most; the interval allows for the choice."""
    shifts: tuple[Shift, ...] = ()
    """Differences of the mean residual, over all samples and in ranges of the variables; empty where not known."""

    @property
    def difference_m_s2(self) -> float:
        return self.judged_m_s2 - self.reference_m_s2

    @property
    def limit_m_s2(self) -> float:
        """Largest difference that counts as none, m/s^2."""
        return CLOSE * self.reference_m_s2

    @property
    def shift(self) -> Shift | None:
        """The clear difference of a mean residual that counts, the largest over all samples; where there is none, the
        largest in a range of the variable that the differences go with the most."""
        clear = [each for each in self.shifts if each.is_clear and abs(each.difference_m_s2) > self.limit_m_s2]
        return max(
            clear, key=lambda each: (not each.variable, self._explained(each), abs(each.difference_m_s2)), default=None
        )

    def _explained(self, shift: Shift) -> float:
        """Mean square of the differences along the axis of `shift` in the ranges of its variable, which hold about
        equally many samples each: the larger, the closer the variable is to the cause."""
        of_variable = [s for s in self.shifts if (s.axis, s.variable) == (shift.axis, shift.variable)]
        return float(np.mean([s.difference_m_s2**2 for s in of_variable]))

    @property
    def widest(self) -> Shift | None:
        """The difference of the mean residual over all samples, along the axis whose interval allows the largest."""
        over_all = [each for each in self.shifts if not each.variable]
        return max(over_all, key=lambda each: each.reach_m_s2, default=None)

    @property
    def verdict(self) -> Literal["as well", "worse", "better", "otherwise", "not known"]:
        """`otherwise`: with errors of another sign, though of the same size as far as is known."""
        if self.ci95 is not None and (self.ci95[0] > 0.0 or self.ci95[1] < 0.0):
            return "worse" if self.ci95[0] > 0.0 else "better"
        if self.shift is not None:
            return "otherwise"
        if self.ci95 is None:
            return "not known"
        return "as well" if max(-self.ci95[0], self.ci95[1]) <= self.limit_m_s2 else "not known"

    @property
    def answer(self) -> Fact:
        """Agreement of the flights, in a few words."""
        if self.verdict in ("otherwise", "worse", "better"):
            return fact(Said.DIFFER)
        if self.verdict == "not known":
            return fact(Said.MAY_AGREE)
        return fact(Said.AS_LARGE if self._may_differ else Said.AGREE)

    @property
    def _may_differ(self) -> bool:
        """Tell whether the mean residuals may differ by more than counts as none."""
        return self.widest is not None and self.widest.reach_m_s2 > self.limit_m_s2

    @property
    def parts(self) -> list[Fact]:
        """Agreement of the flights, and the reasons for it, as parts of a sentence."""
        facts = vars(self) | {"verdict": self.verdict, "limit_m_s2": self.limit_m_s2, "close": CLOSE}
        errors, shift = fact(Said.ERRORS, **facts), [] if self.shift is None else [self._said(self.shift)]
        if self.verdict == "otherwise":
            return [fact(Said.OTHERWISE, **facts), *shift, errors]
        if self.verdict == "not known" or self.ci95 is None:
            why = fact(Said.TOO_SHORT if self.ci95 is None else Said.MAY_BE_MORE, **facts)
            return [fact(Said.NOT_KNOWN, **facts), errors, why]
        if self.verdict == "as well":
            kind = Said.MAY_SHIFT if self._may_differ else Said.NO_SHIFT
            wide = [] if self.widest is None else [fact(kind, reach_m_s2=self.widest.reach_m_s2, axis=self.widest.axis)]
            return [fact(Said.AS_WELL, **facts), errors, fact(Said.IS_LESS, **facts), *wide]
        low, high = sorted(abs(end) for end in self.ci95)
        size = {"size_m_s2": abs(self.difference_m_s2), "least_m_s2": low, "most_m_s2": high}
        return [fact(Said.BETTER_OR_WORSE, **facts, **size), errors, *shift]

    @property
    def said(self) -> Fact:
        """The parts as one sentence."""
        answer, *reasons = self.parts
        return fact(Said.AGREEMENT, answer=answer, reasons=reasons)

    def _said(self, shift: Shift) -> Fact:
        decimals = 2 if abs(shift.difference_m_s2) > TWO_DECIMALS_M_S2 else 3
        there, here = (round(value, decimals) for value in (shift.judged_m_s2, shift.reference_m_s2))
        values = {"judged_m_s2": there, "reference_m_s2": here, "difference_m_s2": there - here}
        said = {name: plus(value, decimals) for name, value in values.items()}
        return fact(Said.SHIFT, **{**shift._asdict(), **said, "judged": self.judged, "reference": self.reference})

    def to_dict(self) -> dict[str, Any]:
        return {
            "reference": list(self.reference),
            "judged": list(self.judged),
            "reference_m_s2": self.reference_m_s2,
            "judged_m_s2": self.judged_m_s2,
            "difference_ci95": None if self.ci95 is None else list(self.ci95),
            "shift": None if self.shift is None else self.shift._asdict(),
            "verdict": self.verdict,
        }


def agreement(reference: Errors, judged: Errors, fitted: Fitted = "", chosen_of: int = 1) -> Agreement:
    """Compare the error on the flights `judged` with that on the flights `reference`.

    `chosen_of` is the number of flights of which the judged one was chosen by its error (Bonferroni).
    """
    found = Agreement(reference.flights, judged.flights, reference.rmse, judged.rmse, None, fitted, chosen_of > 1)
    if min(len(np.unique(errors.block)) for errors in (reference, judged)) < FEWEST_BLOCKS:
        return found
    error, degrees = _standard_error(reference, judged)
    reach = float(special.stdtrit(degrees, 1.0 - 0.025 / chosen_of)) * error
    signed = (
        () if reference.signed is None or judged.signed is None else shifts(reference.signed, judged.signed, chosen_of)
    )
    return replace(found, ci95=(found.difference_m_s2 - reach, found.difference_m_s2 + reach), shifts=tuple(signed))


def least_alike(errors: Errors, fitted: Fitted = "") -> Agreement | None:
    """Compare the flight that differs most from the others with them; None of a single flight.

    Of two flights, the one with the larger error is compared with the other.
    """
    numbers = [int(number) for number in np.unique(errors.flight)]
    if len(numbers) < 2:
        return None
    tried = len(numbers) if len(numbers) > 2 else 1
    found = [
        agreement(errors.some([n for n in numbers if n != number]), errors.some([number]), fitted, tried)
        for number in numbers
    ]
    return max(found, key=lambda a: (a.shift is not None, _clarity(a), a.difference_m_s2))


def flights_of_the_fit(model: Model, flights: Sequence[str]) -> tuple[list[str], list[str]]:
    """Names of the flights that the parameters of `model` were fitted to, and those of `flights` that some were not."""
    fits = [item.fitted.logs for item in model.stack if item.fitted is not None and item.fitted.logs]
    used = list(dict.fromkeys(name for logs in fits for name in logs))
    return used, [name for name in flights if any(name not in logs for logs in fits)]


def of_one_model(model: Model, errors: Errors) -> Agreement | None:
    """Compare the flights that `model` was not fitted to with those that it was fitted to; where there are not both,
    the flight that differs most with the others. None of a single flight."""
    used, new = flights_of_the_fit(model, errors.flights)
    judged = [number for number, name in enumerate(errors.flights) if name in new]
    reference = [number for number, name in enumerate(errors.flights) if name in used and name not in new]
    if not (judged and reference):
        return least_alike(errors, "all" if used and not new else "")
    return agreement(errors.some(reference), errors.some(judged), "these")


def _clarity(found: Agreement) -> float:
    """Size of the difference in half widths of its interval, rounded, so that two flights are equally far from each
    other."""
    if found.ci95 is None:
        return 0.0
    half = 0.5 * (found.ci95[1] - found.ci95[0])
    return round(abs(found.difference_m_s2) / max(half, LEAST_SQUARE), 6)


def _standard_error(reference: Errors, judged: Errors) -> tuple[float, float]:
    """Standard error of the difference of the errors (RMSE), m/s^2, and its degrees of freedom."""
    of_reference, of_judged = (_variance(errors.squares, errors.block) for errors in (reference, judged))
    flights = len(reference.flights)
    if flights >= LEAST_FLIGHTS:
        between, degrees = _variance(reference.squares, reference.flight)
        if between > of_reference[0]:
            of_reference = between, degrees
            of_judged = max(of_judged, (between * flights / len(judged.flights), degrees))
    parts = [
        (variance / (4.0 * max(float(errors.squares.mean()), LEAST_SQUARE)), degrees)
        for errors, (variance, degrees) in ((reference, of_reference), (judged, of_judged))
    ]
    total = sum(variance for variance, _ in parts)
    if total == 0.0:
        return 0.0, 1.0
    return math.sqrt(total), total**2 / sum(variance**2 / degrees for variance, degrees in parts)


def _variance(squares: Floats, unit: NDArray[np.int64]) -> tuple[float, float]:
    """Variance of the mean of `squares`, shape (n,), whose units are independent (of any size), and its degrees of
    freedom."""
    number = np.unique(unit, return_inverse=True)[1]
    sums = np.bincount(number, squares - squares.mean())
    units = len(sums)
    return units / (units - 1) * float(sums @ sums) / len(squares) ** 2, float(units - 1)
