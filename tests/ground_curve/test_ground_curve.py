"""`quadctl ground-curve`: tables made from a known formula give it back; bad tables get their sentence."""

import json
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner, Result

from quadctl.cli import app
from quadctl.effects import Conditions
from quadctl.effects.ground_effect import Cheeseman, Exponential, NearGround, Sanchez, Surface
from quadctl.effects.ground_effect_hexarotor import HexarotorTilted
from quadctl.ground_curve import curves
from quadctl.ground_curve.curves import Table, p_same, tilted
from quadctl.ground_curve.measurement import Measurement, Point
from quadctl.ground_curve.plot import ratio_over_height
from quadctl.ground_curve.result import GroundCurve, Kind, evaluate
from quadctl.model import load_model
from quadctl.vehicle import Vehicle, load_vehicle
from quadctl.words import Facts, Kinds
from tests.support.links import RAPTOR

VEHICLE = load_vehicle(RAPTOR)


@pytest.fixture(autouse=True)
def fewer_draws(monkeypatch: pytest.MonkeyPatch) -> None:
    """A quarter of the draws: intervals are a little coarser."""
    monkeypatch.setattr(curves, "DRAWS", 50)


LEVEL = (1.0, 0.0, 0.0, 0.0)
HEIGHTS_M = tuple(float(z) for z in np.geomspace(0.08, 1.2, 13))


def ratio(effect: NearGround, height_m: float, vehicle: Vehicle = VEHICLE) -> float:
    return float(effect.ratio(Conditions(height_m, (0.0, 0.0, 0.0), LEVEL), vehicle))


def readings(
    effect: NearGround, surface: str = "", noise: float = 0.004, far: float = 1.0, repeats: int = 3, seed: int = 5
) -> list[Point]:
    random = np.random.default_rng(seed)
    return [
        Point(z, far * (ratio(effect, z) + noise * float(random.normal())), surface)
        for z in HEIGHTS_M
        for _ in range(repeats)
    ]


def curve(points: Sequence[Point], is_ratio: bool = True, vehicle: Vehicle = VEHICLE) -> GroundCurve:
    return evaluate(Measurement(tuple(points), is_ratio), vehicle, "bench.csv")


def kinds(result: GroundCurve) -> dict[Kinds, Facts]:
    return {found.kind: found.facts for found in result.findings()}


def run(*words: str | Path) -> Result:
    return CliRunner().invoke(app, ["ground-curve", *map(str, words), "--vehicle", str(RAPTOR)])


def as_csv(path: Path, header: str, rows: Sequence[Sequence[object]]) -> Path:
    path.write_text("\n".join([header, *(",".join(map(str, row)) for row in rows)]) + "\n")
    return path


@pytest.mark.parametrize("truth", [Exponential(0.3, 6.0), Sanchez(1.0)])
def test_the_true_formula_is_best_and_its_numbers_are_within_their_intervals(truth: NearGround) -> None:
    result = curve(readings(truth))
    assert result.best.formula.effect is type(truth)
    for name, (low, high) in result.best.ci95.items():
        assert low <= getattr(truth, name) <= high
    assert result.best.held_out == pytest.approx(0.004, rel=0.5)


def test_of_newtons_the_thrust_far_from_the_ground_is_fitted_too() -> None:
    result = curve(readings(Sanchez(1.0), far=17.0), is_ratio=False)
    assert result.best.formula.effect is Sanchez
    assert result.best.far[0] == pytest.approx(17.0, rel=0.005)
    assert kinds(result)[Kind.FAR]["far_n"] == result.best.far


def test_each_surface_gets_its_own_k_s() -> None:
    true = {"carpet": -0.4, "concrete": 0.6, "grass": 0.1}
    points = [p for i, (s, k) in enumerate(true.items()) for p in readings(Surface(0.4509, k), s, seed=i)]
    result = curve(points)
    assert result.best.formula.effect is Surface
    for surface, k_s in true.items():
        low, high = result.best.ci95[f"k_s[{surface}]"]
        assert low <= k_s <= high
    assert not result.equals


def test_a_number_at_its_bound_is_printed_as_that_and_without_an_interval() -> None:
    result = curve(readings(Cheeseman()))  # no fountain at all: less than sanchez can say
    sanchez = next(fit for fit in result.fits if fit.formula.effect is Sanchez)
    assert sanchez.values[0] == 0.0
    assert not sanchez.ci95
    assert any("k_b = 0 (at its bound)" in str(found) for found in result.findings())


