"""One flight of a seed, flown and judged."""

import tempfile
from pathlib import Path
from typing import NamedTuple

from . import real_time, simulated_time
from .draw import draw
from .oracle import defects


class Judged(NamedTuple):
    """A flight and its judgement."""

    seed: int
    flown: str
    """The sequence, in words."""
    ended: str
    answers: tuple[str, ...]
    autopilot: str
    has_begun: bool
    defects: tuple[str, ...]


def judge(seed: int, kind: str = "simulated") -> Judged:
    """Fly the sequence of a seed, in simulated time or over MAVLink, and judge it."""
    sequence = draw(seed)
    fly = real_time.fly if kind == "mavlink" else simulated_time.fly
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:  # a broken product may write on
        evidence = fly(sequence, Path(folder))
    answers = tuple(dict.fromkeys(n.answer for n in evidence.noted if n.answer))
    ended = evidence.ended if evidence.outcome is None else evidence.outcome
    found = tuple(defects(evidence))
    return Judged(seed, str(sequence), ended, answers, sequence.autopilot, evidence.has_begun, found)
