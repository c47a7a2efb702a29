"""Aerodynamic and external effects: functions that change the forces of those flights of a batch that have them.

Each function takes the air around the batch, the rows (flights) that it changes and its parameters, one value per row.
Thrust effects multiply `gain`; drags add to `body_force_n` (FRD); tethers add to `world_force_n` (NED).
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from studies.worlds.field.arrays import GRAVITY_M_S2, Floats, Rows

Parameters = dict[str, Floats]
RPM_TO_RAD_S = 2.0 * np.pi / 60.0


@dataclass
class Air:
    """Quantities of one instant for all flights (N) and rotors (n), and the changes that effects make to them."""

    position_m: Floats
    """NED, (N, 3)."""
    attitude: Floats
    """Rotation from body to world, (N, 3, 3)."""
    rates_rad_s: Floats
    rpm: Floats
    """(N, n)."""
    thrust_n: Floats
    """Thrust of each rotor without any effect, (N, n)."""
    rotor_height_m: Floats
    """Height of each rotor's hub above the ground, (N, n)."""
    body_air_m_s: Floats
    """Velocity of the vehicle relative to the air, body axes, (N, 3)."""
    world_velocity_m_s: Floats
    mass_kg: Floats
    radius_m: Floats
    hubs_m: Floats
    """(N, n, 3)."""
    present: Floats
    """1 where a flight has this rotor, 0 in the padding, (N, n)."""
    hover_rpm: Floats
    induced_m_s: Floats
    density_kg_m3: Floats
    lift_slope_solidity: Floats
    ceiling_m: Floats
    gain: Floats
    body_force_n: Floats
    world_force_n: Floats


Effect = Callable[[Air, Rows, Parameters], None]


def _lift(air: Air, rows: Rows, gain: Floats) -> None:
    air.gain[rows] *= gain


def _airspeed_in_plane(air: Air, rows: Rows) -> Floats:
    flow = air.body_air_m_s[rows]
    return np.asarray(np.hypot(flow[:, 0], flow[:, 1]))


def _clear_height(air: Air, rows: Rows, least: float) -> Floats:
    """Height of each rotor in radii, not below `least`: nearer than that none of the formulas was ever measured."""
    return np.maximum(air.rotor_height_m[rows] / air.radius_m[rows, None], least)


# Ground effect. `size` scales the gain of thrust; every rotor feels its own height, so a tilted vehicle is levelled.


def ground_cheeseman_forward(air: Air, rows: Rows, p: Parameters) -> None:
    """Cheeseman and Bennett (1955) with the coefficient of Danjun (2015), washed out by forward speed."""
    speed = air.world_velocity_m_s[rows]
    ratio = (speed[:, 0] ** 2 + speed[:, 1] ** 2) / air.induced_m_s[rows] ** 2
    height = _clear_height(air, rows, 0.8)
    image = p["rho"][:, None] / (16.0 * height**2) / (1.0 + ratio[:, None])
    _lift(air, rows, 1.0 + p["size"][:, None] * (1.0 / (1.0 - image) - 1.0))


def ground_hayden(air: Air, rows: Rows, p: Parameters) -> None:
    """Hayden (1976), from helicopter flight tests at constant power; the constant is set so that it tends to 1."""
    height = _clear_height(air, rows, 0.6)
    gain = (1.0 + 0.03794 * 4.0 / height**2) ** (2.0 / 3.0)
    _lift(air, rows, 1.0 + p["size"][:, None] * (gain - 1.0))


def ground_sanchez(air: Air, rows: Rows, p: Parameters) -> None:
    """Sanchez-Cuevas et al. (2017): images of all rotors and the lift of the fountain under the body."""
    height = np.maximum(air.rotor_height_m[rows], 0.8 * air.radius_m[rows, None])
    radius = air.radius_m[rows, None]
    hub = air.hubs_m[rows]
    diagonal = 2.0 * np.sqrt(np.max(np.sum(hub**2, axis=2), axis=1))[:, None]
    side = diagonal / np.sqrt(2.0)
    image = (
        (radius / (4.0 * height)) ** 2
        + radius**2 * height / np.sqrt((side**2 + 4.0 * height**2) ** 3)
        + 0.5 * radius**2 * height / np.sqrt((2.0 * side**2 + 4.0 * height**2) ** 3)
        + 2.0 * radius**2 * height * p["body_lift"][:, None] / np.sqrt((diagonal**2 + 4.0 * height**2) ** 3)
    )
    _lift(air, rows, 1.0 + p["size"][:, None] * (1.0 / (1.0 - np.minimum(image, 0.45)) - 1.0))


