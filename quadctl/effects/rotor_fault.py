"""Rotor fault: rotors give another thrust than k rpm^2: one of them less, always or from one moment on, or each its own
share.
"""

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, make_dataclass
from functools import cache
from typing import Any, ClassVar, Self, cast

from quadctl.effects.base import Conditions, Effect, parameter
from quadctl.effects.onset import Sudden, onsets
from quadctl.numeric import Number
from quadctl.vehicle import Vehicle


@dataclass(frozen=True)
class RotorShares(Effect):
    """Base of effects by which rotors give a share of their thrust, and of their drag torque."""

    affects_moment: ClassVar[bool] = True

    def given(self, c: Conditions, vehicle: Vehicle) -> Mapping[int, Number]:
        """Share of its thrust that each rotor gives, by its place from 0; those that are not in it give all."""
        raise TypeError(f"{type(self).__name__} does not say the shares of its rotors")

    def rotor_thrust(self, thrust_n: Sequence[Number], c: Conditions, vehicle: Vehicle) -> Sequence[Number]:
        given = self.given(c, vehicle)
        return [given[i] * thrust if i in given else thrust for i, thrust in enumerate(thrust_n)]


@dataclass(frozen=True)
class WeakRotor(RotorShares):
    """Rotor number `rotor` gives 1 - loss of its thrust, and of its drag torque."""

    name: ClassVar[str] = "rotor_fault.weak"
    source: ClassVar[str] = "loss of effectiveness of one actuator, as in fault-tolerant control (Lanzon et al. 2014)"
    depends_on: ClassVar[tuple[str, ...]] = ()
    physics: ClassVar[str] = "One rotor gives less thrust at its speed than the others: a chipped or loose propeller."
    distinguished_by: ClassVar[str] = "the balance of moments: this rotor turns faster than its neighbours in hover"
    mission: ClassVar[str] = "missions/hover_staircase_high.yaml"

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

    def given(self, c: Conditions, vehicle: Vehicle) -> Mapping[int, Number]:
        return {round(self.rotor) - 1: 1.0 - self.loss * self.share(c)}

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


@dataclass(frozen=True)
class UnequalRotors(RotorShares):
    """Rotor number i gives share_i of its thrust, and of its drag torque; the mean of all shares is 1.

    The parameters are those that a model file names, `share_1`, `share_2`, ...: all rotors but one at most. Those that
    it does not name have what is left, alike. A compensator leaves it alone: the total thrust stays. A centre of mass
    off the middle makes the same moments about roll and pitch, and none about yaw.
    """

    name: ClassVar[str] = "rotor_fault.unequal"
    source: ClassVar[str] = "effectiveness of each actuator, as in fault-tolerant control (Lanzon et al. 2014)"
    formula: ClassVar[str] = r"T_i = s_i \, k \, \Omega_i^2, \quad \sum_i s_i = n"
    depends_on: ClassVar[tuple[str, ...]] = ()
    physics: ClassVar[str] = "Some rotors give more thrust at their speed than others: they are not alike."
    distinguished_by: ClassVar[str] = (
        "the rotors' mean commands: `quadctl rotation`; but for yaw, a centre of mass off the middle looks the same"
    )
    mission: ClassVar[str] = "missions/hover_staircase_high.yaml"
    candidate: ClassVar[bool] = False
    numbers: ClassVar[tuple[int, ...]] = ()
    """Numbers of the rotors that have a parameter."""

    @classmethod
    def of(cls, shares: Mapping[int, float]) -> "UnequalRotors":
        """The effect with the shares of these rotors, by their numbers from 1."""
        return _of(tuple(sorted(shares)))(**{f"share_{number}": share for number, share in shares.items()})

    @classmethod
    def from_values(cls, values: Mapping[str, Any], source: str) -> Self:
        named = [int(found[1]) for name in values if (found := re.fullmatch(r"share_([1-9]\d?)", name))]
        if values and not named:
            named = [1]  # as an example for the refusal of another name
        # Every class that `_of` makes is an UnequalRotors, and has the inherited method.
        return cast(Self, super(UnequalRotors, _of(tuple(sorted(named)))).from_values(values, source))

    def mismatch(self, vehicle: Vehicle) -> str:
        n = vehicle.n_rotors
        if len(self.numbers) < n and max(self.numbers, default=0) <= n and sum(self.values().values()) < n:
            return ""
        named = ", ".join(f"{name} = {value:g}" for name, value in self.values().items())
        expected = f"expected those of at most {n - 1} of the {n} rotors of '{vehicle.name}', of a sum below {n}"
        return f"parameters of {self.name} are {named}, {expected}"

    def given(self, c: Conditions, vehicle: Vehicle) -> Mapping[int, Number]:
        shares = {number - 1: getattr(self, f"share_{number}") for number in self.numbers}
        others = [i for i in range(vehicle.n_rotors) if i not in shares]
        if not shares or not others:
            return shares
        return shares | dict.fromkeys(others, (vehicle.n_rotors - sum(shares.values())) / len(others))

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickled by its values: its class is in no module."""
        return UnequalRotors.from_values, (self.values(), self.name)


@cache
def _of(numbers: tuple[int, ...]) -> type[UnequalRotors]:
    if not numbers:
        return UnequalRotors
    fields = [
        (f"share_{number}", float, parameter(1.0, 0.1, 2.0, "", f"share of the thrust of rotor {number}", fitted=False))
        for number in numbers
    ]
    return make_dataclass("UnequalRotors", fields, bases=(UnequalRotors,), frozen=True, namespace={"numbers": numbers})
