"""Specification of the lab: the fit, what is called missing, and when nothing is."""

import dataclasses
import io
import math
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console
from scipy import stats
from scipy.signal import lfilter

from quadctl.effects.ground_effect import Exponential, Sanchez
from quadctl.effects.rotor_drag import LinearDrag
from quadctl.effects.rotor_interaction import FrontWake
from quadctl.effects.thrust_scale import ConstantScale
from quadctl.errors import SettingsError
from quadctl.lab.comparison.comparison import compare
from quadctl.lab.fitting.fitted_model import fit_model
from quadctl.lab.fitting.fitter import Fitter
from quadctl.lab.fitting.noise import CorrelatedNoise, autocovariance
from quadctl.lab.fitting.nuisances import BOUND
from quadctl.lab.fitting.parameters import intervals, values_of
from quadctl.lab.fitting.significance import difference_p_value, improvement_p_value
from quadctl.lab.flights.dataset import Dataset, load_dataset
from quadctl.lab.flights.prediction import rmse
from quadctl.lab.flights.preparation import BLOCK_S, prepare
from quadctl.lab.selection.addition import add
from quadctl.lab.selection.diagnosis import Diagnosis, diagnose
from quadctl.lab.selection.discovery import Discovery, discover
from quadctl.logs.flight_log import FlightLog
from quadctl.model import Model, load_model, save_model
from quadctl.vehicle import Vehicle
from quadctl.words import estimate
from tests.support.flights import obedient, simulated, to_and_fro


@pytest.fixture(scope="module")
def of_one_staircase(staircases: list[FlightLog], rigid: Model) -> Diagnosis:
    """Diagnosis of the first staircase alone."""
    return diagnose(rigid, load_dataset(staircases[:1], rigid.vehicle))


