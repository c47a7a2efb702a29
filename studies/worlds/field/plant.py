"""True multirotors of a batch: motors, thrust, hidden effects, gusts and the motion of the rigid bodies."""

from typing import Any

import numpy as np

from studies.worlds.field.arrays import (
    GRAVITY_M_S2,
    Floats,
    Rows,
    cross,
    orthonormal,
    rotate,
    rotate_back,
    rotation_from_vector,
)
from studies.worlds.field.batch import Signal, approach, per_flight, per_rotor
from studies.worlds.field.battery import Batteries
from studies.worlds.field.cases import NOISE_STEP_S, Case, Flight
from studies.worlds.field.effects import EFFECTS, Air, Effect, Parameters

DRAGS = ("rotor_drag", "body_drag", "wind")
ROUGHNESS_M = 0.05
CONTACT_PER_S2 = 400.0
"""Stiffness per mass of ground and ceiling: no reference asks for contact, but a vehicle must not fly through them."""


def active_effects(cases: list[Case]) -> list[tuple[Effect, Rows, Parameters]]:
    """Group the hidden effects of a batch: each variant with its rows and one parameter value per row.

    Drags come last, because some of them are proportional to the thrust that the other effects leave.
    """
    found: dict[str, list[tuple[int, dict[str, float]]]] = {}
    for row, case in enumerate(cases):
        for hidden in case.hidden:
            if hidden.variant in EFFECTS:
                found.setdefault(hidden.variant, []).append((row, hidden.parameters))
    active: list[tuple[Effect, Rows, Parameters]] = []
    for variant in sorted(found, key=lambda name: ("drag" in name, name)):
        rows = np.array([row for row, _ in found[variant]], dtype=np.intp)
        names = found[variant][0][1]
        parameters = {name: np.array([values[name] for _, values in found[variant]]) for name in names}
        active.append((EFFECTS[variant], rows, parameters))
    return active


