"""Difference of a height sensor from its reference, over what may make it err."""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from quadctl.effects.sensor_error import SensorError
from quadctl.lab.arrays import Floats
from quadctl.lab.sensors.heights import Heights

EDGES = {
    "height": (0.0, 0.25, 0.5, 1.0, 2.0, 4.0, 1000.0),
    "speed forward": (-1000.0, -7.0, -4.0, -1.5, 1.5, 4.0, 7.0, 1000.0),
    "speed right": (-1000.0, -7.0, -4.0, -1.5, 1.5, 4.0, 7.0, 1000.0),
    "climb": (-1000.0, -1.5, -0.5, 0.5, 1.5, 1000.0),
    "thrust": (0.0, 0.8, 0.95, 1.05, 1.2, 100.0),
    "temperature": (-1000.0, -5.0, -1.0, 1.0, 5.0, 1000.0),
}
"""Edges of the bins: m above the ground, m/s, share of the hover thrust, K from the take-off."""
LEAST = 6
"""Least number of rows of a bin."""
INDEPENDENT = 4.0
"""Rows that tell as much as one: the scatter is correlated."""


UNITS = {"height": "m", "speed forward": "m/s", "speed right": "m/s", "climb": "m/s", "thrust": "", "temperature": "K"}
"""Units of the variables; the thrust is a share of that in hover."""
CURVE_BINS, CURVE_LEAST = 14, 4
"""Number of bins of a curve, and least number of rows of one."""
SPANS = 0.02
"""Least range of a variable over which a curve says something, in its unit."""


class Curve(NamedTuple):
    """Difference of a sensor from its reference over one variable."""

    value: Floats
    """The variable, shape (n,)."""
    difference_m: Floats
    """Shape (n,)."""
    middle: Floats
    mean_m: Floats
    """Median of the variable and mean of the difference in each bin."""


class Bin(NamedTuple):
    """Mean difference over a range of one variable."""

    variable: str
    low: float
    high: float
    """Ends of what was flown there."""
    mean_m: float
    std_error_m: float
    rows: int


@dataclass(frozen=True)
class SensorComparison:
    """Difference of a sensor from its reference."""

    flights: tuple[Heights, ...]
    bins: tuple[Bin, ...]
    rms_m: float
    """About its middle in each flight."""

    @property
    def sensor(self) -> str:
        return self.flights[0].sensor

    def to_dict(self) -> dict[str, Any]:
        """The facts, as docs/sensors.md describes them."""
        return {
            "sensor": self.sensor,
            "logs": [flight.name for flight in self.flights],
            "references": [str(flight.reference) for flight in self.flights],
            "rms_m": self.rms_m,
            "bins": [found._asdict() for found in self.bins],
        }


def variables(flight: Heights) -> dict[str, Floats]:
    """Causes for which a sensor may err, by the names of EDGES, each of shape (n,)."""
    forward, right, _ = flight.conditions(flight.wind_ne_m_s).velocity_body_m_s
    return {
        "height": flight.above_ground_m,
        "speed forward": np.asarray(forward),
        "speed right": np.asarray(right),
        "climb": flight.climb_m_s,
        "thrust": flight.thrust_share,
        "temperature": flight.temperature_k,
    }


def flown(flights: Sequence[Heights]) -> list[str]:
    """Variables that change in these flights, in the order of EDGES."""
    by_flight = [variables(flight) for flight in flights]
    return [name for name in EDGES if np.ptp(np.concatenate([each[name] for each in by_flight])) > SPANS]


def over(flights: Sequence[Heights], errors: Sequence[SensorError], variable: str) -> Curve:
    """The difference over one variable, with `errors` taken away."""
    value = np.concatenate([variables(flight)[variable] for flight in flights])
    taken = [
        flight.difference_m - sum(np.asarray(e.error_m(flight.conditions(flight.wind_ne_m_s))) for e in errors)
        for flight in flights
    ]
    difference = np.concatenate([each - np.median(each) for each in taken])
    edges = np.linspace(value.min(), value.max(), CURVE_BINS + 1)
    number = np.clip(np.searchsorted(edges, value, side="right") - 1, 0, CURVE_BINS - 1)
    bins = [number == i for i in range(CURVE_BINS) if np.count_nonzero(number == i) >= CURVE_LEAST]
    middle = np.array([np.median(value[rows]) for rows in bins])
    return Curve(value, difference, middle, np.array([np.mean(difference[rows]) for rows in bins]))


def compare_sensor(flights: Sequence[Heights]) -> SensorComparison:
    """The difference from the reference, over each variable."""
    difference = np.concatenate([flight.difference_m for flight in flights])
    by_flight = [variables(flight) for flight in flights]
    bins = []
    for name, edges in EDGES.items():
        values = np.concatenate([each[name] for each in by_flight])
        for low, high in itertools.pairwise(edges):
            rows = (values >= low) & (values < high)
            if np.count_nonzero(rows) < LEAST or rows.all():
                continue
            own = difference[rows]
            std_error = float(np.std(own) / np.sqrt(max(len(own) / INDEPENDENT, 1.0)))
            ends = float(values[rows].min()), float(values[rows].max())
            bins.append(Bin(name, *ends, float(np.mean(own)), std_error, len(own)))
    return SensorComparison(tuple(flights), tuple(bins), float(np.sqrt(np.mean(difference**2))))
