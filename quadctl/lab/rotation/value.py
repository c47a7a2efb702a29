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
        return f"{self.value:.3g} [{self.low:.3g}, {self.high:.3g}]"
