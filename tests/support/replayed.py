"""A simulated flight whose truth is known, and replays of flights in the equations of an export."""

from dataclasses import dataclass, replace

import numpy as np

from quadctl.effects.airspeed_moment import IsotropicMoment
from quadctl.effects.centre_of_mass import FixedOffset
from quadctl.effects.rate_damping import ProportionalDamping
from quadctl.effects.rotor_drag import LinearDrag
from quadctl.effects.rotor_reaction import InertialReaction
from quadctl.effects.thrust_map import LineMap
from quadctl.frames import GRAVITY_M_S2, euler_from_quaternion, multiply, rotate, rotate_inverse
from quadctl.lab.arrays import Floats
from quadctl.lab.rotation.rollout import Track, errors, held
from quadctl.model import Model, conditions
from tests.lab.rotation.closed_loop import VEHICLE

STEP_S, FINE = 0.01, 5
FORCE, FORCE_S, MOMENT, MOMENT_S = 0.35, 5.0, 2.5, 15.0
"""Slow force, m/s^2, and moment, rad/s^2, and the times in which they fade."""
STEPS = (10, 50)
"""Horizons of a replay: 0.1 and 0.5 s."""


def disturbed_model() -> Model:
    """A vehicle none of whose numbers is neutral, and effects on thrust, force and moment."""
    rotor = VEHICLE.rotor.model_copy(update={"time_constant_s": 0.045, "delay_s": 0.013})
    vehicle = VEHICLE.model_copy(update={"rotor": rotor, "inertia_kg_m2": (6.2e-3, 7.4e-3, 1.2e-2)})
    effects = (
        LineMap(1.13, -0.08),
        LinearDrag(0.33, 0.46, 0.2),
        IsotropicMoment(2.4),
        ProportionalDamping(2.6, 2.1, 0.9),
        InertialReaction(0.06),
        FixedOffset(1.1, -0.7),
    )
    model = Model(vehicle, name="disturbed")
    for effect in effects:
        model = model.plus(effect)
    return model


@dataclass(frozen=True, eq=False)
class Flight:
    """A flight, and what is slow in it: NED, m/s^2, and FRD, rad/s^2, each of shape (n, 3)."""

    track: Track
    force: Floats
    moment: Floats


def flown(model: Model, seed: int, seconds: float = 14.0, *, steady: bool = False) -> Flight:
    """A flight of a model to and fro under a controller of attitude and velocity; without disturbances, `steady`."""
    random, vehicle = np.random.default_rng(seed), model.vehicle
    n, h, line = round(seconds / STEP_S), STEP_S / FINE, vehicle.throttle
    inertia, arms = np.array(vehicle.principal_inertia_kg_m2), np.array(vehicle.moment_arms_m)
    mix = arms / np.sum(arms**2, axis=0)
    p, v, w, q = np.array([0.0, 0.0, -3.0]), np.zeros(3), np.zeros(3), np.array([0.98, 0.02, -0.03, 0.19])
    q /= np.linalg.norm(q)
    thrust = np.full(4, 0.9 * vehicle.weight_n / 4.0)
    force, moment = np.zeros(3), np.zeros(3)
    waiting = [np.full(4, line.offset + line.per_newton * vehicle.weight_n)] * (round(vehicle.rotor.delay_s / h) + 1)
    rows: list[tuple[Floats, ...]] = []
    size = 0.0 if steady else 1.0
    for k in range(n * FINE):
        t = k * h
        if k % FINE == 0:
            wanted = np.array([2.0 * np.sin(0.9 * t + seed), 1.6 * np.sin(1.3 * t), 0.5 * np.sin(0.8 * t)])
            wanted += np.array([0.5 * np.sin(3.1 * t), 0.6 * np.sin(2.6 * t + seed), 0.2 * np.sin(2.9 * t)])
            push = 2.0 * (wanted - v) + 0.3 * (np.array([0.0, 0.0, -3.0]) - p)
            roll, pitch, yaw = euler_from_quaternion(tuple(q))
            ahead, right = push[0] * np.cos(yaw) + push[1] * np.sin(yaw), push[1] * np.cos(yaw) - push[0] * np.sin(yaw)
            level = np.array([right / GRAVITY_M_S2 - roll, -ahead / GRAVITY_M_S2 - pitch, 0.4 * np.sin(0.7 * t) - yaw])
            turn = inertia * (np.array([60.0, 60.0, 8.0]) * level - np.array([12.0, 12.0, 4.0]) * w)
            asked = vehicle.mass_kg * (GRAVITY_M_S2 - push[2]) / 4.0 + mix @ turn
            command = np.clip(line.offset + 4.0 * line.per_newton * asked, 0.05, 1.0)
            noise = random.standard_normal(6)
            rows.append((p, v + 2e-3 * noise[:3], q, w + 2e-3 * noise[3:], command, force, moment))
        waiting = [*waiting[1:], command]
        nominal = np.maximum(waiting[0] - line.offset, 0.0) / (4.0 * line.per_newton)
        change = (1.0 - np.exp(-h / vehicle.rotor.time_constant_s)) * (nominal - thrust)
        white = size * random.standard_normal(6)
        force = force - h * force / FORCE_S + FORCE * np.sqrt(2.0 * h / FORCE_S) * white[:3]
        moment = moment - h * moment / MOMENT_S + MOMENT * np.sqrt(2.0 * h / MOMENT_S) * white[3:]
        turned = (q[0], q[1], q[2], q[3])
        c = conditions(vehicle, -p[2], rotate_inverse(turned, tuple(v)), turned, rates_rad_s=tuple(w))
        loads = model.loads(list(thrust + 0.5 * change), replace(c, thrust_rate_n_s=tuple(change / h)))
        thrust = thrust + change
        pushed = np.array(rotate(turned, loads.force_n)) / vehicle.mass_kg + np.array([0.0, 0.0, GRAVITY_M_S2])
        turning = (np.array(loads.torque_n_m) - np.cross(w, inertia * w)) / inertia
        p, v = p + h * v, v + h * (pushed + force)
        q = q + 0.5 * h * np.array(multiply(turned, (0.0, *w)))
        q, w = q / np.linalg.norm(q), w + h * (turning + moment)
    columns = [np.array(column) for column in zip(*rows, strict=True)]
    return Flight(Track(f"made {seed}", STEP_S, *columns[:5]), *columns[5:])


def states(track: Track) -> Floats:
    """States as exported equations take them, shape (13, n)."""
    return np.concatenate([track.position.T, track.velocity.T, track.attitude.T, track.rates.T])


def of_held(track: Track, rows: Floats) -> Floats:
    """Mean errors after `STEPS` of a state that is held, shape (2, 4)."""
    return np.array([errors(held(track, rows, k), track, rows + k).mean(axis=0) for k in STEPS])
