"""Specification of errors on unseen data: what the fit has not seen, and what the choice of effects has not seen."""

import dataclasses
import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from quadctl.effects.ground_effect import Exponential
from quadctl.effects.inflow import AxialInflow
from quadctl.effects.motor_lag import FirstOrderLag
from quadctl.effects.rotor_drag import LinearDrag
from quadctl.effects.thrust_scale import ConstantScale
from quadctl.lab.finding import Finding, Kind
from quadctl.lab.fitting.fitted_model import fit_model
from quadctl.lab.flights.dataset import Dataset, load_dataset
from quadctl.lab.flights.prediction import predict
from quadctl.lab.selection import diagnosis, unseen
from quadctl.lab.selection.diagnosis import Diagnosis, diagnose
from quadctl.logs.csv_log import write_csv
from quadctl.logs.flight_log import FlightLog
from quadctl.model import Model
from quadctl.vehicle import Vehicle
from quadctl.web.session.findings import Findings
from tests.support.commands import Result
from tests.support.flights import obedient, to_and_fro

CANDIDATES = (ConstantScale, Exponential, AxialInflow)


@pytest.fixture(scope="module")
def truth(raptor: Vehicle) -> Model:
    return Model(raptor).plus(Exponential(a=0.3, b=6.0))


@pytest.fixture(scope="module")
def low_and_high(truth: Model) -> list[FlightLog]:
    """One flight over the ground, and one so high that it does not feel it."""
    low = obedient(truth, 60.0, noise_m_s=0.01, name="low.csv")
    high = obedient(Model(truth.vehicle), 60.0, noise_m_s=0.01, seed=1, name="high.csv")
    return [low, dataclasses.replace(high, columns={**high.columns, "z_m": high["z_m"] + 3.0})]


@pytest.fixture(scope="module")
def both(low_and_high: list[FlightLog], raptor: Vehicle) -> Dataset:
    return load_dataset(low_and_high, raptor)


@pytest.fixture(scope="module")
def simple(both: Dataset) -> Diagnosis:
    return diagnose(Model(both.flights[0].vehicle), both, CANDIDATES)


@pytest.fixture(scope="module")
def nested(both: Dataset) -> Diagnosis:
    return diagnose(Model(both.flights[0].vehicle), both, CANDIDATES, nested=True)


class TestPartOfAFlight:
    @pytest.mark.parametrize("delay_s", [0.0, 0.12, -0.04])
    def test_its_prediction_is_that_of_the_whole_flight(self, truth: Model, delay_s: float) -> None:
        log = to_and_fro(obedient(truth, 60.0, noise_m_s=0.01), 1.0)
        (flight,) = load_dataset([log], truth.vehicle).flights
        kept = flight.block % 5 == 2
        part = flight.some(kept)
        assert len(part.grid_s) < 0.5 * len(flight.grid_s)
        expected = predict(truth, flight.shifted(delay_s))[kept]
        assert predict(truth, part.shifted(delay_s)) == pytest.approx(expected, abs=1e-9)
        assert np.array_equal(part.measured, flight.measured[kept])

    def test_it_may_be_cut_again(self, truth: Model) -> None:
        (flight,) = load_dataset([obedient(truth, 60.0)], truth.vehicle).flights
        twice = flight.some(flight.block > 2).some(flight.block[flight.block > 2] == 4)
        once = flight.some(flight.block == 4)
        assert np.array_equal(twice.time_s, once.time_s)
        assert predict(truth, twice) == pytest.approx(predict(truth, once))

    def test_a_flight_of_which_nothing_is_kept_is_left_out(self, both: Dataset) -> None:
        assert both.samples(both.flight_index == 1).names == ["high.csv"]
        assert both.samples(both.fold != 1).names == ["low.csv", "high.csv"]


class TestWithoutNesting:
    def test_blocks_and_flights_stand_side_by_side(self, simple: Diagnosis) -> None:
        blocks, flights = simple.unseen
        assert (blocks.hold_out, flights.hold_out) == ("blocks", "flights")
        assert blocks.after["total"] == simple.steps[-1].rmse["total"]
        assert blocks.before["total"] == simple.steps[0].rmse["total"]
        # Without the low flight nothing tells of the ground effect.
        assert flights.after["total"] > 1.2 * blocks.after["total"]

    def test_it_is_said_that_the_choice_has_seen_the_data(self, simple: Diagnosis) -> None:
        assert Kind.SEEN_BY_CHOICE in {note.kind for note in simple.notes}
        assert [entry["choice_repeated"] for entry in simple.to_dict()["unseen"]] == [False, False]

    def test_where_nothing_is_missing_nothing_is_said(self, raptor: Vehicle) -> None:
        data = load_dataset([obedient(Model(raptor), 60.0, noise_m_s=0.01)], raptor)
        assert "--nested" not in str(diagnose(Model(raptor), data, CANDIDATES))


