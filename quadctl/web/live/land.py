"""The button that lands: two presses, so that neither a slip lands a vehicle nor a dialog delays it."""

CONFIRM_S = 5.0
"""Longest time between the two presses: a slow machine takes a second or two to ask for the second one."""


class LandButton:
    """State of the button in one tab."""

    def __init__(self) -> None:
        self._pressed_s: float | None = None

    def press(self, now_s: float) -> bool:
        """Count a press, and return True if it is the second one: then the vehicle lands."""
        lands = self.waits(now_s)
        self._pressed_s = None if lands else now_s
        return lands

    def waits(self, now_s: float) -> bool:
        """True while a second press would land the vehicle."""
        return self._pressed_s is not None and now_s - self._pressed_s <= CONFIRM_S
