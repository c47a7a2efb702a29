"""Refit of a model and removal of effects: specification of `quadctl fit` and `quadctl remove`."""

import dataclasses
import json
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from quadctl.cli import main
from quadctl.effects.ground_effect import Exponential, Hayden
from quadctl.effects.payload import MassStep
from quadctl.effects.rotor_drag import LinearDrag
from quadctl.effects.thrust_scale import ConstantScale
from quadctl.errors import SettingsError
from quadctl.lab.flights.dataset import Dataset, load_dataset
from quadctl.lab.selection.addition import add
from quadctl.lab.selection.refit import fit
from quadctl.lab.selection.removal import held_effect, remove
from quadctl.logs.csv_log import write_csv
from quadctl.logs.flight_log import FlightLog
from quadctl.model import Model, load_model, save_model
from quadctl.vehicle import Vehicle
from tests.support.flights import obedient


@pytest.fixture(scope="module")
def truth(raptor: Vehicle) -> Model:
    return Model(raptor).plus(ConstantScale(0.93)).plus(Exponential(a=0.3, b=6.0))


@pytest.fixture(scope="module")
def data(truth: Model) -> Dataset:
    return load_dataset([obedient(truth, 120.0, noise_m_s=0.01, seed=3)], truth.vehicle)


@pytest.fixture(scope="module")
def wrong(raptor: Vehicle) -> Model:
    """Model with the right effects and wrong parameters."""
    return Model(raptor, name="wrong").plus(ConstantScale(1.0)).plus(Exponential(a=0.1, b=3.0))


class TestFit:
    def test_all_parameters_are_found_together(self, wrong: Model, data: Dataset) -> None:
        scale, ground = fit(wrong, data).model.effects
        assert scale.values()["factor"] == pytest.approx(0.93, rel=0.01)
        assert ground.values()["a"] == pytest.approx(0.3, rel=0.05)
        assert ground.values()["b"] == pytest.approx(6.0, rel=0.1)

    def test_the_error_before_is_that_of_the_parameters_as_they_stood(self, wrong: Model, data: Dataset) -> None:
        result = fit(wrong, data)
        assert result.before["up"] > 3.0 * result.after["up"]
        low, high = result.drop_ci95
        assert low < result.held_out_drop < high
        assert result.p_value < 1e-6 and result.conclusion == ""

    def test_a_model_that_is_right_already_gains_nothing(self, truth: Model, data: Dataset) -> None:
        """The nuisances of the flight are fitted before and after: they do not count as improvement."""
        result = fit(truth, data)
        assert abs(result.held_out_drop) < 0.01
        assert result.p_value > 0.01

    def test_the_model_says_where_its_parameters_come_from(self, wrong: Model, data: Dataset) -> None:
        result = fit(wrong, data)
        for item in result.model.stack:
            assert item.fitted is not None
            assert item.fitted.logs == ("made.csv",)
            assert item.fitted.held_out
            assert item.fitted.command_delay_s is None  # the rotors' speeds were measured
            assert item.fitted.rmse_before is None  # the error of the old parameters is not that without the effect
            assert item.fitted.rmse_after == result.after["total"]
            for name, (low, high) in item.fitted.ci95.items():
                assert low <= item.effect.values()[name] <= high

    def test_there_must_be_something_to_fit(self, raptor: Vehicle, data: Dataset) -> None:
        with pytest.raises(SettingsError, match="holds no effect, expected an effect with a parameter to fit"):
            fit(Model(raptor), data)
        with pytest.raises(SettingsError, match=r"holds ground_effect\.hayden, expected"):
            fit(Model(raptor).plus(Hayden()), data)


@pytest.fixture(scope="module")
def low_and_high(truth: Model) -> list[FlightLog]:
    """One flight near the ground, and one so high that it does not feel it."""
    low = obedient(truth, 40.0, noise_m_s=0.01, name="low.csv")
    high = obedient(truth.without(truth.effects[1]), 40.0, noise_m_s=0.01, seed=1, name="high.csv")
    return [low, dataclasses.replace(high, columns={**high.columns, "z_m": high["z_m"] + 3.0})]


class TestFlightsHeldOut:
    def test_it_is_said_which_flight_alone_tells_a_parameter(self, wrong: Model, low_and_high: list[FlightLog]) -> None:
        notes = fit(wrong, load_dataset(low_and_high, wrong.vehicle, "flights")).remarks
        (note,) = [note for note in notes if note.startswith("without")]
        assert note.startswith(
            "without low.csv the other flights do not determine a of ground_effect.exponential and b of"
        )

    def test_nothing_is_said_where_each_flight_tells_all(self, wrong: Model, truth: Model) -> None:
        logs = [obedient(truth, 40.0, noise_m_s=0.01, seed=i, name=f"{i}.csv") for i in range(2)]
        assert not fit(wrong, load_dataset(logs, wrong.vehicle, "flights")).remarks

    def test_nor_where_every_fold_has_a_part_of_the_flight(self, wrong: Model, low_and_high: list[FlightLog]) -> None:
        assert not fit(wrong, load_dataset(low_and_high, wrong.vehicle, "blocks")).remarks


