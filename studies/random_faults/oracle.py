"""The oracle: what must never be in a flight, whatever its faults. It knows no fault, only the evidence."""

import math
from collections.abc import Iterator, Sequence

from quadctl.flight.pilot.guards import Answer, unfit
from quadctl.flight.pilot.landing import HOLD_S
from quadctl.flight.pilot.supervisor import HEARTBEAT_S, MODE_FRESH_S

from .evidence import Evidence

TICK_S = 0.02
AGE_ERROR_S = 0.1
"""Largest error of the age that round trips tell, s: half of a round trip on the lines that are drawn here."""
COMING_DOWN = ("LAND", "RTL")
"""Modes in which the autopilot lands by itself, however long a damaged vehicle needs for that."""
SILENT = (Answer.HAND_OVER.value, Answer.RELEASE.value, "silence", "end")
"""Answers after which nothing is sent any more."""


def defects(e: Evidence) -> list[str]:
    """Unsafe ends of a flight, each in a sentence."""
    return [*_setpoints(e), *_modes(e), *_end(e), *_log(e)]


def _setpoints(e: Evidence) -> Iterator[str]:
    silent_s = min((n.at_s for n in e.noted if n.answer in SILENT), default=math.inf)
    landing_s = min((n.at_s for n in e.noted if n.answer == Answer.LAND.value), default=math.inf)
    late = [s for s in e.sent if s.at_s > silent_s + e.slack_s]
    if late:
        yield f"{len(late)} setpoints after the hand-over, up to {late[-1].at_s - silent_s:.2f} s after it"
    if e.sent and e.sent[-1].at_s > landing_s + HOLD_S + 2.0 * TICK_S + e.slack_s:
        yield f"setpoints up to {e.sent[-1].at_s - landing_s:.2f} s after the landing was asked for"
    wrong = [problem for s in e.sent if (problem := unfit(s.target, e.guards, e.max_throttle))]
    if wrong:
        yield f"{len(wrong)} setpoints unfit: {wrong[0]}"
    flown = [s for s in e.sent if s.target.throttle > 0.0]
    spoiled = [s for s in flown if s.spoiled]
    if spoiled:
        yield f"{len(spoiled)} setpoints from a state that is no number: {spoiled[0].spoiled}"
    allowed_s = e.guards.max_state_age_s + AGE_ERROR_S + e.slack_s
    for part in ("position", "attitude"):
        oldest_s = max((getattr(s, f"{part}_age_s") for s in flown), default=0.0)
        if oldest_s > allowed_s:
            yield f"setpoints from a {part} that was {oldest_s:.2f} s old"
    foreign = [s for s in flown if _foreign(e, s.at_s)]
    if foreign:
        yield f"{len(foreign)} setpoints while the mode was told to be another's, or the vehicle disarmed"


def _foreign(e: Evidence, at_s: float) -> bool:
    """True when the last news say that somebody else flies, or nobody."""
    modes = [(t.at_s, t.mode == e.offboard) for t in e.told if t.mode is not None]
    arming = [(t.at_s, t.armed) for t in e.told if t.armed is not None]
    return any(_denied(news, at_s) for news in (modes, arming))


def _denied(news: Sequence[tuple[float, bool]], at_s: float) -> bool:
    """True when the last of the `news` (time, ours) that a tick at `at_s` has seen says no."""
    return next((not ours for told_s, ours in reversed(news) if told_s < at_s), False)


def _modes(e: Evidence) -> Iterator[str]:
    """Modes that were asked for while a person had the vehicle, and requests that only a start makes."""
    lifted_s = math.inf if e.lifted_s is None else e.lifted_s
    longest_s = HEARTBEAT_S + MODE_FRESH_S + 0.1 + e.slack_s
    silent_s = min((n.at_s for n in e.noted if n.answer == Answer.RELEASE.value), default=math.inf)
    for asked in e.asked:
        owner = next((t for t in reversed(e.taken) if t.at_s < asked.at_s), None)
        if owner is not None and owner.mode not in (e.offboard, asked.what):
            known = any(owner.at_s < t.at_s < asked.at_s and t.mode == owner.mode for t in e.told)
            if known or asked.at_s - owner.at_s > longest_s:
                yield f"{asked.what} asked for {asked.at_s - owner.at_s:.2f} s after a person took {owner.mode}"
        if asked.at_s > lifted_s + e.slack_s and asked.what != "LAND":
            yield f"{asked.what} asked for in flight"
        if asked.at_s > silent_s + e.slack_s:
            yield f"{asked.what} asked for {asked.at_s - silent_s:.2f} s after the release"


def _end(e: Evidence) -> Iterator[str]:
    if e.failure:
        yield e.failure
    if not e.at_rest and e.last_mode not in COMING_DOWN:
        armed = "armed" if e.armed_at_end else "disarmed"
        yield f"nobody landed the vehicle: in the end it is {armed} in {e.last_mode}"
    if e.outcome is None and not e.killed:
        yield "the flight did not end"


def _log(e: Evidence) -> Iterator[str]:
    if not e.has_begun:
        if not (e.outcome or e.killed):
            yield "no reason is told"
        return
    if e.killed:
        if not e.ended:
            yield "the sidecar is lost"
        return
    if e.ended in ("", "in flight", "broken off"):
        yield f"the sidecar says {e.ended or 'nothing'!r} in the end"
    if e.outcome is not None and not e.outcome:
        yield "no reason is told"
    if e.outcome == "completed" and not e.mission_flown:
        yield "it calls completed what was not flown to the end"
    if e.outcome not in (None, "completed") and not e.noted:
        yield "no event tells the reason"
    if e.rows < e.ticks and not e.disk_full:
        yield f"{e.ticks - e.rows} rows of the log are lost"
