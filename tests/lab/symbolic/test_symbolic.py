"""Formulas for what no effect of the catalogue explains: found if it is there, none if it is not, usable in flight."""

import json
import math
import re
import warnings
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import ClassVar

import numpy as np
import pytest
from rich.console import Console

import quadctl.sitl.vehicle.hidden
from quadctl.effects import Conditions, Effect
from quadctl.effects.user import effects_of
from quadctl.frames import rotate_inverse
from quadctl.lab.arrays import Floats
from quadctl.lab.fitting.fitter import Fitter
from quadctl.lab.flights.dataset import Dataset, load_dataset
from quadctl.lab.selection.addition import add
from quadctl.lab.symbolic.compact_forms import FORMS, Form, fit_form
from quadctl.lab.symbolic.effect_file import CODE, as_effect_file
from quadctl.lab.symbolic.formula import Formula, Symbolic
from quadctl.lab.symbolic.identification import explain, in_frames
from quadctl.lab.symbolic.library import VARIABLES, library, variables_of
from quadctl.logs.flight_log import FlightLog
from quadctl.logs.read import read_log
from quadctl.model import Model
from quadctl.numeric import Number, Vector, exp
from quadctl.vehicle import Vehicle
from tests.support.flights import simulated
from tests.support.places import DATA

HOVERING = DATA / "raptor/HOVERING.csv"
NORTH, EAST, UP = 0, 1, 2


class TestCompactForms:
    @pytest.mark.parametrize(("place", "width"), [(0.0, 1.0), (100.0, 1.0), (-5000.0, 1.0), (16.0, 0.1)])
    @pytest.mark.parametrize("form", FORMS, ids=lambda form: form.template)
    def test_are_fitted_wherever_the_variable_lies(
        self, form: Form, place: float, width: float, capfd: pytest.CaptureFixture[str]
    ) -> None:
        """Far from 0, as north 100 m from the origin, the exponential overflows at most of the starts."""
        random = np.random.default_rng(1)
        x = place + width * random.normal(1.0, 0.2, 500)
        y = 0.2 * (x - place) / width + random.normal(0.0, 0.05, 500)
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            fitted = fit_form(form, x, y)
        assert np.isfinite(fitted.values).all() and np.isfinite(fitted.jacobian).all()
        assert np.sum((form(x, fitted.values) - y) ** 2) <= np.sum(y**2)
        assert capfd.readouterr().err == ""


@pytest.fixture(scope="module")
def plain(raptor: Vehicle, plain_runs: list[FlightLog]) -> Dataset:
    """Runs along the ground and up and down, in a world without any effect."""
    return load_dataset(plain_runs, raptor)


@pytest.fixture(scope="module")
def noise(rigid: Model, plain: Dataset) -> Floats:
    """Residual of the rigid body, shape (n, 3)."""
    return held_out_residual(rigid, plain)


def held_out_residual(model: Model, dataset: Dataset) -> Floats:
    fitter = Fitter(model, dataset)
    return np.asarray((dataset.targets - fitter.held_out(fitter.fit()))[:, :3])


def value(dataset: Dataset, name: str) -> Floats:
    x = dataset.variable(name)
    assert x is not None
    return x


def with_law(noise: Floats, axis: int, law: Floats) -> Floats:
    changed = noise.copy()
    changed[:, axis] += law
    return changed


def covers(formula: Formula, name: str, truth: float, slack: float = 0.0) -> bool:
    """Check that the interval contains the truth, or misses it by no more than `slack`."""
    low, high = formula.ci95[name]
    return low - slack <= truth <= high + slack


