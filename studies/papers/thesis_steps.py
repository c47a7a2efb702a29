"""Thesis, tables 2 and 3: what the compensators are worth in step responses, signed and absolute."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from quadctl.lab.tracking.metrics import MetricsTable, Window, metrics
from quadctl.logs.flight_log import FlightLog
from studies.page import table, with_deviation

PUBLISHED = {  # table 2: M_A and M_B, m s, means of three runs
    "NO_COMPENSATION": (1.441, 0.409),
    "CHEESEMAN": (1.36, 0.328),
    "HAYDEN": (1.301, 0.269),
    "SANCHEZ": (1.29, 0.258),
    "APPIUS": (1.12, 0.088),
    "HIGH_ALTITUDE": (1.032, 0.0),
}
REFERENCE = "HIGH_ALTITUDE"
RUNS = 2
"""Public, of three."""
WINDOW = Window(15.0, 44.04)
SETPOINT_M = 0.2

HEADINGS = (
    *("flight", "M_A printed", "M_A signed"),
    *("M_B printed", "M_B signed", "M_B absolute"),
)


SPEEDS = ("050", "125")
FORWARD = ("NO_COMPENSATION_V", "APPIUS_FWD_V")
FORWARD_STARTS_S = (20.0, 35.0, 50.0)
"""Nominal times before which a run along x begins; each has one step down in it."""
FORWARD_SETPOINTS_M = 0.1, 1.1
"""Low and high: the flights before the step stand at 1.2 and 2.2 m, and the high one settles at 1.1 m."""
ALIGNED_ABOVE_M = 0.6
"""A run is measured from where it comes down through this height above its setpoint, out of ground effect."""
FORWARD_WINDOW = Window(0.0, 6.0)
"""From there."""


def names() -> list[str]:
    """The logs of both tables."""
    steps = [f"{name}_0{run}" for name in PUBLISHED for run in range(1, RUNS + 1)]
    return steps + [f"{name}_{speed}" for name in (*FORWARD, f"{REFERENCE}_V") for speed in SPEEDS]


def table_2(logs: dict[str, FlightLog]) -> MetricsTable:
    """Metrics of the public step responses, in the order of `PUBLISHED`."""
    runs = {name: [logs[f"{name}_0{run}"] for run in range(1, RUNS + 1)] for name in PUBLISHED}
    high = runs.pop(REFERENCE)
    return metrics([log for flown in runs.values() for log in flown], high, window=WINDOW, setpoint_m=SETPOINT_M)


def table_3(logs: dict[str, FlightLog], name: str, speed: str) -> list[tuple[float, float]]:
    """M_B of each run along x, signed and absolute, m s, against the mean of the three runs of the high flight."""
    low, high = FORWARD_SETPOINTS_M
    flight, high_flight = logs[f"{name}_{speed}"], logs[f"{REFERENCE}_V_{speed}"]
    references = [descent(high_flight, start, high) for start in FORWARD_STARTS_S]
    found = []
    for start in FORWARD_STARTS_S:
        result = metrics(
            [descent(flight, start, low)],
            references,
            window=FORWARD_WINDOW,
            setpoint_m=low,
            reference_setpoint_m=high,
        ).flights[0]
        assert result.m_b_signed is not None and result.m_b_absolute is not None  # there is a reference
        found.append((result.m_b_signed, result.m_b_absolute))
    return found


def descent(log: FlightLog, start_s: float, setpoint_m: float) -> FlightLog:
    """The step down that follows `start_s`, its time from where it passes `ALIGNED_ABOVE_M` above the setpoint.

    The steps are triggered by the place, so that their times scatter by 0.1 s, and 0.1 s of a step of 1 m is 0.1 m s.
    """
    rows = log.updates("z_m")
    rows = rows[log.time_s[rows] > start_s]
    z = log["z_m"][rows]
    below = int(np.argmax(z < setpoint_m + ALIGNED_ABOVE_M))
    pair = slice(below - 1, below + 1)
    crossing = float(np.interp(-(setpoint_m + ALIGNED_ABOVE_M), -z[pair], log.time_s[rows][pair]))
    return since(log, crossing)


def since(log: FlightLog, start_s: float) -> FlightLog:
    """The height around the 10 s after `start_s`, which becomes time 0."""
    time = log.time_s - start_s
    kept = (time > -1.0) & (time < 11.0)
    return replace(log, columns={"time_s": time[kept], "z_m": log["z_m"][kept]}, phase=None)


def noise_floor(result: MetricsTable) -> float:
    """M_B absolute, m s, of the mean of two flights that the ground does nothing to.

    Told from how the reference flights differ: two runs lie half their difference from their mean, two means of two
    differ by sqrt(2) times that.
    """
    runs = [flight.m_b_absolute or 0.0 for flight in result.flights if flight.is_reference]
    return float(np.sqrt(2.0) * np.mean(runs))


def removed(values: dict[str, float], name: str = "APPIUS", without: str = "NO_COMPENSATION") -> float:
    """Share of the uncompensated error that a compensator took away."""
    return 1.0 - values[name] / values[without]


def section(logs: dict[str, FlightLog]) -> str:
    """The part of the page."""
    result = table_2(logs)
    groups = {name: result.group(name) for name in PUBLISHED}
    signed = {name: group.mean["m_b_signed"] or 0.0 for name, group in groups.items()}
    absolute = {name: group.m_b_absolute_of_mean or 0.0 for name, group in groups.items()}
    floor = noise_floor(result)
    rows = [_row_2(name, result) for name in PUBLISHED]
    return f"""## Thesis: table 2, step response from 1.2 m to 0.2 m

