"""Nuisances: small errors of every real flight that are not physics that a model should hold.

Each flight has its own nuisances: the scale of its thrust (rotors, battery), the trim of its attitude estimate, the
datum of its height, the delays of its rotor signal and of its attitude, the share of a lean that accelerates the
vehicle which the attitude estimate takes for level, now and over some seconds, a moment from rotors that are not all
alike and a centre of mass that is off, and the error of an attitude by motion capture. They are fitted together with
the effects, so that an effect does not explain them, and held by priors and bounds, so that they do not explain an
effect. An effect of the same kind, such as a thrust scale or a tilt, is the mean of the vehicle, about which its
flights scatter by the priors; so its interval knows how flights differ.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from quadctl.frames import GRAVITY_M_S2, multiply, quaternion_from_euler, rotate, rotate_inverse
from quadctl.lab.arrays import Floats
from quadctl.lab.flights.flight import Flight
from quadctl.lab.flights.prediction import PREDICT, predict
from quadctl.logs.flight_log import MOTION_CAPTURE
from quadctl.model import Model
from quadctl.vehicle import Vehicle


@dataclass(frozen=True)
class Kind:
    """One nuisance: standard deviation of its prior (mean 0), and the bound of its absolute value."""

    name: str
    prior_std: float
    bound: float
    positive: bool = False
    """True where it is positive by its nature: then it is bounded below by minus its standard deviation."""


KINDS = (
    Kind("thrust_scale", 0.005, 0.015),
    Kind("roll_rad", np.radians(0.4), np.radians(0.8)),
    Kind("pitch_rad", np.radians(0.4), np.radians(0.8)),
    Kind("height_m", 0.01, 0.02),
    Kind("delay_s", 0.008, 0.03),
    Kind("levelling", 0.02, 0.1),
    Kind("slow_levelling", 0.05, 0.25, positive=True),
    Kind("attitude_delay_s", 0.005, 0.02),
    Kind("roll_moment", 0.02, 0.04),
    Kind("pitch_moment", 0.02, 0.04),
    Kind("yaw_moment", 0.02, 0.04),
    Kind("captured_roll_rad", np.radians(1.5), np.radians(5.0)),
    Kind("captured_pitch_rad", np.radians(1.5), np.radians(5.0)),
)
"""Kinds of nuisances. Trims of real vehicles are 0.4 to 3.5 degrees; those beyond the bound are an effect
(`thrust_tilt`). An accelerometer in a vehicle that accelerates by leaning shows no lean, so an estimator that averages
it takes a part of the lean for level: the share is positive. Where other lags of the estimator make it negative, it is
small; a large negative one would stand for a drag, as it did in RAPTOR's forward flight. An attitude that is late by t
gives an error of t times the jerk, which in a hover that sways at w rad/s is a drag of t w^2 1/s. Moments are in units
of the root of the summed squares of the rotors' moments: 0.01 is the standard deviation of the moment of rotors whose
coefficients are independently 1 % off each, and whose motors lean by `LEAN`. Like these errors, they grow with the
thrust. A centre of mass that is 1 % of the arms off gives 0.02; three flights of RAPTOR have roll and pitch moments of
0.002 to 0.051, 0.03 in the root mean square; `bounds` widens those of short arms.

