"""A model as an SDF model of Gazebo, with a plugin `gz-sim-multicopter-motor-model-system` for each rotor.

The plugin's thrust is motorConstant omega^2, its drag -omega rotorDragCoefficient v across the rotor's axis, its drag
torque momentConstant times the thrust. Bodies are forward, left, up.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from quadctl.effects.motor_lag import FirstOrderLag
from quadctl.effects.rotor_drag import LinearDrag
from quadctl.effects.thrust_scale import ConstantScale
from quadctl.export.centred import centred
from quadctl.export.equations import commands_left_out, effect_left_out
from quadctl.export.left_out import Kind
from quadctl.model import Model
from quadctl.vehicle import RotorPlace, Vehicle
from quadctl.words import Fact, fact

ROTOR_MASS_SHARE = 0.005
"""Mass of one rotor's link over that of the vehicle; the base has what is left, so that mass and inertia are exact."""
SLOWDOWN = 10.0
"""Factor by which the visible rotors turn slower than the computed ones, against aliasing."""
_RAD_S_PER_RPM = math.pi / 30.0


class _Base(NamedTuple):
    """The vehicle without its rotors, forward, left, up."""

    mass_kg: float
    centre_m: NDArray[np.float64]
    inertia_kg_m2: NDArray[np.float64]


def gazebo_sdf(model: Model) -> tuple[str, tuple[Fact, ...]]:
    """Text of an SDF model, and what it leaves out of the model."""
    model = centred(model)
    vehicle = model.vehicle
    scale = math.prod(effect.factor for effect in model.effects if isinstance(effect, ConstantScale))
    k_eta = scale * vehicle.rotor.thrust_n_per_rpm2 / _RAD_S_PER_RPM**2
    hover_rad_s = math.sqrt(vehicle.weight_n / vehicle.n_rotors / k_eta)
    lag_s, drag, left_out = vehicle.rotor.time_constant_s, 0.0, commands_left_out(model, "the motor model plugin")
    for effect in model.effects:
        if isinstance(effect, FirstOrderLag):
            lag_s += effect.time_constant_s
            lag = "the time constants are the sum; Gazebo's is of speed"
            left_out.append(fact(Kind.TWO_LAGS, effect=effect.name, target=lag))
        elif isinstance(effect, LinearDrag):
            drag += vehicle.mass_kg * 0.5 * (effect.d_x + effect.d_y) / (vehicle.n_rotors * hover_rad_s)
            form = {"model": "constant", "target": "Gazebo's grows with the rotor speed", "equal": "equal"}
            left_out.append(fact(Kind.OTHER_FORM, effect=effect.name, **form))
            if effect.d_x != effect.d_y:
                values = f"d_x {effect.d_x:g} and d_y {effect.d_y:g}"
                left_out.append(fact(Kind.DIFFERENCE, effect=effect.name, values=values, mean="their mean"))
            if effect.d_z:
                left_out.append(fact(Kind.ALONG_AXES, effect=effect.name, d_z=effect.d_z))
        elif not isinstance(effect, ConstantScale):
            left_out.append(effect_left_out(effect, "the motor model plugin", by_speeds=True))
    speeds = {
        "timeConstantUp": lag_s,
        "timeConstantDown": lag_s,
        "maxRotVelocity": math.sqrt(vehicle.throttle.max_thrust_per_rotor_n * scale / k_eta),
        "motorConstant": k_eta,
        "momentConstant": vehicle.rotor.torque_to_thrust_m,
        "rotorDragCoefficient": drag,
        "rollingMomentCoefficient": 0.0,
        "rotorVelocitySlowdownSim": SLOWDOWN,
    }
    name = _escaped(vehicle.name)
    base = _base(vehicle)
    lines = [
        '<?xml version="1.0"?>',
        f"<!-- {_escaped(model.name)}, written by quadctl. Body: forward, left, up. -->",
        *(f"<!-- Left out: {_escaped(str(reason))}. -->" for reason in left_out),
        '<sdf version="1.9">',
        f'  <model name="{name}">',
        '    <link name="base_link">',
        *_inertial(base.mass_kg, base.centre_m, base.inertia_kg_m2),
        "    </link>",
        *(line for i, rotor in enumerate(vehicle.rotors) for line in _rotor(vehicle, i, rotor)),
        *(line for i, rotor in enumerate(vehicle.rotors) for line in _plugin(i, rotor, speeds)),
        "  </model>",
        "</sdf>",
        "",
    ]
    return "\n".join(lines), tuple(left_out)


