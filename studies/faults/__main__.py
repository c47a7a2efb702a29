"""The fault table: `python -m studies.faults`, or `make faults`; writes docs/faults.md."""

import argparse
import math
import re
import sys
from collections.abc import Iterable
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

Every fault begins in a hover at 0.5 m, in real time over MAVLink, with quadctl in a process of its own and the
simulated autopilot in another. Times are seconds after the fault began, as the autopilot saw them. In no flight is a
setpoint sent that is not a number or beyond the limits, and none is sent after the last one in this table.
`make faults` writes this page; the tests fly the faults that only show in real time. [docs/safety.md](safety.md) gives
the reason for each answer. A flight that a busy machine disturbed is flown again alone, and is marked with its attempt.

The limits are those of `config/flight.yaml`, with a battery guarded at 13.5 V; a landing that does not end is given up
after 2 s (`max_over_time_s`), and the vehicle comes down a second later. In the faults of delay, jitter and loss a
line that holds back, loses and repeats datagrams lies between the two.

The vehicle is the quadrotor of `config/vehicles/raptor.yaml`; rows that say *of six* or *six rotors* fly the hexarotor
of `config/vehicles/f550.yaml`. With one motor at half thrust PX4's mock hovers, as a real PX4 did, whose figure 8 was
handed over after 2.8 s; ArduPilot's leaves its place, and the fence lands it. A real ArduPilot with a motor "at half"
was on the ground after 1.1 s, at 3.2 m/s, and stayed armed in LAND for 85 s. Its simulator weakens a motor by its
pulse: a fifth of the thrust is left, and the mock is on the ground from 1.5 m after 0.74 s, and disarms
([docs/autopilots.md](autopilots.md)). At 80 % the real one leaned by 10 deg, 1.1 m off, the mock by 11 deg, 1.1 m
off. A real hexarotor of ArduPilot flew on with a motor at half, and was on the ground after 1.4 s with one at a
tenth.

ArduPilot's own answer to missing setpoints is to level and hold its height, in GUIDED, without reporting it. Its
ground-station failsafe lands it 3 s after the last heartbeat of quadctl, as a flight requires (`SYSID_MYGCS`). PX4's
is `COM_OBL_RC_ACT`, here 3 (return). The mocks land faster than real autopilots: a PX4 needed 5 to 9 s from 1.5 m to
the ground, and another 2 to 4 s to disarm; an ArduPilot's failsafe comes down 4 s later than a landing that was asked
for. Times of an answer that waits for a message, such as PX4's heartbeats at 1 Hz,
are those of one flight. In rows about a person, that person also lands the vehicle, one or two seconds later. A
restarted autopilot may still be asked to land once: its state is old before it is known to have restarted. A vehicle
that neither of the two lands is landed by a simulated pilot with the switch after 14 s.

| fault | autopilot | answer | last setpoint | mode of the autopilot | at rest | how the log says it ended |
|---|---|---|---|---|---|---|
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


def page(verdicts: Iterable[Verdict]) -> str:
    return HEAD + "".join(row(verdict) + "\n" for verdict in verdicts)


def row(verdict: Verdict) -> str:
    """A line of the table."""
    seen = verdict.seen
    answer = ", ".join(dict.fromkeys(answer for _, answer in seen.events if answer)) or "none: the process is gone"
    modes = ", ".join(f"{mode} at {after_s:.1f} s" for mode, after_s in seen.modes) or "unchanged"
    last = f"{seen.last_setpoint_s:.2f} s" if seen.setpoints else "before it"
    rest = "not" if math.isnan(seen.at_rest_s) else f"{seen.at_rest_s:.1f} s"
    ended = ADDRESS.sub("", seen.ended) + (f" ({seen.problem.partition(': ')[2]})" if seen.problem else "")
    again = f" (attempt {verdict.attempts})" if verdict.attempts > 1 else ""
    return f"| {verdict.fault}{again} | {verdict.autopilot} | {answer} | {last} | {modes} | {rest} | {ended} |"


if __name__ == "__main__":
    main()
