"""Parameters of autopilots for the errors of their barometer."""

import math
from collections.abc import Mapping
from typing import NamedTuple

from quadctl.effects.barometer import FADED_M, RUNS, AirspeedError, GroundError, ThrottleError
from quadctl.export.autopilot import SEA_LEVEL_DENSITY_KG_M3, Dialect, Lacking, Present, Row
from quadctl.export.estimate import Estimate
from quadctl.frames import GRAVITY_M_S2
from quadctl.sensor_model import FittedError, SensorModel
from quadctl.words import Fact, fact

MATTERS = 0.05
"""Half width of an interval about zero within which a coefficient is known to be of no matter."""
LONGEST_HOLD_S = 5.0
"""Longest time for which ArduPilot expects the effect of the ground after a lift-off."""
INDEPENDENT = 50.0
"""Independent readings that a standard deviation stands on: its wander makes neighbours alike."""
FLY = f"fly {RUNS}, and diagnose it"


class SensorDialect(NamedTuple):
    """Names of an autopilot's parameters for its barometer."""

    airspeed: Mapping[str, tuple[str, ...]]
    """Parameters of `barometer.airspeed` that each coefficient stands for."""
    limit: float
    """Largest coefficient that it takes."""
    switch: str
    """Parameter that is 1 where the coefficients are used; empty where none is theirs alone."""
    note: str
    """Further conditions of their use."""
    throttle: str
    """Pressure at full throttle, Pa; empty where it has none."""
    dead_band: str
    """Depth, m, of readings below the true height that are left out near the ground; empty where it has none."""
    dead_band_height: str
    """Height, m, up to which the effect of the ground is expected."""
    dead_band_time: str
    """Time, s, after lift-off for which it is expected whatever the estimated height; empty where there is none."""
    noise: str
    """Standard deviation of the barometer, m; empty where it is none of the sensor."""


BAROMETERS: dict[str, SensorDialect] = {
    "PX4": SensorDialect(
        airspeed={
            "EKF2_PCOEF_XP": ("forward",),
            "EKF2_PCOEF_XN": ("backward",),
            "EKF2_PCOEF_YP": ("right",),
            "EKF2_PCOEF_YN": ("left",),
            "EKF2_PCOEF_Z": ("up", "down"),
        },
        limit=0.5,
        switch="",
        note="used only while a wind is estimated: EKF2_DRAG_CTRL 1, with EKF2_BCOEF_X and _Y or EKF2_MCOEF of a model",
        throttle="",
        dead_band="EKF2_GND_EFF_DZ",
        dead_band_height="EKF2_GND_MAX_HGT",
        dead_band_time="",
        noise="EKF2_BARO_NOISE",
    ),
    # The names of the last two are against what they do: UP acts when the vehicle descends (Copter 4.7).
    "ArduPilot": SensorDialect(
        airspeed={
            "BARO1_WCF_FWD": ("forward",),
            "BARO1_WCF_BCK": ("backward",),
            "BARO1_WCF_RGT": ("right",),
            "BARO1_WCF_LFT": ("left",),
            "BARO1_WCF_UP": ("down",),
            "BARO1_WCF_DN": ("up",),
        },
        limit=1.0,
        switch="BARO1_WCF_ENABLE",
        note="",
        throttle="BARO1_THST_SCALE",
        dead_band="",
        dead_band_height="GNDEFF_ALT",
        dead_band_time="GNDEFF_TMO",  # at most 5 s (AP_GroundEffect.cpp)
        noise="",
    ),
}


def sensor_rows(model: SensorModel, dialect: Dialect, present: Present | None = None) -> list[Row]:
    """Parameters of the autopilot's barometer that the errors tell, and those that they do not, with the reason."""
    names = BAROMETERS[dialect.name]
    rows = [_airspeed(name, of, model, names) for name, of in names.airspeed.items()]
    if names.switch and any(row.estimate is not None for row in rows):
        rows.insert(0, Row(names.switch, "uses the coefficients", Estimate(1.0, 1.0, 1.0), logs=model.logs))
    if names.throttle:
        rows.append(_throttle(names.throttle, model))
    rows += _ground(names, model)
    if names.noise:
        rows.append(_noise(names.noise, model))
    return [_beside(row, present) for row in rows]


def needed(dialect: Dialect) -> tuple[str, ...]:
    """Parameters whose present values an export of sensors asks for."""
    names = BAROMETERS[dialect.name]
    of_ground = names.dead_band, names.dead_band_height, names.dead_band_time
    others = (names.switch, names.throttle, *of_ground, names.noise)
    return (*names.airspeed, *(name for name in others if name))


def _beside(row: Row, present: Present | None) -> Row:
    """The row with the value on the vehicle; not exported where the firmware does not have it."""
    if present is None:
        return row
    if row.name in present.values:
        return row._replace(present=present.values[row.name])
    if row.estimate is None:
        return row
    lacks = "this firmware does not have it" if present.is_whole else f"{present.source} does not hold it"
    return row._replace(estimate=None, lacking=lacks)


def _fitted(model: SensorModel, name: str) -> FittedError | Fact:
    """The error where it is missing; else the reason why nothing is exported."""
    one = model.of(name)
    if one is None:
        return fact(Lacking.NOT_SHOWN, error=name, flight=FLY)
    known = [f"{parameter} {low:.2g} to {high:.2g}" for parameter, (low, high) in one.ci95.items()]
    return one if one.missing else fact(Lacking.ZERO, error=name, intervals=", ".join(known))


