"""States that do not follow from those before them, and messages that are older than their arrival."""

import math
import random
from collections.abc import Iterable, Iterator
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from quadctl.flight.autopilot.link_clock import LinkClock
from quadctl.flight.pilot.continuity import Continuity, ContinuityLimits
from quadctl.flight.pilot.reasons import Kind, Reason
from quadctl.frames import quaternion_from_euler
from quadctl.state import NO_VECTOR, Vec3, VehicleState

LIMITS = ContinuityLimits(
    max_frozen_s=0.5, max_position_jump_m=0.5, max_velocity_jump_m_s=2.0, max_attitude_jump_deg=30.0
)
TICK_S = 0.02


def state(
    t: float,
    position: Vec3 = (0.0, 0.0, -1.0),
    velocity: Vec3 = (0.0, 0.0, 0.0),
    roll: float = 0.0,
    sampled: float | None = None,
) -> VehicleState:
    at = t if sampled is None else sampled
    return VehicleState(
        time_s=t,
        position_ned_m=position,
        velocity_ned_m_s=velocity,
        attitude=quaternion_from_euler(roll, 0.0, 0.0),
        rates_rad_s=(0.0, 0.0, 0.0),
        received_s={"position": at, "attitude": at},
    )


def first_defect(states: Iterable[VehicleState], limits: ContinuityLimits = LIMITS) -> tuple[float, Reason] | None:
    watch = Continuity(limits)
    for s in states:
        problem = watch.defect(s)
        if problem is not None:
            return s.time_s, problem
    return None


def moving(seconds: float, step_s: float = TICK_S) -> Iterator[VehicleState]:
    """Flies about with the noise of a good estimator."""
    noise = random.Random(1)
    for i in range(int(seconds / step_s)):
        t = i * step_s
        w = 3.0
        yield state(
            t,
            (2.0 * math.sin(w * t) + noise.gauss(0.0, 1e-3), 0.0, -1.0),
            (2.0 * w * math.cos(w * t) + noise.gauss(0.0, 0.01), 0.0, 0.0),
            0.5 * math.sin(w * t) + noise.gauss(0.0, 1e-3),
        )


@pytest.mark.parametrize("step_s", [0.01, 0.02, 0.1, 0.2])
def test_a_lively_flight_is_let_through_at_every_rate(step_s: float) -> None:
    assert first_defect(moving(20.0, step_s)) is None


@pytest.mark.parametrize("update_s", [0.1, 0.2, 0.4])
def test_an_estimate_that_is_updated_seldom_is_not_frozen(update_s: float) -> None:
    """The stream repeats each value with a new time stamp."""
    held = list(moving(10.0, update_s))
    seen = (
        replace(held[int(t / update_s)], time_s=t, received_s={"position": t, "attitude": t})
        for t in (0.02 * i for i in range(490))
    )
    assert first_defect(seen) is None


def test_a_quantised_hover_is_not_frozen() -> None:
    """Millimetres, as of a motion capture that is not filtered: some component moves within half a second."""
    noise = random.Random(2)

    def rounded(t: float) -> VehicleState:
        x, y, z = (round(noise.gauss(0.0, 0.0005), 3) for _ in range(3))
        return state(t, (x, y, z - 1.0), (0.0, 0.0, 0.0), round(noise.gauss(0.0, 0.001), 3))

    assert first_defect(rounded(i * TICK_S) for i in range(3000)) is None


@pytest.mark.parametrize("part", ["position", "attitude"])
def test_the_same_values_for_longer_than_the_limit_are_frozen(part: str) -> None:
    def stuck(s: VehicleState, i: int) -> VehicleState:
        if i < 50:
            return s
        kept = frozen[49]
        if part == "position":
            return replace(s, position_ned_m=kept.position_ned_m, velocity_ned_m_s=kept.velocity_ned_m_s)
        return replace(s, attitude=kept.attitude, rates_rad_s=kept.rates_rad_s)

    frozen = list(moving(3.0))
    found = first_defect(stuck(s, i) for i, s in enumerate(frozen))
    assert found is not None
    assert found[0] == pytest.approx(49 * TICK_S + 0.5, abs=1.5 * TICK_S)
    assert (found[1].kind, found[1].facts["part"]) == (Kind.FROZEN, part)
    assert first_defect((stuck(s, i) for i, s in enumerate(frozen)), ContinuityLimits(max_frozen_s=0.0)) is None


