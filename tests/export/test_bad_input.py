"""Bad input of `quadctl export`: one sentence naming file, field, value and what was expected; never a traceback."""

from collections.abc import Callable
from pathlib import Path

import pytest

from quadctl.effects.rotor_drag import LinearDrag
from quadctl.export.targets import AUTOPILOTS, PROGRAMS
from quadctl.model import Model, Provenance, save_model
from quadctl.vehicle import Vehicle, load_vehicle
from tests.support.commands import Result
from tests.support.places import VEHICLES

QuadCtl = Callable[..., Result]
INTERVALS = Provenance(logs=("runs.csv",), ci95={"d_x": (0.2, 0.4), "d_y": (0.3, 0.5), "d_z": (0.0, 0.2)})


@pytest.fixture
def model(raptor: Vehicle, tmp_path: Path) -> Path:
    path = tmp_path / "model.yaml"
    save_model(Model(raptor).plus(LinearDrag(0.3, 0.4, 0.1), INTERVALS), path)
    return path


def refused(done: Result, *said: str) -> None:
    assert done.status == 1, done.out
    assert "Traceback" not in done.err
    assert "Saved" not in done.out
    for words in said:
        assert words in " ".join(done.err.split())


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"", "bad.yaml: is empty"),
        (b"a: [1, 2", "bad.yaml, line 1"),
        (b"only words", "bad.yaml: holds 'only words', expected a mapping"),
        (b"\xff\xfe\x00", "bad.yaml: is not a text file, expected YAML"),
        (b"mission: {steps: 3}", "bad.yaml: unknown key 'mission', expected one of"),
    ],
)
def test_a_file_that_is_no_model(quadctl: QuadCtl, tmp_path: Path, content: bytes, said: str) -> None:
    (tmp_path / "bad.yaml").write_bytes(content)
    refused(quadctl("export", tmp_path / "bad.yaml", "--to", "px4"), said)


@pytest.mark.parametrize("value", [".nan", ".inf", "heavy", "-1.0"])
def test_a_parameter_that_is_no_number_of_its_range(quadctl: QuadCtl, model: Path, value: str) -> None:
    model.write_text(model.read_text().replace("d_x: 0.3", f"d_x: {value}"))
    refused(
        quadctl("export", model, "--to", "px4"), "parameter d_x of rotor_drag.linear is", "expected a number from 0"
    )


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("", "now.params: holds no parameters"),
        ("hello", "now.params: line 1 is 'hello', expected a parameter's name and value"),
        ("MPC_THR_HOVER nan", "now.params: line 1: MPC_THR_HOVER is nan, expected a number"),
        (
            "MOT_THST_HOVER,0.3\nMOT_THST_EXPO,0.6",
            "now.params: holds 2 parameters, such as MOT_THST_HOVER, but none of MPC_THR_HOVER, THR_MDL_FAC, "
            "EKF2_BCOEF_X, EKF2_BCOEF_Y, EKF2_MCOEF, expected a parameter file of PX4",
        ),
    ],
)
def test_present_parameters_of_no_such_vehicle(
    quadctl: QuadCtl, model: Path, tmp_path: Path, content: str, said: str
) -> None:
    (tmp_path / "now.params").write_text(content)
    refused(quadctl("export", model, "--to", "px4", "--now", tmp_path / "now.params"), said)


@pytest.mark.parametrize(
    ("to", "content", "said"),
    [
        ("px4", "EKF2_MCOEF 0.15\nCA_ROTOR_COUNT 6", "6 rotors (CA_ROTOR_COUNT is 6), expected 4 as raptor has"),
        ("ardupilot", "EK3_DRAG_MCOEF,0.15\nFRAME_CLASS,3", "8 rotors (FRAME_CLASS is 3), expected 4 as raptor has"),
    ],
)
def test_present_parameters_of_another_vehicle(
    quadctl: QuadCtl, model: Path, tmp_path: Path, to: str, content: str, said: str
) -> None:
    (tmp_path / "now.params").write_text(content)
    refused(
        quadctl("export", model, "--to", to, "--now", tmp_path / "now.params"),
        f"now.params: is of a vehicle with {said}",
    )


def test_present_parameters_of_the_same_autopilot_are_read(quadctl: QuadCtl, model: Path, tmp_path: Path) -> None:
    (tmp_path / "now.params").write_text("1\t1\tEKF2_MCOEF\t0.15\t9\n")
    done = quadctl("export", model, "--to", "px4", "--now", tmp_path / "now.params")
    assert done.status == 0, done.err
    assert "0.15" in done.out
    assert (
        "EKF2_MCOEF: mean of d_x and d_y, weighted by their intervals, at 1.225 kg/m³, from runs.csv; "
        "one number for both axes" in done.out
    )


@pytest.mark.parametrize("target", [*AUTOPILOTS, *PROGRAMS])
@pytest.mark.parametrize("place", ["a_file/out", "a_folder", "/dev/full"])
def test_an_output_that_cannot_be_written(
    quadctl: QuadCtl, model: Path, tmp_path: Path, target: str, place: str
) -> None:
    (tmp_path / "a_file").write_text("mine")
    (tmp_path / "a_folder").mkdir()
    output = tmp_path / place
    refused(quadctl("export", model, "--to", target, "-o", output), f"{output}: ")


@pytest.mark.parametrize("target", ["rotorpy", "crazyflow", "sih"])
def test_a_target_that_cannot_hold_the_vehicle(quadctl: QuadCtl, tmp_path: Path, target: str) -> None:
    save_model(Model(load_vehicle(VEHICLES / "f550.yaml")), tmp_path / "six.yaml")
    done = quadctl("export", tmp_path / "six.yaml", "--to", target, "-o", tmp_path / "out")
    refused(done, "f550: has 6 rotors, expected")
    assert not (tmp_path / "out").exists()
