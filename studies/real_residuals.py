"""Surrogate flights: real flights that are changed until a known model is true of them.

Noise, gaps and most of the motion stay those of the real flight. Attitude and rotor speeds (slowly), velocity and
position (quickly) are changed until the acceleration that a known model predicts misses the measured one by a given
residual. That residual is the one which the best model of another real flight leaves, from a random
time on and with random signs: as correlated as in reality, but of no variable of the flight. Whatever is found in a
surrogate of the rigid body is a false alarm; and intervals are compared with parameters that are known.

`python -m studies.real_residuals VEHICLE LOG...` writes docs/real-residuals.md.
"""

import argparse
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import cumulative_trapezoid
from scipy.ndimage import gaussian_filter1d

from quadctl.effects import Effect
from quadctl.effects.catalog import every_effect
from quadctl.effects.ground_effect import Exponential
from quadctl.effects.rotor_drag import LinearDrag
from quadctl.frames import GRAVITY_M_S2, euler_from_quaternion, multiply, quaternion_from_euler, rotate
from quadctl.lab.arrays import Floats
from quadctl.lab.fitting.fitted_model import fit_model
from quadctl.lab.flights.dataset import load_dataset
from quadctl.lab.selection.diagnosis import diagnose
from quadctl.lab.selection.discovery import discover
from quadctl.logs.columns import rpm_columns
from quadctl.logs.flight_log import ATTITUDE, POSITION, VELOCITY, FlightLog
from quadctl.logs.read import read_log
from quadctl.model import Model
from quadctl.vehicle import Vehicle, load_vehicle
from studies.page import DOCS, table

PAGE = DOCS / "real-residuals.md"
TRUTHS: tuple[Effect, ...] = (Exponential(a=0.2, b=4.0), LinearDrag(d_x=0.2, d_y=0.2))
LOW_P = 0.01
ITERATIONS = 4
"""Corrections of the inputs; each removes most of the difference that is left."""
CONTROLLED_S = 1.5
"""Standard deviation of the filter that tells disturbances against which the controller leans from those that move the
vehicle: a position loop of some 0.1 Hz."""


def surrogate(log: FlightLog, truth: Model, wanted: Floats, time_s: Floats) -> FlightLog:
    """Flight of `log` changed so that `truth` leaves the residual `wanted`, m/s^2, shape (n, 3), north, east, up, at
    the times `time_s`, shape (n,)."""
    made = log
    for _ in range(ITERATIONS):
        aligned = load_dataset([made], truth.vehicle).aligned_for(truth)
        (flight,) = aligned.flights
        asked = np.column_stack([np.interp(flight.time_s, time_s, w) for w in wanted.T])
        less = np.column_stack([np.interp(log.time_s, flight.time_s, x) for x in (aligned.residual(truth) - asked).T])
        slow = _slow(less, log.time_s)
        made = _moved(_pushed(made, truth.vehicle, slow), slow - less)
    return made


def _slow(signal: Floats, time_s: Floats) -> Floats:
    """Part of a signal, shape (n, 3), that a position controller counteracts."""
    rows = CONTROLLED_S / float(np.median(np.diff(time_s)))
    return np.asarray(gaussian_filter1d(signal, rows, axis=0, mode="nearest"))


def _moved(log: FlightLog, more: Floats) -> FlightLog:
    """Flight with the motion that an acceleration `more`, m/s^2, shape (n, 3), north, east, up, adds."""
    velocity = _integral(more, log.time_s)
    position = _integral(velocity, log.time_s)
    columns = dict(log.columns)
    for names, added in ((VELOCITY, velocity), (POSITION, position)):
        held = _last(log.updates(*names), len(log))
        columns |= {name: columns[name] + a[held] for name, a in zip(names, added.T, strict=True)}
    return replace(log, columns=columns)


def _integral(signal: Floats, time_s: Floats) -> Floats:
    """Integral over time of a signal, shape (n, 3), without its slow part."""
    integral = np.asarray(cumulative_trapezoid(signal, time_s, axis=0, initial=0))
    return integral - _slow(integral, time_s)


def _pushed(log: FlightLog, vehicle: Vehicle, more: Floats) -> FlightLog:
    """Flight whose inputs give the acceleration `more`, m/s^2, shape (n, 3), north, east, up, in addition."""
    attitude = quaternion_from_euler(*(np.radians(log[name]) for name in ATTITUDE))
    # The thrust of a vehicle near hover, N per kg.
    thrust = np.array(rotate(attitude, (0.0, 0.0, -GRAVITY_M_S2)))
    wanted = thrust + more.T * np.array([[1.0], [1.0], [-1.0]])
    size = np.linalg.norm(wanted, axis=0)
    turn = np.concatenate([[GRAVITY_M_S2 * size + np.sum(thrust * wanted, axis=0)], np.cross(thrust.T, wanted.T).T])
    w, x, y, z = turn / np.linalg.norm(turn, axis=0)
    angles = euler_from_quaternion(multiply((w, x, y, z), attitude))
    columns = dict(log.columns)
    columns |= {name: np.degrees(angle) for name, angle in zip(ATTITUDE, angles, strict=True)}
    for name in rpm_columns(vehicle.n_rotors):
        if log.has(name):
            columns[name] = columns[name] * np.sqrt(size / GRAVITY_M_S2)[_last(log.updates(name), len(log))]
    if log.has("throttle_cmd"):
        offset, held = vehicle.throttle.offset, _last(log.updates("throttle_cmd"), len(log))
        columns["throttle_cmd"] = offset + (columns["throttle_cmd"] - offset) * (size / GRAVITY_M_S2)[held]
    return replace(log, columns=columns)


