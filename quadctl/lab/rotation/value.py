"""A value with its interval."""

from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Value:
    """A parameter with its 95 % interval."""

    value: float
    low: float
    high: float

    def to_dict(self) -> dict[str, Any]:
        return {"value": self.value, "ci95": [self.low, self.high]}

    def __str__(self) -> str:
        # What is a millionth of the interval is 0, which the solver has not quite reached.
        least = 1e-6 * max(abs(self.low), abs(self.high))
        return f"{self.value if abs(self.value) > least else 0.0:.3g} [{self.low:.3g}, {self.high:.3g}]"
