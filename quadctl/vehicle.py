"""The vehicle, as in its YAML file: mass, rotors, geometry, thrust and throttle curves."""

import math
from collections.abc import Sequence
from functools import cached_property
from pathlib import Path
from typing import Annotated, Literal, Self

import numpy as np
from pydantic import Field, NonNegativeFloat, PositiveFloat, model_validator

from quadctl.allocation import Allocation
from quadctl.frames import GRAVITY_M_S2
from quadctl.numeric import Number, Vector
from quadctl.settings import Settings, load

Triple = tuple[float, float, float]
_Arm = Annotated[float, Field(gt=-20.0, lt=20.0)]

MIN_THRUST_COEFFICIENT, MAX_THRUST_COEFFICIENT = 1e-3, 0.2
"""Possible C_T = T / (rho A (omega R)^2): propellers have 0.005 to 0.03, so a value outside is a wrong unit."""


class Rotor(Settings):
    """Properties that all rotors share."""

    radius_m: float = Field(gt=0.0, lt=5.0)
    thrust_n_per_rpm2: PositiveFloat
    torque_to_thrust_m: NonNegativeFloat = 0.016
    time_constant_s: float = Field(default=0.04, ge=0.0, lt=2.0)
    delay_s: float = Field(default=0.0, ge=0.0, lt=0.5)
    """Time from a command until the rotors begin to follow it, before the lag."""


class RotorPlace(Settings):
    """Place of one rotor (FRD, from the centre of mass), its sense of rotation seen from above, and its tilt."""

    position_m: tuple[_Arm, _Arm, _Arm]
    spin: Literal["cw", "ccw"]
    cant_deg: float = Field(default=0.0, gt=-90.0, lt=90.0)
    dihedral_deg: float = Field(default=0.0, gt=-90.0, lt=90.0)

    @cached_property
    def axis(self) -> Triple:
        """Unit vector of the thrust, FRD: (0, 0, -1) for an upright rotor.

        Cant turns the axis right-handed about the rotor's outward arm (a rotor in front leans right), dihedral leans it
        toward the centre of the vehicle.
        """
        azimuth = math.atan2(self.position_m[1], self.position_m[0])
        cant, dihedral = math.radians(self.cant_deg), math.radians(self.dihedral_deg)
        inward = math.cos(cant) * math.sin(dihedral)
        sideways = math.sin(cant)
        return (
            -inward * math.cos(azimuth) - sideways * math.sin(azimuth),
            -inward * math.sin(azimuth) + sideways * math.cos(azimuth),
            -math.cos(cant) * math.cos(dihedral),
        )


class ThrottleCurve(Settings):
    """throttle = offset + per_newton * total thrust, throttle in 0..1."""

    per_newton: PositiveFloat
    offset: float = Field(default=0.0, ge=-1.0, lt=1.0)
    max_thrust_per_rotor_n: PositiveFloat


class AxisResponse(Settings):
    """Answer of the attitude about one axis to its setpoint: a delay, then second order."""

    frequency_rad_s: float = Field(gt=0.5, le=200.0)
    damping: float = Field(default=1.0, ge=0.2, le=5.0)
    delay_s: float = Field(default=0.0, ge=0.0, le=0.5)
    lag_interval_s: tuple[NonNegativeFloat, NonNegativeFloat] | None = None
    """95 % interval of `lag_s`; None: nobody has told it."""

    @property
    def lag_s(self) -> float:
        """Time by which it is behind a setpoint that changes slowly."""
        return self.delay_s + 2.0 * self.damping / self.frequency_rad_s


class AttitudeResponse(Settings):
    """Answer of an autopilot's attitude loop on this vehicle, as found in a log."""

    roll: AxisResponse
    pitch: AxisResponse

    @property
    def lag_s(self) -> float:
        """Time by which the direction of thrust is behind its setpoint."""
        return 0.5 * (self.roll.lag_s + self.pitch.lag_s)

    @property
    def lag_interval_s(self) -> tuple[float, float] | None:
        """95 % interval of `lag_s`, as wide as if both axes were off to the same side; None: nobody has told it."""
        roll, pitch = self.roll.lag_interval_s, self.pitch.lag_interval_s
        return None if roll is None or pitch is None else (0.5 * (roll[0] + pitch[0]), 0.5 * (roll[1] + pitch[1]))


Assumable = Literal[
    "rotor.thrust_n_per_rpm2",
    "rotor.torque_to_thrust_m",
    "rotor.time_constant_s",
    "rotor_height_m",
    "rotors",
    "throttle",
]
"""Field of a vehicle that can be said to be assumed."""


