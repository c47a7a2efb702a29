"""Simulated flights in closed loop for the estimation of rotation: many at once, with gusts and rotor noise.

The truth is away from all that an estimator starts from: unequal inertia and rotors, a bent thrust map, a steady wind
that is not along an axis, delays, and a controller that knows none of it.
"""

from dataclasses import dataclass

import numpy as np

from quadctl.frames import GRAVITY_M_S2, rotate, rotate_inverse
from quadctl.lab.arrays import Floats
from quadctl.lab.rotation.records import Record
from quadctl.vehicle import Rotor, RotorPlace, ThrottleCurve, Vehicle

ARM_M, REACTION_M = 0.15, 0.014
VEHICLE = Vehicle(
    name="truth",
    mass_kg=0.9,
    rotor=Rotor(radius_m=0.07, thrust_n_per_rpm2=3e-8, torque_to_thrust_m=REACTION_M),
    rotors=(
        RotorPlace(position_m=(ARM_M, ARM_M, 0.0), spin="ccw"),
        RotorPlace(position_m=(-ARM_M, ARM_M, 0.0), spin="cw"),
        RotorPlace(position_m=(-ARM_M, -ARM_M, 0.0), spin="ccw"),
        RotorPlace(position_m=(ARM_M, -ARM_M, 0.0), spin="cw"),
    ),
    throttle=ThrottleCurve(per_newton=0.055, offset=0.0, max_thrust_per_rotor_n=4.6),
)
STEP_S, CONTROL_EVERY, LOG_EVERY = 0.002, 1, 2
GYRO_RAD_S = 0.004
"""Noise of the gyro at 500 Hz: 0.014 deg/s per square root of a hertz, as the data sheet of the Bosch BMI088 says."""
LOW_PASS = 1.0 - np.exp(-2.0 * np.pi * 30.0 * STEP_S * CONTROL_EVERY)
"""Filter of the gyro before the controller, 30 Hz, as autopilots have one; without it a log's commands are aliased."""


@dataclass(frozen=True)
class Truth:
    """Parameters that the simulated flights hide."""

    inertia: tuple[float, float, float] = (6.2e-3, 7.4e-3, 1.2e-2)
    delay_s: float = 0.02
    lag_s: float = 0.045
    lead_s: float = 0.07
    """Lead of the drag torque by the rotors' inertia."""
    damping_1_s: float = 2.6
    drag_1_s: tuple[float, float] = (0.33, 0.46)
    airspeed: float = 3.5
    """Angular acceleration about pitch per airspeed forward, and about roll per airspeed left, rad/s^2 per m/s."""
    bend: float = 0.55
    """Share of the square in the thrust map T = T_full ((1 - bend) u + bend u^2)."""
    full_n: float = 4.6
    rotor_share: tuple[float, float, float, float] = (1.03, 0.98, 1.01, 0.97)
    wind_m_s: tuple[float, float, float] = (1.6, -0.9, 0.2)

    def gain(self, axis: int) -> float:
        """Angular acceleration per weight of thrust difference, rad/s^2."""
        return VEHICLE.weight_n * ARM_M / self.inertia[axis]


def flights(truth: Truth, seeds: int, seconds: float, first: int = 0, *, log_every: int = LOG_EVERY) -> list[Record]:
    """One flight for each seed, with every so many steps in the log."""
    random = [np.random.default_rng(first + s) for s in range(seeds)]
    n = round(seconds / STEP_S)
    # Drawn for each flight apart, so that a flight does not depend on how many are flown.
    drawn = np.stack([r.standard_normal((n, 19)) for r in random], axis=2)
    phase = np.array([r.uniform(0.0, 2.0 * np.pi, 3) for r in random]).T
    return _flown(truth, drawn, phase, log_every)


