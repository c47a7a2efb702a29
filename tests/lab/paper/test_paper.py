"""Specification of the files for a paper."""

import dataclasses
import json
import math
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from quadctl.effects.ground_effect import Exponential
from quadctl.effects.thrust_scale import ConstantScale
from quadctl.lab.flights.dataset import load_dataset
from quadctl.lab.paper import Statement, paper_files, state
from quadctl.lab.paper.latex import citation_key, escape, symbol
from quadctl.lab.paper.statement import ljung_box
from quadctl.lab.selection.rule import RULE
from quadctl.logs.csv_log import write_csv
from quadctl.model import Model
from tests.support.commands import Result
from tests.support.flights import obedient

NASTY = r"50%_of{a}\b$c&#~^.csv"
COMMAND = "quadctl report raptor.yaml a_b.csv --paper out"
TRUTH = Exponential(a=0.15, b=4.5)


def stated(model: Model, truth: Model, name: str = "made.csv") -> Statement:
    log = dataclasses.replace(obedient(truth, 120.0, noise_m_s=0.005), name=name)
    return state(model, load_dataset([log], truth.vehicle), COMMAND)


@pytest.fixture(scope="module")
def of_ground_effect(rigid: Model) -> Statement:
    return stated(rigid.plus(Exponential()), rigid.plus(TRUTH))


def assert_is_whole(tex: str) -> None:
    """Braces are balanced, and environments closed in order."""
    bare = re.sub(r"\\\\|\\[{}]", "", tex)
    assert bare.count("{") == bare.count("}")
    opened: list[str] = []
    for kind, name in re.findall(r"\\(begin|end)\{(\w+\*?)\}", tex):
        if kind == "begin":
            opened.append(name)
        else:
            assert opened.pop() == name
    assert not opened


class TestFiles:
    def test_the_truth_stands_in_the_intervals(self, of_ground_effect: Statement) -> None:
        rows = {row.name: row for row in of_ground_effect.parameters}
        for name, true in (("a", TRUTH.a), ("b", TRUTH.b)):
            low, high = rows[name].ci95
            assert low < rows[name].value < high
            assert rows[name].value == pytest.approx(true, rel=0.1)
        assert of_ground_effect.r_squared["up"] > 0.9
        np.testing.assert_array_equal(np.diag(of_ground_effect.correlation), 1.0)

    def test_the_document_says_what_was_found_and_how(self, of_ground_effect: Statement) -> None:
        files = paper_files(of_ground_effect)
        assert set(files) == {"model.tex", "model.bib", "model.json"}
        tex = files["model.tex"]
        assert_is_whole(tex)
        assert r"K = c + a \, e^{-b z}" in tex
        for row in of_ground_effect.parameters:
            assert f"{row.value:.4g}" in tex
        assert "Ljung--Box" in tex
        assert r"quadctl report raptor.yaml a\_b.csv -{}-paper out" in tex
        assert f"SIGNIFICANT = {RULE.significant:g}" in tex
        key = citation_key(Exponential.source)
        assert rf"\cite{{{key}}}" in tex
        assert f"@misc{{{key}," in files["model.bib"]

    def test_the_json_holds_the_same_numbers(self, of_ground_effect: Statement) -> None:
        found = json.loads(paper_files(of_ground_effect)["model.json"])
        assert [entry["value"] for entry in found["parameters"]] == [r.value for r in of_ground_effect.parameters]
        assert found["command"] == COMMAND
        assert found["thresholds"]["SIGNIFICANT"] == RULE.significant
        assert set(found["whiteness"]) == {"north", "east", "up"}
        assert set(found) >= {"logs", "version", "seed", "correlation", "r_squared", "held_out"}

    def test_a_model_without_effects_is_the_rigid_body(self, rigid: Model) -> None:
        files = paper_files(stated(rigid, rigid))
        assert_is_whole(files["model.tex"])
        assert "it is the rigid body" in files["model.tex"]
        assert "Fitted parameters" not in files["model.tex"]
        assert r"\bibliography" not in files["model.tex"]
        assert files["model.bib"] == ""

    def test_special_characters_are_escaped(self, rigid: Model) -> None:
        tex = paper_files(stated(rigid.plus(ConstantScale()), rigid, NASTY))["model.tex"]
        assert_is_whole(tex)
        assert NASTY not in tex
        assert r"50\%\_of\{a\}\textbackslash{}b\$c\&\#\textasciitilde{}\textasciicircum{}.csv" in tex


class TestText:
    def test_what_latex_cannot_print_is_replaced(self) -> None:
        assert escape("a\nb \u4e2d \u2212 \x07") == r"a b ? \ensuremath{-} ?"

    def test_the_rest_of_a_name_is_its_index(self) -> None:
        assert [symbol(name) for name in ("a", "d_x", "area_x_m2")] == [
            "a",
            r"d_{\mathrm{x}}",
            r"\mathrm{area}_{\mathrm{x\_m2}}",
        ]


class TestWhiteness:
    def test_white_noise_passes_and_a_wave_does_not(self) -> None:
        random = np.random.default_rng(1)
        white = [random.standard_normal(500) for _ in range(3)]
        passed = ljung_box(white)
        failed = ljung_box([values + np.sin(0.2 * np.arange(500)) for values in white])
        assert passed is not None
        assert failed is not None
        assert passed.p_value > 0.01
        assert failed.p_value < 1e-6
        assert passed.degrees == 60

    def test_the_statistic_is_that_of_the_definition(self) -> None:
        """Ljung & Box: n (n + 2) sum r_k^2 / (n - k), here with one lag of five values."""
        values = np.array([1.0, -1.0, 1.0, -1.0, 0.0])
        found = ljung_box([values])
        assert found is not None
        assert found.statistic == pytest.approx(5 * 7 * (-3.0 / 4.0) ** 2 / 4)
        assert found.p_value == pytest.approx(math.erfc(math.sqrt(found.statistic / 2.0)))

    def test_a_series_that_is_too_short_has_none(self) -> None:
        assert ljung_box([np.array([1.0, 2.0])]) is None


class TestCommand:
    def test_it_writes_the_files(
        self, quadctl: Callable[..., Result], raptor_path: Path, rigid: Model, tmp_path: Path
    ) -> None:
        write_csv(obedient(rigid), tmp_path / "a.csv")
        result = quadctl("report", raptor_path, tmp_path / "a.csv", "--paper", tmp_path / "out")
        assert result.status == 0, result
        assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["model.bib", "model.json", "model.tex"]
        found = json.loads((tmp_path / "out" / "model.json").read_text())
        assert len(found["logs"]["a.csv"]) == 64

    def test_a_folder_that_cannot_be_made_is_one_sentence(
        self, quadctl: Callable[..., Result], raptor_path: Path, rigid: Model, tmp_path: Path
    ) -> None:
        write_csv(obedient(rigid), tmp_path / "a.csv")
        (tmp_path / "out").write_text("a file")
        result = quadctl("report", raptor_path, tmp_path / "a.csv", "--paper", tmp_path / "out")
        assert result.status == 1
        assert "is a file, expected a folder to write into" in result.err
        assert "Traceback" not in result.out + result.err
