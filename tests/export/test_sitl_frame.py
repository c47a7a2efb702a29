"""A frame of ArduPilot's SITL: its equations, by hand, give the hover and the drag of the model."""

import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from quadctl.effects.base import Conditions
from quadctl.effects.body_drag import QuadraticDrag
from quadctl.effects.ground_effect import Hayden
from quadctl.effects.rotor_drag import LinearDrag
from quadctl.effects.thrust_scale import ConstantScale
from quadctl.errors import SettingsError
from quadctl.export.hover import hover_throttle
from quadctl.export.sitl_frame import sitl_frame
from quadctl.frames import GRAVITY_M_S2
from quadctl.model import Model, save_model
from quadctl.vehicle import Vehicle, load_vehicle
from tests.support.commands import Result
from tests.support.places import VEHICLES

EXPO = 0.65
"""ArduPilot's MOT_THST_EXPO, which the frame is written for."""


def frame_of(model: Model) -> dict[str, Any]:
    """Frame as SITL reads it: lines that begin with # are left out."""
    lines = sitl_frame(model)[0].splitlines()
    frame: dict[str, Any] = json.loads("\n".join(line for line in lines if not line.startswith("#")))
    return frame


class Sitl:
    """Equations of SITL's frame (SIM_Frame.cpp, `init` and `calculate_forces`; SIM_Motor.cpp, `calculate_forces`)."""

    def __init__(self, frame: dict[str, Any]) -> None:
        self.frame = frame
        self.weight_n = frame["mass"] * GRAVITY_M_S2
        self.density = 101325.0 / (287.26 * (frame["refTempC"] + 273.15))
        lean, speed = math.radians(frame["refAngle"]), frame["refSpd"]
        push_n = self.weight_n * math.tan(lean)
        discs = math.sqrt(self.weight_n / math.cos(lean) * self.density * frame["disc_area"])
        linear_n = math.cos(lean) * frame["mdrag_coef"] * speed * math.cos(lean) * discs
        self.momentum = frame["mdrag_coef"] * min(1.0, push_n / linear_n if linear_n > 0.0 else 1.0)
        self.area_m2 = max(push_n - linear_n, 0.0) / (0.5 * self.density * speed**2)

    def thrust_n(self, throttle: float) -> float:
        """Thrust of all rotors at rest; the autopilot turns the throttle into a command by MOT_THST_EXPO."""
        command = (EXPO - 1.0 + math.sqrt((1.0 - EXPO) ** 2 + 4.0 * EXPO * throttle)) / (2.0 * EXPO)
        e = self.frame["propExpo"]
        return self.weight_n / self.frame["hoverThrOut"] * ((1.0 - e) * command + e * command**2)

    def drag_m_s2(self, speed_m_s: float) -> float:
        """Deceleration of the level vehicle in hover thrust."""
        n = self.frame["num_motors"]
        each = math.sqrt(self.density * self.frame["disc_area"] / n * self.weight_n / n)
        linear_n = n * self.momentum * speed_m_s * each
        return (linear_n + 0.5 * self.density * self.area_m2 * speed_m_s**2) / self.frame["mass"]


@pytest.fixture(scope="module")
def straight(raptor: Vehicle) -> Vehicle:
    """Vehicle whose thrust is proportional to the throttle, as that of an ArduPilot with the right MOT_THST_EXPO."""
    line = raptor.throttle.model_copy(update={"offset": 0.0})
    return raptor.model_copy(update={"throttle": line, "air_density_kg_m3": 1.1})


@pytest.mark.parametrize("factor", [0.9, 1.1])
def test_it_hovers_at_the_throttle_of_the_model(straight: Vehicle, factor: float) -> None:
    model = Model(straight).plus(ConstantScale(factor))
    sitl = Sitl(frame_of(model))
    assert sitl.thrust_n(hover_throttle(model)) == pytest.approx(straight.weight_n, rel=1e-3)
    assert sitl.density == pytest.approx(1.1, rel=1e-5)


@pytest.mark.parametrize(
    ("linear", "area_m2"),
    [(0.0, 0.0), (0.3, 0.0), (0.0, 0.02), (0.3, 0.02)],
    ids=["none", "linear", "quadratic", "both"],
)
def test_its_drag_is_that_of_the_model(straight: Vehicle, linear: float, area_m2: float) -> None:
    model = Model(straight).plus(LinearDrag(linear, linear, linear)).plus(QuadraticDrag(area_m2, area_m2, area_m2))
    sitl = Sitl(frame_of(model))
    hover = [straight.weight_n / straight.n_rotors] * straight.n_rotors
    for speed in (1.0, 4.0, 12.0):
        force_n = model.loads(hover, Conditions(100.0, (speed, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0))).force_n[0]
        assert sitl.drag_m_s2(speed) == pytest.approx(-float(force_n) / straight.mass_kg, rel=1e-3, abs=1e-4)


def test_the_jet_of_hover_is_twice_the_induced_velocity(straight: Vehicle) -> None:
    frame = frame_of(Model(straight))
    jet_m_s = 2.0 * frame["refVoltage"] * frame["refCurrent"] / straight.weight_n
    assert jet_m_s == pytest.approx(2.0 * straight.hover_induced_velocity_m_s, rel=1e-4)


def test_a_hexarotor_has_six_motors() -> None:
    assert frame_of(Model(load_vehicle(VEHICLES / "f550.yaml")))["num_motors"] == 6


def test_what_sitl_cannot_say_is_listed(quadctl: Callable[..., Result], straight: Vehicle, tmp_path: Path) -> None:
    save_model(Model(straight).plus(Hayden()).plus(LinearDrag(0.3, 0.4, 0.1)), tmp_path / "fitted.yaml")
    done = quadctl("export", tmp_path / "fitted.yaml", "--to", "sitl", "-o", tmp_path / "frame.json")
    assert done.status == 0, done.err
    for said in ("ground_effect.hayden: SITL has no parameter for it", "(0.3, 0.4, 0.1)", "motor lag"):
        assert said in done.out
        assert said in (tmp_path / "frame.json").read_text()


def test_tilted_rotors_are_refused() -> None:
    with pytest.raises(SettingsError, match="f550_tilted: has tilted rotors, expected upright ones"):
        sitl_frame(Model(load_vehicle(VEHICLES / "f550_tilted.yaml")))


def test_a_vehicle_that_is_too_heavy_is_refused(straight: Vehicle) -> None:
    with pytest.raises(SettingsError, match="expected more than its weight"):
        sitl_frame(Model(straight.model_copy(update={"mass_kg": 50.0})))
