"""Difference of a height sensor from its reference, over what may make it err."""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

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
