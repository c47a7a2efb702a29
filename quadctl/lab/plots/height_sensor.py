"""A height sensor beside its reference, over what makes it err, before and after its errors are taken away."""

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from quadctl.effects.sensor_error import SensorError
from quadctl.lab.plots.style import AFTER, BEFORE, styled
from quadctl.lab.sensors.comparison import variables
from quadctl.lab.sensors.heights import Heights

SHOWN = ("height", "speed forward", "speed right", "climb")
UNITS = {"height": "height above ground, m", "climb": "climb rate, m/s"}
BINS, LEAST = 14, 4
"""Number of bins, and least number of rows of one."""


@styled
def height_sensor(flights: Sequence[Heights], errors: Sequence[SensorError]) -> Figure:
    """Draw the difference over each variable: as read, and with `errors` taken away."""
    before = np.concatenate([flight.difference_m for flight in flights])
    taken = [
        flight.difference_m - sum(np.asarray(e.error_m(flight.conditions(flight.wind_ne_m_s))) for e in errors)
        for flight in flights
    ]
    after = np.concatenate([values - np.median(values) for values in taken])
    figure = Figure(figsize=(11, 6.5), layout="constrained")
    for axis, name in zip(figure.subplots(2, 2).ravel(), SHOWN, strict=True):
        values = np.concatenate([variables(flight)[name] for flight in flights])
        for difference, colour, label in ((before, BEFORE, "as read"), (after, AFTER, "errors taken away")):
            if difference is after and not errors:
                continue
            axis.plot(values, 100.0 * difference, ".", ms=2, alpha=0.25, color=colour)
            edges = np.linspace(values.min(), values.max(), BINS + 1)
            number = np.clip(np.searchsorted(edges, values, side="right") - 1, 0, len(edges) - 2)
            known = [i for i in range(BINS) if np.count_nonzero(number == i) >= LEAST]
            middle = [np.median(values[number == i]) for i in known]
            mean = [100.0 * np.mean(difference[number == i]) for i in known]
            axis.plot(middle, mean, "o-", ms=4, color=colour, label=label)
        axis.axhline(0.0, color="k", lw=0.6)
        axis.set_xlabel(UNITS.get(name, f"{name}, m/s"))
        axis.set_ylabel(f"{flights[0].sensor} minus reference, cm")
        axis.legend(fontsize=8)
    figure.suptitle(f"{flights[0].sensor} beside {', '.join(dict.fromkeys(flight.reference for flight in flights))}")
    return figure
