"""The guard on the model that flies: a residual that is too large for too long."""

import math

from pydantic import Field

from quadctl.flight.model_watch.watch import ModelError
from quadctl.flight.pilot.reasons import Kind, Reason, reason
from quadctl.flight.pilot.timer import Timer
from quadctl.settings import Settings

DIRECTIONS = (("forward", "back"), ("to the right", "to the left"), ("down", "up"))
"""Both directions of each axis of the body, FRD."""


class ModelErrorLimits(Settings):
    """Limits of this guard, in YAML under `guards: model_error`."""

    max_m_s2: float = Field(default=0.0, ge=0.0)
    """Largest residual of the specific force that may last for `max_s`; 0: not guarded."""
    max_s: float = Field(default=1.0, gt=0.0, le=60.0)


class ModelGuard:
    """Watches the residual of one flight."""

    def __init__(self, limits: ModelErrorLimits) -> None:
        self._limits = limits
        self._over = Timer()

    def defect(self, error: ModelError, now_s: float) -> Reason | None:
        """Reason why the vehicle is not the one of the model, or None."""
        most, longest_s = self._limits.max_m_s2, self._limits.max_s
        size = math.hypot(*error.ned_m_s2)
        if self._over.held_s(0.0 < most < size, now_s) <= longest_s:
            return None
        axis = max(range(3), key=lambda i: abs(error.body_m_s2[i]))
        towards = DIRECTIONS[axis][error.body_m_s2[axis] <= 0.0]
        return reason(Kind.OTHER_VEHICLE, most_m_s2=most, longest_s=longest_s, size_m_s2=size, towards=towards)
