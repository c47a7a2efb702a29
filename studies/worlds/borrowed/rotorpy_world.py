"""World of RotorPy: its `Multirotor` with its published vehicles, flown by its geometric controller (`SE3Control`).

Drag of rotors and body, inflow, translational lift, wind and motor lag are RotorPy's own; the rest is injected.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar

import numpy as np
from rotorpy.controllers.quadrotor_control import SE3Control
from rotorpy.vehicles import crazyflie_params, hummingbird_params, px4_sihsim_quadx_params
from rotorpy.vehicles.multirotor import Multirotor
from scipy.spatial.transform import Rotation

from studies.worlds.borrowed.craft import DENSITY_KG_M3, GRAVITY_M_S2, Array, Kind
from studies.worlds.borrowed.flight import Aim, Flight, Simulator, Slope, State
from studies.worlds.borrowed.missions import Reference


def _kind(
    given: dict[str, Any], radius_m: float, lag_s: tuple[float, float], cells: int, thrust_to_weight: float
) -> Kind:
    """Vehicle of a parameter file; RotorPy's full thrust is that of the motor alone, so it is given here."""
    return Kind(
        mass_kg=given["mass"],
        inertia_kg_m2=np.array([given["Ixx"], given["Iyy"], given["Izz"]]),
        radius_m=radius_m,
        thrust=given["k_eta"],
        torque_m=given["k_m"] / given["k_eta"],
        positions_m=np.array(list(given["rotor_pos"].values()), dtype=np.float64),
        clockwise=np.array(given["rotor_directions"], dtype=np.float64),
        max_thrust_n=thrust_to_weight * given["mass"] * GRAVITY_M_S2 / given["num_rotors"],
        lag_s=lag_s,
        cells=cells,
    )


class RotorPy(Simulator):
    """RotorPy: one `Multirotor` and one controller for each flight."""

    kinds: ClassVar = {
        "hummingbird": _kind(hummingbird_params.quad_params, 0.10, (0.015, 0.03), 3, 2.6),
        "px4_quadx": _kind(px4_sihsim_quadx_params.quad_params, 0.12, (0.03, 0.05), 4, 2.2),
        "crazyflie": _kind(crazyflie_params.quad_params, 0.0235, (0.03, 0.05), 1, 1.95),
    }
    own = frozenset({"rotor_drag", "body_drag", "inflow.hub", "translational_lift.hub", "wind", "motor_lag"})

    def __init__(self, flights: Sequence[Flight]) -> None:
        """Vehicles and controllers of the flights."""
        super().__init__(flights)
        self.vehicles = [_vehicle(f, lag) for f, lag in zip(flights, self.lags, strict=True)]
        self.winds = np.array([_wind(f) for f in flights])
        self.controllers = [_controller(v, w) for v, w in zip(self.vehicles, self.bandwidth, strict=True)]

    def aim(self, state: State, goal: Reference) -> Aim:
        """Thrust and attitude of `SE3Control`."""
        asked = []
        for i, controller in enumerate(self.controllers):
            here = {"x": state.position[i], "v": state.velocity[i], "q": state.quaternion[i], "w": state.rates[i]}
            there = {"x": goal.position[i], "x_dot": goal.velocity[i], "x_ddot": goal.acceleration[i]}
            asked.append(controller.update(0.0, here, there | {"yaw": goal.yaw[i], "yaw_dot": 0.0}))
        aims = Rotation.from_quat(np.array([a["cmd_q"] for a in asked])).as_matrix()
        return Aim(np.array([a["cmd_thrust"] for a in asked]), np.asarray(aims))

    def slope(self, state: State, command: Array, force: Array, moment: Array, load_kg: Array) -> Slope:
        """RotorPy's derivatives, with the forces and moments on top."""
        rows = np.column_stack(
            [state.position, state.velocity, state.quaternion, state.rates, self.winds, state.speeds]
        )
        plain = np.array([v._s_dot_fn(0.0, r, c) for v, r, c in zip(self.vehicles, rows, command, strict=True)])
        mass = self.fleet.mass_kg[:, None]
        force = force - load_kg[:, None] * np.array([0.0, 0.0, GRAVITY_M_S2])
        acceleration = (mass * plain[:, 3:6] + force) / (mass + load_kg[:, None])
        return Slope(acceleration, plain[:, 10:13] + moment / self.fleet.inertia_kg_m2, plain[:, 16:])


def _vehicle(flight: Flight, lag_s: float) -> Multirotor:
    """Vehicle of RotorPy, with what it can hide in its own parameters."""
    craft, kind = flight.craft, flight.craft.kind
    per_rotor = craft.mass_kg / (craft.count * craft.hover_rad_s)
    wind = flight.hidden.get("wind", {})
    area = {axis: flight.parameter("body_drag", axis, wind.get("area", 0.0)) for axis in "xyz"}
    return Multirotor(
        {
            "mass": craft.mass_kg,
            **dict(zip(("Ixx", "Iyy", "Izz"), craft.inertia_kg_m2, strict=True)),
            **dict.fromkeys(("Ixy", "Iyz", "Ixz"), 0.0),
            "num_rotors": craft.count,
            "rotor_pos": {f"r{i}": place for i, place in enumerate(kind.positions_m, start=1)},
            "rotor_directions": kind.clockwise,
            "k_eta": craft.thrust,
            "k_m": kind.torque_m * craft.thrust,
            "k_d": per_rotor * flight.parameter("rotor_drag", "x", wind.get("rate", 0.0)),
            "k_z": per_rotor * flight.parameter("inflow.hub", "rate"),
            "k_h": craft.mass_kg / craft.count * flight.parameter("translational_lift.hub", "per_m"),
            **{f"c_D{axis}": 0.5 * DENSITY_KG_M3 * value for axis, value in area.items()},
            "tau_m": lag_s,
            "rotor_speed_min": 0.0,
            "rotor_speed_max": 1e9,
            "k_flap": 0.0,
        }
    )


def _wind(flight: Flight) -> Array:
    """Wind of a flight, north, west, up."""
    course = np.radians(flight.hidden.get("wind", {}).get("course_deg", 0.0))
    return np.asarray(flight.parameter("wind", "speed") * np.array([np.cos(course), -np.sin(course), 0.0]))


def _controller(vehicle: Multirotor, bandwidth: float) -> SE3Control:
    """RotorPy's controller, with gains that suit the motors; its moments are not used."""
    names = ("mass", "Ixx", "Iyy", "Izz", "Ixy", "Iyz", "Ixz", "c_Dx", "c_Dy", "c_Dz", "num_rotors", "rotor_pos")
    more = ("rotor_speed_min", "rotor_speed_max", "k_eta", "k_m", "k_d", "k_z", "k_flap", "tau_m")
    given = {name: getattr(vehicle, name) for name in (*names, *more)}
    controller = SE3Control(given | {"rotor_directions": vehicle.rotor_dir})
    slow = 0.28 * bandwidth * np.array([1.0, 1.0, 1.3])
    controller.kp_pos, controller.kd_pos = slow**2, 1.7 * slow
    return controller