class TestStatistics:
    def test_the_variance_of_a_sum_of_white_noise_is_the_sum_of_the_variances(self, rigid: Model) -> None:
        data = load_dataset([obedient(rigid, 300.0)], rigid.vehicle)
        n = len(data.measured)
        white = np.random.default_rng(1).standard_normal(n)
        assert CorrelatedNoise(white, data).variance_of_sum(np.full(n, 1.0 / n)) == pytest.approx(1.0 / n, rel=0.5)

    def test_correlated_noise_makes_a_mean_less_certain(self, rigid: Model) -> None:
        data = load_dataset([obedient(rigid, 300.0)], rigid.vehicle)
        noise = _correlated(len(data.measured), 0.8, 1)
        n = len(noise)
        # Variance of the mean of an AR(1) process: var / n (1 + rho) / (1 - rho) = 9 var / n for rho = 0.8
        ratio = CorrelatedNoise(noise, data).variance_of_sum(np.full(n, 1.0 / n)) / (noise.var() / n)
        assert 4.0 < ratio < 14.0

    def test_autocovariance_at_lag_zero_is_the_variance(self, rigid: Model) -> None:
        data = load_dataset([obedient(rigid)], rigid.vehicle)
        noise = _correlated(len(data.measured), 0.5, 2)
        assert autocovariance(noise, data)[0][0] == pytest.approx(noise.var())

    def test_an_irrelevant_change_is_rarely_significant(self, rigid: Model) -> None:
        """The p-value of candidates that have nothing to do with correlated noise is about uniform."""
        data = load_dataset([obedient(rigid, 200.0)], rigid.vehicle)
        n = len(data.measured)
        p = []
        for seed in range(200):
            before = np.column_stack([_correlated(n, 0.7, 10 * seed + axis) for axis in range(3)])
            change = 0.1 * np.column_stack([_correlated(n, 0.9, 10 * seed + 5 + axis) for axis in range(3)])
            data.targets[:, :3] = before + _motion(n, 10 * seed + 8, 30.0)
            p.append(improvement_p_value(before, change, data))
        assert 0.01 < np.mean(np.array(p) < 0.05) < 0.11  # 5 % expected, 10 +- 3 of 200
        assert 0.4 < np.mean(p) < 0.6

    def test_a_relevant_change_is_significant(self, rigid: Model) -> None:
        data = load_dataset([obedient(rigid, 200.0)], rigid.vehicle)
        n = len(data.measured)
        signal = np.column_stack([np.zeros(n), np.zeros(n), 0.3 * _correlated(n, 0.9, 3)])
        noise = np.column_stack([_correlated(n, 0.7, axis) for axis in range(3)])
        data.targets[:, :3] = noise + signal + _motion(n, 8)
        assert improvement_p_value(noise + signal, signal, data) < 1e-3

    @pytest.mark.parametrize(("wrong", "significant"), [(0.0, False), (0.2, True)])
    def test_a_gain_is_wrong_only_by_more_than_noise_of_its_input_makes_it_seem(
        self, rigid: Model, wrong: float, significant: bool
    ) -> None:
        """Noise of an attitude or a rotor speed is in the prediction, and with the opposite sign in the residual."""
        data = load_dataset([obedient(rigid, 200.0)], rigid.vehicle)
        n = len(data.measured)
        motion = _motion(n, 8)
        noise = np.column_stack([_correlated(n, 0.7, axis) for axis in range(3)])
        logged = motion + noise
        data.targets[:, :3] = (1.0 - wrong) * motion
        before = data.targets[:, :3] - logged
        gain = np.sum(data.targets[:, :3] * logged) / np.sum(logged**2)  # as a regression finds it
        assert (improvement_p_value(before, (gain - 1.0) * logged, data) < 1e-3) is significant

    @pytest.mark.parametrize(("bursts", "significant"), [(1, False), (12, True)])
    def test_what_explains_one_burst_of_noise_has_been_seen_once(
        self, rigid: Model, bursts: int, significant: bool
    ) -> None:
        data = load_dataset([obedient(rigid, 200.0)], rigid.vehicle)
        n = len(data.measured)
        change = np.zeros((n, 3))
        for i in range(bursts):
            begin = round((i + 0.5) * n / bursts)
            change[begin : begin + 8, 2] = 8.0
        before = 0.7 * change + np.column_stack([_correlated(n, 0.7, axis) for axis in range(3)])
        data.targets[:, :3] = before + _motion(n, 8, 30.0)
        assert (improvement_p_value(before, change, data) < 1e-3) is significant

    def test_two_equal_candidates_cannot_be_told_apart(self, rigid: Model) -> None:
        data = load_dataset([obedient(rigid, 200.0)], rigid.vehicle)
        noise = np.random.default_rng(4).standard_normal((len(data.measured), 3))
        assert difference_p_value(noise, noise[:, [1, 0, 2]], data) > 0.05
        assert difference_p_value(noise, 1.5 * noise, data) < 1e-6

    def test_the_difference_is_judged_by_the_t_test_of_blocks(self, rigid: Model) -> None:
        data = load_dataset([obedient(rigid, 60.0)], rigid.vehicle)
        random = np.random.default_rng(5)
        one, other = (random.standard_normal((len(data.measured), 3)) for _ in range(2))
        gain = ((other**2 - one**2) / np.mean(one**2, axis=0)).sum(axis=1)
        per_block = [gain[data.block == block].sum() for block in np.unique(data.block)]
        expected = stats.ttest_1samp(per_block, 0.0).pvalue
        assert difference_p_value(one, other, data) == pytest.approx(expected, rel=1e-9)

    def test_blocks_of_time_are_the_folds_and_flights_when_asked(self, rigid: Model) -> None:
        logs = [obedient(rigid, name=f"{i}.csv") for i in range(2)]
        blocks = load_dataset(logs, rigid.vehicle)
        for flight, fold in zip(blocks.flights, np.split(blocks.fold, 2), strict=True):
            starts = flight.time_s[np.flatnonzero(np.diff(fold))]
            assert np.all(np.diff(starts) == pytest.approx(BLOCK_S, abs=0.2))
        flights = load_dataset(logs, rigid.vehicle, "flights")
        assert flights.folds == [0, 1]
        assert np.array_equal(flights.fold, flights.flight_index)


def test_very_many_flights_share_the_folds(rigid: Model) -> None:
    (flight,) = load_dataset([obedient(rigid, 20.0)], rigid.vehicle).flights
    data = Dataset((flight,) * 23, "flights")
    assert len(data.folds) == 10
    assert all(len(np.unique(data.fold[part])) == 1 for part in data.parts)


