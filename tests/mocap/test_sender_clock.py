"""A pose is late by what it took longer than usual, whatever the sender's clock does in the long run."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from quadctl.mocap.findings import Kind
from quadctl.mocap.gate import STALE_S, WINDOW_S, Gate, Pose, SenderClock

RATE_HZ = 20.0
DELAY_S = 0.01


def lateness(n: int, stamp_s: list[float], delay_s: list[float]) -> list[float]:
    """Lateness of poses that leave every 1/RATE_HZ, stamped and delayed so."""
    clock = SenderClock()
    return [clock.late_s(stamp_s[i], i / RATE_HZ + delay_s[i]) for i in range(n)]


def seconds(duration_s: float) -> int:
    return round(duration_s * RATE_HZ)


@given(st.floats(-1e6, 1e6), st.floats(-0.01, 0.01))
def test_a_clock_that_drifts_by_a_percent_makes_no_pose_stale(offset_s: float, drift: float) -> None:
    n = seconds(60.0)
    late_s = lateness(n, [offset_s + (1.0 + drift) * i / RATE_HZ for i in range(n)], [DELAY_S] * n)
    assert max(late_s) < STALE_S


def test_fifty_ppm_in_half_an_hour_make_no_pose_stale() -> None:
    n = seconds(1800.0)
    assert max(lateness(n, [(1.0 - 50e-6) * i / RATE_HZ for i in range(n)], [DELAY_S] * n)) < 0.001


@given(st.floats(-3600.0, 3600.0), st.integers(1, 200))
def test_a_clock_that_is_set_or_stands_still_makes_poses_stale_for_the_window_at_most(step_s: float, at: int) -> None:
    n = at + seconds(WINDOW_S) + 100
    late_s = lateness(n, [i / RATE_HZ + (step_s if i >= at else 0.0) for i in range(n)], [DELAY_S] * n)
    assert all(late == pytest.approx(0.0, abs=1e-6) for late in late_s[:at] + late_s[at + seconds(WINDOW_S) + 2 :])
    assert late_s[at] == pytest.approx(max(-step_s, 0.0), abs=1e-6)


@given(st.lists(st.floats(0.0, 0.5), min_size=2, max_size=200))
def test_lateness_is_the_delay_above_the_least_of_the_window(delay_s: list[float]) -> None:
    arrivals_s = sorted(i / RATE_HZ + delay for i, delay in enumerate(delay_s))  # none overtakes another
    clock, seen = SenderClock(), []
    for i, arrival_s in enumerate(arrivals_s):
        late_s = clock.late_s(i / RATE_HZ, arrival_s)
        seen.append((arrival_s, arrival_s - i / RATE_HZ))
        least_s = min(difference for at_s, difference in seen if at_s >= arrival_s - WINDOW_S)
        assert late_s == pytest.approx(seen[-1][1] - least_s, abs=1e-9)
        assert late_s >= 0.0


@given(st.floats(0.03, 1.0))
def test_a_delay_that_grows_is_noticed(growth: float) -> None:
    n = seconds(6.0)
    late_s = lateness(n, [i / RATE_HZ for i in range(n)], [growth * i / RATE_HZ for i in range(n)])
    assert max(late_s) > STALE_S


def test_poses_pass_the_gate_again_after_the_senders_clock_was_set_back() -> None:
    gate, objections = Gate(), []
    for i in range(seconds(20.0)):
        at_s = i / RATE_HZ
        sent_s = at_s - (0.5 if at_s >= 10.0 else 0.0)
        pose = Pose("raptor", at_s, (0.001 * i, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0), sent_s)
        objections.append(gate.objection(pose, at_s))
    stale = [i for i, objection in enumerate(objections) if objection is Kind.STALE]
    assert 0 < len(stale) <= seconds(WINDOW_S) + 1
    assert set(objections[stale[-1] + 1 :]) == {None}
