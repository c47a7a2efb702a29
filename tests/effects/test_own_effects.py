"""A user's own effect is one Python file, or an announced one: found, checked, fitted, saved, tried and flown."""

import re
from collections.abc import Callable
from importlib.metadata import EntryPoint
from pathlib import Path

import cloudpickle
import pytest
import yaml
from typer.testing import CliRunner

import quadctl.sitl.run
from quadctl.cli import app
from quadctl.effects import CATALOG, Conditions, catalog, catalog_with, choose_effect, every_effect, find_effect
from quadctl.effects.base import HOOKS, VARIABLES, Effect, Identifiability, Physics, Prior
from quadctl.effects.user import ATTRIBUTES, DECLARED, effects_of
from quadctl.errors import SettingsError
from quadctl.flight.preflight.preparation import prepare_flight
from quadctl.lab.flights.flight import SPAN_UNITS
from quadctl.lab.flights.prediction import GROUPS, concerns
from quadctl.logs.convert import convert
from quadctl.model import Model, load_model, save_model
from quadctl.vehicle import Vehicle
from tests.support.flights import obedient
from tests.support.places import ROOT

PAGE = ROOT / "docs" / "own-effect.md"
TRUTH = {"loss": 0.15, "worst_m_s": 0.5}
WRITE = Callable[..., Path]

WARM_ACCELEROMETER = """
from dataclasses import dataclass
from typing import ClassVar
from quadctl.effects import Conditions, Effect, parameter
from quadctl.numeric import Vector

@dataclass(frozen=True)
class Warmth(Effect):
    name: ClassVar[str] = "imu_warmth.ramp"
    source: ClassVar[str] = "test"
    depends_on: ClassVar[tuple[str, ...]] = ("time",)
    physics: ClassVar[str] = "The accelerometer warms up."
    distinguished_by: ClassVar[str] = "a long flight"
    mission: ClassVar[str] = "missions/hover_staircase.yaml"
    per_s: float = parameter(0.0, -0.1, 0.1, "m/s^3", "growth of the bias along body z")

    def sensed_m_s2(self, c: Conditions) -> Vector:
        return 0.0, 0.0, self.per_s * c.time_s
"""


@pytest.fixture(scope="session")
def source() -> str:
    """The effect that the documentation shows."""
    shown = re.search(r"```python\n(.*?)```", PAGE.read_text(), re.DOTALL)
    assert shown
    return shown[1]


@pytest.fixture
def write(tmp_path: Path, source: str) -> WRITE:
    """Write the effect of the documentation, with pieces of its text replaced."""

    def _write(*changes: tuple[str, str], name: str = "my_effect.py") -> Path:
        text = source
        for old, new in changes:
            assert old in text
            text = text.replace(old, new)
        (tmp_path / name).write_text(text)
        return tmp_path / name

    return _write


@pytest.fixture
def wake(write: WRITE, raptor: Vehicle) -> Model:
    """A vehicle that loses thrust in its own wake."""
    return Model(raptor).plus(effects_of(write())["vortex_ring.bump"].from_values(TRUTH, "test"))


def described(heading: str) -> list[str]:
    """First words of the rows of the table below a heading of the documentation."""
    section = re.search(rf"^### {re.escape(heading)}$(.*?)(?=^#)", PAGE.read_text(), re.DOTALL | re.MULTILINE)
    assert section, heading
    return re.findall(r"^\| `(\w+)` \|", section[1], re.MULTILINE)


class TestItsDocumentation:
    """docs/own-effect.md lists all that an effect can declare, and nothing else."""

    def test_lists_the_words_of_depends_on(self) -> None:
        assert described("Words of `depends_on`") == list(VARIABLES)

    def test_lists_the_required_attributes(self) -> None:
        assert described("Class attributes that every effect has") == list(DECLARED)

    def test_lists_the_methods_by_which_an_effect_acts(self) -> None:
        assert described("Methods by which it acts") == list(HOOKS)

    @pytest.mark.parametrize("part", [Physics, Prior, Identifiability])
    def test_lists_what_is_optional_in_each_part(self, part: type) -> None:
        methods = [n for n, value in vars(part).items() if callable(value) or isinstance(value, classmethod)]
        given = {"acts_by", *HOOKS}  # listed elsewhere, or what follows from them
        optional = [name for name in methods if name[0] != "_" and name not in given]
        attributes = [name for name in part.__annotations__ if name not in DECLARED]
        of_all = ["formula"] if part is Physics else []
        assert described(part.__name__) == [*of_all, *attributes, *optional]

    def test_lists_optional_attributes_with_their_defaults(self) -> None:
        for name in (name for name in ATTRIBUTES if name not in DECLARED):
            default = repr(getattr(Effect, name)).replace("'", '"')
            assert f"\n| `{name}` | `{default}` |" in PAGE.read_text()

    def test_lists_what_needs_may_name(self) -> None:
        (row,) = re.findall(r"^\| `needs` (\|.*)$", PAGE.read_text(), re.MULTILINE)
        assert set(SPAN_UNITS) - set(VARIABLES) <= set(re.findall(r"`(\w+)`", row))