def _airspeed(name: str, of: tuple[str, ...], model: SensorModel, names: SensorDialect) -> Row:
    row = Row(name, f"static pressure error over dynamic pressure, {' and '.join(of)}")
    one = model.of(AirspeedError.name)
    if one is None:
        return row._replace(lacking=f"these flights do not show {AirspeedError.name}: {FLY}")
    known = [_estimate(one, parameter) for parameter in of]
    if len(known) > 1 and max(found.low for found in known) > min(found.high for found in known):
        each = ", ".join(f"{n} {e.value:.3g} [{e.low:.3g}, {e.high:.3g}]" for n, e in zip(of, known, strict=True))
        return row._replace(lacking=f"one number for two that differ: {each}")
    found = _joined(known)
    if found.low <= 0.0 <= found.high:
        interval = f"not distinguished from zero ({found.low:.3g} to {found.high:.3g})"
        is_small = max(-found.low, found.high) < MATTERS
        return row._replace(lacking=interval if is_small else f"{interval}: {FLY}")
    if not one.missing:
        return row._replace(lacking=f"{found.value:.3g} [{found.low:.3g}, {found.high:.3g}], of no matter")
    if abs(found.value) > names.limit:
        return row._replace(
            lacking=f"it is {found.value:.3g}, but the firmware takes {-names.limit:g} to {names.limit:g}"
        )
    return row._replace(estimate=found, logs=model.logs, note=names.note)


def _estimate(one: FittedError, parameter: str) -> Estimate:
    low, high = one.ci95.get(parameter, (-math.inf, math.inf))
    return Estimate(one.error.values()[parameter], low, high)


def _joined(known: list[Estimate]) -> Estimate:
    """Mean of estimates of one quantity, weighted by their precision."""
    if len(known) == 1:
        return known[0]
    weights = [(found.high - found.low) ** -2 if math.isfinite(found.high - found.low) else 0.0 for found in known]
    total = sum(weights)
    if total == 0.0:
        return Estimate(0.0, -math.inf, math.inf)
    value = sum(weight * found.value for weight, found in zip(weights, known, strict=True)) / total
    half = 0.5 * total**-0.5
    return Estimate(value, value - half, value + half)


def _throttle(name: str, model: SensorModel) -> Row:
    row = Row(name, "pressure error at full throttle, Pa")
    one = _fitted(model, ThrottleError.name)
    if isinstance(one, Fact):
        return row._replace(lacking=str(one))
    if model.hover_throttle is None:
        return row._replace(lacking="the logs do not tell the throttle of hover")
    pascal_per_m = -SEA_LEVEL_DENSITY_KG_M3 * GRAVITY_M_S2 / model.hover_throttle
    found = _estimate(one, "in_hover_m")
    ends = sorted((pascal_per_m * found.low, pascal_per_m * found.high))
    return row._replace(estimate=Estimate(pascal_per_m * found.value, *ends), logs=model.logs)


def _ground(names: SensorDialect, model: SensorModel) -> list[Row]:
    """Dead-band, height and time of the ground's effect, where the autopilot has them."""
    rows = [Row(names.dead_band, "depth of the error at the ground, m")] if names.dead_band else []
    height = Row(names.dead_band_height, f"height above which less than {FADED_M:g} m of the ground's error is left, m")
    hold = [Row(names.dead_band_time, "time from lift-off to that height, s")] if names.dead_band_time else []
    one = _fitted(model, GroundError.name)
    if isinstance(one, Fact):
        return [row._replace(lacking=str(one)) for row in (*rows, height, *hold)]
    found, fade_m = _estimate(one, "at_ground_m"), one.error.values()["fade_m"]
    heights = [GroundError(error_m, fade_m).faded_at_m for error_m in found]
    up_to = height._replace(estimate=Estimate(heights[0], *sorted(heights[1:])), logs=model.logs)
    hold = [_hold(row, model) for row in hold]
    if found.value > 0.0 and rows:
        reads = (
            f"near the ground the barometer reads up to {found.value:.2g} m too high, and the dead-band is for too low"
        )
        return [rows[0]._replace(lacking=reads), height._replace(lacking=reads)]
    return [
        *(row._replace(estimate=Estimate(-found.value, -found.high, -found.low), logs=model.logs) for row in rows),
        up_to,
        *hold,
    ]


def _hold(row: Row, model: SensorModel) -> Row:
    if not model.near_ground_s:
        return row._replace(lacking="the logs do not tell how long the vehicle was near the ground after lift-off")
    shortest, longest = min(model.near_ground_s), max(model.near_ground_s)
    if longest > LONGEST_HOLD_S:
        longer = f"it took {longest:.1f} s, and the firmware waits for at most {LONGEST_HOLD_S:g} s: take off faster"
        return row._replace(lacking=longer)
    note = "the longest of these flights: a slower take-off needs more"
    return row._replace(estimate=Estimate(longest, shortest, longest), logs=model.logs, note=note)


def _noise(name: str, model: SensorModel) -> Row:
    row = Row(name, "standard deviation of the barometer's samples, m")
    if model.scatter_m is None:
        return row._replace(lacking="these flights do not tell the scatter of the samples")
    half = 1.96 / math.sqrt(2.0 * INDEPENDENT)
    ends = ((1.0 - half) * model.scatter_m, (1.0 + half) * model.scatter_m)
    note = "without the weather's drift over hours, for which the firmware's default leaves room"
    return row._replace(estimate=Estimate(model.scatter_m, *ends), logs=model.logs, note=note)
