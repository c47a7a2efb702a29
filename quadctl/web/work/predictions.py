"""Accelerations that models predict for a flight, remembered while a person goes to and fro between figures."""

from collections import deque
from collections.abc import Mapping

from quadctl.lab.arrays import Floats
from quadctl.lab.flights.dataset import Dataset
from quadctl.lab.flights.flight import Flight
from quadctl.logs.memory import give_memory_back
from quadctl.model import Model

KEPT = 9
LONG = 200_000
"""Places on the grid of a flight whose prediction takes a hundred megabytes on the way."""
_kept: deque[tuple[Model, Flight, Floats]] = deque(maxlen=KEPT)


def predictions(models: Mapping[str, Model], flight: Flight) -> dict[str, Floats]:
    """Predicted acceleration by the names of the models, m/s², north, east, up, shape (n, 3) each."""
    return {name: _prediction(model, flight) for name, model in models.items()}


def _prediction(model: Model, flight: Flight) -> Floats:
    for known, on, values in _kept:
        if on is flight and known == model:
            return values
    values = Dataset((flight,)).aligned_for(model).predicted(model)
    _kept.append((model, flight, values))
    if len(flight.grid_s) > LONG:
        give_memory_back()
    return values
