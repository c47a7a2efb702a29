"""Input that nobody should give and somebody will: one sentence, exit status 1 or 2, nothing destroyed, no nonsense."""

import os
import re
import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from quadctl import cli
from quadctl.errors import LogError, SettingsError
from quadctl.logs.contradictions import contradictions
from quadctl.logs.csv_log import read_csv, write_csv
from quadctl.logs.flight_log import FlightLog
from quadctl.logs.quality import quality
from quadctl.logs.read import read_log, read_logs
from quadctl.missions import load_mission
from quadctl.model import Model
from quadctl.settings import MAX_YAML_BYTES, read_yaml
from quadctl.vehicle import Vehicle, load_vehicle
from tests.support.flights import obedient
from tests.support.places import ROOT

VEHICLE = ROOT / "config/vehicles/raptor.yaml"
MISSION = ROOT / "missions/short_hop.yaml"
Change = Callable[[dict[str, Any]], None]


@pytest.fixture
def log(raptor: Vehicle, tmp_path: Path) -> Path:
    """A flight of a minute."""
    path = tmp_path / "flight.csv"
    write_csv(obedient(Model(raptor), noise_m_s=0.01), path)
    return path


def refusal(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, *arguments: object) -> str:
    """Message of a command that ends with status 1 or 2."""
    monkeypatch.setattr(sys, "argv", ["quadctl", *map(str, arguments)])
    with pytest.raises(SystemExit) as ended:
        cli.main()
    assert ended.value.code in (1, 2)
    return " ".join(capsys.readouterr().err.split())


# --- vehicles ---------------------------------------------------------------------------------------------------------


def vehicle_file(folder: Path, change: Change) -> Path:
    data = yaml.safe_load(VEHICLE.read_text())
    change(data)
    path = folder / "vehicle.yaml"
    path.write_text(yaml.safe_dump(data))
    return path


@pytest.mark.parametrize(
    ("change", "words"),
    [
        pytest.param(lambda v: v.update(mass_kg=True), "mass_kg is True, expected a number", id="mass: yes"),
        pytest.param(
            lambda v: v.update(inertia_kg_m2=[True, 0.01, 0.01]),
            "inertia_kg_m2 is .*expected a number",
            id="yes in list",
        ),
        pytest.param(
            lambda v: v["rotors"][2].update(position_m=v["rotors"][0]["position_m"]),
            r"rotors\[3\] is at the place of rotors\[1\]",
            id="two rotors at one place",
        ),
        pytest.param(
            lambda v: [r.update(position_m=[0.1 * i, 0.2 * i, 0.0]) for i, r in enumerate(v["rotors"])],
            "rotors are all on one line",
            id="rotors on one line",
        ),
        pytest.param(
            lambda v: v["rotors"][0].update(position_m=[124, 124, 0]),
            r"rotors\[1\]\.position_m\[1\] is 124, expected less than 20",
            id="millimetres",
        ),
        pytest.param(
            lambda v: [r.update(spin="cw") for r in v["rotors"]], "rotors all turn cw", id="all turn the same way"
        ),
        pytest.param(
            lambda v: v["throttle"].update(max_thrust_per_rotor_n=1),
            r"max_thrust_per_rotor_n is 1, expected more than 3\.68 N",
            id="too weak to hover",
        ),
        pytest.param(
            lambda v: v["throttle"].update(per_newton=0.5), r"throttle is 7\.52 in hover", id="throttle beyond full"
        ),
        pytest.param(
            lambda v: v["rotor"].update(thrust_n_per_rpm2=1.0380e-5),
            r"thrust_n_per_rpm2 is 1\.038e-05, expected .* with radius_m = 0\.12",
            id="thrust per (rad/s)^2",
        ),
        pytest.param(lambda v: v.update(air_density_kg_m3=1205), "air_density_kg_m3 = 1205", id="air in g/m^3"),
        pytest.param(
            lambda v: v.update(inertia_kg_m2=[0.01, 0.01, 0.9]), r"inertia_kg_m2 holds 0\.9", id="impossible inertia"
        ),
    ],
)
def test_a_vehicle_that_cannot_be_is_refused(tmp_path: Path, change: Change, words: str) -> None:
    with pytest.raises(SettingsError, match=words) as refused:
        load_vehicle(vehicle_file(tmp_path, change))
    assert str(refused.value).startswith(str(tmp_path / "vehicle.yaml"))


