"""Step responses flown with different compensators, and what they say."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from enum import unique
from pathlib import Path

import numpy as np

from quadctl.errors import LogError
from quadctl.lab.comparison.wording import change_in_words, plus
from quadctl.lab.tracking.metrics import FlightMetrics, MetricsTable, Tracking, Window, tracking
from quadctl.logs.flight_log import FlightLog
from quadctl.words import Fact, Kinds, Words, fact


@dataclass(frozen=True, eq=False)
class StepResponses:
    """Step responses flown with different compensators; the first is the one that the others are compared with."""

    tracks: dict[str, Tracking]
    """By the name that the page gives them, in the order of the table's flights, reference flights last."""
    table: MetricsTable

    @property
    def flown(self) -> dict[str, FlightMetrics]:
        """Metrics of all flights that are no reference flights, by name."""
        pairs = zip(self.tracks, self.table.flights, strict=True)
        return {name: flight for name, flight in pairs if not flight.is_reference}

    @property
    def on_one_reference(self) -> dict[str, Tracking]:
        """All tracks, those flown elsewhere (out of ground effect) shifted to the reference of the first."""
        first = next(iter(self.tracks.values()))
        shown = {}
        for name, track in self.tracks.items():
            reference = np.interp(track.time_s, first.time_s, first.reference_m)
            shown[name] = replace(track, reference_m=reference, position_m=reference + track.error_m)
        return shown


def step_responses(logs: Mapping[str, FlightLog], table: MetricsTable, window: Window | None = None) -> StepResponses:
    """Step responses by name, with their metrics; `logs` in the order of the table's flights, over the same window.

    Raises
    ------
    LogError
        The logs are not those of the table, or one lacks the window.
    """
    names = [log.name for log in logs.values()]
    expected = [flight.flight for flight in table.flights]
    if names != expected:
        raise LogError(f"the step responses are {', '.join(names)}, expected those measured: {', '.join(expected)}")
    tracks = {_stem(name): tracking(log, window or Window(), table.axis) for name, log in logs.items()}
    return StepResponses(tracks, table)


def first_and_last(steps: StepResponses) -> tuple[tuple[str, FlightMetrics], tuple[str, FlightMetrics]] | None:
    flown = list(steps.flown.items())
    return (flown[0], flown[-1]) if len(flown) > 1 else None


_WORDS = Words({"plus": plus, "change": lambda pair: change_in_words(1.0 - abs(pair[1]) / abs(pair[0]))})


@unique
class Said(Kinds, words=_WORDS):
    """Effects of the ground and of the step on two flights, each with its template."""

    GROUND = (
        "From compensator '{first}' to '{last}', what the ground does to the flight (M_B) goes from {absolute[0]:.3f} "
        "to {absolute[1]:.3f} m s in the absolute integral ({absolute:change}) and from {signed[0]:plus} to "
        "{signed[1]:plus} m s in the signed one ({signed:change} in size)."
    )
    ERROR = (
        "The tracking error goes from {rmse_mm[0]:.1f} to {rmse_mm[1]:.1f} mm (RMSE); that includes the step itself, "
        "which no compensator makes shorter."
    )


def effect_of_the_ground(steps: StepResponses) -> list[Fact]:
    """Effect of the ground on the first and on the last flight, and their tracking errors; none of a single flight."""
    pair = first_and_last(steps)
    if pair is None:
        return []
    (first_name, first), (last_name, last) = pair
    found = []
    if first.m_b_absolute and first.m_b_signed and last.m_b_absolute is not None and last.m_b_signed is not None:
        absolute, signed = (first.m_b_absolute, last.m_b_absolute), (first.m_b_signed, last.m_b_signed)
        found.append(fact(Said.GROUND, first=first_name, last=last_name, absolute=absolute, signed=signed))
    return [*found, fact(Said.ERROR, rmse_mm=(1000.0 * first.rmse_m, 1000.0 * last.rmse_m))]


def _stem(name: str) -> str:
    """A compensator as a person calls it: a model file by its name without folder and ending."""
    return Path(name).stem if name.endswith((".yaml", ".yml")) else name
