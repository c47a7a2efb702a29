"""RotorPy's vehicle from a model: flown back in RotorPy's own equations, it predicts as well as the model itself."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from quadctl.effects.body_drag import QuadraticDrag
from quadctl.effects.centre_of_mass import FixedOffset
from quadctl.effects.ground_effect import Exponential
from quadctl.effects.inflow import AxialInflow
from quadctl.effects.rotor_drag import LinearDrag
from quadctl.effects.thrust_scale import ConstantScale
from quadctl.effects.translational_lift import HorizontalLift
from quadctl.export.rotorpy import rotorpy_code
from quadctl.frames import rotate_inverse
from quadctl.model import Model, conditions, save_model
from quadctl.vehicle import Vehicle
from tests.support.commands import Result
from tests.support.held_out import Floats, HeldOut
from tests.support.places import VEHICLES

multirotor = pytest.importorskip("rotorpy.vehicles.multirotor")
UP = np.array([0.0, 0.0, 1.0])
FLIP = np.array([1.0, -1.0, -1.0])
"""Between north, east, down and north, west, up, and between forward, right, down and forward, left, up."""


def flown(model: Model) -> Any:
    """RotorPy's vehicle of the file that is written."""
    place: dict[str, Any] = {}
    exec(rotorpy_code(model)[0], place)
    return multirotor.Multirotor(place["quad_params"], aero=True)


def accelerations(
    vehicle: Any, velocity_ned: np.ndarray, attitude: np.ndarray, rates: np.ndarray, speeds_rad_s: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Derivatives of velocity, NED, and of the body rates, FRD, by RotorPy's statedot."""
    w, x, y, z = attitude
    state = {
        "x": np.zeros(3),
        "v": FLIP * velocity_ned,
        "q": np.array([x, -y, -z, w]),
        "w": FLIP * rates,
        "wind": np.zeros(3),
        "rotor_speeds": speeds_rad_s,
    }
    found = vehicle.statedot(state, {"cmd_motor_speeds": speeds_rad_s}, 0.0)
    return FLIP * found["vdot"], FLIP * found["wdot"]


@pytest.mark.parametrize(
    "effect",
    [
        ConstantScale(0.9),
        LinearDrag(0.35, 0.35, 0.1),
        QuadraticDrag(0.03, 0.02, 0.05),
        AxialInflow(0.4),
        HorizontalLift(0.1),
    ],
    ids=lambda effect: effect.name,
)
def test_in_hover_thrust_the_accelerations_are_the_models(effect: Any, raptor: Vehicle) -> None:
    model = Model(raptor).plus(effect)
    scale = effect.factor if isinstance(effect, ConstantScale) else 1.0
    each = np.full(4, raptor.weight_n / 4.0 / scale)
    q = np.array([1.0, 0.05, -0.08, 0.2])
    q /= np.linalg.norm(q)
    slow = 0.3 if isinstance(effect, HorizontalLift) else 1.0  # where its saturation does not count
    velocity = slow * np.array([1.5, -1.0, 0.4])
    turn = (q[0], q[1], q[2], q[3])
    c = conditions(raptor, 10.0, rotate_inverse(turn, tuple(velocity)), turn)
    speeds = np.sqrt(each / raptor.rotor.thrust_n_per_rpm2) * np.pi / 30.0
    found, _ = accelerations(flown(model), velocity, q, np.zeros(3), speeds)
    expected = np.array(model.acceleration_ned(list(each), c)) + (9.81 - 9.80665) * UP
    assert found == pytest.approx(expected, abs=2e-3 if slow < 1.0 else 1e-6)


def test_each_rotor_turns_the_vehicle_as_in_the_model(raptor: Vehicle) -> None:
    model = Model(raptor)
    vehicle = flown(model)
    for i in range(4):
        each = np.full(4, 3.0)
        each[i] += 0.5
        speeds = np.sqrt(each / raptor.rotor.thrust_n_per_rpm2) * np.pi / 30.0
        _, found = accelerations(vehicle, np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]), np.zeros(3), speeds)
        expected = np.array(raptor.rotor_torque(list(each))) / raptor.principal_inertia_kg_m2
        assert found == pytest.approx(expected, abs=1e-9)


def test_a_centre_of_mass_that_is_off_is_in_the_places_of_the_rotors(raptor: Vehicle) -> None:
    model = Model(raptor).plus(FixedOffset(forward_mm=6.0, right_mm=-4.0))
    each = np.array([3.0, 3.5, 2.8, 3.1])
    speeds = np.sqrt(each / raptor.rotor.thrust_n_per_rpm2) * np.pi / 30.0
    _, found = accelerations(flown(model), np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]), np.zeros(3), speeds)
    c = conditions(raptor, 10.0, (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0))
    expected = np.array(model.body_torque(list(each), c)) / raptor.principal_inertia_kg_m2
    assert found == pytest.approx(expected, abs=1e-9)


def test_a_held_out_flight_is_predicted_at_most_a_tenth_worse(held_out: HeldOut) -> None:
    vehicle, rates = flown(held_out.model), np.zeros(3)
    k = held_out.model.vehicle.rotor.thrust_n_per_rpm2

    def by_rotorpy(velocity: Floats, attitude: Floats, thrust_n: Floats) -> Floats:
        speeds = np.sqrt(thrust_n / k) * np.pi / 30.0
        rows = zip(velocity, attitude, speeds, strict=True)
        return np.array([accelerations(vehicle, v, q, rates, s)[0] for v, q, s in rows])

    held_out.assert_as_good(by_rotorpy)


def test_what_rotorpy_cannot_say_is_listed_in_the_file_and_on_the_terminal(
    quadctl: Callable[..., Result], raptor: Vehicle, tmp_path: Path
) -> None:
    save_model(Model(raptor).plus(Exponential(0.2, 4.0)).plus(LinearDrag(0.3, 0.4, 0.1)), tmp_path / "fitted.yaml")
    done = quadctl("export", tmp_path / "fitted.yaml", "--to", "rotorpy", "-o", tmp_path / "body.py")
    assert done.status == 0, done.err
    for said in (
        "Left out: ground_effect.exponential: RotorPy's vehicle has no parameter for it.",
        "Left out: rotor_drag.linear: d_x 0.3 and d_y 0.4 differ: k_d is of their mean.",
        "Left out: gravity: RotorPy's is 9.81, the model's 9.80665",
    ):
        assert said in done.out
        assert said in (tmp_path / "body.py").read_text()


@pytest.mark.parametrize(
    ("name", "words"), [("f550_tilted", "has 6 rotors, expected 4"), ("tilted", "cant_deg 10 and dihedral_deg 0")]
)
def test_a_vehicle_that_rotorpy_cannot_hold_is_refused(
    name: str, words: str, quadctl: Callable[..., Result], raptor: Vehicle, tmp_path: Path
) -> None:
    path = VEHICLES / f"{name}.yaml"
    if name == "tilted":
        path = tmp_path / "tilted.yaml"
        tilted = raptor.rotors[0].model_copy(update={"cant_deg": 10.0})
        vehicle = raptor.model_copy(update={"rotors": (tilted, *raptor.rotors[1:])})
        save_model(Model(vehicle), path)
    done = quadctl("export", path, "--to", "rotorpy", "-o", tmp_path / "body.py")
    assert done.status == 1
    assert words in done.err
    assert not (tmp_path / "body.py").exists()