The last two are errors of the attitude of a motion capture alone, which turn the force and the accelerometer's reading
alike: the axes of its rigid body are those that the vehicle had on the floor when the markers were named. An estimator
that its accelerometer levels is never that far off. They take away a tilted thrust where no accelerometer tells it from
such an error."""
LEAN = np.radians(0.3)
"""Lean of each motor on its arm, standard deviation, rad; about yaw it matters much more than coefficients that are 1 %
off."""
CENTRE_OF_MASS_M = 2e-3
"""Offset of the centre of mass up to which a moment is a nuisance, where that is more than the bound in `KINDS`: hands
that strap in a battery leave a millimetre or two on any vehicle, which is much of the arms of a small one. On a vehicle
with arms of 33 mm it takes away the faults of one rotor by less than a quarter of its thrust; above arms of 0.1 m it
changes nothing."""
PRIOR_STD = np.array([kind.prior_std for kind in KINDS])
BOUND = np.array([kind.bound for kind in KINDS])
LOWEST = np.array([-kind.prior_std if kind.positive else -kind.bound for kind in KINDS])
FORCES = 8
"""Number of the kinds that act on the acceleration of every flight; three that act on the moments follow."""
MOMENTS = slice(FORCES, FORCES + 3)
TRIM, CAPTURED = slice(1, 3), slice(FORCES + 3, FORCES + 5)
"""Places of roll and pitch: of the trim, and of the error of a motion capture."""
HEIGHT, AGE, LEVELLING, SLOW_LEVELLING, ATTITUDE_AGE = (
    [kind.name for kind in KINDS].index(name)
    for name in ("height_m", "delay_s", "levelling", "slow_levelling", "attitude_delay_s")
)


def prior_std(flight: Flight) -> Floats:
    """Standard deviation of the prior of each nuisance of a flight, shape (kinds,): the delay of the rotor signal may
    also be off by as much as its estimate."""
    found = PRIOR_STD.copy()
    found[AGE] = math.hypot(found[AGE], flight.delay_std_s)
    return found


def is_captured(flight: Flight) -> bool:
    """Tell whether the attitude of a flight is that of a motion capture."""
    return flight.attitude_by == MOTION_CAPTURE


def bounds(flight: Flight) -> tuple[Floats, Floats]:
    """Lowest and highest value of each nuisance of a flight, shape (kinds,) each: two standard deviations of the delay,
    where that is more than its bound in `KINDS`."""
    low, high = LOWEST.copy(), BOUND.copy()
    high[AGE] = max(high[AGE], 2.0 * prior_std(flight)[AGE])
    # Roll and pitch only: a centre of mass does not turn about yaw.
    by_offset = CENTRE_OF_MASS_M * flight.vehicle.weight_n / moment_per_load(flight.vehicle)[:2]
    high[FORCES : FORCES + 2] = np.maximum(high[FORCES : FORCES + 2], by_offset)
    symmetric = np.array([not kind.positive for kind in KINDS])
    return np.where(symmetric, -high, low), high


def captured_leans_deg(flights: Sequence[Flight], nuisances: Floats) -> dict[str, tuple[float, float]]:
    """Roll and pitch by which the vehicle leans more than its motion capture says, deg, by the name of the flight,
    where it is more than the trim of any estimator; `nuisances` has shape (flights, kinds)."""
    return {
        flight.name: (float(np.degrees(roll)), float(np.degrees(pitch)))
        for flight, (roll, pitch) in zip(flights, nuisances[:, CAPTURED], strict=True)
        if is_captured(flight) and np.hypot(roll, pitch) > PRIOR_STD[TRIM.start]
    }


def disturbed(flight: Flight, nuisance: Floats) -> Flight:
    """Correct the logged flight by its nuisance; predictions are made from the result."""
    scale, roll, pitch, height, delay_s = (float(value) for value in nuisance[:LEVELLING])
    attitude_delay_s = 0.0 if flight.tells_force else float(nuisance[ATTITUDE_AGE])
    if is_captured(flight) and not flight.tells_force:  # else it turns the measured force, too
        roll, pitch = roll + float(nuisance[CAPTURED][0]), pitch + float(nuisance[CAPTURED][1])
    if not any((scale, roll, pitch, height, delay_s, attitude_delay_s)):
        return flight
    c = flight.conditions
    attitude = flight.later_attitude(attitude_delay_s) if attitude_delay_s else c.attitude
    attitude = multiply(attitude, quaternion_from_euler(roll, pitch, 0.0)) if roll or pitch else attitude
    flight = flight.shifted(delay_s)
    return replace(
        flight,
        conditions=replace(c, attitude=attitude, height_m=c.height_m + height),
        nominal_n=[(1.0 + scale) * thrust for thrust in flight.nominal_n] if scale else flight.nominal_n,
    )


def nuisance_jacobian(
    model: Model,
    flight: Flight,
    groups: Sequence[str],
    predicted: Floats,
    nearby_jacobian: Floats | None = None,
    out: Floats | None = None,
) -> Floats:
    """Jacobian of the prediction with respect to the nuisances at 0, shape (n, 3 * groups, kinds); they act linearly.

    It is written to `out` where that is given: of a long flight it takes hundreds of megabytes. `predicted` is the
    prediction of the flight's targets without a nuisance, shape (n, 3 * groups). `nearby_jacobian` is the
    `acceleration_jacobian` at other parameters. It is used where it is given, except for the column of the height,
    which depends strongly on the effects and is computed anew.
    """
    found = np.empty((*predicted.shape, len(KINDS))) if out is None else out
    found[:] = 0.0
    if "total" in groups:
        first = 3 * groups.index("total")
        total, acceleration = found[:, first : first + 3], predicted[:, first : first + 3]
        if nearby_jacobian is None:
            acceleration_jacobian(model, flight, acceleration, out=total[..., :FORCES])
        else:
            total[..., :FORCES] = nearby_jacobian
            total[..., HEIGHT] = _acceleration_derivative(model, flight, acceleration, HEIGHT)
        if is_captured(flight) and not flight.tells_force:
            total[..., CAPTURED] = total[..., TRIM]
    if "turning" in groups:
        first = 3 * groups.index("turning")
        for i, moment in enumerate(rotor_moments_n_m(flight).T):
            found[:, first + i, FORCES + i] = moment
    if "sensing" in groups and is_captured(flight):
        first = 3 * groups.index("sensing")
        for i in range(CAPTURED.start, CAPTURED.stop):
            nuisance = np.diag(PRIOR_STD)[i]
            found[:, first : first + 3, i] = sensed_by_wrong_attitude(flight, nuisance) / PRIOR_STD[i]
    return found


def acceleration_jacobian(model: Model, flight: Flight, predicted: Floats, out: Floats | None = None) -> Floats:
    """Jacobian of the acceleration with respect to the nuisances of the forces at 0, shape (n, 3, FORCES), written to
    `out` where that is given."""
    found = np.empty((*predicted.shape, FORCES)) if out is None else out
    for i in range(FORCES):
        found[..., i] = _acceleration_derivative(model, flight, predicted, i)
    return found


def _acceleration_derivative(model: Model, flight: Flight, predicted: Floats, i: int) -> Floats:
    if flight.tells_force and i in (LEVELLING, SLOW_LEVELLING, ATTITUDE_AGE):
        return np.zeros((len(predicted), 3))
    if i == LEVELLING:
        return _leant(predicted[:, :3], 1.0) - predicted[:, :3]
    if i == SLOW_LEVELLING:
        return np.column_stack([flight.lasting_acceleration, np.zeros(len(predicted))])
    return np.asarray((predict(model, disturbed(flight, np.diag(PRIOR_STD)[i])) - predicted[:, :3]) / PRIOR_STD[i])


def _leant(acceleration: Floats, share: float) -> Floats:
    """Acceleration where the lean that causes it is larger by `share` than estimated, north, east, up, shape (n, 3).

    An estimator that levels itself by its accelerometer takes a part of such a lean for level (Mahony et al. 2008,
    IEEE Trans. Autom. Control 53, on bias by acceleration). The rotors' force is the same, so what is pushed to the
    side is missing upward.
    """
    side = share * acceleration[:, :2]
    missing = np.sum(side * acceleration[:, :2], axis=1) / (GRAVITY_M_S2 + acceleration[:, 2])
    return np.column_stack([acceleration[:, :2] + side, acceleration[:, 2] - missing])


def predicted_with(model: Model, flight: Flight, nuisance: Floats, groups: Sequence[str]) -> Floats:
    """Predict the targets of one flight with its nuisance, shape (n, 3 * groups)."""
    predicted = {group: PREDICT[group](model, flight) for group in groups if group != "total"}
    if "turning" in predicted:
        predicted["turning"] = predicted["turning"] + nuisance[MOMENTS] * rotor_moments_n_m(flight)
    if "sensing" in predicted and is_captured(flight) and nuisance[CAPTURED].any():
        predicted["sensing"] = predicted["sensing"] + sensed_by_wrong_attitude(flight, nuisance)
    total = predict(model, disturbed(flight, nuisance))
    if not flight.tells_force:
        total = _leant(total, float(nuisance[LEVELLING]))
        # An estimator that averages its accelerometer over seconds is wrong by what lasts so long, whatever the model
        # says.
        total[:, :2] += nuisance[SLOW_LEVELLING] * flight.lasting_acceleration
    return np.column_stack([total, *predicted.values()])


def sensed_by_wrong_attitude(flight: Flight, nuisance: Floats) -> Floats:
    """Error of the accelerometer's acceleration that is turned into the world by an attitude with this error, north,
    east, up, m/s^2, shape (n, 3).

    Only an attitude that does not come from the accelerometer itself has it: an estimator that is levelled by a biased
    one reads no error in hover.
    """
    roll, pitch = (float(value) for value in nuisance[CAPTURED])
    north, east, up = flight.motion.T
    force = (north, east, -up - GRAVITY_M_S2)
    logged = flight.sampled_attitude
    read = rotate(logged, rotate_inverse(multiply(logged, quaternion_from_euler(roll, pitch, 0.0)), force))
    return np.column_stack([read[0] - force[0], read[1] - force[1], force[2] - read[2]])


def rotor_moments_n_m(flight: Flight) -> Floats:
    """Moment by which each moment's nuisance of 1 acts: roll, pitch, yaw, shape (n, 3)."""
    return np.asarray(np.outer(flight.load, moment_per_load(flight.vehicle)))


def moments_beyond_usual(flights: Sequence[Flight], nuisances: Floats) -> Floats:
    """Moments that the nuisances of the flights take beyond the bounds in `KINDS`, as a centre of mass that is off by
    millimetres does where the arms are short: roll, pitch, yaw, N m, shape (n, 3); `nuisances` has shape (flights,
    kinds)."""
    taken, usual = nuisances[:, MOMENTS], BOUND[MOMENTS]
    beyond = taken - np.clip(taken, -usual, usual)
    return np.concatenate([more * rotor_moments_n_m(flight) for flight, more in zip(flights, beyond, strict=True)])


def moment_per_load(vehicle: Vehicle) -> Floats:
    """Root of the summed squares of the moments of the rotors in hover, N m, roll, pitch, yaw, shape (3,)."""
    lever_m = np.linalg.norm([rotor.position_m[:2] for rotor in vehicle.rotors])
    arms_m = np.linalg.norm(vehicle.moment_arms_m, axis=0)
    arms_m[2] = np.hypot(arms_m[2], LEAN / 0.01 * lever_m)
    return np.asarray(arms_m * vehicle.weight_n / vehicle.n_rotors)
