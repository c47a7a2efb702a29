"""The equations of motion of a model as a CasADi function, for controllers and observers.

The effects' own code is evaluated with symbols: there is no second copy of the physics.
"""

from typing import NamedTuple

import casadi as ca

from quadctl.effects.base import Conditions
from quadctl.errors import SettingsError
from quadctl.frames import GRAVITY_M_S2, rotate, rotate_inverse
from quadctl.model import Loads, Model, conditions
from quadctl.numeric import SYMBOLIC, Vector

STATE = (
    *("north_m", "east_m", "down_m", "v_north_m_s", "v_east_m_s", "v_down_m_s"),
    *("q_w", "q_x", "q_y", "q_z", "roll_rate_rad_s", "pitch_rate_rad_s", "yaw_rate_rad_s"),
)
"""Position and velocity NED, attitude body to world, body rates FRD."""
PARAMETERS = ("battery_v", "time_s")
_FUNCTIONS = {
    **{name: getattr(ca, name) for name in ("exp", "sqrt", "sin", "cos", "asin", "atan2")},
    "minimum": ca.fmin,
    "maximum": ca.fmax,
    "where": ca.if_else,
}
SYMBOLIC[ca.SX] = lambda name, *arguments: _FUNCTIONS[name](*arguments)


class Dynamics(NamedTuple):
    """Equations of motion and what they leave out."""

    function: ca.Function
    """x, u, p -> x_dot, with x as in STATE, u the nominal thrust of each rotor, k rpm², N, and p as in PARAMETERS."""
    left_out: tuple[str, ...]
    """Effects of the model that are not in the function, each with the reason."""


def dynamics(model: Model) -> Dynamics:
    """Equations of motion of the model.

    Raises
    ------
    SettingsError
        An effect cannot be evaluated with symbols.
    """
    vehicle, prompt = model.vehicle, model.prompt()
    left_out = tuple(
        f"{effect.name}: {'its delay is a state of its own' if effect.adds_lag else 'an error of the accelerometer'}"
        for effect in model.effects
        if effect.adds_lag or effect.affects_accelerometer
    )
    x, u, p = ca.SX.sym("x", len(STATE)), ca.SX.sym("u", vehicle.n_rotors), ca.SX.sym("p", len(PARAMETERS))
    velocity, attitude, rates = (x[3], x[4], x[5]), (x[6], x[7], x[8], x[9]), (x[10], x[11], x[12])
    body = rotate_inverse(attitude, velocity)
    here = conditions(vehicle, -x[2], body, attitude, time_s=p[1], battery_v=p[0], position_ne_m=(x[0], x[1]))
    force, torque = _loads(prompt, [u[i] for i in range(vehicle.n_rotors)], here)
    push = rotate(attitude, force)
    acceleration = [component / vehicle.mass_kg for component in push]
    acceleration[2] += GRAVITY_M_S2
    x_dot = ca.vertcat(*velocity, *acceleration, *_attitude_rate(attitude, rates), *_rates_rate(model, torque, rates))
    function = ca.Function("quadrotor", [x, u, p], [x_dot], ["x", "u", "p"], ["x_dot"])
    return Dynamics(function, left_out)


def _loads(model: Model, thrust: list[ca.SX], here: Conditions) -> Loads:
    try:
        return model.loads(thrust, here)
    except (TypeError, NotImplementedError, RuntimeError) as error:
        for effect in model.effects:  # which one it is
            alone = Model(model.vehicle).plus(effect)
            try:
                alone.loads(thrust, here)
            except (TypeError, NotImplementedError, RuntimeError):
                raise SettingsError(
                    f"{effect.name} cannot be evaluated with symbols ({error}): use the functions of quadctl.numeric"
                ) from None
        raise


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
