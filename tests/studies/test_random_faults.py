"""Random sequences of faults: none ends unsafely, and the oracle that says so sees a product that is broken.

`make faults-random` flies a thousand.
"""

from collections.abc import Callable
from functools import cache
from pathlib import Path

import pytest

from quadctl.flight.pilot import guards
from quadctl.flight.pilot.landing import Landing
from quadctl.flight.pilot.supervisor import Supervisor
from quadctl.flight.pilot.tick import Decision
from quadctl.flight.record.recorder import Recorder
from quadctl.state import VehicleState
from studies.random_faults import simulated_time
from studies.random_faults.draw import draw
from studies.random_faults.flights import judge

FEW = range(5000, 5003)
MORE = range(5003, 5016)


@pytest.mark.parametrize("seed", FEW)
def test_a_random_sequence_of_faults_ends_safely(seed: int) -> None:
    done = judge(seed)
    assert not done.defects, done


@pytest.mark.long
@pytest.mark.parametrize("seed", MORE)
def test_more_random_sequences_of_faults_end_safely(seed: int) -> None:
    done = judge(seed)
    assert not done.defects, done


def test_a_seed_gives_the_same_flight_again(tmp_path: Path) -> None:
    def flown(name: str) -> tuple[object, ...]:
        (tmp_path / name).mkdir()
        evidence = simulated_time.fly(draw(FEW[0]), tmp_path / name)
        return evidence.sent, evidence.asked, evidence.noted, evidence.ended

    assert flown("once") == flown("again")


def _is_never_silent(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Supervisor, "breach", lambda *_, **__: None)


def _sees_no_defect(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(guards, "defect", lambda *_: None)


def _repeats_its_requests(monkeypatch: pytest.MonkeyPatch) -> None:
    """As MAVSDK does with a command that is not acknowledged."""
    monkeypatch.setattr(simulated_time._Link, "command_once", simulated_time._Link.command)


def _takes_the_mode_back(monkeypatch: pytest.MonkeyPatch) -> None:
    answer = Landing.answer

    def land_all_the_same(self: Landing, breach: guards.Breach, state: VehicleState) -> Decision:
        return answer(self, breach._replace(answer=guards.Answer.HAND_OVER), state)

    monkeypatch.setattr(Landing, "answer", land_all_the_same)
    monkeypatch.setattr(Landing, "_yield", lambda self, state: self._wait_for_mode(state, 0.0))
    monkeypatch.setattr(Supervisor, "mode_is_ours", lambda *_: True)


def _forgets_its_end(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Recorder, "close", lambda self, ended: self._queue.put(None))


sound = cache(judge)
"""The verdict about a seed with the product as it is, to be asked for before anything is broken."""


@pytest.mark.parametrize(
    ("break_it", "seed", "said"),
    [
        (_is_never_silent, 9, "setpoints while the mode was told to be another's"),
        (_sees_no_defect, 8, "setpoints from a position that was 3.2"),
        (_repeats_its_requests, 1044, "s after the release"),
        (_takes_the_mode_back, 19, "s after a person took POSCTL"),
        (_forgets_its_end, 8, "the sidecar says 'in flight' in the end"),
    ],
)
def test_the_oracle_sees_a_product_that_is_broken(
    monkeypatch: pytest.MonkeyPatch, break_it: Callable[[pytest.MonkeyPatch], None], seed: int, said: str
) -> None:
    assert not sound(seed).defects
    break_it(monkeypatch)
    assert any(said in defect for defect in judge(seed).defects)
