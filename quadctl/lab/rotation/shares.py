"""Share of the thrust that each rotor gives, from the mean commands that balance the vehicle.

Of n rotors the balance of thrust and three moments leaves one set of thrusts where n is 4; of more rotors a controller
chooses one of many, and their commands tell the moments alone.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from quadctl.lab.arrays import Floats
from quadctl.lab.rotation.fits import block_means, half_interval
from quadctl.lab.rotation.innovations import Estimated
from quadctl.lab.rotation.records import Record
from quadctl.lab.rotation.thrust import ThrustMap
from quadctl.lab.rotation.value import Value
from quadctl.vehicle import Vehicle

WORST_CONDITION = 1e6
"""Condition number of the balance above which the thrusts that keep it are open."""


@dataclass(frozen=True)
class Shares:
    """Shares of the rotors, with a centre of mass in the middle and no wind; their mean is 1."""

    rotors: dict[int, Value]
    """By the numbers of the rotors, from 1."""
    yaw: Value
    """Moment about yaw that the mean commands would give rotors that are alike, over that of half of them: a centre of
    mass makes none."""

    @property
    def told(self) -> dict[int, Value]:
        """Those whose intervals leave out 1, but the nearest to it where all do: it follows from the others."""
        told = {number: share for number, share in self.rotors.items() if not share.low <= 1.0 <= share.high}
        if len(told) == len(self.rotors):
            del told[min(told, key=lambda number: abs(told[number].value - 1.0))]
        return told

    @property
    def turns(self) -> bool:
        """True where rotors that are not alike, and no centre of mass alone, explain the commands."""
        return bool(self.told) and not self.yaw.low <= 0.0 <= self.yaw.high

    def to_dict(self) -> dict[str, Any]:
        return {"rotors": {str(n): share.to_dict() for n, share in self.rotors.items()}, "yaw": self.yaw.to_dict()}


def fit_shares(
    records: Sequence[Record], vehicle: Vehicle, hover: float, thrust: ThrustMap, axes: Mapping[str, Estimated]
) -> Shares | None:
    """Shares of the rotors, `hover` being the mean command; None where thrust map or moments are not known, or the
    balance leaves the thrusts open.

    Each stands against the thrust that the balance asks of it, beside the moments that turn the vehicle and those of
    rates and airspeed.
    """
    e, arms, about = thrust.found, np.array(vehicle.moment_arms_m), [fit.values for fit in axes.values()]
    if e is None or len(arms) != 1 + len(about) or any(of["slope"].low <= 0.0 for of in about):
        return None
    balance = np.vstack([np.ones(len(arms)), (arms / np.abs(arms).mean(axis=0)).T]) / len(arms)
    if np.linalg.cond(balance) > WORST_CONDITION:
        return None
    signals = []
    for r in records:
        x = r.command(thrust.by_voltage) / hover
        given = ((2.0 - e.value) * x + (e.value - 1.0) * x**2) @ balance.T
        for i, of in enumerate(about):
            rest = np.gradient(r.rates[:, i], r.step_s) + of["damping_1_s"].value * r.rates[:, i]
            if r.airspeed is not None and "airspeed" in of:
                rest -= of["airspeed"].value * r.airspeed[:, 1 - i]
            given[:, 1 + i] -= e.value / of["slope"].value * rest
        signals.append(given)
    blocks = block_means(records, signals)
    alike = np.linalg.solve(balance, (blocks / blocks[:, :1]).T).T
    asked = np.linalg.solve(balance, np.eye(4)[0])
    share = asked / alike
    share /= share.mean(axis=1, keepdims=True)
    yaw = blocks[:, 3:] / blocks[:, :1]
    return Shares(
        {i + 1: _value(share[:, i : i + 1], 1.0, e) for i in range(len(arms))},
        _value(yaw, 0.0, e),
    )


def _value(blocks: Floats, neutral: float, e: Value) -> Value:
    """Mean of blocks, shape (blocks, 1), whose distance from the neutral value is in proportion to the elasticity."""
    mean = float(blocks.mean())
    by_map = (mean - neutral) * (e.high - e.low) / 2.0 / e.value
    half = float(np.hypot(half_interval(blocks)[0], by_map))
    return Value(mean, mean - half, mean + half)