class TestAFile:
    def test_its_effects_come_by_name(self, write: WRITE) -> None:
        kind = effects_of(write())["vortex_ring.bump"]
        assert [p.name for p in kind.parameters()] == ["loss", "worst_m_s"]

    def test_what_begins_with_an_underscore_is_its_own_affair(self, write: WRITE) -> None:
        path = write(
            ("class VortexRing", "class _Base(ThrustRatio):\n    pass\n\n\n@dataclass(frozen=True)\nclass VortexRing")
        )
        assert list(effects_of(path)) == ["vortex_ring.bump"]

    def test_the_same_file_gives_the_same_classes_until_it_changes(self, write: WRITE) -> None:
        path = write()
        before = effects_of(path)
        assert effects_of(path) == before
        write(("0.1, 0.0, 0.6", "0.2, 0.0, 0.65"))
        assert effects_of(path)["vortex_ring.bump"]().values()["loss"] == 0.2

    def test_it_leaks_into_no_other_model(self, write: WRITE) -> None:
        assert "vortex_ring.bump" in catalog_with([write()])
        assert "vortex_ring.bump" not in CATALOG
        with pytest.raises(SettingsError, match=r"^m\.yaml: there is no effect 'vortex_ring.bump'"):
            find_effect("vortex_ring.bump", "m.yaml")

    def test_its_effects_reach_other_processes(self, wake: Model) -> None:
        # How joblib sends them: by value, as no other process could import the file by name.
        assert b"worst_m_s" in cloudpickle.dumps(type(wake.effects[0]))
        back = cloudpickle.loads(cloudpickle.dumps(wake.effects[0]))
        assert back.values() == TRUTH

    @pytest.mark.parametrize(
        ("change", "sentence"),
        [
            (("from dataclasses", "1 / 0\nfrom dataclasses"), r"line 3 fails \(ZeroDivisionError: division by zero\)"),
            (("class VortexRing(", "class VortexRing(("), r"line \d+ is not Python \(.+\)"),
            (("ThrustRatio, parameter", "Thrust, parameter"), r"line 6 fails \(ImportError: .+\)"),
            (("class VortexRing(ThrustRatio)", "class VortexRing"), r"holds no effect, expected a class derived .+"),
            (("    name:", "    title:"), r"VortexRing declares no name, expected name, source, .+"),
            (("    physics:", "    text:"), r"VortexRing declares no physics, expected name, source, .+"),
            (("vortex_ring.bump", "Vortex"), r"VortexRing is named 'Vortex', expected family\.variant .+"),
            (('("climb_rate",)', '("climbrate",)'),
             r"VortexRing depends on 'climbrate' \(did you mean 'climb_rate'\?\), expected some of .+"),
            (("    name:", '    needs: ClassVar[dict[str, float]] = {"sped": 1.0}\n    name:'),
             r"VortexRing needs a span of 'sped' \(did you mean 'speed'\?\), expected some of .+"),
            (("@dataclass(frozen=True)", ""), r"VortexRing is no dataclass, expected @dataclass\(frozen=True\) .+"),
            (('parameter(0.1, 0.0, 0.6, "", "share of the thrust that is lost at worst")', "0.1"),
             r"VortexRing has a field loss, expected it to be declared: loss: float = parameter\(\.\.\.\)"),
            (("parameter(0.1, 0.0,", "parameter(0.9, 0.0,"), r"VortexRing has loss = 0\.9 within 0\.0 to 0\.6, .+"),
            (("def ratio", "def ration"), r"VortexRing is a ThrustRatio without ratio, expected that method"),
            (("(ThrustRatio)", "(Effect)"), r"VortexRing does nothing, expected one of rotor_thrust, force, .+"),
            (("import Number, exp", "import Number\nfrom math import exp"),
             r"VortexRing fails when it is evaluated \(TypeError: .+\), expected it to take floats and arrays, .+"),
            (("return 1.0 -", "return float('nan') -"), r"VortexRing gives a rotor_thrust that is not finite .+"),
        ],
    )  # fmt: skip
    def test_what_is_wrong_in_it_is_one_sentence(self, write: WRITE, change: tuple[str, str], sentence: str) -> None:
        path = write(change, *([("Conditions, ", "Conditions, Effect, ")] if change[1] == "(Effect)" else []))
        with pytest.raises(SettingsError, match=rf"^{re.escape(str(path))}: {sentence}$"):
            effects_of(path)

    def test_may_declare_itself_by_former_names(self, write: WRITE) -> None:
        path = write(
            (
                "    distinguished_by:",
                "    turns: ClassVar[bool] = True\n    retards = True\n    told_apart_by:",
            )
        )
        kind = effects_of(path)["vortex_ring.bump"]
        assert kind.distinguished_by.startswith("descents at several rates")
        assert kind.affects_moment and kind.adds_lag

    def test_may_act_on_the_accelerometer_alone(self, tmp_path: Path, raptor: Vehicle) -> None:
        path = tmp_path / "my_effect.py"
        path.write_text(WARM_ACCELEROMETER)
        warm = effects_of(path)["imu_warmth.ramp"].from_values({"per_s": 0.001}, "test")
        level = Conditions(1.0, (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0), time_s=20.0)
        assert Model(raptor).plus(warm).sensed_ned_m_s2(level) == pytest.approx((0.0, 0.0, 0.02))

    def test_what_it_affects_follows_from_its_methods(self, tmp_path: Path, write: WRITE) -> None:
        path = tmp_path / "warm.py"
        path.write_text(WARM_ACCELEROMETER)
        warm, (wake,) = effects_of(path)["imu_warmth.ramp"], effects_of(write()).values()
        assert [concerns(warm(), group) for group in GROUPS] == [True, False, True]
        assert [concerns(wake(), group) for group in GROUPS] == [True, False, False]
        path.write_text(
            WARM_ACCELEROMETER
            + "    def torque(self, thrust_n, c, vehicle):\n        return (0.0, 0.0, 0.1 * c.time_s)\n"
        )
        assert concerns(effects_of(path)["imu_warmth.ramp"](), "turning")

    def test_may_declare_what_follows_from_its_methods(self, tmp_path: Path) -> None:
        path = tmp_path / "warm.py"
        path.write_text(
            WARM_ACCELEROMETER.replace("    per_s", "    affects_accelerometer: ClassVar[bool] = True\n    per_s")
        )
        assert "imu_warmth.ramp" in effects_of(path)

    def test_that_is_missing(self, tmp_path: Path) -> None:
        with pytest.raises(
            SettingsError, match=r"none\.py: there is no such file, expected a Python file with an effect$"
        ):
            effects_of(tmp_path / "none.py")

    def test_that_takes_a_name_of_the_catalogue(self, write: WRITE) -> None:
        path = write(("vortex_ring.bump", "rotor_drag.linear"))
        with pytest.raises(
            SettingsError, match=r"my_effect\.py: rotor_drag\.linear is in the catalogue already, expected another"
        ):
            catalog_with([path])

    def test_that_takes_a_name_of_another_file(self, write: WRITE) -> None:
        with pytest.raises(SettingsError, match=r"other\.py: vortex_ring\.bump is in another file already"):
            catalog_with([write(), write(name="other.py")])