def test_an_attitude_without_rates_can_be_frozen_too() -> None:
    still = (replace(s, rates_rad_s=NO_VECTOR, attitude=(1.0, 0.0, 0.0, 0.0)) for s in moving(3.0))
    found = first_defect(still)
    assert found is not None
    assert (found[1].kind, found[1].facts["part"]) == (Kind.FROZEN, "attitude")


def test_messages_that_stop_are_not_frozen_but_old() -> None:
    """That is the guard of the age, which is faster."""
    assert first_defect(state(i * TICK_S, sampled=0.0) for i in range(100)) is None


@given(
    jump=st.floats(0.0, 5.0),
    speed=st.floats(-8.0, 8.0),
    dt=st.sampled_from([0.01, 0.02, 0.1, 0.2]),
)
def test_a_position_may_move_by_its_velocity_and_the_margin(jump: float, speed: float, dt: float) -> None:
    before = state(0.0, (0.0, 0.0, -1.0), (speed, 0.0, 0.0))
    after = state(dt, (speed * dt + jump, 0.0, -1.0), (speed, 0.0, 0.0), 0.001)
    found = first_defect([before, after])
    if abs(jump - 0.5) > 1e-6:
        assert (found is not None) == (jump > 0.5)


def test_a_velocity_may_change_by_4_g_and_the_margin() -> None:
    for to, broken in ((2.7, False), (2.9, True)):
        found = first_defect([state(0.0), state(0.02, velocity=(to, 0.0, 0.0))])
        assert (found is not None) == broken


def test_an_attitude_may_turn_by_10_rad_s_and_the_margin() -> None:
    for to_deg, broken in ((41.0, False), (42.0, True), (-42.0, True)):
        found = first_defect([state(0.0), state(0.02, roll=math.radians(to_deg))])
        assert (found is not None) == broken
    turned = replace(state(0.02), attitude=(-1.0, 0.0, 0.0, 0.0))
    assert first_defect([state(0.0), turned]) is None  # the same attitude by its other quaternion


# --- the autopilot's clock -------------------------------------------------------------------------------------------


def test_a_message_is_as_old_as_its_stamp_says() -> None:
    clock = LinkClock()
    for i in range(100):
        assert clock.sampled_s(5.0 + 0.01 * i, 100.0 + 0.01 * i) == pytest.approx(100.0 + 0.01 * i)
    # The process was stopped for 3 s; the queue holds what came in its first second.
    ages = [104.0 - clock.sampled_s(6.0 + 0.01 * i, 104.0) for i in range(100)]
    assert ages[0] == pytest.approx(3.0, abs=0.2)
    assert min(ages) > 1.8
    assert 104.0 - clock.sampled_s(9.0, 104.0) == pytest.approx(0.0, abs=0.01)


@pytest.mark.parametrize("rate", [0.96, 0.9999, 1.0, 1.0001, 1.04, 4.0])
def test_another_pace_of_the_clocks_is_not_an_age(rate: float) -> None:
    """Crystals differ by 1e-4; a simulator may run at another pace than real time."""
    clock = LinkClock()
    ages = [0.01 * i - clock.sampled_s(7.0 + rate * 0.01 * i, 0.01 * i) for i in range(100_000)]
    assert max(ages) < 0.01


def test_a_clock_that_begins_anew_is_a_restart() -> None:
    clock = LinkClock()
    clock.sampled_s(50.0, 100.0)
    clock.sampled_s(49.9, 100.01)  # overtaken on the way
    assert clock.restarts == 0
    assert clock.sampled_s(0.3, 101.0) == 101.0
    assert clock.restarts == 1