@pytest.mark.parametrize(
    "rotors",
    [
        [(0.1, 0.17, "cw"), (0.1, -0.17, "cw"), (-0.2, 0.0, "cw")],  # a tricopter yaws with a servo
        [(x, y, s) for x in (-0.2, 0.2) for y in (-0.2, 0.2) for s in ("cw", "ccw")],
    ],
    ids=["tricopter", "coaxial octocopter"],
)
def test_unusual_vehicles_are_not_refused(tmp_path: Path, rotors: list[tuple[float, float, str]]) -> None:
    places = [{"position_m": [x, y, 0.0 if s == "cw" else 0.05], "spin": s} for x, y, s in rotors]
    path = vehicle_file(tmp_path, lambda v: v.update(rotors=places, mass_kg=1.5))
    assert load_vehicle(path).n_rotors == len(rotors)


# --- files ------------------------------------------------------------------------------------------------------------


def test_a_device_without_an_end_is_not_read() -> None:
    with pytest.raises(SettingsError, match="/dev/zero: is a device or a pipe, expected a YAML file"):
        read_yaml(Path("/dev/zero"))
    with pytest.raises(LogError, match="/dev/zero: is a device or a pipe, expected a file that holds a flight log"):
        read_log("/dev/zero")


def test_a_pipe_that_nobody_writes_to_does_not_hang(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe.csv"
    os.mkfifo(pipe)
    caught: list[Exception] = []

    def read(reader: Callable[[Path], object]) -> None:
        try:
            reader(pipe)
        except (LogError, SettingsError) as error:
            caught.append(error)

    for reader in (read_log, read_yaml):
        thread = threading.Thread(target=read, args=(reader,), daemon=True)
        thread.start()
        thread.join(timeout=20.0)
    assert ["is a device or a pipe" in str(error) for error in caught] == [True, True]


def test_a_log_in_the_place_of_a_model_is_not_parsed_as_yaml(tmp_path: Path) -> None:
    path = tmp_path / "swapped.csv"
    path.write_text("1,2,3\n" * (MAX_YAML_BYTES // 6 + 1))
    with pytest.raises(SettingsError, match=r"swapped\.csv: is larger than 1 MB, expected settings in YAML"):
        read_yaml(path)


def test_aliases_within_aliases_are_not_written_out(tmp_path: Path) -> None:
    """In full, this value of 1 kB of YAML is 10^9 numbers."""
    nested = ["&a0 [1, 1]", *(f"&a{i} [{', '.join([f'*a{i - 1}'] * 10)}]" for i in range(1, 10))]
    path = tmp_path / "bomb.yaml"
    path.write_text(f"name: [{', '.join(nested)}]\n" + VEHICLE.read_text().replace("name: raptor\n", ""))
    with pytest.raises(SettingsError, match=r"bomb\.yaml: name is \[\[1, 1\], .*, expected text") as refused:
        load_vehicle(path)
    assert len(str(refused.value)) < len(str(path)) + 120


def test_links_that_lead_in_a_circle_are_one_sentence(tmp_path: Path) -> None:
    link = tmp_path / "a.csv"
    link.symlink_to(link)
    with pytest.raises(LogError, match=r"a\.csv: cannot be read \(Too many levels"):
        read_logs([link])


# --- outputs ----------------------------------------------------------------------------------------------------------


def test_a_result_is_never_written_over_a_flight(
    log: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    before = log.read_bytes()
    commands: list[list[object]] = [
        ["add", "rotor_drag.linear", VEHICLE, log, "-o", log],
        ["compare", VEHICLE, log, "--json", log],
        ["compare", VEHICLE, log, "--html", tmp_path / "other.ulg"],
        ["metrics", log, "--json", log],
        ["logs", log, "--json", log],
        ["simulate", MISSION, "--json", log],
    ]
    for command in commands:
        assert "is the name of a flight log, expected another file" in refusal(capsys, monkeypatch, *command)
    assert log.read_bytes() == before


def test_a_model_is_not_written_over_the_vehicle_it_is_made_from(
    log: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    vehicle = tmp_path / "mine.yaml"
    vehicle.write_text(VEHICLE.read_text())
    said = refusal(capsys, monkeypatch, "add", "rotor_drag.linear", vehicle, log, "-o", vehicle)
    assert "mine.yaml: is read by this command, expected another file" in said
    assert load_vehicle(vehicle).name == "raptor"


def test_outputs_that_cannot_be_are_refused_before_the_work(
    log: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    for option in ("--json", "--html"):
        said = refusal(capsys, monkeypatch, "compare", VEHICLE, log, option, tmp_path)
        assert f"{tmp_path}: is a directory, expected the name of a file" in said
    same = tmp_path / "out"
    said = refusal(capsys, monkeypatch, "compare", VEHICLE, log, "--json", same, "--html", same)
    assert "out: is written by this command already" in said
    said = refusal(capsys, monkeypatch, "simulate", MISSION, "--log-dir", tmp_path / "new", "--json", tmp_path)
    assert "is a directory" in said
    assert not (tmp_path / "new").exists()


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
def test_a_full_disk_behind_the_output_is_one_sentence(log: Path) -> None:
    with Path("/dev/full").open("w") as full:
        command = [sys.executable, "-c", "from quadctl.cli import main; main()", "logs", str(log)]
        done = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, text=True, check=False)
    assert done.returncode == 1
    assert done.stderr == "quadctl: the output: No space left on device\n"


# --- options ----------------------------------------------------------------------------------------------------------


def test_odd_options_are_refused(
    log: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    said = refusal(capsys, monkeypatch, "simulate", MISSION, "--seed", -1)  # would be the flight of seed 1
    assert "'--seed': Input should be greater than or equal to 0" in said
    said = refusal(capsys, monkeypatch, "diagnose", VEHICLE, log, "--hold-out", "flights")
    assert "--hold-out is flights with 1 log, expected at least 2 logs" in said
    for value in ("nan", "1e308"):
        said = refusal(capsys, monkeypatch, "metrics", log, "--from", 1, "--to", 5, "--setpoint", value)
        assert re.search(r"--setpoint is (nan|1e\+308), expected a number between", said)
    said = refusal(capsys, monkeypatch, "fly", MISSION, "--link", "")  # an empty variable of a script
    assert "The link '' is not one that can be opened" in said


# --- missions ---------------------------------------------------------------------------------------------------------


def test_a_lifted_mission_says_that_it_is_lifted() -> None:
    with pytest.raises(SettingsError, match=r"z = 0\.00 m.*lifted by offset_up_m = -5"):
        load_mission(MISSION, offset_up_m=-5.0)
    with pytest.raises(SettingsError, match=r"lasts 2000000012 s.*lifted by offset_up_m = 1e\+09"):
        load_mission(MISSION, offset_up_m=1e9)


def test_a_name_too_long_for_a_file_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "long.yaml"
    path.write_text(yaml.safe_dump({**yaml.safe_load(MISSION.read_text()), "name": "x" * 500}))
    with pytest.raises(SettingsError, match=r"long\.yaml: name has 500 characters, expected at most 100"):
        load_mission(path)


# --- logs -------------------------------------------------------------------------------------------------------------


def changed(log: Path, change: Callable[[FlightLog], None]) -> Path:
    flight = read_csv(log)
    change(flight)
    path = log.with_name("changed.csv")
    write_csv(flight, path)
    return path


def test_impossible_values_are_missing_ones(log: Path) -> None:
    def damage(flight: FlightLog) -> None:
        flight["motor1_rpm"][100] = 1e30
        flight["motor2_rpm"][100:102] = -4e5
        flight["x_m"][7] = 1e13

    flight = read_csv(changed(log, damage))
    assert np.isnan(flight["motor1_rpm"][100])
    assert np.isnan(flight["motor2_rpm"][100:102]).all()
    assert "1 impossible value of motor1_rpm (beyond 300000) read as missing" in flight.notes
    assert "2 impossible values of motor2_rpm (beyond 300000) read as missing" in flight.notes
    assert "1 impossible value of x_m (beyond 1e+12) read as missing" in flight.notes


def test_a_flight_in_the_wrong_units_is_refused(
    log: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def millimetres(flight: FlightLog) -> None:
        flight["z_m"][:] *= 1000.0

    assert not contradictions(read_csv(log))
    path = changed(log, millimetres)
    said = refusal(capsys, monkeypatch, "compare", VEHICLE, path)
    assert re.search(r"changed\.csv: z_m changes (1e\+03|9\d\d|10\d\d) times as much as vz_m_s says", said)
    assert not quality(read_csv(path)).can_be_analysed


def test_a_dead_rotor_sensor_is_refused(
    log: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def dead(flight: FlightLog) -> None:
        flight["motor3_rpm"][:] = 0.0

    said = refusal(capsys, monkeypatch, "compare", VEHICLE, changed(log, dead))
    assert "changed.csv: motor3_rpm is 0 for most of the log while other rotors turn" in said


def test_what_was_left_out_of_a_log_is_said_on_the_terminal(
    log: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    lines = log.read_text().splitlines()
    lines[1::7] = [line.rpartition(",")[0] for line in lines[1::7]]
    log.write_text("\n".join(lines) + "\n")
    monkeypatch.setattr(sys, "argv", ["quadctl", "compare", str(VEHICLE), str(log)])
    with pytest.raises(SystemExit) as ended:
        cli.main()
    assert ended.value.code == 0
    assert re.search(r"flight\.csv: \d+ damaged lines left out \(line 2: ", capsys.readouterr().out)
