"""The base of all effects: a frozen dataclass of bounded parameters, and pure functions of the flight conditions.

The same object predicts (arrays: a whole log), compensates (floats: one control tick) and simulates (floats: one
physics step). An effect has three parts: `Physics`, what it does; `Prior`, what is likely before a flight is seen; and
`Identifiability`, what flights must have to show it. Only the first is needed, by one of these methods:

- `rotor_thrust`: it changes the thrust that each rotor gives at its speed (ground effect, inflow, ...);
- `force`: it adds a force on the body that is not along the rotors' axes (drag, a tilted thrust axis, ...);
- `torque`: it adds a moment on the body that is not the rotors';
- `wind_ned_m_s`: it moves the air, which all effects of the air then feel;
- `sensed_m_s2`: it makes the accelerometer read what is not there.
"""

import dataclasses
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Self, cast

from quadctl.errors import SettingsError
from quadctl.frames import Quaternion
from quadctl.numeric import Number, Vector
from quadctl.surfaces import Shares
from quadctl.vehicle import Vehicle
from quadctl.words import nearest

NO_FORCE: Vector = (0.0, 0.0, 0.0)
NO_TORQUE: Vector = (0.0, 0.0, 0.0)
NO_WIND: Vector = (0.0, 0.0, 0.0)
NO_BIAS: Vector = (0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True)
class Conditions:
    """Flight conditions that an effect may depend on; each field is one value, or one per sample, shape (n,)."""

    height_m: Number
    """Height of the rotor plane above the ground."""
    velocity_body_m_s: Vector
    """Velocity relative to the air, FRD; over ground where no wind is known."""
    attitude: Quaternion
    """Attitude, body to world."""
    time_s: Number = 0.0
    """Time since the start of the log or flight."""
    battery_v: Number = float("nan")
    position_ne_m: tuple[Number, Number] = (0.0, 0.0)
    """Position north and east, from the origin of the log."""
    surfaces: Shares = ()
    """Named surfaces of the ground below, each with its share; none where the flight does not say."""
    flight: int = 0
    """Number of the flight among those that are analysed together, from 1; 0 where there is but one."""
    rates_rad_s: Vector = (0.0, 0.0, 0.0)
    """Body rates, FRD; zero where they are not known."""
    thrust_rate_n_s: Sequence[Number] = ()
    """Rate of change of the nominal thrust of each rotor; none where it is not known."""


@dataclass(frozen=True, slots=True)
class Parameter:
    """Declaration of one parameter; its bounds are what physics allows."""

    name: str
    default: float
    low: float
    high: float
    unit: str
    meaning: str
    fitted: bool = True
    """False: not fitted but kept at its value, which the effect's `starts` may choose from the data."""


def parameter(default: float, low: float, high: float, unit: str, meaning: str, *, fitted: bool = True) -> Any:
    """A dataclass field that declares a parameter of an effect."""
    return dataclasses.field(
        default=default,
        metadata={"default": default, "low": low, "high": high, "unit": unit, "meaning": meaning, "fitted": fitted},
    )


VARIABLES = (
    *("height_over_radius", "climb_rate", "speed_forward", "speed_right", "roll", "pitch"),
    *("thrust", "time", "battery", "north", "east"),
)
"""Variables that an effect can say it depends on; the compensator fades out an effect that depends on
`height_over_radius` beyond the heights of its data."""
SPANS = (*VARIABLES, "heading", "speed", "thrust_share")
"""Variables whose span in the data an effect can ask for."""
HOOKS = ("rotor_thrust", "force", "torque", "wind_ned_m_s", "sensed_m_s2")
"""Methods by which an effect acts, of which it overrides at least one."""
NUMBERS = ("thrust", "throttle", "exponent", "mass", "tilt", "lag")
"""Numbers of a vehicle that an effect can correct: the thrust of all rotors by one factor, the line from throttle to
thrust, the exponent of the thrust over the rotor speed, the mass, the tilt of the thrust and its lag."""


@dataclass(frozen=True)
class Parametric:
    """Physics with a name, and parameters with bounds: subclasses are frozen dataclasses whose fields are declared with
    `parameter`."""

    name: ClassVar[str]
    """Name as `family.variant`, as in model files."""
    source: ClassVar[str]
    """Source: paper and equation."""
    formula: ClassVar[str] = ""
    """Formula in LaTeX's mathematics; where it is empty a paper names the effect with its parameters."""
    physics: ClassVar[str]
    """One sentence for the user: the physical cause and its consequence."""
    distinguished_by: ClassVar[str]
    """Kind of flight that distinguishes it from effects that look alike."""
    mission: ClassVar[str]
    """Mission file that shows this effect best."""

    @classmethod
    def family(cls) -> str:
        return cls.name.partition(".")[0]

    @classmethod
    def parameters(cls) -> tuple[Parameter, ...]:
        return tuple(Parameter(name=field.name, **field.metadata) for field in dataclasses.fields(cls))

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


