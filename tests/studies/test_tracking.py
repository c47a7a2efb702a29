"""The study of tracking: its links, its figures of a track, its margins, and its goals on the mocks."""

import math
from pathlib import Path

import numpy as np
import pytest

from quadctl.effects.catalog import CATALOG
from quadctl.flight.pilot.tick import Stage
from quadctl.state import AttitudeTarget, Setpoint
from studies.autopilots.measured import mock
from studies.tracking import ground, never_worse
from studies.tracking.__main__ import HEAD, judged, open_loops
from studies.tracking.comparison import Results
from studies.tracking.flights import (
    ARDUPILOT,
    BEFORE,
    COURSES,
    FOUND,
    LAWS,
    OWN,
    PX4_GOOD,
    Link,
    Linked,
    Mock,
    Row,
    Track,
    _track,
    fly,
    found_model,
    heavier,
    step_flown,
    unknown_model,
)
from studies.tracking.margins import Complex, Gains, law, margins, sensitivity
from tests.support.links import LEVEL

SHORT = COURSES["figure 8"]._replace(overrides=("laps=1",))


class Flying:
    """Pilot in flight."""

    stage = Stage.FLY


def linked(link: Link, own: bool = False) -> Linked:
    return Linked(mock("ardupilot"), link, Flying(), own, 1)  # type: ignore[arg-type]


def test_a_late_link_tells_its_age_and_delivers_at_its_time() -> None:
    link = linked(Link(delay_s=0.08))
    for tick in range(10):
        state = link.estimate()
        assert state.time_s == pytest.approx(0.02 * tick)
        assert state.age_s("position") == pytest.approx(min(0.08, 0.02 * tick), abs=1e-6)
        assert state.setpoint_delay_s == 0.08
        link.set_attitude_target(AttitudeTarget(LEVEL, 0.01 * tick))
        link.step(0.02 * (tick + 1))
        assert link.target.throttle == pytest.approx(max(0.0, 0.01 * (tick - 4)))


def test_a_lossy_link_loses_its_share_and_keeps_the_last_state() -> None:
    link, ages = linked(Link(loss=0.2)), []
    for tick in range(500):
        ages.append(link.estimate().age_s("position"))
        link.step(0.02 * (tick + 1))
    assert 0.15 < np.mean(np.array(ages) > 0.01) < 0.25


def test_own_control_gets_positions_and_no_attitudes() -> None:
    link = linked(Link(), own=True)
    link.set_attitude_target(AttitudeTarget(LEVEL, 0.9))
    link.step(0.02)
    assert link.target.throttle == 0.0
    link.send(Setpoint((1.0, 2.0, -3.0)))
    link.step(0.04)
    assert link._autopilot._place == Setpoint((1.0, 2.0, -3.0))


def track(east_m: list[float]) -> Track:
    errors = np.column_stack([np.zeros(len(east_m)), east_m, np.zeros(len(east_m))])
    return Track(0.1 * np.arange(len(east_m)), errors, "completed")


def test_a_step_has_an_overshoot_and_a_time_after_which_it_stays() -> None:
    flown = step_flown(track([-1.0, -0.5, -0.05, 0.12, 0.16, 0.09, 0.02]))
    assert flown.overshoot_m == pytest.approx(0.16)
    assert flown.settled_s == pytest.approx(0.5)
    assert math.isinf(step_flown(track([-1.0, -0.5, -0.2])).settled_s)


def test_errors_are_those_at_the_time_of_the_reference_in_the_phases_asked_for() -> None:
    """East at 2 m/s, 0.1 s behind its reference: with the reference's own time, no error, else 0.2 m."""
    rows = [
        Row(
            0.1 * k - 0.1,
            (0.0, 0.2 * (k - 1), 0.0),
            "run" if k > 2 else "hold",
            0.1 * k,
            (0.0, 0.2 * k, 0.0),
        )
        for k in range(10)
    ]
    found = _track(rows, ("run",), "completed")
    assert found.rmse_m == pytest.approx(0.0, abs=1e-12)
    assert len(found.time_s) == 7
    late = _track([row._replace(reference_s=row.time_s) for row in rows], ("run",), "completed")
    assert late.rmse_m == pytest.approx(0.2)


def test_margins_of_an_integrator_with_a_delay_are_those_by_hand() -> None:
    """L = k exp(-T s) / s: gain margin pi / (2 k T), phase margin 90 deg - k T, delay margin pi / (2 k) - T."""
    k, delay_s = 2.0, 0.1

    def open_loop(s: Complex) -> Complex:
        return k * np.exp(-delay_s * s) / s

    found = margins(open_loop)
    assert found.gain == pytest.approx(math.pi / 0.4, rel=1e-3)
    assert found.phase_deg == pytest.approx(90.0 - math.degrees(0.2), rel=1e-3)
    assert found.delay_s == pytest.approx(math.pi / 4.0 - 0.1, rel=1e-3)
    assert found.sensitivity_peak == pytest.approx(1.194, abs=1e-3)


