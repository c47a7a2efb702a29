"""Forecasts of simulated flights whose controller answers gusts that a forecast cannot know."""

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from quadctl.frames import GRAVITY_M_S2, quaternion_from_euler
from quadctl.lab.arrays import Floats
from quadctl.lab.rotation import unseen
from quadctl.lab.rotation.forecast import Forecast, fit_forecast
from quadctl.lab.rotation.innovations import Noise
from quadctl.lab.rotation.regression import fit_reference
from quadctl.lab.rotation.rollout import (
    Commands,
    Disturbance,
    Disturbances,
    Driven,
    Late,
    Physics,
    Track,
    commands_of,
    disturbance,
    errors,
    held,
    observe_force,
    roll_out,
    unexplained_rates,
)
from quadctl.model import Model
from quadctl.observer import AXES, Observer
from tests.lab.rotation.closed_loop import VEHICLE

STEP_S, HOVER = 0.01, 0.6
TRUTH = Physics((420.0, 400.0, 30.0), (1.7, 1.5, 1.0), (-9.0, 8.0), 1.3, (0.4, 0.4, 0.1))
PROMPT = Late(0.0, 0.001)
STEADY = Noise(0.03, 20.0, 3.0, 0.02)
OBSERVER = Observer(
    step_s=STEP_S,
    **{axis: {"quick": 1.0, "quick_s": 0.03, "slow": 3.0, "slow_s": 20.0, "sensor": 0.02} for axis in AXES},
)


def observe(track: Track, driven: Driven, physics: Physics) -> tuple[Disturbance, Disturbance]:
    """Moment and force, by the noise `STEADY`."""
    left = unexplained_rates(track, driven, physics)
    moment = disturbance(left, (STEADY,) * 3, physics.damping_1_s, track.step_s)
    return moment, observe_force(track, driven, physics, Disturbances((STEADY,) * 3, (STEADY,) * 3))


def rolling(seed: int, seconds: float = 24.0) -> Track:
    """A flight that rolls from side to side; a gusty moment turns it, and its controller holds against it."""
    random, n = np.random.default_rng(seed), round(seconds / STEP_S)
    reach = np.abs(np.array(VEHICLE.moment_arms_m)[:, 0]).mean()
    mix = np.array(VEHICLE.moment_arms_m)[:, 0] / reach
    angle = rate = speed = gust = trim = 0.0
    rows: list[tuple[float, ...]] = []
    command = np.empty((n, 4))
    for k in range(n):
        wanted = 0.35 * np.sin(1.9 * k * STEP_S + seed)
        trim += STEP_S * 20.0 * (wanted - angle)
        difference = (120.0 * (wanted - angle) - 16.0 * rate + 3.0 * trim) / TRUTH.slope[0]
        command[k] = HOVER * (1.0 + difference * mix)
        rows.append((angle, rate, speed))
        gust += -STEP_S * gust / 0.9 + 3.0 * np.sqrt(2.0 * STEP_S / 0.9) * random.standard_normal()
        turn = TRUTH.slope[0] * difference + TRUTH.airspeed[0] * speed - TRUTH.damping_1_s[0] * rate + gust
        speed += STEP_S * (GRAVITY_M_S2 * np.sin(angle) - TRUTH.drag_1_s[1] * speed)
        angle += STEP_S * rate
        rate += STEP_S * turn
    angle_, rate_, speed_ = np.array(rows).T
    still = np.zeros(n)
    velocity = np.column_stack([still, speed_ * np.cos(angle_), speed_ * np.sin(angle_)])
    position = STEP_S * np.cumsum(velocity, axis=0)
    attitude = np.stack(quaternion_from_euler(angle_, still, still), axis=1)
    rates = np.column_stack([rate_, still, still]) + 1e-3 * random.standard_normal((n, 3))
    return Track(f"{seed}", STEP_S, position, velocity, attitude, rates, command)


def commands(track: Track) -> Commands:
    return commands_of(track, HOVER, TRUTH.elasticity, VEHICLE)


@pytest.fixture(scope="module")
def forecast() -> Forecast:
    tracks = [rolling(seed) for seed in (1, 2, 3)]
    return fit_forecast(tracks, [commands(t) for t in tracks], TRUTH, (PROMPT,) * 3, OBSERVER)


