"""Flight of a whole batch at once: estimators, controllers and vehicles in step, and the record of each flight."""

from dataclasses import dataclass

import numpy as np

from studies.worlds.field.arrays import GRAVITY_M_S2, Floats
from studies.worlds.field.batch import Signal, per_flight
from studies.worlds.field.cases import Case, Flight
from studies.worlds.field.control import Controllers, Estimate
from studies.worlds.field.estimation import Estimators
from studies.worlds.field.missions import STEP_S
from studies.worlds.field.plant import Plant

RATE_HZ = 400
RECORD_EVERY = 2


@dataclass(frozen=True)
class Track:
    """Recorded flight, at steps of `RECORD_EVERY / RATE_HZ`, from the start of the log; world vectors in NED."""

    time_s: Floats
    position_m: Floats
    velocity_m_s: Floats
    accel_m_s2: Floats
    attitude: Floats
    specific_force_m_s2: Floats
    """Without gravity, body axes."""
    hidden_accel_m_s2: Floats
    """Acceleration that the hidden effects make, against the rigid body with the vehicle file's numbers."""
    rpm: Floats
    commanded_rpm: Floats
    thrust_command_n: Floats
    voltage_v: Floats
    lowest_m: Floats
    """Height of the lowest rotor above the ground."""
    estimated_position_m: Floats
    estimated_velocity_m_s: Floats
    estimated_attitude: Floats
    estimated_rates_rad_s: Floats


class _Recorder:
    """Store of the quantities of a batch at every recorded step, shape (records, flights, ...)."""

    def __init__(self, records: int) -> None:
        self._records = records
        self._store: dict[str, Floats] = {}

    def keep(self, record: int, values: dict[str, Floats]) -> None:
        for name, value in values.items():
            if name not in self._store:
                self._store[name] = np.empty((self._records, *value.shape))
            self._store[name][record] = value

    def track(self, row: int, records: int, rotors: int) -> Track:
        """Record of one flight, without the padding of rotors and time."""
        values = {name: stored[:records, row].copy() for name, stored in self._store.items()}
        for name in ("rpm", "commanded_rpm"):
            values[name] = values[name][:, :rotors].copy()
        return Track(time_s=np.asarray(np.arange(records) * (RECORD_EVERY / RATE_HZ), dtype=np.float64), **values)


def _seen(estimate: Estimate) -> dict[str, Floats]:
    return {
        "estimated_position_m": estimate.position_m,
        "estimated_velocity_m_s": estimate.velocity_m_s,
        "estimated_attitude": estimate.attitude,
        "estimated_rates_rad_s": estimate.rates_rad_s,
    }


def simulate(cases: list[Case], flights: list[Flight]) -> list[Track]:
    """Fly `flights`, each with the case in the same place of `cases`; all must settle for the same time."""
    step_s = 1.0 / RATE_HZ
    settle = flights[0].settle_s
    duration = max(flight.reference.duration_s for flight in flights)
    steps, first = int(duration * RATE_HZ), int(settle * RATE_HZ)
    plant = Plant(cases, flights, duration, step_s)
    estimators = Estimators(cases, flights, duration, step_s)
    controllers = Controllers(cases, plant.rpm.shape[1])
    missing = GRAVITY_M_S2 * (1.0 / plant.known_thrust_gain() - 1.0)
    controllers.preload(-missing[:, None] * np.array([0.0, 0.0, 1.0]))
    position = Signal([flight.reference.position_m for flight in flights], STEP_S, duration)
    velocity = Signal([flight.reference.velocity_m_s for flight in flights], STEP_S, duration)
    accel = Signal([flight.reference.accel_m_s2 for flight in flights], STEP_S, duration)
    yaw = Signal([flight.reference.yaw_rad for flight in flights], STEP_S, duration)
    # The rotor speed controller makes up for a part of the motor lag by asking for more than it wants.
    lead = 1.0 / (1.0 - per_flight(cases, lambda case: case.control.lead))[:, None]
    fastest = per_flight(cases, lambda c: 1.08 * np.sqrt(c.vehicle.max_thrust_n / c.vehicle.thrust_n_per_rpm2))[:, None]
    spinning = plant.rpm > 0.0
    recorder = _Recorder((steps - first) // RECORD_EVERY)
    for step in range(steps):
        time = step * step_s
        estimate = estimators.update(plant, time)
        controllers.outer(step, RATE_HZ, estimate, position.at(time), velocity.at(time), accel.at(time))
        controllers.inner(step, RATE_HZ, estimate, yaw.at(time))
        wanted = plant.rpm + lead * (controllers.speeds_rpm() - plant.rpm)
        command = np.clip(wanted, 0.15 * fastest, fastest) * spinning
        record, between = divmod(step - first, RECORD_EVERY)
        keep = step >= first and between == 0 and record < (steps - first) // RECORD_EVERY
        before = (plant.position_m, plant.velocity_m_s, plant.attitude)
        plant.advance(command, time)
        if keep:
            values = {**plant.snapshot(), **_seen(estimate)}
            values["position_m"], values["velocity_m_s"], values["attitude"] = before
            values |= {"commanded_rpm": command, "thrust_command_n": controllers.thrust_n}
            recorder.keep(record, values)
    tracks = []
    for row, (case, flight) in enumerate(zip(cases, flights, strict=True)):
        records = min(int((flight.reference.duration_s - settle) * RATE_HZ) // RECORD_EVERY, recorder._records)
        tracks.append(recorder.track(row, records, case.vehicle.rotors))
    return tracks
