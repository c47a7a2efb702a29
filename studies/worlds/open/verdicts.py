"""Size of what is hidden, and whether the flights are fit to show it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from studies.worlds.open.control import euler
from studies.worlds.open.draw import Drawn
from studies.worlds.open.effects import Hidden, hide
from studies.worlds.open.missions import SETTLE_S, STEP_S
from studies.worlds.open.noise import low_pass
from studies.worlds.open.physics import Loads, World, padded
from studies.worlds.open.simulate import RECORD_S, Flight, Record, rotations
from studies.worlds.open.vehicles import GRAVITY_M_S2, Array


def believed_thrust(drawn: Drawn, record: Record) -> Array:
    """Total thrust by the logged signal and the vehicle file, its ordinary errors left out."""
    craft = drawn.craft
    if drawn.kit.source == "speeds":
        return np.asarray(np.sum(craft.rotor_gains * craft.thrust_n_per_rpm2 * record.rpm**2, axis=1))
    speeds = np.sqrt(record.command / craft.thrust_n_per_rpm2)
    if drawn.case.lag_known:
        speeds = low_pass(speeds, RECORD_S, craft.time_constant_s)
    return np.asarray(np.sum(craft.rotor_gains * craft.thrust_n_per_rpm2 * speeds**2, axis=1))


def plain_acceleration(drawn: Drawn, record: Record) -> Array:
    """Acceleration that the rigid body of the vehicle file would have had, turbulence included."""
    lift = believed_thrust(drawn, record) / drawn.craft.mass_kg
    down = rotations(record.quaternion)[:, :, 2]
    return np.asarray(record.gust - lift[:, None] * down + np.array([0.0, 0.0, GRAVITY_M_S2]))


def hidden_acceleration(drawn: Drawn, record: Record) -> Array:
    """Acceleration that the hidden effects cause; of a mere moment, the one it gives at the radius of the arms."""
    effect = record.acceleration - plain_acceleration(drawn, record)
    if not drawn.case.effects:
        return np.zeros_like(effect)
    turn = record.levelling / drawn.craft.inertia_kg_m2 * drawn.craft.arm_m
    return np.asarray(np.column_stack([effect, turn, np.tile(drawn.hidden.imu_bias_m_s2, (len(effect), 1))]))


def effect_rms(drawn: Drawn, records: Sequence[Record]) -> float:
    """Root mean square of the hidden acceleration over all flights."""
    squares = np.concatenate([np.sum(hidden_acceleration(drawn, r) ** 2, axis=1) for r in records])
    return float(np.sqrt(squares.mean()))


def _loads(drawn: Drawn, hidden: Hidden, record: Record, rows: slice) -> Loads:
    """Loads of one hidden physics on the states that were flown, each state taken as a flight of its own."""
    q = record.quaternion[rows]
    n = len(q)
    world = World([drawn.craft] * n, [hidden] * n, [drawn.case.ceiling_m] * n)
    rpm = np.ascontiguousarray(padded(record.rpm[rows].T).T)
    times = np.arange(len(record.quaternion), dtype=np.float64)[rows] * RECORD_S
    for _ in range(30):  # until the inflow has settled
        loads = world.loads(
            times, record.position[rows], record.velocity[rows], rotations(q), rpm, record.gust[rows], 0.02
        )
    return loads


def effect_sizes(drawn: Drawn, records: Sequence[Record], every: int = 20) -> dict[str, float]:
    """Root mean square of the acceleration by each hidden effect alone, on the states that were flown."""
    sizes, rows = {}, slice(None, None, every)
    plain = [_loads(drawn, Hidden(), record, rows) for record in records]
    for name, size in drawn.case.effects.items():
        alone, _ = hide({name: size}, drawn.craft, drawn.strength)
        squares = []
        for record, rigid in zip(records, plain, strict=True):
            if name in {"battery_sag", "motor_lag", "thrust_map"}:
                real = np.sum(drawn.craft.rotor_gains * drawn.craft.thrust_n_per_rpm2 * record.rpm**2, axis=1)
                squares.append(((real - believed_thrust(drawn, record)) / drawn.craft.mass_kg) ** 2)
                continue
            loads = _loads(drawn, alone, record, rows)
            pull = loads.force / loads.mass[:, None] - rigid.force / rigid.mass[:, None]
            turn = loads.levelling / drawn.craft.inertia_kg_m2 * drawn.craft.arm_m
            bias = np.sum(alone.imu_bias_m_s2**2)
            squares.append(np.sum(pull**2, axis=1) + np.sum(turn**2, axis=1) + bias)
        sizes[name] = float(np.sqrt(np.mean(np.concatenate(squares))))
    return sizes


def _flaw(drawn: Drawn, flight: Flight, record: Record) -> str | None:
    """Reason why one flight is no good."""
    if not all(np.isfinite(part).all() for part in (record.position, record.quaternion, record.rpm)):
        return "lost"
    craft = drawn.craft
    plane = -record.position[:, 2] + craft.rotor_height_m
    if plane.min() < 0.45 * craft.radius_m + 0.2 * craft.rotor_height_m:
        return f"touches the ground at {plane.min() / craft.radius_m:.2f} radii"
    if flight.ceiling_m is not None and (flight.ceiling_m - plane).min() < 0.25 * craft.radius_m:
        return "touches the ceiling"
    lean = np.degrees(np.abs(euler(rotations(record.quaternion))[:, :2])).max()
    if lean > 60.0:
        return f"leans by {lean:.0f} degrees"
    if record.saturated > 0.01:
        return f"saturates for {record.saturated:.1%}"
    path = flight.reference.position[round(SETTLE_S / STEP_S) :]
    rows = np.minimum(np.arange(len(record.position)) * round(RECORD_S * 1000) // round(STEP_S * 1000), len(path) - 1)
    away = np.linalg.norm(record.position - path[rows], axis=1)
    room = float(np.max(np.ptp(path, axis=0)))
    if away.max() > 0.8 + 0.4 * room:
        return f"strays by {away.max():.1f} m"
    return None


def flaw(drawn: Drawn, records: Sequence[Record]) -> str | None:
    """Reason why a case is no good: a crash, saturation, or an effect that is never reached."""
    for flight, record in zip(drawn.flights, records, strict=True):
        reason = _flaw(drawn, flight, record)
        if reason is not None:
            return reason
    size = effect_rms(drawn, records)
    if drawn.case.effects and not 0.15 * drawn.strength <= size <= 3.0 * max(drawn.strength, 1.0):
        return f"effect of {size:.2f} m/s^2"
    for name, part in effect_sizes(drawn, records).items():
        if part < 0.12 * drawn.strength:
            return f"{name} of {part:.2f} m/s^2"
    return None
