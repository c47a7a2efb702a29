"""Families that the flights of a case cannot separate, by least squares on the true motion.

The true acceleration of the hidden effects is fitted by simple terms of the hidden families, and by those with one
family exchanged for another, each with the signs and bounds that physics allows. Where the exchange leaves nearly as
little, the two are alike in these flights. Families that a moment gives away (rotor_fault, ground_torque,
rotor_interaction) are alike to none. A wind is felt by a drag: whether that drag is named beside it is no matter of
physics.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import lsq_linear

from studies.worlds.blade.flight import COMMANDED, MEASURED, THROTTLE, TICK, Flight, Recording
from studies.worlds.blade.power import CELL_VOLTS
from studies.worlds.blade.rotation import Array, matrix, rotate_back
from studies.worlds.blade.vehicles import GRAVITY

EVERY = 20
"""Ticks from sample to sample."""
FAINT = 0.03
"""Acceleration that noisy logs do not show for sure, m/s^2."""
SHARE = 0.12
"""Share of the effect that may be left over where two families are called alike; the forms of one differ by more."""
TAKEN = 0.2
"""Share of a family's effect that must be left where the other hidden families have taken what they can."""


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
    """Battery voltage over that of a full battery in hover."""
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
                "voltage": tape["voltage"][:, 0] / (flight.pack.cells * CELL_VOLTS[-1] * (1.0 - flight.pack.sag)),
            }
        )
    joined = {name: np.concatenate([p[name] for p in parts]) for name in parts[0]}
    return Motion(**joined, source=flights[0].source)


Terms = list[Array]


def _drags(m: Motion, factor: Array) -> Terms:
    body = rotate_back(m.rotation, m.velocity) * factor[:, None]
    return [-m.rotation[:, :, i] * body[:, i : i + 1] for i in range(3)]


def _constants(m: Motion) -> Terms:
    return [np.tile(axis, (len(m.time), 1)) for axis in np.eye(3)[:2]]


def _steps(m: Motion) -> Terms:
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


def _size(m: Motion) -> Array:
    size: Array = np.sqrt((m.thrust**2).sum(-1, keepdims=True))
    return size


def _edgewise(m: Motion) -> Terms:
    edge = np.hypot(*rotate_back(m.rotation, m.velocity)[:, :2].T)[:, None]
    return [m.thrust * edge, m.thrust * edge**2]


ANY, MORE = (-np.inf, np.inf), (0.0, np.inf)
TERMS: dict[str, tuple[Callable[[Motion], Terms], tuple[float, float]]] = {
    "thrust_scale": (lambda m: [m.thrust], ANY),
    "payload": (_steps, ANY),
    "ground_effect": (lambda m: [m.thrust * np.exp(-r * m.height)[:, None] for r in (0.7, 1.5, 3.0)], MORE),
    "ceiling_effect": (lambda m: [m.thrust * np.exp(-r * m.below)[:, None] for r in (0.7, 1.5, 3.0)], MORE),
    "rotor_drag": (lambda m: _drags(m, np.ones(len(m.time))), MORE),
    "body_drag": (lambda m: _drags(m, np.sqrt((m.velocity**2).sum(-1))), MORE),
    "inflow": (lambda m: [m.thrust * rotate_back(m.rotation, m.velocity)[:, 2:]], MORE),
    "translational_lift": (_edgewise, MORE),
    "wind": (_constants, ANY),
    "thrust_tilt": (lambda m: [m.rotation[:, :, i] * _size(m) for i in range(2)], ANY),
    "tether": (lambda m: [np.array([0.0, 0.0, 1.0]) * m.altitude[:, None]], MORE),
    "thrust_curve": (lambda m: [m.thrust * np.log(m.speed)[:, None]], (-1.0, 1.0)),
    "battery_sag": (lambda m: [m.thrust * (m.voltage - 1.0)[:, None]], MORE),
    "motor_lag": (lambda m: [-m.thrust_rate], MORE),
    "thrust_map": (lambda m: [m.thrust, m.thrust / _size(m) * GRAVITY], (-0.6, 0.6)),
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


def left_over(m: Motion, families: list[str], hidden: tuple[str, ...]) -> float:
    """Root mean square of what terms of these families leave of the effect, m/s^2."""
    named = [TERMS[family] for family in families if family in TERMS]
    if "wind" in families and "wind" in hidden:
        named += [TERMS["rotor_drag"], TERMS["body_drag"]]  # the drag that makes it felt
    columns = [(term.ravel(), bounds) for terms, bounds in named for term in terms(m)]
    columns = [(term, bounds) for term, bounds in columns if np.abs(term).max() > 1e-9]
    effect = m.effect.ravel()
    rest = effect
    if columns:
        size = np.array([np.sqrt((term**2).mean()) for term, _ in columns])
        design = np.column_stack([term for term, _ in columns]) / size
        low, high = (np.array([bounds[i] for _, bounds in columns]) * size for i in range(2))
        rest = effect - design @ lsq_linear(design, effect, (low, high), method="bvls").x
    return float(np.sqrt((rest**2).sum() / len(m.time)))


def alike(m: Motion, families: tuple[str, ...], forms: tuple[str, ...]) -> list[list[str]]:
    """Pairs of a hidden family and another one that these flights do not separate."""
    least = left_over(m, list(families), families)
    clear = visible(m, families)
    whole = float(np.sqrt((m.effect**2).sum(-1).mean()))
    pairs = set()
    for family, form in zip(families, forms, strict=True):
        if family == "wind":
            pairs.add(("body_drag" if form == "body" else "rotor_drag", "wind"))
        if family in BY_MOMENT:
            continue
        others = [f for f in families if f != family]
        alone = np.sqrt(max(whole**2 - left_over(m, [family], families) ** 2, 0.0))
        for other in TERMS:
            if other in others:
                alike_ = other not in BY_MOMENT and clear[family] < max(FAINT, TAKEN * alone)
            elif other == family or not possible(other, m) or clear[family] < FAINT:
                continue  # what cannot be seen is like everything
            else:
                exchanged = left_over(m, [*others, other], families)
                more = np.sqrt(max(exchanged**2 - least**2, 0.0))
                alike_ = more < max(FAINT, SHARE * clear[family])
            if alike_:
                pairs.add((min(family, other), max(family, other)))
    return sorted([first, second] for first, second in pairs)


def visible(m: Motion, families: tuple[str, ...]) -> dict[str, float]:
    """Acceleration that each family explains and the others do not, m/s^2."""
    whole = left_over(m, list(families), families)
    out = {}
    for family in families:
        if family in TERMS:
            others = [f for f in families if f != family]
            out[family] = round(float(np.sqrt(max(left_over(m, others, families) ** 2 - whole**2, 0.0))), 4)
    return out
