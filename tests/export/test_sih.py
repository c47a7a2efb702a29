"""Parameters of PX4's simulator SIH: those of the simulator that made a log come back from the model fitted to it."""

from collections.abc import Callable
from pathlib import Path

import pytest

from quadctl.effects.ground_effect import Hayden
from quadctl.effects.rotor_drag import LinearDrag
from quadctl.effects.thrust_scale import ConstantScale
from quadctl.errors import SettingsError
from quadctl.export.sih import sih_parameters
from quadctl.lab.flights.dataset import load_dataset
from quadctl.lab.selection.addition import add
from quadctl.logs.read import read_logs
from quadctl.model import Model, save_model
from quadctl.parameter_file import read_parameters
from quadctl.vehicle import Vehicle, load_vehicle
from tests.support.commands import Result
from tests.support.places import ROOT, VEHICLES

RECORDED = ROOT.parent / "shared" / "data" / "real" / "px4"
TRUE = {"SIH_MASS": 1.0, "SIH_IXX": 0.025, "SIH_IYY": 0.025, "SIH_IZZ": 0.03, "SIH_T_MAX": 5.0, "SIH_Q_MAX": 0.1}
TRUE |= {"SIH_L_ROLL": 0.2, "SIH_L_PITCH": 0.2, "SIH_KDV": 1.0, "SIH_T_TAU": 0.05}


def parameters(text: str, folder: Path) -> dict[str, float]:
    path = folder / "sih.params"
    path.write_text(text)
    return read_parameters(path)


@pytest.mark.skipif(not RECORDED.is_dir(), reason="the recorded flights are not here")
def test_the_parameters_of_the_simulator_that_flew_come_back(tmp_path: Path) -> None:
    vehicle = load_vehicle(ROOT / "sitl/px4/vehicle.yaml")
    logs = read_logs([RECORDED / "forward_runs.ulg", RECORDED / "vertical_runs.ulg"])
    model = add(LinearDrag, Model(vehicle), load_dataset(logs, vehicle)).model
    found = parameters(sih_parameters(model)[0], tmp_path)
    assert found.pop("SIH_KDV") == pytest.approx(TRUE["SIH_KDV"], rel=0.15)
    assert found == pytest.approx({name: value for name, value in TRUE.items() if name != "SIH_KDV"})


def test_hover_and_drag_are_the_models(raptor: Vehicle, tmp_path: Path) -> None:
    found = parameters(
        sih_parameters(Model(raptor).plus(ConstantScale(0.9)).plus(LinearDrag(0.3, 0.3, 0.3)))[0], tmp_path
    )
    throttle = raptor.throttle
    assert found["SIH_T_MAX"] == pytest.approx(0.9 * (1.0 - throttle.offset) / throttle.per_newton / 4.0)
    assert found["SIH_KDV"] == pytest.approx(0.3 * raptor.mass_kg)


def test_what_sih_cannot_say_is_listed(quadctl: Callable[..., Result], raptor: Vehicle, tmp_path: Path) -> None:
    save_model(Model(raptor).plus(Hayden()).plus(LinearDrag(0.3, 0.4, 0.1)), tmp_path / "fitted.yaml")
    done = quadctl("export", tmp_path / "fitted.yaml", "--to", "sih", "-o", tmp_path / "sih.params")
    assert done.status == 0, done.err
    for said in ("ground_effect.hayden: SIH has no parameter for it", "d_x 0.3, d_y 0.4, d_z 0.1"):
        assert said in done.out
        assert said in (tmp_path / "sih.params").read_text()


def test_a_hexarotor_is_refused() -> None:
    with pytest.raises(SettingsError, match="f550: has 6 rotors, expected four upright ones in an x"):
        sih_parameters(Model(load_vehicle(VEHICLES / "f550.yaml")))
