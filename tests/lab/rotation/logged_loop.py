"""A simulated rate loop, logged as autopilots do: a fast gyro, setpoints at a fifth of its rate, slow outputs.

The truth is away from all that an estimator starts from: unequal gains, a lag of 80 ms, damping, unequal rotors, a
mixer of its own, a gyro so noisy that the commands hardly agree from one logged sample to the next.
"""

from dataclasses import dataclass

import numpy as np

from quadctl.lab.arrays import Floats
from quadctl.logs.columns import TORQUE, motor_columns
from quadctl.logs.flight_log import IMU, RATES, FlightLog
from quadctl.vehicle import Rotor, RotorPlace, ThrottleCurve, Vehicle

STEP_S, SETPOINT_EVERY, OUTPUT_EVERY = 0.004, 5, 25
PLACES = ((0.17, 0.22, "ccw"), (-0.17, -0.22, "ccw"), (0.17, -0.22, "cw"), (-0.17, 0.22, "cw"))
VEHICLE = Vehicle(
    name="logged",
    mass_kg=1.4,
    rotor=Rotor(radius_m=0.12, thrust_n_per_rpm2=5e-8, torque_to_thrust_m=0.018),
    rotors=tuple(RotorPlace(position_m=(x, y, 0.0), spin=spin) for x, y, spin in PLACES),
    throttle=ThrottleCurve(per_newton=0.04, offset=0.0, max_thrust_per_rotor_n=6.2),
)
GYRO_RAD_S = 0.06


@dataclass(frozen=True)
class Truth:
    """Parameters that the log hides."""

    slope: tuple[float, float, float] = (95.0, 61.0, 9.0)
    """Angular acceleration per relative difference of the outputs, rad/s^2."""
    lag_s: float = 0.08
    damping_1_s: float = 2.3
    hover: float = 0.57
    """Output of level hover."""
    trim: tuple[float, float, float] = (0.006, -0.004, 0.01)
    """Torque setpoint that unequal rotors need."""


def mixer() -> Floats:
    """Outputs of the rotors by setpoints of torque and thrust, shape (4, 4): the signs of the arms, with gains."""
    signs = np.sign(np.array(VEHICLE.moment_arms_m)).T
    return np.vstack([signs * np.array([[0.8], [0.65], [1.1]]), np.ones(4)])


def flight(truth: Truth, seed: int, seconds: float = 70.0, pushed: tuple[float, ...] = ()) -> FlightLog:
    """The log of a flight; at the times `pushed` a thrust is asked for that saturates the outputs for half a second."""
    n, random = round(seconds / STEP_S), np.random.default_rng(seed)
    time_s, mix = STEP_S * np.arange(n), mixer()
    phase = random.uniform(0.0, 2.0 * np.pi, 3)
    wanted = 0.25 * np.sin(np.outer(time_s, [1.7, 2.3, 0.9]) + phase)
    wanted += 0.12 * np.sign(np.sin(np.outer(time_s, [2.9, 3.7, 1.9]) + 2.0 * phase))
    thrust = truth.hover + 0.04 * np.sin(1.1 * time_s) + 0.03 * np.sign(np.sin(2.9 * time_s))
    for at_s in pushed:
        thrust[(time_s >= at_s) & (time_s < at_s + 0.5)] = 1.4
    noise, slow = GYRO_RAD_S * random.standard_normal((n, 3)), 0.4 * random.standard_normal((n, 3))
    arms = np.array(VEHICLE.moment_arms_m)
    weights = (arms / np.abs(arms).mean(axis=0)).T / len(arms)
    rates, gust, turn, asked, integral = (np.zeros(3) for _ in range(5))
    force = np.zeros(3)
    lift = truth.hover
    rows = {name: np.empty((n, 3)) for name in ("gyro", "torque")}
    outputs, measured = np.empty((n, 4)), np.empty(n)
    decay, follow = np.exp(-truth.damping_1_s * STEP_S), 1.0 - np.exp(-STEP_S / truth.lag_s)
    filtered = np.zeros(3)
    for k in range(n):
        gyro = rates + noise[k]
        before, filtered = filtered, filtered + 0.6 * (gyro - filtered)
        asked = 4.0 * (wanted[k] - turn) - filtered
        integral = integral + STEP_S * asked
        torque = 0.035 * asked + 0.05 * integral - 0.0006 * (filtered - before) / STEP_S
        output = np.clip(torque @ mix[:3] + thrust[k], 0.0, 1.0)
        rows["gyro"][k], rows["torque"][k], outputs[k] = gyro, torque, output
        measured[k] = -9.80665 * lift / truth.hover + 0.3 * noise[k, 0] / GYRO_RAD_S
        steady = weights @ (output / truth.hover)
        force = force + follow * (steady - force)
        lift = lift + follow * (output.mean() - lift)
        gust = gust + STEP_S * -gust / 1.5 + np.sqrt(2.0 * STEP_S / 1.5) * slow[k]
        angular = np.array(truth.slope) * (force - np.array(truth.trim)) + gust
        rates = decay * rates + (1.0 - decay) / truth.damping_1_s * angular
        turn = turn + STEP_S * rates
    columns = {"time_s": time_s, IMU[2]: measured}
    columns |= dict.fromkeys(IMU[:2], random.standard_normal(n))
    columns |= dict(zip(RATES, rows["gyro"].T, strict=True))
    columns |= dict(zip(TORQUE, _held(rows["torque"], SETPOINT_EVERY).T, strict=True))
    columns["throttle_cmd"] = _held(thrust[:, None], SETPOINT_EVERY)[:, 0]
    columns |= dict(zip(motor_columns(4, "output"), _held(outputs, OUTPUT_EVERY).T, strict=True))
    return FlightLog("loop.ulg", None, columns, meta={"autopilot": "simulated"})


def _held(values: Floats, every: int) -> Floats:
    """Every n-th of the values, held until the next."""
    return np.asarray(values[np.arange(len(values)) // every * every])
