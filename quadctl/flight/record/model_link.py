"""The residual of the model on the link, for the ground stations behind it."""

import math

from quadctl.flight.autopilot.port import Autopilot
from quadctl.flight.pilot.tick import Tick

TELL_S = 0.5
"""Interval of the messages."""
NAME = "residual"
"""Name of the DEBUG_VECT, of at most ten characters: forward, right, down, m/s^2."""


class ModelLink:
    """Listener of the loop that tells the residual twice a second."""

    def __init__(self, autopilot: Autopilot) -> None:
        self._autopilot = autopilot
        self._due_s = -math.inf

    def __call__(self, tick: Tick) -> None:
        residual = tick.model_error.body_m_s2
        if tick.time_s >= self._due_s and all(map(math.isfinite, residual)):
            self._due_s = tick.time_s + TELL_S
            self._autopilot.tell(NAME, residual)
