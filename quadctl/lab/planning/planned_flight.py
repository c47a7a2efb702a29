"""Planned flight: the prepared flight of a mission that has not been flown, by an ideal vehicle that follows its
reference."""

import functools
import math

import numpy as np

from quadctl.errors import SettingsError
from quadctl.frames import GRAVITY_M_S2, Quaternion, quaternion_from_euler, rotate, rotate_inverse
from quadctl.lab.arrays import Floats
from quadctl.lab.flights.dataset import Dataset
from quadctl.lab.flights.flight import Flight
from quadctl.lab.flights.preparation import BANDWIDTH_PER_UPDATE_RATE, prepare
from quadctl.logs.columns import rpm_columns
from quadctl.logs.flight_log import ATTITUDE, POSITION, VELOCITY, FlightLog
from quadctl.missions import Mission
from quadctl.missions.mission import Phase
from quadctl.model import Model, conditions
from quadctl.numeric import Vector, asin, atan2, plus, scaled, sqrt

STEP_S = 0.02
JUMP_M = 0.005
"""Change of the reference in a step beyond what its velocity explains that counts as a jump."""
FOLLOWING_RAD_S = 1.5
"""Angular frequency of the critically damped oscillator by which the vehicle follows a jump, as position controllers of
multirotors do: 1 m with at most 2.3 m/s^2."""
ROUNDS = 4
"""Iterations that correct attitude and thrust for the effects of the model; each removes most of the error."""
LEAST_HEIGHT_M = 0.02
MAX_TILT_DEG = 35.0
MAX_THRUST_SHARE = 0.9
"""Largest share of the rotors' maximum thrust; the rest is for attitude control."""


def planned_flight(mission: Mission, model: Model, like: Dataset) -> Flight:
    """Flight of `mission` by a vehicle that obeys `model`, without noise, logged as slowly as the flights of `like`.

    The vehicle follows the reference, and its jumps as a well damped vehicle would. Attitude and rotor thrusts are
    those that give the reference's acceleration by `model`; all rotors give the same thrust. A mission that keeps the
    heading of take-off has the heading of the last flight, and the battery voltage falls as it did then.

    Raises
    ------
    SettingsError
        The mission cannot be flown by this vehicle: floor, ceiling, tilt or thrust.
    LogError
        The flight is too short for an analysis.
    """
    vehicle = model.vehicle
    time, position, velocity, acceleration = _followed(mission.phases)
    _check_heights(mission, model, position[:, 2], time)
    last = like.flights[-1].conditions
    heading = _heading(last.attitude)
    yaw = np.array([mission.yaw_rad(t, heading) for t in time.tolist()])
    battery = _falling(np.asarray(last.battery_v), np.asarray(last.time_s), time)
    wanted = scaled(vehicle.mass_kg, (acceleration[:, 0], acceleration[:, 1], -acceleration[:, 2] - GRAVITY_M_S2))
    command = wanted
    for _ in range(ROUNDS):
        roll, pitch = _lean(command, yaw)
        attitude = quaternion_from_euler(roll, pitch, yaw)
        each = _length(command) / (vehicle.n_rotors * vehicle.axial_share)
        body = rotate_inverse(attitude, (velocity[:, 0], velocity[:, 1], -velocity[:, 2]))
        c = conditions(vehicle, position[:, 2], body, attitude, time, battery, (position[:, 0], position[:, 1]))
        given = rotate(attitude, model.body_force([each] * vehicle.n_rotors, c))
        command = plus(command, plus(wanted, scaled(-1.0, given)))
    _check_forces(mission, model, roll, pitch, each)
    columns = {
        **dict(zip(POSITION, position.T, strict=True)),
        **dict(zip(VELOCITY, velocity.T, strict=True)),
        **dict(zip(ATTITUDE, np.degrees([roll, pitch, yaw]), strict=True)),
        **dict.fromkeys(rpm_columns(vehicle.n_rotors), np.sqrt(each / vehicle.rotor.thrust_n_per_rpm2)),
        "battery_v": battery,
    }
    return prepare(_log(mission.name, time, columns, min(flight.bandwidth_hz for flight in like.flights)), vehicle)


