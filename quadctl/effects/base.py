"""What an effect is: a frozen dataclass of named, bounded parameters and pure functions of the flight conditions.

The same object predicts (arrays: a whole log), compensates (floats: one control tick) and simulates (floats: one
physics step). An effect overrides the hooks of the ways in which it acts:

- `rotor_thrust`: it changes the thrust that each rotor gives at its speed (ground effect, inflow, ...);
- `force`: it adds a force on the body that is not along the rotors' axes (drag, a tilted thrust axis, ...);
- `torque`: it adds a moment on the body that is not the rotors';
- `wind_ned_m_s`: it moves the air, which all effects of the air then feel;
- `sensed_m_s2`: it makes the accelerometer read what is not there.
"""

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Self

from quadctl.errors import SettingsError
from quadctl.frames import Quaternion
from quadctl.numeric import Number, Vector
from quadctl.settings import nearest
from quadctl.vehicle import Vehicle

NO_FORCE: Vector = (0.0, 0.0, 0.0)
NO_TORQUE: Vector = (0.0, 0.0, 0.0)
NO_WIND: Vector = (0.0, 0.0, 0.0)
NO_BIAS: Vector = (0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True)
class Conditions:
    """What an effect may depend on; every field is one value or an array with one value per sample, shape (n,)."""

    height_m: Number
    """Height of the rotor plane above the ground."""
    velocity_body_m_s: Vector
    """Velocity relative to the air, FRD; over ground where no wind is known."""
    attitude: Quaternion
    """Body to world."""
    time_s: Number = 0.0
    """Since the start of the log or flight."""
    battery_v: Number = float("nan")
    position_ne_m: tuple[Number, Number] = (0.0, 0.0)
    """North and east."""


@dataclass(frozen=True, slots=True)
class Parameter:
    """Declaration of one parameter: its bounds are those of physics, not of taste."""

    name: str
    default: float
    low: float
    high: float
    unit: str
    meaning: str
    fitted: bool = True
    """False: kept at its value; the effect's `starts` choose it where data can."""


def parameter(default: float, low: float, high: float, unit: str, meaning: str, *, fitted: bool = True) -> Any:
    """A dataclass field that declares a parameter of an effect."""
    return dataclasses.field(
        default=default, metadata={"low": low, "high": high, "unit": unit, "meaning": meaning, "fitted": fitted}
    )


