"""Summary of a flight: its end, its log, its tracking error, and the lateness of its ticks."""

import math
from dataclasses import asdict, dataclass
from pathlib import Path

from quadctl.flight.pilot.pilot import END_EARLY, Pilot
from quadctl.flight.pilot.reasons import Kind, Reason
from quadctl.flight.pilot.tick import Stage, Tick
from quadctl.words import Template, When, Words

COMPLETED = str(Reason(Kind.COMPLETED))


LINES: tuple[Template, ...] = (
    "{mission}: {ended} after {flight_s:.1f} s of flight",
    ("phases: ", When("phases", "{phases:list}", "none")),
    "tracking error (RMSE): north {rmse_cm[north]:.1f}, east {rmse_cm[east]:.1f}, up {rmse_cm[up]:.1f} cm",
    When(
        "is_late",
        "{ticks} ticks, late by {late_ms[p50]:.2f} ms (median), {late_ms[p99]:.2f} ms (p99), "
        "{late_ms[max]:.2f} ms (worst)",
    ),
)
"""Templates of the lines that every flight has."""


@dataclass(frozen=True)
class Outcome:
    """Outcome of a flight, as `fly` and `simulate` print it and write it with `--json`."""

    mission: str
    ended: str
    completed: bool
    log: str
    phases: list[str]
    flight_s: float
    ticks: int
    tracking_rmse_m: dict[str, float]
    """RMSE of the position against its reference: north, east, up."""
    late_ms: dict[str, float]
    """Tick lateness: p50, p99, max. All 0 in lockstep."""
    late_ticks: int
    """Ticks more than half a period late."""
    known: tuple[str, ...] = ()
    """Reason why the mission ended early, where it did."""
    texts: tuple[str, ...] = ()
    """Warnings and errors that the autopilot sent as texts, each once, in their order."""
    problem: str | None = None
    """Problem beside the flight, such as a full disk."""

    def lines(self) -> list[str]:
        """Lines for the terminal."""
        centimetres = {axis: 100.0 * rmse_m for axis, rmse_m in self.tracking_rmse_m.items()}
        facts = {**asdict(self), "rmse_cm": centimetres, "is_late": self.late_ms["max"] > 0.0}
        words = Words()
        told = self.known if self.completed else (*self.known, *self.texts)
        lines = (*(words.say(line, facts) for line in LINES), *told, self.problem, f"log: {self.log}")
        return [line for line in lines if line]


class Tally:
    """Listener that collects an `Outcome` tick by tick."""

    def __init__(self, period_s: float) -> None:
        self._period_s = period_s
        self._squares = [0.0, 0.0, 0.0]
        self._tracked = [0, 0, 0]
        self._late_s: list[float] = []
        self._known: list[str] = []
        self._texts: list[str] = []

    def __call__(self, tick: Tick) -> None:
        self._late_s.append(tick.late_s)
        self._known += [event.what for event in tick.events if event.answer == END_EARLY]
        self._texts += [str(text) for text in tick.texts if text.grave]
        if tick.stage is Stage.FLY and tick.setpoint is not None:
            pairs = zip(tick.setpoint.position_ned_m, tick.state.position_ned_m, strict=True)
            for i, (wanted, at) in enumerate(pairs):
                if not math.isnan(wanted):  # nan: flown by velocity, there is no place to be
                    self._tracked[i] += 1
                    self._squares[i] += (at - wanted) ** 2

    @property
    def late_ms(self) -> dict[str, float]:
        late = sorted(self._late_s) or [0.0]
        return {
            "p50": 1e3 * late[len(late) // 2],
            "p99": 1e3 * late[min(len(late) - 1, int(0.99 * len(late)))],
            "max": 1e3 * late[-1],
        }

    def outcome(self, pilot: Pilot, log: Path, problem: str | None = None) -> Outcome:
        rmse = [math.sqrt(total / max(n, 1)) for total, n in zip(self._squares, self._tracked, strict=True)]
        return Outcome(
            mission=pilot.mission.name,
            ended=pilot.ended,
            completed=pilot.ended == COMPLETED,
            log=str(log),
            phases=list(pilot.phases_flown),
            flight_s=pilot.flight_s,
            ticks=len(self._late_s),
            tracking_rmse_m=dict(zip(("north", "east", "up"), rmse, strict=True)),
            late_ms=self.late_ms,
            late_ticks=sum(late > 0.5 * self._period_s for late in self._late_s),
            known=tuple(self._known),
            texts=tuple(dict.fromkeys(self._texts)),
            problem=problem,
        )
