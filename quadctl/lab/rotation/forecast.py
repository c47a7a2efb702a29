"""Forecasts of the whole state from the past and from the commands to come.

The past is explained by the physics as estimated. A forecast trusts less: in closed loop the commands to come answer
disturbances that nobody knows yet, so it uses a share of the slope of the commands, of the moment by airspeed and of
the slow moment, and damps more. These shares, lags and the noise of the observer are no properties of the vehicle: they
are fitted to forecasts of flights under one controller, over several horizons at once.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from quadctl.lab.arrays import Floats
from quadctl.lab.rotation.innovations import NOISE_NAMES, noise_of
from quadctl.lab.rotation.rollout import (
    Commands,
    Disturbance,
    Disturbances,
    Driven,
    Late,
    Physics,
    State,
    Track,
    disturbance,
    errors_in_axes,
    observe_force,
    roll_out,
    state_at,
    unexplained_rates,
)
from quadctl.observer import Observer

AHEAD_S = (0.25, 0.5)
"""Horizons over which the forecasts are fitted."""
WINDOWS = 1000
"""Number of forecasts that the fit compares with the record, over all flights."""
SETTLED_S = 2.0
"""Time in which the observer forgets that it starts from nothing."""


@dataclass(frozen=True, eq=False)
class Forecast:
    """Physics that explains the past, and the share of it that a forecast trusts."""

    past: Physics
    """Moments as estimated, by which the slow moment is observed."""
    past_late: tuple[Late, ...]
    physics: Physics
    """Moments and forces of what is to come; its forces also observe the slow force."""
    late: Late
    thrust_late: Late
    noise: Disturbances
    lasting: tuple[float, float, float]
    """Share of the observed moment about each axis that lasts, as its noise fades."""

    def driven(self, commands: Commands) -> Driven:
        return commands.driven((self.late,) * 3, self.thrust_late)

    def seen(self, track: Track, commands: Commands) -> tuple[Disturbance, Disturbance]:
        """Moment and force that the forecast reckons with, at each sample, from it and those before."""
        before = unexplained_rates(track, commands.driven(self.past_late, self.thrust_late), self.past)
        return self._reckoned(before, track), observe_force(track, self.driven(commands), self.physics, self.noise)

    def _reckoned(self, before: Floats, track: Track) -> Disturbance:
        moment, lasting = (
            disturbance(before, self.noise.moment, self.past.damping_1_s, track.step_s),
            np.array(self.lasting),
        )
        return Disturbance(lasting * moment.quick, lasting * moment.slow, moment.noise)

    def roll_out(self, track: Track, commands: Commands, rows: NDArray[np.intp], steps: Sequence[int]) -> list[State]:
        """States after each of these numbers of steps, ascending, from windows that start at `rows`."""
        return roll_out(track, self.driven(commands), self.physics, self.seen(track, commands), rows, steps)


@dataclass(frozen=True)
class _Free:
    """A parameter that the fit varies from `start`, or in proportion to the estimate."""

    name: str
    start: float
    low: float
    high: float
    scale: float


TRUSTED = (
    _Free("share", 0.5, 0.0, 2.0, 0.2),
    _Free("airspeed", 0.6, -1.0, 2.0, 0.2),
    _Free("damping_1_s", 8.0, 0.0, 60.0, 2.0),
    _Free("yaw_share", 0.5, 0.0, 2.0, 0.2),
    _Free("yaw_lasting", 0.5, -1.0, 3.0, 0.3),
    _Free("yaw_damping_1_s", 4.0, 0.0, 60.0, 2.0),
    _Free("delay_s", 0.04, 0.0, 0.1, 0.01),
    _Free("lag_s", 0.04, 0.002, 0.3, 0.01),
    _Free("thrust_lag_s", 0.03, 0.002, 0.3, 0.02),
    _Free("elasticity", 1.0, 0.4, 2.0, 0.2),
    _Free("inflow_1_s", 0.5, -1.0, 3.0, 0.2),
)
"""Parameters that a forecast trusts: shares of roll and pitch in proportion to their estimates, those of yaw apart."""
NOISY = ("tilting", "turning", "across", "up")
"""The moments about roll and pitch, that about yaw, the forces along the ground and that along the vertical."""
LOWEST, HIGHEST = (-6.0, -1.5, -7.0, -12.0), (-0.2, 3.5, 4.0, 5.0)
"""Bounds of the noise's logarithms, as `noise_of` takes them."""


def fit_forecast(
    tracks: Sequence[Track],
    commands: Sequence[Commands],
    past: Physics,
    past_late: tuple[Late, ...],
    observer: Observer,
) -> Forecast:
    """Forecast that comes closest to these flights over several horizons at once, from the noise of an observer.

    Errors of position, velocity, rotation and rates count by their size over that of the first guess, and large ones in
    proportion, as a mean error counts them.
    """
    joined = _Joined(tracks, commands, past, past_late)
    start = _start(observer)
    free = [*TRUSTED, *(_Free(n, s, lo, hi, 1.0) for n, s, lo, hi in start)]
    scale = np.array([f.scale for f in free])

    def forecast(x: Floats) -> Forecast:
        return _forecast(dict(zip((f.name for f in free), x * scale, strict=True)), past, past_late)

    first = np.array([f.start for f in free]) / scale
    low, high = (np.array(b) / scale for b in ([f.low for f in free], [f.high for f in free]))
    typical = typical_size(joined.errors(forecast(first)))

    def missed(x: Floats) -> Floats:
        return compared(joined.errors(forecast(x)) / typical)

    steps = np.full(len(free), 1e-3)
    found = least_squares(missed, first, bounds=(low, high), diff_step=steps, ftol=1e-3, max_nfev=15)
    return forecast(found.x)