class TestFit:
    def test_the_parameters_of_an_obedient_flight_are_found(self, raptor: Vehicle) -> None:
        truth = Model(raptor).plus(ConstantScale(0.93)).plus(Exponential(a=0.3, b=6.0))
        data = load_dataset([obedient(truth, 120.0)], raptor)
        fitted = Fitter(Model(raptor).plus(ConstantScale()).plus(Exponential()), data).fit().model
        assert fitted.effects[0].values()["factor"] == pytest.approx(0.93, abs=1e-3)
        assert fitted.effects[1].values()["a"] == pytest.approx(0.3, rel=0.02)
        assert fitted.effects[1].values()["b"] == pytest.approx(6.0, rel=0.02)

    def test_an_outlier_does_not_move_the_fit(self, raptor: Vehicle) -> None:
        truth = Model(raptor).plus(ConstantScale(0.93))
        data = load_dataset([obedient(truth, noise_m_s=0.005)], raptor)
        data.measured[100:103, 2] += 30.0
        fitted = Fitter(Model(raptor).plus(ConstantScale()), data).fit().model
        assert fitted.effects[0].values()["factor"] == pytest.approx(0.93, abs=3e-3)

    def test_a_fit_sees_only_what_it_may(self, raptor: Vehicle) -> None:
        """Held-out samples may have any value: the fit to the others does not change."""
        truth = Model(raptor).plus(ConstantScale(0.93))
        data = load_dataset([obedient(truth, noise_m_s=0.005)], raptor)
        fitter = Fitter(Model(raptor).plus(ConstantScale()), data)
        held = data.fold == 2
        clean = fitter.fit(~held).model.effects[0].values()["factor"]
        data.measured[held] += 5.0
        assert fitter.fit(~held).model.effects[0].values()["factor"] == pytest.approx(clean, abs=1e-9)

    @pytest.mark.long
    def test_intervals_hold_the_truth_about_as_often_as_they_say(self, raptor: Vehicle) -> None:
        truth = Model(raptor).plus(ConstantScale(0.95))
        form = Model(raptor).plus(ConstantScale())
        inside = 0
        for seed in range(40):
            data = load_dataset([obedient(truth, 60.0, noise_m_s=0.02, seed=seed)], raptor)
            fitter = Fitter(form, data)
            fitted = fitter.fit()
            ((low, high),) = intervals(fitter.free, values_of(fitted.model, fitter.free), fitter.bootstrap(fitted))
            inside += low <= 0.95 <= high
        assert 33 <= inside <= 40  # 38 expected; below 33 has a probability under 1 %

    def test_what_the_data_do_not_see_is_called_undetermined(self, raptor: Vehicle) -> None:
        data = load_dataset([obedient(Model(raptor), noise_m_s=0.005)], raptor)
        result = add(Exponential, Model(raptor), data)
        b = result.model.stack[0].fitted
        assert b is not None
        low, high = b.ci95["b"]
        assert high - low > 40.0
        assert any("b is not determined" in remark for remark in result.remarks)

    @pytest.mark.parametrize(("noise_m_s", "seed"), [(0.01, 0), (0.03, 1)])
    def test_a_wake_in_which_nothing_is_lost_is_not_determined(
        self, raptor: Vehicle, noise_m_s: float, seed: int
    ) -> None:
        """Its narrow interval holds 0, which is no wake at all."""
        runs = to_and_fro(obedient(Model(raptor), 60.0, noise_m_s=noise_m_s, seed=seed), 2.0)
        fit = fit_model(Model(raptor).plus(FrontWake()), load_dataset([runs], raptor))
        (low, high) = fit.ci95(0)["loss"]
        assert low <= 1e-6 and high < 0.01
        assert not fit.determined(0)


