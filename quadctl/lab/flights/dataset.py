"""Prepared flights as one set of samples: stacked residuals, folds for held-out errors, noise that respects time."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Literal

import numpy as np
from joblib import Parallel, delayed
from numpy.typing import NDArray

from quadctl.effects import Effect
from quadctl.errors import LogError
from quadctl.frames import ned_from_neu
from quadctl.lab.arrays import Floats
from quadctl.lab.flights.delay import timed_for
from quadctl.lab.flights.flight import Flight
from quadctl.lab.flights.preparation import prepare
from quadctl.logs.flight_log import FlightLog
from quadctl.model import Model
from quadctl.vehicle import Vehicle

AXES = ("north", "east", "up")
MOMENTS = ("roll", "pitch", "yaw")
SENSED = ("imu_north", "imu_east", "imu_up")
GROUPS = {"total": AXES, "turning": MOMENTS, "sensing": SENSED}
"""What is measured, by the name of the root of the sum of its squares: acceleration, torque, and by how much the
accelerometer tells another acceleration than the velocity."""
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
        return np.concatenate([np.column_stack(_measured(flight, self.groups)) for flight in self.flights])

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

    def predicted(self, model: Model) -> Floats:
        """What `model` says the filtered acceleration should have been, shape (n, 3)."""
        return np.concatenate([predict(model, flight) for flight in self.timed_for(model).flights])

    def residual(self, model: Model) -> Floats:
        """Measured minus predicted, shape (n, 3)."""
        return self.measured - self.predicted(model)

    def predicted_targets(self, model: Model) -> Floats:
        """What `model` says the `targets` should have been."""
        return np.concatenate([predict_targets(model, flight, self.groups) for flight in self.flights])

    def timed_for(self, model: Model) -> "Dataset":
        """The same flights, their rotor signals timed beside what `model` says the motors do."""
        late = model.late()
        if not late.stack:
            return self
        if late.effects not in self._timed:
            flights = tuple(timed_for(late, flight) for flight in self.flights)
            self._timed[late.effects] = Dataset(flights, self.hold_out)
        return self._timed[late.effects]

    @cached_property
    def _timed(self) -> "dict[tuple[Effect, ...], Dataset]":
        return {}

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


def predict(model: Model, flight: Flight) -> Floats:
    """Filtered acceleration of one flight by `model`, north, east, up, shape (n, 3)."""
    acceleration = ned_from_neu(model.acceleration_ned(flight.nominal_n, flight.conditions))
    return np.column_stack([flight.filtered(component) for component in acceleration])


def predict_torque(model: Model, flight: Flight) -> Floats:
    """Torque of one flight by `model`, filtered and slowly, FRD, N m, shape (n, 3).

    It is that of the effects that the balance of moments can show: the others scale what is near zero on average.
    """
    turning = model.turning()
    if not turning.stack:
        return flight.nominal_torque
    torque = turning.body_torque(flight.nominal_n, flight.conditions)
    return flight.slowly(np.column_stack([flight.filtered(component) for component in torque]))


def predict_imu_error(model: Model, flight: Flight) -> Floats:
    """Filtered: what the accelerometer tells beyond the acceleration, by `model`, north, east, up, shape (n, 3)."""
    if not any(effect.senses for effect in model.effects):
        return np.zeros_like(flight.measured)
    sensed = ned_from_neu(model.sensed_ned_m_s2(flight.conditions))
    return np.column_stack([flight.filtered(component) for component in sensed])


def concerns(effect: Effect, group: str) -> bool:
    """Whether `effect` has a say in what `group` measures."""
    return {"total": True, "turning": effect.affects_moment, "sensing": effect.senses}[group]


PREDICT = {"total": predict, "turning": predict_torque, "sensing": predict_imu_error}


def predict_targets(model: Model, flight: Flight, groups: Sequence[str]) -> Floats:
    """Prediction of what is measured in `groups`, shape (n, 3 * groups)."""
    return np.column_stack([PREDICT[group](model, flight) for group in groups])


def _measured(flight: Flight, groups: Sequence[str]) -> list[Floats]:
    known = {"total": flight.measured, "turning": flight.moments, "sensing": flight.imu_error}
    return [values for group in groups if (values := known[group]) is not None]


def rmse(residual: Floats, groups: Sequence[str] = ("total",)) -> dict[str, float]:
    """Root mean square per axis, and of each group the root of the sum of the squares of its axes."""
    squares = np.mean(residual**2, axis=0)
    errors: dict[str, float] = {}
    for i, group in enumerate(groups):
        three = squares[3 * i : 3 * i + 3]
        errors |= {axis: float(np.sqrt(value)) for axis, value in zip(GROUPS[group], three, strict=True)}
        errors[group] = float(np.sqrt(three.sum()))
    return errors
