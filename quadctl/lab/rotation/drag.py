"""Drag along the body axes, from the accelerometer."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from quadctl.effects.rotor_drag import FLOWN_M_S
from quadctl.frames import GRAVITY_M_S2
from quadctl.lab.arrays import Floats
from quadctl.lab.rotation.fits import HIGH_NOISE, LOW_NOISE, SETTLED_S, means
from quadctl.lab.rotation.innovations import (
    BLOCK_S,
    NOISE_NAMES,
    Estimated,
    Regression,
    earlier,
    estimate,
    first_order,
    force_filter,
    noise_of,
)
from quadctl.lab.rotation.records import Record
from quadctl.lab.rotation.value import Value

GUST_PUSHES_S = 0.12
"""Time until a gust shows in the accelerometer above its noise: by the velocity of this instant it would pass for a
weaker drag."""
DRAG_STEP_S = 0.04
"""Drag answers a velocity, which changes within tenths of seconds."""


def fit_drag(records: Sequence[Record], axis: int) -> Estimated:
    """Drag along body x (0) or y (1), 1/s, from the accelerometer: f = -d u + bias + slow force.

    Both are averaged over `DRAG_STEP_S`: the filter of a slow force raises what is quick, of a velocity its noise,
    which weakens the drag. So does its error: the velocity that the tilt gives a vehicle of this drag is an estimate of
    its own, and the interval reaches up to the drag that is right where all that the two differ by is an error of the
    measured one, or that has the error which estimators have (Frisch 1934: the regression weakens by the error's share
    of the variance).

    A force that follows the velocity late passes for more drag, by the instrument of earlier velocities: where the
    flights show that it does, f = -d u + m u' with m > 0, the interval reaches down to that drag, which gusts weaken.
    """
    flights = []
    for r in records:
        assert r.force is not None and r.airspeed is not None
        rows = max(round(DRAG_STEP_S / r.step_s), 1)
        speed = r.airspeed[:, axis]
        signals = (r.force[:, axis], np.ones(len(speed)), -speed, np.gradient(speed, r.step_s))
        flights.append((np.array([means(signal, rows) for signal in signals]), rows * r.step_s))

    def fitted(*linear: str) -> Estimated:
        def regress(x: Floats) -> list[Regression]:
            made = []
            for signals, step_s in flights:
                white = force_filter(noise_of(x), step_s).whitened(signals[: 2 + len(linear)])
                white = white[:, round(SETTLED_S / step_s) :]
                before = earlier(white[2:], round(GUST_PUSHES_S / step_s))
                made.append(Regression(white[0], white[2:], white[1:2], before))
            return made

        start, rows = np.array([-2.5, 0.7, 0.5, -1.0]), round(BLOCK_S / flights[0][1])
        return estimate(regress, start, (LOW_NOISE, HIGH_NOISE), np.ones(4), NOISE_NAMES, linear, rows)

    found, late = fitted("drag_1_s"), fitted("drag_1_s", "late")
    drag = found.values["drag_1_s"]
    share = _velocity_error(records, axis, found)
    high = drag.high / (1.0 - share) if drag.high > 0.0 and share < 1.0 else np.inf
    low = min(drag.low, late.values["drag_1_s"].low) if late.values["late"].low > 0.0 else drag.low
    return replace(found, values=found.values | {"drag_1_s": Value(drag.value, low, max(high, drag.high))})


def _velocity_error(records: Sequence[Record], axis: int, found: Estimated) -> float:
    """Largest share of the velocity's variance that is its error, as the drag's fit weighs it; 0 where the attitude is
    not known."""
    steady = noise_of([found.values[name].value for name in NOISE_NAMES])
    drag = max(found.values["drag_1_s"].value, 0.0)
    whole = wrong = estimated = 0.0
    for r in records:
        if r.down is None or r.airspeed is None:
            return 0.0
        estimated += (r.velocity_error_m_s**2 / float(np.var(r.airspeed[:, axis]))) / len(records)
        rows = max(round(DRAG_STEP_S / r.step_s), 1)
        step_s = rows * r.step_s
        # u' = g_x - d u + r v - q w, and v' = g_y - d v + p w - r u.
        u, v, w = r.airspeed.T
        p, q, yaw = r.rates.T
        turned = (yaw * v - q * w) if axis == 0 else (p * w - yaw * u)
        forcing = means(GRAVITY_M_S2 * r.down[:, axis] + turned, rows)
        speed = means(r.airspeed[:, axis], rows)
        own = first_order(forcing, drag, step_s)
        white = force_filter(steady, step_s).whitened(np.array([speed, own, np.ones(len(speed))]))
        speed, own, one = white[:, round(SETTLED_S / step_s) :]
        speed, own = (x - one * (one @ x) / (one @ one) for x in (speed, own))
        whole += float(speed @ speed)
        wrong += float((speed - own) @ (speed - own))
    return max(wrong / whole, estimated)


def flown(records: Sequence[Record], axis: int) -> bool:
    """True where the flights are fast enough along body x (0) or y (1) to tell what grows with the airspeed: an
    estimate of a slow velocity is mostly error."""
    speeds = [r.airspeed[:, axis] for r in records if r.airspeed is not None]
    return len(speeds) == len(records) and float(np.ptp(np.quantile(np.concatenate(speeds), (0.05, 0.95)))) > FLOWN_M_S