def _flown(truth: Truth, drawn: Floats, phase: Floats, log_every: int) -> list[Record]:  # noqa: PLR0915
    n, _, seeds = drawn.shape
    share, inertia = np.array(truth.rotor_share)[:, None], np.array(truth.inertia)[:, None]
    arms = np.array(VEHICLE.moment_arms_m).T
    mix, about_yaw = np.sign(arms).T, np.diag([0.0, 0.0, 1.0]) @ arms
    position, velocity, rates = np.zeros((3, seeds)), np.zeros((3, seeds)), np.zeros((3, seeds))
    q = np.vstack([np.ones(seeds), np.zeros((3, seeds))])
    hover = 0.6
    thrust = np.full((4, seeds), VEHICLE.weight_n / 4.0)
    waiting = [np.full((4, seeds), hover)] * (round(truth.delay_s / STEP_S) + 1)
    integral, place_integral, gust, moment = (np.zeros((3, seeds)) for _ in range(4))
    command, measured = waiting[0], np.zeros((3, seeds))
    wind = np.array(truth.wind_m_s)[:, None]
    logged: list[tuple[Floats, ...]] = []
    for k in range(n):
        white = drawn[k]
        t = k * STEP_S
        gust += STEP_S * -gust / 1.3 + 0.7 * np.sqrt(2.0 * STEP_S / 1.3) * white[:3]
        moment += STEP_S * -moment / 0.8 + 1.5 * np.sqrt(2.0 * STEP_S / 0.8) * white[3:6]
        body = np.array(rotate_inverse(tuple(q), tuple(velocity)))
        air = body - np.array(rotate_inverse(tuple(q), tuple(wind + gust)))
        if k % CONTROL_EVERY == 0:
            measured += LOW_PASS * (rates + GYRO_RAD_S * white[6:9] - measured)
            wanted, slope = _reference(t, phase)
            error = wanted - position
            place_integral += STEP_S * CONTROL_EVERY * error
            asked = 2.5 * error + 2.2 * (slope - velocity) + 0.4 * place_integral
            level = np.array(rotate_inverse(tuple(q), tuple(asked - np.array([[0.0], [0.0], [GRAVITY_M_S2]]))))
            tilt = np.array([level[1], -level[0], np.zeros(seeds)]) / GRAVITY_M_S2
            heading = np.arctan2(2.0 * (q[0] * q[3] + q[1] * q[2]), 1.0 - 2.0 * (q[2] ** 2 + q[3] ** 2))
            tilt[2] = 0.25 * np.sin(1.3 * t + phase[0]) + 0.12 * np.sin(4.0 * t + phase[1]) - heading
            turn = np.array([[7.0], [7.0], [3.0]]) * tilt - measured
            integral += STEP_S * CONTROL_EVERY * turn
            moments = np.array([[0.025], [0.03], [0.1]]) * (turn + 1.5 * integral)
            command = np.clip(hover * (-level[2] / GRAVITY_M_S2) ** 0.7 + mix @ moments, 0.05, 1.0)
        waiting = [*waiting[1:], command]
        u = waiting[0] * (1.0 + 0.04 * white[9:13])
        steady = share * truth.full_n * ((1.0 - truth.bend) * u + truth.bend * u**2)
        change = (1.0 - np.exp(-STEP_S / truth.lag_s)) * (steady - thrust)
        thrust = thrust + change
        force = np.array([-truth.drag_1_s[0] * air[0], -truth.drag_1_s[1] * air[1], -thrust.sum(0) / 0.9])
        if k % log_every == 0:
            seen = rates + GYRO_RAD_S * white[6:9]
            noise = np.array([[0.08], [0.08], [0.2]]) * white[13:16]
            logged.append((seen, waiting[-1], force + noise + 0.05, body + 0.005 * white[16:19]))
        reaction = about_yaw @ change * truth.lead_s / STEP_S
        torque = (arms @ thrust + reaction) / inertia + np.array(
            [-truth.airspeed * air[1], truth.airspeed * air[0], 0.0 * air[0]]
        )
        angular = torque + moment - truth.damping_1_s * rates
        (roll, pitch, yaw), (ix, iy, iz) = rates, inertia
        angular -= np.array([(iz - iy) * pitch * yaw, (ix - iz) * yaw * roll, (iy - ix) * roll * pitch]) / inertia
        world = np.array(rotate(tuple(q), tuple(force)))
        position, velocity = position + STEP_S * velocity, velocity + STEP_S * (world + _DOWN)
        q = q + 0.5 * STEP_S * _turned(q, rates)
        q /= np.linalg.norm(q, axis=0)
        rates = rates + STEP_S * angular
    start = round(3.0 / (STEP_S * log_every))
    columns = [np.array(c)[start:] for c in zip(*logged, strict=True)]
    made = []
    for s in range(seeds):
        seen, drive, force, airspeed = (c[:, :, s] for c in columns)
        made.append(Record(f"flight {s}", STEP_S * log_every, seen, drive, None, force, False, airspeed))
    return made


_DOWN = np.array([[0.0], [0.0], [GRAVITY_M_S2]])


def _reference(t: float, phase: Floats) -> tuple[Floats, Floats]:
    """Position, m, and velocity, m/s, of a path that turns back and forth at several frequencies, shape (3, seeds)."""
    size, pace = np.array([[2.2], [1.8], [0.7]]), np.array([[0.7], [0.9], [0.6]])
    quick, more = np.array([[0.25], [0.3], [0.2]]), np.array([[2.1], [2.6], [1.9]])
    slow, fast = pace * t + phase, more * t + 2.0 * phase
    place = size * np.sin(slow) + quick * np.sin(fast)
    return place, size * pace * np.cos(slow) + quick * more * np.cos(fast)


def _turned(q: Floats, rates: Floats) -> Floats:
    w, x, y, z = q
    p, r, s = rates
    return np.array([-x * p - y * r - z * s, w * p + y * s - z * r, w * r - x * s + z * p, w * s + x * r - y * p])