class TestAnAnnouncedEffect:
    """An effect announced by the entry points of an installed package."""

    @pytest.fixture
    def announce(self, monkeypatch: pytest.MonkeyPatch) -> Callable[[str, str], None]:
        def _announce(name: str, value: str) -> None:
            entry = EntryPoint(name, value, "quadctl.effects")
            monkeypatch.setattr(catalog, "installed", lambda: {name: entry})

        return _announce

    @pytest.fixture
    def package(self, write: WRITE, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.syspath_prepend(write(name="vortex_package.py").parent)

    @pytest.mark.usefixtures("package")
    @pytest.mark.parametrize("word", ["vortex_ring.bump", "bump", "vortex_ring"])
    def test_is_found_like_the_catalogues(self, announce: Callable[[str, str], None], word: str) -> None:
        announce("vortex_ring.bump", "vortex_package:VortexRing")
        assert find_effect(word, "m.yaml").name == "vortex_ring.bump"
        assert "vortex_ring.bump" in every_effect([])

    def test_is_not_imported_before_it_is_named(self, announce: Callable[[str, str], None]) -> None:
        announce("broken.one", "no_such_package:One")
        assert find_effect("sanchez", "m.yaml").name == "ground_effect.sanchez"
        with pytest.raises(
            SettingsError, match=r"^entry point 'broken.one = no_such_package:One': cannot be loaded \(.+\)$"
        ):
            find_effect("broken.one", "m.yaml")

    @pytest.mark.usefixtures("package")
    def test_that_is_something_else(self, announce: Callable[[str, str], None]) -> None:
        announce("vortex_ring.other", "vortex_package:VortexRing")
        with pytest.raises(
            SettingsError, match=r"the effect is named vortex_ring\.bump, expected the name of the entry"
        ):
            find_effect("vortex_ring.other", "m.yaml")
        announce("vortex_ring.bump", "vortex_package:exp")
        with pytest.raises(SettingsError, match="is no effect, expected a class derived from"):
            find_effect("vortex_ring.bump", "m.yaml")


class TestAModel:
    def test_lists_the_file_relative_to_itself(self, wake: Model, write: WRITE, tmp_path: Path) -> None:
        path = write()
        (tmp_path / "models").mkdir()
        kind = effects_of(path)["vortex_ring.bump"]
        listed = Model(wake.vehicle, effect_files=(path,)).plus(kind())
        save_model(listed, tmp_path / "models" / "fitted.yaml")
        assert yaml.safe_load((tmp_path / "models" / "fitted.yaml").read_text())["effect_files"] == ["../my_effect.py"]
        assert load_model(tmp_path / "models" / "fitted.yaml").effects == (kind(),)

    def test_names_the_file_that_it_cannot_find(self, tmp_path: Path, raptor_path: Path) -> None:
        (tmp_path / "m.yaml").write_text(f"vehicle: {raptor_path}\neffect_files: [gone.py]\n")
        with pytest.raises(SettingsError, match=r"gone\.py: there is no such file"):
            load_model(tmp_path / "m.yaml")


class TestTheWordOfACommand:
    def test_may_be_a_file_with_one_effect(self, write: WRITE) -> None:
        path = write()
        kind, files = choose_effect(str(path), "EFFECT", [])
        assert (kind.name, files) == ("vortex_ring.bump", (path,))

    @pytest.mark.parametrize("word", ["vortex_ring.bump", "bump"])
    def test_may_name_an_effect_in_a_file(self, write: WRITE, word: str) -> None:
        path = write()
        assert choose_effect(f"{path}:{word}", "EFFECT", [path]) == (effects_of(path)["vortex_ring.bump"], (path,))

    def test_must_choose_from_a_file_with_several(self, write: WRITE, source: str) -> None:
        path = write()
        path.write_text(
            source + source[source.index("@dataclass") :].replace("bump", "other").replace("xRing", "xOther")
        )
        with pytest.raises(SettingsError, match=r"holds vortex_ring\.bump, vortex_ring\.other, expected one of them: "):
            choose_effect(str(path), "EFFECT", [])

    def test_may_name_what_the_model_lists(self, write: WRITE) -> None:
        assert choose_effect("bump", "EFFECT", [write()])[0].name == "vortex_ring.bump"

    def test_may_be_an_effect_of_the_catalogue(self) -> None:
        assert choose_effect("sanchez", "EFFECT", []) == (CATALOG["ground_effect.sanchez"], ())


class TestFromLogToFlight:
    @pytest.fixture
    def log(self, wake: Model, tmp_path: Path) -> Path:
        made = obedient(wake, seconds=60.0, noise_m_s=0.002, name="descent.csv")
        return convert(made, "csv", tmp_path / "logs")

    def test_add_fits_it_and_the_model_flies(self, log: Path, write: WRITE, raptor_path: Path, tmp_path: Path) -> None:
        fitted = tmp_path / "fitted.yaml"
        result = CliRunner().invoke(app, ["add", str(write()), str(raptor_path), str(log), "-o", str(fitted)])
        assert result.exit_code == 0, result.output
        model = load_model(fitted)
        assert model.effects[0].values() == pytest.approx(TRUTH, rel=0.1)
        provenance = model.stack[0].fitted
        assert provenance and provenance.rmse_before and provenance.rmse_after
        assert provenance.rmse_after < 0.5 * provenance.rmse_before
        plan = prepare_flight(ROOT / "missions" / "step_response.yaml", None, str(fitted), None)
        assert plan.compensator.effects == model.effects
        assert quadctl.sitl.run.simulate(plan, tmp_path, None, 0).completed

    @pytest.mark.long
    def test_discover_tries_what_the_model_lists(
        self, log: Path, write: WRITE, raptor_path: Path, tmp_path: Path
    ) -> None:
        write()
        (tmp_path / "rigid.yaml").write_text(f"vehicle: {raptor_path}\neffect_files: [my_effect.py]\n")
        found = tmp_path / "found" / "model.yaml"
        result = CliRunner().invoke(app, ["discover", str(tmp_path / "rigid.yaml"), str(log), "-o", str(found)])
        assert result.exit_code == 0, result.output
        assert load_model(found).effects[0].name == "vortex_ring.bump"
        assert yaml.safe_load(found.read_text())["effect_files"] == ["../my_effect.py"]
