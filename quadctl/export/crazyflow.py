"""A model as parameters of `first_principles.dynamics` of the Python packages crazyflow and drone-models.

Their world points up and their body is forward, left, up: read here as north, west, up. The thrust of a rotor is a
polynomial of its speed in rpm, the drag is linear in the velocity along the body's axes.
"""

import math
from typing import NamedTuple

from quadctl.effects.inflow import AxialInflow
from quadctl.effects.motor_lag import FirstOrderLag
from quadctl.effects.rotor_drag import LinearDrag
from quadctl.effects.rotor_reaction import InertialReaction
from quadctl.effects.thrust_scale import ConstantScale
from quadctl.errors import SettingsError
from quadctl.export.centred import centred
from quadctl.export.equations import commands_left_out, effect_left_out
from quadctl.export.left_out import Kind
from quadctl.frames import GRAVITY_M_S2
from quadctl.model import Model
from quadctl.vehicle import Vehicle
from quadctl.words import Fact, fact

N_ROTORS = 4
LEAST_LAG_S = 1e-3
"""Time constant of the rotors below which their speed follows at once; the target divides by it."""


class Parameters(NamedTuple):
    """Parameters by their names in crazyflow, numbers or nested lists, and what they leave out of the model."""

    values: dict[str, object]
    left_out: tuple[Fact, ...]


def parameters(model: Model) -> Parameters:
    """Parameters of a model.

    Raises
    ------
    SettingsError
        The target cannot hold the vehicle: it has other than four rotors, or tilted ones.
    """
    model = centred(model)
    vehicle = model.vehicle
    _require_rotors(vehicle)
    scale, drag_kg_s, rotor_inertia = 1.0, [0.0, 0.0, 0.0], 0.0
    lag_s, left_out = vehicle.rotor.time_constant_s, commands_left_out(model, "crazyflow")
    for effect in model.effects:
        if isinstance(effect, ConstantScale):
            scale *= effect.factor
        elif isinstance(effect, LinearDrag):
            for axis, deceleration in enumerate((effect.d_x, effect.d_y, effect.d_z)):
                drag_kg_s[axis] += vehicle.mass_kg * deceleration
        elif isinstance(effect, AxialInflow):
            drag_kg_s[2] += effect.k * vehicle.weight_n / vehicle.hover_induced_velocity_m_s
            form = {"model": "proportional to the thrust", "target": "constant in crazyflow", "equal": "equal"}
            left_out.append(fact(Kind.OTHER_FORM, effect=effect.name, **form))
        elif isinstance(effect, InertialReaction):
            rotor_inertia = effect.rotor_inertia_kg_m2(vehicle)
        elif isinstance(effect, FirstOrderLag):
            lag_s += effect.time_constant_s
            lag = "one of their sum in crazyflow, of speed, not of thrust"
            left_out.append(fact(Kind.TWO_LAGS, effect=effect.name, target=lag))
        else:
            left_out.append(effect_left_out(effect, "crazyflow's first_principles", by_speeds=True))
    thrust_n_per_rpm2 = scale * vehicle.rotor.thrust_n_per_rpm2
    inertia = vehicle.principal_inertia_kg_m2
    rate = 1.0 / max(lag_s, LEAST_LAG_S)
    arm_m = max(abs(length) for rotor in vehicle.rotors for length in rotor.position_m[:2])
    values: dict[str, object] = {
        "mass": vehicle.mass_kg,
        "L": arm_m,
        "prop_inertia": rotor_inertia,
        "gravity_vec": [0.0, 0.0, -GRAVITY_M_S2],
        "J": _diagonal(inertia),
        "J_inv": _diagonal([1.0 / moment for moment in inertia]),
        "rpm2thrust": [0.0, 0.0, thrust_n_per_rpm2],
        "rpm2torque": [0.0, 0.0, vehicle.rotor.torque_to_thrust_m * thrust_n_per_rpm2],
        "mixing_matrix": [
            [0.0 - rotor.position_m[1] / arm_m for rotor in vehicle.rotors],
            [0.0 - rotor.position_m[0] / arm_m for rotor in vehicle.rotors],
            [1.0 if rotor.spin == "cw" else -1.0 for rotor in vehicle.rotors],
        ],
        "drag_matrix": _diagonal([0.0 - drag for drag in drag_kg_s]),
        "rotor_dyn_coef": [rate, 0.0, rate, 0.0],
    }
    return Parameters(values, tuple(left_out))


def crazyflow_code(model: Model) -> tuple[str, tuple[Fact, ...]]:
    """Text of a Python file with `parameters`, and what it leaves out."""
    values, left_out = parameters(model)
    text = "\n".join(
        [
            f'"""Parameters of {model.name} for first_principles.dynamics of crazyflow and drone-models.',
            "",
            "Written by quadctl. World: north, west, up; body: forward, left, up; quaternion: x, y, z, w; rotors: rpm.",
            "Use: dynamics(pos, quat, vel, ang_vel, cmd, rotor_vel, dist_f, dist_t, **parameters).",
            "dist_f, N, and dist_t, N m, are a slow force and moment, both along world axes.",
            *(f"Left out: {reason}." for reason in left_out),
            '"""',
            "",
            "import numpy as np",
            "",
            "parameters = {",
            *(f"    {name!r}: np.array({value!r})," for name, value in values.items()),
            "}",
            "",
        ]
    )
    return text, left_out


def _diagonal(values: list[float] | tuple[float, float, float]) -> list[list[float]]:
    return [[value if i == j else 0.0 for j in range(3)] for i, value in enumerate(values)]


def _require_rotors(vehicle: Vehicle) -> None:
    if vehicle.n_rotors != N_ROTORS or any(math.hypot(*rotor.axis[:2]) > 1e-6 for rotor in vehicle.rotors):
        raise SettingsError(
            f"{vehicle.name}: has {vehicle.n_rotors} rotors, expected {N_ROTORS} upright ones, as crazyflow: "
            "--to casadi and --to numpy take any"
        )
