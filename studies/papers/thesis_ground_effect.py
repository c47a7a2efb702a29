"""Thesis, eq. 14 and 16: a exp(-b z) + c from the hover and the forward-speed log, choice by choice.

The thrust ratio of a hover is K = weight / (k rpm^2): what thrust the rotors must have given over what their speed
promises. Its c is 1 only where k, mass and reference thrust agree, so a / c and b are what fits can be compared by.
The thesis' script is flight_analysis/ground_effect_model.py in github.com/aurelappius/offboard; it names its logs
otherwise, so that they are HOVERING and FORWARD_SPEED is our reading.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import curve_fit
from scipy.signal import savgol_filter

from quadctl.effects.ground_effect import Exponential
from quadctl.effects.thrust_scale import ConstantScale
from quadctl.frames import GRAVITY_M_S2, rotate
from quadctl.lab.fitting.fitter import Fitter
from quadctl.lab.flights.dataset import Dataset
from quadctl.lab.flights.flight import Flight
from quadctl.lab.flights.preparation import prepare
from quadctl.lab.selection.addition import add
from quadctl.logs.columns import rpm_columns
from quadctl.logs.flight_log import FlightLog, Floats
from quadctl.model import Model
from quadctl.vehicle import Vehicle
from studies.page import save, table, with_interval

PUBLISHED = {"HOVERING": ("14", 0.114, 5.388, 1.028), "FORWARD_SPEED": ("16", 0.147, 4.368, 0.988)}
"""Equation, a, b (1/m), c; which log belongs to eq. 16 is our reading."""
CUT_ROWS = 2000, 1000
"""Rows that the thesis' script drops at either end."""
SMOOTHED_ROWS, SMOOTHED_ROTORS = 500, 3
"""Its Savitzky-Golay filter of order 3; the script smooths three of the four rotors."""
CONTACT_M = 0.10
"""Below this height the logged point of RAPTOR is within 5 cm of where it stands."""
OTHER_CUTS = ((1500, 1000), (2500, 1500), (3000, 1500))
BLOCK_S = 5.0
DRAWS = 1000
RATES = np.geomspace(1.0, 30.0, 800)
"""b in 1/m: for each, a and c are linear, so that the best of them is the fit."""


class Points(NamedTuple):
    """Thrust ratios over height, each array of shape (n,)."""

    z_m: Floats
    ratio: Floats
    block: NDArray[np.int64]
    """Number of the 5 s of flight that a point belongs to."""

    def where(self, kept: NDArray[np.bool_]) -> "Points":
        return Points(self.z_m[kept], self.ratio[kept], self.block[kept])


class Curve(NamedTuple):
    """a exp(-b z) + c, and 95 % intervals of a / c and b from resampled blocks."""

    a: float
    b: float
    c: float
    relative: tuple[float, float]
    rate: tuple[float, float]


def fit_exponential(points: Points, draws: int = DRAWS, seed: int = 0) -> Curve:
    """Least squares of a exp(-b z) + c; b is found on the grid `RATES`."""
    sums = _block_sums(points)
    a, b, c = _best(sums.sum(axis=0))
    random = np.random.default_rng(seed)
    found = np.array([_best(sums[random.integers(0, len(sums), len(sums))].sum(axis=0)) for _ in range(draws)])
    relative = np.percentile(found[:, 0] / found[:, 2], [2.5, 97.5])
    rate = np.percentile(found[:, 1], [2.5, 97.5])
    return Curve(a, b, c, (float(relative[0]), float(relative[1])), (float(rate[0]), float(rate[1])))


def _block_sums(points: Points) -> Floats:
    """Sums of 1, y, y^2 and, for every rate, e, e^2, e y over each block, shape (blocks, 6, rates)."""
    found = []
    for number in np.unique(points.block):
        mine = points.block == number
        y = points.ratio[mine][:, None]
        e = np.exp(-points.z_m[mine][:, None] * RATES)
        one = np.ones_like(e)
        found.append([np.sum(term, axis=0) for term in (one, one * y, one * y * y, e, e * e, e * y)])
    return np.array(found)


def _best(sums: Floats) -> tuple[float, float, float]:
    n, y, yy, e, ee, ey = sums
    a = (n * ey - e * y) / (n * ee - e * e)
    c = (y - a * e) / n
    left = yy - a * ey - c * y
    best = int(np.argmin(left))
    return float(a[best]), float(RATES[best]), float(c[best])


