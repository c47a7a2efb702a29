"""Battery, ESC and motor."""

import numpy as np

from studies.worlds.blade.rotation import Array

CHARGE = np.array([0.0, 0.03, 0.08, 0.15, 0.3, 0.5, 0.7, 0.85, 0.95, 1.0])
CELL_VOLTS = np.array([3.1, 3.42, 3.58, 3.67, 3.75, 3.83, 3.95, 4.06, 4.14, 4.19])
"""Open-circuit voltage of a lithium-polymer cell over its charge; typical of published discharge curves."""


def open_voltage(charge: Array) -> Array:
    """Open-circuit voltage of a cell."""
    volts: Array = np.interp(charge, CHARGE, CELL_VOLTS)
    return volts


class Battery:
    """Battery of each of many flights; rotor speeds and power are shares of those in hover."""

    def __init__(self, charge: Array, cells: Array, drain: Array, sag: Array) -> None:
        """Battery with a charge (0 to 1) that falls by `drain` per second in hover; `sag` is the share of the
        voltage that the internal resistance takes in hover."""
        self.charge, self._cells, self._drain, self._sag = charge.copy(), cells, drain, sag
        self.voltage = cells * open_voltage(charge) * (1.0 - sag)

    def advance(self, power: Array, step: float) -> Array:
        """Terminal voltage after a step with this power, as a share of the power in hover."""
        self.charge = np.maximum(self.charge - self._drain * power * step, 0.0)
        open_ = self._cells * open_voltage(self.charge)
        current = power * self._cells * 3.7 / self.voltage
        target = open_ * (1.0 - self._sag * current)
        self.voltage = self.voltage + (target - self.voltage) * min(step / 0.05, 1.0)  # double layer and ESC capacitors
        return self.voltage


def open_loop_speed(command: Array, voltage_ratio: Array, loss: Array) -> Array:
    """Speed of motors at a duty that would give the speed `command` at the nominal voltage.

    Steady DC motor: duty V = omega / K_v + R_m I, I proportional to omega^2. Speeds as shares of that in hover,
    where the winding takes the share `loss` of the voltage.
    """
    duty = (command + loss * command**2) * voltage_ratio
    speed: Array = (np.sqrt(1.0 + 4.0 * loss * duty) - 1.0) / (2.0 * loss)
    return speed
