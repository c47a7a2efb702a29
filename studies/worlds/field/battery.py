"""Lithium-polymer batteries of a batch: charge, resistance and slow polarisation."""

import numpy as np

from studies.worlds.field.arrays import Floats
from studies.worlds.field.batch import per_flight
from studies.worlds.field.cases import Case


def open_circuit_v(charge: Floats, cells: Floats) -> Floats:
    """Open-circuit voltage of a pack over its state of charge."""
    return np.asarray(cells * (3.62 + 0.42 * charge + 0.14 * charge**3 - 0.35 * np.exp(-22.0 * charge)))


class Batteries:
    """Voltage under load; hover draws the vehicle's C rate, and its current costs 5 % of the voltage."""

    def __init__(self, cases: list[Case], charge: Floats) -> None:
        """Start at a state of charge, already loaded."""
        self._cells = per_flight(cases, lambda case: float(case.vehicle.cells))
        self._c_rate = per_flight(cases, lambda case: case.vehicle.battery_c_rate)
        self._charge = charge
        self._slow = np.full(len(cases), 0.02)
        self.voltage_v = open_circuit_v(charge, self._cells) * 0.95

    def advance(self, power: Floats, step_s: float) -> None:
        """Draw a power, in units of the power in hover."""
        self._charge = np.maximum(self._charge - self._c_rate * power * step_s / 3600.0, 0.02)
        self._slow = self._slow + step_s / 1.5 * (0.02 * power - self._slow)
        self.voltage_v = open_circuit_v(self._charge, self._cells) * (1.0 - 0.03 * power - self._slow)