def _blocks(time_s: Floats) -> NDArray[np.int64]:
    return np.asarray((time_s - time_s[0]) // BLOCK_S, dtype=np.int64)


def of_rows(log: FlightLog, vehicle: Vehicle, *, smooth: bool, cut: tuple[int, int] = CUT_ROWS) -> Points:
    """Every row counts, held values and all, as in the thesis' script."""
    rpm = np.nan_to_num(np.column_stack([log[name] for name in rpm_columns(4)]))
    if smooth:
        for rotor in range(SMOOTHED_ROTORS):
            rpm[:, rotor] = savgol_filter(rpm[:, rotor], SMOOTHED_ROWS, 3)
    thrust = vehicle.rotor.thrust_n_per_rpm2 * (rpm**2).sum(axis=1)
    kept = slice(cut[0], len(log) - cut[1])
    points = Points(log["z_m"][kept], vehicle.weight_n / np.maximum(thrust[kept], 1.0), _blocks(log.time_s[kept]))
    return points.where(thrust[kept] > 0.5 * vehicle.weight_n)


def of_updates(log: FlightLog, vehicle: Vehicle) -> Points:
    """One point per update of the rotor speeds, the height interpolated between its own updates."""
    names = rpm_columns(4)
    rows, z_rows = log.updates(*names), log.updates("z_m")
    first, last = log.time_s[CUT_ROWS[0]], log.time_s[len(log) - CUT_ROWS[1]]
    rows = rows[(log.time_s[rows] > first) & (log.time_s[rows] < last)]
    thrust = vehicle.rotor.thrust_n_per_rpm2 * sum(log[name][rows] ** 2 for name in names)
    rows, thrust = rows[thrust > 0.5 * vehicle.weight_n], thrust[thrust > 0.5 * vehicle.weight_n]
    z = np.interp(log.time_s[rows], log.time_s[z_rows], log["z_m"][z_rows])
    return Points(z, vehicle.weight_n / thrust, _blocks(log.time_s[rows]))


def of_flight(flight: Flight, *, tilt: bool = True, acceleration: bool = True) -> Points:
    """Even clock, delay of the rotor speeds taken out, one filter over both sides of K = m (g + a) / (k rpm^2 cos)."""
    _, _, down = rotate(flight.conditions.attitude, (0.0, 0.0, -1.0))
    upward = -down if tilt else 1.0
    promised = flight.filtered(upward * sum(flight.nominal_n)) / flight.vehicle.mass_kg
    needed = GRAVITY_M_S2 + (flight.measured[:, 2] if acceleration else 0.0)
    return Points(flight.filtered(flight.conditions.height_m), needed / promised, flight.block)


def naive_error(points: Points) -> float:
    """Standard error of b when every point counts as independent, 1/m."""
    start = fit_exponential(points, draws=1)
    _, covariance = curve_fit(_exponential, points.z_m, points.ratio, p0=(start.a, start.b, start.c))
    return float(np.sqrt(covariance[1, 1]))


def _exponential(z_m: Floats, a: float, b: float, c: float) -> Floats:
    return np.asarray(a * np.exp(-b * z_m) + c)


class Choice(NamedTuple):
    """One way to the fit, and what came out."""

    name: str
    points: Points
    curve: Curve


def choices(log: FlightLog, vehicle: Vehicle, draws: int = DRAWS) -> list[Choice]:
    """From what the thesis' script does to what quadctl does, one change at a time."""
    flight = prepare(log, vehicle)
    kept = (flight.time_s > log.time_s[CUT_ROWS[0]]) & (flight.time_s < log.time_s[len(log) - CUT_ROWS[1]])
    whole = of_flight(flight)
    full = whole.where(kept)
    ways = (
        ("the thesis' script", of_rows(log, vehicle, smooth=True)),
        ("without smoothing", of_rows(log, vehicle, smooth=False)),
        ("one point for each update of the rotor speeds instead of every row", of_updates(log, vehicle)),
        ("delay taken out, 1 Hz filter", of_flight(flight, tilt=False, acceleration=False).where(kept)),
        ("as 4, and the tilt accounted for", of_flight(flight, acceleration=False).where(kept)),
        ("delay, tilt and vertical acceleration accounted for", full),
        (f"as 6, z > {CONTACT_M} m", full.where(full.z_m > CONTACT_M)),
        ("as 6, with take-off and landing", whole),
    )
    return [Choice(name, points, fit_exponential(points, draws)) for name, points in ways]


def joint_fit(log: FlightLog, vehicle: Vehicle) -> tuple[Curve, float, float]:
    """quadctl's own: a thrust scale and `ground_effect.exponential` with c = 1; held-out RMSE without and with, m/s^2.

    In the curve c is the thrust scale and a its multiple, so that it reads as the others do.
    """
    dataset = Dataset((prepare(log, vehicle),))
    base = Model(vehicle).plus(ConstantScale())
    added = add(Exponential, Fitter(base, dataset).fit().model, dataset)
    scale, ground = added.model.effects
    item = added.model.stack[-1].fitted
    assert item is not None  # what `add` has fitted says so
    c = next(iter(scale.values().values()))
    a, b = ground.values()["a"], ground.values()["b"]
    return Curve(a * c, b, c, item.ci95["a"], item.ci95["b"]), added.before["total"], added.after["total"]


SHOWN = (1, 6)
"""Numbers of the choices that the page shows."""


def section(logs: dict[str, FlightLog], vehicle: Vehicle) -> str:
    """The part of the page, for the logs of `PUBLISHED`."""
    rows = []
    panels = {name: choices(logs[name], vehicle) for name in PUBLISHED}
    joint = {name: joint_fit(logs[name], vehicle) for name in PUBLISHED}
    for name, (equation, a, b, c) in PUBLISHED.items():
        rows.append([f"**{name}**, printed as eq. {equation}", f"{a / c:.3f}", f"{b:.2f}", f"{c:.3f}"])
        rows += [_row(f"{number}. {panels[name][number - 1].name}", panels[name][number - 1].curve) for number in SHOWN]
        rows.append(_row("quadctl, c = 1", joint[name][0]))
    errors = "; ".join(f"{name} {before:.3f} -> {after:.3f} m/s²" for name, (_, before, after) in joint.items())
    hover, forward = panels["HOVERING"][0].curve, panels["FORWARD_SPEED"][0].curve
    cuts = [fit_exponential(of_rows(logs["HOVERING"], vehicle, smooth=True, cut=cut), draws=1).b for cut in OTHER_CUTS]
    naive = naive_error(panels["HOVERING"][0].points)
    return f"""## Thesis: eq. 14 and 16, T = a e^(-b z) + c

Intervals are from resampled blocks of 5 s. quadctl's own fit is `thrust_scale` with `ground_effect.exponential`.

{table(["from the public log", "a/c", "b, 1/m", "c"], rows)}

{_figure(panels)}

- **Eq. 14 is reproduced**: a/c {hover.a / hover.c:.3f} (printed {0.114 / 1.028:.3f}), b {hover.b:.2f} (printed 5.39).
  With 500 or 1000 rows more or fewer at the ends, b is {min(cuts):.1f} to {max(cuts):.1f}. The standard error of b is
  {naive:.2f} with independent rows, {(hover.rate[1] - hover.rate[0]) / 3.92:.1f} from blocks: rotor speeds were updated
  {len(panels["HOVERING"][2].points.z_m)} times.
- **Eq. 16 is reproduced approximately**: a/c {forward.a / forward.c:.3f}, b {forward.b:.2f} (printed
  {0.147 / 0.988:.3f}, 4.37). The flight is hardly ever below 0.17 m, so the curves agree only at the heights flown.
- **c is no ground effect** but a thrust scale. Held-out error without and with the ground effect: {errors}.
"""


def _row(name: str, curve: Curve) -> list[str]:
    a = with_interval(curve.a / curve.c, *curve.relative)
    b = with_interval(curve.b, *curve.rate, digits=1)
    return [name, a, b, f"{curve.c:.3f}"]


def _figure(panels: dict[str, list[Choice]]) -> str:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.0, 3.6), layout="constrained")
    for axes, (name, panel) in zip(figure.subplots(1, len(panels), sharey=True), panels.items(), strict=True):
        points, reference = panel[5].points, panel[5].curve
        axes.plot(points.z_m, points.ratio / reference.c, ".", color="0.75", markersize=3, label="flight, as in 6")
        z = np.linspace(0.06, 1.2, 200)
        for number in (1, 3, 6):
            curve = panel[number - 1].curve
            axes.plot(z, 1.0 + curve.a / curve.c * np.exp(-curve.b * z), label=f"choice {number}")
        _, a, b, c = PUBLISHED[name]
        axes.plot(z, 1.0 + a / c * np.exp(-b * z), "k--", label=f"printed, eq. {PUBLISHED[name][0]}")
        axes.set(title=name, xlabel="height z, m", xlim=(0.0, 1.2), ylim=(0.9, 1.2))
        axes.legend(fontsize="small")
        axes.grid(alpha=0.3)
    figure.axes[0].set_ylabel("thrust over that far from the ground")
    return save(figure, "ground-effect", "Thrust ratio over height in both logs, and the fits")