class TestForecast:
    def test_an_unseen_flight_is_forecast_better_than_held_and_than_by_all_that_is_known(
        self, forecast: Forecast
    ) -> None:
        track = rolling(7)
        rows = np.arange(200, len(track.rates) - 60, 7)
        driven = commands(track).driven((PROMPT,) * 3, PROMPT)
        (known,) = roll_out(track, driven, TRUTH, observe(track, driven, TRUTH), rows, [50])
        (trusted,) = forecast.roll_out(track, commands(track), rows, [50])
        of_held = errors(held(track, rows, 50), track, rows + 50).mean(axis=0)
        of_known, of_trusted = (errors(end, track, rows + 50).mean(axis=0) for end in (known, trusted))
        # Rotation and rates.
        assert np.all(of_trusted[2:] < 0.8 * of_known[2:]), (of_trusted, of_known)
        assert np.all(of_trusted[2:] < 0.6 * of_held[2:]), (of_trusted, of_held)
        assert forecast.physics.slope[0] < TRUTH.slope[0]
        assert forecast.physics.damping_1_s[0] > TRUTH.damping_1_s[0]

    @pytest.mark.parametrize("seeds", [(1,), (1, 2, 3)], ids=["one flight", "three"])
    def test_the_reference_forecasts_an_unseen_flight_better_than_held(self, seeds: tuple[int, ...]) -> None:
        reference, track = fit_reference([rolling(seed) for seed in seeds], VEHICLE, [10, 50]), rolling(7)
        rows = np.arange(200, len(track.rates) - 60, 7)
        for k, end in zip([10, 50], reference.roll_out(track, rows, [10, 50]), strict=True):
            of_reference, of_held = (errors(e, track, rows + k).mean(axis=0) for e in (end, held(track, rows, k)))
            assert np.all(of_reference < 0.8 * of_held), (k, of_reference, of_held)

    def test_it_knows_nothing_of_the_state_after_its_start(self, forecast: Forecast) -> None:
        track, other = rolling(7), rolling(7)
        other.rates[901:] += 0.5
        other.velocity[901:] += 0.7
        rows = np.array([900, 950])
        (one,), (two,) = (forecast.roll_out(t, commands(t), rows, [40]) for t in (track, other))
        np.testing.assert_allclose(one.rates[0], two.rates[0])
        np.testing.assert_allclose(one.velocity[0], two.velocity[0])
        assert not np.allclose(one.rates[1], two.rates[1])


@pytest.mark.parametrize(
    ("held_out", "folds"), [(["c"], [("ab", "c")]), ([], [("b", "a"), ("a", "b")])], ids=["held out", "by turns"]
)
def test_flights_that_are_held_out_are_used_by_no_fit(
    held_out: list[str], folds: list[tuple[str, str]], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each flight stands for its name here, and its errors for those of its fit."""
    fits: list[str] = []
    tested: list[str] = []
    said: list[str] = []

    def know(flights: list[SimpleNamespace], _: Model) -> str:
        fits.append("".join(flight.track for flight in flights))
        return fits[-1]

    def in_blocks(track: str, known: str, reference: str) -> dict[str, list[Floats]]:
        assert track not in known and reference == known
        tested.append(track)
        of = {"held": 2.0, "model": 3.0, "forecast": 1.0, "reference": 0.5}
        return {name: [np.full((4, 4), value)] * 3 for name, value in of.items()}

    monkeypatch.setattr(unseen, "flown_of", lambda log, vehicle: SimpleNamespace(track=log))
    monkeypatch.setattr(unseen, "know", know)
    monkeypatch.setattr(unseen, "_in_blocks", in_blocks)
    monkeypatch.setattr(unseen, "_steps", lambda track: [])
    monkeypatch.setattr(unseen, "fit_reference", lambda tracks, vehicle, steps: "".join(tracks))
    logs: Any = ["a", "b"]
    found = unseen.forecast_unseen(logs, Model(VEHICLE), cast(Any, held_out), said.append)
    assert list(zip(fits, tested, strict=True)) == folds and len(said) == len(folds)
    assert (found.mean("held", 0, 0).value, found.mean("forecast", 3, 3).value) == (2.0, 1.0)
