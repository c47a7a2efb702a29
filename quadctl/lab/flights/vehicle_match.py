"""Check that a log was flown by the given vehicle; the parameters of another one would look like missing physics."""

import math
from enum import unique
from typing import Any

import numpy as np
from scipy.optimize import linear_sum_assignment

from quadctl.logs.findings import Finding, Kind, finding
from quadctl.logs.flight_log import FlightLog, Floats
from quadctl.vehicle import Vehicle
from quadctl.words import By, Fact, Kinds, When, fact

MAX_THRUST_FACTOR = 2.5
"""Largest ratio of the rotors' thrust to the weight in flight, or of the weight to the thrust: more is another vehicle
or unit, not a thrust scale."""
DOUBTFUL_THRUST_FACTOR = 1.4
"""Such a ratio above which one must ask: throttle lines are off by a third, coefficients and masses by less."""
MIN_HEIGHT_CHANGE_M = 0.3
"""Least change of height that shows a flight; below it the rotors may be idling on the ground."""
MAX_SETTING_DIFFERENCE = 0.1
"""Largest relative difference between the sidecar's vehicle and the given one if only the name differs."""
MIN_CORRELATION, STRANGER_CORRELATION = 0.4, 0.15
"""Correlation of the rotors' moments with the measured ones: least in the right order of the motors, largest in a wrong
one."""
MIN_SHARE_OF_MOMENT = 0.5
"""Least share of the rotors' moments that turns the vehicle, in the right order of the motors. Where most of them
counters a moment from outside, such as that of the ground, the vehicle turns against them in any order."""
MIN_LIFT_CORRELATION = 0.7
"""Least correlation of thrust with vertical acceleration at which sign and factor are clear."""
MAX_ACCELERATION_FACTOR = 2.5
"""Largest slope of vertical acceleration over thrust by mass; less may be a thrust scale."""

_SPEED_UNITS = {math.pi / 30.0: "rad/s", 1.0 / 60.0: "revolutions per second"}
_POLE_PAIRS = range(3, 29)


@unique
class Mismatch(Kinds):
    """Contradictions between a log and its vehicle, each with its template."""

    OTHER_VEHICLE = (
        "its sidecar says that '{flown}' flew it ({name} {theirs:g}), expected the vehicle of the model, '{vehicle}' "
        "({name} {ours:g})"
    )
    OTHER_WEIGHT = (
        "by the {source} and the vehicle '{vehicle}' the rotors give {thrust_n:.3g} N in flight, {factor:.2g} times "
        "its weight of {weight_n:.3g} N, expected about once: ",
        By(
            "source",
            {
                "thrust command": "is thrust_cmd_n the thrust of all rotors in newtons, and is mass_kg that of the "
                "vehicle that flew?",
                "rotor speed": When(
                    "unit",
                    "are the rotor speeds in {unit}?",
                    (
                        "are mass_kg and thrust_n_per_rpm2 those of the vehicle that flew",
                        When("pole_pairs", ", or the speeds electrical ({pole_pairs} pole pairs)"),
                        "?",
                    ),
                ),
            },
            "is the signal between 0 and 1, and are mass_kg and throttle those of the vehicle that flew?",
        ),
    )
    UPSIDE_DOWN = (
        "vz_m_s falls when the rotors give more thrust (correlation {correlation:.2f}), expected it to rise: are z_m "
        "and vz_m_s up?"
    )
    NO_METRES = (
        "vz_m_s speeds up {factor:.3g} times as much as the rotors' thrust over mass_kg says, expected about once: are "
        "z_m and vz_m_s in metres?"
    )
    MOTOR_ORDER = (
        "its rotor speeds do not turn the vehicle as it turns (correlation of the roll and pitch moments "
        "{as_logged[0]:.2f} and {as_logged[1]:.2f}), but in the order {order:list} they do ({best[0]:.2f} and "
        "{best[1]:.2f}), expected the order of rotors of the vehicle '{vehicle}'"
    )


def sidecar_problem(log: FlightLog, vehicle: Vehicle) -> Fact | None:
    """Problem with the vehicle named in the log's sidecar; None where it is the given one or none is
    named."""
    flown = log.meta.get("vehicle")
    if not isinstance(flown, dict) or flown.get("name") in (None, vehicle.name):
        return None
    rotor = flown.get("rotor")
    rotor = rotor if isinstance(rotor, dict) else {}
    rotors = flown.get("rotors")
    said: dict[str, tuple[Any, float]] = {
        "mass_kg": (flown.get("mass_kg"), vehicle.mass_kg),
        "rotor.thrust_n_per_rpm2": (rotor.get("thrust_n_per_rpm2"), vehicle.rotor.thrust_n_per_rpm2),
        "rotor.radius_m": (rotor.get("radius_m"), vehicle.rotor.radius_m),
        "number of rotors": (len(rotors) if isinstance(rotors, list) else None, vehicle.n_rotors),
    }
    for name, (theirs, ours) in said.items():
        if isinstance(theirs, int | float) and abs(theirs - ours) > MAX_SETTING_DIFFERENCE * ours:
            both = {"flown": flown["name"], "vehicle": vehicle.name, "name": name, "theirs": theirs, "ours": ours}
            return fact(Mismatch.OTHER_VEHICLE, **both)
    return None