class TestNested:
    def test_each_search_is_without_what_it_is_judged_on(self, nested: Diagnosis) -> None:
        blocks, flights = nested.unseen
        assert (blocks.searches, blocks.found) == (5, {"ground_effect": 5})
        assert (flights.searches, flights.found) == (2, {"ground_effect": 1})
        # The search without the low flight finds nothing: its error there is that of the model as given.
        assert flights.after["total"] == pytest.approx(flights.before["total"], rel=0.1)
        assert blocks.after["total"] < 0.6 * blocks.before["total"]

    @pytest.mark.long
    def test_no_search_sees_the_samples_that_it_is_judged_on(
        self, both: Dataset, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        seen = []

        def watched(model: Model, data: Dataset) -> unseen.FittedModel:
            seen.append({(f.name, time) for f in data.flights for time in f.time_s})
            return fit_model(model, data)

        monkeypatch.setattr(unseen, "fit_model", watched)
        unseen.nested_errors(Model(both.flights[0].vehicle), both, [ConstantScale], lambda text: None)
        folds = [both.block % 5 == number for number in range(5)] + [both.flight_index == i for i in range(2)]
        every = [(both.names[i], time) for i, flight in enumerate(both.flights) for time in flight.time_s]
        for data, held in zip(seen, folds, strict=True):
            assert data == {every[i] for i in np.flatnonzero(~held)}

    def test_the_verdict_is_that_of_all_data(self, simple: Diagnosis, nested: Diagnosis) -> None:
        assert nested.missing == simple.missing == ["ground_effect"]
        assert "neither the fit nor the choice of effects has seen" in str(nested)
        assert "--nested" not in str(nested)

    def test_a_saved_session_keeps_it(self, nested: Diagnosis, both: Dataset) -> None:
        text = Findings.of(nested, {}).to_json()
        assert Findings.from_json(text, nested.model).diagnosed(nested.model, both).diagnosis.unseen == nested.unseen

    def test_a_motor_lag_is_judged_with_the_delay_of_the_fit(self, raptor: Vehicle, both: Dataset) -> None:
        start = Model(raptor).plus(FirstOrderLag(0.1))
        blocks, _ = unseen.nested_errors(start, both, [Exponential], lambda text: None)
        expected = fit_model(start, both).held_out_rmse["total"]
        assert blocks.before["total"] == pytest.approx(expected, rel=0.1)

    @pytest.mark.long
    def test_the_command_repeats_the_choice(
        self, truth: Model, tmp_path: Path, raptor_path: Path, quadctl: Callable[..., Result]
    ) -> None:
        log, out, found = tmp_path / "low.csv", tmp_path / "new.yaml", tmp_path / "found.json"
        write_csv(obedient(truth, 40.0, noise_m_s=0.01), log)
        result = quadctl("discover", raptor_path, log, "-o", out, "--json", found, "--nested")
        assert result.status == 0, result.err
        (blocks,) = json.loads(found.read_text())["diagnosis"]["unseen"]
        assert blocks["choice_repeated"] and blocks["searches"] == 5
        assert blocks["rmse_after"] < blocks["rmse_before"]


@pytest.fixture(scope="module")
def long(truth: Model) -> Dataset:
    return load_dataset([obedient(truth, 900.0, noise_m_s=0.01)], truth.vehicle)


class TestLongLogs:
    """The search sees stretches that are spread over the flights; what it finds is fitted to all."""

    def test_the_stretches_are_spread_and_hold_every_fold(self, long: Dataset) -> None:
        part = long.spread_out(2000)
        assert 1500 < len(part.targets) < 2500
        assert [np.mean(part.fold == number) for number in part.folds] == pytest.approx([0.2] * 5, abs=0.03)
        gaps = np.diff(part.flights[0].time_s)
        assert np.count_nonzero(gaps > 5.0) >= 4
        assert long.spread_out(10**6) is long

    def test_each_flight_keeps_a_stretch(self, both: Dataset) -> None:
        assert both.spread_out(300).names == ["low.csv", "high.csv"]

    def test_the_parameters_are_those_of_a_fit_to_all(
        self, long: Dataset, truth: Model, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(diagnosis, "MOST_SEARCHED", 2000)
        found = diagnose(Model(truth.vehicle), long, CANDIDATES)
        assert found.missing == ["ground_effect"]
        assert 1500 < found.searched < 2500
        assert Finding(Kind.PART_SEARCHED, {"searched": found.searched, "all": len(long.targets)}) in found.notes
        assert found.to_dict()["samples"] == {"searched": found.searched, "all": len(long.targets)}
        whole = fit_model(found.best, long)
        assert found.fit is not None and len(found.fit.held_out_residual) == len(long.targets)
        assert found.ranking[0].effect.values()["a"] == pytest.approx(whole.model.effects[0].values()["a"], rel=1e-2)
        assert found.ranking[0].ci95 == found.fit.ci95(0)

    def test_small_effects_are_compared_on_what_the_search_has_seen(
        self, raptor: Vehicle, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(diagnosis, "MOST_SEARCHED", 2000)
        climbs = obedient(Model(raptor).plus(AxialInflow(0.03)), 900.0, noise_m_s=0.002)
        found = diagnose(Model(raptor), load_dataset([climbs], raptor), (AxialInflow, LinearDrag))
        assert [c.effect.name for c in found.measured] == ["inflow.axial", "rotor_drag.linear"]
        assert [[c.effect.name for c in group] for group in found.small] == [["inflow.axial"]]