class TestCompare:
    def test_it_says_where_the_model_fails(self, staircases: list[FlightLog], rigid: Model) -> None:
        result = compare(rigid, load_dataset(staircases, rigid.vehicle))
        ranges = [f for f in result.fails_where if f.variable == "height_over_radius" and f.axis == "up"]
        assert ranges
        assert ranges[0].low < 1.5 and ranges[0].high < 4.0 and ranges[0].mean_residual > 0.3
        assert (ranges[0].kind, ranges[1].kind) == ("dependence", "range")
        assert ranges[0].extremes[0][1] > 0.0
        assert ranges[1].mean_residual > 0.0

    def test_the_noise_floor_lies_below_the_error_and_near_what_the_true_form_leaves(
        self, staircases: list[FlightLog], rigid: Model
    ) -> None:
        data = load_dataset(staircases, rigid.vehicle)
        result = compare(rigid, data)
        best = compare(add(Exponential, rigid, data).model, data)
        assert result.noise_floor["total"] < 0.3 * result.rmse["total"]
        assert result.noise_floor["total"] == pytest.approx(best.rmse["total"], rel=0.1)

    def test_a_true_model_fails_nowhere(self, plain_runs: list[FlightLog], rigid: Model) -> None:
        result = compare(rigid, load_dataset(plain_runs[:1], rigid.vehicle))
        assert [f for f in result.fails_where if abs(f.mean_residual) > 0.15] == []

    def test_total_is_the_root_of_the_sum_of_squares(self) -> None:
        errors = rmse(np.array([[3.0, 0.0, 4.0], [-3.0, 0.0, 4.0]]))
        assert errors == {"north": 3.0, "east": 0.0, "up": 4.0, "total": 5.0}


class TestDiagnose:
    @pytest.mark.long
    def test_a_hidden_ground_effect_of_another_form_is_found_alone(
        self, staircases: list[FlightLog], rigid: Model
    ) -> None:
        result = diagnose(rigid, load_dataset(staircases, rigid.vehicle, "flights"))
        assert result.verdict == "missing"
        assert result.missing == ["ground_effect"]
        first = result.ranking[0]
        assert first.family == "ground_effect"
        assert first.held_out_drop > 0.5 and first.p_value < 1e-6

    def test_without_an_effect_nothing_is_missing(self, nothing: Diagnosis) -> None:
        assert (nothing.verdict, nothing.missing) == ("none", [])

    @pytest.mark.long
    def test_two_effects_are_found_and_nothing_else(self, tmp_path: Path, rigid: Model) -> None:
        hidden = [("rotor_drag.linear", {"d_x": 0.3, "d_y": 0.25}), ("thrust_scale.constant", {"factor": 0.93})]
        logs = [simulated(mission, hidden, 5, tmp_path) for mission in ("forward_runs", "vertical_runs")]
        result = diagnose(rigid, load_dataset(logs, rigid.vehicle))
        assert result.missing == ["thrust_scale", "rotor_drag"]
        drag = result.best.effects[1]
        assert isinstance(drag, LinearDrag)
        assert drag.d_x == pytest.approx(0.3, rel=0.05)
        assert drag.d_y == pytest.approx(0.25, rel=0.05)

    def test_an_effect_that_the_model_holds_is_not_missing(self, staircases: list[FlightLog], rigid: Model) -> None:
        data = load_dataset(staircases[:1], rigid.vehicle)
        complete = add(Exponential, rigid, data).model
        assert "ground_effect" not in diagnose(complete, data).missing

    def test_something_that_no_effect_explains_is_unexplained(self, raptor: Vehicle) -> None:
        data = load_dataset([obedient(Model(raptor), 120.0, noise_m_s=0.002)], raptor)
        data.targets[:, 0] += 0.5 * np.sin(0.2 * data.flights[0].time_s)  # a push to the north that comes and goes
        result = diagnose(Model(raptor), data)
        assert (result.verdict, result.missing) == ("unexplained", [])

    def test_the_result_is_what_the_contract_says(self, of_one_staircase: Diagnosis) -> None:
        found = of_one_staircase.to_dict()
        assert {"verdict", "ranking", "missing", "confounded", "suggested_mission", "symbolic"} <= found.keys()
        assert {
            "family",
            "effect",
            "parameters",
            "ci95",
            "rmse_before",
            "rmse_after",
            "held_out_drop",
            "p_value",
            "text",
        } <= found["ranking"][0].keys()
        entry = found["ranking"][0]
        assert entry["held_out_drop"] == pytest.approx(1.0 - entry["rmse_after"] / entry["rmse_before"])