def thrust_problem(total_n: Floats, z_m: Floats, vehicle: Vehicle, source: str) -> Fact | None:
    """Problem with the thrust: it carries another weight; None where it fits, or the vehicle stays on
    the ground.

    `total_n`: nominal thrust of all rotors over the whole log, shape (n,); `z_m`: altitude, shape (n,).
    """
    working = total_n > 0.5 * float(np.nanquantile(total_n, 0.9))
    if not working.any():
        return None
    factor = float(np.median(total_n[working])) / vehicle.weight_n
    rises = float(np.diff(np.nanquantile(z_m[working], [0.02, 0.98]))[0]) > MIN_HEIGHT_CHANGE_M
    if factor < MAX_THRUST_FACTOR and (factor > 1.0 / MAX_THRUST_FACTOR or not rises):
        return None
    of_speed = math.sqrt(factor)
    pairs = round(of_speed)
    return fact(
        Mismatch.OTHER_WEIGHT,
        source=source,
        vehicle=vehicle.name,
        thrust_n=factor * vehicle.weight_n,
        factor=factor,
        weight_n=vehicle.weight_n,
        unit=next((unit for known, unit in _SPEED_UNITS.items() if 0.8 < of_speed / known < 1.25), ""),
        pole_pairs=pairs if pairs in _POLE_PAIRS else None,
    )


def weight_doubt(factor: float, vehicle: Vehicle, source: str) -> Finding | None:
    """Doubt whether the vehicle is the one that flew; None where its thrust carries its weight.

    `factor`: nominal thrust of all rotors in flight over the weight.
    """
    if 1.0 / DOUBTFUL_THRUST_FACTOR < factor < DOUBTFUL_THRUST_FACTOR:
        return None
    line = "" if source == "rotor speed" else ", and the line from command to thrust in its file (see thrust_map)"
    return finding(
        Kind.WEIGHT_DOUBT, source=source, vehicle=vehicle.name, factor=factor, mass_kg=vehicle.mass_kg, line=line
    )


def motion_problem(
    measured: Floats, thrust_n: Floats, torque: Floats | None, lean: Floats, vehicle: Vehicle
) -> Fact | None:
    """Problem with the motion: the vehicle does not move as its rotors drive it; None if it does or
    hardly moves.

    All arguments have the same filter: `measured`, acceleration north, east, up, m/s^2, shape (n, 3); `thrust_n`,
    nominal thrust of each rotor, N, shape (n, rotors); `torque`, from the body rates, FRD, N m, shape (n, 3), if known;
    `lean`, roll and pitch, shape (n, 2).
    """
    return _upside_down(measured[:, 2], thrust_n.sum(axis=1) / vehicle.mass_kg) or (
        None if torque is None else _motor_order(_without(lean, torque[:, :2]), _without(lean, thrust_n), vehicle)
    )


def _upside_down(up: Floats, by_thrust: Floats) -> Fact | None:
    """Compare vertical acceleration with thrust over mass, both of shape (n,): opposite sign, or another unit."""
    if not np.std(by_thrust) or not np.std(up):
        return None
    correlation = float(np.corrcoef(by_thrust, up)[0, 1])
    if correlation < -MIN_LIFT_CORRELATION:
        return fact(Mismatch.UPSIDE_DOWN, correlation=correlation)
    factor = correlation * float(np.std(up) / np.std(by_thrust))
    if correlation > MIN_LIFT_CORRELATION and factor > MAX_ACCELERATION_FACTOR:
        return fact(Mismatch.NO_METRES, factor=factor)
    return None


def _without(lean: Floats, values: Floats) -> Floats:
    """Values without their mean and without what follows the lean, shape (n, k).

    The ground levels a vehicle that leans, and its rotors hold against that: they then turn it, as far as one can see,
    the wrong way.
    """
    columns = np.column_stack([lean, np.ones(len(lean))])
    return np.asarray(values - columns @ np.linalg.lstsq(columns, values, rcond=None)[0])


def _motor_order(needed: Floats, thrust: Floats, vehicle: Vehicle) -> Fact | None:
    """Compare the rotors' roll and pitch moments with those `needed`; find the order of motors that fits best.

    The order whose moments have the largest covariance with the measured ones is the solution of a linear assignment
    problem.
    """
    arms = np.array(vehicle.moment_arms_m)[:, :2]
    gain = thrust.T @ (needed / np.maximum(needed.std(axis=0), 1e-12)) @ arms.T
    speeds, places = linear_sum_assignment(gain, maximize=True)
    order = speeds[np.argsort(places)]
    made = thrust[:, order] @ arms
    as_logged, best = _correlations(thrust @ arms, needed), _correlations(made, needed)
    if min(best) < MIN_CORRELATION or min(as_logged) > STRANGER_CORRELATION:
        return None
    if np.min(np.sum(made * needed, axis=0) / np.sum(made**2, axis=0)) < MIN_SHARE_OF_MOMENT:
        return None
    known = {"as_logged": as_logged, "best": best, "vehicle": vehicle.name}
    return fact(Mismatch.MOTOR_ORDER, order=[int(i) + 1 for i in order], **known)


def _correlations(made: Floats, needed: Floats) -> list[float]:
    """Correlation of each pair of columns; 0 where one of them is constant."""
    power = np.sqrt((made**2).sum(axis=0) * (needed**2).sum(axis=0))
    return [float(c) for c in (made * needed).sum(axis=0) / np.maximum(power, 1e-30)]
