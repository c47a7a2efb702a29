"""World of drone-models: its first-principles dynamics with its measured Crazyflies.

Linear drag, the thrust curve and the lag of the motors are its own; the rest is injected as its disturbance force and
torque. It has no controller: the vehicles are flown by a cascade of Euler angles.
"""

from __future__ import annotations

import os
import tomllib
from collections.abc import Callable, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from scipy.spatial.transform import Rotation

from studies.worlds.borrowed.craft import GRAVITY_M_S2, RPM, Array, Kind
from studies.worlds.borrowed.flight import Aim, Flight, Simulator, Slope, State
from studies.worlds.borrowed.missions import Reference


def _dynamics() -> Callable[..., tuple[Array, ...]]:
    """Dynamics of drone_models, which asks for a setting of SciPy when it is imported."""
    before = os.environ.get("SCIPY_ARRAY_API")
    os.environ["SCIPY_ARRAY_API"] = "1"
    from drone_models.first_principles import dynamics

    if before is None:
        del os.environ["SCIPY_ARRAY_API"]
    found: Callable[..., tuple[Array, ...]] = dynamics
    return found


DYNAMICS = _dynamics()
_SPEC = find_spec("drone_models")
assert _SPEC is not None and _SPEC.origin is not None
PUBLISHED: dict[str, dict[str, Any]] = tomllib.loads((Path(_SPEC.origin).parent / "data/params.toml").read_text())


def _kind(name: str) -> Kind:
    """Published vehicle, with the pure square in the place of its thrust curve that agrees with it in hover."""
    given = PUBLISHED[name]
    _, b, c = given["rpm2thrust"]
    each = given["mass"] * GRAVITY_M_S2 / 4.0
    hover_rpm = (-b + np.sqrt(b**2 + 4.0 * c * each)) / (2.0 * c)
    mixing = np.array(given["mixing_matrix"])
    return Kind(
        mass_kg=given["mass"],
        inertia_kg_m2=np.diag(given["J"]).astype(np.float64),
        radius_m=given["prop_radius"],
        thrust=each / hover_rpm**2 * RPM**2,
        torque_m=given["thrust2torque"],
        positions_m=given["L"] * np.column_stack([-mixing[1], mixing[0], np.zeros(4)]),
        clockwise=mixing[2],
        max_thrust_n=given["thrust_max"],
        lag_s=(0.03, 0.05),
        cells=1,
    )


class DroneModels(Simulator):
    """drone-models: all flights at once, each with its own parameters."""

    kinds: ClassVar = {name: _kind(name) for name in ("cf2x_L250", "cf2x_P250", "cf2x_T350", "cf21B_500")}
    own = frozenset({"rotor_drag.measured", "thrust_curve.measured", "motor_lag"})

    def __init__(self, flights: Sequence[Flight]) -> None:
        """Parameters of all flights side by side."""
        super().__init__(flights)
        f = self.fleet
        inertia = np.array([np.diag(i) for i in f.inertia_kg_m2])
        square = np.array([flight.craft.thrust for flight in flights]) / RPM**2
        line = np.array([flight.parameter("thrust_curve.measured", "size") * _line(flight) for flight in flights])
        hover_rpm = f.hover_rad_s * RPM
        quick = 1.0 / self.lags
        late = np.array(["motor_lag" in flight.hidden for flight in flights])
        drags = [flight.parameter("rotor_drag.measured", "size") * _drag(flight) for flight in flights]
        self.mass = f.mass_kg
        self.parameters = {
            "L": 1.0,
            "prop_inertia": float(np.mean([PUBLISHED[flight.craft.name]["prop_inertia"] for flight in flights])),
            "gravity_vec": np.array([0.0, 0.0, -GRAVITY_M_S2]),
            "J": inertia,
            "J_inv": np.linalg.inv(inertia),
            "rpm2thrust": np.stack([0.0 * line, line, square - line / hover_rpm])[:, :, None],
            "rpm2torque": np.stack([0.0 * square, 0.0 * square, f.torque_m * square])[:, :, None],
            "mixing_matrix": np.stack([f.positions_m[:, :, 1], -f.positions_m[:, :, 0], f.clockwise], axis=1),
            "drag_matrix": np.array(drags),
            # Speeding up by a line, slowing down by squares where the motors are late, as those of the 2x are measured.
            "rotor_dyn_coef": np.stack(
                [quick, 0.0 * quick, np.where(late, 0.0, quick), np.where(late, quick / (2.0 * hover_rpm), 0.0)]
            )[:, :, None],
        }

    def aim(self, state: State, goal: Reference) -> Aim:
        """Thrust and Euler angles of a cascade of position and velocity."""
        slow = 0.26 * self.bandwidth[:, None] * np.array([1.0, 1.0, 1.5])
        wish = slow**2 * (goal.position - state.position) + 1.7 * slow * (goal.velocity - state.velocity)
        wish = wish + np.array([0.6, 0.6, 1.0]) * goal.acceleration
        wish[:, :2] *= np.minimum(1.0, 6.0 / np.maximum(np.hypot(wish[:, 0], wish[:, 1]), 1e-9))[:, None]
        wish[:, 2] = np.clip(wish[:, 2], -6.0, 6.0) + GRAVITY_M_S2
        ahead = np.cos(goal.yaw) * wish[:, 0] + np.sin(goal.yaw) * wish[:, 1]
        left = -np.sin(goal.yaw) * wish[:, 0] + np.cos(goal.yaw) * wish[:, 1]
        pitch = np.arctan2(ahead, wish[:, 2])
        roll = np.arctan2(-left * np.cos(pitch), wish[:, 2])
        rotation = Rotation.from_euler("ZYX", np.column_stack([goal.yaw, pitch, roll])).as_matrix()
        thrust = self.fleet.mass_kg * np.maximum(np.einsum("ni,ni->n", wish, state.rotation[:, :, 2]), 2.0)
        return Aim(thrust, np.asarray(rotation))

    def slope(self, state: State, command: Array, force: Array, moment: Array, load_kg: Array) -> Slope:
        """Derivatives of the library, with forces and moments as its disturbances."""
        torque = np.einsum("nij,nj->ni", state.rotation, moment)
        _, _, acceleration, spin_up, speeds = DYNAMICS(
            state.position, state.quaternion, state.velocity, state.rates, command * RPM, state.speeds * RPM,
            force, torque, mass=(self.mass + load_kg)[:, None], **self.parameters,
        )  # fmt: skip
        return Slope(np.asarray(acceleration), np.asarray(spin_up), np.asarray(speeds) / RPM)


def _line(flight: Flight) -> float:
    """Linear part of the published thrust, scaled to the specimen."""
    return float(PUBLISHED[flight.craft.name]["rpm2thrust"][1] * flight.craft.thrust / flight.craft.kind.thrust)


def _drag(flight: Flight) -> Array:
    """Drag of the published vehicle, N/(m/s)."""
    return np.array(PUBLISHED[flight.craft.name]["drag_matrix"], dtype=np.float64)