class TestAdd:
    def test_the_error_falls_on_a_flight_that_no_fit_has_seen(self, staircases: list[FlightLog], rigid: Model) -> None:
        seen, unseen = load_dataset(staircases[:1], rigid.vehicle), load_dataset(staircases[1:], rigid.vehicle)
        model = add(Exponential, rigid, seen).model
        assert compare(model, unseen).rmse["total"] < 0.3 * compare(rigid, unseen).rmse["total"]

    def test_the_saved_model_tells_where_it_comes_from(
        self, staircases: list[FlightLog], raptor_path: Path, tmp_path: Path
    ) -> None:
        model = load_model(raptor_path)
        data = load_dataset(staircases[:1], model.vehicle)
        result = add(Sanchez, model, data)
        save_model(result.model, tmp_path / "new.yaml")
        fitted = load_model(tmp_path / "new.yaml").stack[0].fitted
        assert fitted is not None
        assert fitted.held_out and fitted.logs == (staircases[0].name,)
        assert fitted.rmse_after == pytest.approx(result.after["total"])
        low, high = fitted.ci95["k_b"]
        assert low < result.model.effects[0].values()["k_b"] < high
        assert fitted.height_m is not None and fitted.height_m[0] < 0.2 and fitted.height_m[1] > 0.8

    def test_a_family_is_added_once(self, staircases: list[FlightLog], rigid: Model) -> None:
        data = load_dataset(staircases[:1], rigid.vehicle)
        with pytest.raises(SettingsError, match="holds a ground_effect already"):
            add(Sanchez, rigid.plus(Exponential()), data)

    def test_earlier_effects_are_refitted_with_the_new_one(self, raptor: Vehicle) -> None:
        truth = Model(raptor).plus(ConstantScale(0.93)).plus(Exponential(a=0.3, b=6.0))
        data = load_dataset([obedient(truth, 120.0, noise_m_s=0.005)], raptor)
        alone = add(ConstantScale, Model(raptor), data).model
        both = add(Exponential, alone, data).model
        assert abs(alone.effects[0].values()["factor"] - 0.93) > 5e-3
        assert both.effects[0].values()["factor"] == pytest.approx(0.93, abs=3e-3)


def _motion(n: int, seed: int, size: float = 3.0) -> np.ndarray:
    """Accelerations of a flight of standard deviation `size`, shape (n, 3)."""
    return size * np.column_stack([_correlated(n, 0.9, seed + axis) for axis in range(3)])


def _correlated(n: int, rho: float, seed: int) -> np.ndarray:
    """An AR(1) process of unit variance."""
    steps = np.random.default_rng(seed).standard_normal(n) * math.sqrt(1.0 - rho * rho)
    values, _ = lfilter([1.0], [1.0, -rho], steps, zi=[rho * steps[0] / math.sqrt(1.0 - rho * rho)])
    return np.asarray(values)


def test_a_dataset_knows_the_heights_it_covers(rigid: Model) -> None:
    low, high = Dataset((prepare(obedient(rigid), rigid.vehicle),)).heights_m
    assert 0.1 < low < 0.25 and 0.95 < high < 1.1


@pytest.mark.parametrize(("speed_m_s", "known"), [(0.05, False), (0.8, True)])
def test_a_position_and_a_speed_explain_nothing_where_the_vehicle_only_wanders(
    rigid: Model, speed_m_s: float, known: bool
) -> None:
    data = load_dataset([to_and_fro(obedient(rigid, noise_m_s=0.005), speed_m_s)], rigid.vehicle)
    for name in ("north", "east", "speed_forward", "speed_right"):
        assert (data.variable(name) is not None) is known, name
    assert data.variable("pitch") is None
    assert data.variable("height_over_radius") is not None


