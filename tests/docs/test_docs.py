"""The README and the other pages stay true: their links lead somewhere, and the commands that they show parse."""

import re
import shlex
from pathlib import Path

import pytest
import typer
import yaml

from quadctl import __version__
from quadctl.cli import app
from quadctl.effects import CATALOG
from quadctl.logs.columns import MOTOR_QUANTITIES, OPTIONAL_COLUMNS, PHASE_COLUMN, STATE_COLUMNS, motor_columns
from quadctl.model import load_model
from quadctl.sitl.vehicle.hidden import load_hidden
from quadctl.vehicle import Vehicle
from tests.support.places import ROOT

USAGE_ERROR: type[Exception] = typer.BadParameter.__mro__[1]
"""click's UsageError, wherever typer keeps its click."""
DOCS = sorted((ROOT / "docs").glob("*.md"))
PAGES = [*sorted(ROOT.glob("*.md")), ROOT / "examples" / "README.md", *DOCS]
LINK = re.compile(r"\]\(([^)#\s]+)[^)]*\)|<img src=\"([^\"]+)\"")
BLOCK = re.compile(r"^```\w*\n(.*?)^```", re.MULTILINE | re.DOTALL)
NAMED = re.compile(r"`((?:quadctl|sitl|missions|config|docs|tests|studies|examples)/[\w./-]+)`")


def name(page: Path) -> str:
    return str(page.relative_to(ROOT))


def commands(page: Path, program: str) -> list[str]:
    """Lines of the page's blocks that call `program`, without prompt and comment."""
    lines = [line.removeprefix("$ ") for block in BLOCK.findall(page.read_text()) for line in block.splitlines()]
    return [line.partition(" #")[0].strip() for line in lines if line.startswith(f"{program} ")]


@pytest.mark.parametrize("page", PAGES, ids=name)
class TestEveryPage:
    def test_links_to_what_is_there(self, page: Path) -> None:
        links = ["".join(found) for found in LINK.findall(page.read_text())]
        assert [link for link in links if "://" not in link and not (page.parent / link).exists()] == []

    def test_names_files_that_are_there(self, page: Path) -> None:
        assert [file for file in NAMED.findall(page.read_text()) if not (ROOT / file).exists()] == []

    def test_shows_commands_that_parse(self, page: Path) -> None:
        wrong = {}
        for command in commands(page, "quadctl"):
            try:
                parse(command)
            except USAGE_ERROR as error:
                wrong[command] = str(error)
        assert wrong == {}

    def test_names_targets_of_the_makefile(self, page: Path) -> None:
        targets = re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(), re.MULTILINE)
        inline = re.findall(r"`(make [a-z-]+)`", page.read_text())
        assert {shown.removeprefix("make ") for shown in [*inline, *commands(page, "make")]} <= set(targets)


def parse(command: str) -> None:
    """Parse a command line without running it.

    Raises
    ------
    USAGE_ERROR
        The command, an argument or an option is not as `quadctl` has it.
    """
    group = typer.main.get_group(app)
    _, *words = shlex.split(command.replace("...", ""))
    with group.make_context("quadctl", words) as context:
        _, subcommand, rest = group.resolve_command(context, words)
        assert subcommand is not None
        subcommand.make_context(subcommand.name, rest, parent=context)


def test_a_command_with_an_unknown_option_is_noticed() -> None:
    with pytest.raises(USAGE_ERROR, match="--nonsense"):
        parse("quadctl compare raptor.yaml flight.csv --nonsense")


def test_every_family_of_effects_stands_on_the_page_of_effects() -> None:
    shown = set(re.findall(r"^\| `([a-z_]+)` \|", (ROOT / "docs" / "effects.md").read_text(), re.MULTILINE))
    assert shown == {effect.family() for effect in CATALOG.values()}


def test_every_mission_stands_on_the_page_of_missions() -> None:
    rows = re.findall(r"^\| (`\w+\.yaml`.*?) \|", (ROOT / "docs" / "missions.md").read_text(), re.MULTILINE)
    shown = set()
    for row in rows:
        files, endings = re.findall(r"`(\w+)\.yaml`", row), re.findall(r"`(_\w+)`", row)
        shown |= {*files, *(files[-1] + ending for ending in endings)}
    assert shown == {file.stem for file in (ROOT / "missions").glob("*.yaml")}


def test_every_command_stands_on_the_page_of_commands() -> None:
    shown = re.findall(r"`quadctl ([a-z-]+)", (ROOT / "docs" / "commands.md").read_text())
    assert set(typer.main.get_group(app).commands) - {"demo"} <= set(shown)


def test_every_column_of_a_log_stands_on_the_page_of_the_log_format() -> None:
    shown = (ROOT / "docs" / "log-format.md").read_text()
    motors = [motor_columns(1, quantity)[0] for quantity in MOTOR_QUANTITIES]
    columns = [*STATE_COLUMNS, *motors, *OPTIONAL_COLUMNS, PHASE_COLUMN]
    assert [column for column in columns if f"`{column}`" not in shown] == []


def test_every_field_of_a_vehicle_and_a_model_stands_on_the_page_of_file_formats(tmp_path: Path) -> None:
    page = (ROOT / "docs" / "file-formats.md").read_text()
    vehicle, model, hidden = re.findall(r"```yaml\n(.*?)```", page, re.DOTALL)
    (tmp_path / "raptor.yaml").write_text(vehicle)
    (tmp_path / "my_effect.py").write_text("")
    (tmp_path / "hidden.yaml").write_text(hidden)
    assert set(yaml.safe_load(vehicle)) == set(Vehicle.model_fields)
    (tmp_path / "model.yaml").write_text(model.replace("effect_files: [my_effect.py]", ""))
    assert [effect.name for effect in load_model(tmp_path / "model.yaml").effects] == ["ground_effect.exponential"]
    assert load_hidden(tmp_path / "hidden.yaml").noise.rpm == 20


def test_the_first_screen_of_the_readme_shows_a_picture_and_two_commands() -> None:
    first = (ROOT / "README.md").read_text().splitlines()[:35]
    assert sum("<img" in line for line in first) == 1
    assert [line.split()[1] for line in first if line.startswith("make ")] == ["demo", "test"]


def test_every_page_is_in_the_navigation_of_the_site() -> None:
    listed = re.findall(r"[\w-]+\.md", (ROOT / "mkdocs.yml").read_text())
    assert {page.name for page in DOCS} <= set(listed)


def test_the_citation_names_the_version() -> None:
    assert yaml.safe_load((ROOT / "CITATION.cff").read_text())["version"] == __version__


def test_the_changelog_begins_with_the_version() -> None:
    latest = re.search(r"^## \[([\d.]+)\]", (ROOT / "CHANGELOG.md").read_text(), re.MULTILINE)
    assert latest and latest[1] == __version__


def test_the_tutorial_shows_the_commands_of_its_template() -> None:
    page = ROOT / "docs" / "find-the-missing-effect.md"
    template = (ROOT / "studies" / "tutorial.md.j2").read_text()
    run = re.findall(r'^(?:\{\{ t\.run\(")?(quadctl [^"\n]+)', template, re.MULTILINE)
    assert commands(page, "quadctl") == run


def test_every_figure_of_the_tutorial_is_small_and_shown() -> None:
    page = (ROOT / "docs" / "find-the-missing-effect.md").read_text()
    for figure in (ROOT / "docs").glob("tutorial-*.png"):
        assert figure.name in page
        assert figure.stat().st_size <= 60_000
