"""Outside the repository, commands find missions, configuration and vehicles among what is installed with quadctl."""

import json
import os
import subprocess
import sys
from importlib import resources
from importlib.metadata import version
from pathlib import Path

import pytest
import yaml

from quadctl.errors import SettingsError
from quadctl.installed import describe, is_installed, locate, name_of, write_copies
from quadctl.model import Model, load_model, save_model
from quadctl.vehicle import load_vehicle
from tests.support.places import ROOT

EDITED = (
    *sorted((ROOT / "missions").glob("*.yaml")),
    *sorted(path for path in (ROOT / "config").rglob("*") if path.is_file()),
    *sorted(path for path in (ROOT / "sitl").rglob("*") if path.is_file() and path.suffix not in (".py", ".pyc")),
)
"""Files of the repository that a user of the wheel needs too."""


@pytest.fixture
def empty(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty folder that a command runs in."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


class TestLookup:
    def test_what_is_here_goes_first(self, empty: Path) -> None:
        assert is_installed(locate(Path("missions/short_hop.yaml")))
        (empty / "missions").mkdir()
        (empty / "missions/short_hop.yaml").touch()
        assert locate(Path("missions/short_hop.yaml")) == Path("missions/short_hop.yaml")
        assert is_installed(locate(Path("missions/step_response.yaml")))

    @pytest.mark.parametrize("path", ["missions/none.yaml", "short_hop.yaml", "missions/../../settings.py", "/", "."])
    def test_what_is_nowhere_stays_as_it_is(self, empty: Path, path: str) -> None:
        assert locate(Path(path)) == Path(path)

    def test_an_installed_file_is_named_as_it_is_found(self, empty: Path) -> None:
        path = Path("config/vehicles/raptor.yaml")
        assert name_of(locate(path)) == path
        assert name_of(Path("other.yaml")) == Path("other.yaml")

    def test_it_is_said_which_one_is_used(self, empty: Path) -> None:
        path = Path("config/flight.yaml")
        assert (
            describe("configuration", locate(path))
            == "configuration: the one installed with quadctl (quadctl init DIR copies it for editing)"
        )
        write_copies(empty)
        assert describe("configuration", locate(path)) == "configuration: config/flight.yaml"

    def test_a_model_of_an_installed_vehicle_holds_the_vehicle_itself(self, empty: Path) -> None:
        path = locate(Path("config/vehicles/raptor.yaml"))
        save_model(load_model(path), "model.yaml")
        assert str(path.parent) not in Path("model.yaml").read_text()
        assert load_model("model.yaml").vehicle == load_vehicle(path)
        save_model(Model(load_vehicle(path), vehicle_path=Path("mine.yaml")), "model.yaml")
        assert yaml.safe_load(Path("model.yaml").read_text())["vehicle"] == "mine.yaml"


class TestCopies:
    def test_hold_all_that_can_be_edited(self, empty: Path) -> None:
        assert write_copies(empty / "flights") == [empty / "flights" / name for name in ("config", "missions", "sitl")]
        copied = {path.relative_to(empty / "flights") for path in (empty / "flights").rglob("*") if path.is_file()}
        assert copied == {path.relative_to(ROOT) for path in EDITED}
        assert os.access(empty / "flights/sitl/px4/start.sh", os.X_OK)

    def test_overwrite_nothing(self, empty: Path) -> None:
        (empty / "missions").mkdir()
        with pytest.raises(SettingsError, match=r"missions: is there already and would be overwritten, expected"):
            write_copies(empty)
        assert [path.name for path in empty.iterdir()] == ["missions"]

    def test_cannot_be_made_in_a_file(self, empty: Path) -> None:
        (empty / "file").touch()
        with pytest.raises(SettingsError, match="file: cannot be written"):
            write_copies(empty / "file")


def test_the_package_holds_what_is_edited_in_the_repository() -> None:
    """`importlib.resources` finds every one of these files, here through the links in the package."""
    package = resources.files("quadctl")
    for path in EDITED:
        inside = path.relative_to(ROOT)
        where = inside if inside.parts[0] == "sitl" else Path("installed", inside)
        assert package.joinpath(*where.parts).read_bytes() == path.read_bytes()


@pytest.mark.skipif(int(version("setuptools").split(".")[0]) < 77, reason="an older setuptools than the build's")
def test_the_wheel_packs_what_is_edited_in_the_repository() -> None:
    """setuptools' own list of the data files that go into a wheel; nothing is built or written."""
    listing = (
        "import json, setuptools\n"
        "from setuptools.command.build_py import build_py\n"
        "distribution = setuptools.dist.Distribution()\n"
        "distribution.parse_config_files()\n"
        "build = build_py(distribution)\n"
        "build.ensure_finalized()\n"
        "found = build.get_data_files_without_manifest()\n"
        "print(json.dumps([f'{folder}/{name}' for _, folder, _, names in found for name in names]))\n"
    )
    done = subprocess.run([sys.executable, "-c", listing], cwd=ROOT, capture_output=True, text=True, check=True)
    packed = json.loads(done.stdout.splitlines()[-1])
    for path in EDITED:
        inside = path.relative_to(ROOT)
        folder = "quadctl" if inside.parts[0] == "sitl" else "quadctl/installed"
        assert f"{folder}/{inside}" in packed
