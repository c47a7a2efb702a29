"""docs/architecture.md shows the code as it is: its rooms, their imports, and functions that exist."""

import ast
import re
from pathlib import Path

import pytest

from studies import architecture
from studies.architecture import Graph, Rooms
from tests.support.places import ROOT

PAGE = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
FUNCTION = re.compile(r"`([\w/]+\.py):([\w.]+)`")


@pytest.fixture(scope="module")
def modules() -> Graph:
    return architecture.module_imports()


def exists(path: Path, name: str) -> bool:
    """Tell whether a module defines a function, a class, or a method (`Class.method`)."""
    body: list[ast.stmt] = ast.parse(path.read_text(encoding="utf-8")).body
    for part in name.split("."):
        found = [
            node
            for node in body
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef) and node.name == part
        ]
        if not found:
            return False
        body = found[0].body
    return True


def steps(heading: str) -> list[str]:
    """The numbered steps under a heading of the page."""
    section = PAGE.split(f"\n## {heading}\n")[1].split("\n## ")[0]
    return re.findall(r"^\d+\. .*(?:\n   .*)*", section, re.MULTILINE)


def test_the_page_shows_the_rooms_as_they_are(modules: Graph) -> None:
    every = [architecture.rooms_of(package, modules) for package in architecture.PACKAGES]
    assert architecture.written(PAGE, architecture.tables(every, modules)) == PAGE, "run: make architecture"


@pytest.mark.parametrize("package", architecture.PACKAGES)
def test_the_picture_shows_the_rooms_and_their_imports_as_they_are(package: str, modules: Graph) -> None:
    rooms = architecture.rooms_of(package, modules)
    picture = (ROOT / "docs" / rooms.picture).read_text(encoding="utf-8")
    assert picture == architecture.drawn(rooms), "run: make architecture"


@pytest.mark.parametrize("heading", ["One tick of control", "One log in the lab"])
def test_a_path_has_ten_steps_through_functions_that_exist(heading: str) -> None:
    path = steps(heading)
    assert len(path) == 10
    named = [FUNCTION.findall(step) for step in path]
    assert all(named)
    assert [f"{file}:{name}" for step in named for file, name in step if not exists(ROOT / file, name)] == []


def test_a_name_that_is_not_there_is_noticed() -> None:
    loop = ROOT / "quadctl" / "flight" / "loop.py"
    assert exists(loop, "fly")
    assert not exists(loop, "flew")


def test_a_room_imports_whatever_one_of_its_modules_imports() -> None:
    graph = {"quadctl.web.page": frozenset({"quadctl.lab.fitting.fitter"}), "quadctl.lab.fitting.fitter": frozenset()}
    assert architecture.rooms_of("quadctl", {**graph}).imports == {"web": {"lab"}, "lab": set()}


def test_rooms_that_import_each_other_are_a_circle() -> None:
    graph = {"a": frozenset("b"), "b": frozenset("c"), "c": frozenset("b"), "d": frozenset()}
    assert architecture.circles(graph) == [["b", "c"]]


def test_an_arrow_that_a_longer_way_implies_is_left_out() -> None:
    graph = {"top": frozenset({"middle", "low"}), "middle": frozenset({"low"}), "low": frozenset()}
    assert architecture.without_implied(graph) == {"top": {"middle"}, "middle": {"low"}, "low": set()}


def test_a_room_is_drawn_above_all_that_it_imports() -> None:
    imports = {"top": frozenset({"low"}), "low": frozenset()}
    picture = architecture.drawn(Rooms("quadctl", imports, {"top": "", "low": ""}))
    height = {name: float(y) for y, name in re.findall(r'<text x="\d+" y="(\d+)">(\w+)</text>', picture)}
    assert height["top"] < height["low"]
