"""`quadctl verify`: an unchanged vehicle passes, a changed one is told by its parameter, bad models get a sentence."""

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from quadctl.cli import app
from quadctl.effects.ground_effect import Exponential
from quadctl.effects.thrust_scale import ConstantScale
from quadctl.errors import SettingsError
from quadctl.lab.flights.dataset import Dataset, load_dataset
from quadctl.lab.selection.addition import add
from quadctl.lab.verification import Verification, verify
from quadctl.logs.csv_log import write_csv
from quadctl.model import Model, save_model
from tests.support.flights import obedient
from tests.support.links import RAPTOR

NOISE_M_S = 0.01


def flight(rigid: Model, a: float, seed: int, name: str = "new.csv") -> Dataset:
    log = obedient(rigid.plus(Exponential(a, 5.0)), 50.0, noise_m_s=NOISE_M_S, seed=seed, name=name)
    return load_dataset([log], rigid.vehicle)


@pytest.fixture(scope="module")
def fitted(rigid: Model) -> Model:
    return add(Exponential, rigid, flight(rigid, 0.3, 1, "fit.csv")).model


@pytest.fixture(scope="module")
def changed(rigid: Model, fitted: Model) -> Verification:
    return verify(fitted, [flight(rigid, a, i, f"{i}.csv") for i, a in ((2, 0.3), (3, 0.5), (4, 0.5))])


def test_an_unchanged_vehicle_passes(changed: Verification) -> None:
    first = changed.checks[0]
    assert first.holds
    assert first.error_m_s2 == pytest.approx(first.refitted_m_s2, rel=0.05)


def test_a_changed_parameter_is_named_with_the_flight_since_which_it_is_another(changed: Verification) -> None:
    assert [check.holds for check in changed.checks] == [True, False, False]
    (a,) = (c for c in changed.checks[1].changes if c.parameter == "a")
    assert a.before[1] <= 0.3 <= a.before[2]
    assert a.now[1] <= 0.5 <= a.now[2]
    text = " ".join(str(changed).split())
    assert "3.csv: a of ground_effect.exponential is 0.5" in text
    assert "(first in 3.csv)" in text
    assert text.endswith("The model does not hold on these flights.")


@pytest.mark.parametrize(("factor", "holds"), [(0.955, True), (0.91, False)])
def test_flights_differ_by_their_bias_and_no_change_is_called_by_it(rigid: Model, factor: float, holds: bool) -> None:
    def scaled(factor: float, seed: int) -> Dataset:
        log = obedient(rigid.plus(ConstantScale(factor)), 40.0, noise_m_s=NOISE_M_S, seed=seed, name=f"{seed}.csv")
        return load_dataset([log], rigid.vehicle)

    before = add(ConstantScale, rigid, scaled(0.95, 1)).model
    assert verify(before, [scaled(factor, 2)]).holds is holds


def test_a_model_without_intervals_is_one_sentence(rigid: Model) -> None:
    with pytest.raises(SettingsError, match="holds no parameter with an interval, expected a model that was fitted"):
        verify(rigid.plus(Exponential(0.3, 5.0)), [flight(rigid, 0.3, 2)])


def test_the_exit_status_is_a_gate(rigid: Model, fitted: Model, tmp_path: Path) -> None:
    model, out = tmp_path / "model.yaml", tmp_path / "v.json"
    save_model(Model(fitted.vehicle, fitted.stack, vehicle_path=RAPTOR), model)
    statuses = []
    for name, a in (("same", 0.3), ("other", 0.5)):
        path = tmp_path / f"{name}.csv"
        write_csv(obedient(rigid.plus(Exponential(a, 5.0)), 50.0, noise_m_s=NOISE_M_S, seed=7, name=path.name), path)
        shown = CliRunner().invoke(app, ["verify", str(model), str(path), "--json", str(out)])
        statuses.append(shown.exit_code)
        assert json.loads(out.read_text())["holds"] is (name == "same"), shown.output
    assert statuses == [0, 1]
