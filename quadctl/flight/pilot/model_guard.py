"""The guard on the model that flies: a residual that is too large for too long."""

import math

from pydantic import Field

from quadctl.flight.model_watch.watch import ModelError
from quadctl.flight.pilot.timer import Timer
from quadctl.settings import Settings


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

    def defect(self, error: ModelError, now_s: float) -> str | None:
        """Reason why the vehicle is not the one of the model, or None."""
        most, longest_s = self._limits.max_m_s2, self._limits.max_s
        size = math.hypot(*error.ned_m_s2)
        if self._over.held_s(0.0 < most < size, now_s) <= longest_s:
            return None
        return (
            f"the vehicle is not the one of the model: the residual has been over {most:g} m/s^2 for more than "
            f"{longest_s:g} s, it is {size:.2f} m/s^2, most of it {_direction(error)}"
        )


def _direction(error: ModelError) -> str:
    """Direction of the body along which most of the error is."""
    names = (("forward", "back"), ("to the right", "to the left"), ("down", "up"))
    size, (towards, away) = max(zip(error.body_m_s2, names, strict=True), key=lambda pair: abs(pair[0]))
    return towards if size > 0.0 else away