class TestProvenance:
    """`rmse_before` and `rmse_after` are the errors without and with one effect; what is not known is left out."""

    def test_an_effect_that_is_added_has_both(self, truth: Model, data: Dataset) -> None:
        added = add(Exponential, Model(truth.vehicle), data)
        (item,) = added.model.stack
        assert item.fitted is not None
        assert (item.fitted.rmse_before, item.fitted.rmse_after) == (added.before["total"], added.after["total"])

    def test_it_keeps_them_when_a_further_one_is_added_to_the_same_flights_only(
        self, truth: Model, data: Dataset
    ) -> None:
        first = add(Exponential, Model(truth.vehicle), data)
        same = add(ConstantScale, first.model, data).model.stack[0].fitted
        known = first.model.stack[0].fitted
        assert same is not None and known is not None
        assert (same.rmse_before, same.rmse_after) == (known.rmse_before, known.rmse_after)
        other = load_dataset([obedient(truth, 60.0, noise_m_s=0.01, seed=5, name="other.csv")], truth.vehicle)
        moved = add(ConstantScale, first.model, other)
        fitted = moved.model.stack[0].fitted
        assert fitted is not None
        assert (fitted.rmse_before, fitted.rmse_after) == (None, moved.after["total"])

    def test_a_removal_says_nothing_of_the_error_without_those_that_stay(self, truth: Model, data: Dataset) -> None:
        result = remove("thrust_scale", truth, data)
        fitted = result.model.stack[0].fitted
        assert fitted is not None
        assert (fitted.rmse_before, fitted.rmse_after) == (None, result.after["total"])


class TestAdd:
    def test_what_no_fit_can_move_is_chosen_by_the_data(self, raptor: Vehicle) -> None:
        """A mass that is picked up at 40 s: the sum of squares has a local minimum at every moment of the flight."""
        truth = Model(raptor).plus(MassStep(mass_kg=0.15, time_s=40.0))
        flights = load_dataset([obedient(truth, 90.0, noise_m_s=0.01)], raptor)
        (found,) = add(MassStep, Model(raptor), flights).model.effects
        assert found.values()["time_s"] == pytest.approx(40.0, abs=1.0)
        assert found.values()["mass_kg"] == pytest.approx(0.15, rel=0.1)

    def test_what_begins_in_each_flight_at_a_moment_of_its_own_is_one_effect(self, raptor: Vehicle) -> None:
        """A load that is dropped once in each flight: no single moment, and no single flight, has it all."""
        logs = [
            obedient(Model(raptor).plus(MassStep(mass_kg=-0.15, time_s=time_s)), 60.0, noise_m_s=0.01)
            for time_s in (20.0, 41.0)
        ]
        (found,) = add(MassStep, Model(raptor), load_dataset(logs, raptor)).model.effects
        assert found.values()["mass_kg"] == pytest.approx(-0.15, rel=0.1)
        assert found.values()["flight"] == 0.0
        assert found.values()["time_1_s"] == pytest.approx(20.0, abs=1.0)
        assert found.values()["time_2_s"] == pytest.approx(41.0, abs=1.0)


class TestRemove:
    def test_what_is_needed_costs_error_and_what_is_not_does_not(self, truth: Model, data: Dataset) -> None:
        needed = remove("ground_effect", truth, data)
        assert needed.after["up"] > 2.0 * needed.before["up"]
        assert needed.p_value < 1e-6
        assert "support ground_effect.exponential" in needed.conclusion

        superfluous = remove("rotor_drag", truth.plus(LinearDrag()), data)
        assert abs(superfluous.held_out_drop) < 0.01
        assert superfluous.p_value > 0.01
        assert "do not support rotor_drag.linear" in superfluous.conclusion

    def test_a_drag_that_stands_for_a_wrong_delay_is_not_supported(self, truth: Model) -> None:
        """The rotors' delay is estimated without the ground effect: 40 ms too early, as its standard error says."""
        flight = load_dataset([obedient(truth, 120.0, noise_m_s=0.01, seed=1)], truth.vehicle)
        assert remove("rotor_drag", truth.plus(LinearDrag()), flight).p_value > 0.01

    def test_the_rest_is_refitted(self, raptor: Vehicle, truth: Model, data: Dataset) -> None:
        """Without the ground effect, the thrust scale compensates for it."""
        alone = remove("ground_effect", truth, data).model
        assert [type(effect) for effect in alone.effects] == [ConstantScale]
        assert alone.effects[0].values()["factor"] > 0.94
        assert remove("thrust_scale", Model(raptor).plus(ConstantScale(0.93)), data).model.effects == ()

    def test_it_is_the_reverse_of_add(self, raptor: Vehicle, data: Dataset) -> None:
        scaled = add(ConstantScale, Model(raptor), data)
        both = add(Exponential, scaled.model, data)
        back = remove("exponential", both.model, data)
        assert back.after["total"] == pytest.approx(both.before["total"], rel=2e-3)
        assert back.before["total"] == pytest.approx(both.after["total"], rel=2e-3)
        assert back.p_value == pytest.approx(both.p_value, rel=0.01, abs=1e-12)

    @pytest.mark.parametrize("word", ["ground_effect.exponential", "ground_effect", "exponential"])
    def test_an_effect_goes_by_name_family_or_variant(self, truth: Model, word: str) -> None:
        assert held_effect(word, truth) is truth.effects[1]

    def test_a_wrong_name_is_a_sentence(self, raptor: Vehicle, truth: Model) -> None:
        with pytest.raises(SettingsError, match=r"no effect 'ground_efect' \(did you mean 'ground_effect'\?\)"):
            held_effect("ground_efect", truth)
        with pytest.raises(SettingsError, match=r"expected one of: thrust_scale\.constant, ground_effect\.exponential"):
            held_effect("zzz", truth)
        with pytest.raises(SettingsError, match="holds no effect, so 'hayden' cannot be taken out"):
            held_effect("hayden", Model(raptor))

    def test_without_a_fit_the_others_keep_their_parameters(self, truth: Model) -> None:
        rest = truth.without(truth.effects[1])
        assert rest.effects == (truth.effects[0],)


