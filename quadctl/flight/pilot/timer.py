"""A timer of the guards, on the clock of the state."""


class Timer:
    """Time for which a condition has held without a break."""

    def __init__(self) -> None:
        self._since_s: float | None = None

    def held_s(self, holds: bool, now_s: float) -> float:
        if not holds:
            self._since_s = None
            return 0.0
        self._since_s = now_s if self._since_s is None else self._since_s
        return now_s - self._since_s

    def forget(self) -> None:
        self._since_s = None
