"""Distinction of a step from a flight whose regime changes: speeds and tilts before and after a moment."""

from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from quadctl.lab.flights.flight import Flight
from quadctl.lab.selection.coincidence import LEAST_OVERLAP, overlap

TIME_S = np.arange(0.0, 60.0, 0.25)


def wandering(seed: int, size: float) -> np.ndarray:
    """A signal that never repeats itself, of about this size."""
    random = np.random.default_rng(seed)
    waves = ((f, random.uniform(0.0, 6.3)) for f in (0.17, 0.31, 0.53, 0.83))
    return size * np.sum([np.sin(f * TIME_S + phase) for f, phase in waves], axis=0) / 2.0


def flight(moving: np.ndarray) -> Flight:
    """A flight whose speeds and tilts are those of a wandering one times `moving`, shape (n,)."""
    sizes = {"speed_forward": 2.0, "speed_right": 2.0, "climb_rate": 1.5, "roll": 8.0, "pitch": 8.0}
    variables = {name: moving * wandering(i, size) for i, (name, size) in enumerate(sizes.items())}
    return cast(Flight, SimpleNamespace(time_s=TIME_S, variables=variables))


@pytest.mark.parametrize("moment_s", [20.0, 31.0, 40.0])
def test_a_flight_that_never_repeats_itself_tells_a_step(moment_s: float) -> None:
    assert overlap(flight(np.ones(len(TIME_S))), moment_s) > 1.5 * LEAST_OVERLAP


@pytest.mark.parametrize("moment_s", [20.0, 31.0, 40.0])
def test_a_hover_before_a_cruise_does_not(moment_s: float) -> None:
    assert overlap(flight(np.where(moment_s > TIME_S, 0.05, 1.0)), moment_s) < LEAST_OVERLAP
