"""The fault table: `python -m studies.faults`, or `make faults`; writes docs/faults.md."""

import argparse
import math
import re
import sys
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console

from studies.page import DOCS

from .cases import CASES
from .flights import JOBS, Verdict, fly_all
from .scene import PROFILES

ADDRESS = re.compile(r" \(system \d+\) at \S+")
"""Address of the simulated autopilot in a message: another one in every flight."""
PAGE = DOCS / "faults.md"
HEAD = """# Faults

Written by `make faults`. Every fault begins in a hover at 0.5 m, in real time over MAVLink, on the
[simulated autopilots](autopilots.md). [Safety](safety.md) explains the answers. In no flight is a setpoint sent that is
not a number or beyond the limits, and none after the last one of this table. Limits are those of `config/flight.yaml`,
with a battery guarded at 13.5 V. The vehicle is RAPTOR; rows with six motors or rotors fly the F550.

The figures are seconds after the fault began: the last setpoint (*before* the fault), and at rest on the ground. In
rows about a person, that person lands the vehicle. Real autopilots are slower: a PX4 needed 5 to 9 s from 1.5 m to the
ground and 2 to 4 s more to disarm, an ArduPilot's failsafe 4 s more than a landing that was asked for. With one of four
motors at half its pulse a real ArduPilot was on the ground after 1.1 s at 3.2 m/s, and stayed armed in LAND for 85 s.

| fault | answer | PX4 | ArduPilot |
|---|---|---|---|
"""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--only", default="", help="faults whose name contains this; the page is not written")
    parser.add_argument("--autopilot", choices=PROFILES, action="append", help="may be repeated; all without it")
    parser.add_argument("--jobs", type=int, default=JOBS)
    parser.add_argument("--out", type=Path, default=PAGE)
    options = parser.parse_args()
    faults = [case.name for case in CASES if options.only in case.name]
    console = Console(width=160)
    verdicts = []
    pairs = [(fault, autopilot) for fault in faults for autopilot in options.autopilot or PROFILES]
    for verdict in fly_all(pairs, options.jobs):
        verdicts.append(verdict)
        console.print(row(verdict), markup=False, highlight=False, soft_wrap=True)
        for sentence in verdict.wrong:
            console.print(f"    {sentence}", style="red", markup=False, highlight=False, soft_wrap=True)
    if not options.only and options.autopilot is None:
        options.out.write_text(page(sorted(verdicts, key=lambda v: pairs.index((v.fault, v.autopilot)))))
    sys.exit(any(verdict.wrong for verdict in verdicts))


def page(verdicts: Sequence[Verdict]) -> str:
    """Page with a row for each fault."""
    faults = dict.fromkeys(verdict.fault for verdict in verdicts)
    return HEAD + "".join(line([v for v in verdicts if v.fault == fault]) + "\n" for fault in faults)


def line(verdicts: Sequence[Verdict]) -> str:
    """Row of the page: one fault on both autopilots."""
    answers = " / ".join(dict.fromkeys(answers_of(verdict) for verdict in verdicts))
    times = " | ".join(f"{last_setpoint(verdict)}, {at_rest(verdict)}" for verdict in verdicts)
    again = f" (attempt {attempts})" if (attempts := max(v.attempts for v in verdicts)) > 1 else ""
    return f"| {verdicts[0].fault}{again} | {answers} | {times} |"


def answers_of(verdict: Verdict) -> str:
    answers = dict.fromkeys(answer for _, answer in verdict.seen.events if answer)
    return ", ".join(answers) or "none: the process is gone"


def last_setpoint(verdict: Verdict) -> str:
    return f"{verdict.seen.last_setpoint_s:.2f}" if verdict.seen.setpoints else "before"


def at_rest(verdict: Verdict) -> str:
    return "not" if math.isnan(verdict.seen.at_rest_s) else f"{verdict.seen.at_rest_s:.1f}"


def row(verdict: Verdict) -> str:
    """One flight, for the terminal: with the modes of the autopilot and the end in the log."""
    seen = verdict.seen
    modes = ", ".join(f"{mode} at {after_s:.1f} s" for mode, after_s in seen.modes) or "unchanged"
    ended = ADDRESS.sub("", seen.ended) + (f" ({seen.problem.partition(': ')[2]})" if seen.problem else "")
    cells = (
        verdict.fault,
        verdict.autopilot,
        answers_of(verdict),
        last_setpoint(verdict),
        modes,
        at_rest(verdict),
        ended,
    )
    return " | ".join(cells)


if __name__ == "__main__":
    main()
