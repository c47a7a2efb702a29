"""The commands as scripts rely on them: output files, exit status, and one sentence for every bad input."""

import json
import math
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import yaml

from quadctl import __version__
from quadctl.effects.ground_effect import Exponential
from quadctl.errors import LogError
from quadctl.lab.study import HoldOutError
from quadctl.logs.csv_log import write_csv
from quadctl.model import Model, load_model
from quadctl.vehicle import Vehicle
from tests.support.commands import Result
from tests.support.flights import obedient
from tests.support.places import ROOT
from tests.support.rollouts import ROLLOUTS

VEHICLE = str(ROOT / "config/vehicles/raptor.yaml")
MISSION = str(ROOT / "missions/short_hop.yaml")


@pytest.fixture
def quadctl(quadctl: Callable[..., Result], monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Callable[..., Result]:
    """Function that runs a command in an empty directory."""
    monkeypatch.chdir(tmp_path)
    return quadctl


@pytest.fixture(scope="module")
def log(raptor: Vehicle, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A flight of a minute with a ground effect of a = 0.3, b = 6."""
    path = tmp_path_factory.mktemp("log") / "waves.csv"
    truth = Model(raptor).plus(Exponential(a=0.3, b=6.0))
    write_csv(obedient(truth, noise_m_s=0.01), path)
    return path


def one_sentence(result: Result, *words: str, status: int = 1) -> None:
    """The command ended as a user can understand: this status, one sentence with these words, no traceback."""
    assert result.status == status, result
    assert "Traceback" not in result.err + result.out
    assert result.err.strip().count("\n") == 0, result.err
    for word in words:
        assert word in result.err, result.err


class TestCommands:
    def test_compare_forecasts_the_whole_state_where_it_is_asked_to(
        self, quadctl: Callable[..., Result], log: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr("quadctl.lab.rotation.interface.forecast_unseen", lambda logs, model: ROLLOUTS)
        shown = quadctl("compare", VEHICLE, log, "--rollouts", "--json", tmp_path / "c.json")
        assert shown.status == 0 and "Whole state from commands" in shown.out and "Held: " in shown.out
        found = json.loads((tmp_path / "c.json").read_text())
        assert found["rollouts"] == ROLLOUTS.to_dict() and found["flights"] == ["waves.csv"]
        assert "rollouts" not in quadctl("compare", VEHICLE, log).out
        both = quadctl("compare", log, "--sensors", "--rollouts")
        assert both.status != 0 and "--rollouts" in both.err

    def test_a_refusal_of_forecasts_loses_nothing_of_the_comparison(
        self, quadctl: Callable[..., Result], log: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        def refuse(logs: object, model: object) -> None:
            raise LogError("waves.csv: too brief")

        monkeypatch.setattr("quadctl.lab.rotation.interface.forecast_unseen", refuse)
        shown = quadctl("compare", VEHICLE, log, "--rollouts", "--json", tmp_path / "c.json")
        assert shown.status == 1 and "too brief" in shown.err and "Acceleration error" in shown.out
        assert json.loads((tmp_path / "c.json").read_text())["flights"] == ["waves.csv"]

    def test_compare_writes_the_contract(self, quadctl: Callable[..., Result], log: Path, tmp_path: Path) -> None:
        assert quadctl("compare", VEHICLE, log, "--json", tmp_path / "c.json").status == 0
        found = json.loads((tmp_path / "c.json").read_text())
        assert found["flights"] == ["waves.csv"]
        assert {"north", "east", "up", "total"} == found["rmse"].keys() == found["noise_floor"].keys()
        assert isinstance(found["n_samples"], int) and isinstance(found["explained"], float)
        first = found["fails_where"][0]
        assert {
            "axis",
            "variable",
            "from",
            "to",
            "mean_residual",
            "sigma",
            "n",
            "kind",
            "text",
            "also",
            "most_in",
        } == first.keys()
        assert [most["flight"] for most in first["most_in"]] == ["waves.csv"]
        assert found["agreement"] is None

    def test_the_circle(self, quadctl: Callable[..., Result], log: Path, tmp_path: Path) -> None:
        """diagnose names the effect, add fits it, the error falls, the model flies and is measured."""
        done = quadctl("diagnose", VEHICLE, log, "--json", "d.json")
        assert done.status == 0
        lines = [line.removeprefix("* ") for line in done.out.splitlines()]
        rows = [line for line in lines if line.startswith("ground_effect.") and " -> " in line]
        assert rows and all(row.split()[2] == "->" and row.split()[4].endswith("%") for row in rows)  # 80 columns
        diagnosis = json.loads(Path("d.json").read_text())
        assert diagnosis["verdict"] == "missing" and diagnosis["missing"] == ["ground_effect"]

        effect = diagnosis["ranking"][0]["effect"]
        assert quadctl("add", effect, VEHICLE, log, "-o", "out/new.yaml", "--json", "a.json").status == 0
        added = json.loads(Path("a.json").read_text())
        assert added["rmse_after"]["total"] < 0.5 * added["rmse_before"]["total"]
        fitted = load_model("out/new.yaml").effects[0].values()
        assert fitted["a"] == pytest.approx(0.3, rel=0.05) and fitted["b"] == pytest.approx(6.0, rel=0.05)

        later = shutil.copy(log, Path(log).with_name("later.csv"))
        for flight, expected in ((log, False), (later, True)):  # what has changed, a diagnosis fits away
            told = quadctl("diagnose", "out/new.yaml", flight)
            assert (f"says `quadctl verify out/new.yaml {flight}`" in told.out) == expected, told

        shutil.copytree(ROOT / "config", "config")
        for model in ("none", "out/new.yaml"):
            result = quadctl("simulate", MISSION, "--model", model, "--log-dir", "logs", "--json", "s.json")
            assert result.status == 0, result
            assert json.loads(Path("s.json").read_text())["completed"] is True
        flown = sorted(Path("logs").glob("*.csv"))
        assert len(flown) == 2
        assert quadctl("metrics", flown[0], "--reference", flown[1], "--phase", "down", "--json", "m.json").status == 0
        assert json.loads(Path("m.json").read_text())["flights"]

    def test_the_model_of_a_flight_is_in_its_meta_file(self, quadctl: Callable[..., Result]) -> None:
        for word in ("none", "cheeseman", "ground_effect.hayden"):
            result = quadctl(
                "simulate", MISSION, "--model", word, "--config", ROOT / "config/flight.yaml", "--log-dir", word
            )
            assert result.status == 0, result
            meta = yaml.safe_load(next(Path(word).glob("*.meta.yaml")).read_text())
            assert meta["compensator"] == word and meta["ended"] == "completed"
            assert [e["effect"].split(".")[-1] for e in meta["model"]] == (
                [] if word == "none" else [word.split(".")[-1]]
            )

    @pytest.mark.long
    def test_where_no_expression_is_found_it_says_so(self, quadctl: Callable[..., Result], log: Path) -> None:
        done = quadctl("diagnose", VEHICLE, log, "--save-expression", "found.py")
        assert done.status == 0 and "No expression was found: found.py is not written." in done.out
        assert not Path("found.py").exists()

    @pytest.mark.long
    def test_a_report_is_written(self, quadctl: Callable[..., Result], log: Path) -> None:
        for command in (("compare", VEHICLE, log), ("diagnose", VEHICLE, log)):
            assert quadctl(*command, "--html", "r.html").status == 0
            assert "<html" in Path("r.html").read_text()


INSTALLED = "the one installed with quadctl (quadctl init DIR copies it for editing)"


class TestOutsideTheRepository:
    """Every command runs in an empty folder, on what is installed with quadctl, and says so."""

    def test_a_mission_is_flown_and_checked(self, quadctl: Callable[..., Result]) -> None:
        done = quadctl("simulate", "missions/short_hop.yaml")
        assert done.status == 0
        assert f"missions/short_hop.yaml: {INSTALLED}\nconfiguration: {INSTALLED}\n" in done.out
        done = quadctl("check", "config/vehicles/raptor.yaml", "missions/short_hop.yaml")
        assert done.status == 0
        assert f"config/vehicles/raptor.yaml: {INSTALLED}\n" in done.out

    def test_a_mission_of_ones_own_needs_no_configuration_of_ones_own(self, quadctl: Callable[..., Result]) -> None:
        shutil.copy(MISSION, "mine.yaml")
        done = quadctl("simulate", "mine.yaml")
        assert done.status == 0
        assert done.out.startswith(f"configuration: {INSTALLED}\n")

    def test_a_copy_for_editing_goes_first(self, quadctl: Callable[..., Result]) -> None:
        assert quadctl("init", ".").status == 0
        Path("config/flight.yaml").write_text("vehicle: vehicles/raptor.yaml\ncompensator: hayden\n")
        done = quadctl("simulate", "missions/short_hop.yaml")
        assert done.status == 0
        assert done.out.startswith("configuration: config/flight.yaml\n") and "installed" not in done.out
        assert yaml.safe_load(next(Path("logs").glob("*.meta.yaml")).read_text())["compensator"] == "hayden"
        one_sentence(quadctl("init", "."), "config", "is there already and would be overwritten")

    @pytest.mark.long
    def test_a_log_is_analysed_and_the_next_flight_suggested(self, quadctl: Callable[..., Result], log: Path) -> None:
        assert quadctl("add", "exponential", "config/vehicles/raptor.yaml", log, "-o", "new.yaml").status == 0
        done = quadctl("suggest", "new.yaml", log, "--json", "s.json")
        assert done.status == 0
        assert "missions: those installed with quadctl" in done.out
        commands = [option["command"] for option in json.loads(Path("s.json").read_text())["options"]]
        assert "quadctl fly missions/forward_sweep.yaml" in commands

    def test_missions_are_listed(self, quadctl: Callable[..., Result]) -> None:
        done = quadctl("mission", "list")
        assert done.status == 0 and "hover_staircase" in done.out and "those installed with quadctl" in done.out

    def test_a_real_vehicle_is_not_flown_with_the_example_configuration(self, quadctl: Callable[..., Result]) -> None:
        refused = quadctl("fly", "missions/short_hop.yaml", "--link", "udpin://127.0.0.1:1")
        one_sentence(refused, "there is no config/flight.yaml here", "quadctl init DIR")

    def test_the_page_begins(self, quadctl: Callable[..., Result], monkeypatch: pytest.MonkeyPatch) -> None:
        begun: list[Any] = []
        monkeypatch.setattr("quadctl.web.page.server.serve", lambda *arguments: begun.extend(arguments))
        done = quadctl("lab")
        assert done.status == 0 and "missions: those installed with quadctl" in done.out
        assert begun[1].model.vehicle.name == "raptor"


class TestBadInput:
    def test_of_logs(self, quadctl: Callable[..., Result], log: Path, tmp_path: Path) -> None:
        one_sentence(quadctl("compare", VEHICLE, "gone.csv"), "gone.csv", "no such file")
        Path("empty.csv").touch()
        one_sentence(quadctl("compare", VEHICLE, "empty.csv"), "empty.csv", "empty")
        lines = log.read_text().splitlines()
        Path("text.csv").write_text(
            "\n".join([lines[0], *(line.replace(",", ",abc,", 1) for line in lines[1:])]) + "\n"
        )
        one_sentence(quadctl("diagnose", VEHICLE, "text.csv"), "text.csv")
        position = lines[0].split(",").index("z_m")
        wrong = [line.split(",") for line in lines[1:]]
        for fields in wrong:
            fields[position] = "high"
        Path("word.csv").write_text("\n".join([lines[0], *(",".join(fields) for fields in wrong)]) + "\n")
        one_sentence(quadctl("diagnose", VEHICLE, "word.csv"), "word.csv", "z_m", "high", "number")
        ground = [
            ",".join("0" if "rpm" in name else v for name, v in zip(lines[0].split(","), line.split(","), strict=True))
            for line in lines[1:]
        ]
        Path("ground.csv").write_text("\n".join([lines[0], *ground]) + "\n")
        one_sentence(quadctl("diagnose", VEHICLE, "ground.csv"), "ground.csv", "never leaves the ground")

    def test_of_a_vehicle_with_other_rotors_than_the_log(self, quadctl: Callable[..., Result], log: Path) -> None:
        head, *rows = log.read_text().splitlines()
        six = [head + ",motor5_rpm,motor6_rpm", *(f"{row},{5600 + i % 7},{5600 + i % 9}" for i, row in enumerate(rows))]
        Path("six.csv").write_text("\n".join(six) + "\n")
        one_sentence(quadctl("diagnose", VEHICLE, "six.csv"), "six.csv", "6 rotors", "expected 4")

    @pytest.mark.parametrize(
        ("change", "words"),
        [
            ({"mass_kg": -1.0}, ["mass_kg", "-1", "greater than 0"]),
            ({"mass_kg": math.nan}, ["mass_kg", "nan"]),
            ({"mas_kg": 1.0}, ["mas_kg", "did you mean 'mass_kg'"]),
            ({"rotors": []}, ["rotors"]),
        ],
    )
    def test_of_vehicles(
        self, quadctl: Callable[..., Result], log: Path, change: dict[str, Any], words: list[str]
    ) -> None:
        data = yaml.safe_load(Path(VEHICLE).read_text())
        Path("v.yaml").write_text(yaml.safe_dump({**data, **change}))
        one_sentence(quadctl("compare", "v.yaml", log), "v.yaml", *words)

    def test_of_yaml(self, quadctl: Callable[..., Result], log: Path) -> None:
        Path("broken.yaml").write_text("name: [")
        one_sentence(quadctl("compare", "broken.yaml", log), "broken.yaml", "line 1", "not valid YAML")
        Path("empty.yaml").write_text("")
        one_sentence(quadctl("compare", "empty.yaml", log), "empty.yaml", "is empty")
        one_sentence(quadctl("compare", "gone.yaml", log), "gone.yaml", "no such file")

    def test_of_a_flight_to_judge_on_that_the_fit_uses(self, quadctl: Callable[..., Result], log: Path) -> None:
        twin = shutil.copy(log, Path(log).with_name("twin.csv"))
        add = ("add", "exponential", VEHICLE, log, "-o", "n.yaml", "--unseen", twin)
        one_sentence(quadctl(*add), "twin.csv", "same flight as", "expected one that no fit uses")
        assert not Path("n.yaml").exists()

    def test_of_effects(self, quadctl: Callable[..., Result], log: Path) -> None:
        one_sentence(quadctl("add", "ground_efect.exponential", VEHICLE, log, "-o", "n.yaml"), "did you mean")
        Path("m.yaml").write_text(f"vehicle: {VEHICLE}\neffects: [{{effect: rotor_drga.linear}}]\n")
        one_sentence(quadctl("compare", "m.yaml", log), "m.yaml", "rotor_drga", "did you mean 'rotor_drag")
        assert not Path("n.yaml").exists()

    def test_of_missions(self, quadctl: Callable[..., Result]) -> None:
        shutil.copytree(ROOT / "config", "config")
        limits = {"max_z_m": 1.0, "min_z_m": 0.05}
        phases = [{"name": "up", "kind": "move", "to_m": [0, 0, 2.0]}]
        Path("high.yaml").write_text(yaml.safe_dump({"phases": phases, "limits": limits}))
        one_sentence(quadctl("simulate", "high.yaml"), "high.yaml", "phase 'up'", "limits.max_z_m = 1")
        Path("odd.yaml").write_text(yaml.safe_dump({"phases": [{"kind": "hovr", "duration_s": 1}], "limits": limits}))
        one_sentence(quadctl("simulate", "odd.yaml"), "odd.yaml", "hovr")
        one_sentence(quadctl("simulate", "gone.yaml"), "gone.yaml", "no such file")

    def test_of_links_and_options(self, quadctl: Callable[..., Result], log: Path) -> None:
        shutil.copytree(ROOT / "config", "config")
        one_sentence(quadctl("fly", MISSION, "--link", "nonsense"), "nonsense", "expected")
        both = quadctl("fly", MISSION, "--sitl", "--link", "udpin://0.0.0.0:14540")
        assert both.status == 2 and "not both" in both.err
        unasked = quadctl("fly", MISSION, "--autopilot", "ardupilot")
        assert unasked.status == 2 and "need --sitl" in unasked.err
        assert quadctl("fly", MISSION, "--sitl", "--autopilot", "betaflight").status == 2
        assert quadctl("compare", VEHICLE).status == 2
        refused = quadctl("diagnose", VEHICLE, log, "--hold-out", "nothing")
        assert refused.status == 2
        assert "--hold-out is 'nothing', expected blocks or flights" in refused.err
        assert quadctl("fligh").status == 2

    def test_only_the_lab_knows_what_can_be_held_out(
        self, quadctl: Callable[..., Result], log: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        """The command hands on what it is given, and what the lab says of it: exit status 2, its own option's name."""

        def refuse(logs: object, vehicle: object, hold_out: str) -> None:
            raise HoldOutError(f"hold_out is {hold_out}, and no more than that")

        monkeypatch.setattr("quadctl.lab.study.prepare_flights", refuse)
        refused = quadctl("compare", VEHICLE, log), quadctl("diagnose", VEHICLE, log, "--hold-out", "moons")
        assert [result.status for result in refused] == [2, 2]
        assert "--hold-out is moons, and no more than that" in refused[1].err

    def test_of_output_paths(self, quadctl: Callable[..., Result], log: Path) -> None:
        Path("file").touch()
        one_sentence(quadctl("compare", VEHICLE, log, "--json", "file/c.json"), "file/c.json", "cannot be written")
        one_sentence(
            quadctl("add", "exponential", VEHICLE, log, "-o", "file/n.yaml"), "file/n.yaml", "cannot be written"
        )
        one_sentence(
            quadctl("simulate", MISSION, "--config", ROOT / "config/flight.yaml", "--log-dir", "file/logs"), "file/logs"
        )

    def test_of_a_compensator_that_must_not_fly(self, quadctl: Callable[..., Result]) -> None:
        shutil.copytree(ROOT / "config", "config")
        Path("bad.yaml").write_text(
            "vehicle: config/vehicles/raptor.yaml\n"
            "effects: [{effect: thrust_scale.constant, parameters: {factor: 0}}]\n"
        )
        one_sentence(quadctl("simulate", MISSION, "--model", "bad.yaml"), "bad.yaml", "factor", "expected")

    def test_of_a_path_that_names_no_model_file(self, quadctl: Callable[..., Result]) -> None:
        shutil.copytree(ROOT / "config", "config")
        one_sentence(quadctl("simulate", MISSION, "--model", "/dev/null"), "--model", "/dev/null", ".yaml")


def test_the_installed_command_runs() -> None:
    done = subprocess.run(
        [sys.executable, "-c", "from quadctl.cli import main; main()", "--help"],
        capture_output=True,
        text=True,
        check=True,
    )
    for command in ("fly", "simulate", "compare", "diagnose", "add", "metrics", "demo"):
        assert command in done.stdout


def test_a_flight_whose_reader_leaves_goes_on(tmp_path: Path) -> None:
    """As with `quadctl simulate ... | head -1`: nothing more is read, and everything is written."""
    line = [sys.executable, "-m", "quadctl", "simulate", MISSION, "--json", "flown.json"]
    flying = subprocess.Popen(line, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert flying.stdout is not None
    flying.stdout.close()
    _, errors = flying.communicate()
    assert (flying.returncode, errors) == (0, "")
    assert json.loads((tmp_path / "flown.json").read_text())["completed"]


def test_what_flies_loads_no_analysis_library() -> None:
    code = (
        "import sys, quadctl.cli, quadctl.flight.session, quadctl.sitl.run\n"
        "print([m for m in ('scipy', 'polars', 'matplotlib', 'jinja2') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_it_can_be_run_as_a_module() -> None:
    done = subprocess.run([sys.executable, "-m", "quadctl", "--version"], capture_output=True, text=True, check=True)
    assert done.stdout == f"quadctl {__version__}\n"
