"""The clock of a link tells a delay from a difference of the clocks, however the delay comes and however they run."""

import math
import random
from collections.abc import Callable

import pytest

from quadctl.flight.autopilot.link_clock import LinkClock
from quadctl.flight.autopilot.round_trips import RoundTrips

BOOTED_S = 1000.0
"""Our time at which the autopilot's clock began."""
Delay = Callable[[float], float]
"""Function from our time since the start of a test to a delay, s."""


class Line:
    """A line between us and an autopilot that sends at 100 Hz and answers questions at 10 Hz."""

    def __init__(self, down: Delay, up: Delay, rate: float = 1.0, answers: bool = True) -> None:
        self.clock = LinkClock()
        self.down, self.up, self.rate, self.answers = down, up, rate, answers

    def stamp_s(self, t: float) -> float:
        return self.rate * (BOOTED_S + t) - self.rate * 900.0

    def run(self, seconds: float) -> list[tuple[float, float]]:
        """Delay of each message and of a setpoint, as the clock tells them."""
        arrivals: list[tuple[float, Callable[[], None]]] = []
        told: list[tuple[float, float]] = []

        def message(sent: float, arrives: float) -> None:
            self.clock.sampled_s(self.stamp_s(sent), BOOTED_S + arrives)
            told.append((self.clock.delay_s, self.clock.setpoint_delay_s))

        def answer(sent: float, turns: float, arrives: float) -> None:
            self.clock.exchanged(BOOTED_S + sent, self.stamp_s(turns), BOOTED_S + arrives)

        for i in range(round(100 * seconds)):
            t = 0.01 * i
            arrives = t + self.down(t)
            arrivals.append((arrives, lambda t=t, a=arrives: message(t, a)))
            if i % 10 == 0 and self.answers:
                turns = t + self.up(t)
                back = turns + self.down(turns)
                arrivals.append((back, lambda t=t, turns=turns, b=back: answer(t, turns, b)))
        for _, arrive in sorted(arrivals, key=lambda a: a[0]):
            arrive()
        return told


def constant(delay_s: float) -> Delay:
    return lambda t: delay_s


def growing(rate: float, to_s: float) -> Delay:
    return lambda t: min(0.003 + rate * t, to_s)


def test_a_constant_delay_is_never_forgotten() -> None:
    down, up = Line(constant(0.25), constant(0.25)).run(60.0)[-1]
    assert down == pytest.approx(0.25, abs=0.01)
    assert up == pytest.approx(0.25, abs=0.01)


@pytest.mark.parametrize("rate", [0.005, 0.02, 0.04])
def test_a_delay_that_grows_slowly_is_seen(rate: float) -> None:
    down, up = Line(growing(rate, 0.4), growing(rate, 0.4)).run(100.0)[-1]
    assert down == pytest.approx(0.4, abs=0.02)
    assert up == pytest.approx(0.4, abs=0.02)


@pytest.mark.parametrize(("down_s", "up_s"), [(0.4, 0.003), (0.003, 0.4)])
def test_a_delay_of_one_direction_shows_in_the_sum(down_s: float, up_s: float) -> None:
    """Which direction it is cannot be known when it grows slowly; a setpoint reaches the vehicle as late either way."""
    down, up = Line(growing(0.02, down_s), growing(0.02, up_s)).run(60.0)[-1]
    assert down + up == pytest.approx(0.403, abs=0.02)


@pytest.mark.parametrize("rate", [0.987, 0.991, 1.0, 1.005])
def test_the_rate_of_the_autopilots_clock_is_no_delay(rate: float) -> None:
    told = Line(constant(0.003), constant(0.003), rate).run(120.0)[50:]
    assert max(down + up for down, up in told) < 0.012


def test_without_answers_the_measured_rate_holds() -> None:
    line = Line(constant(0.003), constant(0.003), 0.987)
    line.run(60.0)
    line.clock.sampled_s(line.stamp_s(80.0), BOOTED_S + 80.003)
    assert line.clock.delay_s < 0.03  # 20 s at 13 ms/s would be 0.26


def test_jitter_is_a_delay_of_its_message_alone() -> None:
    chance = random.Random(1)
    told = Line(lambda t: chance.uniform(0.003, 0.04), lambda t: chance.uniform(0.003, 0.04)).run(30.0)[100:]
    assert max(down for down, _ in told) < 0.06
    assert max(up for _, up in told) < 0.04


def test_a_queue_that_empties_at_once_is_old() -> None:
    """A process that was stopped for 3 s reads what has waited, answers to its questions too."""
    line = Line(lambda t: max(13.0 - t, 0.003) if t > 10.0 else 0.003, constant(0.003))
    told = line.run(10.5)
    assert told[999][0] < 0.01
    assert told[1001][0] == pytest.approx(2.99, abs=0.05)


def test_without_round_trips_only_a_sudden_delay_is_seen() -> None:
    line = Line(lambda t: 0.25 if t < 20.0 else 0.55, constant(0.25), answers=False)
    told = line.run(20.1)
    assert told[1900][0] < 0.01
    assert told[2001][0] == pytest.approx(0.3, abs=0.02)
    assert not line.clock.measured
    assert line.clock.setpoint_delay_s == 0.0


def test_a_restart_is_seen_and_the_new_clock_is_measured_anew() -> None:
    clock = LinkClock()
    clock.sampled_s(500.0, 10.0)
    clock.exchanged(10.0, 500.0, 10.1)
    clock.sampled_s(0.5, 11.0)
    assert clock.restarts == 1
    assert not clock.measured
    clock.exchanged(11.0, 0.75, 11.5)
    assert clock.sampled_s(1.0, 11.75) == pytest.approx(11.5)
    assert clock.restarts == 1


def test_messages_out_of_order_are_no_restart() -> None:
    clock = LinkClock()
    for stamp_s in (5.0, 5.2, 5.1, 5.3):
        clock.sampled_s(stamp_s, 10.0 + stamp_s)
    assert clock.restarts == 0


def test_answers_from_another_clock_than_that_of_the_messages_are_not_used() -> None:
    clock = LinkClock()
    clock.sampled_s(500.0, 10.0)
    clock.exchanged(10.0, 1.7e9, 10.1)
    assert not clock.measured


class TestRoundTrips:
    def test_an_answer_ends_the_question_that_it_repeats(self) -> None:
        trips = RoundTrips()
        question = trips.question(12.5)
        trip = trips.answered({"tc1": 7_000_000_000, "ts1": question["ts1"]}, 12.75)
        assert trip == pytest.approx((12.5, 7.0, 12.75))

    def test_a_second_answer_a_strange_one_and_a_question_of_the_autopilot_are_none(self) -> None:
        trips = RoundTrips()
        question = trips.question(12.5)
        assert question["tc1"] == 0
        assert trips.answered({"tc1": 0, "ts1": question["ts1"]}, 12.6) is None
        assert trips.answered({"tc1": 7, "ts1": 99}, 12.6) is None
        assert trips.answered({"tc1": 7, "ts1": question["ts1"]}, 12.6) is not None
        assert trips.answered({"tc1": 7, "ts1": question["ts1"]}, 12.7) is None


def test_before_the_first_message_there_is_no_delay() -> None:
    clock = LinkClock()
    assert clock.delay_s == 0.0
    assert math.isfinite(clock.sampled_s(1.0, 2.0))
