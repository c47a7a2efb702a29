"""Gazebo's model from ours: the same mass, inertia and hover; what the plugins cannot say is listed."""

import xml.etree.ElementTree as ET
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from quadctl.effects.body_drag import QuadraticDrag
from quadctl.effects.rotor_drag import LinearDrag
from quadctl.effects.thrust_scale import ConstantScale
from quadctl.export.gazebo import gazebo_sdf
from quadctl.model import Model, save_model
from quadctl.vehicle import Vehicle, load_vehicle
from tests.support.commands import Result
from tests.support.places import VEHICLES


def number(element: ET.Element, path: str) -> float:
    return float(str(element.findtext(path)))


def parts(vehicle: Vehicle) -> list[tuple[float, np.ndarray, np.ndarray, np.ndarray]]:
    """Mass, place of the centre, inertia about it in the base's axes, and z axis, of each link."""
    found = []
    for link in ET.fromstring(gazebo_sdf(Model(vehicle))[0]).iter("link"):
        pose = np.array(str(link.findtext("pose", "0 0 0 0 0 0")).split(), dtype=float)
        roll, pitch = pose[3:5]
        about_x = np.array([[1, 0, 0], [0, np.cos(roll), -np.sin(roll)], [0, np.sin(roll), np.cos(roll)]])
        about_y = np.array([[np.cos(pitch), 0, np.sin(pitch)], [0, 1, 0], [-np.sin(pitch), 0, np.cos(pitch)]])
        turn = about_y @ about_x
        xx, xy, xz, yy, yz, zz = (number(link, f"inertial/inertia/i{k}") for k in ("xx", "xy", "xz", "yy", "yz", "zz"))
        inertia = turn @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ turn.T
        centre = pose[:3] + turn @ np.array(str(link.findtext("inertial/pose")).split(), dtype=float)[:3]
        found.append((number(link, "inertial/mass"), centre, inertia, turn[:, 2]))
    return found


@pytest.mark.parametrize("name", ["raptor", "f550_tilted"])
def test_mass_centre_inertia_and_thrust_axes_are_the_vehicles(name: str) -> None:
    vehicle = load_vehicle(VEHICLES / f"{name}.yaml")
    links = parts(vehicle)
    assert sum(mass for mass, *_ in links) == pytest.approx(vehicle.mass_kg)
    assert sum(mass * centre for mass, centre, *_ in links) == pytest.approx(np.zeros(3), abs=1e-12)
    about = sum(j + m * (c @ c * np.eye(3) - np.outer(c, c)) for m, c, j, _ in links)
    assert about == pytest.approx(np.diag(vehicle.principal_inertia_kg_m2), abs=1e-12)
    for (*_, axis), rotor in zip(links[1:], vehicle.rotors, strict=True):
        assert axis * [1, -1, -1] == pytest.approx(rotor.axis, abs=1e-12)


def test_hover_and_drag_in_hover_are_the_models(raptor: Vehicle) -> None:
    text, _ = gazebo_sdf(Model(raptor).plus(ConstantScale(0.9)).plus(LinearDrag(0.35, 0.35, 0.0)))
    plugins = list(ET.fromstring(text).iter("plugin"))
    assert [plugin.findtext("turningDirection") for plugin in plugins] == [rotor.spin for rotor in raptor.rotors]
    k, drag = number(plugins[0], "motorConstant"), number(plugins[0], "rotorDragCoefficient")
    hover_rpm = np.sqrt(raptor.weight_n / 4.0 / 0.9 / raptor.rotor.thrust_n_per_rpm2)
    speed = hover_rpm * np.pi / 30.0
    assert 4.0 * k * speed**2 == pytest.approx(raptor.weight_n)
    assert 4.0 * drag * speed / raptor.mass_kg == pytest.approx(0.35)


def test_what_gazebo_cannot_say_is_listed(quadctl: Callable[..., Result], raptor: Vehicle, tmp_path: Path) -> None:
    save_model(Model(raptor).plus(QuadraticDrag()).plus(LinearDrag(0.3, 0.4, 0.1)), tmp_path / "fitted.yaml")
    done = quadctl("export", tmp_path / "fitted.yaml", "--to", "gazebo", "-o", tmp_path / "model.sdf")
    assert done.status == 0, done.err
    for said in (
        "body_drag.quadratic: the motor model plugin has no parameter for it",
        "d_z 0.1",
        "d_x 0.3 and d_y 0.4",
    ):
        assert said in done.out
        assert said in (tmp_path / "model.sdf").read_text()