class TestFound:
    def test_an_updraft_at_one_place(self, found: Symbolic, noise: Floats) -> None:
        law = found.laws[0]
        assert (law.axis in ("up", "top"), law.compact.variables, len(found.laws)) == (True, ("north",), 1)
        assert law.best is law.compact
        truth = {"a": 0.5, "m": 1.0, "w": 0.5, "c": 0.0}
        assert all(covers(law.compact, name, expected, 0.01) for name, expected in truth.items())
        assert law.compact.coefficients == pytest.approx(truth, abs=0.03)
        # It explains what there is to explain, on data that it has not seen.
        share = 1.0 - np.sum(noise[:, UP] ** 2) / np.sum((noise[:, UP] + law.compact.predicted) ** 2)
        assert law.compact.held_out_share == pytest.approx(share, abs=0.05)

    def test_a_pull_toward_a_line(self, plain: Dataset, noise: Floats) -> None:
        found = explain(with_law(noise, NORTH, -0.3 * (value(plain, "north") - 0.5)), plain)
        assert found
        (law,) = found.laws
        assert (found.frame, law.axis, law.compact.variables) == ("world", "north", ("north",))
        assert law.compact.coefficients == pytest.approx({"a": -0.3, "c": 0.15}, abs=0.01)
        assert law.sparse.parts[0] == "{k1}*north"  # and at most a small term by chance
        assert law.sparse.coefficients["k1"] == pytest.approx(-0.3, abs=0.01)
        assert law.sparse.held_out_share == pytest.approx(law.compact.held_out_share, abs=0.02)

    @pytest.mark.long
    def test_a_pull_toward_a_point_acts_along_two_axes(self, rigid: Model, tmp_path: Path) -> None:
        eights = load_dataset([simulated("figure8", [], 3, tmp_path)], rigid.vehicle)
        away = value(eights, "north") - 0.5, value(eights, "east") - 0.2
        softened = 0.5 + away[0] ** 2 + away[1] ** 2
        quiet = held_out_residual(rigid, eights)
        pulled = with_law(with_law(quiet, NORTH, -0.6 * away[0] / softened), EAST, -0.6 * away[1] / softened)
        found = explain(pulled, eights)
        assert found
        best = {law.axis: law.best for law in found.laws}
        assert set(best) == {"north", "east"}
        assert "north" in best["north"].variables
        assert "east" in best["east"].variables
        assert min(formula.held_out_share for formula in best.values()) > 0.6

    def test_a_resonance_at_one_thrust(self, plain: Dataset, noise: Floats) -> None:
        thrust = value(plain, "thrust")
        found = explain(with_law(noise, UP, -0.6 * np.exp(-(((thrust - 15.5) / 0.4) ** 2))), plain)
        assert found
        compact = found.laws[0].compact
        assert compact.variables == ("thrust",)
        assert compact.coefficients["m"] == pytest.approx(15.5, abs=0.05)
        assert compact.coefficients["a"] == pytest.approx(-0.6, abs=0.05)

    def test_a_law_of_two_variables_stays_a_sum_of_terms(self, plain: Dataset, noise: Floats) -> None:
        u, v = value(plain, "speed_forward"), value(plain, "speed_right")
        found = explain(with_law(noise, NORTH, 0.4 * v - 0.2 * u), plain)
        assert found
        law = found.laws[0]
        assert law.best is law.sparse
        assert {"speed_forward", "speed_right"} <= set(law.sparse.variables) | {"speed"}
        assert law.sparse.held_out_share > 0.8

    @pytest.mark.skipif(not HOVERING.is_file(), reason="the public flight logs are not here")
    def test_the_thesis_ground_effect_in_its_hovering_log(self, rigid: Model) -> None:
        data = load_dataset([read_log(HOVERING)], rigid.vehicle)
        found = explain(held_out_residual(rigid, data), data)
        assert found
        law = found.laws[0]
        assert law.axis in ("up", "top")
        assert law.compact.variables == ("height_over_radius",)
        assert "exp(-0.5*height_over_radius)" in law.sparse.text
        # Appius fits thrust gains of a = 0.114 and b = 5.388 1/m, or 0.147 and 4.368, to this and another log.
        gain = law.compact.coefficients["a"] / 9.80665
        rate = law.compact.coefficients["b"] / rigid.vehicle.rotor.radius_m
        assert 0.09 < gain < 0.16
        assert 3.5 < rate < 6.0


