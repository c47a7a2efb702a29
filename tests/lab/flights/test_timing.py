"""Specification of the timing of a log's channels: what a flight shows of it, and what it takes from the others."""

import dataclasses

import numpy as np
import pytest

from quadctl.effects.motor_lag import lagged
from quadctl.lab.finding import Kind
from quadctl.lab.fitting.fitter import Fitter
from quadctl.lab.fitting.nuisances import AGE, BOUND, PRIOR_STD, bounds, prior_std
from quadctl.lab.flights.dataset import load_dataset
from quadctl.lab.flights.flight import Estimate
from quadctl.lab.flights.timing import LEAST_STD_S, MOST_EARLY_S, ROTOR_PRIOR, _shrunk, comes_too_early, of_timing
from quadctl.lab.selection.diagnosis import diagnose
from quadctl.logs.flight_log import VELOCITY, FlightLog
from quadctl.model import Model
from tests.support.flights import obedient, swaying, with_late_rotors

LAG_S = 0.03


def with_late_velocity(log: FlightLog, lag_s: float = LAG_S) -> FlightLog:
    late = {name: np.interp(log.time_s - lag_s, log.time_s, log[name]) for name in VELOCITY}
    return dataclasses.replace(log, columns={**log.columns, **late})


def with_filtered_velocity(log: FlightLog, lag_s: float) -> FlightLog:
    """The same flight whose velocity has passed a first-order low-pass filter."""
    step_s = float(np.median(np.diff(log.time_s)))
    filtered = {name: lagged(log[name], step_s, lag_s) for name in VELOCITY}
    return dataclasses.replace(log, columns={**log.columns, **filtered})


def answering_noise(log: FlightLog, gain: float, random: np.random.Generator) -> FlightLog:
    """The same flight with bursts of motion along x, noise of the velocity, and a controller that answers the noise by
    an acceleration of `gain` times the error that it sees."""
    step = float(np.median(np.diff(log.time_s)))
    noise, answer = np.zeros_like(log.time_s), np.zeros_like(log.time_s)
    for i, kick in enumerate(random.standard_normal(len(noise) - 1)):
        noise[i + 1] = 0.9 * noise[i] + 0.03 * kick
        answer[i + 1] = answer[i] - step * gain * (noise[i] + answer[i])
    bursts = 0.3 * np.sin(2.0 * np.pi * 0.6 * log.time_s) * (np.sin(2.0 * np.pi * log.time_s / 20.0) > 0.0)
    flown = bursts + answer
    columns = {"x_m": np.cumsum(flown) * step, "vx_m_s": flown + noise}
    return dataclasses.replace(log, columns={**log.columns, **columns})


class TestVelocity:
    @pytest.mark.parametrize("lag_s", [LAG_S, 0.14])
    def test_its_lag_behind_the_position_is_found_and_taken_out(self, rigid: Model, lag_s: float) -> None:
        plain, late = (
            load_dataset([log], rigid.vehicle) for log in (obedient(rigid), with_late_velocity(obedient(rigid), lag_s))
        )
        assert late.flights[0].velocity_lag_s == pytest.approx(lag_s, abs=0.003)
        assert plain.flights[0].velocity_lag_s == pytest.approx(0.0, abs=0.003)
        up, expected = (data.measured[:-1, 2] for data in (late, plain))  # the last sample sees beyond the log
        assert up == pytest.approx(expected, abs=0.05 * float(np.std(expected)))

    @pytest.mark.parametrize("lag_s", [0.08, 0.14])
    def test_a_filter_is_told_from_a_delay_and_what_it_rounds_comes_back(self, rigid: Model, lag_s: float) -> None:
        flown = obedient(rigid)
        plain, late, filtered = (
            load_dataset([log], rigid.vehicle).flights[0]
            for log in (flown, with_late_velocity(flown, lag_s), with_filtered_velocity(flown, lag_s))
        )
        assert (plain.velocity_filtered, late.velocity_filtered, filtered.velocity_filtered) == (False, False, True)
        assert filtered.velocity_lag_s == pytest.approx(lag_s, abs=0.01)
        up, expected = filtered.measured[1:-1, 2], plain.measured[1:-1, 2]
        assert up == pytest.approx(expected, abs=0.1 * float(np.std(expected)))
        assert float(np.std(up)) == pytest.approx(float(np.std(expected)), rel=0.02)

    def test_the_interval_holds_it(self, rigid: Model) -> None:
        data = load_dataset([with_late_velocity(obedient(rigid))], rigid.vehicle)
        low, high = data.flights[0].timing.velocity.ci95
        assert low < LAG_S < high

    @pytest.mark.parametrize("lag_s", [0.0, LAG_S])
    def test_a_controller_that_answers_noise_of_the_velocity_makes_little_lag(self, rigid: Model, lag_s: float) -> None:
        """Least squares is off by 23 ms here."""
        still, lags = obedient(rigid, seconds=120.0), []
        small = {name: 0.01 * still[name] for name in ("z_m", "vz_m_s")}
        still = dataclasses.replace(still, columns={**still.columns, **small, "z_m": small["z_m"] - 1.0})
        for seed in range(6):
            log = with_late_velocity(answering_noise(still, 2.0, np.random.default_rng(seed)), lag_s)
            lags.append(load_dataset([log], rigid.vehicle).flights[0].velocity_lag_s)
        assert np.mean(lags) == pytest.approx(lag_s, abs=0.015)