def _base(vehicle: Vehicle) -> _Base:
    mass = ROTOR_MASS_SHARE * vehicle.mass_kg
    places = [_place(rotor) for rotor in vehicle.rotors]
    base_kg = vehicle.mass_kg - mass * len(places)
    centre = -mass * np.sum(places, axis=0) / base_kg
    inertia = np.diag(vehicle.principal_inertia_kg_m2) - _steiner(base_kg, centre)
    for place, rotor in zip(places, vehicle.rotors, strict=True):
        turn = _turn(rotor)
        inertia -= _steiner(mass, place) + turn @ _disk(vehicle) @ turn.T
    return _Base(base_kg, centre, inertia)


def _steiner(mass_kg: float, place: NDArray[np.float64]) -> NDArray[np.float64]:
    return mass_kg * (place @ place * np.eye(3) - np.outer(place, place))


def _disk(vehicle: Vehicle) -> NDArray[np.float64]:
    return 0.25 * ROTOR_MASS_SHARE * vehicle.mass_kg * vehicle.rotor.radius_m**2 * np.diag([1.0, 1.0, 2.0])


def _place(rotor: RotorPlace) -> NDArray[np.float64]:
    x, y, z = rotor.position_m
    return np.array([x, 0.0 - y, 0.0 - z])


def _tilt(rotor: RotorPlace) -> tuple[float, float]:
    """Roll and pitch, rad, forward left up, that turn z to the rotor's thrust axis."""
    x, y, z = rotor.axis[0], -rotor.axis[1], -rotor.axis[2]
    return -math.asin(y) + 0.0, math.atan2(x, z)


def _turn(rotor: RotorPlace) -> NDArray[np.float64]:
    roll, pitch = _tilt(rotor)
    cr, sr, cp, sp = math.cos(roll), math.sin(roll), math.cos(pitch), math.sin(pitch)
    return np.array([[cp, sp * sr, sp * cr], [0.0, cr, -sr], [-sp, cp * sr, cp * cr]])


def _inertial(mass_kg: float, centre: NDArray[np.float64], inertia: NDArray[np.float64]) -> list[str]:
    names = (("ixx", 0, 0), ("ixy", 0, 1), ("ixz", 0, 2), ("iyy", 1, 1), ("iyz", 1, 2), ("izz", 2, 2))
    x, y, z = centre.tolist()
    return [
        "      <inertial>",
        f"        <pose>{x!r} {y!r} {z!r} 0 0 0</pose>",
        f"        <mass>{mass_kg!r}</mass>",
        f"        <inertia>{''.join(f'<{name}>{float(inertia[i, j])!r}</{name}>' for name, i, j in names)}</inertia>",
        "      </inertial>",
    ]


def _rotor(vehicle: Vehicle, i: int, rotor: RotorPlace) -> list[str]:
    (x, y, z), (roll, pitch) = _place(rotor).tolist(), _tilt(rotor)
    return [
        f'    <link name="rotor_{i}">',
        f'      <pose relative_to="base_link">{x!r} {y!r} {z!r} {roll!r} {pitch!r} 0</pose>',
        *_inertial(ROTOR_MASS_SHARE * vehicle.mass_kg, np.zeros(3), _disk(vehicle)),
        "    </link>",
        f'    <joint name="rotor_{i}_joint" type="revolute">',
        f"      <parent>base_link</parent><child>rotor_{i}</child>",
        "      <axis><xyz>0 0 1</xyz><limit><lower>-1e16</lower><upper>1e16</upper></limit></axis>",
        "    </joint>",
    ]


def _plugin(i: int, rotor: RotorPlace, speeds: dict[str, float]) -> list[str]:
    return [
        '    <plugin filename="gz-sim-multicopter-motor-model-system" name="gz::sim::systems::MulticopterMotorModel">',
        f"      <jointName>rotor_{i}_joint</jointName>",
        f"      <linkName>rotor_{i}</linkName>",
        f"      <turningDirection>{rotor.spin}</turningDirection>",
        f"      <motorNumber>{i}</motorNumber>",
        "      <motorType>velocity</motorType>",
        "      <commandSubTopic>command/motor_speed</commandSubTopic>",
        *(f"      <{name}>{value!r}</{name}>" for name, value in speeds.items()),
        "    </plugin>",
    ]


def _escaped(text: str) -> str:
    """Text for an attribute or a comment of XML."""
    for sign, name in (("&", "&amp;"), ("<", "&lt;"), (">", "&gt;"), ('"', "&quot;"), ("--", "- -")):
        text = text.replace(sign, name)
    return text