class TestNotFound:
    def test_in_what_the_true_model_leaves(self, plain: Dataset, noise: Floats) -> None:
        assert explain(noise, plain) is None

    @pytest.mark.parametrize("seed", range(2))
    def test_in_noise_that_is_slow(self, plain: Dataset, seed: int) -> None:
        white = np.random.default_rng(seed).standard_normal((len(plain.measured) + 40, 3))
        slow = np.array([np.convolve(column, np.exp(-np.arange(20) / 5.0), "valid") for column in white.T]).T
        assert explain(0.05 * slow[: len(plain.measured)], plain) is None

    def test_in_an_offset(self, plain: Dataset, noise: Floats) -> None:
        assert explain(noise + 0.3, plain) is None

    def test_thrust_is_no_variable_where_it_only_mirrors_what_is_missing(self, plain: Dataset, rigid: Model) -> None:
        assert "thrust" in variables_of(plain)
        still = tuple(replace(f, measured=0.01 * f.measured[::-1]) for f in plain.flights)
        assert "thrust" not in variables_of(Dataset(still))


class TestTheLibrary:
    def test_every_variable_is_known_to_the_effect_file(self) -> None:
        assert set(CODE) == set(VARIABLES)

    def test_terms_are_python_over_their_variables(self, plain: Dataset) -> None:
        variables = variables_of(plain)
        terms = library(variables)
        for term in terms:
            names = {name: variables[name] for name in term.variables}
            value = eval(term.text, {"exp": np.exp, "abs": np.abs, "__builtins__": {}}, names)
            assert np.allclose(value, term.values), term.text
        assert any(term.text == "speed_forward*exp(-1*height_over_radius)" for term in terms)
        assert any("thrust" in term.variables and len(term.variables) == 2 for term in terms)

    @pytest.mark.parametrize("form", FORMS)
    def test_the_compact_forms_come_back(self, form: Form) -> None:
        truth = np.array([{"a": 2.0, "b": 0.7, "m": 3.0, "w": 0.8, "c": 1.0}[name] for name in form.names])
        x = np.linspace(0.5, 6.0, 400)
        assert fit_form(form, x, form(x, truth)).values == pytest.approx(truth, rel=1e-3)


@pytest.fixture(scope="module")
def found(plain: Dataset, noise: Floats) -> Symbolic:
    """Flight through an updraft of 0.5 m/s^2, 0.5 m wide, 1 m north."""
    result = explain(with_law(noise, UP, 0.5 * np.exp(-(((value(plain, "north") - 1.0) / 0.5) ** 2))), plain)
    assert result
    return result


class TestWhatAUserSees:
    def test_json(self, found: Symbolic) -> None:
        back = json.loads(json.dumps(found.to_dict(), allow_nan=False))
        assert back["variables"] == ["north"]
        assert back["expression"].startswith(f"{found.laws[0].axis} = ")
        assert back["laws"][0]["compact"]["coefficients"]["m"] == pytest.approx(1.0, abs=0.03)

    @pytest.mark.parametrize("width", [80, 400])
    def test_the_table_holds_every_formula_whole(self, found: Symbolic, width: int) -> None:
        console = Console(width=width)
        with console.capture() as capture:
            console.print(found)
        shown = re.sub(r"[\s│]+", "", capture.get())
        for law in found.laws:
            assert re.sub(r"\s+", "", f"{law.axis} = {law.sparse.text}") in shown or width < 400
            ends = law.sparse.text.rpartition(" + ")[2].replace(" ", "")
            assert ends.rpartition("*")[2] in shown
            assert f"{law.axis},ofonevariable=" in shown

    @pytest.mark.parametrize(
        ("coefficients", "text"),
        [
            ({"a": -0.5, "b": -2.0, "c": -0.1}, "-0.5*exp(2*north) - 0.1"),
            ({"a": 0.5, "b": 2.0, "c": 0.1}, "0.5*exp(-2*north) + 0.1"),
        ],
    )
    def test_signs_are_written_as_by_hand(self, coefficients: dict[str, float], text: str) -> None:
        parts = ("{a}*exp(-{b}*north)", "{c}")
        assert Formula(parts, ("north",), coefficients, {}, {}, 0.5, np.zeros(1)).text == text