def _last(updates: NDArray[np.intp], n: int) -> NDArray[np.intp]:
    """Row of the last update before each of `n` rows; the row itself before the first."""
    rows = np.zeros(n, dtype=np.intp)
    rows[updates] = updates
    return np.asarray(np.maximum.accumulate(rows), dtype=np.intp)


def best_residual(log: FlightLog, vehicle: Vehicle) -> tuple[Floats, Floats]:
    """Times of the samples of a flight, shape (n,), and the residual of the best model found for it, m/s^2, shape
    (n, 3), north, east, up."""
    dataset = load_dataset([log], vehicle)
    fit = fit_model(discover(Model(vehicle), dataset).model, dataset)
    residual: Floats = (fit.fitter.dataset.targets - fit.predicted)[:, :3]
    return dataset.flights[0].time_s, residual


def transplanted(source: tuple[Floats, Floats], time_s: Floats, random: np.random.Generator) -> Floats:
    """Residual of another flight from a random time on, there and back again, each axis with a random sign, shape
    (n, 3), at the times `time_s`, shape (n,)."""
    own_s, residual = source
    span = float(own_s[-1] - own_s[0])
    along = np.mod(time_s - time_s[0] + random.uniform(0.0, span), 2.0 * span)
    at = own_s[0] + np.where(along > span, 2.0 * span - along, along)
    moved = np.column_stack([np.interp(at, own_s, axis) for axis in residual.T])
    return np.asarray(moved * random.choice([-1.0, 1.0], 3))


@dataclass
class Nulls:
    """Count of what is found in surrogates of the rigid body."""

    flights: int = 0
    alarms: int = 0
    unexplained: int = 0
    low_p: int = 0
    """Surrogates in which some effect's p-value is below `LOW_P`."""


@dataclass
class Coverage:
    """Count of the 95 % intervals that hold the known value of a parameter."""

    held: int = 0
    fits: int = 0


def main() -> None:
    """Make surrogates of every log, and write the page with the counts."""
    parser = argparse.ArgumentParser(description="Count false alarms and coverage in surrogates of real flights.")
    parser.add_argument("vehicle", type=Path)
    parser.add_argument("logs", type=Path, nargs="+")
    parser.add_argument("--each", type=int, default=10, help="surrogates of each log")
    parser.add_argument("--page", type=Path, default=PAGE)
    arguments = parser.parse_args()
    vehicle = load_vehicle(arguments.vehicle)
    logs = {path.name: read_log(path) for path in arguments.logs}
    residuals = {name: best_residual(log, vehicle) for name, log in logs.items()}
    nulls, coverage = Nulls(), {name: Coverage() for name in (f.name for t in TRUTHS for f in t.parameters())}
    for number, (name, log) in enumerate(logs.items()):
        sources = [residual for other, residual in residuals.items() if other != name]
        time_s = residuals[name][0]
        for seed in range(arguments.each):
            random = np.random.default_rng([number, seed])
            wanted = transplanted(sources[random.integers(len(sources))], time_s, random)
            _count_alarms(nulls, surrogate(log, Model(vehicle), wanted, time_s), vehicle)
            for truth in TRUTHS:
                _count_held(coverage, log, Model(vehicle).plus(truth), wanted, time_s)
        print(name, nulls, coverage, flush=True)
    arguments.page.write_text(_page(list(logs), arguments.each, nulls, coverage))


def _count_alarms(nulls: Nulls, log: FlightLog, vehicle: Vehicle) -> None:
    kinds = [
        effect for effect in every_effect([]).values() if not (effect.affects_moment or effect.acts_by("sensed_m_s2"))
    ]
    found = diagnose(Model(vehicle), load_dataset([log], vehicle), kinds)
    nulls.flights += 1
    nulls.alarms += bool(found.missing)
    nulls.unexplained += found.verdict == "unexplained"
    nulls.low_p += any(candidate.p_value < LOW_P for candidate in found.ranking)


def _count_held(coverage: dict[str, Coverage], log: FlightLog, truth: Model, wanted: Floats, time_s: Floats) -> None:
    """Fit the last effect of `truth` to a surrogate in which it is true, where the flight can tell of it."""
    kind = type(truth.effects[-1])
    dataset = load_dataset([surrogate(log, truth, wanted, time_s)], truth.vehicle)
    if any(dataset.span(variable) < least for variable, least in kind.needs.items()):
        return
    fit = fit_model(Model(truth.vehicle).plus(kind()), dataset)
    for name, (low, high) in fit.ci95(0).items():
        if name in coverage and fit.determined(0):
            coverage[name].fits += 1
            coverage[name].held += low <= truth.effects[-1].values()[name] <= high


def _page(names: list[str], each: int, nulls: Nulls, coverage: dict[str, Coverage]) -> str:
    rows = [
        ("some printed p-value below 0.01", nulls.low_p, nulls.flights),
        ("an effect named missing", nulls.alarms, nulls.flights),
        ("verdict `unexplained`", nulls.unexplained, nulls.flights),
    ]
    rows += [(f"95 % interval of {name} holds the truth", c.held, c.fits) for name, c in coverage.items() if c.fits]
    shown = table(
        ["in surrogate flights", "result"], [(text, f"{n} of {of} = {n / of:.0%}") for text, n, of in rows], range(2)
    )
    truths = ", or ".join(
        f"{t.name} with " + ", ".join(f"{name} = {value:g}" for name, value in t.values().items()) for t in TRUTHS
    )
    return f"""# Residuals of real flights

Written by `python -m studies.real_residuals`. {each} surrogates of each of {len(names)} real flights: changed
until a known model is
true of them, with the residual that the best model of another of these flights leaves, so with noise as
correlated as in
reality. Nothing is hidden in the flights of the first three rows. The others contain {truths}.

{shown}
"""


if __name__ == "__main__":
    main()
