"""Estimators of a batch: lagging velocity, tilt driven by acceleration, drift, gyro filters."""

import numpy as np

from studies.worlds.field.arrays import GRAVITY_M_S2, Floats, cross, rotation_from_vector
from studies.worlds.field.batch import Signal, approach, per_flight, per_rotor
from studies.worlds.field.cases import NOISE_STEP_S, Case, Flight
from studies.worlds.field.control import Estimate
from studies.worlds.field.plant import Plant

FILTER_S = 0.015
"""Time constant of the filters of incremental control."""


class Estimators:
    """State estimates of all flights, as the controllers and the loggers see them."""

    def __init__(self, cases: list[Case], flights: list[Flight], duration_s: float, step_s: float) -> None:
        """Start without errors but the noise."""
        count = len(cases)
        self._position_noise = Signal([flight.position_noise_m for flight in flights], NOISE_STEP_S, duration_s)
        self._velocity_noise = Signal([flight.velocity_noise_m_s for flight in flights], NOISE_STEP_S, duration_s)
        self._tilt_noise = Signal([flight.tilt_noise_rad for flight in flights], NOISE_STEP_S, duration_s)
        self._trim = rotation_from_vector(np.stack([flight.trim_rad for flight in flights]))
        self._lag_step = approach(step_s, per_flight(cases, lambda case: 0.5 * case.sensing.velocity_lag_s))
        self._gyro_step = approach(step_s, per_flight(cases, lambda case: case.sensing.gyro_lag_s))
        self._filter_step = float(1.0 - np.exp(-step_s / FILTER_S))
        self._tilt_step = approach(step_s, per_flight(cases, lambda case: case.sensing.tilt_time_s))
        self._tilt_gain = np.radians(per_flight(cases, lambda case: case.sensing.tilt_per_accel_deg))[:, None]
        self._coefficient = per_rotor(cases, lambda case: np.full(case.vehicle.rotors, case.beliefs.thrust_n_per_rpm2))
        self._hubs = per_rotor(cases, lambda case: case.vehicle.positions_m)
        self._torque = per_rotor(cases, lambda case: case.vehicle.yaw_signs * case.vehicle.torque_to_thrust_m)
        self._velocity, self._lagged_velocity = np.zeros((count, 3)), np.zeros((count, 3))
        self._gyro, self._slow_gyro = np.zeros((count, 3)), np.zeros((count, 3))
        self._moment, self._slow_moment = np.zeros((count, 3)), np.zeros((count, 3))
        self._accel = np.zeros((count, 3))
        self._thrust = per_flight(cases, lambda case: case.vehicle.mass_kg * GRAVITY_M_S2)
        self._tilt_error = np.zeros((count, 3))

    def update(self, plant: Plant, time_s: float) -> Estimate:
        """Estimate from the plant's present state."""
        self._velocity = self._velocity + self._lag_step * (plant.velocity_m_s - self._velocity)
        self._lagged_velocity = self._lagged_velocity + self._lag_step * (self._velocity - self._lagged_velocity)
        self._gyro = self._gyro + self._gyro_step * (plant.rates_rad_s - self._gyro)
        rate_change = (self._gyro - self._slow_gyro) / FILTER_S
        self._slow_gyro = self._slow_gyro + self._filter_step * (self._gyro - self._slow_gyro)
        # A filter levelled by the accelerometer takes a part of the tilt that accelerates the vehicle for level.
        accel = plant.accel_m_s2
        towards = self._tilt_gain * np.stack([-accel[:, 1], accel[:, 0], np.zeros(len(accel))], axis=1)
        self._tilt_error = self._tilt_error + self._tilt_step * (towards - self._tilt_error)
        error = self._tilt_error + self._tilt_noise.at(time_s)
        columns = plant.attitude.swapaxes(1, 2)
        leant = plant.attitude + cross(error[:, None, :], columns).swapaxes(1, 2)
        self._filter_rotors(plant.rpm)
        self._accel = self._accel + self._filter_step * (accel - self._accel)
        return Estimate(
            position_m=plant.position_m + self._position_noise.at(time_s),
            velocity_m_s=self._lagged_velocity + self._velocity_noise.at(time_s),
            accel_m_s2=self._accel,
            attitude=np.matmul(leant, self._trim),
            rates_rad_s=self._gyro,
            rate_change_rad_s2=rate_change,
            thrust_n=self._thrust,
            moment_n_m=self._slow_moment,
        )

    def _filter_rotors(self, rpm: Floats) -> None:
        """Filter thrust and moment of the rotors exactly as the accelerations that they are compared with."""
        thrust = self._coefficient * rpm * rpm
        self._thrust = self._thrust + self._filter_step * (thrust.sum(axis=1) - self._thrust)
        moment = np.stack(
            [
                -np.sum(self._hubs[:, :, 1] * thrust, axis=1),
                np.sum(self._hubs[:, :, 0] * thrust, axis=1),
                np.sum(self._torque * thrust, axis=1),
            ],
            axis=1,
        )
        self._moment = self._moment + self._gyro_step * (moment - self._moment)
        self._slow_moment = self._slow_moment + self._filter_step * (self._moment - self._slow_moment)