class TestCommands:
    @pytest.fixture
    def run(
        self, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
    ) -> Callable[..., tuple[int, str, str]]:
        monkeypatch.chdir(tmp_path)

        def run(*arguments: object) -> tuple[int, str, str]:
            monkeypatch.setattr(sys, "argv", ["quadctl", *map(str, arguments)])
            with pytest.raises(SystemExit) as ended:
                main()
            out, err = capsys.readouterr()
            return int(ended.value.code or 0), out, err

        return run

    @pytest.fixture
    def files(self, truth: Model, wrong: Model, tmp_path: Path) -> tuple[Path, Path]:
        """Log, and model file with the wrong parameters."""
        write_csv(obedient(truth, 60.0, noise_m_s=0.01), tmp_path / "waves.csv")
        save_model(wrong, tmp_path / "wrong.yaml")
        return tmp_path / "waves.csv", tmp_path / "wrong.yaml"

    def test_fit(self, run: Callable[..., tuple[int, str, str]], files: tuple[Path, Path]) -> None:
        log, model = files
        status, out, _ = run("fit", model, log, "-o", "new.yaml", "--json", "f.json")
        assert status == 0 and "The held-out acceleration error changes by" in out and "Saved: new.yaml" in out
        found = json.loads(Path("f.json").read_text())
        assert found["rmse_after"]["total"] < 0.5 * found["rmse_before"]["total"]
        low, high = found["held_out_drop_ci95"]
        assert low < found["held_out_drop"] < high
        assert load_model("new.yaml").effects[1].values()["a"] == pytest.approx(0.3, rel=0.1)

    def test_remove(self, run: Callable[..., tuple[int, str, str]], files: tuple[Path, Path]) -> None:
        log, model = files
        status, out, _ = run("remove", "ground_effect", model, log, "-o", "new.yaml", "--json", "r.json")
        assert status == 0 and "is worse without it" in " ".join(out.split())
        found = json.loads(Path("r.json").read_text())
        assert found["removed"] == "ground_effect.exponential" and found["refitted"]
        assert found["p_value"] < 1e-4 and found["held_out_drop"] < 0.0
        assert [effect.family() for effect in load_model("new.yaml").effects] == ["thrust_scale"]

    def test_remove_without_logs_refits_nothing_and_says_so(
        self, run: Callable[..., tuple[int, str, str]], files: tuple[Path, Path]
    ) -> None:
        _, model = files
        status, out, _ = run("remove", "thrust_scale", model, "-o", "new.yaml")
        assert status == 0 and "Nothing was refitted" in out
        (ground,) = load_model("new.yaml").effects
        assert ground.values() == load_model(model).effects[1].values()

    def test_a_wrong_name_ends_in_one_sentence(
        self, run: Callable[..., tuple[int, str, str]], files: tuple[Path, Path]
    ) -> None:
        log, model = files
        for arguments in (
            ("remove", "tether", model, "-o", "n.yaml"),
            ("remove", "tether", model, log, "-o", "n.yaml"),
        ):
            status, _, err = run(*arguments)
            assert status == 1 and err.count("\n") == 1 and "holds no effect 'tether'" in err
            assert not Path("n.yaml").exists()

    def test_nothing_that_is_read_is_overwritten(
        self, run: Callable[..., tuple[int, str, str]], files: tuple[Path, Path]
    ) -> None:
        log, model = files
        for command in (("fit", model, log), ("remove", "thrust_scale", model), ("remove", "thrust_scale", model, log)):
            status, _, err = run(*command, "-o", model)
            assert status == 1 and "is read by this command" in err
