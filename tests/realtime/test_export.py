"""A model's parameters, written to a simulated autopilot over MAVLink and taken back."""

from collections.abc import Callable
from pathlib import Path

import pytest

from quadctl.effects.body_drag import QuadraticDrag
from quadctl.effects.rotor_drag import LinearDrag
from quadctl.model import Model, Provenance, save_model
from quadctl.sitl.rules.copter import SimulatedCopter
from quadctl.sitl.rules.px4 import SimulatedAutopilot
from quadctl.vehicle import load_vehicle
from tests.support.commands import Result
from tests.support.links import RAPTOR, free_port, mock

pytestmark = pytest.mark.realtime

BEFORE = {"EKF2_BCOEF_X": 100.0, "EKF2_BCOEF_Y": 100.0, "EKF2_MCOEF": 0.15, "EKF2_DRAG_CTRL": 0.0}


@pytest.fixture
def model(tmp_path: Path) -> Path:
    fitted = Provenance(logs=("runs.csv",), ci95={"d_x": (0.3, 0.5), "d_y": (0.35, 0.45)})
    path = tmp_path / "drag.yaml"
    save_model(Model(load_vehicle(RAPTOR)).plus(LinearDrag(0.4, 0.4, 0.0), fitted), path)
    return path


def test_parameters_are_shown_written_read_back_and_undone(
    quadctl: Callable[..., Result], model: Path, tmp_path: Path
) -> None:
    px, port = SimulatedAutopilot(load_vehicle(RAPTOR)), free_port()
    px.parameters |= BEFORE
    words = (
        "export",
        str(model),
        "--to",
        "px4",
        "--link",
        f"udpin://127.0.0.1:{port}",
        "--kept",
        str(tmp_path / "old"),
    )
    with mock(px, port):
        shown = quadctl(*words)
        assert shown.status == 0, shown.err
        assert "0.15" in next(line for line in shown.out.splitlines() if line.startswith("EKF2_MCOEF"))
        assert BEFORE.items() <= px.parameters.items()

        unasked = quadctl(*words, "--apply")  # nobody is there to say yes
        assert "nobody is there to confirm the new parameters" in unasked.err
        assert BEFORE.items() <= px.parameters.items()

        written = quadctl(*words, "--apply", "--yes")
        assert "EKF2_MCOEF is 0.403306 (was 0.15)." in written.out, written.err
        assert px.parameters["EKF2_MCOEF"] == pytest.approx(0.4033, abs=1e-4)
        assert px.parameters["EKF2_DRAG_CTRL"] == 1.0

        undone = quadctl(*words, "--undo")
        assert "EKF2_MCOEF is 0.15 again." in undone.out, undone.err
        for name, value in BEFORE.items():
            assert px.parameters[name] == pytest.approx(value)


def test_older_firmware_gets_its_own_switch_and_nothing_that_it_lacks(
    quadctl: Callable[..., Result], tmp_path: Path
) -> None:
    fitted = Provenance(logs=("runs.csv",), ci95={"area_x_m2": (0.04, 0.06), "area_y_m2": (0.04, 0.07)})
    model = tmp_path / "body.yaml"
    save_model(Model(load_vehicle(RAPTOR)).plus(QuadraticDrag(0.05, 0.05, 0.0), fitted), model)
    px, port = SimulatedAutopilot(load_vehicle(RAPTOR)), free_port()
    del px.parameters["EKF2_DRAG_CTRL"]  # which came with 1.14
    px.parameters |= {"EKF2_AID_MASK": 1.0, "EKF2_BCOEF_X": 22.0, "EKF2_BCOEF_Y": 25.0}
    before = dict(px.parameters)
    url = f"udpin://127.0.0.1:{port}"
    with mock(px, port):
        done = quadctl("export", model, "--to", "px4", "--link", url, "--apply", "--yes", "--kept", tmp_path / "old")
    assert done.status == 0, done.err
    assert "EKF2_BCOEF_Y: confirmed, stays 25" in done.out
    changed = {name: value for name, value in px.parameters.items() if value != before.get(name)}
    assert changed == {"EKF2_BCOEF_X": pytest.approx(30.0), "EKF2_AID_MASK": 33.0}


def test_another_kind_of_autopilot_is_refused(quadctl: Callable[..., Result], model: Path) -> None:
    port = free_port()
    with mock(SimulatedCopter(load_vehicle(RAPTOR)), port):
        done = quadctl("export", str(model), "--to", "px4", "--link", f"udpin://127.0.0.1:{port}", "--apply", "--yes")
    assert done.status == 1
    assert "is there, expected PX4, whose parameters these are" in done.err


def test_a_vehicle_with_another_number_of_rotors_is_refused(quadctl: Callable[..., Result], model: Path) -> None:
    px, port = SimulatedAutopilot(load_vehicle(RAPTOR)), free_port()
    px.parameters |= BEFORE | {"CA_ROTOR_COUNT": 6.0}
    url = f"udpin://127.0.0.1:{port}"
    with mock(px, port):
        done = quadctl("export", str(model), "--to", "px4", "--link", url, "--apply", "--yes")
    assert done.status == 1
    assert f"{url}: is of a vehicle with 6 rotors (CA_ROTOR_COUNT is 6), expected 4 as raptor has" in done.err
    assert px.parameters["EKF2_MCOEF"] == BEFORE["EKF2_MCOEF"]


def test_an_armed_vehicle_keeps_its_parameters(quadctl: Callable[..., Result], model: Path, tmp_path: Path) -> None:
    px, port = SimulatedAutopilot(load_vehicle(RAPTOR)), free_port()
    px.parameters |= BEFORE | {"COM_DISARM_PRFLT": 600.0}
    assert px.request_arm() is None
    url = f"udpin://127.0.0.1:{port}"
    words = ("export", str(model), "--to", "px4", "--link", url, "--apply", "--yes", "--kept", str(tmp_path / "old"))
    with mock(px, port):
        done = quadctl(*words)
    assert "is armed: parameters are written to a vehicle that is disarmed" in done.err
    assert BEFORE.items() <= px.parameters.items()
