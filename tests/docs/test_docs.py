"""The README and the pages of docs/ stay true: what they link to is there, and the commands that they show parse."""

import re
import shlex
from pathlib import Path

import pytest
import typer

from quadctl.cli import app
from quadctl.effects import CATALOG
from tests.support.places import ROOT

USAGE_ERROR: type[Exception] = typer.BadParameter.__mro__[1]
"""click's UsageError, wherever typer keeps its click."""
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
LINK = re.compile(r"\]\(([^)#\s]+)[^)]*\)|<img src=\"([^\"]+)\"")
BLOCK = re.compile(r"^```\w*\n(.*?)^```", re.MULTILINE | re.DOTALL)
NAMED = re.compile(r"`((?:quadctl|sitl|missions|config|docs|tests|papers|benchmarks)/[\w./-]+)`")


def name(page: Path) -> str:
    return str(page.relative_to(ROOT))


def commands(page: Path, program: str) -> list[str]:
    """The lines of the page's blocks that call `program`, without prompt and comment."""
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


def test_every_family_of_effects_stands_in_the_readme() -> None:
    shown = set(re.findall(r"^\| `([a-z_]+)` \|", (ROOT / "README.md").read_text(), re.MULTILINE))
    assert {effect.family() for effect in CATALOG.values()} <= shown


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
