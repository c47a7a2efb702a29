"""A model as the vehicle parameters of RotorPy (Folk et al. 2023, arXiv 2306.04485), a Python file.

RotorPy's world points up and its body is forward, left, up: read here as north, west, up. Its rotor drag is
H = -omega diag(k_d, k_d, k_z) v at each rotor, its body drag D = -|v| diag(c_D) v, its lift k_h (u^2 + v^2) per rotor.
"""

import math
from collections.abc import Callable
from typing import NamedTuple

from quadctl.effects import Effect
from quadctl.effects.airspeed_moment import IsotropicMoment
from quadctl.effects.body_drag import QuadraticDrag
from quadctl.effects.inflow import AxialInflow
from quadctl.effects.motor_lag import FirstOrderLag
from quadctl.effects.rotor_drag import LinearDrag
from quadctl.effects.thrust_scale import ConstantScale
from quadctl.effects.translational_lift import HorizontalLift
from quadctl.errors import SettingsError
from quadctl.export.centred import centred
from quadctl.export.equations import commands_left_out, effect_left_out
from quadctl.export.left_out import Kind
from quadctl.frames import GRAVITY_M_S2
from quadctl.model import Model
from quadctl.vehicle import Vehicle
from quadctl.words import Fact, fact

ROTORPY_GRAVITY_M_S2 = 9.81
N_ROTORS = 4
_RAD_S_PER_RPM = math.pi / 30.0


class Parameters(NamedTuple):
    """Vehicle parameters of RotorPy, by their names there, and what they leave out of the model."""

    values: dict[str, object]
    left_out: tuple[Fact, ...]


def parameters(model: Model) -> Parameters:
    """RotorPy's parameters of a model.

    Drag of the rotors, inflow and translational lift are matched at the rotor speed of hover: in RotorPy they grow with
    that speed (the first two) or do not (the last).

    Raises
    ------
    SettingsError
        RotorPy cannot hold the vehicle: it has other than four rotors, or tilted ones.
    """
    model = centred(model)
    vehicle = model.vehicle
    _require_rotors(vehicle)
    scale = math.prod(effect.factor for effect in model.effects if isinstance(effect, ConstantScale))
    k_eta = scale * vehicle.rotor.thrust_n_per_rpm2 / _RAD_S_PER_RPM**2
    values: dict[str, object] = {
        "mass": vehicle.mass_kg,
        **dict(zip(("Ixx", "Iyy", "Izz"), vehicle.principal_inertia_kg_m2, strict=True)),
        **dict.fromkeys(("Ixy", "Iyz", "Ixz"), 0.0),
        "num_rotors": vehicle.n_rotors,
        "rotor_radius": vehicle.rotor.radius_m,
        "rotor_pos": {
            f"r{i}": (r.position_m[0], 0.0 - r.position_m[1], 0.0 - r.position_m[2])
            for i, r in enumerate(vehicle.rotors, start=1)
        },
        "rotor_directions": tuple(1 if r.spin == "cw" else -1 for r in vehicle.rotors),
        "rI": (0.0, 0.0, 0.0),
        "k_eta": k_eta,
        "k_m": vehicle.rotor.torque_to_thrust_m * k_eta,
        "tau_m": vehicle.rotor.time_constant_s,
        "rotor_speed_min": 0.0,
        "rotor_speed_max": math.sqrt(vehicle.throttle.max_thrust_per_rotor_n * scale / k_eta),
        "motor_noise_std": 0.0,
    }
    coefficients = dict.fromkeys(("c_Dx", "c_Dy", "c_Dz", "k_d", "k_z", "k_h", "k_flap"), 0.0)
    hover_rad_s = math.sqrt(vehicle.weight_n / vehicle.n_rotors / k_eta)
    left_out = [
        fact(
            Kind.GRAVITY,
            theirs=ROTORPY_GRAVITY_M_S2,
            ours=GRAVITY_M_S2,
            more=ROTORPY_GRAVITY_M_S2 - GRAVITY_M_S2,
        ),
        *commands_left_out(model, "RotorPy"),
    ]
    for effect in model.effects:
        if isinstance(effect, ConstantScale):
            continue
        if isinstance(effect, FirstOrderLag):
            values["tau_m"] = vehicle.rotor.time_constant_s + effect.time_constant_s
            lag = "tau_m is the sum; RotorPy's is of speed, not of thrust"
            left_out.append(fact(Kind.TWO_LAGS, effect=effect.name, target=lag))
            continue
        translate = _TRANSLATIONS.get(type(effect))
        if translate is None:
            left_out.append(effect_left_out(effect, "RotorPy's vehicle", by_speeds=True))
            continue
        added, remarks = translate(effect, vehicle, hover_rad_s)
        for name, value in added.items():
            coefficients[name] += value
        left_out += remarks
    return Parameters(values | coefficients, tuple(left_out))


