"""The commands about missions as a user meets them: `mission show`, `mission list`, `check`, and `--set`."""

import json
from collections.abc import Callable
from itertools import takewhile
from pathlib import Path

import pytest
import yaml

from quadctl.cli.app import console
from quadctl.missions import load_mission
from tests.support.commands import Result
from tests.support.places import ROOT

STEP_FORWARD = "missions/step_forward.yaml"


def test_a_mission_is_drawn_with_its_limits_and_its_phases(quadctl: Callable[..., Result]) -> None:
    shown = quadctl("mission", "show", STEP_FORWARD, "--set", "speed_m_s=0.5")
    assert shown.status == 0
    for words in ("min_z_m 0.08, max_z_m 1.5", "guard 8", "limit 35", "fence 4 m", "speed_m_s=0.5"):
        assert words in shown.out
    row = next(line for line in shown.out.splitlines() if line.startswith("step_1"))
    # 5.5 m at 0.5 m/s: 11 s, 0.25 s more for the ramps, 2 s of hold
    assert " ".join(row.split()) == "step_1 step_run 12.7 13.2 -2.5 0 1.2 3 0 0.2 0.20..1.20 0.50 2.00 12° 1.00"
    assert "from above" not in quadctl("mission", "show", "missions/hover_staircase.yaml").out


def test_a_mission_is_drawn_into_a_picture(quadctl: Callable[..., Result], tmp_path: Path) -> None:
    picture = tmp_path / "m.png"
    assert quadctl("mission", "show", "missions/short_hop.yaml", "-o", picture).status == 0
    assert picture.read_bytes().startswith(b"\x89PNG")
    wrong = quadctl("mission", "show", "missions/short_hop.yaml", "-o", tmp_path / "m.txt")
    assert (wrong.status, wrong.err.count("\n")) == (1, 1)
    assert "expected .png" in wrong.err


def test_the_missions_are_listed_with_what_can_be_set(quadctl: Callable[..., Result]) -> None:
    listed = quadctl("mission", "list")
    assert listed.status == 0
    for path in (ROOT / "missions").glob("*.yaml"):
        assert path.stem in listed.out
    row = next(line for line in listed.out.splitlines() if line.startswith("hover_heights"))
    assert "140" in row and "0.21..1.00" in row and "heights_m, hover_s" in row
    assert quadctl("mission", "list", "docs").status == 1


