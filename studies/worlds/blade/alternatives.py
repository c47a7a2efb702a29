"""Families that the flights of a case cannot separate, by least squares on the true motion.

The true acceleration of the hidden effects is fitted by simple terms of the hidden families, and by those with one
family exchanged for another. Where the exchange leaves nearly as little, the two are alike in these flights. Families
that a moment gives away (rotor_fault, ground_torque, rotor_interaction) are alike to none.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from studies.worlds.blade.flight import COMMANDED, MEASURED, THROTTLE, TICK, Flight, Recording
from studies.worlds.blade.rotation import Array, matrix, rotate_back
from studies.worlds.blade.vehicles import GRAVITY

EVERY = 20
"""Ticks from sample to sample."""
FAINT = 0.03
"""Acceleration that noisy logs do not show for sure, m/s^2."""
SHARE = 0.12
"""Share of the effect that may be left over where two families are called alike."""


@dataclass(frozen=True)
class Motion:
    """True motion of all flights of a case, in samples one after another."""

    flight: Array
    time: Array
    effect: Array
    thrust: Array
    """Thrust of the vehicle file over mass, along the third body axis (upwards), in world axes."""
    thrust_rate: Array
    rotation: Array
    velocity: Array
    height: Array
    """Height of the hubs over the radius."""
    below: Array
    """Distance from the ceiling over the radius."""
    altitude: Array
    speed: Array
    """Mean rotor speed over that in hover."""
    voltage: Array
    source: str


def motion(flights: tuple[Flight, ...], recordings: list[Recording]) -> Motion:
    """True motion of the flights of a case."""
    parts: list[dict[str, Array]] = []
    for i, (flight, recording) in enumerate(zip(flights, recordings, strict=True)):
        tape = {name: values[::EVERY].astype(float) for name, values in recording.columns.items()}
        v, count = flight.vehicle, flight.vehicle.count
        rotors = (tape["speed"] if flight.source == MEASURED else tape["command"])[:, :count]
        size = v.k * (rotors**2).sum(-1) / v.mass
        rotation = matrix(tape["true_attitude"])
        hub = v.rotor_height - tape["true_position"][:, 2]
        parts.append(
            {
                "flight": np.full(len(hub), float(i)),
                "time": np.arange(len(hub)) * EVERY * TICK,
                "effect": tape["effect"],
                "thrust": -rotation[:, :, 2] * size[:, None],
                "thrust_rate": -rotation[:, :, 2] * np.gradient(size, EVERY * TICK)[:, None],
                "rotation": rotation,
                "velocity": tape["true_velocity"],
                "height": hub / v.radius,
                "below": ((v.ceiling or 1e6) - hub) / v.radius,
                "altitude": -tape["true_position"][:, 2],
                "speed": rotors.mean(-1) / v.hover_speed,
                "voltage": tape["voltage"][:, 0] / tape["voltage"].max(),
            }
        )
    joined = {name: np.concatenate([p[name] for p in parts]) for name in parts[0]}
    return Motion(**joined, source=flights[0].source)


def _drags(m: Motion, factor: Array) -> list[Array]:
    body = rotate_back(m.rotation, m.velocity) * factor[:, None]
    return [m.rotation[:, :, i] * body[:, i : i + 1] for i in range(3)]


def _constants(m: Motion) -> list[Array]:
    return [np.tile(axis, (len(m.time), 1)) for axis in np.eye(3)[:2]]


def _steps(m: Motion) -> list[Array]:
    """Thrust from the moment on that suits a step of the effect best, in each flight."""
    out = []
    for flight in np.unique(m.flight):
        here = m.flight == flight
        along = (m.effect * m.thrust).sum(-1)[here] / GRAVITY
        count = len(along)
        tried = range(count // 10, count - count // 10, max(count // 60, 1))
        spread = [along[:i].var() * i + along[i:].var() * (count - i) for i in tried]
        moment = m.time[here][list(tried)[int(np.argmin(spread))]]
        out.append(m.thrust * (here & (m.time >= moment))[:, None])
    return out


TERMS: dict[str, Callable[[Motion], list[Array]]] = {
    "thrust_scale": lambda m: [m.thrust],
    "payload": _steps,
    "ground_effect": lambda m: [m.thrust * np.exp(-r * m.height)[:, None] for r in (0.7, 1.5, 3.0)],
    "ceiling_effect": lambda m: [m.thrust * np.exp(-r * m.below)[:, None] for r in (0.7, 1.5, 3.0)],
    "rotor_drag": lambda m: _drags(m, np.ones(len(m.time))),
    "body_drag": lambda m: _drags(m, np.sqrt((m.velocity**2).sum(-1))),
    "inflow": lambda m: [m.thrust * rotate_back(m.rotation, m.velocity)[:, 2:]],
    "translational_lift": lambda m: [
        m.thrust * np.hypot(*rotate_back(m.rotation, m.velocity)[:, :2].T)[:, None] ** power for power in (1, 2)
    ],
    "wind": _constants,
    "thrust_tilt": lambda m: [
        m.rotation[:, :, i] * np.sqrt((m.thrust**2).sum(-1, keepdims=True)) for i in range(2)
    ],
    "tether": lambda m: [np.array([0.0, 0.0, 1.0]) * m.altitude[:, None]],
    "thrust_curve": lambda m: [m.thrust * np.log(m.speed)[:, None]],
    "battery_sag": lambda m: [m.thrust * (1.0 - m.voltage)[:, None]],
    "motor_lag": lambda m: [m.thrust_rate],
    "thrust_map": lambda m: [m.thrust, m.thrust / np.sqrt((m.thrust**2).sum(-1, keepdims=True))],
}
BY_MOMENT = {"rotor_fault", "ground_torque", "rotor_interaction", "imu_bias"}


def possible(family: str, m: Motion) -> bool:
    """True where the family can be thought of in such flights."""
    if family == "motor_lag":
        return m.source in (COMMANDED, THROTTLE)
    if family == "thrust_map":
        return m.source == THROTTLE
    if family == "battery_sag":
        return m.source != MEASURED
    if family == "thrust_curve":
        return m.source != THROTTLE
    return not (family == "ceiling_effect" and m.below.min() > 1e3)


def left_over(m: Motion, families: list[str]) -> float:
    """Root mean square of what terms of these families leave of the effect, m/s^2."""
    columns = [term.ravel() for family in families if family in TERMS for term in TERMS[family](m)]
    if "wind" in families:
        columns += [term.ravel() for term in TERMS["rotor_drag"](m) + TERMS["body_drag"](m)]
    effect = m.effect.ravel()
    if not columns:
        return float(np.sqrt((effect**2).sum() / len(m.time)))
    matrix_ = np.column_stack(columns)
    size = np.sqrt((matrix_**2).mean(0))
    keep = size > 1e-9
    fit = np.linalg.lstsq(matrix_[:, keep] / size[keep], effect, rcond=None)[0]
    rest = effect - matrix_[:, keep] / size[keep] @ fit
    return float(np.sqrt((rest**2).sum() / len(m.time)))


def alike(m: Motion, families: tuple[str, ...]) -> list[list[str]]:
    """Pairs of a hidden family and another one that these flights do not separate."""
    size = float(np.sqrt((m.effect**2).sum(-1).mean()))
    hidden = list(families)
    least = left_over(m, hidden)
    pairs = []
    for family in set(hidden) - BY_MOMENT:
        for other in TERMS:
            # With a wind comes the drag that makes it felt: exchanging a drag for both says nothing.
            if other in hidden or not possible(other, m) or (other == "wind" and family in ("rotor_drag", "body_drag")):
                continue
            exchanged = [f for f in hidden if f != family] + [other]
            more = np.sqrt(max(left_over(m, exchanged) ** 2 - least**2, 0.0))
            if more < max(FAINT, SHARE * size):
                pairs.append(sorted([family, other]))
    return sorted(pairs)


def visible(m: Motion, families: tuple[str, ...]) -> dict[str, float]:
    """Acceleration that each family explains and the others do not, m/s^2."""
    whole = left_over(m, list(families))
    out = {}
    for family in families:
        if family in TERMS:
            others = [f for f in families if f != family]
            out[family] = round(float(np.sqrt(max(left_over(m, others) ** 2 - whole**2, 0.0))), 4)
    return out
