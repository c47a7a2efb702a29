"""The button that lands: two presses, so that no slip lands a vehicle, and no question is between a person and the
ground."""

CONFIRM_S = 5.0
"""A second press counts for so long: a page on a slow machine takes a second or two to say that it waits for it."""


class LandButton:
    """One per tab."""

    def __init__(self) -> None:
        self._pressed_s: float | None = None

    def press(self, now_s: float) -> bool:
        """Whether this press lands."""
        lands = self.waits(now_s)
        self._pressed_s = None if lands else now_s
        return lands

    def waits(self, now_s: float) -> bool:
        """For a second press."""
        return self._pressed_s is not None and now_s - self._pressed_s <= CONFIRM_S
