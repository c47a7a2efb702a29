"""Basis of docs/papers.md: fits that find known truths, and the published numbers where the logs are present."""

from pathlib import Path

import numpy as np
import pytest

from quadctl.logs.flight_log import FlightLog, Floats
from studies import page
from studies.papers import (
    dena,
    garofano,
    garofano_flight,
    thesis_ground_effect,
    thesis_sindy,
    thesis_steps,
    thesis_thrust,
)
from studies.papers.raptor import LOGS, log, raptor
from studies.papers.thesis_ground_effect import Points
from studies.papers.thesis_sindy import Data
from studies.papers.world import World

with_logs = pytest.mark.skipif(not LOGS.is_dir(), reason="the public RAPTOR logs are not here")


class TestPage:
    def test_a_table_has_a_rule_below_its_headings(self) -> None:
        assert page.table(["a", "b"], [["x", "1"]]) == "| a | b |\n| --- | ---: |\n| x | 1 |"

    def test_prose_is_wrapped_and_tables_are_not(self) -> None:
        item, row = "- " + "word " * 40, "| " + "cell | " * 40
        lines = page.wrapped(f"# Title\n\n{item}\n{item}\n\n{row}\n").splitlines()
        assert [line[:2] for line in lines] == ["# ", "", "- ", "  ", "- ", "  ", "", "| "]
        assert max(map(len, lines[:-1])) <= page.WIDTH

    def test_numbers_come_with_their_uncertainty(self) -> None:
        assert page.with_interval(1.0, 0.5, 2.0, digits=1) == "1.0 [0.5, 2.0]"
        assert page.with_deviation([1.0, 3.0], digits=1) == "2.0 ± 1.0", "of the population"


class TestThrustStand:
    def test_k_is_that_of_the_thesis(self) -> None:
        found = thesis_thrust.fit(thesis_thrust.THROTTLE, thesis_thrust.RPM, thesis_thrust.THRUST_N)
        assert found.k == pytest.approx(thesis_thrust.PUBLISHED_K, rel=1e-4)
        assert (found.slope, found.offset) == pytest.approx((0.0191, 0.158), abs=5e-4)

    def test_known_coefficients_come_back(self) -> None:
        rpm = np.linspace(3000.0, 9000.0, 10)
        thrust = 1e-7 * rpm**2
        found = thesis_thrust.fit(0.02 * 4.0 * thrust + 0.1, rpm, thrust)
        assert tuple(found) == pytest.approx((1e-7, 2.0, 0.02, 0.1))


