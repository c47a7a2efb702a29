"""Runs, steps on the way, swoops and figures of 8 against values worked out by hand; and all trajectories alike."""

import math
from itertools import pairwise
from pathlib import Path

import pytest

from quadctl.missions import load_mission
from quadctl.missions.profile import sampled
from quadctl.settings import validate
from quadctl.state import Vec3
from quadctl.trajectories import Reference
from quadctl.trajectories.figure8 import Figure8
from quadctl.trajectories.run import Run
from quadctl.trajectories.step_run import StepRun
from quadctl.trajectories.swoop import Swoop
from tests.support.places import ROOT

MISSIONS = sorted((ROOT / "missions").glob("*.yaml"))
START: Vec3 = (-2.0, 0.0, 1.2)


def test_a_run_is_flown_by_velocity_along_its_way_and_holds_its_place_at_the_end() -> None:
    """4 m at 1 m/s with 2 m/s^2: ramps of 0.5 s, 4.5 s in all."""
    run = validate({"to_m": [2, 0, 1.2], "speed_m_s": 1.0, "hold_s": 2.0}, Run, "test")
    assert run.duration_s(START) == pytest.approx(6.5)
    cruise = run.reference(2.0, START)
    assert cruise.velocity_m_s == pytest.approx((1, 0, 0))
    assert cruise.by_velocity == (True, False, False)
    assert run.reference(4.6, START) == Reference((2, 0, 1.2))
    diagonal = validate({"to_m": [2, 3, 2.2]}, Run, "test").reference(1.0, START)
    assert diagonal.by_velocity == (True, True, False)


def test_the_height_steps_on_the_way_while_the_run_goes_on() -> None:
    """A level run of 4 m at 1 m/s; 1.5 m are behind after 0.5 s of ramp (0.25 m) and 1.25 s at speed."""
    step = validate({"to_m": [2, 0, 0.2], "step_after_m": 1.5, "speed_m_s": 1.0, "hold_s": 1.0}, StepRun, "test")
    assert step.duration_s(START) == pytest.approx(5.5)
    before, after = step.reference(1.74, START), step.reference(1.76, START)
    assert (before.position_m[2], after.position_m[2]) == (1.2, 0.2)
    assert before.velocity_m_s == after.velocity_m_s == pytest.approx((1, 0, 0))
    assert after.by_velocity == (True, False, False)
    assert step.end_m(START) == (2, 0, 0.2)
    late = validate({"to_m": [2, 0, 0.2], "step_after_m": 99, "speed_m_s": 1.0}, StepRun, "test")
    assert late.end_m(START) == (2, 0, 0.2)


def test_a_swoop_is_lowest_half_way_and_ends_at_the_height_where_it_began() -> None:
    """4 m at 1 m/s: half way at 2.25 s, where z'' = depth (2 pi / length)^2 / 2 v^2 = (pi / 2)^2 / 2."""
    swoop = validate({"to_m": [2, 0, 0.2], "speed_m_s": 1.0, "hold_s": 1.0}, Swoop, "test")
    assert swoop.duration_s(START) == pytest.approx(5.5)
    lowest = swoop.reference(2.25, START)
    assert lowest.position_m == pytest.approx((0, 0, 0.2))
    assert lowest.velocity_m_s == pytest.approx((1, 0, 0))
    assert lowest.acceleration_m_s2 == pytest.approx((0, 0, 0.5 * (math.pi / 2) ** 2))
    assert swoop.reference(5.0, START) == Reference((2, 0, 1.2))
    assert swoop.lifted(1.0).to_m == (2, 0, 1.2)


def test_a_figure_8_crosses_its_middle_and_returns_to_it() -> None:
    """At full speed the angle turns by 2 pi in 8 s; the middle is crossed at (north w, 2 east w)."""
    eight = validate({"north_m": 1.5, "east_m": 0.75, "lap_s": 8, "laps": 2, "fade_s": 2}, Figure8, "test")
    centre = (1.0, 2.0, 0.5)
    whole = eight.duration_s(centre)
    assert whole == pytest.approx(2 * 8 + 2)  # each fade takes half of its time more
    assert eight.reference(0.0, centre) == eight.reference(whole, centre) == Reference(centre)
    middle, rate = eight.reference(whole / 2, centre), 2 * math.pi / 8
    assert middle.position_m == pytest.approx(centre)
    assert middle.velocity_m_s == pytest.approx((1.5 * rate, 1.5 * rate, 0))
    places = [eight.reference(whole * i / 500, centre).position_m for i in range(501)]
    assert max(abs(x - 1.0) for x, _, _ in places) == pytest.approx(1.5, abs=0.01)
    assert max(abs(y - 2.0) for _, y, _ in places) == pytest.approx(0.75, abs=0.01)


@pytest.mark.parametrize("path", MISSIONS, ids=lambda path: path.stem)
def test_velocity_and_acceleration_are_derivatives_in_every_mission(path: Path) -> None:
    """In mid-phase, where no corner is near: by central differences over 2 ms."""
    h = 1e-3
    compared = 0
    for phase in load_mission(path).phases:
        for share in (0.11, 0.23, 0.37, 0.52, 0.68):
            t = share * (phase.end_s - phase.start_s)
            before, here, after = (phase.trajectory.reference(t + dt, phase.start_m) for dt in (-h, 0.0, h))
            if math.dist(before.acceleration_m_s2, after.acceleration_m_s2) > 0.1 or t < h:
                continue  # a corner of a trapezoid
            for i in range(3):
                slope = (after.position_m[i] - before.position_m[i]) / (2 * h)
                bend = (after.velocity_m_s[i] - before.velocity_m_s[i]) / (2 * h)
                assert here.velocity_m_s[i] == pytest.approx(slope, abs=1e-3)
                assert here.acceleration_m_s2[i] == pytest.approx(bend, abs=1e-2)
                compared += 1
    assert compared > 3


@pytest.mark.parametrize("path", MISSIONS, ids=lambda path: path.stem)
def test_only_steps_and_staircases_jump(path: Path) -> None:
    mission = load_mission(path)
    for phase, samples in zip(mission.phases, sampled(mission), strict=True):
        jumps = [sample.time_s for sample in samples if sample.jump_m != (0.0, 0.0, 0.0)]
        assert bool(jumps) == (phase.trajectory.kind in ("step", "step_run", "staircase")), phase.name
    assert all(a.end_s == b.start_s and b.start_m == a.trajectory.end_m(a.start_m) for a, b in pairwise(mission.phases))