def rotorpy_code(model: Model) -> tuple[str, tuple[Fact, ...]]:
    """Text of a Python file with `quad_params`, and what it leaves out."""
    values, left_out = parameters(model)
    lines = [f"    {name!r}: {_literal(name, value)}," for name, value in values.items()]
    text = "\n".join(
        [
            f'"""Vehicle parameters of {model.name} for RotorPy, written by quadctl.',
            "",
            "World: north, west, up; body: forward, left, up. Use: Multirotor(quad_params).",
            *(f"Left out: {reason}." for reason in left_out),
            '"""',
            "",
            "import numpy as np",
            "",
            "quad_params = {",
            *lines,
            "}",
            "",
        ]
    )
    return text, left_out


def _literal(name: str, value: object) -> str:
    if isinstance(value, dict):
        return "{" + ", ".join(f"{key!r}: np.array({list(place)!r})" for key, place in value.items()) + "}"
    return f"np.array({list(value)!r})" if isinstance(value, tuple) else repr(value)


def _require_rotors(vehicle: Vehicle) -> None:
    if vehicle.n_rotors != N_ROTORS:
        raise SettingsError(
            f"{vehicle.name}: has {vehicle.n_rotors} rotors, expected {N_ROTORS}: RotorPy's Multirotor inverts "
            "the matrix of its rotors"
        )
    for i, rotor in enumerate(vehicle.rotors, start=1):
        if rotor.cant_deg or rotor.dihedral_deg:
            raise SettingsError(
                f"{vehicle.name}: rotors[{i}] has cant_deg {rotor.cant_deg:g} and dihedral_deg {rotor.dihedral_deg:g}, "
                "expected 0: all rotors of RotorPy push along the body's z axis"
            )


_Translated = tuple[dict[str, float], list[Fact]]
"""Coefficients of RotorPy to be added, and what they leave out."""


def _rotor_drag(effect: Effect, vehicle: Vehicle, hover_rad_s: float) -> _Translated:
    assert isinstance(effect, LinearDrag)
    per_rotor = vehicle.mass_kg / (vehicle.n_rotors * hover_rad_s)
    form = {"model": "constant", "target": "RotorPy's grows with the rotor speed", "equal": "they are equal"}
    remarks = [fact(Kind.OTHER_FORM, effect=effect.name, **form)]
    if effect.d_x != effect.d_y:
        values = f"d_x {effect.d_x:g} and d_y {effect.d_y:g}"
        remarks.append(fact(Kind.DIFFERENCE, effect=effect.name, values=values, mean="k_d is of their mean"))
    return {"k_d": per_rotor * 0.5 * (effect.d_x + effect.d_y), "k_z": per_rotor * effect.d_z}, remarks


def _body_drag(effect: Effect, vehicle: Vehicle, hover_rad_s: float) -> _Translated:
    assert isinstance(effect, QuadraticDrag)
    half = 0.5 * vehicle.air_density_kg_m3
    areas = {"c_Dx": effect.area_x_m2, "c_Dy": effect.area_y_m2, "c_Dz": effect.area_z_m2}
    return {name: half * area for name, area in areas.items()}, []


def _inflow(effect: Effect, vehicle: Vehicle, hover_rad_s: float) -> _Translated:
    assert isinstance(effect, AxialInflow)
    loss = effect.k * vehicle.weight_n / vehicle.hover_induced_velocity_m_s
    thrust, speed = "proportional to the thrust", "to the rotor speed in RotorPy"
    remark = fact(Kind.OTHER_FORM, effect=effect.name, model=thrust, target=speed, equal="they are equal")
    return {"k_z": loss / (vehicle.n_rotors * hover_rad_s)}, [remark]


def _lift(effect: Effect, vehicle: Vehicle, hover_rad_s: float) -> _Translated:
    assert isinstance(effect, HorizontalLift)
    v_h = vehicle.hover_induced_velocity_m_s
    remark = fact(Kind.SATURATION, effect=effect.name, speed_m_s=v_h)
    return {"k_h": effect.gain * vehicle.weight_n / (vehicle.n_rotors * v_h**2)}, [remark]


def _flapping(effect: Effect, vehicle: Vehicle, hover_rad_s: float) -> _Translated:
    """RotorPy's moment of a rotor is -omega k_flap (v, -u, 0), v leftward; the model's T k (v, -u, 0) in these axes."""
    assert isinstance(effect, IsotropicMoment)
    moment = 1e-3 * effect.k * vehicle.weight_n
    thrust, speed = "proportional to the thrust", "to the rotor speed in RotorPy"
    remark = fact(Kind.OTHER_FORM, effect=effect.name, model=thrust, target=speed, equal="they are equal")
    return {"k_flap": -moment / (vehicle.n_rotors * hover_rad_s)}, [remark]


_TRANSLATIONS: dict[type[Effect], Callable[[Effect, Vehicle, float], _Translated]] = {
    LinearDrag: _rotor_drag,
    QuadraticDrag: _body_drag,
    AxialInflow: _inflow,
    HorizontalLift: _lift,
    IsotropicMoment: _flapping,
}
