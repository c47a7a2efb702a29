"""A held-out flight of a real autopilot, on which exported equations of motion are compared with the model itself."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from quadctl.lab import add, prepare_flights
from quadctl.lab.flights.dataset import Dataset
from quadctl.lab.flights.flight import Flight
from quadctl.model import Model, load_model
from tests.support.places import DATA

REAL = DATA / "real" / "px4"
Floats = npt.NDArray[np.float64]


@dataclass(frozen=True)
class HeldOut:
    """Rotor drag fitted to two flights, and a third flight."""

    rigid: Model
    model: Model
    data: Dataset

    @property
    def flight(self) -> Flight:
        (flight,) = self.data.flights
        return flight

    @cached_property
    def velocity_ned(self) -> Floats:
        """Shape (n, 3), m/s."""
        north, east, up = (np.broadcast_to(v, len(self.flight.grid_s)) for v in self.flight.velocity_neu)
        return np.column_stack([north, east, -up])

    @cached_property
    def attitude(self) -> Floats:
        """Quaternions w, x, y, z, from forward, right, down to north, east, down, shape (n, 4)."""
        parts: Any = self.flight.conditions.attitude
        return np.column_stack([np.broadcast_to(part, len(self.flight.grid_s)) for part in parts])

    @cached_property
    def thrust_n(self) -> Floats:
        """Nominal thrust of each rotor, shape (n, rotors)."""
        return np.maximum(self.flight.nominal_n, 0.0).T

    def error_m_s2(self, accelerations_ned: Floats) -> float:
        """Error of accelerations, shape (n, 3), against those measured, all filtered alike."""
        north, east, down = accelerations_ned.T
        predicted = self.flight.filtered_vector((north, east, -down))
        return float(np.sqrt(np.mean(np.square(self.flight.measured - predicted))))

    def own_error_m_s2(self, model: Model) -> float:
        """Error of the lab's own prediction."""
        return float(np.sqrt(np.mean(np.square(self.data.residual(model)))))

    def assert_as_good(self, accelerations: Callable[[Floats, Floats, Floats], Floats]) -> None:
        """`accelerations` of (velocity_ned, attitude, thrust_n) err by at most a tenth more than the model."""
        own = self.own_error_m_s2(self.model)
        assert own < 0.9 * self.own_error_m_s2(self.rigid)  # the drag is worth something on this flight
        assert self.error_m_s2(accelerations(self.velocity_ned, self.attitude, self.thrust_n)) <= 1.1 * own


def held_out_flight() -> HeldOut:
    """The flight `excitation` of a real PX4 in its simulator."""
    rigid = load_model(REAL / "vehicle.yaml")
    model = add("rotor_drag", rigid, [REAL / "forward_runs.csv", REAL / "vertical_runs.csv"]).model
    return HeldOut(rigid, model, prepare_flights(REAL / "excitation.csv", model.vehicle).aligned_for(model))