def test_one_surface_is_not_divided() -> None:
    assert all(fit.formula.effect is not Surface for fit in curve(readings(Sanchez(1.0), "floor")).fits)


def test_formulas_that_noise_hides_are_named_as_not_told_apart() -> None:
    result = curve(readings(Sanchez(1.0), noise=0.05, repeats=1))
    assert len(result.equals) > 2
    assert kinds(result)[Kind.NOT_DISTINCT]["others"] == [fit.formula.name for fit in result.equals]


def test_pure_noise_is_no_ground_effect() -> None:
    result = curve(readings(Exponential(0.0, 5.0), noise=0.01))
    assert Kind.NOT_SEEN in kinds(result)


def test_all_repeats_of_one_height_are_held_out_together() -> None:
    points = [Point(z + shift, 1.1 + shift) for z in (0.1, 0.2, 0.4, 0.8) for shift in (0.0, 0.001)]
    groups = Table(Measurement(tuple(points), True), VEHICLE).groups
    assert [list(group) for group in groups] == [[0, 1], [2, 3], [4, 5], [6, 7]]


def test_a_formula_is_no_different_from_itself() -> None:
    fits = curve(readings(Sanchez(1.0))).fits
    assert p_same(fits[0], fits[0]) == 1.0
    assert p_same(fits[0], fits[-1]) < 0.05


def hexarotor() -> Vehicle:
    places = [(0.28 * np.cos(a), 0.28 * np.sin(a), 0.0) for a in np.radians(range(0, 360, 60))]
    rotors = [{"position_m": p, "spin": ("cw", "ccw")[i % 2]} for i, p in enumerate(places)]
    values = VEHICLE.model_dump(mode="json", exclude_none=True)
    values["rotors"], values["rotor"]["radius_m"] = rotors, 0.1194
    return Vehicle.model_validate(values)


def test_a_bench_with_tilted_rotors_is_known_by_its_columns_of_tilt() -> None:
    random, points = np.random.default_rng(2), []
    for tilt in (10.0, 30.0):
        vehicle = tilted(hexarotor(), tilt, tilt)
        points += [
            Point(z, ratio(HexarotorTilted(), z, vehicle) + 0.002 * float(random.normal()), "", tilt, tilt)
            for z in np.linspace(0.1, 0.9, 13)
        ]
    result = curve(points, vehicle=hexarotor())
    assert result.best.formula.effect is HexarotorTilted
    boundaries = {text.get_text() for text in ratio_over_height(result).axes[0].texts}
    assert {"2.5 R", "3 R"} <= boundaries


def test_the_command_writes_a_figure_numbers_and_a_model_that_loads(tmp_path: Path) -> None:
    rows = [(p.height_m, 1000 / 9.80665 * p.thrust) for p in readings(Exponential(0.3, 6.0), far=17.0)]
    table = as_csv(tmp_path / "bench.csv", "height_m, thrust_g", rows)
    model, picture, numbers = tmp_path / "ground.yaml", tmp_path / "curve.png", tmp_path / "curve.json"
    result = run(table, "--out", model, "--plot", picture, "--json", numbers)
    assert result.exit_code == 0, result.output
    assert "ground_effect.exponential" in result.output
    (stacked,) = load_model(model).stack
    assert isinstance(stacked.effect, Exponential) and stacked.fitted is not None
    assert stacked.fitted.height_m == pytest.approx((0.08, 1.2))
    assert stacked.fitted.ci95["a"][0] < stacked.effect.a < stacked.fitted.ci95["a"][1]
    assert picture.read_bytes().startswith(b"\x89PNG")
    first = json.loads(numbers.read_text())["formulas"][0]
    assert first["formula"] == "ground_effect.exponential" and first["p_same_as_best"] == 1.0
    assert "is there already" in str(run(table, "--out", model).exception)
    assert "must" not in run(table, "--out", model, "--force", "--formula", "sanchez").output
    assert load_model(model).effects[0].name == "ground_effect.sanchez"
    assert "expected another formula" in str(run(table, "--out", model, "--force", "--formula", "kan").exception)
    assert "--formula is 'sanches'" in str(run(table, "--out", model, "--force", "--formula", "sanches").exception)


