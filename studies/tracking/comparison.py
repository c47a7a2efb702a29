"""All flights of the comparison: every course, mock and law, the step, and the robustness."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from quadctl.effects import Effect
from quadctl.logs.flight_log import Floats
from quadctl.model import Model

from .flights import (
    ADDED_DELAY_S,
    ARDUPILOT,
    BEFORE,
    COURSES,
    FOUND,
    LAWS,
    LOSS,
    MOCKS,
    OWN,
    PERFECT,
    PX4_GOOD,
    SEEDS,
    STEP,
    Course,
    Link,
    Mock,
    StepFlown,
    Track,
    fly,
    found_model,
    heavier,
    step_flown,
    unknown_model,
)

SHOWN = "figure 8"
"""Course of the robustness and of the figure."""
ROBUST_MOCKS = (ARDUPILOT, PX4_GOOD)
DELAYED, HEAVIER, LOSSY = "80 ms more each way", "mass +15 %", "20 % lost"
DEFECTS = {DELAYED: Link(delay_s=ADDED_DELAY_S), HEAVIER: PERFECT, LOSSY: Link(loss=LOSS)}
HALF, BEATEN = 0.5, 0.8
"""Largest share of the error of the law before, and of the autopilot's own control, that may be left."""

Key = tuple[str, str, str]
"""Title of a mock, name of a course or defect, law."""


@dataclass
class Results:
    """Everything that is flown for the tables and the figure."""

    rmse_m: dict[Key, float] = field(default_factory=dict)
    steps: dict[tuple[str, str], StepFlown] = field(default_factory=dict)
    """By mock and law: mean overshoot, and the longest time."""
    errors: dict[tuple[str, str], tuple[Floats, Floats]] = field(default_factory=dict)
    """By mock and law: time and length of the error on the course that is shown."""
    models: dict[str, Model] = field(default_factory=dict)
    """By mock: what the lab found."""
    broken_off: list[str] = field(default_factory=list)
    """Flights that did not end by themselves, with the reason."""

    def is_met(self, mock: str, course: str) -> tuple[bool, bool]:
        """True where the goals against the law before and against the autopilot's own are met."""
        found, before, own = (self.rmse_m[mock, course, law] for law in (FOUND, BEFORE, OWN))
        return found <= HALF * before, found <= BEATEN * own


def compared(folder: Path) -> Results:
    """Fly all; logs go to `folder`."""
    results = Results()
    for where in MOCKS:
        results.models[where.title] = found_model(where, folder)
        for law in LAWS:
            for name, course in COURSES.items():
                tracks = list(_tracks(results, folder, course, name, where, law))
                results.rmse_m[where.title, name, law] = together(tracks)
                if name == SHOWN:
                    results.errors[where.title, law] = tracks[0].time_s, np.linalg.norm(tracks[0].error_m, axis=1)
            steps = [step_flown(track) for track in _tracks(results, folder, STEP, "step", where, law)]
            mean_m = sum(step.overshoot_m for step in steps) / len(steps)
            results.steps[where.title, law] = StepFlown(mean_m, max(step.settled_s for step in steps))
    for where in ROBUST_MOCKS:
        for name, link in DEFECTS.items():
            load = heavier(where) if name == HEAVIER else []
            for law in LAWS:
                tracks = list(_tracks(results, folder, COURSES[SHOWN], name, where, law, link, load))
                results.rmse_m[where.title, name, law] = together(tracks)
    return results


def _tracks(
    results: Results,
    folder: Path,
    course: Course,
    name: str,
    where: Mock,
    law: str,
    link: Link = PERFECT,
    load: list[Effect] | None = None,
) -> Iterator[Track]:
    """Tracks of all seeds, those that were broken off noted."""
    model = found_model(where, folder) if law == FOUND else unknown_model(where)
    for seed in SEEDS:
        track = fly(course, where, law, model, seed, link, load or [])
        if track.ended != "completed":
            results.broken_off.append(f"{where.title}, {name}, {law}, seed {seed}: {track.ended}")
        yield track


def together(tracks: list[Track]) -> float:
    """RMSE over several flights."""
    return math.sqrt(sum(track.rmse_m**2 for track in tracks) / len(tracks))
