"""The equations of motion of a model as CasADi functions, for controllers and observers.

The effects' own code is evaluated with symbols: there is no second copy of the physics.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from quadctl.effects.base import Conditions
from quadctl.errors import SettingsError
from quadctl.export.equations import (
    FAILURES,
    PARAMETERS,
    SHARE,
    STATE,
    Actuation,
    actuation,
    cannot_be_evaluated,
    left_out,
    parameters,
)
from quadctl.frames import GRAVITY_M_S2, rotate, rotate_inverse
from quadctl.model import Model
from quadctl.numeric import SYMBOLIC, Vector, plus
from quadctl.observer import DISTURBANCES, Observer
from quadctl.words import Fact

SAMPLE_STATE = (0.3, -0.2, -0.7, 1.1, -0.6, 0.4, 0.94, 0.14, -0.1, 0.295, 0.1, -0.2, 0.3)
SAMPLE_PARAMETERS = (14.6, 12.3)
"""A flight condition, in which each new function is compared with the model."""
_FUNCTIONS = {
    **{name: getattr(ca, name) for name in ("exp", "sqrt", "sin", "cos", "asin", "atan2")},
    "minimum": ca.fmin,
    "maximum": ca.fmax,
    "where": ca.if_else,
    "clip": lambda value, low, high: ca.fmin(ca.fmax(value, low), high),
    # What is nan is neither above 0 nor at most 0; CasADi takes `value == value` for true.
    "known_or": lambda value, otherwise: ca.if_else(ca.logic_or(value <= 0.0, value > 0.0), value, otherwise),
}
SYMBOLIC[ca.SX] = lambda name, *arguments: _FUNCTIONS[name](*arguments)


class Dynamics(NamedTuple):
    """Equations of motion and what they leave out."""

    function: ca.Function
    """x, u, p -> x_dot, with x as in STATE, u the nominal thrust of each rotor, k rpm², N, and p as in `parameters`."""
    commanded: ca.Function
    """The same with the states of the rotors behind those of x, and u the command of each rotor, 0..1."""
    disturbed: ca.Function | None
    """The same with the states of slow forces and moments behind those, which fade; None for a model without an
    observer."""
    foreseen: ca.Function | None
    """The same as a forecast of flights under one controller trusts it; None as `disturbed`."""
    states: tuple[str, ...]
    """Names of the states of `disturbed`, or of `commanded`."""
    parameters: tuple[str, ...]
    left_out: tuple[Fact, ...]
    """Parts of the model that are not in the functions, each with the reason."""


def dynamics(model: Model) -> Dynamics:
    """Equations of motion of the model.

    Raises
    ------
    SettingsError
        An effect cannot be evaluated with symbols.
    """
    stages, names = actuation(model), parameters(model)
    n = model.vehicle.n_rotors
    x, p, u = ca.SX.sym("x", len(STATE)), ca.SX.sym("p", len(names)), ca.SX.sym("u", n)
    rotors = ca.SX.sym("rotors", len(stages.states(n)))
    try:
        here = _conditions(model, _each(x), _each(p), names)
        prompt = _motion(model, stages, x, _each(u), here)
        whole = _commanded(model, stages, x, _each(rotors), _each(u), here)
    except FAILURES as error:
        raise cannot_be_evaluated(_culprit(model), error) from None
    function = ca.Function("quadrotor", [x, u, p], [ca.vertcat(*prompt)], ["x", "u", "p"], ["x_dot"])
    if not _is_as_the_model(function, model, names):
        raise cannot_be_evaluated(_culprit(model), "it then gives other numbers")
    states = ca.vertcat(x, rotors)
    commanded = ca.Function("commanded", [states, u, p], [ca.vertcat(*whole)], ["x", "u", "p"], ["x_dot"])
    disturbed, foreseen, names_of_states = None, None, (*STATE, *stages.states(n))
    if model.observer is not None:
        d, names_of_states = ca.SX.sym("disturbances", len(DISTURBANCES)), (*names_of_states, *DISTURBANCES)
        moved = _disturbed(whole, _each(d), model.observer)
        trusted = list(moved)
        for row, (share, damping_1_s) in enumerate(model.observer.trusted, start=10):
            trusted[row] = share * moved[row] - damping_1_s * x[row]
        disturbed, foreseen = (
            ca.Function(name, [ca.vertcat(states, d), u, p], [ca.vertcat(*rate)], ["x", "u", "p"], ["x_dot"])
            for name, rate in (("disturbed", moved), ("foreseen", trusted))
        )
    return Dynamics(function, commanded, disturbed, foreseen, names_of_states, names, left_out(model, stages))


def _conditions(model: Model, x: Sequence[Any], p: Sequence[Any], names: Sequence[str]) -> Conditions:
    """Conditions of a state, with the velocity relative to the air."""
    attitude = x[6], x[7], x[8], x[9]
    shares = tuple((name.removeprefix(SHARE), p[i]) for i, name in enumerate(names) if name.startswith(SHARE))
    return model.in_air(
        Conditions(
            height_m=model.vehicle.rotor_height_m - x[2],
            velocity_body_m_s=rotate_inverse(attitude, (x[3], x[4], x[5])),
            attitude=attitude,
            time_s=p[1],
            battery_v=p[0],
            position_ne_m=(x[0], x[1]),
            surfaces=shares,
            rates_rad_s=(x[10], x[11], x[12]),
        )
    )


def _commanded(
    model: Model, stages: Actuation, x: ca.SX, rotors: list[ca.SX], command: list[ca.SX], here: Conditions
) -> list[ca.SX]:
    line, n = model.vehicle.throttle, model.vehicle.n_rotors
    rates: list[ca.SX] = []
    thrust = [ca.fmax(share - line.offset, 0.0) / (line.per_newton * n) for share in command]
    if stages.rotors is not None:
        following, rotors = rotors[:n], rotors[n:]
        rates += _lag(following, thrust, stages.rotors.time_constant_s)
        thrust = following
    if stages.late is None:
        here = replace(here, thrust_rate_n_s=rates)
        return [*_motion(model, stages, x, thrust, here), *rates]
    rates += _lag(rotors, stages.before.rotor_thrust(thrust, here), stages.late.time_constant_s)
    here = replace(here, thrust_rate_n_s=rates[-n:])
    return [*_moved(model, x, stages.after.rotor_thrust(rotors, here), here), *rates]


def _disturbed(rates: list[ca.SX], d: list[ca.SX], observer: Observer) -> list[ca.SX]:
    """Derivatives with those of disturbances, which move velocity and body rates."""
    moved, axes = list(rates), len(d) // 2
    for axis, row in enumerate((3, 4, 5, 10, 11, 12)):
        moved[row] += d[axis] + d[axes + axis]
    return [*moved, *(-now / lasting_s for now, lasting_s in zip(d, observer.lasting_s, strict=True))]


def _lag(thrust: Sequence[ca.SX], wanted: Sequence[ca.SX], time_constant_s: float) -> list[ca.SX]:
    return [(goal - now) / time_constant_s for now, goal in zip(thrust, wanted, strict=True)]


def _motion(model: Model, stages: Actuation, x: ca.SX, nominal: Sequence[ca.SX], here: Conditions) -> list[ca.SX]:
    thrust = stages.after.rotor_thrust(stages.before.rotor_thrust(nominal, here), here)
    return _moved(model, x, thrust, here)


def _moved(model: Model, x: ca.SX, thrust: Sequence[ca.SX], here: Conditions) -> list[ca.SX]:
    """Derivative of the state by the thrust of each rotor, all effects on it included."""
    velocity, attitude, rates = (x[3], x[4], x[5]), (x[6], x[7], x[8], x[9]), (x[10], x[11], x[12])
    vehicle = model.vehicle
    force = plus(vehicle.rotor_force(thrust), model.side_force(sum(thrust), here))
    torque = plus(vehicle.rotor_torque(thrust), model.side_torque(thrust, here))
    acceleration = [component / vehicle.mass_kg for component in rotate(attitude, force)]
    acceleration[2] += GRAVITY_M_S2
    return [*velocity, *acceleration, *_attitude_rate(attitude, rates), *_rates_rate(model, torque, rates)]


def _each(symbols: ca.SX) -> list[ca.SX]:
    return [symbols[i] for i in range(symbols.numel())]


def _culprit(model: Model) -> str:
    """Name of the effect whose code takes numbers only; of the model where it is none by itself."""
    for item in model.stack if len(model.stack) > 1 else ():
        try:
            dynamics(replace(model, stack=(item,)))
        except SettingsError:
            return item.effect.name
    return model.effects[0].name if len(model.stack) == 1 else model.name


def _is_as_the_model(function: ca.Function, model: Model, names: Sequence[str]) -> bool:
    """True where the equations give the model's own accelerations in one flight condition that is nothing special.

    CasADi takes a symbol for nan where code makes a number of it, and says nothing.
    """
    nominal_n = [(0.2 + 0.01 * i) * model.vehicle.weight_n for i in range(model.vehicle.n_rotors)]
    p = [*SAMPLE_PARAMETERS, *[0.3] * (len(names) - len(PARAMETERS))]
    here = _conditions(replace(model, stack=()), SAMPLE_STATE, p, names)
    expected = model.prompt().acceleration_ned(nominal_n, here)
    found = np.array(function(SAMPLE_STATE, nominal_n, p)).ravel()[3:6]
    return bool(np.allclose(found, np.array(expected, dtype=float), rtol=1e-9, atol=1e-9))


def _attitude_rate(q: tuple[ca.SX, ...], rates: tuple[ca.SX, ...]) -> tuple[ca.SX, ...]:
    """Half of q times (0, rates)."""
    w, x, y, z = q
    p, r, s = rates
    return (
        0.5 * (-x * p - y * r - z * s),
        0.5 * (w * p + y * s - z * r),
        0.5 * (w * r + z * p - x * s),
        0.5 * (w * s + x * r - y * p),
    )


def _rates_rate(model: Model, torque: Vector, rates: tuple[ca.SX, ...]) -> tuple[ca.SX, ...]:
    """Euler's equations about the principal axes."""
    jx, jy, jz = model.vehicle.principal_inertia_kg_m2
    p, r, s = rates
    return (
        (torque[0] - (jz - jy) * r * s) / jx,
        (torque[1] - (jx - jz) * s * p) / jy,
        (torque[2] - (jy - jx) * p * r) / jz,
    )