def exponential(noise: float) -> Points:
    random = np.random.default_rng(1)
    z = random.uniform(0.1, 1.2, 2000)
    ratio = 0.86 * (1.0 + 0.11 * np.exp(-5.4 * z)) + noise * random.standard_normal(2000)
    return Points(z, ratio, np.arange(2000) // 20)


class TestGroundEffect:
    def test_a_known_exponential_comes_back(self) -> None:
        curve = thesis_ground_effect.fit_exponential(exponential(0.0), draws=20)
        assert curve.b == pytest.approx(5.4, rel=0.005), "to the step of the grid"
        assert (curve.a / curve.c, curve.c) == pytest.approx((0.11, 0.86), rel=0.01)

    def test_intervals_hold_the_truth(self) -> None:
        curve = thesis_ground_effect.fit_exponential(exponential(0.01))
        assert curve.relative[0] < 0.11 < curve.relative[1]
        assert curve.rate[0] < 5.4 < curve.rate[1]

    def test_independent_points_need_no_blocks(self) -> None:
        points = exponential(0.01)
        curve = thesis_ground_effect.fit_exponential(points)
        naive = thesis_ground_effect.naive_error(points)
        assert (curve.rate[1] - curve.rate[0]) / 3.92 == pytest.approx(naive, rel=0.3)

    @with_logs
    def test_eq_14_comes_out_of_the_hover_log(self) -> None:
        points = thesis_ground_effect.of_rows(log("HOVERING"), raptor(), smooth=True)
        curve = thesis_ground_effect.fit_exponential(points, draws=200)
        _, a, b, c = thesis_ground_effect.PUBLISHED["HOVERING"]
        assert curve.a / curve.c == pytest.approx(a / c, abs=0.003)
        assert curve.b == pytest.approx(b, abs=0.1)
        assert curve.rate[0] < b < curve.rate[1]


def sampled(ratio: Floats, z: Floats) -> Data:
    random = np.random.default_rng(3)
    features = np.column_stack([z, random.uniform(-0.5, 0.5, len(z)), random.uniform(0.0, 1.0, len(z))])
    return Data(features, ratio, np.arange(len(z)) // 10)


class TestSindy:
    def test_the_true_terms_are_found_and_no_others(self) -> None:
        pytest.importorskip("pysindy")
        random = np.random.default_rng(2)
        z = random.uniform(0.8, 8.0, 400)
        truth = 0.85 + 0.1 * np.exp(-0.5 * z)
        found = thesis_sindy.identify(sampled(truth + 0.002 * random.standard_normal(400), z), 0.12, draws=20)
        assert found.coefficients == pytest.approx({"1": 0.85, "e^(-z/2)": 0.1}, abs=0.003)
        assert found.frequency["e^(-z/2)"] > 0.9
        assert found.rmse["the sparse expression"][0] < 0.5 * found.rmse["a constant"][0]

    def test_of_equal_models_the_sparser_is_taken(self) -> None:
        scores = np.array([[1.00, 1.10], [0.98, 1.08], [1.00, 1.12], [2.0, 2.2]])
        assert thesis_sindy.sparsest(scores) == 2, "within one standard error (0.05) of the best, 1.03"


@with_logs
class TestTables:
    def test_table_2_comes_out_signed(self) -> None:
        logs = {name: log(name) for name in thesis_steps.names()}
        result = thesis_steps.table_2(logs)
        for name, (m_a, m_b) in thesis_steps.PUBLISHED.items():
            mean = result.group(name).mean
            assert mean["m_a_signed"] == pytest.approx(m_a, abs=0.03)
            assert mean["m_b_signed"] == pytest.approx(m_b, abs=0.04)

    @pytest.mark.parametrize("speed", thesis_steps.SPEEDS)
    def test_with_forward_speed_the_compensator_more_than_halves_m_b(self, speed: str) -> None:
        logs = {name: log(name) for name in thesis_steps.names() if name.endswith(f"V_{speed}")}
        none, with_it = (np.array(thesis_steps.table_3(logs, name, speed)) for name in thesis_steps.FORWARD)
        assert np.all(none.mean(axis=0) > 2.0 * with_it.mean(axis=0))


def test_a_descent_is_timed_from_where_it_passes_the_height() -> None:
    time = np.arange(0.0, 20.0, 0.1)
    z = np.where(time < 5.0, 1.2, np.maximum(1.2 - 0.5 * (time - 5.0), 0.1))  # passes 0.7 m at 6 s
    start = thesis_steps.descent(FlightLog("a.csv", None, {"time_s": time, "z_m": z}), 1.0, 0.1)
    assert np.interp(0.0, start.time_s, start["z_m"]) == pytest.approx(0.7, abs=0.01)


class TestDena:
    rivals = dena.Rivals.of(raptor())

    @pytest.mark.parametrize("spread", dena.SPREADS)
    def test_the_ranking_comes_out_without_noise(self, spread: float) -> None:
        outcome = dena.simulate(raptor(), self.rivals, spread, 0.0)
        assert (outcome.pm_best, outcome.whole_order) == (1.0, 1.0)
        assert outcome.rmse[dena.MODELS.index("PM")] < 1e-4

    def test_it_is_lost_in_much_noise(self) -> None:
        assert dena.simulate(raptor(), self.rivals, 0.1, 0.05, draws=40).pm_best < 0.5

    def test_names_are_in_order_only_where_the_fountain_is_weak(self) -> None:
        limit = dena.names_in_order_below(raptor(), self.rivals)
        assert 0.0 < limit < dena.K_B


class TestGarofano:
    def test_sections_meet_where_cant_and_dihedral_are_alike(self) -> None:
        for tilt in garofano.TILTS_DEG:
            assert all(abs(jump.size) < 0.002 for jump in garofano.jumps(tilt, tilt)[:2])

    def test_and_nowhere_else(self) -> None:
        for tilts in garofano.UNEQUAL:
            assert all(abs(jump.size) > 0.05 for jump in garofano.jumps(*tilts)[:2])

    @pytest.mark.long
    def test_table_iv_in_the_world_of_eq_9_its_own_compensator_reaches_a_fifth(self, tmp_path: Path) -> None:
        upright = garofano_flight.VEHICLES[0]
        world = World(tmp_path / "world", upright.config, f"ground_effect.{upright.formula}")
        none, own = (world.errors("garofano_cosine", word, [1]) for word in ("none", upright.formula))
        assert own.rmse[0] < 0.2 * none.rmse[0]
        assert own.largest[0] < 0.2 * none.largest[0]
