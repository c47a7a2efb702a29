"""Open-loop prediction error of position and velocity some seconds after the start of a simulation.

From many instants of a flight the equations of motion are integrated forward. Attitude and rotor speeds are those of
the log; position, velocity and all effects that depend on them are those of the simulation. The result is compared with
the log. A constant error e of the acceleration grows to e t in velocity and e t^2 / 2 in position.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.table import Table
from scipy.integrate import cumulative_trapezoid
from scipy.ndimage import gaussian_filter1d

from quadctl.effects import Conditions
from quadctl.frames import ned_from_neu, rotate, rotate_inverse
from quadctl.lab.arrays import Floats
from quadctl.lab.comparison.wording import Said, number
from quadctl.lab.fitting.bootstrap import Estimate, estimates
from quadctl.lab.flights.dataset import Dataset
from quadctl.lab.flights.flight import Flight
from quadctl.lab.flights.prediction import AXES
from quadctl.lab.flights.preparation import BLOCK_S
from quadctl.model import Model
from quadctl.words import Fact, fact

HORIZONS_S = (1.0, 2.0, 5.0)
START_EVERY_S = 0.25
MAX_STARTS = 4000
"""Largest number of starts per flight; in longer flights the starts are further apart."""
COLUMNS = (*AXES, "horizontal", "total")
OFF_M = 0.1
"""Position error from which on an effect is said to move the vehicle off."""
STEP_S, LONGEST_S = 0.1, 30.0
"""Resolution and end of the times after which a vehicle may be off."""


@dataclass(frozen=True, eq=False)
class OpenLoop:
    """Errors (RMSE) at one horizon after the start: per axis, `horizontal`, and `total` of all three axes."""

    horizon_s: float
    n_starts: int
    position: dict[str, Estimate]
    """Position error, m."""
    velocity: dict[str, Estimate]
    """Velocity error, m/s."""
    held_position: dict[str, Estimate]
    """Position error without any model, when the velocity stays as it is at the start, m."""
    held_velocity: dict[str, Estimate]

    @property
    def said(self) -> Fact:
        """The error of the position beside that of a constant velocity."""
        position, held_m = self.position["total"].in_words("m"), self.held_position["total"].rmse
        return fact(Said.OPEN_LOOP, horizon_s=self.horizon_s, position=position, held_m=held_m)

    def to_dict(self) -> dict[str, Any]:
        errors = {
            "position_m": self.position,
            "velocity_m_s": self.velocity,
            "velocity_held_position_m": self.held_position,
            "velocity_held_velocity_m_s": self.held_velocity,
        }
        return {
            "horizon_s": self.horizon_s,
            "n_starts": self.n_starts,
            **{name: {axis: e.to_dict() for axis, e in by_axis.items()} for name, by_axis in errors.items()},
        }


_TITLE = "RMSE of open-loop predictions: position (m), velocity (m/s); no model: position at constant velocity"


def open_loop_table(by_horizon: Sequence[OpenLoop]) -> Table:
    """Table of the errors of position and velocity, with those of a constant velocity for comparison."""
    table = Table(title=_TITLE, title_justify="left")
    table.add_column("after", no_wrap=True)
    for name in ("horizontal", "up", "position [95 %]", "velocity", "no model"):
        table.add_column(name, justify="right", no_wrap=True)
    for e in by_horizon:
        parts = (e.position["horizontal"], e.position["up"])
        ends = (e.velocity["total"], e.held_position["total"])
        table.add_row(
            f"{e.horizon_s:g} s",
            *(number(part.rmse) for part in parts),
            e.position["total"].in_words(),
            *(number(end.rmse) for end in ends),
        )
    return table


def open_loop(model: Model, dataset: Dataset, horizons_s: Sequence[float] = HORIZONS_S) -> list[OpenLoop]:
    """Open-loop errors of `model` at each of the ascending `horizons_s`, s; horizons longer than all flights are left
    out."""
    flown = [_errors(model, flight, horizons_s) for flight in dataset.flights]
    found = []
    for place, horizon in enumerate(horizons_s):
        errors = [flight[place] for flight in flown if len(flight[place].block)]
        if not errors:
            break
        # Overlapping predictions are correlated: a block is longer than several predictions.
        offsets = np.cumsum([0, *(int(e.block.max()) + 1 for e in errors[:-1])])
        block = np.concatenate([e.block + offset for e, offset in zip(errors, offsets, strict=True)])
        squares = np.concatenate([e.squares for e in errors], axis=1)
        by_kind = estimates(np.concatenate(squares, axis=1), block)
        width = len(COLUMNS)
        kinds = [dict(zip(COLUMNS, by_kind[i : i + width], strict=True)) for i in range(0, len(by_kind), width)]
        found.append(OpenLoop(horizon, len(block), *kinds))
    return found


def off_after_s(model: Model, without: Model, flights: Sequence[Flight], off_m: float = OFF_M) -> float | None:
    """Time after which a simulation by `without` is off by `off_m`, the RMS over its starts, were `model` right, s;
    None where no flight lasts so long.

    To first order: the difference of the two accelerations along the flown path is integrated twice.
    """
    tracks = [_drift(model, without, flight) for flight in flights]
    for horizon in np.arange(STEP_S, LONGEST_S + STEP_S, STEP_S):
        offsets = [drift.after(float(horizon)) for drift in tracks]
        squares = np.concatenate([np.sum(offset**2, axis=0) for offset in offsets])
        if not len(squares):
            return None
        if np.mean(squares) > off_m**2:
            return round(float(horizon), 1)
    return None


@dataclass(frozen=True, eq=False)
class _Drift:
    """First and second integral of an acceleration over the grid of a flight, north, east, up, shape (3, m) each."""

    velocity: Floats
    position: Floats
    step_s: float
    starts: NDArray[np.int64]
    lasting_s: Floats

    def after(self, horizon_s: float) -> Floats:
        """Position that the acceleration adds within `horizon_s` of each start that the flight outlasts, shape
        (3, starts)."""
        steps = round(horizon_s / self.step_s)
        first = self.starts[(self.lasting_s >= horizon_s) & (self.starts + steps < self.position.shape[1])]
        begun = self.position[:, first] + steps * self.step_s * self.velocity[:, first]
        return np.asarray(self.position[:, first + steps] - begun)


def _drift(model: Model, without: Model, flight: Flight) -> _Drift:
    with_it, without_it = (
        np.stack(np.broadcast_arrays(*ned_from_neu(m.acceleration_ned(flight.nominal_n, flight.conditions))))
        for m in (model, without)
    )
    step_s = float(flight.grid_s[1] - flight.grid_s[0])
    difference: Floats = with_it - without_it
    velocity = cumulative_trapezoid(difference, dx=step_s, initial=0)
    time, lasting = _starts(flight)
    starts = np.rint((time - flight.grid_s[0]) / step_s).astype(np.int64)
    return _Drift(velocity, cumulative_trapezoid(velocity, dx=step_s, initial=0), step_s, starts, lasting)


@dataclass(frozen=True, eq=False)
class _Errors:
    """Squared errors of one flight at one horizon."""

    squares: Floats
    """Squares of the errors of position, velocity, and both with the velocity held, shape (4, starts, columns)."""
    block: NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class _Track:
    """Flown position and velocity on the grid, north, east, up, shape (3, m) each."""

    position: Floats
    velocity: Floats
    """Filtered velocity: the error of a single sample would grow with the horizon."""
    step_s: float


def _errors(model: Model, flight: Flight, horizons_s: Sequence[float]) -> list[_Errors]:
    track = _track(flight)
    time, lasting = _starts(flight)
    starts = np.rint((time - flight.grid_s[0]) / track.step_s).astype(np.int64)
    found = []
    for horizon, (position, velocity) in zip(
        horizons_s, _simulated(model, flight, track, starts, horizons_s), strict=True
    ):
        usable = lasting >= horizon
        first = starts[usable]
        whole, share = _steps(horizon, track.step_s)
        there = first + whole
        true_position = (1.0 - share) * track.position[:, there] + share * track.position[:, there + 1]
        true_velocity = (1.0 - share) * track.velocity[:, there] + share * track.velocity[:, there + 1]
        held = track.velocity[:, first]
        errors = (
            position[:, usable] - true_position,
            velocity[:, usable] - true_velocity,
            track.position[:, first] + horizon * held - true_position,
            held - true_velocity,
        )
        block = (time[usable] // max(BLOCK_S, 2.0 * horizon)).astype(np.int64)
        found.append(_Errors(np.stack([_by_column(e**2) for e in errors]), block))
    return found


def _by_column(squares: Floats) -> Floats:
    """Squares of the columns `COLUMNS`, shape (s, columns), from those north, east, up, shape (3, s)."""
    north, east, up = squares
    return np.column_stack([north, east, up, north + east, north + east + up])


def _track(flight: Flight) -> _Track:
    c = flight.conditions
    step = float(flight.grid_s[1] - flight.grid_s[0])
    sigma_s = np.sqrt(np.log(2.0)) / (2.0 * np.pi * flight.bandwidth_hz)  # half the power at the bandwidth
    velocity = np.stack(ned_from_neu(rotate(c.attitude, c.velocity_body_m_s)))
    return _Track(
        np.stack([*c.position_ne_m, c.height_m]),
        gaussian_filter1d(velocity, sigma_s / step, axis=1, mode="nearest", truncate=3.0),
        step,
    )


def _starts(flight: Flight) -> tuple[Floats, Floats]:
    """Start times, and the time that the flight then goes on without a gap, s."""
    time = flight.time_s
    spacing = float(np.median(np.diff(time)))
    last = np.append(np.flatnonzero(np.diff(time) > 1.5 * spacing), len(time) - 1)
    lasting = time[last[np.searchsorted(last, np.arange(len(time)))]] - time
    stride = max(1, round(START_EVERY_S / spacing), -(-len(time) // MAX_STARTS))
    return time[::stride], lasting[::stride]


def _steps(horizon_s: float, step_s: float) -> tuple[int, float]:
    """Whole steps within the horizon, and the share of the next one that is left."""
    whole = int(horizon_s / step_s)
    return whole, horizon_s / step_s - whole


def _simulated(
    model: Model, flight: Flight, track: _Track, starts: NDArray[np.int64], horizons_s: Sequence[float]
) -> list[tuple[Floats, Floats]]:
    """Predicted position and velocity, north, east, up, shape (3, starts) each, after every horizon.

    All starts advance together with Heun's method: the acceleration at the end of a step is evaluated at the Euler
    prediction, and is used again at the beginning of the next step. Simulations that run past the end of the flight
    continue with its last sample and are not used.
    """
    nominal, immediate = _without_memory(model, flight)
    last = len(flight.grid_s) - 1

    def acceleration(step: int, position: Floats, velocity: Floats) -> Floats:
        rows = np.minimum(starts + step, last)
        c = _at(flight.conditions, rows)
        north, east, height = position
        body = rotate_inverse(c.attitude, ned_from_neu((velocity[0], velocity[1], velocity[2])))
        there = replace(c, height_m=height, velocity_body_m_s=body, position_ne_m=(north, east))
        return np.stack(ned_from_neu(immediate.acceleration_ned([thrust[rows] for thrust in nominal], there)))

    h = track.step_s
    ends = dict(_steps(horizon, h) for horizon in horizons_s)
    found = []
    p, v = track.position[:, starts], track.velocity[:, starts]
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):  # a bad model may diverge
        a = acceleration(0, p, v)
        for step in range(max(ends) + 1):
            next_a = acceleration(step + 1, p + h * v + 0.5 * h * h * a, v + h * a)
            next_v = v + 0.5 * h * (a + next_a)
            next_p = p + 0.5 * h * (v + next_v)
            if step in ends:
                share = ends[step]
                found.append(((1.0 - share) * p + share * next_p, (1.0 - share) * v + share * next_v))
            p, v, a = next_p, next_v, next_a
    return found


def _without_memory(model: Model, flight: Flight) -> tuple[Sequence[Floats], Model]:
    """Thrust of the rotors after the motor lag has been applied to the whole log, and the model without the lag."""
    return model.late().rotor_thrust(flight.nominal_n, flight.conditions), model.prompt()


def _at(c: Conditions, rows: NDArray[np.int64]) -> Conditions:
    """Conditions at the samples `rows`."""

    def chosen(value: Any) -> Any:
        if isinstance(value, tuple):
            return tuple(chosen(part) for part in value)
        return value[rows] if isinstance(value, np.ndarray) else value

    return Conditions(**{field.name: chosen(getattr(c, field.name)) for field in fields(c)})
