"""No log ends in a traceback on its way to a diagnosis: it is analysed, or refused with one sentence.

Flights are damaged at random in the ways of real records; the seed of each is in its name.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from quadctl.effects.ground_effect import Exponential
from quadctl.effects.rotor_drag import LinearDrag
from quadctl.errors import LogError
from quadctl.lab.comparison.comparison import compare
from quadctl.lab.flights.dataset import load_dataset
from quadctl.lab.selection.diagnosis import diagnose
from quadctl.logs.flight_log import FlightLog
from quadctl.logs.quality import quality
from quadctl.model import Model

Damage = Callable[[FlightLog, np.random.Generator], FlightLog]


def _stretch(log: FlightLog, random: np.random.Generator) -> slice:
    begin, end = np.sort(random.integers(0, len(log), 2))
    return slice(int(begin), int(end) + 1)


def _of_columns(change: Callable[[np.ndarray, np.random.Generator], np.ndarray]) -> Damage:
    def damage(log: FlightLog, random: np.random.Generator) -> FlightLog:
        names = [name for name in log.columns if name != "time_s"]
        chosen = random.choice(names, int(random.integers(1, 5)), replace=False)
        rows, columns = _stretch(log, random), dict(log.columns)
        for name in chosen:
            columns[name] = columns[name].copy()
            columns[name][rows] = change(columns[name][rows], random)
        return replace(log, columns=columns)

    return damage


DAMAGES: tuple[Damage, ...] = (
    _of_columns(lambda values, _: np.full_like(values, np.nan)),
    _of_columns(lambda values, _: np.zeros_like(values)),
    _of_columns(lambda values, _: np.full_like(values, values[0])),
    _of_columns(lambda values, random: values * 10.0 ** random.uniform(-6.0, 6.0)),
    _of_columns(lambda values, random: values + random.uniform(-1e4, 1e4)),
    _of_columns(lambda values, random: values + random.normal(0.0, 10.0 ** random.uniform(-4.0, 3.0), len(values))),
    _of_columns(lambda values, _: np.linspace(values[0], 1e5, len(values))),
    _of_columns(lambda values, _: np.round(values)),
    lambda log, random: log.rows(_stretch(log, random)),
    lambda log, random: log.rows(np.sort(random.choice(len(log), max(2, len(log) // 7), replace=False))),
    lambda log, random: replace(
        log, columns={n: v for n, v in log.columns.items() if n in ("time_s", "z_m") or random.random() > 0.15}
    ),
    lambda log, random: replace(
        log,
        columns={**log.columns, "time_s": log.time_s + random.uniform(0, 1e3) * (log.time_s > random.uniform(0, 60))},
    ),
    lambda log, random: replace(log, columns={**log.columns, "z_m": log["z_m"] + 10.0 ** random.uniform(0.0, 5.0)}),
    lambda log, random: replace(log, columns={**log.columns, "time_s": log.time_s * 10.0 ** random.uniform(-3.0, 3.0)}),
)


def damaged(log: FlightLog, seed: int) -> FlightLog:
    random = np.random.default_rng(seed)
    for _ in range(int(random.integers(1, 4))):
        if len(log) > 2:
            log = DAMAGES[int(random.integers(len(DAMAGES)))](log, random)
    return log


@pytest.mark.parametrize("seed", [*range(19), *range(20, 31)])  # 19 makes a log of 80 minutes
def test_a_damaged_log_is_judged_and_compared_or_refused(plain_runs: list[FlightLog], rigid: Model, seed: int) -> None:
    log = damaged(plain_runs[0], seed)
    report = quality(log)
    report.to_dict()
    assert all(report.notes) and all(report.obstacles)
    try:
        data = load_dataset([log], rigid.vehicle)
        found = compare(rigid, data)
    except LogError as error:
        assert "\n" not in str(error) and len(str(error)) < 1500
    else:
        assert np.isfinite(found.rmse["total"])
        found.to_dict()


@pytest.mark.long
@pytest.mark.parametrize("seed", range(100, 110))
def test_a_damaged_log_is_diagnosed_or_refused(plain_runs: list[FlightLog], rigid: Model, seed: int) -> None:
    try:
        data = load_dataset([damaged(plain_runs[0], seed)], rigid.vehicle)
    except LogError:
        return
    found = diagnose(rigid, data, [LinearDrag, Exponential])
    assert found.to_dict()["verdict"] in ("missing", "small", "none", "unexplained")


@pytest.mark.long
@pytest.mark.parametrize("height_m", [60.0, 900.0])
def test_a_flight_that_is_near_the_ground_for_seconds_only_is_diagnosed(
    plain_runs: list[FlightLog], rigid: Model, height_m: float
) -> None:
    """Terms that fade with height are constant, or too small for a number, in most folds."""
    log = plain_runs[0]
    rise = height_m / (1.0 + np.exp(-(log.time_s - 15.0) / 2.0))
    high = {"z_m": log["z_m"] + rise, "vz_m_s": log["vz_m_s"] + np.gradient(rise, log.time_s)}
    odd = {"vx_m_s": log["vx_m_s"] + 0.4 * np.sin(0.6 * log.time_s)}  # unexplained
    found = diagnose(rigid, load_dataset([replace(log, columns={**log.columns, **high, **odd})], rigid.vehicle))
    assert found.to_dict()["verdict"]