def ground_exponential(air: Air, rows: Rows, p: Parameters) -> None:
    """Exponential decay with height in radii, in the manner of He and Leang (2020), weaker in forward flight."""
    speed = air.world_velocity_m_s[rows]
    ratio = np.hypot(speed[:, 0], speed[:, 1]) / air.induced_m_s[rows]
    wash = 1.0 / (1.0 + (ratio / 0.9) ** 2)
    height = _clear_height(air, rows, 0.4)
    _lift(air, rows, 1.0 + (p["size"] * p["a"] * wash)[:, None] * np.exp(-p["b"][:, None] * height))


def ground_kan(air: Air, rows: Rows, p: Parameters) -> None:
    """Kan et al. (2019) with the sign that raises thrust: inverse in height, falling with the cube of forward speed."""
    speed = air.world_velocity_m_s[rows]
    ratio = np.hypot(speed[:, 0], speed[:, 1]) / air.induced_m_s[rows]
    height = _clear_height(air, rows, 0.5)
    fade = np.exp(-((height / 7.0) ** 4))
    _lift(air, rows, 1.0 + (p["size"] / (1.0 + (3.0 * ratio) ** 3 / 50.0))[:, None] * 0.16 / height * fade)


# Ceiling effect.


def _gap(air: Air, rows: Rows) -> Floats:
    gap = (air.ceiling_m[rows, None] - air.rotor_height_m[rows]) / air.radius_m[rows, None]
    return np.maximum(gap, 0.3)


def ceiling_hsiao(air: Air, rows: Rows, p: Parameters) -> None:
    """Hsiao and Chirarattananon (2018): momentum theory of a rotor under a wall, at constant power coefficient."""
    gain = 0.5 + 0.5 * np.sqrt(1.0 + 1.0 / (8.0 * _gap(air, rows) ** 2))
    _lift(air, rows, 1.0 + p["size"][:, None] * (gain - 1.0))


def ceiling_sanchez(air: Air, rows: Rows, p: Parameters) -> None:
    """Sanchez-Cuevas et al. (2017), fitted to bench data: T/T0 = 1 / (1 - (R / (z + a2))^2 / a1)."""
    image = 1.0 / (p["a1"][:, None] * (_gap(air, rows) + p["a2"][:, None]) ** 2)
    _lift(air, rows, 1.0 + p["size"][:, None] * (1.0 / (1.0 - np.minimum(image, 0.4)) - 1.0))


# Drag of rotors and body.


def rotor_drag_matrix(air: Air, rows: Rows, p: Parameters) -> None:
    """Linear drag along the body axes, as in Faessler et al. (2018)."""
    flow = air.body_air_m_s[rows] * air.mass_kg[rows, None]
    air.body_force_n[rows] -= flow * np.stack([p["x"], p["y"], p["z"]], axis=1)


def rotor_drag_speed(air: Air, rows: Rows, p: Parameters) -> None:
    """Drag of each rotor in its plane proportional to its speed and to the local flow, rotation included."""
    spin = air.rpm[rows] / air.hover_rpm[rows, None] * air.present[rows]
    share = (p["per_s"] * air.mass_kg[rows] / np.sum(air.present[rows], axis=1))[:, None] * spin
    flow, rates, hub = air.body_air_m_s[rows], air.rates_rad_s[rows], air.hubs_m[rows]
    air.body_force_n[rows, 0] -= np.sum(share * (flow[:, 0:1] - rates[:, 2:3] * hub[:, :, 1]), axis=1)
    air.body_force_n[rows, 1] -= np.sum(share * (flow[:, 1:2] + rates[:, 2:3] * hub[:, :, 0]), axis=1)


def rotor_drag_thrust(air: Air, rows: Rows, p: Parameters) -> None:
    """Drag by blade flapping and induced drag: proportional to thrust and in-plane airspeed."""
    thrust = np.sum(air.thrust_n[rows] * air.gain[rows], axis=1) / GRAVITY_M_S2
    air.body_force_n[rows, :2] -= (p["per_s"] * thrust)[:, None] * air.body_air_m_s[rows, :2]


def body_drag_area(air: Air, rows: Rows, p: Parameters) -> None:
    """Drag of a blunt body: along the whole flow, with areas that differ between body axes."""
    flow = air.body_air_m_s[rows]
    speed = np.sqrt(np.sum(flow**2, axis=1))[:, None]
    area = np.stack([p["area_x_m2"], p["area_y_m2"], p["area_z_m2"]], axis=1)
    air.body_force_n[rows] -= 0.5 * air.density_kg_m3[rows, None] * speed * area * flow