class Vehicle(Settings):
    """A multirotor, as in its YAML file. Immutable."""

    name: str
    mass_kg: float = Field(gt=0.0, lt=1000.0)
    inertia_kg_m2: tuple[PositiveFloat, PositiveFloat, PositiveFloat] | None = None
    rotor: Rotor
    rotors: tuple[RotorPlace, ...] = Field(min_length=3)
    rotor_height_m: float = Field(default=0.0, gt=-5.0, lt=5.0)
    throttle: ThrottleCurve
    ceiling_m: PositiveFloat | None = None
    air_density_kg_m3: PositiveFloat = 1.225
    endurance_s: PositiveFloat | None = None
    """Hover time on a full battery, until the voltage at which a flight should end."""
    attitude_response: AttitudeResponse | None = None
    """Answer of the attitude to its setpoint; None: not known, and references are not looked at ahead."""
    assumed: tuple[Assumable, ...] | None = None
    """Fields whose numbers nobody has measured."""

    @model_validator(mode="after")
    def _can_fly(self) -> Self:
        """Check values that are possible one by one, but not together: usually a wrong unit or a copied line."""
        _require_geometry(self.rotors, self.rotor.radius_m)
        _require_thrust(self)
        _require_inertia(self.inertia_kg_m2)
        return self

    @property
    def n_rotors(self) -> int:
        return len(self.rotors)

    @cached_property
    def weight_n(self) -> float:
        return self.mass_kg * GRAVITY_M_S2

    @property
    def hover_throttle(self) -> float:
        """Throttle that carries the weight, by the throttle curve."""
        return self.throttle.offset + self.throttle.per_newton * self.weight_n

    @cached_property
    def max_thrust_n(self) -> float:
        """Largest thrust of all rotors together."""
        return self.throttle.max_thrust_per_rotor_n * self.n_rotors

    @cached_property
    def axial_share(self) -> float:
        """Force along the body's thrust axis over the sum of the rotors' thrusts: 1 when all rotors are upright."""
        return -sum(rotor.axis[2] for rotor in self.rotors) / self.n_rotors

    @cached_property
    def rotors_by_axis(self) -> tuple[tuple[Triple, tuple[int, ...]], ...]:
        """The thrust axes, FRD, and the numbers of the rotors that share each, from 0: one where all are upright."""
        axes = [rotor.axis for rotor in self.rotors]
        return tuple((axis, tuple(i for i, a in enumerate(axes) if a == axis)) for axis in dict.fromkeys(axes))

    @cached_property
    def moment_arms_m(self) -> tuple[Triple, ...]:
        """Moment about the centre of mass per thrust of each rotor, FRD, N m/N: lever and drag torque.

        A rotor that turns counter-clockwise seen from above drives the body clockwise, i.e. positive about down, which
        is against its thrust axis.
        """
        arms = []
        for rotor, (dx, dy, dz) in zip(self.rotors, self.drag_arms_m, strict=True):
            (px, py, pz), (ax, ay, az) = rotor.position_m, rotor.axis
            arms.append((py * az - pz * ay + dx, pz * ax - px * az + dy, px * ay - py * ax + dz))
        return tuple(arms)

    @cached_property
    def drag_arms_m(self) -> tuple[Triple, ...]:
        """Drag torque per thrust of each rotor, FRD, N m/N."""
        arms = []
        for rotor in self.rotors:
            ax, ay, az = rotor.axis
            drag = -self.rotor.torque_to_thrust_m if rotor.spin == "ccw" else self.rotor.torque_to_thrust_m
            arms.append((drag * ax, drag * ay, drag * az))
        return tuple(arms)

    @cached_property
    def allocation(self) -> Allocation:
        """Allocation of force and moment to the rotors."""
        rows = [[*rotor.axis, *arms] for rotor, arms in zip(self.rotors, self.moment_arms_m, strict=True)]
        return Allocation(np.array(rows).T, self.throttle.max_thrust_per_rotor_n, 0.5 * self.opposite_distance_m)

    def rotor_force(self, thrust_n: Sequence[Number]) -> Vector:
        """Force of the rotors on the body, FRD, N, from the thrust of each, N."""
        fx: Number = 0.0
        fy: Number = 0.0
        fz: Number = 0.0
        for (ax, ay, az), rotors in self.rotors_by_axis:
            t: Number = 0.0
            for i in rotors:
                t = t + thrust_n[i]
            fz = fz + az * t
            if ax or ay:  # only of tilted rotors: where all are upright, the force along x and y is no array
                fx, fy = fx + ax * t, fy + ay * t
        return fx, fy, fz

    def rotor_torque(self, thrust_n: Sequence[Number]) -> Vector:
        """Moment of the rotors about the centre of mass, FRD, N m, from the thrust of each, N."""
        tx: Number = 0.0
        ty: Number = 0.0
        tz: Number = 0.0
        for (mx, my, mz), t in zip(self.moment_arms_m, thrust_n, strict=True):
            tx, ty, tz = tx + mx * t, ty + my * t, tz + mz * t
        return tx, ty, tz

    @cached_property
    def hover_induced_velocity_m_s(self) -> float:
        """v_h = sqrt(T / (2 rho pi R^2)) with the thrust of one rotor in hover (momentum theory)."""
        disk_m2 = math.pi * self.rotor.radius_m**2
        return math.sqrt(self.weight_n / self.n_rotors / (2.0 * self.air_density_kg_m3 * disk_m2))

    @cached_property
    def adjacent_distance_m(self) -> float:
        """d: distance between the axes of neighbouring rotors (the smallest between any two)."""
        return min(self._distances_m)

    @cached_property
    def opposite_distance_m(self) -> float:
        """b: distance between the axes of opposite rotors (the largest between any two)."""
        return max(self._distances_m)

    @cached_property
    def _distances_m(self) -> list[float]:
        places = [r.position_m for r in self.rotors]
        return [math.hypot(p[0] - q[0], p[1] - q[1]) for i, p in enumerate(places) for q in places[:i]]

    @cached_property
    def principal_inertia_kg_m2(self) -> Triple:
        """The file's inertia, or that of a vehicle of this mass whose parts sit, on average, at half the arm length."""
        if self.inertia_kg_m2 is not None:
            return self.inertia_kg_m2
        radius_m = 0.25 * self.opposite_distance_m
        flat = 0.5 * self.mass_kg * radius_m**2
        return flat, flat, 2.0 * flat


