"""A height sensor beside its reference, over what makes it err, before and after its errors are taken away."""

from collections.abc import Sequence

from matplotlib.figure import Figure

from quadctl.effects.sensor_error import SensorError
from quadctl.lab.plots.style import AFTER, BEFORE, styled
from quadctl.lab.sensors.comparison import over
from quadctl.lab.sensors.heights import Heights

SHOWN = ("height", "speed forward", "speed right", "climb")
UNITS = {"height": "height above ground, m", "climb": "climb rate, m/s"}


@styled
def height_sensor(flights: Sequence[Heights], errors: Sequence[SensorError]) -> Figure:
    """Draw the difference over each variable: as read, and with `errors` taken away."""
    figure = Figure(figsize=(11, 6.5), layout="constrained")
    curves = [((), BEFORE, "as read"), *([(errors, AFTER, "errors taken away")] if errors else [])]
    for axis, name in zip(figure.subplots(2, 2).ravel(), SHOWN, strict=True):
        for taken, colour, label in curves:
            drawn = over(flights, taken, name)
            axis.plot(drawn.value, 100.0 * drawn.difference_m, ".", ms=2, alpha=0.25, color=colour)
            axis.plot(drawn.middle, 100.0 * drawn.mean_m, "o-", ms=4, color=colour, label=label)
        axis.axhline(0.0, color="k", lw=0.6)
        axis.set_xlabel(UNITS.get(name, f"{name}, m/s"))
        axis.set_ylabel(f"{flights[0].sensor} minus reference, cm")
        axis.legend(fontsize=8)
    figure.suptitle(f"{flights[0].sensor} beside {', '.join(dict.fromkeys(flight.reference for flight in flights))}")
    return figure
