"""Padding of flights with different lengths and numbers of rotors into arrays of one batch."""

from collections.abc import Callable

import numpy as np

from studies.worlds.field.arrays import Floats
from studies.worlds.field.cases import Case


def per_flight(cases: list[Case], value: Callable[[Case], float]) -> Floats:
    """One number of each case, shape (flights,)."""
    return np.array([value(case) for case in cases], dtype=np.float64)


def per_rotor(cases: list[Case], value: Callable[[Case], Floats]) -> Floats:
    """Arrays (rotors, ...) of each case, padded with zeros to (flights, most rotors, ...)."""
    values = [value(case) for case in cases]
    out = np.zeros((len(cases), max(len(array) for array in values), *values[0].shape[1:]))
    for row, array in enumerate(values):
        out[row, : len(array)] = array
    return out


def over_time(arrays: list[Floats], samples: int) -> Floats:
    """Arrays (time, ...) of different length as (samples, flights, ...), the last value repeated."""
    return np.stack(
        [np.concatenate([a, np.repeat(a[-1:], max(samples - len(a), 0), axis=0)])[:samples] for a in arrays], axis=1
    )


def approach(step_s: float, time_s: Floats) -> Floats:
    """Share of the way that a first-order filter goes in one step, as a column."""
    return np.asarray(1.0 - np.exp(-step_s / np.maximum(time_s, 1e-4)))[:, None]


class Signal:
    """Random or reference signal of a batch between equidistant samples, linear in time."""

    def __init__(self, arrays: list[Floats], step_s: float, duration_s: float) -> None:
        """Pad the arrays to the longest flight."""
        self._step_s = step_s
        self._values = over_time(arrays, int(np.ceil(duration_s / step_s)) + 3)

    def at(self, time_s: float) -> Floats:
        """Value of all flights at this time."""
        place, part = divmod(time_s / self._step_s, 1.0)
        before = self._values[int(place)]
        value: Floats = before + part * (self._values[int(place) + 1] - before)
        return value
