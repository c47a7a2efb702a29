"""No output of a command may be one of its inputs: for all commands and all pairs of their parameters."""

import os
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import get_type_hints

import pytest

from quadctl.cli.overwriting import Reads, Writes, WritesInto, marks
from quadctl.effects.rotor_drag import LinearDrag
from quadctl.model import load_model, save_model
from quadctl.vehicle import Vehicle, load_vehicle
from tests.support.commands import Known, Result, commands
from tests.support.places import RAPTOR

MINE = "vehicle: gone.yaml\n"
"""Content of a file that must stay as it is."""


ALL = list(commands())
PAIRS = [
    pytest.param(command, read, written, id=f"{'-'.join(command.words)}: {read} as {written}")
    for command in ALL
    for read, mark in marks(command.function).items()
    if isinstance(mark, Reads)
    for written, other in marks(command.function).items()
    if isinstance(other, Writes | WritesInto)
]


def line(command: Known, values: dict[str, object]) -> list[str]:
    """Words of a command line with these values; whatever else it needs is made up."""
    options, arguments = [], []
    for parameter in command.parameters:
        value = values.get(parameter.name, f"some_{parameter.name}" if parameter.required else None)
        if value is None:
            continue
        if parameter.param_type_name == "argument":
            arguments.append(str(value))
        else:
            options += [max(parameter.opts, key=len), str(value)]
    return [*command.words, *options, *arguments]


@pytest.mark.parametrize("command", ALL, ids=lambda command: "-".join(command.words))
def test_every_parameter_that_is_a_path_says_what_is_done_with_it(command: Known) -> None:
    paths = {name for name, hint in get_type_hints(command.function).items() if "Path" in str(hint)}
    assert paths <= marks(command.function).keys()


@pytest.mark.parametrize(("command", "read", "written"), PAIRS)
def test_what_is_read_is_not_written(
    quadctl: Callable[..., Result],
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
    command: Known,
    read: str,
    written: str,
) -> None:
    mine = tmp_path / "mine.yaml"
    mine.write_text(MINE)
    (tmp_path / "link.yaml").symlink_to(mine)
    os.link(mine, tmp_path / "twin.yaml")
    monkeypatch.chdir(tmp_path)
    for other in (mine, "mine.yaml", "./mine.yaml", tmp_path / "link.yaml", tmp_path / "twin.yaml"):
        for first, second in ((mine, other), (other, mine)):
            done = quadctl(*line(command, {read: first, written: second}))
            assert (done.status, done.err.count("\n")) == (1, 1), done
            assert "is read by this command, expected another file" in done.err or "expected a folder" in done.err
            assert mine.read_text() == MINE


def test_there_are_pairs_of_all_kinds() -> None:
    """Against a test that goes over nothing."""
    names = {pair.id for pair in PAIRS}
    expected = {
        "discover: logs as output",
        "export: now as output",
        "fly: hidden as json_out",
        "vehicle-new: parameters as output",
    }
    assert expected <= names
    assert len(PAIRS) > 60


class TestReadWithIt:
    """Files that a command reads without being given them by name."""

    @pytest.fixture(autouse=True)
    def _here(self, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, quadctl: Callable[..., Result]) -> None:
        monkeypatch.chdir(tmp_path)
        shutil.copy(RAPTOR, "raptor.yaml")
        rigid = load_model("raptor.yaml")
        save_model(rigid.plus(LinearDrag(0.3, 0.4, 0.1)), "drag.yaml")
        Path("flight.csv").write_text("time_s\n")
        Path("flight.meta.yaml").write_text("mission: mine\n")

    def refused(self, done: Result, path: str) -> None:
        assert done.status == 1
        assert done.err == f"quadctl: {path}: is read by this command, expected another file to write the result to\n"

    def test_the_vehicle_of_the_model(self, quadctl: Callable[..., Result], raptor: Vehicle) -> None:
        self.refused(quadctl("fit", "drag.yaml", "flight.csv", "-o", "raptor.yaml"), "raptor.yaml")
        assert load_vehicle("raptor.yaml") == raptor

    def test_the_sidecar_of_a_log(self, quadctl: Callable[..., Result]) -> None:
        self.refused(quadctl("compare", "raptor.yaml", "flight.csv", "--json", "flight.meta.yaml"), "flight.meta.yaml")

    def test_the_configuration_that_nobody_named(self, quadctl: Callable[..., Result]) -> None:
        assert quadctl("init", ".").status == 0
        before = Path("config/flight.yaml").read_text()
        done = quadctl("simulate", "missions/short_hop.yaml", "--json", "config/flight.yaml")
        assert done.err.startswith("quadctl: config/flight.yaml: is read by this command")
        assert Path("config/flight.yaml").read_text() == before

    def test_a_file_of_a_log_that_is_a_folder(self, quadctl: Callable[..., Result]) -> None:
        Path("review").mkdir()
        Path("review/vehicle_attitude.parquet").touch()
        Path("review/metadata.json").write_text("{}")
        self.refused(
            quadctl("compare", "raptor.yaml", "review", "--json", "review/metadata.json"), "review/metadata.json"
        )


def test_nothing_is_written_to_a_file_that_is_named_like_a_log(quadctl: Callable[..., Result], tmp_path: Path) -> None:
    for name in ("old.csv", "old.ULG", "old.bin"):
        done = quadctl("export", RAPTOR, "--to", "numpy", "-o", tmp_path / name)
        assert "is the name of a flight log, expected another file" in done.err


@pytest.mark.parametrize("folder", [".", "/", ".."])
def test_a_folder_without_a_name_is_no_log(quadctl: Callable[..., Result], folder: str) -> None:
    for words in (("compare", "config/vehicles/raptor.yaml", folder), ("check", "figure8", "--log", folder)):
        refused = quadctl(*words)
        assert (refused.status, refused.err) == (1, f"quadctl: {folder}: is a directory, expected a flight log\n")


def test_two_outputs_are_two_files(quadctl: Callable[..., Result], tmp_path: Path) -> None:
    one = tmp_path / "one.json"
    done = quadctl("compare", RAPTOR, "flight.ulg", "--json", one, "--html", one)
    assert "is written by this command already" in done.err