class Plant:
    """State of all vehicles of a batch, NED and FRD, and one step of their motion."""

    def __init__(self, cases: list[Case], flights: list[Flight], duration_s: float, step_s: float) -> None:
        """Start in hover at the beginning of each reference."""
        self._step_s = step_s
        self._set_vehicles(cases)
        self._set_effects(cases, flights)
        count = len(cases)
        self._gusts = Signal([flight.gusts_m_s for flight in flights], NOISE_STEP_S, duration_s)
        self.position_m: Floats = np.stack([flight.reference.position_m[0] for flight in flights])
        self.velocity_m_s = np.zeros((count, 3))
        self.accel_m_s2 = np.zeros((count, 3))
        yaw = np.array([flight.reference.yaw_rad[0] for flight in flights])
        self.attitude = rotation_from_vector(yaw[:, None] * np.array([0.0, 0.0, 1.0]))
        self.rates_rad_s = np.zeros((count, 3))
        self.specific_force_m_s2 = np.zeros((count, 3))
        self.hidden_accel_m_s2 = np.zeros((count, 3))
        """Acceleration that the vehicle file's rigid body with the logged rotor speeds does not have."""
        self.lowest_m = np.full(count, np.inf)
        """Height of the lowest rotor above the ground."""
        hover = (self._mass * GRAVITY_M_S2 / self._present.sum(axis=1))[:, None]
        self.rpm = np.sqrt(hover / np.where(self._coefficient > 0.0, self._coefficient, 1.0)) * self._present
        self._hover_power = np.sum((self._coefficient * self.rpm**2) ** 1.5, axis=1)
        self._steps = 0
        self.batteries = Batteries(cases, np.array([flight.charge for flight in flights]))
        self._air = Air(
            position_m=self.position_m,
            attitude=self.attitude,
            rates_rad_s=self.rates_rad_s,
            rpm=self.rpm,
            thrust_n=self._coefficient * self.rpm**2,
            rotor_height_m=np.ones_like(self.rpm),
            body_air_m_s=self.velocity_m_s,
            world_velocity_m_s=self.velocity_m_s,
            mass_kg=self._mass,
            radius_m=self._radius,
            hubs_m=self._hubs,
            present=self._present,
            hover_rpm=per_flight(cases, lambda case: case.vehicle.hover_rpm),
            induced_m_s=per_flight(cases, lambda case: case.vehicle.induced_m_s),
            density_kg_m3=per_flight(cases, lambda case: case.vehicle.air_density_kg_m3),
            lift_slope_solidity=per_flight(cases, lambda case: case.vehicle.lift_slope_solidity),
            ceiling_m=self._ceiling,
            gain=self._present,
            body_force_n=np.zeros((count, 3)),
            world_force_n=np.zeros((count, 3)),
        )

    def _set_vehicles(self, cases: list[Case]) -> None:
        self._mass = per_flight(cases, lambda case: case.vehicle.mass_kg)
        self._inertia: Floats = np.stack([case.vehicle.inertia_kg_m2 for case in cases])
        self._radius = per_flight(cases, lambda case: case.vehicle.radius_m)
        self._rotor_height = per_flight(cases, lambda case: case.vehicle.rotor_height_m)
        self._ceiling = per_flight(cases, lambda case: 1e3 if case.ceiling_m is None else case.ceiling_m)
        self._present = per_rotor(cases, lambda case: np.ones(case.vehicle.rotors))
        self._coefficient = per_rotor(
            cases, lambda case: case.vehicle.thrust_n_per_rpm2 * (1.0 + case.vehicle.rotor_spread)
        )
        self._hubs = per_rotor(cases, lambda case: case.vehicle.positions_m)
        self._arms = per_rotor(cases, lambda case: case.vehicle.positions_m - case.vehicle.centre_of_mass_m)
        self._torque = per_rotor(cases, lambda case: case.vehicle.yaw_signs * case.vehicle.torque_to_thrust_m)
        self._motor_step = approach(self._step_s, per_flight(cases, lambda case: case.vehicle.motor_time_s))

    def _set_effects(self, cases: list[Case], flights: list[Flight]) -> None:
        def hidden(family: str, name: str, default: float) -> Floats:
            return per_flight(cases, lambda case: case.parameter(family, name, default))

        tilt = [np.radians(hidden("thrust_tilt", name, 0.0)) for name in ("roll_deg", "pitch_deg")]
        turned = rotation_from_vector(np.stack([*tilt, np.zeros(len(cases))], axis=1))
        self._thrust_axis: Floats = -turned[:, :, 2]
        self._lagged = np.array(["motor_lag" in case.families for case in cases])[:, None]
        self._sag_power = hidden("battery_sag", "exponent", 0.0)
        self._sag_reference = hidden("battery_sag", "reference_v", 1.0)
        self._thrust_scale = hidden("thrust_scale", "factor", 1.0)
        self._mass_change = np.array([flight.mass_change for flight in flights])
        self._change_at = np.array([flight.settle_s + flight.mass_change_at_s for flight in flights])
        self._change_takes = np.array([max(flight.mass_change_takes_s, self._step_s) for flight in flights])
        dragged = np.array([any(family in DRAGS for family in case.families) for case in cases])
        self._gust_coupling = np.where(dragged, 0.0, np.array([flight.gust_coupling_per_s for flight in flights]))
        self._stirred = np.array(["ground_effect" in case.families for case in cases])
        self._mean_wind: Floats = np.stack([flight.mean_wind_m_s for flight in flights])
        self._sheared = np.array([flight.shear for flight in flights])
        self._effects = active_effects(cases)

    def known_thrust_gain(self) -> Floats:
        """True over believed thrust per mass at the start, as an autopilot has learned it in flights before."""
        return np.asarray(self._thrust_scale * self._sag())

    def _sag(self) -> Floats:
        return np.asarray((self.batteries.voltage_v / self._sag_reference) ** self._sag_power)

    def _wind(self, gust: Floats) -> Floats:
        """Air velocity at the vehicles: mean wind, with a logarithmic profile in some cases, and gusts."""
        if not self._mean_wind.any():
            return gust
        height = np.maximum(-self.position_m[:, 2], 0.3)
        profile = np.log(height / ROUGHNESS_M + 1.0) / np.log(10.0 / ROUGHNESS_M + 1.0)
        return np.asarray(gust + self._mean_wind * np.where(self._sheared, profile, 1.0)[:, None])

    def _breathe(self, mass: Floats, gust: Floats) -> tuple[Floats, Floats]:
        """Apply the hidden aerodynamic effects: thrust of each rotor, (N, n), and their other forces in the world."""
        air = self._air
        air.position_m, air.attitude, air.rates_rad_s, air.rpm = (
            self.position_m,
            self.attitude,
            self.rates_rad_s,
            self.rpm,
        )
        air.thrust_n = self._coefficient * self.rpm * self.rpm
        sunk = np.einsum("nrk,nk->nr", self._hubs, self.attitude[:, 2, :])
        air.rotor_height_m = self._rotor_height[:, None] - self.position_m[:, 2:3] - sunk
        air.world_velocity_m_s = self.velocity_m_s
        air.body_air_m_s = rotate_back(self.attitude, self.velocity_m_s - self._wind(gust))
        air.mass_kg = mass
        air.gain = self._present.copy()
        air.body_force_n = np.zeros_like(self.velocity_m_s)
        air.world_force_n = np.zeros_like(self.velocity_m_s)
        for effect, rows, parameters in self._effects:
            effect(air, rows, parameters)
        self.lowest_m = np.min(np.where(self._present > 0.0, air.rotor_height_m, np.inf), axis=1)
        return air.thrust_n * air.gain, rotate(self.attitude, air.body_force_n) + air.world_force_n

    def _contact(self) -> Floats:
        """Acceleration (down) of ground and ceiling on a vehicle whose rotors all but touch them."""
        ground = np.maximum(0.25 * self._radius - self.lowest_m, 0.0)
        top = self._rotor_height - self.position_m[:, 2]
        ceiling = np.maximum(top - self._ceiling + 0.25 * self._radius, 0.0)
        return np.asarray(CONTACT_PER_S2 * (ceiling - ground))

    def advance(self, command_rpm: Floats, time_s: float) -> None:
        """Advance by one step with the commanded rotor speeds, (N, n)."""
        step = self._step_s
        sag = self._sag()[:, None]
        self.rpm = self.rpm + self._motor_step * (command_rpm * np.sqrt(sag) - self.rpm)
        passed = np.clip((time_s - self._change_at) / self._change_takes, 0.0, 1.0)
        mass = self._mass * (1.0 + self._mass_change * passed)
        inertia = self._inertia * (1.0 + 0.3 * self._mass_change * passed)[:, None]
        gust = self._gusts.at(time_s)
        thrust, force = self._breathe(mass, gust)
        force = force + rotate(self.attitude, np.sum(thrust, axis=1)[:, None] * self._thrust_axis)
        logged_rpm = np.where(self._lagged, command_rpm, self.rpm / np.sqrt(sag))
        nominal = np.sum(self._coefficient * logged_rpm * logged_rpm, axis=1) / self._thrust_scale / self._mass
        self.hidden_accel_m_s2 = force / mass[:, None] + nominal[:, None] * self.attitude[:, :, 2]
        near = np.exp(-np.maximum(self.lowest_m, 0.0) / (2.0 * self._radius))
        disturbance = (self._gust_coupling * (1.0 + 2.0 * self._stirred * near))[:, None] * gust
        disturbance[:, 2] += self._contact()
        accel = force / mass[:, None] + disturbance
        self.specific_force_m_s2 = rotate_back(self.attitude, accel)
        accel[:, 2] += GRAVITY_M_S2
        moment = np.stack(
            [
                -np.sum(self._arms[:, :, 1] * thrust, axis=1),
                np.sum(self._arms[:, :, 0] * thrust, axis=1),
                np.sum(self._torque * thrust, axis=1),
            ],
            axis=1,
        )
        self.batteries.advance(np.sum(thrust**1.5, axis=1) / self._hover_power, step)
        self.accel_m_s2 = accel
        self.position_m = self.position_m + step * self.velocity_m_s + 0.5 * step * step * accel
        self.velocity_m_s = self.velocity_m_s + step * accel
        self.rates_rad_s = (
            self.rates_rad_s + step * (moment - cross(self.rates_rad_s, inertia * self.rates_rad_s)) / inertia
        )
        self.attitude = np.matmul(self.attitude, rotation_from_vector(self.rates_rad_s * step))
        self._steps += 1
        if self._steps % 50 == 0:
            self.attitude = orthonormal(self.attitude)

    def snapshot(self) -> dict[str, Any]:
        """True quantities for the record."""
        return {
            "position_m": self.position_m,
            "velocity_m_s": self.velocity_m_s,
            "accel_m_s2": self.accel_m_s2,
            "attitude": self.attitude,
            "rpm": self.rpm,
            "specific_force_m_s2": self.specific_force_m_s2,
            "hidden_accel_m_s2": self.hidden_accel_m_s2,
            "lowest_m": self.lowest_m,
            "voltage_v": self.batteries.voltage_v,
        }
