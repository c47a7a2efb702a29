"""Progress of a flight: its stage, the time since it began, and the events for the log."""

from quadctl.flight.pilot.guards import Guard
from quadctl.flight.pilot.reasons import Reason
from quadctl.flight.pilot.tick import Event, Stage


class Progress:
    """Progress of one flight; the pilot shares it with the objects that carry out a stage."""

    def __init__(self) -> None:
        self.stage = Stage.WAIT
        self.ends: tuple[Reason, ...] = ()
        """End of the flight: completed, or the reason why it was not, and what came after it; empty before."""
        self.flight_s = 0.0
        """Time in the mission."""
        self.now_s = 0.0
        """Time of this tick, on the clock of the state."""
        self._began_s: float | None = None
        self._took_off_s: float | None = None
        self._entered_s = 0.0
        self._events: list[Event] = []

    def advance(self, now_s: float) -> float:
        """Begin a tick; return the time since the last one, s."""
        if self._began_s is None:
            self._began_s = self._entered_s = self.now_s = now_s
        dt = max(now_s - self.now_s, 0.0)
        self.now_s = now_s
        return dt

    @property
    def time_s(self) -> float:
        """Time since the first tick."""
        return self.now_s - (self._began_s or 0.0)

    @property
    def in_stage_s(self) -> float:
        """Time since this stage began."""
        return self.now_s - self._entered_s

    @property
    def in_air_s(self) -> float:
        """Time since the take-off began; 0 before."""
        return 0.0 if self._took_off_s is None else self.now_s - self._took_off_s

    def take_off(self) -> None:
        """Note that the vehicle climbs from now on, by the autopilot's take-off or by our targets."""
        if self._took_off_s is None:
            self._took_off_s = self.now_s

    def enter(self, stage: Stage) -> None:
        self.stage = stage
        self._entered_s = self.now_s

    @property
    def ended(self) -> str:
        """End of the flight, in words; empty before."""
        return "; ".join(map(str, self.ends))

    def end(self, *reasons: Reason) -> None:
        """End the flight."""
        self.ends = reasons
        self._note(self.ended, "end", reasons[-1])
        self.enter(Stage.DONE)

    def note(self, reason: Reason, answer: str, guard: Guard | None = None) -> None:
        """Note an event for the log."""
        self._note(str(reason), answer, reason, guard)

    def _note(self, what: str, answer: str, reason: Reason, guard: Guard | None = None) -> None:
        self._events.append(Event(self.time_s, what, answer, guard.value if guard else "", reason.kind.name.lower()))

    def take_events(self) -> tuple[Event, ...]:
        """Events noted since the last call."""
        events, self._events = tuple(self._events), []
        return events
