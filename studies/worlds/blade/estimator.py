"""Error-state Kalman filter of many flights at once, after Sola 2017, Quaternion kinematics for the error-state Kalman
filter: attitude error (body axes), velocity, position, biases of gyro and accelerometer."""

import numpy as np

from studies.worlds.blade.rotation import Array, from_vector, matrix, multiply, rotate, skew
from studies.worlds.blade.vehicles import GRAVITY

ANGLE, VELOCITY, POSITION, GYRO, ACCELEROMETER = (slice(i, i + 3) for i in range(0, 15, 3))
HISTORY = 64
"""Ticks of states that are kept, for measurements that come late."""


class Memory:
    """Ring of past attitudes, velocities and positions of flights."""

    def __init__(self, flights: int) -> None:
        """Memory that is empty."""
        self._ring = np.zeros((HISTORY, flights, 10))
        self._count = 0

    def push(self, attitude: Array, velocity: Array, position: Array) -> None:
        """State of this tick."""
        row = self._ring[self._count % HISTORY]
        row[:, :4], row[:, 4:7], row[:, 7:] = attitude, velocity, position
        self._count += 1

    def past(self, lanes: Array, ticks: Array) -> tuple[Array, Array, Array]:
        """Attitude, velocity and position of some flights, `ticks` before now."""
        back = np.minimum(ticks, min(self._count, HISTORY) - 1)
        rows = self._ring[(self._count - 1 - back) % HISTORY, lanes]
        return rows[:, :4], rows[:, 4:7], rows[:, 7:]


class Filter:
    """Estimates of flights: attitude, velocity, position (NED) and the biases of the IMU."""

    def __init__(self, attitude: Array, velocity: Array, position: Array, noise: Array) -> None:
        """Filter at a first estimate; noise is that of gyro (rad/s), accelerometer (m/s^2) and their biases' walks, as
        rows of four per flight, per square root of a second."""
        flights = len(attitude)
        self.attitude, self.velocity, self.position = attitude.copy(), velocity.copy(), position.copy()
        self.gyro_bias, self.accelerometer_bias = np.zeros((flights, 3)), np.zeros((flights, 3))
        self._noise = np.repeat(noise[:, [0, 1, 1, 2, 3]], 3, axis=1) ** 2
        self._noise[:, POSITION] = 0.0
        first = np.repeat([0.01, 0.1, 0.1, 0.003, 0.08], 3) ** 2
        self._covariance = np.tile(np.diag(first), (flights, 1, 1))
        self._held = np.tile(np.eye(15), (flights, 1, 1))
        self.memory = Memory(flights)
        self._angle_sum, self._accel_sum, self._sums = np.zeros((flights, 3)), np.zeros((flights, 3)), 0

    def predict(self, gyro: Array, accelerometer: Array, step: float) -> Array:
        """Rotation matrices after one step with this IMU sample."""
        rate = gyro - self.gyro_bias
        force = accelerometer - self.accelerometer_bias
        middle = matrix(multiply(self.attitude, from_vector(0.5 * step * rate)))
        acceleration = rotate(middle, force)
        acceleration[:, 2] += GRAVITY
        self.position = self.position + self.velocity * step + 0.5 * step * step * acceleration
        self.velocity = self.velocity + acceleration * step
        self.attitude = multiply(self.attitude, from_vector(step * rate))
        self._angle_sum, self._accel_sum, self._sums = self._angle_sum + rate, self._accel_sum + force, self._sums + 1
        self.memory.push(self.attitude, self.velocity, self.position)
        return middle

    def spread(self, rotation: Array, step: float) -> None:
        """Covariance over the steps since the last call, `step` seconds in all (Sola eq. 269-270, first order)."""
        rate, force = self._angle_sum / self._sums, self._accel_sum / self._sums
        f = self._held
        eye = np.eye(3)
        f[:, ANGLE, ANGLE] = eye - skew(rate * step)
        f[:, ANGLE, GYRO] = -eye * step
        f[:, VELOCITY, ANGLE] = -step * rotation @ skew(force)
        f[:, VELOCITY, ACCELEROMETER] = -step * rotation
        f[:, POSITION, VELOCITY] = eye * step
        self._covariance = f @ self._covariance @ np.swapaxes(f, -1, -2)
        diagonal = np.arange(15)
        self._covariance[:, diagonal, diagonal] += self._noise * step
        self._angle_sum, self._accel_sum, self._sums = 0.0 * rate, 0.0 * rate, 0

    def correct(self, lanes: Array, slope: Array, residual: Array, sigma: Array) -> None:
        """Update of some flights by measurements: residual and sigma (n, m), slope by the error state (n, m, 15)."""
        covariance = self._covariance[lanes]
        turned = slope @ covariance
        innovation = turned @ np.swapaxes(slope, -1, -2)
        m = residual.shape[1]
        innovation[:, np.arange(m), np.arange(m)] += sigma**2
        size = np.sqrt(innovation[:, np.arange(m), np.arange(m)])
        bounded = np.clip(residual, -5.0 * size, 5.0 * size)  # gate
        gain = np.swapaxes(np.linalg.solve(innovation, turned), -1, -2)
        error = (gain @ bounded[..., None])[..., 0]
        covariance = covariance - gain @ turned
        self._covariance[lanes] = 0.5 * (covariance + np.swapaxes(covariance, -1, -2))
        self.attitude[lanes] = multiply(self.attitude[lanes], from_vector(error[:, ANGLE]))
        self.velocity[lanes] += error[:, VELOCITY]
        self.position[lanes] += error[:, POSITION]
        self.gyro_bias[lanes] += error[:, GYRO]
        self.accelerometer_bias[lanes] += error[:, ACCELEROMETER]
