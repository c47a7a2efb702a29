"""Errors of forecasts by horizon, as a value without what computes them."""

import json
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.special import stdtrit

from quadctl.errors import SettingsError
from quadctl.lab.arrays import Floats
from quadctl.lab.rotation.value import Value

HORIZONS_S = (0.01, 0.1, 0.5, 2.0)
QUANTITIES = ("position_m", "velocity_m_s", "rotation_rad", "rates_rad_s")
MODELS = HELD, SAVED, FORECAST, REFERENCE = "held", "model", "forecast", "reference"
LEAST_BLOCKS = 3
"""Number of blocks that an interval needs."""
FORECAST_OF = ("position, m", "velocity, m/s", "rotation, rad", "rates, rad/s")
FORECAST_ERRORS = "mean errors of forecasts of held-out data [95 % interval]"
FORECAST_HOLDS = (
    "Held: constant velocity and rates. Model: the one that `quadctl rotation -o` saves, begun by its observer. "
    "Forecast: the same, corrected for the controller's answers to disturbances. Reference: regression on past and "
    "commands, without physics. Forecast and reference hold for this controller only."
)


@dataclass(frozen=True, eq=False)
class Unseen:
    """Mean errors of forecasts of what no fit saw, in blocks of time, by the name of the model; each of shape (blocks,
    horizons, quantities)."""

    errors: dict[str, Floats]

    def mean(self, model: str, horizon: int, quantity: int) -> Value:
        """Mean over the blocks, with the interval that their scatter gives."""
        values = self.errors[model][:, horizon, quantity]
        half = float(stdtrit(max(len(values) - 1, 1), 0.975) * np.std(values, ddof=1) / np.sqrt(len(values)))
        mean = float(np.mean(values))
        return Value(mean, mean - half, mean + half)

    def rows(self) -> list[tuple[str, ...]]:
        """Rows of a table: horizon, model, and errors in the order of `FORECAST_OF` with their intervals."""
        return [
            (f"{horizon_s:g} s", model, *(str(self.mean(model, h, quantity)) for quantity in range(len(QUANTITIES))))
            for h, horizon_s in enumerate(HORIZONS_S)
            for model in self.errors
        ]

    def to_dict(self) -> dict[str, Any]:
        return {
            model: {
                f"{horizon_s:g}": {name: self.mean(model, h, q).to_dict() for q, name in enumerate(QUANTITIES)}
                for h, horizon_s in enumerate(HORIZONS_S)
            }
            for model in self.errors
        }

    def to_json(self) -> str:
        return json.dumps({model: np.round(blocks, 8).tolist() for model, blocks in self.errors.items()})

    @classmethod
    def from_json(cls, text: str) -> "Unseen":
        """The errors of `to_json`.

        Raises
        ------
        SettingsError
            The text holds none.
        """
        try:
            errors = {str(model): np.array(blocks, dtype=float) for model, blocks in json.loads(text).items()}
        except (ValueError, TypeError, AttributeError):
            errors = {}
        shape = (len(HORIZONS_S), len(QUANTITIES))
        if not {HELD} <= set(errors) <= set(MODELS) or any(
            e.shape[1:] != shape or len(e) < LEAST_BLOCKS or not np.isfinite(e).all() for e in errors.values()
        ):
            raise SettingsError("holds no errors of rollouts by horizon and quantity")
        return cls(errors)
