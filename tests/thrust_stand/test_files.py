"""`quadctl thrust-stand --from`: former measurements, and the vehicle file that they go into."""

import json
from collections.abc import Sequence
from pathlib import Path

import pytest
import yaml
from typer.testing import CliRunner, Result

from quadctl.cli import app
from quadctl.errors import QuadctlError
from quadctl.frames import GRAVITY_M_S2
from quadctl.settings_text import with_numbers
from quadctl.thrust_stand.measurement import Point, check_plausible
from quadctl.vehicle import Vehicle, load_vehicle
from tests.support.links import RAPTOR
from tests.support.thrust_stand import VEHICLE, K, measured


def run(*words: str | Path) -> Result:
    return CliRunner().invoke(app, ["thrust-stand", *map(str, words)])


def as_csv(path: Path, header: str, rows: Sequence[Sequence[object]]) -> Path:
    path.write_text("\n".join([header, *(",".join(map(str, row)) for row in rows)]) + "\n")
    return path


def test_a_former_measurement_goes_into_a_copy_of_the_vehicle_file(tmp_path: Path) -> None:
    points = measured()
    former = as_csv(
        tmp_path / "former.csv",
        "throttle, rpm, thrust_g",
        [(p.throttle, p.rpm * 1.1, p.thrust_n / GRAVITY_M_S2 * 1000) for p in points],
    )
    out, picture = tmp_path / "new.yaml", tmp_path / "stand.png"
    result = run(RAPTOR, "--from", former, "-o", out, "--plot", picture, "--json", tmp_path / "out.json")
    assert result.exit_code == 0, result.output
    assert "One k is enough" in result.output
    new = load_vehicle(out)
    assert new.rotor.thrust_n_per_rpm2 == pytest.approx(K / 1.21, rel=0.01)
    assert new.throttle.per_newton == pytest.approx(VEHICLE.throttle.per_newton, rel=0.02)
    assert (new.mass_kg, new.rotors) == (VEHICLE.mass_kg, VEHICLE.rotors)
    assert "# first-order motor lag" in out.read_text()
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert json.loads((tmp_path / "out.json").read_text())["one_k_is_enough"] is True
    again = run(RAPTOR, "--from", former, "-o", out)
    assert "is there already" in str(again.exception)
    assert run(RAPTOR, "--from", former, "-o", out, "--force").exit_code == 0
    assert "is read by this command" in str(run(out, "--from", former, "-o", out, "--force").exception)


@pytest.mark.parametrize(
    "throttle",
    [
        "throttle: {per_newton: 0.02, max_thrust_per_rotor_n: 9}  # flow, no offset",
        "throttle:\n  per_newton: 0.02  # block, no offset\n  max_thrust_per_rotor_n: 9",
    ],
)
def test_the_edit_of_a_vehicle_file_adds_a_key_that_it_had_not(throttle: str, tmp_path: Path) -> None:
    lines = RAPTOR.read_text().splitlines()
    path = tmp_path / "vehicle.yaml"
    path.write_text("\n".join(throttle if line.startswith("throttle:") else line for line in lines))
    values = {("throttle", "offset"): 0.125, ("rotor", "thrust_n_per_rpm2"): 1.2e-7}
    text = with_numbers(path, values, Vehicle, "vehicle file")
    new = yaml.safe_load(text)
    assert (new["throttle"]["offset"], new["rotor"]["thrust_n_per_rpm2"]) == (0.125, 1.2e-7)
    assert throttle.partition("#")[2].partition("\n")[0] in text


GOOD = [(p.throttle, p.rpm, p.thrust_n) for p in measured()]


HEADER = "throttle,rpm,thrust_n"


@pytest.mark.parametrize(
    ("header", "rows", "sentence"),
    [
        ("throtle,rpm,thrust_n", GOOD, "unknown column 'throtle' (did you mean 'throttle'?)"),
        ("time,value", [(0, 1)], "its columns are time, value; expected throttle, rpm, thrust_n"),
        ("throttle,thrust_n,thrust_g", GOOD, "has thrust_n and thrust_g, expected one column of thrust"),
        (HEADER, GOOD[:2], "holds 2 throttle steps, expected 3 or more"),
        (HEADER, [], "holds 0 throttle steps"),
        (HEADER, [*GOOD, (0.95, 9000, "OL")], "line 16: thrust_n is 'OL', expected a number"),
        (HEADER, [*GOOD, (0.95, 9000)], "line 16: thrust_n is '', expected a number"),
        (HEADER, [(100 * u, r, t) for u, r, t in GOOD], "line 2: throttle is 25, expected a share from 0 to 1"),
        (HEADER, [(u, r, 102 * t) for u, r, t in GOOD], "are these grams (thrust_g, or --unit g)?"),
        ("throttle,rpm,thrust_g", GOOD, "expected newtons (or thrust_g, thrust_kg, --unit), and a motor that turns"),
        (HEADER, [(u, r, 8 - t) for u, r, t in GOOD], "thrust falls from"),
        (HEADER, [(u, 9000 - r, t) for u, r, t in GOOD], "the rotor speed falls from"),
    ],
)
def test_a_measurement_that_cannot_be_true_is_one_sentence(
    header: str, rows: Sequence[Sequence[object]], sentence: str, tmp_path: Path
) -> None:
    path = as_csv(tmp_path / "bad.csv", header, rows)
    result = run(RAPTOR, "--from", path)
    assert isinstance(result.exception, QuadctlError)
    assert str(result.exception).startswith(str(path))
    assert sentence in str(result.exception)


def test_numbers_that_no_vehicle_has_are_not_written(tmp_path: Path) -> None:
    fast = as_csv(tmp_path / "fast.csv", HEADER, [(u, 100 * rpm, thrust) for u, rpm, thrust in GOOD])
    result = run(RAPTOR, "--from", fast, "-o", tmp_path / "new.yaml", "--json", tmp_path / "out.json")
    assert "raptor.yaml with the measured numbers: rotor.thrust_n_per_rpm2 is 1.1" in str(result.exception)
    assert not (tmp_path / "new.yaml").exists()


@pytest.mark.parametrize("content", [b"\xff\xfe\x00\x01", None])
def test_what_is_no_csv_is_one_sentence(content: bytes | None, tmp_path: Path) -> None:
    path = tmp_path / "bad.csv"
    if content is not None:
        path.write_bytes(content)
    assert isinstance(run(RAPTOR, "--from", path).exception, QuadctlError)


def test_noise_at_idle_is_no_fall_of_thrust() -> None:
    check_plausible([Point(0.1, 1010.0, 0.03), Point(0.15, 1000.0, -0.03)], VEHICLE, "idle")


def test_without_the_lab_it_measures_and_says_how_to_fit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("quadctl.cli.thrust_stand.find_spec", lambda name: None)
    monkeypatch.setattr("quadctl.cli.thrust_stand._measure", lambda *words: measured())
    result = run(RAPTOR, "--link", "auto", "--yes-props-are-safe", "--raw", tmp_path / "raw.csv")
    assert result.exit_code == 0, result.output
    assert f"quadctl thrust-stand {RAPTOR} --from {tmp_path / 'raw.csv'}" in result.output
