"""Prepared flights as one set of samples: folds that hold them out, and the same flights aligned for a model."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise
from typing import Literal

import numpy as np
from joblib import Parallel, delayed
from numpy.typing import NDArray

from quadctl.effects import Effect
from quadctl.errors import LogError
from quadctl.lab.arrays import Floats
from quadctl.lab.flights.delay import align
from quadctl.lab.flights.flight import Flight
from quadctl.lab.flights.prediction import measured_targets, predict, predict_targets
from quadctl.lab.flights.preparation import prepare
from quadctl.logs.flight_log import FlightLog
from quadctl.model import Model
from quadctl.vehicle import Vehicle

HoldOut = Literal["blocks", "flights"]
FOLDS = 5
MOST_FLIGHT_FOLDS = 10
"""More flights than these share the folds: a fit without each of very many flights would tell little more."""
MOVED = {"north": 0.5, "east": 0.5, "speed_forward": 0.5, "speed_right": 0.5, "roll": 3.0, "pitch": 3.0}
"""In their units: a vehicle that a controller holds in its place against gusts wanders, moves and leans less."""
MAX_FACTOR_BETWEEN_FLIGHTS = 1.6
"""Of thrust over weight in flight: batteries and payloads explain less."""


@dataclass(frozen=True, eq=False)
class Dataset:
    """Flights of one vehicle, and how part of them is held out.

    With `hold_out="blocks"` every flight is cut into blocks of `BLOCK_S`, dealt to the folds in turn; with "flights"
    whole flights are the folds, or dealt to `MOST_FLIGHT_FOLDS` in turn. Each fold is predicted by a fit that has seen
    only the others.
    """

    flights: tuple[Flight, ...]
    hold_out: HoldOut = "blocks"

    @cached_property
    def measured(self) -> Floats:
        """Kinematic acceleration, north, east, up, m/s^2, shape (n, 3)."""
        return np.concatenate([flight.measured for flight in self.flights])

    @cached_property
    def groups(self) -> tuple[str, ...]:
        """Of `GROUPS`, those that all flights have."""
        turning = all(flight.torque is not None for flight in self.flights)
        sensing = all(flight.imu_error is not None for flight in self.flights)
        return ("total", *(["turning"] if turning else []), *(["sensing"] if sensing else []))

    @cached_property
    def targets(self) -> Floats:
        """What fits aim at: three columns for each of `groups`; the torque FRD, N m, the others north, east, up."""
        return np.concatenate([measured_targets(flight, self.groups) for flight in self.flights])

    @cached_property
    def flight_index(self) -> NDArray[np.int64]:
        return np.repeat(np.arange(len(self.flights)), [len(flight.time_s) for flight in self.flights])

    @cached_property
    def parts(self) -> list[slice]:
        """Where the samples of each flight are."""
        ends = np.cumsum([0, *(len(flight.time_s) for flight in self.flights)])
        return [slice(int(a), int(b)) for a, b in pairwise(ends)]

    @cached_property
    def block(self) -> NDArray[np.int64]:
        """Number of the block of each sample, unique over all flights."""
        numbers, offset = [], 0
        for flight in self.flights:
            numbers.append(flight.block + offset)
            offset += int(flight.block.max()) + 1
        return np.concatenate(numbers)

    @cached_property
    def fold(self) -> NDArray[np.int64]:
        """Number of the fold that holds each sample out."""
        return self.flight_index % MOST_FLIGHT_FOLDS if self.whole_flights else self.block % FOLDS

    @property
    def whole_flights(self) -> bool:
        """Whether folds are flights: one flight alone has to be cut into blocks."""
        return self.hold_out == "flights" and len(self.flights) > 1

    @cached_property
    def folds(self) -> list[int]:
        return [int(number) for number in np.unique(self.fold)]

    def aligned_for(self, model: Model) -> "AlignedDataset":
        """The same flights with their rotor signals shifted to the force they make, beside the lag of `model`.

        An aligned dataset aligns the flights that it was made from, so that aligning twice is aligning once.
        """
        lag = model.late()
        if lag.effects not in self._aligned:
            flights = tuple(align(flight, lag) for flight in self.flights) if lag.stack else self.flights
            self._aligned[lag.effects] = AlignedDataset(flights, self.hold_out, source=self)
        return self._aligned[lag.effects]

    @cached_property
    def _aligned(self) -> "dict[tuple[Effect, ...], AlignedDataset]":
        return {}

    def some(self, which: Iterable[int]) -> "Dataset":
        """A dataset of the flights with these numbers only."""
        return Dataset(tuple(self.flights[i] for i in which), self.hold_out)

    def variable(self, name: str) -> Floats | None:
        """A variable of all samples, or None where a flight lacks it.

        A position, a speed or a tilt that hardly changes is none: it follows the pushes that it would seem to explain.
        """
        if any(name not in flight.variables for flight in self.flights):
            return None
        if self.span(name) < MOVED.get(name, 0.0):
            return None
        return np.concatenate([flight.variables[name] for flight in self.flights])

    def span(self, name: str) -> float:
        """How far a variable ranges over all flights (see `Flight.span`); 0 where it is not logged."""
        ends = np.array([flight.span(name) for flight in self.flights])
        reach = float(ends[:, 1].max() - ends[:, 0].min())
        return reach if np.isfinite(reach) else 0.0

    @property
    def names(self) -> list[str]:
        return [flight.name for flight in self.flights]

    @cached_property
    def heights_m(self) -> tuple[float, float]:
        """Range of the rotor plane's height."""
        z = [flight.filtered(flight.conditions.height_m) for flight in self.flights]
        return float(min(h.min() for h in z)), float(max(h.max() for h in z))


