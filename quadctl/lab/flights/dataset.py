"""Dataset: prepared flights as one set of samples with folds, and the same flights aligned for a model."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise
from typing import Any, Literal

import numpy as np
from joblib import Parallel, delayed
from numpy.typing import NDArray

from quadctl.effects import Effect
from quadctl.errors import LogError
from quadctl.lab.arrays import Floats, Mask
from quadctl.lab.flights.flight import Flight
from quadctl.lab.flights.prediction import PREDICT, measured_targets, predict_targets
from quadctl.lab.flights.preparation import prepare
from quadctl.lab.flights.timing import timed
from quadctl.logs.flight_log import MOTION_CAPTURE, FlightLog
from quadctl.model import Model
from quadctl.vehicle import Vehicle

HoldOut = Literal["blocks", "flights"]
FOLDS = 5
MOST_FLIGHT_FOLDS = 10
"""Largest number of folds of whole flights; with more flights, several share a fold."""
MOVED = {"north": 0.5, "east": 0.5, "speed_forward": 0.5, "speed_right": 0.5, "roll": 3.0, "pitch": 3.0}
"""Least span of a variable that counts as varied, in its unit; gusts alone move a position-controlled vehicle by
less."""
MANOEUVRES = 0.5
"""Least share of the variance of roll, pitch or thrust that the acceleration explains in manoeuvres."""
PASSING = ("time", "battery")
"""Variables that pass by themselves during a flight."""
MAX_FACTOR_BETWEEN_FLIGHTS = 1.6
"""Largest ratio of thrust over weight between flights of one vehicle; batteries and payloads explain less."""


@dataclass(frozen=True, eq=False)
class Dataset:
    """Flights of one vehicle, and the way in which parts of them are held out.

    With `hold_out="blocks"` every flight is cut into blocks of `BLOCK_S`, which are assigned to the folds in turn. With
    "flights" each flight is a fold; more than `MOST_FLIGHT_FOLDS` flights share the folds. Each fold is predicted by a
    fit to the other folds.
    """

    flights: tuple[Flight, ...]
    hold_out: HoldOut = "blocks"

    @cached_property
    def measured(self) -> Floats:
        """Filtered kinematic acceleration, north, east, up, m/s^2, shape (n, 3)."""
        return np.concatenate([flight.measured for flight in self.flights])

    @cached_property
    def groups(self) -> tuple[str, ...]:
        """Measured groups (see `GROUPS`) that all flights have."""
        turning = all(flight.torque is not None for flight in self.flights)
        sensing = all(flight.imu_error is not None for flight in self.flights)
        return ("total", *(["turning"] if turning else []), *(["sensing"] if sensing else []))

    @cached_property
    def targets(self) -> Floats:
        """Targets of a fit, three columns for each of `groups`: torque FRD, N m; the others north, east, up, m/s^2."""
        return np.concatenate([measured_targets(flight, self.groups) for flight in self.flights])

    @cached_property
    def flight_index(self) -> NDArray[np.int64]:
        return np.repeat(np.arange(len(self.flights)), [len(flight.time_s) for flight in self.flights])

    @cached_property
    def parts(self) -> list[slice]:
        """Slice of the samples of each flight."""
        ends = np.cumsum([0, *(len(flight.time_s) for flight in self.flights)])
        return [slice(int(a), int(b)) for a, b in pairwise(ends)]

    @cached_property
    def block(self) -> NDArray[np.int64]:
        """Block number of each sample, unique over all flights, shape (n,)."""
        numbers, offset = [], 0
        for flight in self.flights:
            numbers.append(flight.block + offset)
            offset += int(flight.block.max()) + 1
        return np.concatenate(numbers)

    @cached_property
    def fold(self) -> NDArray[np.int64]:
        """Number of the fold that holds each sample out, shape (n,)."""
        return self.flight_index % MOST_FLIGHT_FOLDS if self.whole_flights else self.block % FOLDS

    @property
    def whole_flights(self) -> bool:
        """True where the folds are whole flights; a single flight is always cut into blocks."""
        return self.hold_out == "flights" and len(self.flights) > 1

    @cached_property
    def folds(self) -> list[int]:
        return [int(number) for number in np.unique(self.fold)]

    def aligned_for(self, model: Model) -> "AlignedDataset":
        """Align the rotor signals with the force that they make, given the motor lag of `model`.

        An aligned dataset aligns the flights that it was made from, so that aligning twice is the same as aligning
        once.
        """
        lag = model.late()
        if lag.effects not in self._aligned:
            flights = timed(self.flights, lag) if lag.stack else self.flights
            self._aligned[lag.effects] = AlignedDataset(flights, self.hold_out, source=self)
        return self._aligned[lag.effects]

    @cached_property
    def _aligned(self) -> "dict[tuple[Effect, ...], AlignedDataset]":
        return {}

    def some(self, which: Iterable[int]) -> "Dataset":
        """Select the flights with the given indices."""
        return Dataset(tuple(self.flights[i] for i in which), self.hold_out)

    def samples(self, kept: Mask) -> "Dataset":
        """Select the samples of the mask `kept`, shape (n,); a flight without any is left out."""
        of_flights = [(flight, kept[part]) for flight, part in zip(self.flights, self.parts, strict=True)]
        return Dataset(
            tuple(flight if own.all() else flight.some(own) for flight, own in of_flights if own.any()), self.hold_out
        )

    def spread_out(self, most: int) -> "Dataset":
        """Select about `most` samples in stretches of `FOLDS` blocks that are spread evenly over each flight; the same
        dataset where it has no more. Of each flight at least one stretch is kept."""
        if len(self.targets) <= most:
            return self
        kept = np.zeros(len(self.targets), dtype=bool)
        for flight, part in zip(self.flights, self.parts, strict=True):
            stretch = flight.block // FOLDS
            numbers = np.unique(stretch)
            count = max(1, round(len(numbers) * most / len(self.targets)))
            chosen = numbers[((np.arange(count) + 0.5) * len(numbers) / count).astype(int)]
            kept[part] = np.isin(stretch, chosen)
        return self.samples(kept)

    def variable(self, name: str) -> Floats | None:
        """Values of a variable at all samples, shape (n,), or None where a flight lacks it.

        None also where a position, a speed or a tilt hardly changes: it then follows the disturbances that it would
        seem to explain.
        """
        if any(name not in flight.variables for flight in self.flights):
            return None
        if self.span(name) < MOVED.get(name, 0.0):
            return None
        return np.concatenate([flight.variables[name] for flight in self.flights])

    def is_flown(self, name: str) -> bool:
        """Tell whether a variable can be a cause of an error rather than follow it.

        The controller counters whatever disturbs the vehicle by leaning and by thrust. So roll, pitch and thrust count
        only where the vehicle's acceleration explains most of their variance, as it does in manoeuvres.
        """
        if name not in self.flights[0].manoeuvres:
            return True
        x = np.concatenate([flight.variables[name] for flight in self.flights])
        flown = np.concatenate([flight.manoeuvres[name] for flight in self.flights])
        if min(np.ptp(x), np.ptp(flown)) < 1e-9:
            return False
        return bool(np.corrcoef(x, flown)[0, 1] ** 2 > MANOEUVRES)

    @cached_property
    def causes(self) -> list[str]:
        """Variables of which an error can be a function: those that are flown, but neither time nor the battery.

        Noise of real flights drifts. Whatever drifts is a function of time, and so of a voltage that falls with it: a
        regression on them predicts held-out blocks of pure noise from the blocks beside them.
        """
        return [name for name in self.flights[0].variables if name not in PASSING and self.is_flown(name)]

    @cached_property
    def followers(self) -> list[str]:
        """Logged variables that are no `causes`: they pass by themselves or follow disturbances."""
        return [name for name in self.flights[0].variables if name not in self.causes]

    def span(self, name: str) -> float:
        """Span of a variable over all flights (see `Flight.span`); 0 where it is not logged, and for a thrust that
        follows disturbances. `levelled` is 1 where an estimator tells by the logged accelerometer, and no motion
        capture, what is level."""
        if name == "levelled":
            return float(any(f.sensed is not None and f.attitude_by != MOTION_CAPTURE for f in self.flights))
        if name == "thrust_share" and not self.is_flown("thrust"):
            return 0.0
        ends = np.array([flight.span(name) for flight in self.flights])
        reach = float(ends[:, 1].max() - ends[:, 0].min())
        return reach if np.isfinite(reach) else 0.0

    @property
    def names(self) -> list[str]:
        return [flight.name for flight in self.flights]

    @property
    def record(self) -> dict[str, list[dict[str, Any]]]:
        """Findings about the record of each flight, by its name, as they stand in JSON."""
        return {flight.name: [found.to_dict() for found in flight.findings] for flight in self.flights}

    @cached_property
    def heights_m(self) -> tuple[float, float]:
        """Lowest and highest height of the rotor plane, m."""
        z = [flight.filtered(flight.conditions.height_m) for flight in self.flights]
        return float(min(h.min() for h in z)), float(max(h.max() for h in z))


@dataclass(frozen=True, eq=False)
class AlignedDataset(Dataset):
    """Flights whose rotor signals are aligned with the force that they make: the only dataset that can be predicted.

    The delay of a rotor signal and the motor lag of a model shift the thrust alike, so the delay is estimated for a
    given lag. During a fit the lag may move away from the one that the flights were aligned for.
    """

    source: Dataset = field(kw_only=True)
    """Prepared flights before the alignment."""

    def aligned_for(self, model: Model) -> "AlignedDataset":
        return self.source.aligned_for(model)

    def some(self, which: Iterable[int]) -> Dataset:
        return self.source.some(which)

    def samples(self, kept: Mask) -> Dataset:
        return self.source.samples(kept)

    def predicted(self, model: Model) -> Floats:
        """Predicted filtered acceleration by `model`, north, east, up, m/s^2, shape (n, 3)."""
        return self.predicted_group(model, "total")

    def predicted_group(self, model: Model, group: str) -> Floats:
        """Prediction of one measured group by `model`, in its unit, shape (n, 3)."""
        return np.concatenate([PREDICT[group](model, flight) for flight in self.flights])

    def residual(self, model: Model) -> Floats:
        """Measured minus predicted acceleration, m/s^2, shape (n, 3)."""
        return self.measured - self.predicted(model)

    def predicted_targets(self, model: Model) -> Floats:
        """Prediction of the `targets` by `model`, shape (n, 3 * groups)."""
        return np.concatenate([predict_targets(model, flight, self.groups) for flight in self.flights])


def load_dataset(logs: Iterable[FlightLog], vehicle: Vehicle, hold_out: HoldOut = "blocks") -> Dataset:
    """Prepare `logs`, flown by `vehicle`; parallel as `joblib.parallel_config` says, serial by default.

    Raises
    ------
    LogError
        The first reason why one of them cannot be analysed, or why they are of different vehicles.
    """
    return joined(Parallel()(delayed(prepare)(log, vehicle) for log in logs), hold_out)


def joined(flights: Sequence[Flight], hold_out: HoldOut = "blocks") -> Dataset:
    """Dataset of flights that were prepared one by one; the times of their channels are estimated from all together.

    Raises
    ------
    LogError
        They are of different vehicles.
    """
    _require_one_vehicle(flights)
    if len(flights) < 2:  # its times have been estimated from it already
        return Dataset(tuple(flights), hold_out)
    numbered = [
        replace(flight, conditions=replace(flight.conditions, flight=number))
        for number, flight in enumerate(flights, start=1)
    ]
    return Dataset(timed(numbered, Model(flights[0].vehicle)), hold_out)


def _require_one_vehicle(flights: Sequence[Flight]) -> None:
    """Raise LogError where the ratio of thrust to weight in flight differs too much between flights with one kind of
    thrust signal."""
    for source in sorted({flight.thrust_source for flight in flights}):
        of_source = [flight for flight in flights if flight.thrust_source == source]
        share = {f.name: float(np.median(f.variables["thrust"])) / f.vehicle.weight_n for f in of_source}
        least, most = min(share, key=share.__getitem__), max(share, key=share.__getitem__)
        if share[most] > MAX_FACTOR_BETWEEN_FLIGHTS * share[least]:
            raise LogError(
                f"{most}: by its {source} the rotors give {share[most]:.2f} times the weight in flight, in {least} "
                f"{share[least]:.2f} times, expected about the same: were they flown by different vehicles?"
            )