def body_drag_axes(air: Air, rows: Rows, p: Parameters) -> None:
    """Drag of plates and tubes: each axis by the square of its own component."""
    flow = air.body_air_m_s[rows]
    area = np.stack([p["area_x_m2"], p["area_y_m2"], p["area_z_m2"]], axis=1)
    air.body_force_n[rows] -= 0.5 * air.density_kg_m3[rows, None] * area * np.abs(flow) * flow


# Blade elements in axial and in edgewise flow.


def _blade_gain(air: Air, rows: Rows, axial_m_s: Floats, edgewise_m_s: Floats, descent: bool) -> Floats:
    """Thrust at the present rotor speed over thrust without flow, by blade elements with uniform inflow.

    C_T = (s a / 2) (theta / 3 - lambda / 2) with lambda from momentum theory (Glauert); pitch is set so that the thrust
    without flow is the static one. Below hover the induced velocity is Leishman's empirical quartic.
    """
    tip = np.maximum(air.rpm[rows], 1.0) * RPM_TO_RAD_S * air.radius_m[rows, None]
    area = np.pi * air.radius_m[rows, None] ** 2
    density = air.density_kg_m3[rows, None]
    coefficient = np.maximum(air.thrust_n[rows], 1e-9) / (density * area * tip**2)
    half = air.lift_slope_solidity[rows, None] / 2.0
    hover = np.sqrt(coefficient / 2.0)
    climb = axial_m_s / tip
    advance = edgewise_m_s / tip
    value = coefficient.copy()
    for _ in range(3):
        induced = np.sqrt(np.maximum(value, 1e-9) / 2.0)
        x = climb / induced
        fast = advance / induced
        # Momentum theory: w sqrt(fast^2 + (x + w)^2) = 1, two Newton steps from a good start.
        w = 1.0 / np.sqrt(1.0 + 0.5 * fast**2 + np.maximum(x, 0.0))
        for _ in range(2):
            root = np.sqrt(fast**2 + (x + w) ** 2) + 1e-9
            w = w - (w * root - 1.0) / (root + w * (x + w) / root)
        if descent:
            y = np.maximum(x, -1.6)
            leishman = 1.0 - 1.125 * y - 1.372 * y**2 - 1.718 * y**3 - 0.655 * y**4
            w = np.where(x < 0.0, leishman, w)
        inflow = induced * (w + x)
        value = 0.5 * value + 0.5 * (coefficient + half * 0.5 * (hover - inflow))
    return np.asarray(np.clip(value / coefficient, 0.3, 1.7))


def inflow_blade_element(air: Air, rows: Rows, p: Parameters) -> None:
    """Loss of thrust in a climb and gain in a descent, by blade elements with uniform inflow."""
    axial = np.broadcast_to(-air.body_air_m_s[rows, 2:3], air.rpm[rows].shape)
    gain = _blade_gain(air, rows, axial, np.zeros_like(axial), descent=True)
    _lift(air, rows, 1.0 + p["size"][:, None] * (gain - 1.0))


def inflow_linear(air: Air, rows: Rows, p: Parameters) -> None:
    """Loss of thrust linear in climb rate and rotor speed: T = k w^2 - c w v, with each rotor's own axial velocity."""
    rates, hub = air.rates_rad_s[rows], air.hubs_m[rows]
    down = air.body_air_m_s[rows, 2:3] + rates[:, 0:1] * hub[:, :, 1] - rates[:, 1:2] * hub[:, :, 0]
    slower = air.hover_rpm[rows, None] / np.maximum(air.rpm[rows], 0.2 * air.hover_rpm[rows, None])
    gain = 1.0 + (p["per_induced"] / air.induced_m_s[rows])[:, None] * down * slower
    _lift(air, rows, np.clip(gain, 0.3, 1.7))


def translational_glauert(air: Air, rows: Rows, p: Parameters) -> None:
    """Gain of thrust in edgewise flow: Glauert's induced velocity falls with horizontal airspeed."""
    edge = np.broadcast_to(_airspeed_in_plane(air, rows)[:, None], air.rpm[rows].shape)
    gain = _blade_gain(air, rows, np.zeros_like(edge), edge, descent=False)
    _lift(air, rows, 1.0 + p["size"][:, None] * (gain - 1.0))


def translational_quadratic(air: Air, rows: Rows, p: Parameters) -> None:
    """Gain of thrust by the square of horizontal airspeed, shared by the rotors, as in Faessler et al. (2018)."""
    speed = _airspeed_in_plane(air, rows)
    added = p["per_m"] * air.mass_kg[rows] * speed**2
    gain = 1.0 + added / np.maximum(np.sum(air.thrust_n[rows], axis=1), 1e-6)
    _lift(air, rows, np.minimum(gain, 1.6)[:, None])