@dataclass(frozen=True)
class Effect:
    """Base of all effects. Subclasses are frozen dataclasses whose fields are declared with `parameter`."""

    name: ClassVar[str]
    """`family.variant`, as in model files."""
    source: ClassVar[str]
    """Paper and equation."""
    depends_on: ClassVar[tuple[str, ...]]
    """Variables of the lab's residual plots that this effect varies with."""
    physics: ClassVar[str]
    """One sentence for a person: what happens and why."""
    told_apart_by: ClassVar[str]
    """What flight distinguishes it from its look-alikes."""
    mission: ClassVar[str]
    """The mission file that shows this effect best."""
    replaces: ClassVar[tuple[str, ...]] = ()
    """Nuisances of single flights (`lab.nuisance`) that this effect stands for: they are not fitted beside it."""
    needs: ClassVar[dict[str, float]] = {}
    """Variables, and the span of each that data must have for this effect to be told from its look-alikes."""
    turns: ClassVar[bool] = False
    """Its rotor thrusts or its torque turn the body by what the balance of moments can show."""
    senses: ClassVar[bool] = False
    """It shows where the accelerometer and the change of velocity disagree."""
    retards: ClassVar[bool] = False
    """It makes the thrust come later; by how much a log itself is late has to be estimated along with it."""
    reversible: ClassVar[bool] = False
    """A fit may go either way from a start: it explains as much as its opposite does."""
    stands_back_for: ClassVar[tuple[str, ...]] = ()
    """Families beside which it is used as `standing_back`, because they say a part of it better."""

    candidate: ClassVar[bool] = True
    """False: the lab does not propose it by itself; a model file may still name it."""
    not_for_flight: ClassVar[str] = ""
    """Why a compensator must not hold this effect; empty: it may."""

    @classmethod
    def family(cls) -> str:
        return cls.name.partition(".")[0]

    @classmethod
    def applies_to(cls, vehicle: Vehicle) -> bool:
        """Whether the effect can be there at all; the lab does not try it otherwise."""
        return True

    @classmethod
    def starts(cls, flights: Sequence[Conditions], vehicle: Vehicle) -> "Sequence[Effect]":
        """Where a fit to these flights may begin: several where the error has several valleys.

        Parameters that are not fitted keep the value of the start that explains most.
        """
        return [cls()]

    def closer(self, flights: Sequence[Conditions]) -> "Sequence[Effect]":
        """Further starts about this one, tried where it explains most of all: a coarse search made fine."""
        return []

    @classmethod
    def parameters(cls) -> tuple[Parameter, ...]:
        return tuple(
            Parameter(name=field.name, default=float(field.default), **field.metadata)  # type: ignore[arg-type]
            for field in dataclasses.fields(cls)
        )

    @classmethod
    def from_values(cls, values: Mapping[str, Any], source: str) -> Self:
        """An effect with the parameters of a file; those not named keep their default.

        Raises
        ------
        SettingsError
            A name is not a parameter of this effect, or a value is no number or out of bounds; `source` is named.
        """
        declared = {p.name: p for p in cls.parameters()}
        for name, value in values.items():
            if name not in declared:
                expected = f", expected one of: {', '.join(declared)}" if declared else ", expected none"
                raise SettingsError(
                    f"{source}: {cls.name} has no parameter '{name}'{nearest(name, declared) or expected}"
                )
            bounds = declared[name]
            number = isinstance(value, int | float) and not isinstance(value, bool)
            if not number or not bounds.low <= value <= bounds.high:
                raise SettingsError(
                    f"{source}: parameter {name} of {cls.name} is {value}, "
                    f"expected a number from {bounds.low:g} to {bounds.high:g} {bounds.unit}".rstrip()
                )
        return cls(**{name: float(value) for name, value in values.items()})

    def values(self) -> dict[str, float]:
        return {field.name: getattr(self, field.name) for field in dataclasses.fields(self)}

    def negligible(self) -> bool:
        """No more than what coefficients and trims of any real vehicle are off by: then it is not called missing."""
        return False

    def believable(self, flights: Sequence[Conditions], vehicle: Vehicle) -> bool:
        """Whether parameters fitted to these flights are what the effect can be, or the form stands in for another."""
        return True

    def distinct(self, flights: Sequence[Conditions], vehicle: Vehicle) -> bool:
        """Whether these flights can tell it, with the parameters fitted to them, from what looks like it."""
        return True

    def mismatch(self, vehicle: Vehicle) -> str:
        """Why these parameters cannot be those of `vehicle`; empty: they can."""
        return ""

    def shows_in(self, vehicle: Vehicle) -> tuple[str, ...]:
        """Axes of the moments (roll, pitch, yaw) whose error it must lower, all of them, to be what it says it is."""
        return ()

    def standing_back(self) -> Self:
        """The same effect beside one that it stands back for: without what that one says better."""
        return self

    def rotor_thrust(self, thrust_n: Sequence[Number], c: Conditions, vehicle: Vehicle) -> Sequence[Number]:
        """Thrust of each rotor, N, given what it would be without this effect."""
        return thrust_n

    def force(self, total_thrust_n: Number, c: Conditions, vehicle: Vehicle) -> Vector:
        """Further force on the body, FRD, N; `total_thrust_n` is the thrust of all rotors, all effects included."""
        return NO_FORCE

    def torque(self, thrust_n: Sequence[Number], c: Conditions, vehicle: Vehicle) -> Vector:
        """Further moment on the body, FRD, N m; `thrust_n` is the thrust of each rotor, all effects included."""
        return NO_TORQUE

    def wind_ned_m_s(self, c: Conditions) -> Vector:
        """Velocity of the air over ground, NED."""
        return NO_WIND

    def sensed_m_s2(self, c: Conditions) -> Vector:
        """What the accelerometer reads beyond the specific force, FRD."""
        return NO_BIAS


@dataclass(frozen=True)
class ThrustRatio(Effect):
    """An effect that multiplies the thrust of all rotors by the same ratio."""

    def ratio(self, c: Conditions, vehicle: Vehicle) -> Number:
        """Thrust with the effect over thrust without it."""
        raise TypeError(f"{type(self).__name__} does not say its thrust ratio")

    def rotor_thrust(self, thrust_n: Sequence[Number], c: Conditions, vehicle: Vehicle) -> Sequence[Number]:
        ratio = self.ratio(c, vehicle)
        return [ratio * thrust for thrust in thrust_n]