LEAST_STACK = 0.1
"""Distance between the planes of coaxial rotors, over the radius, below which they would touch."""


def _require_geometry(rotors: tuple[RotorPlace, ...], radius_m: float) -> None:
    for i, rotor in enumerate(rotors):
        for j, other in enumerate(rotors[:i]):
            if math.dist(rotor.position_m, other.position_m) < 1e-3:
                raise ValueError(f"rotors[{i + 1}] is at the place of rotors[{j + 1}], expected places of their own")
            apart_m = math.dist(rotor.position_m[:2], other.position_m[:2])
            if apart_m < radius_m and abs(rotor.position_m[2] - other.position_m[2]) < LEAST_STACK * radius_m:
                raise ValueError(
                    f"rotors[{i + 1}] turns inside rotors[{j + 1}], {apart_m:.3g} m from it with a radius_m of "
                    f"{radius_m:g}, expected a place outside, or coaxial rotors at different heights"
                )
    x0, y0, _ = rotors[0].position_m
    arms = [(r.position_m[0] - x0, r.position_m[1] - y0) for r in rotors[1:]]
    along = max(arms, key=lambda arm: math.hypot(*arm))
    if all(abs(along[0] * y - along[1] * x) < 1e-3 * math.hypot(*along) for x, y in arms):
        raise ValueError(
            "rotors are all on one line, about which nothing holds the vehicle, expected them around its centre"
        )
    if len(rotors) > 3 and len({r.spin for r in rotors}) == 1 and not any(r.cant_deg for r in rotors):
        raise ValueError(f"rotors all turn {rotors[0].spin}, which turns the vehicle, expected some cw and some ccw")


def _require_thrust(vehicle: Vehicle) -> None:
    if vehicle.max_thrust_n <= vehicle.weight_n:
        raise ValueError(
            f"throttle.max_thrust_per_rotor_n is {vehicle.throttle.max_thrust_per_rotor_n:g}, expected more than "
            f"{vehicle.weight_n / vehicle.n_rotors:.3g} N, a rotor's share of the weight"
        )
    hover = vehicle.hover_throttle
    if not 0.0 < hover < 1.0:
        raise ValueError(f"throttle is {hover:.3g} in hover (offset + per_newton * weight), expected between 0 and 1")
    rotor = vehicle.rotor
    tip_m_s_per_rpm = math.pi / 30.0 * rotor.radius_m
    per_coefficient = vehicle.air_density_kg_m3 * math.pi * rotor.radius_m**2 * tip_m_s_per_rpm**2
    coefficient = rotor.thrust_n_per_rpm2 / per_coefficient
    if not MIN_THRUST_COEFFICIENT < coefficient < MAX_THRUST_COEFFICIENT:
        raise ValueError(
            f"rotor.thrust_n_per_rpm2 is {rotor.thrust_n_per_rpm2:g}, expected "
            f"{MIN_THRUST_COEFFICIENT * per_coefficient:.2g} to {MAX_THRUST_COEFFICIENT * per_coefficient:.2g} "
            f"with radius_m = {rotor.radius_m:g} and air_density_kg_m3 = {vehicle.air_density_kg_m3:g}"
        )


INERTIA_TOLERANCE = 1.3
"""Factor on the sum of two moments of inertia, which the third cannot exceed: a flat vehicle comes close to it, and
estimates are off by a fifth."""


def _require_inertia(inertia_kg_m2: Triple | None) -> None:
    if inertia_kg_m2 is None:
        return
    *rest, largest = sorted(inertia_kg_m2)
    if largest > sum(rest) * INERTIA_TOLERANCE:
        raise ValueError(f"inertia_kg_m2 holds {largest:g}, expected at most the sum of the other two, as in any body")


def load_vehicle(path: Path | str) -> Vehicle:
    """Read a vehicle file; raises SettingsError with one sentence when it cannot be used."""
    return load(path, Vehicle)