@dataclass(frozen=True)
class Updraft(Effect):
    """Updraft at one place, which is in no catalogue."""

    name: ClassVar[str] = "hidden.updraft"
    depends_on: ClassVar[tuple[str, ...]] = ("north", "east")

    def force(self, total_thrust_n: Number, c: Conditions, vehicle: Vehicle) -> Vector:
        north, east = c.position_ne_m
        lift = 0.6 * vehicle.mass_kg * exp(-((north - 1.0) ** 2 + east**2) / 0.5**2)
        return rotate_inverse(c.attitude, (0.0, 0.0, -lift))


class TestTheEffectFile:
    @pytest.fixture
    def load(self, tmp_path: Path) -> Callable[[str], type[Effect]]:
        def _load(text: str) -> type[Effect]:
            (tmp_path / "found.py").write_text(text)
            return effects_of(tmp_path / "found.py")["unexplained.found"]

        return _load

    @pytest.mark.parametrize(
        ("axis", "law"),
        [
            (UP, lambda d: 3.0 * np.exp(-0.3 * value(d, "height_over_radius"))),
            (NORTH, lambda d: 0.4 * value(d, "speed_right") - 0.2 * value(d, "speed_forward")),
            (NORTH, lambda d: 0.2 * value(d, "north") + 0.6 * np.exp(-(((value(d, "north") - 1.0) / 0.4) ** 2))),
            (EAST, lambda d: 0.3 * value(d, "north") * np.abs(value(d, "north"))),
            (UP, lambda d: -0.1 * value(d, "climb_rate") * value(d, "thrust")),
        ],
    )
    def test_predicts_what_was_found(
        self,
        plain: Dataset,
        noise: Floats,
        rigid: Model,
        load: Callable[[str], type[Effect]],
        axis: int,
        law: Callable[[Dataset], Floats],
    ) -> None:
        found = explain(with_law(noise, axis, law(plain)), plain)
        assert found
        model = rigid.plus(load(as_effect_file(found, "unexplained.found"))())
        change = in_frames(
            plain.aligned_for(model).predicted(model) - plain.aligned_for(rigid).predicted(rigid), plain
        )[found.frame]
        expected = np.zeros_like(change)
        for item in found.laws:
            column = {"north": 0, "forward": 0, "east": 1, "right": 1, "up": 2, "top": 2}[item.axis]
            expected[:, column] = item.best.predicted
        # The effect is filtered after the formula, the formula was found in filtered variables: nearly the same.
        assert math.sqrt(np.mean((change - expected) ** 2)) < 0.03 * math.sqrt(np.mean(expected**2))

    @pytest.mark.long
    def test_is_added_and_helps_on_a_flight_that_was_not_seen(
        self, rigid: Model, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, load: Callable[[str], type[Effect]]
    ) -> None:
        monkeypatch.setitem(quadctl.sitl.vehicle.hidden.HIDDEN_EFFECTS, Updraft.name, Updraft)
        flights = [simulated("forward_runs", [(Updraft.name, {})], seed, tmp_path / str(seed)) for seed in (1, 2)]
        seen, other = (load_dataset([log], rigid.vehicle) for log in flights)
        found = explain(held_out_residual(rigid, seen), seen)
        assert found
        assert "north" in found.variables
        text = as_effect_file(found, "unexplained.found")
        result = add(load(text), rigid, seen)
        assert result.held_out_drop > 0.1
        before, after = (other.aligned_for(m).residual(m)[:, UP] for m in (rigid, result.model))
        assert np.mean(after**2) < 0.5 * np.mean(before**2)