def typical_size(errors: Floats) -> Floats:
    """Median size of errors along three axes, shape (windows, horizons, 4, 3), over the windows."""
    return np.asarray(np.median(np.linalg.norm(errors, axis=3), axis=0)[None, :, :, None])


LARGEST = 1e3
"""Largest error over its typical size: that of a rollout that has no end state, too."""


def compared(relative: Floats) -> Floats:
    """Errors over their typical size, shape as there, of which the sum of squares grows in proportion to large ones."""
    relative = np.clip(np.nan_to_num(relative, nan=LARGEST), -LARGEST, LARGEST)
    size = np.sum(relative**2, axis=3, keepdims=True)
    weight = np.sqrt(2.0 * (np.sqrt(1.0 + size) - 1.0) / np.maximum(size, 1e-12))
    return np.asarray(relative * weight).ravel()


def _start(observer: Observer) -> list[tuple[str, float, float, float]]:
    """Name, start and bounds of the noise's logarithms, each for two axes where they are alike."""
    pairs = (("roll", "pitch"), ("yaw",), ("north", "east"), ("down",))
    rows = []
    for name, alike in zip(NOISY, pairs, strict=True):
        of = [getattr(observer, axis) for axis in alike]
        values = np.mean([np.log([n.quick_s, n.slow_s, n.slow / n.quick, n.sensor / n.quick]) for n in of], axis=0)
        for part, value, low, high in zip(NOISE_NAMES, values, LOWEST, HIGHEST, strict=True):
            rows.append((f"{name} {part}", float(np.clip(value, low + 0.1, high - 0.1)), low, high))
    return rows


def _forecast(x: dict[str, float], past: Physics, past_late: tuple[Late, ...]) -> Forecast:
    tilting, turning, across, up = (noise_of([x[f"{name} {part}"] for part in NOISE_NAMES]) for name in NOISY)
    roll, pitch, yaw = past.slope
    share, damping = x["share"], x["damping_1_s"]
    physics = Physics(
        (share * roll, share * pitch, x["yaw_share"] * yaw),
        (damping, damping, x["yaw_damping_1_s"]),
        (x["airspeed"] * past.airspeed[0], x["airspeed"] * past.airspeed[1]),
        x["elasticity"] * past.elasticity,
        (*past.drag_1_s[:2], x["inflow_1_s"]),
    )
    return Forecast(
        past,
        past_late,
        physics,
        Late(x["delay_s"], x["lag_s"]),
        Late(x["delay_s"], x["thrust_lag_s"]),
        Disturbances((tilting, tilting, turning), (across, across, up)),
        (share, share, x["yaw_lasting"]),
    )


class _Joined:
    """Flights as one, so that their windows are rolled out together; filters run on each flight alone."""

    def __init__(
        self, tracks: Sequence[Track], commands: Sequence[Commands], past: Physics, past_late: tuple[Late, ...]
    ) -> None:
        self._flights = list(zip(tracks, commands, strict=True))
        self._before = [unexplained_rates(t, c.driven(past_late, past_late[0]), past) for t, c in self._flights]
        step_s = tracks[0].step_s
        self._steps = [round(s / step_s) for s in AHEAD_S]
        lengths = [len(t.rates) for t in tracks]
        every = max(sum(lengths) // WINDOWS, 1)
        settled = round(SETTLED_S / step_s)
        firsts = np.cumsum([0, *lengths[:-1]])
        parts = [f + np.arange(settled, n - max(self._steps), every) for f, n in zip(firsts, lengths, strict=True)]
        self._rows = np.concatenate(parts)
        names = ("position", "velocity", "attitude", "rates", "command")
        self._track = Track("", step_s, *(np.concatenate([getattr(t, name) for t in tracks]) for name in names))
        self._true = [state_at(self._track, self._rows + k) for k in self._steps]

    def errors(self, forecast: Forecast) -> Floats:
        """Errors along three axes, shape (windows, horizons, 4, 3)."""
        driven = [forecast.driven(c) for _, c in self._flights]
        pairs = zip(self._flights, driven, strict=True)
        force = [observe_force(t, d, forecast.physics, forecast.noise) for (t, _), d in pairs]
        moment = [forecast._reckoned(b, t) for b, (t, _) in zip(self._before, self._flights, strict=True)]
        together = Driven(
            np.concatenate([d.differences for d in driven]),
            np.concatenate([d.mean for d in driven]),
            np.concatenate([d.square for d in driven]),
        )
        seen = _together(moment), _together(force)
        ends = roll_out(self._track, together, forecast.physics, seen, self._rows, self._steps)
        return np.stack([errors_in_axes(e, t) for e, t in zip(ends, self._true, strict=True)], axis=1)


def _together(parts: Sequence[Disturbance]) -> Disturbance:
    return Disturbance(
        np.concatenate([p.quick for p in parts]), np.concatenate([p.slow for p in parts]), parts[0].noise
    )
