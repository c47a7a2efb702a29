"""A model as a frame of SITL, ArduPilot's own simulator of a multirotor (`SIM_Frame.cpp` and `SIM_Motor.cpp`).

SITL's thrust is proportional to (1 - e) s + e s² of the command s of each motor and loses what the inflow takes from
the rotors' jet. Its drag is a momentum drag, linear in the velocity, and a bluff-body drag, quadratic in it, each the
same along all axes. The second is not a parameter: it is what the first leaves of the drag in level flight at refSpd
with a lean of refAngle.
"""

import json
import math

from quadctl.effects.body_drag import QuadraticDrag
from quadctl.effects.rotor_drag import LinearDrag
from quadctl.errors import SettingsError
from quadctl.export.ardupilot import ARDUPILOT
from quadctl.export.equations import delay_left_out, observer_left_out
from quadctl.export.hover import bend, lift_n, root
from quadctl.export.left_out import Kind
from quadctl.frames import GRAVITY_M_S2
from quadctl.model import Model
from quadctl.vehicle import Vehicle
from quadctl.words import Fact, fact

THRUST = {"thrust", "throttle", "exponent"}
"""Numbers that are in the thrust over the command."""
REFERENCE_SPEED_M_S = 10.0
SEA_LEVEL_PA, GAS_CONSTANT, KELVIN = 101325.0, 287.26, 273.15
"""Standard atmosphere of ArduPilot: pressure, Pa, gas constant, J/(kg K), and 0 °C in K."""
MOST_LEAN_DEG = 89.0
SAME = 0.02
"""Largest relative difference between numbers that count as the same."""


def sitl_frame(model: Model) -> tuple[str, tuple[Fact, ...]]:
    """Text of a frame file for `--model "quad:FILE.json"`, and what it leaves out of the model.

    Raises
    ------
    SettingsError
        The rotors are tilted, or they cannot carry the vehicle.
    """
    vehicle = model.vehicle
    if any(math.hypot(*rotor.axis[:2]) > 1e-6 for rotor in vehicle.rotors):
        raise SettingsError(f"{vehicle.name}: has tilted rotors, expected upright ones, as SITL's frames have")
    full_n = lift_n(model, 1.0)
    if full_n <= vehicle.weight_n:
        raise SettingsError(f"{vehicle.name}: full throttle lifts {full_n:.3g} N, expected more than its weight")
    left_out = [
        Fact(Kind.MOTOR_LAG),
        Fact(Kind.EACH_ROTOR),
        *delay_left_out(model),
        *observer_left_out(model, "SITL"),
    ]
    drag_per_s, area_m2 = 0.0, 0.0
    for effect in model.effects:
        if isinstance(effect, LinearDrag):
            each = (effect.d_x, effect.d_y, effect.d_z)
            drag_per_s += 0.5 * (effect.d_x + effect.d_y)
        elif isinstance(effect, QuadraticDrag):
            each = (effect.area_x_m2, effect.area_y_m2, effect.area_z_m2)
            area_m2 += 0.5 * (effect.area_x_m2 + effect.area_y_m2)
        elif THRUST & set(effect.corrects):
            continue
        else:
            left_out.append(fact(Kind.NO_PARAMETER, effect=effect.name, target="SITL"))
            continue
        if max(each) - min(each) > SAME * max(each):
            numbers = ", ".join(f"{value:g}" for value in each)
            left_out.append(fact(Kind.DIFFERENCE_OF_AXES, effect=effect.name, values=numbers))
    discs_m2 = vehicle.n_rotors * math.pi * vehicle.rotor.radius_m**2
    momentum = _momentum_coefficient(vehicle, drag_per_s, discs_m2)
    frame: dict[str, float | list[float]] = {
        "mass": vehicle.mass_kg,
        "diagonal_size": 2.0 * _arm_m(vehicle),
        "moment_inertia": list(vehicle.principal_inertia_kg_m2),
        "num_motors": vehicle.n_rotors,
        "disc_area": discs_m2,
        "mdrag_coef": momentum,
        "refSpd": REFERENCE_SPEED_M_S,
        "refAngle": _lean_deg(vehicle, momentum, area_m2, discs_m2),
        "refAlt": 0.0,
        "refTempC": SEA_LEVEL_PA / (GAS_CONSTANT * vehicle.air_density_kg_m3) - KELVIN,
        "hoverThrOut": vehicle.weight_n / full_n,
        "propExpo": bend(model, ARDUPILOT.default_curve),
        **_hover_power(vehicle),
    }
    rounded = {name: _rounded(value) for name, value in frame.items()}
    lines = [
        f"# {model.name}: a frame of ArduPilot's SITL, written by quadctl. It is for an autopilot with MOT_THST_EXPO "
        f"{ARDUPILOT.default_curve:g}, MOT_SPIN_MIN 0.15 and MOT_SPIN_MAX 0.95.",
        *(f"# Left out: {reason}." for reason in left_out),
        json.dumps(rounded, indent=4),
    ]
    return "\n".join(lines) + "\n", tuple(left_out)


def _momentum_coefficient(vehicle: Vehicle, drag_per_s: float, discs_m2: float) -> float:
    """SITL's mdrag_coef, which gives the linear drag `drag_per_s` in hover: each rotor drags with mdrag_coef times the
    root of density, disc area and thrust, times the velocity."""
    return drag_per_s * math.sqrt(vehicle.mass_kg / (vehicle.air_density_kg_m3 * discs_m2 * GRAVITY_M_S2))


def _lean_deg(vehicle: Vehicle, momentum: float, area_m2: float, discs_m2: float) -> float:
    """Lean in level flight at the reference speed, by SITL's equations, deg."""
    density, weight_n = vehicle.air_density_kg_m3, vehicle.weight_n

    def unbalanced_n(lean: float) -> float:
        along_m_s = REFERENCE_SPEED_M_S * math.cos(lean)
        linear_n = momentum * along_m_s * math.cos(lean) * math.sqrt(weight_n / math.cos(lean) * density * discs_m2)
        return weight_n * math.tan(lean) - linear_n - 0.5 * density * area_m2 * REFERENCE_SPEED_M_S**2

    return math.degrees(root(unbalanced_n, 0.0, math.radians(MOST_LEAN_DEG)))


def _hover_power(vehicle: Vehicle) -> dict[str, float]:
    """Reference voltage and current of ideal rotors in hover, whose jet has twice the induced velocity: SITL takes the
    speed of the jet from them."""
    voltage_v = 12.0
    power_w = vehicle.weight_n * vehicle.hover_induced_velocity_m_s
    return {"refVoltage": voltage_v, "maxVoltage": voltage_v, "refCurrent": power_w / voltage_v, "refBatRes": 0.0}


def _arm_m(vehicle: Vehicle) -> float:
    """Mean distance of the rotors from the centre, m."""
    return sum(math.hypot(*rotor.position_m[:2]) for rotor in vehicle.rotors) / vehicle.n_rotors


def _rounded(value: float | list[float]) -> float | list[float]:
    return [float(f"{v:.6g}") for v in value] if isinstance(value, list) else float(f"{value:.6g}")
