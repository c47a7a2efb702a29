"""The scripts of examples/ run, use the public interface only, and print what their page promises."""

import ast
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.support.places import ROOT

EXAMPLES = ROOT / "examples"
SCRIPTS = sorted(path for path in EXAMPLES.glob("*.py") if path.stem != "simulator")
PUBLIC = {"quadctl.lab", "quadctl.effects", "quadctl.numeric", "quadctl.vehicle"}


def printed(name: str) -> str:
    """Standard output of a script, run as a user runs it."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    command = [sys.executable, EXAMPLES / f"{name}.py"]
    run = subprocess.run(command, capture_output=True, text=True, check=False, env=environment)
    assert run.returncode == 0, run.stderr
    return run.stdout


def number(pattern: str, text: str) -> float:
    """The number that a pattern with one group finds in a text."""
    found = re.search(pattern, text)
    assert found, f"{pattern} is not in: {text}"
    return float(found[1])


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda path: path.stem)
def test_an_example_uses_the_public_interface_only(script: Path) -> None:
    nodes = ast.walk(ast.parse(script.read_text()))
    imported = {node.module for node in nodes if isinstance(node, ast.ImportFrom) and node.module}
    assert {module for module in imported if module.startswith("quadctl")} <= PUBLIC


def test_every_example_stands_on_their_page() -> None:
    page = (EXAMPLES / "README.md").read_text()
    assert [script.name for script in SCRIPTS if f"({script.name})" not in page] == []


@pytest.mark.long
def test_the_missing_effect_is_found_in_a_log() -> None:
    text = printed("find_the_missing_effect")
    assert "missing: ground_effect\n" in text
    assert number(r"held-out error: .* -> ([\d.]+)", text) < 0.5 * number(r"held-out error: ([\d.]+)", text)


@pytest.mark.long
def test_an_effect_of_ones_own_is_fitted_and_compared() -> None:
    text = printed("write_your_own_effect")
    own = number(r"ground_bell.gaussian +held-out error ([\d.]+)", text)
    assert own < number(r"ground_effect.hayden +held-out error ([\d.]+)", text)


@pytest.mark.long
def test_the_fitted_compensator_follows_a_step_best() -> None:
    text = printed("compare_compensators")
    error = {name: number(rf"{name} +([\d.]+) m", text) for name in ("none", "hayden", "fitted")}
    assert error["fitted"] < 0.7 * error["none"]
    assert error["fitted"] < error["hayden"]