class Physics:
    """Physics of an effect: what it does to the vehicle, and by which variables."""

    depends_on: ClassVar[tuple[str, ...]]
    """Variables that this effect varies with, of `VARIABLES`."""
    affects_moment: ClassVar[bool] = False
    """True: it changes the moments on the body by enough for the balance of moments to show it. Declared by an effect
    that changes the thrust of the rotors unequally; what has a `torque` has it by itself."""
    adds_lag: ClassVar[bool] = False
    """True: it delays the thrust, so that the delay of the log must be estimated together with it."""
    needs_thrust_rate: ClassVar[bool] = False
    """True: it depends on `Conditions.thrust_rate_n_s`, which is computed for such effects only."""
    stands_back_for: ClassVar[tuple[str, ...]] = ()
    """Families that model a part of it better: in a stack with one of them, `standing_back` takes its place."""
    not_for_flight: ClassVar[str] = ""
    """Reason why a compensator must not hold this effect; empty where it may."""

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        if cls.acts_by("torque"):
            cls.affects_moment = True

    @classmethod
    def acts_by(cls, hook: str) -> bool:
        """True where it acts by this method, of `HOOKS`."""
        return getattr(cls, hook) is not getattr(Physics, hook)

    def rotor_thrust(self, thrust_n: Sequence[Number], c: Conditions, vehicle: Vehicle) -> Sequence[Number]:
        """Thrust of each rotor, N, from `thrust_n`, the thrust without this effect."""
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
        """Reading of the accelerometer beyond the specific force, FRD."""
        return NO_BIAS

    def standing_back(self) -> Self:
        """The same effect without the part that an effect of `stands_back_for` models better."""
        return self


class Prior:
    """Prior of an effect: the parameters that are possible and likely before a flight is seen, beside their bounds."""

    reversible: ClassVar[bool] = False
    """True: the effect with opposite sign explains as much at the start, so that a fit may go either way."""
    corrects: ClassVar[tuple[str, ...]] = ()
    """Numbers of the vehicle that it corrects, of `NUMBERS`, where it is nothing else. Of two effects that correct the
    same number one is no alternative to the other."""

    @classmethod
    def applies_to(cls, vehicle: Vehicle) -> bool:
        """True where `vehicle` can have this effect; the lab does not try it otherwise."""
        return True

    @classmethod
    def starts(cls, flights: Sequence[Conditions], vehicle: Vehicle) -> "Sequence[Effect]":
        """Initial guesses for a fit to these flights: several where the error has several local minima.

        Parameters that are not fitted keep the value of the start that explains most.
        """
        return [cast("Effect", cls())]

    def closer(self, flights: Sequence[Conditions]) -> "Sequence[Effect]":
        """Further initial guesses near this one, tried where it explains most: a fine search after the coarse one."""
        return []

    @classmethod
    def joined(cls, explained: "Mapping[Effect, float]") -> "Sequence[Effect]":
        """Further initial guesses that join several of those tried, of which each explains some squared error."""
        return []

    def negligible(self) -> bool:
        """True where it is smaller than the usual error of coefficients and trims: then it is not called missing."""
        return False

    def mismatch(self, vehicle: Vehicle) -> str:
        """Reason why these parameters cannot be those of `vehicle`; empty where they can."""
        return ""

    def believable(self, flights: Sequence[Conditions], vehicle: Vehicle) -> bool:
        """True where the parameters fitted to these flights are physically possible for this effect; otherwise its form
        stands in for another effect."""
        return True


class Identifiability:
    """Identifiability of an effect: what flights must have to show it, and what it is confounded with."""

    candidate: ClassVar[bool] = True
    """False: the lab does not propose it by itself; a model file may still name it."""
    needs: ClassVar[dict[str, float]] = {}
    """Span of each variable, of `SPANS`, that the data must have to tell this effect from others."""
    only_without_rotor_speeds: ClassVar[bool] = False
    """True: it is an error of the way from a command to the thrust, which measured rotor speeds do not go."""
    only_of_several_flights: ClassVar[bool] = False
    """True: it says in what flights differ, so that one flight alone has nothing of it."""
    essential: ClassVar[tuple[str, ...]] = ()
    """Parameters of which data must show one to differ from 0: without them it is another effect, as a wind of 0 m/s is
    a drag."""

    if_constant: ClassVar[str] = ""
    """Name of the effect that is left of it where the variables that it depends on do not change."""

    def distinct(self, flights: Sequence[Conditions], vehicle: Vehicle) -> bool:
        """True where these flights can tell it, with the parameters fitted to them, from effects that look alike."""
        return True

    def implied_by(self, others: "Sequence[Effect]", flights: Sequence[Conditions], vehicle: Vehicle) -> bool:
        """True where `others`, the other effects of the model, imply this one at about this size, or leave a constant
        open that it stands for: then it is no discovery of its own."""
        return False

    def shows_in(self, vehicle: Vehicle) -> tuple[str, ...]:
        """Axes (roll, pitch, yaw; up) whose error must fall, on each of them, for the effect to be accepted."""
        return ()

    def inseparable_from(
        self, missing: Collection[str], ci95: Mapping[str, tuple[float, float]], span: Callable[[str], float]
    ) -> Sequence[str]:
        """Families that hardly any flight separates from this effect, which was found among the families `missing`.

        `ci95` are the intervals of its parameters, and `span` gives the span of a variable, of `SPANS`, in the data.
        """
        return ()


@dataclass(frozen=True)
class Effect(Physics, Prior, Identifiability, Parametric):
    """Base of all effects on the motion: its three parts, with the name and the parameters."""


@dataclass(frozen=True)
class ThrustRatio(Effect):
    """An effect that multiplies the thrust of all rotors by the same ratio."""

    def ratio(self, c: Conditions, vehicle: Vehicle) -> Number:
        """Thrust with the effect over thrust without it."""
        raise TypeError(f"{type(self).__name__} does not say its thrust ratio")

    def rotor_thrust(self, thrust_n: Sequence[Number], c: Conditions, vehicle: Vehicle) -> Sequence[Number]:
        ratio = self.ratio(c, vehicle)
        return [ratio * thrust for thrust in thrust_n]