@functools.lru_cache(maxsize=64)  # every suggestion looks at the same missions
def _followed(phases: tuple[Phase, ...]) -> tuple[Floats, Floats, Floats, Floats]:
    """Time, shape (n,), and position, velocity and acceleration of the vehicle, north, east, up, shape (n, 3) each;
    not to be written to."""
    time = np.arange(0.0, phases[-1].end_s, STEP_S)
    at = np.minimum(np.searchsorted([phase.end_s for phase in phases], time, side="right"), len(phases) - 1)
    flown = [(t, phases[i]) for t, i in zip(time.tolist(), at.tolist(), strict=True)]
    references = [phase.reference(t) for t, phase in flown]
    position, velocity, acceleration = (np.array([r[i] for r in references]) for i in range(3))
    jumps = np.diff(position, axis=0) - 0.5 * STEP_S * (velocity[1:] + velocity[:-1])
    w = FOLLOWING_RAD_S
    for k in np.flatnonzero(np.linalg.norm(jumps, axis=1) > JUMP_M) + 1:
        left, since = jumps[k - 1], (time[k:] - time[k])[:, None]
        decay = np.exp(-w * since) * left
        position[k:] -= (1.0 + w * since) * decay
        velocity[k:] += w * w * since * decay
        acceleration[k:] += w * w * (1.0 - w * since) * decay
    for array in (time, position, velocity, acceleration):
        array.flags.writeable = False
    return time, position, velocity, acceleration


def _log(name: str, time: Floats, columns: dict[str, Floats], bandwidth_hz: float) -> FlightLog:
    """Log of the flight, in which the position has the update rate that allows a filter of `bandwidth_hz`."""
    slow = max(1, int(BANDWIDTH_PER_UPDATE_RATE / bandwidth_hz / STEP_S))
    logged = {"time_s": time}
    for column, values in columns.items():
        rows = slow if column in POSITION else 1
        update = np.arange(len(time)) // rows
        # Readers of a log take a repeated value as no update: so consecutive values differ by a negligible amount.
        logged[column] = values[rows * update] + 1e-9 * (update % 2)
    return FlightLog(name=name, path=None, columns=logged)


def _lean(force_ned: Vector, yaw_rad: Floats) -> tuple[Floats, Floats]:
    """Roll and pitch, rad, at which the thrust of a vehicle with heading `yaw_rad` points along `force_ned`."""
    north, east, down = force_ned
    ahead = np.cos(yaw_rad) * north + np.sin(yaw_rad) * east
    right = np.cos(yaw_rad) * east - np.sin(yaw_rad) * north
    return asin(right / _length(force_ned)), atan2(-ahead, -down)


def _heading(attitude: Quaternion) -> float:
    """Circular mean of the yaw of a flight, rad."""
    w, x, y, z = attitude
    east, north = 2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)
    return math.atan2(float(np.mean(east)), float(np.mean(north)))


def _falling(battery_v: Floats, time_s: Floats, time: Floats) -> Floats:
    """Battery voltage with the initial value and the slope of an earlier flight; nan where it was not logged."""
    if battery_v.ndim == 0 or not np.isfinite(battery_v).all():
        return np.full_like(time, np.nan)
    slope, begin = np.polyfit(time_s - time_s[0], battery_v, 1)
    return np.asarray(begin + slope * time)


def _check_heights(mission: Mission, model: Model, z_m: Floats, time: Floats) -> None:
    vehicle = model.vehicle
    lowest = float(np.min(z_m[time >= mission.phases[0].end_s], initial=math.inf))
    if lowest < LEAST_HEIGHT_M:
        raise SettingsError(f"{mission.name}: goes down to z = {lowest:.2f} m, expected {LEAST_HEIGHT_M:g} m or more")
    highest = float(np.max(z_m)) + vehicle.rotor_height_m
    if vehicle.ceiling_m is not None and highest > vehicle.ceiling_m - vehicle.rotor.radius_m:
        raise SettingsError(
            f"{mission.name}: the rotors reach {highest:.2f} m, expected a rotor radius or more below the ceiling at "
            f"ceiling_m = {vehicle.ceiling_m:g}"
        )


def _check_forces(mission: Mission, model: Model, roll: Floats, pitch: Floats, each_n: Floats) -> None:
    lean_deg = math.degrees(float(np.max(np.arccos(np.cos(roll) * np.cos(pitch)))))
    if not lean_deg < MAX_TILT_DEG:
        raise SettingsError(f"{mission.name}: tilts by {lean_deg:.0f} degrees, expected less than {MAX_TILT_DEG:g}")
    most, allowed = float(np.max(each_n)), MAX_THRUST_SHARE * model.vehicle.throttle.max_thrust_per_rotor_n
    if not most < allowed:
        raise SettingsError(f"{mission.name}: needs {most:.1f} N from each rotor, expected less than {allowed:.1f} N")


def _length(a: Vector) -> Floats:
    return np.asarray(sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2]))
