"""Parameters of crazyflow and drone-models from a model: flown back in their equations, they predict as it does."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from quadctl.effects.ground_effect import Exponential
from quadctl.effects.inflow import AxialInflow
from quadctl.effects.motor_lag import FirstOrderLag
from quadctl.effects.rotor_drag import LinearDrag
from quadctl.effects.rotor_reaction import InertialReaction
from quadctl.effects.thrust_scale import ConstantScale
from quadctl.export.crazyflow import crazyflow_code
from quadctl.frames import rotate_inverse
from quadctl.model import Model, conditions, save_model
from quadctl.vehicle import Vehicle
from tests.support.commands import Result
from tests.support.held_out import Floats, HeldOut
from tests.support.places import VEHICLES

FLIP = np.array([1.0, -1.0, -1.0])
"""Between north, east, down and north, west, up, and between forward, right, down and forward, left, up."""


def parameters_of(model: Model) -> dict[str, Any]:
    """Parameters in the file that is written."""
    place: dict[str, Any] = {}
    exec(crazyflow_code(model)[0], place)
    found: dict[str, Any] = place["parameters"]
    return found


def flown(
    dynamics: Callable[..., Any], model: Model, velocity_ned: Floats, attitude: Floats, thrust_n: Floats
) -> tuple[Floats, Floats]:
    """Derivatives of velocity, NED, and of the body rates, FRD, each of shape (n, 3)."""
    w, x, y, z = attitude.T
    rpm = np.sqrt(thrust_n / model.vehicle.rotor.thrust_n_per_rpm2)
    zeros = np.zeros_like(velocity_ned)
    quaternions = np.column_stack([x, -y, -z, w])
    _, _, v_dot, w_dot, _ = dynamics(zeros, quaternions, FLIP * velocity_ned, zeros, rpm, rpm, **parameters_of(model))
    return FLIP * v_dot, FLIP * w_dot


@pytest.mark.parametrize(
    "effect", [ConstantScale(0.9), LinearDrag(0.35, 0.25, 0.1), AxialInflow(0.4)], ids=lambda effect: effect.name
)
def test_in_hover_thrust_the_accelerations_are_the_models(
    effect: Any, raptor: Vehicle, dynamics: Callable[..., Any]
) -> None:
    model = Model(raptor).plus(effect)
    each = [raptor.weight_n / raptor.n_rotors] * 4
    q = np.array([1.0, 0.05, -0.08, 0.2])
    q /= np.linalg.norm(q)
    turn, velocity = (q[0], q[1], q[2], q[3]), np.array([1.5, -1.0, 0.4])
    c = conditions(raptor, 10.0, rotate_inverse(turn, (1.5, -1.0, 0.4)), turn)
    found, _ = flown(dynamics, model, velocity[None], q[None], np.array([each]))
    assert found[0] == pytest.approx(model.acceleration_ned(each, c), abs=1e-9)


def test_each_rotor_turns_the_vehicle_as_in_the_model(raptor: Vehicle, dynamics: Callable[..., Any]) -> None:
    level, still = np.array([[1.0, 0.0, 0.0, 0.0]] * 4), np.zeros((4, 3))
    thrust_n = 3.0 + 0.5 * np.eye(4)
    _, found = flown(dynamics, Model(raptor), still, level, thrust_n)
    for each, turning in zip(thrust_n, found, strict=True):
        assert turning == pytest.approx(np.array(raptor.rotor_torque(list(each))) / raptor.principal_inertia_kg_m2)


def test_the_speeds_of_the_rotors_follow_their_commands_with_the_lag_of_the_vehicle(
    raptor: Vehicle, dynamics: Callable[..., Any]
) -> None:
    parameters = parameters_of(Model(raptor).plus(FirstOrderLag(0.03)))
    speeds, commands = np.array([4000.0, 5000.0, 6000.0, 5000.0]), np.full(4, 5000.0)
    level, still = np.array([0.0, 0.0, 0.0, 1.0]), np.zeros(3)
    *_, found = dynamics(still, level, still, still, commands, speeds, **parameters)
    assert found == pytest.approx((commands - speeds) / (raptor.rotor.time_constant_s + 0.03))


def test_a_rotor_that_spins_up_turns_the_vehicle_as_in_the_model(raptor: Vehicle, dynamics: Callable[..., Any]) -> None:
    """In hover, where the rotor's inertia and its lead are the same."""
    model = Model(raptor).plus(InertialReaction(0.06))
    each, k = raptor.weight_n / 4.0, raptor.rotor.thrust_n_per_rpm2
    speeds = np.full(4, np.sqrt(each / k))
    commands = speeds + np.array([400.0, 100.0, -300.0, 50.0])
    rates = 2.0 * k * speeds * (commands - speeds) / raptor.rotor.time_constant_s
    level, still = np.array([0.0, 0.0, 0.0, 1.0]), np.zeros(3)
    found = dynamics(still, level, still, still, commands, speeds, **parameters_of(model))[3]
    c = conditions(raptor, 10.0, (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0), thrust_rate_n_s=tuple(rates))
    expected = np.array(model.body_torque([each] * 4, c)) / raptor.principal_inertia_kg_m2
    assert abs(expected[2]) > 1.0
    assert FLIP * found == pytest.approx(expected, rel=1e-6)


def test_a_held_out_flight_is_predicted_at_most_a_tenth_worse(held_out: HeldOut, dynamics: Callable[..., Any]) -> None:
    held_out.assert_as_good(lambda velocity, q, thrust: flown(dynamics, held_out.model, velocity, q, thrust)[0])


def test_what_crazyflow_cannot_say_is_listed_in_the_file_and_on_the_terminal(
    quadctl: Callable[..., Result], raptor: Vehicle, tmp_path: Path
) -> None:
    save_model(Model(raptor).plus(Exponential(0.2, 4.0)).plus(AxialInflow(0.4)), tmp_path / "fitted.yaml")
    done = quadctl("export", tmp_path / "fitted.yaml", "--to", "crazyflow", "-o", tmp_path / "body.py")
    assert done.status == 0, done.err
    for said in (
        "Left out: ground_effect.exponential: crazyflow's first_principles has no parameter for it.",
        "Left out: inflow.axial: proportional to the thrust in the model, constant in crazyflow",
    ):
        assert said in done.out
        assert said in (tmp_path / "body.py").read_text()


def test_a_vehicle_that_it_cannot_hold_is_refused(quadctl: Callable[..., Result], tmp_path: Path) -> None:
    done = quadctl("export", VEHICLES / "f550.yaml", "--to", "crazyflow", "-o", tmp_path / "body.py")
    assert done.status == 1
    assert "f550: has 6 rotors, expected 4 upright ones, as crazyflow: --to casadi and --to numpy take any" in done.err
    assert not (tmp_path / "body.py").exists()