def test_the_list_of_missions_is_readable_on_80_columns(
    quadctl: Callable[..., Result], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(console, "_width", 80)
    lines = quadctl("mission", "list").out.splitlines()
    assert max(map(len, lines)) <= 80
    for path in (ROOT / "missions").glob("*.yaml"):
        row = next(i for i, line in enumerate(lines) if line.split()[0] == path.stem)
        mission = load_mission(path)
        assert lines[row].endswith(", ".join(mission.parameters))  # not wrapped
        told = " ".join(line.strip() for line in takewhile(lambda line: line.startswith("  "), lines[row + 1 :]))
        assert told == mission.description


@pytest.mark.parametrize("name", ["short_hop", "short_hop.yaml", "missions/short_hop.yaml"])
def test_a_mission_is_called_by_its_name(quadctl: Callable[..., Result], name: str, tmp_path: Path) -> None:
    for words in (["mission", "show", name], ["check", name], ["check", "config/vehicles/raptor.yaml", name]):
        assert quadctl(*words).status == 0
    refused = quadctl("fly", name, "--link", "nonsense", "--log-dir", tmp_path)
    assert "no such file" not in refused.err and "nonsense" in refused.err
    wrong = quadctl("check", "short_hopp")
    assert (wrong.status, wrong.err) == (1, "quadctl: short_hopp: there is no such file\n")


def test_a_file_where_one_is_goes_before_a_mission_of_that_name(
    quadctl: Callable[..., Result], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    own = yaml.safe_load((ROOT / "missions" / "short_hop.yaml").read_text()) | {"description": "my own hop"}
    (tmp_path / "short_hop.yaml").write_text(yaml.safe_dump(own))
    (tmp_path / "missions").mkdir()
    monkeypatch.chdir(tmp_path)
    assert "missions/short_hop.yaml" not in quadctl("mission", "show", "short_hop.yaml").out


def test_set_changes_what_is_flown_and_recorded(quadctl: Callable[..., Result], tmp_path: Path) -> None:
    words = ["simulate", "missions/oscillation.yaml", "--set", "cycles=1", "--log-dir", tmp_path]
    assert quadctl(*words).status == 0
    meta = yaml.safe_load(next(tmp_path.glob("*.meta.yaml")).read_text())
    assert meta["parameters"] == {"cycles": 1}
    wrong = quadctl("simulate", "missions/oscillation.yaml", "--set", "cycle=1", "--log-dir", tmp_path)
    assert (wrong.status, wrong.err.count("\n")) == (1, 1)
    assert "has no parameter 'cycle' (did you mean 'cycles'?)" in wrong.err


def test_a_mission_is_checked_with_another_vehicle(quadctl: Callable[..., Result], tmp_path: Path) -> None:
    heavy = tmp_path / "heavy.yaml"
    raptor = yaml.safe_load((ROOT / "config/vehicles/raptor.yaml").read_text())
    heavy.write_text(yaml.safe_dump({**raptor, "mass_kg": 3.4}))
    out = tmp_path / "check.json"
    assert quadctl("check", "missions/oscillation.yaml", "--json", out).status == 0
    assert {f["verdict"] for f in json.loads(out.read_text())["findings"]} == {"ok", "warning"}
    refused = quadctl("check", heavy, "missions/oscillation.yaml")
    assert refused.status == 1
    assert "refused  thrust" in refused.out
    assert "missions/oscillation.yaml must not be flown like this: 1 of" in refused.err
    assert quadctl("check", heavy, heavy, "missions/oscillation.yaml").status == 2


@pytest.mark.parametrize("command", [("fly", "--link", "nonsense"), ("simulate",)], ids=lambda c: c[0])
def test_what_the_check_refuses_is_not_begun(
    quadctl: Callable[..., Result], tmp_path: Path, command: tuple[str, ...]
) -> None:
    """No log is made, and the link, which is none, is not looked at."""
    config = tmp_path / "flight.yaml"
    vehicle = str(ROOT / "config/vehicles/raptor.yaml")
    config.write_text(yaml.safe_dump({"vehicle": vehicle, "guards": {"max_tilt_deg": 30}}))
    refused = quadctl(*command, "missions/short_hop.yaml", "--config", config, "--log-dir", tmp_path / "logs")
    assert refused.status == 1
    assert refused.err.startswith("quadctl: missions/short_hop.yaml must not be flown like this: tilt: up to ")
    assert refused.err.endswith(
        "the controller may lean further than the guard allows, expected a guard above its limit\n"
    )
    assert refused.err.count("\n") == 1
    assert not (tmp_path / "logs").exists()


def test_what_the_check_warns_of_is_printed_before_the_flight(quadctl: Callable[..., Result], tmp_path: Path) -> None:
    config = tmp_path / "flight.yaml"
    vehicle = str(ROOT / "config/vehicles/raptor.yaml")
    config.write_text(yaml.safe_dump({"vehicle": vehicle, "compensator_limits": {"band": 0.01}}))
    words = ["missions/short_hop.yaml", "--config", config, "--log-dir", tmp_path, "--model", "sanchez"]
    out = quadctl("fly", *words, "--link", "nonsense").out
    assert "warning: battery: 12 s of flight: no guard on the voltage" in out
    assert "limited to 0.99 to 1.01: it asks for more than the limit" in out
    simulated = quadctl("simulate", *words)
    assert simulated.status == 0
    assert "it asks for more than the limit" in simulated.out
    assert "battery" not in simulated.out