def test_a_model_holds_all_surfaces_or_the_one_asked_for(tmp_path: Path) -> None:
    points = [*readings(Surface(0.4509, -0.4), "carpet"), *readings(Surface(0.4509, 0.6), "concrete", seed=6)]
    table = as_csv(
        tmp_path / "t.csv", "height_m,thrust_ratio,surface", [(p.height_m, p.thrust, p.surface) for p in points]
    )
    out = tmp_path / "ground.yaml"
    assert run(table, "--out", out).exit_code == 0
    (both,) = load_model(out).effects
    assert both.values() == pytest.approx({"k_b": 0.4509, "k_carpet": -0.4, "k_concrete": 0.6}, abs=0.15)
    refused = str(run(table, "--out", out, "--surface", "lawn", "--force").exception)
    assert refused == "--surface is 'lawn', expected one of: carpet, concrete"
    assert run(table, "--out", out, "--surface", "carpet", "--force").exit_code == 0
    (stacked,) = load_model(out).stack
    assert stacked.effect.values()["k_s"] == pytest.approx(-0.4, abs=0.15)
    assert stacked.fitted is not None and list(stacked.fitted.ci95) == ["k_s"]


GOOD = [(z, ratio(Exponential(0.3, 6.0), z)) for z in HEIGHTS_M]


@pytest.mark.parametrize(
    ("header", "rows", "sentence"),
    [
        ("height_m,thrust_ratio", [(0.2, 1.1), (0.2, 1.2)], "holds one height only, expected 4 or more"),
        ("height_m,thrust_ratio", GOOD[:3], "holds 3 heights"),
        ("height_m,thrust_ratio", [], "holds no readings"),
        ("height_m,thrust_ratio", [(z, 100 * k) for z, k in GOOD], "is it in percent"),
        ("height_m,thrust_ratio", [(z, k - 0.95) for z, k in GOOD], "not its gain"),
        ("height_m,thrust_ratio", [(100 * z, k) for z, k in GOOD], "are these cm?"),
        ("height_m,thrust_ratio", [(1000 * z, k) for z, k in GOOD], "are these mm?"),
        ("height_cm,thrust_ratio", [(100 * z, k) for z, k in GOOD], "has the column height_cm, expected height_m"),
        ("height_m", [(z,) for z, _ in GOOD], "its columns are height_m; expected"),
        ("height_m,thurst_n", GOOD, "unknown column 'thurst_n'"),
        ("height_m,thrust_n,thrust_g", [(z, k, k) for z, k in GOOD], "expected one column of thrust"),
        ("height_m,thrust_ratio", [(-0.1, 1.2), *GOOD], "line 2: height_m is -0.1, expected"),
        ("height_m,thrust_ratio", [*GOOD, (0.3, "n/a")], "line 15: thrust_ratio is 'n/a', expected a number"),
        ("height_m,thrust_ratio", [*GOOD, (0.3, "nan")], "thrust_ratio is 'nan', expected a number"),
        ("height_m,thrust_ratio", [*GOOD, (0.3,)], "thrust_ratio is '', expected a number"),
        ("height_m,thrust_n", [(z, 17.0) for z, _ in GOOD], "thrust is 17 at every height"),
        ("height_m,thrust_n", [(z, 1700 * k) for z, k in GOOD], "expected newtons"),
        ("height_m,thrust_n", [(z, 17 * (k - 2)) for z, k in GOOD], "expected a thrust above 0"),
        ("height_m,thrust_ratio,surface", [(z, k, "") for z, k in GOOD], "surface is empty"),
    ],
)
def test_a_bad_table_gets_its_sentence(
    tmp_path: Path, header: str, rows: Sequence[Sequence[object]], sentence: str
) -> None:
    table = as_csv(tmp_path / "bad.csv", header, rows)
    error = str(run(table).exception)
    assert error.startswith(str(table)) and sentence in error, error


@pytest.mark.parametrize("make", [lambda p: p / "none.csv", lambda p: p])
def test_a_file_that_cannot_be_read_gets_its_sentence(tmp_path: Path, make: Callable[[Path], Path]) -> None:
    assert str(make(tmp_path)) in str(run(make(tmp_path)).exception)
