"""Where a flight is, since when, and what its log must explain."""

from quadctl.flight.pilot.tick import Event, Stage


class Progress:
    """Kept by the pilot, shared with those who carry out a stage for it."""

    def __init__(self) -> None:
        self.stage = Stage.WAIT
        self.ended = ""
        """How the flight ended: `completed`, or the reason why it did not."""
        self.flight_s = 0.0
        """Time in the mission."""
        self.now_s = 0.0
        """Of this tick, on the clock of the state."""
        self._began_s: float | None = None
        self._took_off_s: float | None = None
        self._entered_s = 0.0
        self._events: list[Event] = []

    def advance(self, now_s: float) -> float:
        """A tick begins; the time since the last one, s."""
        if self._began_s is None:
            self._began_s = self._entered_s = self.now_s = now_s
        dt = max(now_s - self.now_s, 0.0)
        self.now_s = now_s
        return dt

    @property
    def time_s(self) -> float:
        """Since the first tick."""
        return self.now_s - (self._began_s or 0.0)

    @property
    def in_stage_s(self) -> float:
        """Since this stage began."""
        return self.now_s - self._entered_s

    @property
    def in_air_s(self) -> float:
        """Since the take-off began; 0 before."""
        return 0.0 if self._took_off_s is None else self.now_s - self._took_off_s

    def take_off(self) -> None:
        """From now on the vehicle climbs, by its autopilot's means or by ours."""
        if self._took_off_s is None:
            self._took_off_s = self.now_s

    def enter(self, stage: Stage) -> None:
        self.stage = stage
        self._entered_s = self.now_s

    def end(self, reason: str) -> None:
        """There is nothing more to do."""
        self.note(reason, "end")
        self.ended = reason
        self.enter(Stage.DONE)

    def note(self, what: str, answer: str) -> None:
        """For the log."""
        self._events.append(Event(self.time_s, what, answer))

    def take_events(self) -> tuple[Event, ...]:
        """What was noted since they were last taken."""
        events, self._events = tuple(self._events), []
        return events