def test_a_loop_of_third_order_has_the_margins_by_hand() -> None:
    """2 / (s + 1)^3: at sqrt(3) rad/s it is -2/8; it is 1 in size where w^2 = 2^(2/3) - 1, at 3 atan(w) = 112.4 deg."""

    def open_loop(s: Complex) -> Complex:
        return 2.0 / (s + 1.0) ** 3

    found = margins(open_loop)
    assert found.gain == pytest.approx(4.0, rel=1e-3)
    assert found.phase_deg == pytest.approx(180.0 - 112.4, abs=0.1)


def test_the_transfer_of_the_law_is_that_of_its_terms() -> None:
    gains = Gains(position_p=1.0, p=2.0, i=0.5, d=0.3, derivative_s=0.05)
    s = np.array([2.0j])
    pid = (2.0 + 0.5 / s) * (1.0 + 1.0 / s) + 0.3 * s / (0.05 * s + 1.0)
    assert law(gains)(s) == pytest.approx(pid)
    led = Gains(1.0, 2.0, 0.5, 0.3, 0.05, error_s=0.03, damps_error=True)
    assert law(led)(s) == pytest.approx(
        (2.0 + 0.5 / s + 0.3 * s / (0.05 * s + 1.0)) * (1.0 + 1.0 / s) / (0.03 * s + 1.0)
    )


def test_every_loop_of_the_page_is_stable_by_far() -> None:
    loops = open_loops()
    assert len(loops) == 6
    for loop in loops.values():
        found = margins(loop)
        assert found.sensitivity_peak < 1.8
        assert found.gain > 3.0
        assert 30.0 < found.phase_deg < 120.0
        assert found.delay_s > 0.2


def test_the_new_gains_reject_more_than_those_before() -> None:
    loops, slow = open_loops(), np.array([0.5])
    for title in (ARDUPILOT.title, PX4_GOOD.title):
        now, before = (sensitivity(loops[title, law_], slow)[0] for law_ in (FOUND, BEFORE))
        assert now < 0.85 * before


def test_goals_are_judged_against_both() -> None:
    errors = dict(zip(LAWS, (0.2, 0.15, 0.09, 0.1), strict=True))
    results = Results(rmse_m={("m", "c", law_): error for law_, error in errors.items()})
    assert list(judged(results, "m", "c")) == ["20.0", "15.0", "9.0", "10.0", "met (0.45)", "**not met** (0.90)"]


def test_every_family_of_the_catalogue_has_a_row_or_a_reason() -> None:
    flown = {effect.family() for effect in never_worse.TRUTHS}
    families = {effect.family() for effect in CATALOG.values()}
    assert flown | never_worse.NOT_FLOWN.keys() == families
    assert not flown & never_worse.NOT_FLOWN.keys()
    assert len(never_worse.TRUTHS) == len(flown)


def test_the_page_says_that_these_are_mocks() -> None:
    assert "These are mocks" in HEAD


@pytest.mark.long
@pytest.mark.parametrize("effect", never_worse.TRUTHS, ids=lambda effect: effect.name)
def test_a_true_model_is_never_worse_than_none(effect: never_worse.Effect) -> None:
    found = never_worse.compare(effect)
    assert not found.alone.worse, found.alone
    assert found.beside_drag is None or not found.beside_drag.worse, found.beside_drag


@pytest.mark.long
@pytest.mark.parametrize("where", [ARDUPILOT, PX4_GOOD], ids=lambda where: where.name)
def test_with_what_the_lab_finds_both_goals_are_met_on_the_figure_8(where: Mock, tmp_path: Path) -> None:
    model, none = found_model(where, tmp_path), unknown_model(where)
    found, before, own = (
        fly(SHORT, where, law_, model if law_ == FOUND else none, 1).rmse_m for law_ in (FOUND, BEFORE, OWN)
    )
    assert found < 0.5 * before
    assert found < 0.8 * own
    for link, load in ((Link(delay_s=0.08), []), (Link(loss=0.2), []), (Link(), heavier(where))):
        flown = fly(SHORT, where, FOUND, model, 1, link, load)
        assert flown.ended == "completed"
        assert flown.rmse_m < 0.5 * before


@pytest.mark.long
def test_the_ground_effect_of_a_step_is_taken_away_in_both_integrals(tmp_path: Path) -> None:
    without, compensated = ground.results(tmp_path, laws=["now"], seeds=[1])
    assert (without.model, compensated.model) == (ground.WITHOUT, ground.WITH)
    assert compensated.m_b_signed < 0.1 * without.m_b_signed
    assert compensated.m_b_absolute < 0.15 * without.m_b_absolute
    assert compensated.swoop_up_m < 0.4 * without.swoop_up_m