class TestDiscover:
    @pytest.mark.long
    def test_it_walks_the_circle_until_nothing_is_left(self, tmp_path: Path, rigid: Model) -> None:
        hidden = [("rotor_drag.linear", {"d_x": 0.3, "d_y": 0.25}), ("thrust_scale.constant", {"factor": 0.93})]
        data = load_dataset([simulated("forward_runs", hidden, 6, tmp_path)], rigid.vehicle)
        found = discover(rigid, data)
        assert [type(effect) for effect in found.model.effects] == [ConstantScale, LinearDrag]
        errors = [step.rmse["total"] for step in found.diagnosis.steps]
        assert errors == sorted(errors, reverse=True)
        assert [step.family for step in found.diagnosis.steps] == ["", *found.diagnosis.missing]
        assert found.noise_floor["total"] <= errors[-1]
        assert diagnose(found.model, data).missing == []
        self.check_that_parameters_are_told(found)

    @staticmethod
    def check_that_parameters_are_told(found: Discovery) -> None:
        """As saved, with interval and p; on a terminal of 80 columns nothing is cut."""
        console = Console(file=io.StringIO(), width=80, color_system=None)
        with console.capture() as capture:
            console.print(found)
        text = capture.get()
        for item, entry in zip(found.model.stack, found.to_dict()["effects"], strict=True):
            assert item.fitted is not None
            assert entry["effect"] == item.effect.name
            assert entry["p_value"] == found.p_values[item.effect.family()] < 0.01
            units = {p.name: f" {p.unit}" if p.unit else "" for p in item.effect.parameters()}
            for name, (low, high) in item.fitted.ci95.items():
                value = item.effect.values()[name]
                shown, interval = estimate(value, (low, high))
                assert f"{name} = {shown}{units[name]} {interval}" in text
                assert low < entry["parameters"][name] < high
        assert max(map(len, text.splitlines())) <= 80


class TestSpans:
    def test_an_effect_is_not_tried_where_the_data_cannot_tell_it_from_others(
        self, of_one_staircase: Diagnosis
    ) -> None:
        """A hover does not determine a drag with the square of the speed: the result says so."""
        assert "body_drag" not in {candidate.family for candidate in of_one_staircase.ranking}
        (reason,) = (r for r in of_one_staircase.untried if r.facts["effect"] == "body_drag.quadratic")
        assert (reason.facts["variable"], reason.facts["needed"]) == ("speed", 1.0)
        assert reason.facts["span"] < 1.0


class TestNuisances:
    def test_a_trim_of_the_size_that_real_vehicles_have_is_not_called_missing(self, raptor: Vehicle) -> None:
        truth = Model(raptor).plus(ConstantScale(1.005))
        data = load_dataset([obedient(truth, 120.0, noise_m_s=0.005)], raptor)
        assert diagnose(Model(raptor), data).missing == []

    @pytest.mark.long
    def test_a_larger_one_is(self, raptor: Vehicle) -> None:
        truth = Model(raptor).plus(ConstantScale(1.03))
        data = load_dataset([obedient(truth, 120.0, noise_m_s=0.005)], raptor)
        assert diagnose(Model(raptor), data).missing == ["thrust_scale"]

    def test_they_are_held_to_what_is_believed(self, raptor: Vehicle) -> None:
        data = load_dataset([obedient(Model(raptor).plus(ConstantScale(0.8)), 60.0, noise_m_s=0.005)], raptor)
        fitted = Fitter(Model(raptor), data).fit()
        assert np.all(np.abs(fitted.nuisances) <= BOUND + 1e-12)
        assert fitted.nuisances[0, 0] == pytest.approx(-BOUND[0], abs=1e-4)

    def test_each_flight_has_its_own(self, raptor: Vehicle) -> None:
        logs = [
            obedient(Model(raptor).plus(ConstantScale(factor)), 60.0, noise_m_s=0.005, name=f"{factor}.csv")
            for factor in (0.994, 1.006)
        ]
        fitted = Fitter(Model(raptor), load_dataset(logs, raptor)).fit()
        assert fitted.nuisances[:, 0] == pytest.approx([-0.006, 0.006], abs=1e-3)

    def test_a_height_that_is_off_by_a_centimetre_does_not_bend_the_ground_effect(self, raptor: Vehicle) -> None:
        truth = Model(raptor).plus(Exponential(a=0.3, b=6.0))
        log = obedient(truth, 120.0, noise_m_s=0.005)
        off = dataclasses.replace(log, columns={**log.columns, "z_m": log["z_m"] + 0.01})
        both = load_dataset([dataclasses.replace(off, name="off.csv"), log], raptor)
        fitted = Fitter(Model(raptor).plus(Exponential()), both).fit()
        # Only the difference between the flights can be seen: an offset common to all is a change of a.
        assert fitted.nuisances[1, 3] - fitted.nuisances[0, 3] == pytest.approx(0.01, abs=2e-3)
