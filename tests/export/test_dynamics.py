"""Equations of motion for other programs: the numbers of the model itself, with nothing dropped in silence."""

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from quadctl.effects import CATALOG
from quadctl.effects.base import Effect
from quadctl.effects.ground_effect import Exponential
from quadctl.effects.imu_bias import ConstantBias
from quadctl.effects.motor_lag import FirstOrderLag
from quadctl.effects.rotor_drag import LinearDrag
from quadctl.errors import SettingsError
from quadctl.export.dynamics import STATE, Dynamics, dynamics
from quadctl.export.numpy_code import numpy_code
from quadctl.export.targets import PROGRAMS
from quadctl.frames import rotate_inverse
from quadctl.model import Model, conditions, save_model
from quadctl.vehicle import Vehicle
from tests.support.commands import Result
from tests.support.held_out import Floats, HeldOut

P = (16.0, 3.0)


def state(down_m: float, velocity: tuple[float, float, float], turn: tuple[float, float, float]) -> list[float]:
    q = np.array([1.0, *turn])
    q /= np.linalg.norm(q)
    return [0.3, -0.2, down_m, *velocity, *map(float, q), 0.1, -0.2, 0.3]


def accelerations(model: Model, x: list[float], u: list[float]) -> list[float]:
    """By the model itself: velocity, then body rates."""
    q = (x[6], x[7], x[8], x[9])
    body = rotate_inverse(q, (x[3], x[4], x[5]))
    c = conditions(model.vehicle, -x[2], body, q, P[1], P[0], (x[0], x[1]))
    turning = np.array(model.prompt().body_torque(u, c))
    inertia = np.array(model.vehicle.principal_inertia_kg_m2)
    rates = np.array(x[10:])
    return [*model.prompt().acceleration_ned(u, c), *((turning - np.cross(rates, inertia * rates)) / inertia)]


@pytest.mark.parametrize("effect", list(CATALOG.values()), ids=lambda effect: effect.name)
def test_every_effect_of_the_catalogue_gives_the_same_numbers_with_symbols(
    effect: type[Effect], raptor: Vehicle
) -> None:
    model = Model(raptor).plus(effect())
    x, u = state(-0.4, (1.0, -0.7, 0.3), (0.1, -0.05, 0.2)), [3.0, 3.5, 4.0, 3.2]
    found = np.array(dynamics(model).function(x, u, P)).ravel()
    assert found[[3, 4, 5, 10, 11, 12]] == pytest.approx(accelerations(model, x, u), rel=1e-12, abs=1e-12)
    assert found[:3] == pytest.approx(x[3:6])


@settings(max_examples=30)
@given(
    down_m=st.floats(-3.0, -0.05),
    velocity=st.tuples(*[st.floats(-8.0, 8.0)] * 3),
    turn=st.tuples(*[st.floats(-0.5, 0.5)] * 3),
    thrust=st.lists(st.floats(0.0, 8.0), min_size=4, max_size=4),
)
def test_the_numpy_file_gives_the_same_numbers(
    raptor: Vehicle,
    down_m: float,
    velocity: tuple[float, float, float],
    turn: tuple[float, float, float],
    thrust: list[float],
) -> None:
    model = Model(raptor).plus(Exponential(0.2, 4.0)).plus(LinearDrag(0.3, 0.4, 0.1))
    found = compiled(model)(state(down_m, velocity, turn), thrust, P)
    x = state(down_m, velocity, turn)
    assert found[[3, 4, 5, 10, 11, 12]] == pytest.approx(accelerations(model, x, thrust), rel=1e-9, abs=1e-9)


def compiled(model: Model) -> Callable[..., Any]:
    place: dict[str, Any] = {}
    exec(numpy_code(model, dynamics(model), "a test"), place)
    function: Callable[..., Any] = place["x_dot"]
    return function


