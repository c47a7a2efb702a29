"""Python interface of the lab: the examples of its documentation run, results print themselves, and inputs are
flexible."""

import doctest
import importlib
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

import quadctl.lab
from quadctl.effects.ground_effect import Exponential
from quadctl.errors import LogError, SettingsError
from quadctl.lab import (
    FlightModel,
    add,
    compare,
    diagnose,
    discover,
    fit,
    judge,
    load_model,
    prepare_flights,
    read_log,
    remove,
    suggest,
)
from quadctl.lab.results import Result
from quadctl.logs.csv_log import write_csv
from quadctl.model import Model
from quadctl.vehicle import Vehicle
from tests.support.flights import MISSIONS, obedient
from tests.support.places import ROOT

PAGE = ROOT / "docs" / "python.md"
GROUND = "ground_effect.exponential"


@pytest.fixture(scope="module")
def folder(raptor: Vehicle, raptor_path: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder in which the examples are run: a vehicle, and two flights over a ground with a = 0.3, b = 6."""
    where = tmp_path_factory.mktemp("examples")
    shutil.copy(raptor_path, where / "raptor.yaml")
    truth = Model(raptor).plus(Exponential(a=0.3, b=6.0))
    for seed, name in enumerate(("flight.csv", "other_flight.csv")):
        write_csv(obedient(truth, 120.0, noise_m_s=0.01, seed=seed), where / name)
    return where


@pytest.fixture
def here(folder: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(folder)
    return folder


class TestExamples:
    @pytest.mark.parametrize(
        "name", ["quadctl.lab", "quadctl.lab.interface", "quadctl.lab.study", "quadctl.lab.estimator"]
    )
    def test_those_of_the_docstrings_run(self, here: Path, name: str) -> None:
        result = doctest.testmod(importlib.import_module(name))
        assert result.attempted > 0 and result.failed == 0

    def test_those_of_the_page_run(self, here: Path) -> None:
        result = doctest.testfile(str(PAGE), module_relative=False)
        assert result.attempted > 10 and result.failed == 0


class TestEstimator:
    def test_it_learns_what_the_flights_obey(self, here: Path) -> None:
        model = FlightModel("raptor.yaml", effects=[GROUND]).fit(["flight.csv", "other_flight.csv"])
        (ground,) = model.effects_
        assert ground.values()["a"] == pytest.approx(0.3, rel=0.05)
        assert (
            model.rmse_["total"] < FlightModel("raptor.yaml", effects=["thrust_scale"]).fit("flight.csv").rmse_["total"]
        )
        assert model.refit_.model is model.model_

    def test_it_predicts_and_scores_as_compare_does(self, here: Path) -> None:
        model = FlightModel("raptor.yaml", [GROUND]).fit("flight.csv")
        dataset = prepare_flights("other_flight.csv", model.model_.vehicle)
        predicted = model.predict("other_flight.csv")
        assert predicted.shape == dataset.measured.shape
        assert model.score(dataset) == pytest.approx(compare(model.model_, dataset).explained)
        assert np.array_equal(model.predict(dataset), predicted)

    def test_before_fit_it_is_the_model_that_it_was_given(self, here: Path) -> None:
        model = FlightModel("raptor.yaml")
        assert model.score("flight.csv") == compare("raptor.yaml", "flight.csv").explained
        assert not any(name.endswith("_") and not name.startswith("_") for name in vars(model))

    def test_parameters_are_what_the_constructor_takes(self) -> None:
        model = FlightModel("raptor.yaml", [GROUND], hold_out="flights")
        assert model.get_params() == {"model": "raptor.yaml", "effects": [GROUND], "hold_out": "flights"}
        twin = FlightModel(**model.get_params()).set_params(hold_out="blocks")
        assert (twin.hold_out, model.hold_out) == ("blocks", "flights")
        with pytest.raises(SettingsError, match=r"no parameter 'depth', expected one of: model, effects, hold_out"):
            model.set_params(depth=3)

    def test_what_it_saves_the_commands_read(self, here: Path, tmp_path: Path) -> None:
        model = FlightModel("raptor.yaml", [GROUND]).fit("flight.csv")
        model.save(tmp_path / "found.yaml")
        assert load_model(tmp_path / "found.yaml").effects == model.effects_

    def test_a_family_can_be_there_once(self, here: Path) -> None:
        with pytest.raises(
            SettingsError, match=r"holds a ground_effect already, so ground_effect.hayden cannot be added"
        ):
            FlightModel("raptor.yaml", [GROUND, "hayden"]).fit("flight.csv")


class TestFlights:
    def test_logs_paths_and_prepared_flights_are_the_same(self, here: Path, raptor: Vehicle) -> None:
        prepared, log = prepare_flights("flight.csv", raptor), read_log("flight.csv")
        results = [compare(model, prepared).rmse for model in (Model(raptor), "raptor.yaml", Path("raptor.yaml"))]
        results += [compare(Model(raptor), flights).rmse for flights in ("flight.csv", Path("flight.csv"), [log], log)]
        assert all(result == results[0] for result in results)

    def test_bad_ones_are_sentences(self, here: Path) -> None:
        with pytest.raises(SettingsError, match="no flight is given"):
            compare("raptor.yaml", [])
        with pytest.raises(LogError, match=r"nowhere\.csv"):
            compare("raptor.yaml", "nowhere.csv")
        with pytest.raises(LogError, match="is given twice"):
            compare("raptor.yaml", ["flight.csv", "flight.csv"])
        with pytest.raises(SettingsError, match="hold_out is flights with 1 log"):
            add(GROUND, "raptor.yaml", "flight.csv", hold_out="flights")
        with pytest.raises(SettingsError, match="hold_out is 'none', expected blocks or flights"):
            add(GROUND, "raptor.yaml", "flight.csv", hold_out="none")  # type: ignore[arg-type]
        with pytest.raises(SettingsError, match="there is no effect 'ground_efect'"):
            add("ground_efect", "raptor.yaml", "flight.csv")


@pytest.fixture(scope="module")
def results(folder: Path, raptor: Vehicle) -> dict[str, Result]:
    flights, missions = prepare_flights(folder / "flight.csv", raptor), folder / "missions"
    missions.mkdir()
    for name in ("forward_runs.yaml", "vertical_runs.yaml"):
        shutil.copy(MISSIONS / name, missions)
    some = ["thrust_scale", GROUND]
    added = add(GROUND, Model(raptor), flights)
    return {
        "compare": compare(Model(raptor), flights),
        "diagnose": diagnose(Model(raptor), flights, some),
        "add": added,
        "fit": fit(added.model, flights),
        "remove": remove(GROUND, added.model, flights),
        "discover": discover(Model(raptor), flights, some),
        "suggest": suggest(Model(raptor), flights, missions, ["rotor_drag", "inflow"]),
    }


class TestResults:
    @pytest.mark.parametrize("name", ["compare", "diagnose", "add", "fit", "remove", "discover", "suggest"])
    def test_each_prints_as_a_table_and_draws_itself(self, results: dict[str, Result], name: str) -> None:
        result = results[name]
        text = str(result)
        assert "━" in text and "\x1b" not in text
        assert max(map(len, text.splitlines())) <= 120
        assert repr(result) == text
        html = result._repr_html_()
        assert html.startswith("<pre") and "━" in html
        figure = result.plot()
        assert isinstance(figure, Figure) and figure.axes


HEAVY = ("scipy", "polars", "matplotlib", "joblib", "pysindy", "pyulog", "jinja2", "nicegui", "mavsdk")


def test_importing_the_lab_alone_loads_no_heavy_package() -> None:
    code = f"import sys, quadctl.lab; print(*(name for name in {HEAVY} if name in sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == []


def test_an_analysis_loads_no_plotting_before_something_is_drawn() -> None:
    code = "import sys; from quadctl.lab import compare, diagnose, discover; print('matplotlib' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "False"


def test_every_public_name_is_there() -> None:
    assert all(callable(getattr(quadctl.lab, name)) for name in quadctl.lab.__all__)
    assert dir(quadctl.lab) == sorted(quadctl.lab.__all__)


def test_a_name_that_is_not_public_is_said_to_be_none() -> None:
    with pytest.raises(AttributeError, match="has no attribute 'improve'"):
        quadctl.lab.improve  # noqa: B018


class TestUnseenFlights:
    def test_both_models_are_judged_as_they_stand_with_the_interval_of_the_change(self, here: Path) -> None:
        found = judge(
            "raptor.yaml", Model(load_model("raptor.yaml").vehicle).plus(Exponential(a=0.3, b=6.0)), "flight.csv"
        )
        before, after = (
            compare(model, "flight.csv").rmse["total"] for model in (found.before.model, found.after.model)
        )
        assert found.drop == pytest.approx(1.0 - after / before)
        low, high = found.drop_ci95
        assert 0.5 < low < found.drop < high < 1.0
        assert "On flight.csv, which no fit has seen: " in str(found)

    def test_two_like_models_have_an_interval_that_holds_no_change(self, here: Path) -> None:
        found = judge("raptor.yaml", "raptor.yaml", "flight.csv")
        assert found.drop == 0.0 and found.drop_ci95 == (0.0, 0.0)
