"""Equations: what all files of them hold alike, and what they leave out.

Between the command of a rotor and its thrust there are stages, each a lag with states of its own. The throttle line of
the vehicle file makes a nominal thrust of a command, which the rotors follow with the lag that the file states. A motor
lag of the model comes later: at its place in the stack of effects, so that the effects before it are late, too, as in
the lab's prediction.
"""

from dataclasses import replace
from typing import NamedTuple

from quadctl.effects import Effect
from quadctl.effects.ground_effect_surfaces import Surfaces
from quadctl.effects.motor_lag import FirstOrderLag
from quadctl.effects.per_flight import PerFlight
from quadctl.errors import SettingsError
from quadctl.export.left_out import Kind
from quadctl.model import Model
from quadctl.words import Fact, fact

STATE = (
    *("north_m", "east_m", "down_m", "v_north_m_s", "v_east_m_s", "v_down_m_s"),
    *("q_w", "q_x", "q_y", "q_z", "roll_rate_rad_s", "pitch_rate_rad_s", "yaw_rate_rad_s"),
)
"""Position and velocity NED, attitude body to world, body rates FRD."""
PARAMETERS = ("battery_v", "time_s")
"""Further inputs of the equations; after these come the shares of surfaces that the model names."""
SHARE = "share_"
"""Beginning of the name of the share of a surface in the ground below."""
FAILURES = (TypeError, AttributeError, NotImplementedError, RuntimeError)
"""Errors of code that takes numbers only."""


class Stage(NamedTuple):
    """A first-order lag of the thrust of each rotor."""

    name: str
    """Beginning of the names of its states."""
    said: str
    """Whose lag it is."""
    time_constant_s: float

    @property
    def constant(self) -> str:
        """Name of its time constant."""
        return f"{self.name.upper()}_TIME_CONSTANT_S"

    def states(self, n_rotors: int) -> tuple[str, ...]:
        return tuple(f"{self.name}_{i}_n" for i in range(1, n_rotors + 1))


class Actuation(NamedTuple):
    """Stages of a model, and its effects before and after the later one, which act without delay."""

    rotors: Stage | None
    """The lag of the vehicle file; None where it states none."""
    late: Stage | None
    """The motor lag of the model; None where it holds none."""
    before: Model
    after: Model
    left_out: tuple[Fact, ...]

    @property
    def stages(self) -> tuple[Stage, ...]:
        return tuple(stage for stage in (self.rotors, self.late) if stage is not None)

    def states(self, n_rotors: int) -> tuple[str, ...]:
        """Names of the states of all stages: thrusts, N."""
        return tuple(name for stage in self.stages for name in stage.states(n_rotors))


def actuation(model: Model) -> Actuation:
    """The stages of a model."""
    lag_s = model.vehicle.rotor.time_constant_s
    place, late, left_out = len(model.stack), None, []
    for i, effect in enumerate(model.effects):
        if isinstance(effect, FirstOrderLag):
            place = i
            late = (
                Stage("late", f"{effect.name}, after the rotors' own", effect.time_constant_s)
                if effect.time_constant_s > 0.0
                else None
            )
        elif effect.adds_lag:
            left_out.append(fact(Kind.OTHER_DELAY, effect=effect.name))
    return Actuation(
        Stage("rotor", "the rotors', by the vehicle file", lag_s) if lag_s > 0.0 else None,
        late,
        replace(model, stack=model.stack[:place]).prompt(),
        replace(model, stack=model.stack[place:]).prompt(),
        tuple(left_out),
    )


def parameters(model: Model) -> tuple[str, ...]:
    """Names of what the equations of a model depend on, beside state and input."""
    named = (surface for effect in model.effects if isinstance(effect, Surfaces) for surface in effect.surfaces)
    return (*PARAMETERS, *(f"{SHARE}{surface}" for surface in dict.fromkeys(named)))


def delay_left_out(model: Model) -> list[Fact]:
    """The delay of the command, which no target can hold; none where there is none."""
    if (delay := model.command_delay_s) is None:
        return []
    return [fact(Kind.DELAY, **dict(zip(("delay_s", "low_s", "high_s"), delay, strict=True)))]


def commands_left_out(model: Model, target: str) -> list[Fact]:
    """Parts of the model before the speeds of the rotors, for a target that is commanded by these."""
    line = model.vehicle.throttle
    throttle = fact(Kind.THROTTLE_LINE, offset=line.offset, per_newton=line.per_newton, target=target)
    return [throttle, *delay_left_out(model), *observer_left_out(model, target)]


def observer_left_out(model: Model, target: str) -> list[Fact]:
    """The observer, for a target that has no states of slow forces and moments; none where the model has none."""
    return [fact(Kind.OBSERVER, target=target)] if model.observer is not None else []


def effect_left_out(effect: Effect, target: str, *, by_speeds: bool = False) -> Fact:
    """An effect for which a target has no parameter; a map of the command means nothing where it is commanded
    `by_speeds`."""
    of_command = by_speeds and effect.only_without_rotor_speeds
    return fact(Kind.OF_COMMAND if of_command else Kind.NO_PARAMETER, effect=effect.name, target=target)


def left_out(model: Model, stages: Actuation) -> tuple[Fact, ...]:
    """Parts of a model that its equations do not hold, each with the reason."""
    found = [*stages.left_out, *delay_left_out(model)]
    for effect in model.effects:
        if effect.needs_thrust_rate:
            found.append(fact(Kind.THRUST_RATE if stages.stages else Kind.NO_LAG, effect=effect.name))
        if effect.acts_by("sensed_m_s2"):
            found.append(fact(Kind.SENSED, effect=effect.name))
        flight = effect.values().get("flight", 0.0)
        if flight > 0.0:
            found.append(fact(Kind.LATER_FLIGHT, effect=effect.name, flight=flight))
        elif isinstance(effect, PerFlight) and effect.numbers:
            found.append(fact(Kind.OF_FLIGHTS, effect=effect.name, flights=effect.numbers))
    return tuple(found)


def cannot_be_evaluated(name: str, why: object) -> SettingsError:
    """The error of an effect whose code takes numbers only."""
    return SettingsError(f"{name} cannot be evaluated with symbols ({why}): use the functions of quadctl.numeric")
