"""Summary of a fleet: quality of its logs, spread of the population, and the vehicles that changed."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from enum import unique
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from quadctl.fleet.changes import FALSE_DISCOVERIES, LEAST_FLIGHTS, Change, Series, by_quantity, find_changes
from quadctl.fleet.changes import number_of_tests as count_tests
from quadctl.fleet.measurement import FlightRecord
from quadctl.lab.random_effects import Population
from quadctl.lab.results import Result
from quadctl.words import Fact, Kinds, When, Words, fact

LEAST_FOR_MEAN = 2
"""Least number of flights of a vehicle whose scatter says how well its mean is known."""
PROBLEMS_SHOWN = 10


_WORDS = Words(
    {
        "interval": lambda ends: "[{:+.3g}, {:+.3g}]".format(*ends),
        "p": lambda p: "p < 1e-4" if p < 1e-4 else f"p = {p:.2g}",
    }
)


@unique
class Kind(Kinds, words=_WORDS):
    """Kinds of findings about a fleet, each with the template of its words."""

    MEASURED = "{measured} of {all} flights of {vehicles} vehicles measured."
    REFUSED = "Refused:"
    REASON = "  {flights} x {reason}"
    MORE_REASONS = "  and {reasons} other reasons (--json has all)"
    NO_TEST = "No vehicle has {flights} flights that show the same quantity: no change can be told."
    NO_CHANGE = "No vehicle changes: none of {tests} tests (false discovery rate {rate:.0%})."
    CHANGES = "{changes:count change} in {tests} tests (at most {rate:.0%} of such findings are false, on average):"
    DRIFT = "  {vehicle}: {quantity} drifts by {size:+.3g} {ci95:interval} in ten flights ({p:p}, adjusted)."
    JUMP = "  {vehicle}: {quantity} jumps by {size:+.3g} {ci95:interval} with {since} ({p:p}, adjusted)."

    FIGURE = (
        "{quantity} of {vehicles} vehicles over their flights",
        When("mean", " with mean {mean}"),
        When("changed", "; {changed:list} changed"),
        ".",
    )


class Spread(NamedTuple):
    """Distribution of one quantity in the fleet."""

    quantity: str
    vehicles: int
    flights: int
    population: Population
    """Over the vehicles' means."""
    scatter: float
    """Standard deviation between flights of one vehicle, root mean square over the vehicles."""


@dataclass(frozen=True, eq=False, repr=False)
class Fleet(Result):
    """Result of `summarise`."""

    records: tuple[FlightRecord, ...]
    false_discoveries: float = FALSE_DISCOVERIES

    @cached_property
    def measured(self) -> list[FlightRecord]:
        return [record for record in self.records if not record.problem]

    @cached_property
    def refused(self) -> list[FlightRecord]:
        return [record for record in self.records if record.problem]

    @cached_property
    def vehicles(self) -> list[str]:
        return list(dict.fromkeys(record.vehicle for record in self.records))

    @cached_property
    def series(self) -> list[Series]:
        """Every quantity of every vehicle, flight by flight."""
        found = []
        for vehicle in self.vehicles:
            own = [record for record in self.measured if record.vehicle == vehicle]
            for quantity in dict.fromkeys(name for record in own for name in record.values):
                there = [i for i, record in enumerate(own) if quantity in record.values]
                values = np.array([own[i].values[quantity] for i in there])
                flights = tuple(own[i].flight for i in there)
                found.append(Series(vehicle, quantity, flights, np.array(there, dtype=float), values))
        return found

    @cached_property
    def changes(self) -> list[Change]:
        return find_changes(self.series, self.false_discoveries)

    @cached_property
    def spreads(self) -> list[Spread]:
        """Quantities that at least two vehicles have shown in several flights each."""
        found = []
        for quantity, series in by_quantity(self.series).items():
            several = [one.values for one in series if len(one.values) >= LEAST_FOR_MEAN]
            if len(several) < 2:
                continue
            variances = np.array([values.var(ddof=1) for values in several])
            counts = np.array([len(values) for values in several])
            pooled = float((variances * (counts - 1)).sum() / (counts - 1).sum())
            means = np.array([values.mean() for values in several])
            population = Population.of(means, np.maximum(pooled, 1e-18) / counts)
            found.append(Spread(quantity, len(several), int(counts.sum()), population, pooled**0.5))
        return found

    def to_dict(self) -> dict[str, Any]:
        return {
            "flights": len(self.records),
            "measured": len(self.measured),
            "refused": {record.flight: record.problem for record in self.refused},
            "vehicles": self.vehicles,
            "false_discovery_rate": self.false_discoveries,
            "tests": count_tests(self.series),
            "changes": [change._asdict() for change in self.changes],
            "quantities": {
                spread.quantity: {
                    "mean": spread.population.mean,
                    "standard_error": spread.population.standard_error,
                    "between_vehicles": spread.population.spread,
                    "between_flights": spread.scatter,
                    "next_vehicle_ci95": list(spread.population.next_ci95),
                    "vehicles": spread.vehicles,
                    "flights": spread.flights,
                }
                for spread in self.spreads
            },
        }

    def __rich__(self) -> RenderableType:
        parts: list[RenderableType] = [Text("\n".join(map(str, self.counted())))]
        if self.spreads:
            parts.append(self._spread_table())
        parts.append(Text("\n".join(map(str, self.changed()))))
        return Group(*parts)

    def counted(self) -> list[Fact]:
        """Number of flights and vehicles, and what was refused."""
        measured, all_ = len(self.measured), len(self.records)
        found = [fact(Kind.MEASURED, measured=measured, all=all_, vehicles=len(self.vehicles))]
        reasons = Counter(record.problem.removeprefix(f"{record.flight}: ") for record in self.refused)
        if reasons:
            told = reasons.most_common(PROBLEMS_SHOWN)
            found += [Fact(Kind.REFUSED), *(fact(Kind.REASON, flights=n, reason=reason) for reason, n in told)]
        if len(reasons) > PROBLEMS_SHOWN:
            found.append(fact(Kind.MORE_REASONS, reasons=len(reasons) - PROBLEMS_SHOWN))
        return found

    def _spread_table(self) -> Table:
        table = Table(title="Each quantity over the fleet", title_justify="left")
        table.add_column("quantity", no_wrap=True)
        for heading in ("mean", "std. error", "between vehicles", "between flights", "vehicles", "flights"):
            table.add_column(heading, justify="right")
        for s in self.spreads:
            p = s.population
            numbers = (p.mean, p.standard_error, p.spread, s.scatter)
            table.add_row(s.quantity, *(f"{x:.3g}" for x in numbers), str(s.vehicles), str(s.flights))
        return table

    def changed(self) -> list[Fact]:
        """Each change, after the number of tests and of changes that may be false."""
        tests = count_tests(self.series)
        if not tests:
            return [fact(Kind.NO_TEST, flights=LEAST_FLIGHTS)]
        of = {"tests": tests, "rate": self.false_discoveries}
        if not self.changes:
            return [fact(Kind.NO_CHANGE, **of)]
        each = (
            fact(Kind.DRIFT if change.kind == "drift" else Kind.JUMP, **change._asdict(), p=change.adjusted)
            for change in self.changes
        )
        return [fact(Kind.CHANGES, changes=len(self.changes), **of), *each]


def summarise(records: Sequence[FlightRecord]) -> Fleet:
    """Summarise the records of a fleet, each vehicle's in the order of its flights."""
    return Fleet(tuple(records))
