"""Motor lag: the thrust follows the logged rotor speeds or commands only after a while."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from quadctl.effects.base import Conditions, Effect, parameter
from quadctl.numeric import Number
from quadctl.vehicle import Vehicle

LEAST_S = 0.022
MEMORY = 8.0
"""Time constants after which a change has settled."""


@dataclass(frozen=True)
class FirstOrderLag(Effect):
    """tau dT/dt = T_nominal - T, on top of the lag that the vehicle file states for commands.

    It acts on a whole log, whose samples are evenly spaced in time. A single instant has no past: there the thrust is
    that of steady flight, and a compensator changes nothing.
    """

    name: ClassVar[str] = "motor_lag.first_order"
    source: ClassVar[str] = "first-order actuator, as in RotorS (Furrer et al. 2016), eq. of the motor model"
    depends_on: ClassVar[tuple[str, ...]] = ("thrust",)
    physics: ClassVar[str] = "The thrust follows the logged commands or speeds late: motors and air take their time."
    distinguished_by: ClassVar[str] = "quick changes of thrust; slow flight does not show it"
    mission: ClassVar[str] = "missions/vertical_runs.yaml"
    adds_lag: ClassVar[bool] = True
    corrects: ClassVar[tuple[str, ...]] = ("lag",)

    time_constant_s: float = parameter(0.05, 0.0, 1.0, "s", "after which 63 % of a change are there")

    def negligible(self) -> bool:
        return self.time_constant_s < LEAST_S

    def rotor_thrust(self, thrust_n: Sequence[Number], c: Conditions, vehicle: Vehicle) -> Sequence[Number]:
        if not isinstance(c.time_s, np.ndarray) or len(c.time_s) < 2:
            return thrust_n
        step_s = c.time_s[1] - c.time_s[0]
        return [lagged(thrust, step_s, self.time_constant_s) for thrust in thrust_n]


def lagged(signal: NDArray[np.float64], step_s: float, lag_s: float) -> NDArray[np.float64]:
    """Response of a first-order lag to `signal`, sampled every `step_s` and linear in between."""
    if lag_s < 1e-3 * step_s:
        return signal
    reach = min(max(1, round(MEMORY * lag_s / step_s)), 4 * len(signal))
    # The exact answer to each hat function of a piecewise linear signal, so that it is smooth in lag_s down to 0.
    edges = np.arange(-1, reach + 2)
    ramp = np.where(edges > 0, edges * step_s - lag_s * (1.0 - np.exp(-np.maximum(edges, 0) * step_s / lag_s)), 0.0)
    kernel = np.diff(ramp, 2) / step_s
    kernel /= kernel.sum()
    padded = np.concatenate([np.full(len(kernel) - 1, signal[0]), signal])
    return np.asarray(np.convolve(padded, kernel, mode="valid"))