@dataclass(frozen=True, eq=False)
class AlignedDataset(Dataset):
    """Flights whose rotor signals are aligned with the force they make: the only dataset that can be predicted.

    The delay of a rotor signal and the lag of a model's motors shift the thrust alike, so the delay is known only
    beside a lag. Parameters of a fit may move away from the lag that the flights were aligned for.
    """

    source: Dataset = field(kw_only=True)
    """The flights as they were prepared."""

    def aligned_for(self, model: Model) -> "AlignedDataset":
        return self.source.aligned_for(model)

    def some(self, which: Iterable[int]) -> Dataset:
        return self.source.some(which)

    def predicted(self, model: Model) -> Floats:
        """Filtered acceleration by `model`, north, east, up, m/s^2, shape (n, 3)."""
        return np.concatenate([predict(model, flight) for flight in self.flights])

    def residual(self, model: Model) -> Floats:
        """Measured minus predicted acceleration, m/s^2, shape (n, 3)."""
        return self.measured - self.predicted(model)

    def predicted_targets(self, model: Model) -> Floats:
        """Prediction of the `targets` by `model`, shape (n, 3 * groups)."""
        return np.concatenate([predict_targets(model, flight, self.groups) for flight in self.flights])


def load_dataset(logs: Iterable[FlightLog], vehicle: Vehicle, hold_out: HoldOut = "blocks") -> Dataset:
    """Prepare `logs`, flown by `vehicle`; spread as `joblib.parallel_config` says, one after the other without.

    Raises
    ------
    LogError
        The first reason why one of them cannot be analysed, or why they are of different vehicles.
    """
    flights = Parallel()(delayed(prepare)(log, vehicle) for log in logs)
    _require_one_vehicle(flights)
    return Dataset(tuple(flights), hold_out)


def _require_one_vehicle(flights: Sequence[Flight]) -> None:
    """Of one vehicle, the thrust over the weight in flight is about the same by the same kind of signal."""
    for source in sorted({flight.thrust_source for flight in flights}):
        of_source = [flight for flight in flights if flight.thrust_source == source]
        share = {f.name: float(np.median(f.variables["thrust"])) / f.vehicle.weight_n for f in of_source}
        least, most = min(share, key=share.__getitem__), max(share, key=share.__getitem__)
        if share[most] > MAX_FACTOR_BETWEEN_FLIGHTS * share[least]:
            raise LogError(
                f"{most}: by its {source} the rotors give {share[most]:.2f} times the weight in flight, in {least} "
                f"{share[least]:.2f} times, expected about the same: were they flown by different vehicles?"
            )
