"""Open-loop prediction as a specification: errors that can be worked out by hand."""

import dataclasses
import json
import math

import numpy as np
import pytest

from quadctl.effects.motor_lag import FirstOrderLag
from quadctl.effects.rotor_drag import LinearDrag
from quadctl.effects.thrust_scale import ConstantScale
from quadctl.frames import GRAVITY_M_S2
from quadctl.lab.comparison.comparison import compare
from quadctl.lab.comparison.open_loop import HORIZONS_S, open_loop
from quadctl.lab.fitting.bootstrap import Estimate, estimates
from quadctl.lab.flights.dataset import Dataset, load_dataset
from quadctl.logs.columns import rpm_columns
from quadctl.logs.flight_log import FlightLog
from quadctl.model import Model
from quadctl.vehicle import Vehicle
from tests.support.flights import obedient


def hover(vehicle: Vehicle, thrust_over_weight: float, forward_m_s: float = 0.0, seconds: float = 60.0) -> FlightLog:
    """Level flight at 1 m with a steady speed north; the logged rotor speeds belong to another thrust than the
    weight."""
    log = obedient(Model(vehicle), seconds)
    t = log.time_s
    random = np.random.default_rng(1)
    tremble = 1e-7 * random.standard_normal((5, len(t)))  # a channel that never changes is one that has failed
    rpm = math.sqrt(thrust_over_weight * vehicle.weight_n / vehicle.n_rotors / vehicle.rotor.thrust_n_per_rpm2)
    columns = {**log.columns, "z_m": 1.0 + tremble[0], "vz_m_s": tremble[1]}
    columns |= {"x_m": forward_m_s * t + tremble[2], "vx_m_s": forward_m_s + tremble[3]}
    columns |= dict.fromkeys(rpm_columns(vehicle.n_rotors), rpm + tremble[4])
    return dataclasses.replace(log, columns=columns)


def data(*logs: FlightLog, vehicle: Vehicle) -> Dataset:
    return load_dataset(logs, vehicle)


class TestByHand:
    def test_a_steady_error_of_the_acceleration_grows_with_time_and_its_square(self, raptor: Vehicle) -> None:
        """Rotor speeds for 2 % too much thrust: e = 0.02 g, velocity error e t, position error e t^2 / 2."""
        e = 0.02 * GRAVITY_M_S2
        for errors in open_loop(Model(raptor), data(hover(raptor, 1.02), vehicle=raptor)):
            t = errors.horizon_s
            assert errors.velocity["up"].rmse == pytest.approx(e * t, rel=1e-4)
            assert errors.position["up"].rmse == pytest.approx(0.5 * e * t * t, rel=1e-4)
            assert errors.position["total"].rmse == pytest.approx(errors.position["up"].rmse, rel=1e-4)
            assert errors.position["horizontal"].rmse < 1e-4
            assert errors.held_position["total"].rmse < 1e-4

    def test_drag_acts_on_the_predicted_velocity_not_on_the_logged_one(self, raptor: Vehicle) -> None:
        """Model with a drag that the flight does not have: v = v0 exp(-t/T) with T = 1 / d, and the position falls
        behind."""
        d, v0 = 0.6, 2.0
        model = Model(raptor).plus(LinearDrag(d_x=d, d_y=d))
        tau = 1.0 / d
        for errors in open_loop(model, data(hover(raptor, 1.0, v0), vehicle=raptor)):
            t = errors.horizon_s
            assert errors.velocity["north"].rmse == pytest.approx(v0 * (1.0 - math.exp(-t / tau)), rel=1e-3)
            behind = v0 * t - v0 * tau * (1.0 - math.exp(-t / tau))
            assert errors.position["north"].rmse == pytest.approx(behind, rel=1e-3)

    def test_a_model_that_the_flight_obeys_is_right_for_seconds(self, raptor: Vehicle) -> None:
        truth = Model(raptor).plus(ConstantScale(0.9))
        last = open_loop(truth, data(obedient(truth), vehicle=raptor))[-1]
        assert last.horizon_s == 5.0
        assert last.position["total"].rmse < 0.01 * last.held_position["total"].rmse

    def test_holding_the_velocity_is_off_by_what_it_changes(self, raptor: Vehicle) -> None:
        log = hover(raptor, 1.0)
        a = 0.3
        columns = {**log.columns, "vx_m_s": a * log.time_s, "x_m": 0.5 * a * log.time_s**2}
        for errors in open_loop(Model(raptor), data(dataclasses.replace(log, columns=columns), vehicle=raptor)):
            t = errors.horizon_s
            assert errors.held_velocity["north"].rmse == pytest.approx(a * t, rel=1e-3)
            assert errors.held_position["north"].rmse == pytest.approx(0.5 * a * t * t, rel=1e-3)

    def test_a_lag_of_the_motors_acts_along_the_log(self, raptor: Vehicle) -> None:
        """A motor lag changes nothing in steady flight, however many predictions run in parallel."""
        model = Model(raptor).plus(FirstOrderLag(0.2))
        errors = open_loop(model, data(hover(raptor, 1.02), vehicle=raptor))[0]
        assert errors.position["up"].rmse == pytest.approx(0.5 * 0.02 * GRAVITY_M_S2, rel=1e-4)