class TestOfAllFlights:
    def test_what_a_flight_does_not_show_is_taken_from_the_others(self) -> None:
        shown = _shrunk([Estimate(0.03, 0.002), Estimate(0.2, 10.0)], Estimate(0.0, 0.02))
        assert shown.of_flights[1].value == pytest.approx(shown.common.value, abs=1e-4)
        assert shown.common.value == pytest.approx(0.03, abs=0.001)

    def test_it_is_as_uncertain_as_that_and_as_flights_differ(self) -> None:
        shown = _shrunk([Estimate(0.03, 0.012), Estimate(0.2, 10.0)], Estimate(0.0, 0.02))
        assert shown.common.std == pytest.approx((0.012**-2 + 0.02**-2) ** -0.5, rel=0.02)
        assert shown.of_flights[1].std == pytest.approx(np.hypot(shown.common.std, LEAST_STD_S), rel=0.01)

    def test_what_none_shows_is_the_prior(self) -> None:
        unseen = _shrunk([Estimate(0.2, 10.0)], Estimate(0.0, 0.02))
        assert unseen.common.value == pytest.approx(0.0, abs=1e-4)
        assert unseen.common.std == pytest.approx(0.02, rel=0.01)


class TestDelaysThatNoFlightShows:
    """A rotor signal that is late by t looks like a drag of t w^2 1/s, if the flight sways steadily at w rad/s."""

    def test_a_late_rotor_signal_is_no_drag(self, rigid: Model) -> None:
        data = load_dataset([swaying(rigid, late_s=0.06)], rigid.vehicle)
        assert data.flights[0].delay_std_s == pytest.approx(ROTOR_PRIOR.std, rel=0.1)
        found = diagnose(rigid, data)
        assert (found.verdict, found.missing, found.small) == ("none", [], [])

    def test_a_delay_has_the_prior_that_is_left_when_flights_have_told_of_it(self, rigid: Model) -> None:
        shown, unseen = (load_dataset([log], rigid.vehicle).flights[0] for log in (obedient(rigid), swaying(rigid)))
        assert prior_std(shown)[AGE] == pytest.approx(PRIOR_STD[AGE], rel=0.1)
        assert bounds(shown)[1][AGE] == BOUND[AGE]
        assert prior_std(unseen)[AGE] == pytest.approx(np.hypot(PRIOR_STD[AGE], ROTOR_PRIOR.std), rel=0.1)
        assert bounds(unseen)[1][AGE] == pytest.approx(2.0 * prior_std(unseen)[AGE])
        others = np.arange(len(PRIOR_STD)) != AGE
        assert np.array_equal(prior_std(unseen)[others], PRIOR_STD[others])


class TestSignalsThatComeBeforeTheirForce:
    def test_rotors_that_follow_them_late_leave_no_more_than_a_usual_delay_to_the_position(self, rigid: Model) -> None:
        late, lagging = (
            load_dataset([with_late_rotors(obedient(rigid), *s)], rigid.vehicle) for s in ((0.03,), (0.0, 0.07))
        )
        assert not comes_too_early(late.flights[0].timing)
        assert comes_too_early(lagging.flights[0].timing)
        assert lagging.flights[0].delay_s == -MOST_EARLY_S
        assert of_timing(late.flights[0].timing) == []
        (told,) = of_timing(lagging.flights[0].timing)
        assert told.kind is Kind.LATE_OR_LAGGING and told.facts["low_ms"] < 70.0 < told.facts["high_ms"]

    def test_a_position_that_is_later_than_usual_is_taken_for_what_it_is(self, rigid: Model) -> None:
        """A lag would round the quick changes, which a delay leaves as they are."""
        data = load_dataset([with_late_rotors(obedient(rigid), -0.1)], rigid.vehicle)
        assert data.flights[0].delay_s == pytest.approx(-0.1, abs=0.003)
        assert not comes_too_early(data.flights[0].timing)
        (told,) = of_timing(data.flights[0].timing)
        assert told.kind is Kind.LATE_POSITION and told.facts["delay_ms"] == pytest.approx(100.0, abs=3.0)
        assert 90.0 < told.facts["low_ms"] < 100.0 < told.facts["high_ms"]


def test_no_nuisance_delays_a_signal_earlier_than_positions_are_late(rigid: Model) -> None:
    """A signal that is earlier still has rotors that lag: no flight may take that for a delay of its own."""
    data = load_dataset([with_late_rotors(obedient(rigid), 0.0, 0.07)], rigid.vehicle).aligned_for(rigid)
    (flight,) = data.flights
    assert flight.delay_s == pytest.approx(-MOST_EARLY_S)
    fitted = Fitter(rigid, data).fit()
    assert fitted.nuisances[0, AGE] >= 0.0
