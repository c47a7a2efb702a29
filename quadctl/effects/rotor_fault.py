"""Rotor fault: one rotor gives less thrust than k rpm^2, all the time or from one moment on."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

from quadctl.effects.base import Conditions, Effect, parameter
from quadctl.effects.onset import Sudden, onsets
from quadctl.numeric import Number
from quadctl.vehicle import Vehicle


@dataclass(frozen=True)
class WeakRotor(Effect):
    """Rotor number `rotor` gives 1 - loss of its thrust, and of its drag torque."""

    name: ClassVar[str] = "rotor_fault.weak"
    source: ClassVar[str] = "loss of effectiveness of one actuator, as in fault-tolerant control (Lanzon et al. 2014)"
    depends_on: ClassVar[tuple[str, ...]] = ()
    physics: ClassVar[str] = "One rotor gives less thrust at its speed than the others: a chipped or loose propeller."
    distinguished_by: ClassVar[str] = "the balance of moments: this rotor turns faster than its neighbours in hover"
    mission: ClassVar[str] = "missions/hover_staircase_high.yaml"
    affects_moment: ClassVar[bool] = True

    loss: float = parameter(0.05, 0.0, 0.9, "", "share of the rotor's thrust that is missing")
    rotor: float = parameter(1.0, 1.0, 64.0, "", "number of the rotor, as motor1, motor2, ...", fitted=False)

    @classmethod
    def starts(cls, flights: Sequence[Conditions], vehicle: Vehicle) -> Sequence[Effect]:
        return [cls(rotor=float(number)) for number in range(1, vehicle.n_rotors + 1)]

    def negligible(self) -> bool:
        """True for a loss that turns the vehicle by no more than a centre of mass 1.75 % of the arms off."""
        return self.loss < 0.07

    def mismatch(self, vehicle: Vehicle) -> str:
        whole = float(self.rotor).is_integer() and self.rotor <= vehicle.n_rotors
        expected = f"expected a whole number from 1 to {vehicle.n_rotors}, the rotors of '{vehicle.name}'"
        return "" if whole else f"parameter rotor of {self.name} is {self.rotor:g}, {expected}"

    def shows_in(self, vehicle: Vehicle) -> tuple[str, ...]:
        """Axes on which the rotor has a long lever arm; beside a single one, the vertical axis.

        An error of one moment alone may come from the centre of mass; a weak rotor also lacks thrust, or has a second
        moment. Not yaw: there motors that lean by little turn the vehicle by more than a rotor's drag does.
        """
        x, y, _ = vehicle.rotors[round(self.rotor) - 1].position_m
        furthest = max(math.hypot(*rotor.position_m[:2]) for rotor in vehicle.rotors)
        long = tuple(axis for axis, lever in (("roll", y), ("pitch", x)) if abs(lever) > 0.3 * furthest)
        return long if len(long) > 1 else (*long, "up")

    def rotor_thrust(self, thrust_n: Sequence[Number], c: Conditions, vehicle: Vehicle) -> Sequence[Number]:
        weak, left = round(self.rotor) - 1, 1.0 - self.loss * self.share(c)
        return [left * thrust if i == weak else thrust for i, thrust in enumerate(thrust_n)]

    def share(self, c: Conditions) -> Number:
        """Share of the loss that is there: all of it."""
        return 1.0


@dataclass(frozen=True)
class FailingRotor(Sudden, WeakRotor):
    """Rotor number `rotor` gives 1 - loss of its thrust, and of its drag torque, from `time_s` of one flight on."""

    name: ClassVar[str] = "rotor_fault.onset"
    depends_on: ClassVar[tuple[str, ...]] = ("time",)
    physics: ClassVar[str] = "From one moment on one rotor gives less thrust at its speed: its propeller was chipped."
    distinguished_by: ClassVar[str] = "a step in time of the balance of moments; a load at the centre has none"
    not_for_flight: ClassVar[str] = "the time of the damage belongs to one flight"

    time_s: float = parameter(0.0, 0.0, 1e6, "s", "time of the log at which it happens", fitted=False)
    flight: float = parameter(0.0, 0.0, 1e6, "", "number of the flight, in the order given; 0: every one", fitted=False)

    @classmethod
    def starts(cls, flights: Sequence[Conditions], vehicle: Vehicle) -> Sequence[Effect]:
        numbers = [float(number) for number in range(1, vehicle.n_rotors + 1)]
        return [
            FailingRotor(rotor=number, time_s=time_s, flight=flight)
            for time_s, flight in onsets(flights)
            for number in numbers
        ] or [FailingRotor(rotor=number) for number in numbers]

    def share(self, c: Conditions) -> Number:
        return self.begun(c)
