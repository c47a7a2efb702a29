"""Commands of the rotors between their logged samples, and from an autopilot's torque setpoint.

A log holds every n-th command of a loop that answers each sample of the gyro, with its noise. What the loop does in
between is known as far as it answers the gyro, which is logged faster: a finite impulse response from the gyro to the
command is fitted to the logged commands, and only what it leaves is interpolated.

Where the outputs of the rotors are slower still, the setpoints of torque and thrust stand for them: the mixer, which is
linear, is fitted to the instants at which both are known.
"""

from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from quadctl.lab.arrays import Floats

REACH_S = 0.1
"""Time for which a command remembers the gyro, beside what changes slowly."""
PER_TAP = 20
"""Commands that are needed for each sample of the gyro in the impulse response."""
FOLLOWED = 0.98
"""Least share of the outputs' variance that the mixer explains."""
LEAST_PAIRS = 50
"""Instants that are needed at which setpoints and outputs are known."""
LEAST_OUTPUT, MOST_OUTPUT = 0.0, 1.0
MARGIN = 0.005
"""Distance from the ends of its range within which an output saturates."""


@dataclass(frozen=True, eq=False)
class Filled:
    """Commands on the clock of a gyro, shape (n, q), and what is unknown of the logged ones, shape (m, q): what neither
    their neighbours nor the gyro tell."""

    value: Floats
    logged: Floats
    unknown: Floats

    def unknown_share(self, weights: Floats) -> Floats:
        """Share of the variance that is unknown of combinations of the commands, by weights of shape (q, p)."""
        whole = np.var(self.logged @ weights, axis=0)
        return np.asarray(np.var(self.unknown @ weights, axis=0) / np.where(whole > 0.0, whole, 1.0))


def filled_in(clock_s: Floats, gyro: Floats | None, time_s: Floats, command: Floats) -> Filled:
    """The commands, shape (m, q), logged at `time_s`, on the clock of the gyro, shape (n, q).

    Each is interpolated, with the help of the gyro, where it is given on the clock, shape (n, 3), and predicts what is
    left of the second half of the commands better than the straight line between their neighbours does.
    """
    between = np.column_stack([np.interp(clock_s, time_s, column) for column in command.T])

    def beside(values: Floats, at_s: Floats) -> Floats:
        """Distance of each value from the straight line between its neighbours."""
        share = ((at_s[1:-1] - at_s[:-2]) / (at_s[2:] - at_s[:-2]))[:, None]
        return np.asarray(values[1:-1] - (1.0 - share) * values[:-2] - share * values[2:])

    straight = Filled(between, command, beside(command, time_s))
    if gyro is None:
        return straight
    reach = round(REACH_S / float(clock_s[1] - clock_s[0]))
    inside = np.searchsorted(clock_s, time_s + 1e-6) - 1
    kept = (inside >= reach) & (time_s <= clock_s[-1])
    at, time_s, command = inside[kept], time_s[kept], command[kept]
    if len(at) < PER_TAP * reach * gyro.shape[1] or reach < 2:
        return straight
    past = sliding_window_view(gyro, reach, axis=0).reshape(-1, reach * gyro.shape[1])
    first = reach - 1
    design, wanted = beside(past[at - first], time_s), beside(command, time_s)
    half = len(design) // 2
    tried = np.linalg.lstsq(design[:half], wanted[:half], rcond=None)[0]
    left = wanted[half:] - design[half:] @ tried
    helps = np.var(left, axis=0) < np.var(wanted[half:], axis=0)
    weights = np.linalg.lstsq(design, wanted, rcond=None)[0]
    answered = past @ np.where(helps, weights, 0.0)
    found = between
    for i, column in enumerate(command.T):
        rest = np.interp(clock_s[first:], time_s, column - answered[at - first, i])
        found[first:, i] = answered[:, i] + rest
    return Filled(found, command, np.where(helps, left, wanted[half:]))


@dataclass(frozen=True, eq=False)
class Mixer:
    """Linear map from the setpoints of torque and thrust to the outputs of k rotors."""

    weights: Floats
    """Shape (4, k)."""
    offset: Floats
    """Shape (k,)."""
    followed: float
    """Share of the outputs' variance that it explains, where none saturates."""
    scatter: float
    """Standard deviation of what it does not explain."""

    def outputs(self, setpoint: Floats) -> Floats:
        """Outputs, shape (n, k), of setpoints, shape (n, 4), beyond their range, too."""
        return np.asarray(setpoint @ self.weights + self.offset)


def fit_mixer(setpoint: Floats, output: Floats) -> Mixer | None:
    """The mixer by setpoints, shape (m, 4), and outputs, shape (m, k), of the same instants; None where these are few.

    Instants at which an output saturates, or which a first fit misses by far, are left out: there the mixer is not
    linear.
    """
    design = np.column_stack([setpoint, np.ones(len(setpoint))])
    kept = ~saturated(output)
    for _ in range(2):
        if np.count_nonzero(kept) < LEAST_PAIRS:
            return None
        weights = np.linalg.lstsq(design[kept], output[kept], rcond=None)[0]
        missed = np.abs(output - design @ weights).max(axis=1)
        kept &= missed <= 5.0 * np.median(missed[kept]) + 1e-6
    left = (output - design @ weights)[kept]
    share = 1.0 - float(np.mean(np.var(left, axis=0) / np.maximum(np.var(output[kept], axis=0), 1e-12)))
    return Mixer(np.array(weights[:-1], float), np.array(weights[-1], float), share, float(np.std(left)))


def saturated(output: Floats) -> NDArray[np.bool_]:
    """True where one of the outputs, shape (n, k), is at an end of its range, shape (n,)."""
    return np.asarray(np.any((output <= LEAST_OUTPUT + MARGIN) | (output >= MOST_OUTPUT - MARGIN), axis=1))