Integrals in m s over the nominal {WINDOW}; the reference of M_B is HIGH_ALTITUDE. The thesis gives means of three runs,
of which two are public: mean ± population standard deviation.

{table(HEADINGS, rows)}

- The printed numbers are reproduced **with the signed integral**, although the thesis defines an absolute one.
- Appius' compensator removes {removed(signed):.0%} of M_B by the signed integral (printed: 78.5 %), in which errors
  above and below the setpoint cancel, and {removed(absolute):.0%} by the absolute one; between flights
  without ground effect that is {floor:.2f} m s.

## Thesis: table 3, the same with forward speed

M_B alone, as the logs lack the reference; each run aligned where it passes 0.6 m above its setpoint, over
{FORWARD_WINDOW.to_s:.0f} s; means of three runs, the printed numbers not at hand. {_forward_words(logs)}
"""


def _row_2(name: str, result: MetricsTable) -> list[str]:
    m_a, m_b = PUBLISHED[name]
    runs = [flight for flight in result.flights if flight.group == name]
    return [
        name,
        f"{m_a:.3f}",
        with_deviation([run.m_a_signed for run in runs]),
        f"{m_b:.3f}",
        with_deviation([run.m_b_signed or 0.0 for run in runs]),
        with_deviation([run.m_b_absolute or 0.0 for run in runs]),
    ]


def _forward_words(logs: dict[str, FlightLog]) -> str:
    parts = []
    for speed in SPEEDS:
        means = [_means(table_3(logs, name, speed)) for name in FORWARD]
        (none_signed, none_absolute), (signed, absolute) = means
        parts.append(
            f"at {int(speed) / 100:.2f} m/s from {none_signed:.3f} to {signed:.3f} m s (signed) and from "
            f"{none_absolute:.3f} to {absolute:.3f} m s (absolute, {1.0 - absolute / none_absolute:.0%} less)"
        )
    return f"The compensator changes M_B {'; '.join(parts)}."


def _means(runs: Sequence[tuple[float, float]]) -> tuple[float, float]:
    return sum(run[0] for run in runs) / len(runs), sum(run[1] for run in runs) / len(runs)
