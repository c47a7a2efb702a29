"""The button that lands: two presses, so that neither a slip lands a vehicle nor a dialog delays it."""

import math

CONFIRM_S = 5.0
"""Longest time between the two presses, from the moment in which the browser asks for the second one."""


class LandButton:
    """State of the button in one tab."""

    def __init__(self) -> None:
        self._until_s: float | None = None
        """End of the time for a second press; infinite until the browser asks for it."""

    def press(self, now_s: float) -> bool:
        """Count a press, and return True if it is the second one: then the vehicle lands."""
        lands = self.waits(now_s)
        self._until_s = None if lands else math.inf
        return lands

    def asks(self, now_s: float) -> None:
        """Count the time for a second press from now on, as the browser asks for it."""
        if self._until_s is not None:
            self._until_s = min(self._until_s, now_s + CONFIRM_S)

    def waits(self, now_s: float) -> bool:
        """True while a second press would land the vehicle."""
        return self._until_s is not None and now_s <= self._until_s
