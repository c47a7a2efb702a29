"""A model as the parameters of SIH, PX4's own simulator of a multirotor (`src/modules/simulation/simulator_sih`).

SIH's thrust is proportional to the output of each motor, up to SIH_T_MAX; its drag is -SIH_KDV v, the same along all
axes; its arms are levers SIH_L_ROLL and SIH_L_PITCH of four rotors in an x.
"""

import math
from collections.abc import Mapping

from quadctl.effects.motor_lag import FirstOrderLag
from quadctl.effects.rotor_drag import LinearDrag
from quadctl.effects.thrust_scale import ConstantScale
from quadctl.errors import SettingsError
from quadctl.export.equations import delay_left_out, observer_left_out
from quadctl.export.left_out import Kind
from quadctl.export.px4 import REAL32
from quadctl.model import Model
from quadctl.vehicle import Vehicle
from quadctl.words import Fact, fact

SAME = 0.02
"""Largest relative difference between numbers that count as the same."""


def sih_parameters(model: Model) -> tuple[str, tuple[Fact, ...]]:
    """Text of a parameter file as QGroundControl loads it, and what it leaves out of the model.

    Raises
    ------
    SettingsError
        The vehicle is no quadrotor x with upright rotors.
    """
    vehicle = model.vehicle
    roll_m, pitch_m = _levers_m(vehicle)
    scale, drag_kg_s, lag_s = 1.0, 0.0, vehicle.rotor.time_constant_s
    left_out = [*delay_left_out(model), *observer_left_out(model, "SIH")]
    for item in model.stack:
        effect = item.effect
        if isinstance(effect, ConstantScale):
            scale *= effect.factor
        elif isinstance(effect, LinearDrag):
            each = {"d_x": effect.d_x, "d_y": effect.d_y, "d_z": effect.d_z}
            drag_kg_s += vehicle.mass_kg * _mean(each, item.fitted.ci95 if item.fitted is not None else {})
            if max(each.values()) - min(each.values()) > SAME * max(each.values()):
                numbers = ", ".join(f"{name} {value:g}" for name, value in each.items())
                mean = "their mean is taken along all axes"
                left_out.append(fact(Kind.DIFFERENCE, effect=effect.name, values=numbers, mean=mean))
        elif isinstance(effect, FirstOrderLag):
            lag_s += effect.time_constant_s
            lag = "SIH_T_TAU is the sum of their time constants"
            left_out.append(fact(Kind.TWO_LAGS, effect=effect.name, target=lag))
        else:
            left_out.append(fact(Kind.NO_PARAMETER, effect=effect.name, target="SIH"))
    if vehicle.throttle.offset != 0.0:
        left_out.append(fact(Kind.THROTTLE_OFFSET, offset=vehicle.throttle.offset))
    most_n = scale * (1.0 - vehicle.throttle.offset) / vehicle.throttle.per_newton / vehicle.n_rotors
    ixx, iyy, izz = vehicle.principal_inertia_kg_m2
    values = {
        "SIH_MASS": vehicle.mass_kg,
        "SIH_IXX": ixx,
        "SIH_IYY": iyy,
        "SIH_IZZ": izz,
        "SIH_T_MAX": most_n,
        "SIH_Q_MAX": most_n * vehicle.rotor.torque_to_thrust_m,
        "SIH_L_ROLL": roll_m,
        "SIH_L_PITCH": pitch_m,
        "SIH_KDV": drag_kg_s,
        "SIH_T_TAU": lag_s,
    }
    lines = [
        f"# {model.name}: parameters of SIH, written by quadctl. SIH_KDW (drag of the rotation) stays as it is.",
        *(f"# Left out: {reason}." for reason in left_out),
        *(f"1\t1\t{name}\t{value:.9g}\t{REAL32}" for name, value in values.items()),
    ]
    return "\n".join(lines) + "\n", tuple(left_out)


def _mean(values: Mapping[str, float], ci95: Mapping[str, tuple[float, float]]) -> float:
    """Mean of the values, weighted by the inverse squares of the widths of their intervals where all have one."""
    widths = [high - low for name in values if name in ci95 for low, high in [ci95[name]]]
    weights = [width**-2 for width in widths if width > 0.0]
    if len(weights) < len(values):
        weights = [1.0] * len(values)
    return sum(w * value for w, value in zip(weights, values.values(), strict=True)) / sum(weights)


def _levers_m(vehicle: Vehicle) -> tuple[float, float]:
    """Levers of the rotors about the roll and the pitch axis, m."""
    upright = all(math.hypot(*rotor.axis[:2]) < 1e-6 for rotor in vehicle.rotors)
    across = [abs(rotor.position_m[1]) for rotor in vehicle.rotors]
    along = [abs(rotor.position_m[0]) for rotor in vehicle.rotors]
    same = all(min(arms) > 0.0 and max(arms) - min(arms) <= SAME * max(arms) for arms in (across, along))
    if vehicle.n_rotors != 4 or not upright or not same:
        raise SettingsError(
            f"{vehicle.name}: has {vehicle.n_rotors} rotors, expected four upright ones in an x, as SIH"
        )
    return sum(across) / 4.0, sum(along) / 4.0
