"""The public benchmarks: their files as flights, and models that are fitted to some and judged on others."""

from pathlib import Path

import numpy as np
import polars as pl
import pytest

from quadctl.errors import QuadctlError
from quadctl.lab.rotation.records import Record
from quadctl.lab.rotation.regression import CHANGED, COMMANDED, Features
from quadctl.lab.rotation.rollout import Track
from quadctl.lab.rotation.rollout_errors import HORIZONS_S
from quadctl.lab.rotation.unseen import Flown
from quadctl.vehicle import load_vehicle
from studies.nanobench import nanodrone
from studies.nanobench.perceptron import fit_perceptrons
from studies.nanobench.rollouts import CORRECTED, FORECAST, HELD, NETWORK, RIDGE, Flight, judged, together
from studies.nanobench.tables import errors_table, times_table
from tests.lab.rotation.closed_loop import VEHICLE
from tests.lab.rotation.test_forecast import rolling

COLUMNS = "t x y z qx qy qz qw vx vy vz wx wy wz ax ay az m1_rads m2_rads m3_rads m4_rads Vbat"


class TestNanodrone:
    def test_its_files_are_flights_in_our_axes(self, tmp_path: Path) -> None:
        """East, north and up, and a body of front, left and up, that has turned left by 0.3 rad."""
        n, half = 1200, 0.15
        time_s = 0.01 * np.arange(n)
        speed = np.sin(time_s)
        columns = dict.fromkeys(COLUMNS.split(), np.zeros(n)) | {
            "t": time_s,
            "x": 2.0 - np.cos(time_s),
            "vx": speed,
            "z": np.full(n, 0.6),
            "qz": np.full(n, np.sin(half)),
            "qw": np.full(n, np.cos(half)),
            "wy": 0.2 * speed,
            "wz": 0.1 * speed,
            "az": np.full(n, 9.81),
            "Vbat": np.full(n, 3.9),
            "m1_rads": 1700.0 + 50.0 * speed,
            **{f"m{i}_rads": np.full(n, 1700.0) for i in (2, 3, 4)},
        }
        path = tmp_path / "melon_20251017_run1.csv"
        pl.DataFrame(columns).write_csv(path)
        (flight,) = nanodrone.flights_of(tmp_path, load_vehicle(nanodrone.VEHICLE))
        track, record = flight.flown.track, flight.flown.record
        at = round(3.0 / 0.01)
        assert flight.shape == "melon"
        np.testing.assert_allclose(track.position[at], [0.0, 2.0 - np.cos(3.0), -0.6], atol=1e-6)
        np.testing.assert_allclose(track.velocity[at], [0.0, np.sin(3.0), 0.0], atol=1e-6)
        np.testing.assert_allclose(track.rates[at], [0.0, -0.2 * np.sin(3.0), -0.1 * np.sin(3.0)], atol=1e-6)
        assert record.measured and record.force is not None
        np.testing.assert_allclose(record.force[at], [0.0, 0.0, -9.81], atol=1e-6)
        rpm = (1700.0 + 50.0 * np.sin(3.0)) * 30.0 / np.pi
        np.testing.assert_allclose(
            record.drive[at, :2], [1e-6 * rpm**2, 1e-6 * (1700.0 * 30.0 / np.pi) ** 2], rtol=1e-4
        )
        # The nose points north of east by 0.3 rad: forward and right of it.
        assert record.airspeed is not None
        np.testing.assert_allclose(
            record.airspeed[at, :2], np.sin(3.0) * np.array([np.cos(0.3), np.sin(0.3)]), atol=1e-6
        )

    def test_a_folder_without_flights_is_one_sentence(self, tmp_path: Path) -> None:
        with pytest.raises(QuadctlError, match=r"train: holds no flight, expected CSV files"):
            nanodrone.report(tmp_path)

    def test_thrust_by_its_coefficient_carries_its_mass_at_its_motor_speeds_in_hover(self) -> None:
        vehicle = load_vehicle(nanodrone.VEHICLE)
        rpm = np.array([1728.0, 1679.0, 1717.0, 1751.0]) * 30.0 / np.pi
        assert vehicle.rotor.thrust_n_per_rpm2 * np.sum(rpm**2) == pytest.approx(vehicle.weight_n, rel=0.02)


class TestFitPerceptrons:
    def test_what_is_bent_is_learned(self) -> None:
        random = np.random.default_rng(5)
        x = [random.normal(size=(400, 4)) for _ in range(8)]
        y = [np.repeat(np.abs(f[:, :1]) + f[:, 1:2], len(CHANGED), axis=1) for f in x]
        found = fit_perceptrons([Features(f, COMMANDED) for f in x[:6]], y[:6])
        missed = np.concatenate([found.predict(f) - c for f, c in zip(x[6:], y[6:], strict=True)])
        # The best that is straight leaves all of |x|, of standard deviation 0.6.
        assert np.std(missed) < 0.2


def flight(seed: int) -> Flight:
    track: Track = rolling(seed)
    record = Record(f"{seed}", track.step_s, track.rates, track.command, None, None, False, None)
    return Flight("made", Flown(record, track))


class TestJudged:
    def test_all_models_are_judged_on_each_flight_that_they_did_not_see(self) -> None:
        flights = [flight(seed) for seed in (1, 2, 3, 4)]
        parts = [judged(flights[:3], flights[3:], VEHICLE, HORIZONS_S[:3], 20)]
        found = together([*parts, *parts])
        errors = {name: np.array(of.errors) for name, of in found.items()}
        assert all(e.shape == (2, 3, 4) for e in errors.values())
        rotation_rates = {name: e[0, 2, 2:] for name, e in errors.items()}
        assert np.all(rotation_rates[RIDGE] < 0.5 * rotation_rates[HELD])
        assert np.all(rotation_rates[NETWORK] < 0.8 * rotation_rates[HELD])
        assert np.all(rotation_rates[CORRECTED] <= 1.05 * rotation_rates[FORECAST])
        assert len(errors_table(found, 2).splitlines()) == len(times_table(found).splitlines()) == 2 + len(found)
