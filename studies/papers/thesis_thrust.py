"""Thesis, section 3.3: the thrust stand. Is one thrust coefficient enough, and what does hover make of it?"""

from typing import NamedTuple

import numpy as np

from quadctl.logs.flight_log import Floats
from quadctl.vehicle import Vehicle
from studies.page import table, with_interval

GRAM_N = 9.81e-3
THROTTLE = np.arange(0.15, 1.001, 0.05)
RPM = np.array(
    [
        *(2698.48, 3223.85, 3702.06, 4209.70, 4777.34, 5182.43, 5604.95, 6133.74, 6684.19),
        *(6926.21, 7391.07, 7881.86, 8349.40, 8527.63, 8841.98, 9283.28, 9549.62, 9897.33),
    ]
)
THRUST_N = GRAM_N * np.array(
    [73, 107, 145, 190, 246, 301, 358, 416, 485, 553, 624, 700, 768, 842, 920, 1014, 1090, 1175]
)
"""One motor at each throttle."""
PUBLISHED_K, PUBLISHED_SLOPE, PUBLISHED_OFFSET = 1.1382941e-7, 0.02394, 0.1644
DRAWS = 4000


class Stand(NamedTuple):
    """Fits to the points of a thrust stand."""

    k: float
    """T = k rpm^2, least squares through zero, N/rpm^2."""
    exponent: float
    """n of T = c rpm^n, least squares of the logarithms."""
    slope: float
    offset: float
    """throttle = slope * thrust of four motors + offset."""


def fit(throttle: Floats, rpm: Floats, thrust_n: Floats) -> Stand:
    """The four numbers from points of one motor, each of shape (n,)."""
    square = rpm**2
    k = float(thrust_n @ square / (square @ square))
    exponent = float(np.polyfit(np.log(rpm), np.log(thrust_n), 1)[0])
    slope, offset = np.polyfit(4.0 * thrust_n, throttle, 1)
    return Stand(k, exponent, float(slope), float(offset))


def bootstrap(draws: int = DRAWS, seed: int = 0) -> Floats:
    """Fits to resampled points, shape (draws, 4)."""
    random = np.random.default_rng(seed)
    picks = random.integers(0, len(RPM), (draws, len(RPM)))
    return np.array([fit(THROTTLE[i], RPM[i], THRUST_N[i]) for i in picks])


def thrust_at(rpm: float) -> float:
    """Thrust of one motor between the points of the stand, N."""
    return float(np.interp(rpm, RPM, THRUST_N))


def section(vehicle: Vehicle, hover_rpm: float | None) -> str:
    """The part of the page; `hover_rpm` is the root mean square rotor speed of a public hover, where there is one."""
    found = fit(THROTTLE, RPM, THRUST_N)
    low, high = np.percentile(bootstrap(), [2.5, 97.5], axis=0)
    rows = [
        ["k, N/rpm²", f"{PUBLISHED_K:.4e}", f"{found.k:.4e} [{low[0]:.3e}, {high[0]:.3e}]"],
        ["n of T = c rpmⁿ", "2 (assumed)", with_interval(found.exponent, low[1], high[1], 2)],
        ["throttle per newton (four motors)", f"{PUBLISHED_SLOPE}", with_interval(found.slope, low[2], high[2], 4)],
        ["throttle at no thrust", f"{PUBLISHED_OFFSET}", with_interval(found.offset, low[3], high[3], 3)],
    ]
    local = THRUST_N / RPM**2
    text = f"""## Thesis: thrust stand (section 3.3)

{table(["", "thesis", "from its 18 points"], rows)}

- A single k is an approximation: T/rpm² rises with speed from {local.min():.2e} to {local.max():.2e} N/rpm².
- The thesis' line of throttle over thrust is {PUBLISHED_SLOPE / found.slope - 1.0:.0%} steeper than least squares.
"""
    if hover_rpm is None:
        return text
    each = vehicle.weight_n / 4.0
    return (
        text
        + f"""- In the public HOVERING log, at {hover_rpm:.0f} rpm, k rpm² differs from the weight by
  {PUBLISHED_K * hover_rpm**2 / each - 1.0:+.0%}, and the stand's points by
  {thrust_at(hover_rpm) / each - 1.0:+.0%}. So every fit below needs a thrust scale.
"""
    )