@pytest.mark.parametrize("effect", list(CATALOG.values()), ids=lambda effect: effect.name)
def test_the_numpy_file_knows_every_instruction_and_takes_many_samples(effect: type[Effect], raptor: Vehicle) -> None:
    model = Model(raptor).plus(effect())
    one, two = state(-0.4, (1.0, -0.7, 0.3), (0.1, -0.05, 0.2)), state(-1.4, (-1.0, 0.7, 0.1), (0.0, 0.05, 0.1))
    u = np.array([[3.0, 3.5, 4.0, 3.2], [4.0, 3.0, 3.0, 3.3]]).T
    found = compiled(model)(np.array([one, two]).T, u, np.array([P, P]).T)
    assert found.shape == (len(STATE), 2)
    assert found[3:6, 0] == pytest.approx(accelerations(model, one, list(u[:, 0]))[:3], rel=1e-9, abs=1e-9)
    assert found[3:6, 1] == pytest.approx(accelerations(model, two, list(u[:, 1]))[:3], rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("target", ["casadi", "numpy"])
def test_a_held_out_flight_is_predicted_as_by_the_model(held_out: HeldOut, target: str, tmp_path: Path) -> None:
    model = held_out.model
    written = tmp_path / "body"
    PROGRAMS[target](model, written)

    def by_target(velocity: Floats, attitude: Floats, thrust_n: Floats) -> Floats:
        n = len(velocity)
        x = np.column_stack([np.zeros((n, 3)), velocity, attitude, np.zeros((n, 3))]).T
        p = np.tile(P, (n, 1)).T
        if target == "numpy":
            place: dict[str, Any] = {}
            exec(written.read_text(), place)
            return np.asarray(place["x_dot"](x, thrust_n.T, p)[3:6].T)
        return np.array(ca.Function.load(str(written)).map(n)(x, thrust_n.T, p))[3:6].T

    held_out.assert_as_good(by_target)


def test_jacobians_come_with_it(raptor: Vehicle) -> None:
    function = dynamics(Model(raptor).plus(LinearDrag(0.3, 0.4, 0.1))).function
    x, u = state(-2.0, (1.0, 0.0, 0.0), (0.0, 0.0, 0.0)), [3.67] * 4
    by_x = np.array(function.factory("j", ["x", "u", "p"], ["jac:x_dot:x"])(x, u, P))
    assert by_x[3, 3] == pytest.approx(-0.3)  # level and to the north: d_x
    assert by_x[4, 4] == pytest.approx(-0.4)
    assert by_x[0, 3] == 1.0


def test_what_the_function_leaves_out_is_said(raptor: Vehicle) -> None:
    model = Model(raptor).plus(FirstOrderLag()).plus(ConstantBias())
    equations = dynamics(model)
    assert equations.left_out == (
        "motor_lag.first_order: its delay is a state of its own",
        "imu_bias.offset: an error of the accelerometer",
    )
    assert "Not in these equations: motor_lag.first_order: its delay is a state of its own." in numpy_code(
        model, equations, "a test"
    )


def test_the_command_writes_both_and_names_what_is_left_out(
    quadctl: Callable[..., Result], raptor: Vehicle, tmp_path: Path
) -> None:
    save_model(Model(raptor).plus(LinearDrag(0.3, 0.4, 0.1)).plus(FirstOrderLag()), tmp_path / "fitted.yaml")
    for target in ("casadi", "numpy"):
        written = tmp_path / f"body.{target}"
        done = quadctl("export", str(tmp_path / "fitted.yaml"), "--to", target, "-o", str(written))
        assert done.status == 0, done.err
        assert "Left out: motor_lag.first_order: its delay is a state of its own." in done.out
        assert written.is_file()
    refused = quadctl("export", str(tmp_path / "fitted.yaml"), "--to", "numpy")
    assert "--to numpy needs -o FILE" in refused.err


def test_a_saved_function_is_loaded_by_casadi_alone(raptor: Vehicle, tmp_path: Path) -> None:
    function = dynamics(Model(raptor)).function
    function.save(str(tmp_path / "body.casadi"))
    again = ca.Function.load(str(tmp_path / "body.casadi"))
    x = state(-1.0, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    hover = [raptor.weight_n / 4.0] * 4
    assert float(again(x, hover, P)[5]) == pytest.approx(0.0, abs=1e-12)
    assert math.isclose(float(again(x, hover, P)[5]), float(function(x, hover, P)[5]))


def test_an_operation_without_a_form_in_numpy_is_a_sentence_that_says_what_to_do(raptor: Vehicle) -> None:
    x, u, p = (ca.SX.sym(name, n) for name, n in (("x", 13), ("u", 4), ("p", 2)))
    function = ca.Function("f", [x, u, p], [ca.erf(x)])
    with pytest.raises(SettingsError, match=r"has no form in NumPy, expected those of quadctl\.numeric"):
        numpy_code(Model(raptor), Dynamics(function, ()), "mine")