class TestStarts:
    def test_no_prediction_crosses_a_gap(self, raptor: Vehicle) -> None:
        """The vehicle is elsewhere after the gap: a prediction across it would be wrong by metres."""
        log = hover(raptor, 1.0)
        columns = {**log.columns, "x_m": log["x_m"] + 50.0 * (log.time_s > 31.0)}
        kept = (log.time_s < 30.0) | (log.time_s > 34.0)
        for errors in open_loop(
            Model(raptor), data(dataclasses.replace(log, columns=columns).rows(kept), vehicle=raptor)
        ):
            assert errors.position["north"].rmse < 0.01

    def test_noise_of_the_velocity_hardly_starts_a_prediction_wrong(self, raptor: Vehicle) -> None:
        noise = 0.05
        log = obedient(Model(raptor), 120.0, noise_m_s=noise)
        two = open_loop(Model(raptor), data(log, vehicle=raptor))[1]
        assert two.position["up"].rmse < 0.5 * noise * two.horizon_s

    def test_a_short_flight_has_only_short_horizons(self, raptor: Vehicle) -> None:
        """A flight of 4 s has no errors after 5 s."""
        log = hover(raptor, 1.0, seconds=30.0)
        pieces = np.floor(log.time_s / 5.0) % 2 == 0
        found = open_loop(Model(raptor), data(log.rows(pieces), vehicle=raptor))
        assert [errors.horizon_s for errors in found] == [1.0, 2.0]

    def test_flights_are_taken_together(self, raptor: Vehicle) -> None:
        both = data(hover(raptor, 1.02), dataclasses.replace(hover(raptor, 0.98), name="other.csv"), vehicle=raptor)
        one = data(hover(raptor, 1.02), vehicle=raptor)
        pair, single = open_loop(Model(raptor), both)[0], open_loop(Model(raptor), one)[0]
        assert pair.n_starts == 2 * single.n_starts
        assert pair.position["up"].rmse == pytest.approx(single.position["up"].rmse, rel=1e-3)


class TestUncertainty:
    def test_the_interval_holds_the_error_and_shrinks_with_more_data(self, raptor: Vehicle) -> None:
        width = []
        for seconds in (60.0, 600.0):
            log = obedient(Model(raptor), seconds, noise_m_s=0.1)
            error = open_loop(Model(raptor), data(log, vehicle=raptor))[0].position["total"]
            assert error.ci95 is not None
            assert error.ci95[0] < error.rmse < error.ci95[1]
            width.append(error.ci95[1] - error.ci95[0])
        assert width[1] < 0.6 * width[0]

    def test_samples_of_one_block_are_no_independent_witnesses(self) -> None:
        """The same squares in many blocks, and in few blocks of equal values: the latter give a wider interval."""
        squares = np.repeat(np.random.default_rng(2).chisquare(1, 40), 25)[:, None]
        (known,) = estimates(squares, np.arange(1000))
        (blocked,) = estimates(squares, np.repeat(np.arange(40), 25))
        assert known.ci95 is not None and blocked.ci95 is not None
        assert blocked.ci95[1] - blocked.ci95[0] > 3.0 * (known.ci95[1] - known.ci95[0])

    def test_too_few_blocks_have_no_interval(self) -> None:
        (error,) = estimates(np.full((30, 1), 4.0), np.repeat(np.arange(3), 10))
        assert (error.rmse, error.ci95) == (2.0, None)

    def test_it_reads_as_a_number_with_its_unit_and_interval(self) -> None:
        assert Estimate(0.31, (0.27, 0.352)).in_words("m") == "0.310 m [0.270, 0.352]"
        assert Estimate(math.inf, None).in_words("m") == "unbounded"
        assert Estimate(math.inf, None).to_dict() == {"rmse": None, "ci95": None}


class TestCompare:
    def test_it_says_how_far_off_a_simulation_would_be(self, raptor: Vehicle) -> None:
        result = compare(Model(raptor), data(hover(raptor, 1.02), vehicle=raptor))
        assert "A prediction over 2 s, not corrected by measurements, misses the position by 0.3923 m" in " ".join(
            str(result).split()
        )
        found = result.to_dict()["open_loop"]
        assert [entry["horizon_s"] for entry in found] == list(HORIZONS_S)
        assert found[1]["position_m"]["up"]["rmse"] == pytest.approx(0.02 * GRAVITY_M_S2 * 2.0, rel=1e-3)
        assert json.dumps(found, allow_nan=False)
