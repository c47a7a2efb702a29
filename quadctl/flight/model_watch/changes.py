"""Changes of the vehicle that are worth telling: large enough to matter, sure enough, and lasting."""

import math
from typing import NamedTuple

from quadctl.flight.model_watch.regression import PARAMETERS, Block, Estimate
from quadctl.frames import GRAVITY_M_S2
from quadctl.words import By, Words

SURE = 4.0
"""Standard deviations by which a change that is told differs from none."""
HELD = 0.5
"""Factor on that, and on the least size, for a change that has been told, until it counts as gone."""
LASTING_BLOCKS = 4
"""Blocks in a row in which a change is found before it is told."""
SPEED_SMOOTHING_S = 10.0
"""Time constant of the mean square of the speed at which a change of drag is weighed."""


class Change(NamedTuple):
    """Change of a parameter of the vehicle against the model."""

    name: str
    amount: float
    """Relative for the thrust, 1/s for drag and inflow, rad for a lean."""
    std: float
    since_s: float
    """Time since the first tick at which it was first seen."""

    def __str__(self) -> str:
        side = "below" if self.amount < 0.0 else "above"
        return _WORDS.say(WORDS, {**self._asdict(), "side": side, "size": abs(self.amount)})


LEAN = "{name} by {amount:degrees} deg against the model since {since_s:.0f} s"
WORDS = By(
    "name",
    {
        "thrust": "thrust {size:.0%} {side} the model since {since_s:.0f} s",
        "lean forward": LEAN,
        "lean right": LEAN,
    },
    "{name} {size:.2f} 1/s {side} the model since {since_s:.0f} s",
)
"""Template of a change."""
_WORDS = Words({"degrees": lambda radians: f"{math.degrees(radians):.1f}"})


class _Trace(NamedTuple):
    """Blocks in a row in which a parameter was found changed to the same side."""

    blocks: int = 0
    sign: float = 0.0
    since_s: float = 0.0


class Changes:
    """Follows the estimates of one flight."""

    def __init__(self) -> None:
        self._traces = {parameter.name: _Trace() for parameter in PARAMETERS}
        self._squares_m2_s2 = (0.0, 0.0, 0.0)

    def judge(self, found: dict[str, Estimate], block: Block, begin_s: float) -> tuple[Change, ...]:
        """Changes that are told after a block that began at `begin_s`, by the estimates with it."""
        share = min(block.duration_s / SPEED_SMOOTHING_S, 1.0)
        x, y, z = (
            square + share * (speed * speed - square)
            for square, speed in zip(self._squares_m2_s2, block.air_m_s, strict=True)
        )
        self._squares_m2_s2 = x, y, z
        told = []
        for name, per_change in self._weights().items():
            trace = self._traces[name] = self._continued(name, found[name], per_change, begin_s)
            if trace.blocks >= LASTING_BLOCKS:
                told.append(Change(name, *found[name], trace.since_s))
        return tuple(told)

    def _continued(self, name: str, estimate: Estimate, per_change: float, begin_s: float) -> _Trace:
        trace, (value, std) = self._traces[name], estimate
        ease = HELD if trace.blocks >= LASTING_BLOCKS else 1.0
        size, least_m_s2 = abs(value), _LEAST_M_S2[name]
        if not (size > ease * SURE * std and per_change * size > ease * least_m_s2):
            return _Trace()
        if trace.sign * value > 0.0:
            return trace._replace(blocks=trace.blocks + 1)
        return _Trace(1, math.copysign(1.0, value), begin_s)

    def _weights(self) -> dict[str, float]:
        """Specific force, m/s^2, that a change of 1 makes in this flight, by name."""
        forward, right, down = map(math.sqrt, self._squares_m2_s2)
        g = GRAVITY_M_S2
        return {
            "thrust": g,
            "drag forward": forward,
            "drag right": right,
            "inflow": down,
            "lean forward": g,
            "lean right": g,
        }


_LEAST_M_S2 = {parameter.name: parameter.told for parameter in PARAMETERS}