def blade_element_both(air: Air, rows: Rows, p: Parameters) -> None:
    """Axial and edgewise flow together in one blade-element model: inflow and translational lift of the same rotor."""
    axial = np.broadcast_to(-air.body_air_m_s[rows, 2:3], air.rpm[rows].shape)
    edge = np.broadcast_to(_airspeed_in_plane(air, rows)[:, None], axial.shape)
    gain = _blade_gain(air, rows, axial, edge, descent=False)
    _lift(air, rows, 1.0 + p["size"][:, None] * (gain - 1.0))


def wake_interaction(air: Air, rows: Rows, p: Parameters) -> None:
    """Loss of the rear rotors in the wake of the front ones: grows with airspeed until the wake is swept back flat."""
    flow = air.body_air_m_s[rows, :2]
    speed = np.hypot(flow[:, 0], flow[:, 1])
    along = flow / np.maximum(speed, 1e-3)[:, None]
    hub = air.hubs_m[rows, :, :2]
    span = np.sqrt(np.max(np.sum(hub**2, axis=2), axis=1))[:, None]
    behind = np.maximum(-np.einsum("nrk,nk->nr", hub, along) / span, 0.0)
    skew = (speed / (p["speed_ratio"] * air.induced_m_s[rows])) ** 2
    loss = (p["loss"] * skew / (1.0 + skew))[:, None] * behind
    _lift(air, rows, 1.0 - loss)


# Tethers and single rotors.


def tether_hanging(air: Air, rows: Rows, p: Parameters) -> None:
    """Weight of the cable lifted off the ground, and a little of its pull towards the winch."""
    position = air.position_m[rows]
    up = np.maximum(-position[:, 2] + p["slack_m"], 0.0)
    pull = p["kg_per_m"] * GRAVITY_M_S2 * up
    away = position[:, :2] - np.stack([p["north_m"], p["east_m"]], axis=1)
    air.world_force_n[rows, 2] += pull
    air.world_force_n[rows, :2] -= (p["lateral"] * pull / np.maximum(up, 0.5))[:, None] * away


def tether_elastic(air: Air, rows: Rows, p: Parameters) -> None:
    """Elastic line to a point on the ground, slack below its free length, with a smooth beginning."""
    line = air.position_m[rows] - np.stack([p["north_m"], p["east_m"], np.zeros(len(rows))], axis=1)
    length = np.sqrt(np.sum(line**2, axis=1))
    over = length - p["free_m"]
    tension = p["n_per_m"] * 0.5 * (over + np.sqrt(over**2 + 0.01))
    air.world_force_n[rows] -= (tension / np.maximum(length, 0.1))[:, None] * line


def rotor_fault(air: Air, rows: Rows, p: Parameters) -> None:
    """Less thrust of one rotor at a given speed: a chipped or wrongly mounted propeller."""
    air.gain[rows, p["rotor"].astype(np.intp) - 1] *= 1.0 - p["loss"]


def thrust_curve(air: Air, rows: Rows, p: Parameters) -> None:
    """Thrust by another power of rotor speed than 2, right at the speed at which the rotor was calibrated."""
    ratio = np.maximum(air.rpm[rows], 1.0) / (p["calibrated_over_hover"] * air.hover_rpm[rows])[:, None]
    _lift(air, rows, ratio ** (p["exponent"] - 2.0)[:, None])


EFFECTS: dict[str, Effect] = {
    "ground_effect.cheeseman_forward": ground_cheeseman_forward,
    "ground_effect.hayden": ground_hayden,
    "ground_effect.sanchez": ground_sanchez,
    "ground_effect.exponential": ground_exponential,
    "ground_effect.kan": ground_kan,
    "ceiling_effect.hsiao": ceiling_hsiao,
    "ceiling_effect.sanchez": ceiling_sanchez,
    "rotor_drag.matrix": rotor_drag_matrix,
    "rotor_drag.speed": rotor_drag_speed,
    "rotor_drag.thrust": rotor_drag_thrust,
    "body_drag.area": body_drag_area,
    "body_drag.axes": body_drag_axes,
    "inflow.blade_element": inflow_blade_element,
    "inflow.linear": inflow_linear,
    "translational_lift.glauert": translational_glauert,
    "translational_lift.quadratic": translational_quadratic,
    "inflow+translational_lift.blade_element": blade_element_both,
    "rotor_interaction.wake": wake_interaction,
    "tether.hanging": tether_hanging,
    "tether.elastic": tether_elastic,
    "rotor_fault.loss": rotor_fault,
    "thrust_curve.power": thrust_curve,
}
