"""A model predicts acceleration with the right signs, and comes back from its file as it was."""

import math
import pickle
from pathlib import Path

import numpy as np
import pytest
import yaml

from quadctl.effects import Conditions
from quadctl.effects.body_drag import QuadraticDrag
from quadctl.effects.ground_effect import Exponential, Sanchez
from quadctl.effects.ground_torque import Levelling
from quadctl.effects.rotor_drag import LinearDrag
from quadctl.effects.rotor_fault import UnequalRotors, WeakRotor
from quadctl.effects.thrust_scale import ConstantScale
from quadctl.effects.thrust_tilt import FixedTilt
from quadctl.effects.wind import SteadyWind
from quadctl.errors import SettingsError
from quadctl.frames import quaternion_from_euler
from quadctl.model import Model, Provenance, StackedEffect, conditions, load_model, save_model
from quadctl.state import Quat, Vec3
from quadctl.vehicle import RotorPlace, Vehicle

HOVER_N = 3.67749375  # one rotor: 1.5 * 9.80665 / 4
TEN_DEG = math.radians(10.0)


def attitude(roll: float, pitch: float, yaw: float) -> Conditions:
    q: Quat = quaternion_from_euler(roll, pitch, yaw)
    return Conditions(height_m=1.0, velocity_body_m_s=(0.0, 0.0, 0.0), attitude=q)


# --- signs ---------------------------------------------------------------------------------------------------------


def test_hover_is_in_balance(raptor: Vehicle) -> None:
    assert Model(raptor).acceleration_ned([HOVER_N] * 4, attitude(0.0, 0.0, 0.7)) == pytest.approx((0, 0, 0), abs=1e-9)


def test_without_thrust_it_falls_with_gravity(raptor: Vehicle) -> None:
    assert Model(raptor).acceleration_ned([0.0] * 4, attitude(0.3, 0.2, 0.1)) == (0.0, 0.0, 9.80665)


def test_thrust_acts_along_minus_z_body(raptor: Vehicle) -> None:
    assert Model(raptor).body_force([1.0, 2.0, 3.0, 4.0], attitude(0.3, 0.2, 0.1)) == pytest.approx((0.0, 0.0, -10.0))


def test_a_climb_is_negative_down(raptor: Vehicle) -> None:
    # 10 % more than the weight: -0.1 * 9.80665
    assert Model(raptor).acceleration_ned([1.1 * HOVER_N] * 4, attitude(0.0, 0.0, 0.0)) == pytest.approx(
        (0.0, 0.0, -0.980665)
    )


@pytest.mark.parametrize(
    ("euler", "acceleration"),
    [
        # Thrust = weight, tilted by 10 deg: 9.80665 sin 10 = 1.7029069 sideways, 9.80665 (1 - cos 10) = 0.1489850 down.
        ((TEN_DEG, 0.0, 0.0), (0.0, 1.7029069, 0.1489850)),  # roll right, heading north: east
        ((-TEN_DEG, 0.0, 0.0), (0.0, -1.7029069, 0.1489850)),
        ((0.0, TEN_DEG, 0.0), (-1.7029069, 0.0, 0.1489850)),  # nose up, heading north: backward, south
        ((0.0, -TEN_DEG, 0.0), (1.7029069, 0.0, 0.1489850)),
        ((TEN_DEG, 0.0, math.pi / 2), (-1.7029069, 0.0, 0.1489850)),  # roll right, heading east: south
        ((0.0, TEN_DEG, math.pi / 2), (0.0, -1.7029069, 0.1489850)),  # nose up, heading east: west
    ],
)
def test_tilted_hover_accelerates_to_the_low_side(raptor: Vehicle, euler: Vec3, acceleration: Vec3) -> None:
    assert Model(raptor).acceleration_ned([HOVER_N] * 4, attitude(*euler)) == pytest.approx(acceleration, abs=1e-7)


def test_a_canted_rotor_pushes_along_its_own_axis(raptor: Vehicle) -> None:
    # The rotor in front, 20 deg of cant: 2 N along (0, sin 20, -cos 20).
    front = RotorPlace(position_m=(0.2, 0.0, 0.0), spin="cw", cant_deg=20.0)
    upright = RotorPlace(position_m=(-0.2, 0.1, 0.0), spin="cw")
    vehicle = raptor.model_copy(update={"rotors": (front, upright, upright)})
    force = Model(vehicle).body_force([2.0, 0.0, 0.0], attitude(0.0, 0.0, 0.0))
    assert force == pytest.approx((0.0, 0.6840403, -1.8793852))


# --- moments -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("thrust_n", "moment_n_m"),
    [
        ([3.0, 3.0, 3.0, 3.0], (0.0, 0.0, 0.0)),
        ([3.0, 4.0, 4.0, 3.0], (0.248, 0.0, 0.0)),  # 1 N more on each of the left rotors, 0.124 m: roll right
        ([4.0, 3.0, 4.0, 3.0], (0.0, 0.248, 0.0)),  # in front: nose up
        ([4.0, 4.0, 3.0, 3.0], (0.0, 0.0, 0.032)),  # on those that turn ccw, 0.016 m: the body turns cw, to the right
    ],
)
def test_rotors_turn_the_body(raptor: Vehicle, thrust_n: list[float], moment_n_m: Vec3) -> None:
    assert Model(raptor).body_torque(thrust_n, attitude(0.3, 0.2, 0.1)) == pytest.approx(moment_n_m, abs=1e-12)


def test_a_moment_stands_on_the_thrust_with_all_effects(raptor: Vehicle) -> None:
    # On the ground: -stiffness R roll per newton, 4 * 3 * 1.5 = 18 N: -18 * 0.5 * 0.12 * 0.1
    c = Conditions(0.0, (0.0, 0.0, 0.0), quaternion_from_euler(0.1, 0.0, 0.0))
    for order in (1, -1):
        model = Model(raptor)
        for effect in (Levelling(0.5), ConstantScale(1.5))[::order]:
            model = model.plus(effect)
        assert model.body_torque([3.0] * 4, c) == pytest.approx((-0.108, 0.0, 0.0), abs=1e-12)
        assert model.side_torque([4.5] * 4, c) == pytest.approx((-0.108, 0.0, 0.0), abs=1e-12)


def test_what_turns_is_what_the_moments_can_show(raptor: Vehicle) -> None:
    model = Model(raptor).plus(ConstantScale(1.1)).plus(WeakRotor()).plus(LinearDrag()).plus(Levelling())
    assert model.turning().effects == (WeakRotor(), Levelling())
    assert model.turning().vehicle is model.vehicle


# --- air -----------------------------------------------------------------------------------------------------------


def test_without_wind_the_air_stands_still(raptor: Vehicle) -> None:
    c = attitude(0.1, 0.2, 0.3)
    assert Model(raptor).plus(LinearDrag()).in_air(c) is c


def test_velocity_is_that_through_the_air(raptor: Vehicle) -> None:
    # Heading east, over ground 5 m/s forward; air from the west at 2 m/s and from the south at 1: 3 forward, 1 right
    c = Conditions(1.0, (5.0, 0.0, 0.5), quaternion_from_euler(0.0, 0.0, 0.5 * math.pi))
    air = Model(raptor).plus(SteadyWind(north_m_s=1.0, east_m_s=2.0)).in_air(c)
    assert air.velocity_body_m_s == pytest.approx((3.0, 1.0, 0.5))
    assert (air.height_m, air.attitude) == (c.height_m, c.attitude)


def test_who_stands_back_for_another_family_pushes_nothing_beside_it(raptor: Vehicle) -> None:
    wind, c = SteadyWind(2.0, 1.0, drag=0.3), attitude(0.0, 0.0, 0.4)
    alone = Model(raptor).plus(wind)
    air = alone.in_air(c)
    for drag in (LinearDrag(), QuadraticDrag()):
        both = alone.plus(drag)
        assert both.in_air(c) == air
        assert both.side_force(14.7, air) == pytest.approx(drag.force(14.7, air, raptor))
    scaled = alone.plus(ConstantScale())
    assert scaled.side_force(14.7, air) == pytest.approx(wind.force(14.7, air, raptor))


# --- effects together ----------------------------------------------------------------------------------------------


def test_effects_multiply_and_add(raptor: Vehicle) -> None:
    # Thrust 4 * 3 * 1.2 * 0.9 = 12.96 N; drag -1.5 * 0.4 * 2 = -1.2 N forward.
    stack = (StackedEffect(ConstantScale(1.2)), StackedEffect(LinearDrag(0.4, 0.4)), StackedEffect(ConstantScale(0.9)))
    c = Conditions(1.0, (2.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0))
    assert Model(raptor, stack).body_force([3.0] * 4, c) == pytest.approx((-1.2, 0.0, -12.96))


def test_the_thrust_after_each_effect_is_that_of_the_effects_before_it(raptor: Vehicle) -> None:
    stack = (StackedEffect(ConstantScale(1.2)), StackedEffect(LinearDrag(0.4, 0.4)), StackedEffect(ConstantScale(0.9)))
    c = Conditions(1.0, (2.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0))
    after_each = Model(raptor, stack).thrust_by_effect([3.0] * 4, c)
    assert [sum(thrust) for thrust in after_each] == pytest.approx([14.4, 14.4, 12.96])  # drag leaves it as it is


def test_the_loads_are_force_and_moment_of_rotors_and_effects_in_the_air_that_moves(raptor: Vehicle) -> None:
    # Over ground it stands still: 1 m/s of wind from ahead drags with 1.5 * 0.4 * 1 N, the weak rotor gives 2.7 N.
    stack = tuple(map(StackedEffect, (WeakRotor(loss=0.1, rotor=2.0), LinearDrag(0.4, 0.4), SteadyWind(-1.0, 0.0))))
    c = Conditions(1.0, (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0))
    loads = Model(raptor, stack).loads([3.0] * 4, c)
    assert loads.force_n == pytest.approx((-0.6, 0.0, -11.7))
    # The moments of four equal rotors cancel: what is left is that of the 0.3 N which the second one lacks.
    assert loads.torque_n_m == pytest.approx([-0.3 * arm for arm in raptor.moment_arms_m[1]])


def test_a_force_counts_by_the_share_of_its_own_effect(raptor: Vehicle) -> None:
    c = Conditions(1.0, (2.0, 1.0, 0.0), (1.0, 0.0, 0.0, 0.0))
    model = Model(raptor).plus(ConstantScale(1.2)).plus(LinearDrag(0.4, 0.4)).plus(QuadraticDrag())
    drag, draught = (Model(raptor).plus(effect).side_force(12.0, c) for effect in model.effects[1:])
    expected = [0.25 * a + 0.5 * b for a, b in zip(drag, draught, strict=True)]
    assert model.side_force(12.0, c, (0.0, 0.25, 0.5)) == pytest.approx(expected)


def test_forces_see_the_whole_thrust_whatever_the_order(raptor: Vehicle) -> None:
    tilt, scale = StackedEffect(FixedTilt(roll_deg=5.0)), StackedEffect(ConstantScale(1.3))
    c = attitude(0.0, 0.0, 0.0)
    one, other = Model(raptor, (tilt, scale)), Model(raptor, (scale, tilt))
    # 13 N leaning 5 deg to the right: 13 sin 5 = 1.1330247, 13 cos 5 = 12.9505311
    assert one.body_force([2.5] * 4, c) == pytest.approx((0.0, 1.1330247, -12.9505311))
    assert other.body_force([2.5] * 4, c) == pytest.approx((0.0, 1.1330247, -12.9505311))


def test_a_whole_log_at_once(raptor: Vehicle) -> None:
    model = Model(raptor).plus(Exponential()).plus(LinearDrag()).plus(FixedTilt(1.0, -2.0))
    n = 5
    rng = np.random.default_rng(1)
    z, u, v, w = rng.uniform(0.0, 2.0, n), *rng.normal(size=(3, n))
    roll, pitch, yaw = 0.3 * rng.normal(size=(3, n))
    thrust = rng.uniform(2.0, 5.0, (4, n))
    log = Conditions(z, (u, v, w), quaternion_from_euler(roll, pitch, yaw))
    at_once = model.acceleration_ned(list(thrust), log)
    for i in range(n):
        q: Quat = quaternion_from_euler(float(roll[i]), float(pitch[i]), float(yaw[i]))
        c = Conditions(float(z[i]), (float(u[i]), float(v[i]), float(w[i])), q)
        assert [a[i] for a in at_once] == pytest.approx(model.acceleration_ned([float(t) for t in thrust[:, i]], c))


def test_heights_are_those_of_the_rotor_plane(raptor: Vehicle) -> None:
    vehicle = raptor.model_copy(update={"rotor_height_m": 0.05})
    assert conditions(vehicle, 0.2, (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0)).height_m == pytest.approx(0.25)


def test_with_effects_changes_parameters_and_nothing_else(raptor: Vehicle) -> None:
    provenance = Provenance(logs=("a.csv",))
    model = Model(raptor).plus(Sanchez(2.0), provenance).with_effects([Sanchez(1.0)])
    assert model.stack == (StackedEffect(Sanchez(1.0), provenance),)
    with pytest.raises(ValueError, match="zip"):
        model.with_effects([])


# --- files ---------------------------------------------------------------------------------------------------------

FITTED = Provenance(
    logs=("HOVERING.csv", "FORWARD_SPEED.csv"),
    rmse_before=0.41,
    rmse_after=0.12,
    held_out=True,
    ci95={"a": (0.10, 0.12), "b": (5.0, 5.8)},
    height_m=(0.09, 0.95),
    software="0.1.0",
)


def test_a_bare_vehicle_file_is_the_rigid_body(raptor_path: Path, raptor: Vehicle) -> None:
    model = load_model(raptor_path)
    assert model.vehicle == raptor
    assert model.effects == ()


def test_a_saved_model_comes_back_whole(tmp_path: Path, raptor_path: Path) -> None:
    model = load_model(raptor_path).plus(Exponential(a=0.12, b=5.1), FITTED).plus(LinearDrag(d_x=0.25))
    save_model(model, tmp_path / "deep" / "er" / "fitted.yaml")
    back = load_model(tmp_path / "deep" / "er" / "fitted.yaml")
    assert back.vehicle == model.vehicle
    assert back.stack == model.stack
    assert back.name == "fitted"


def test_the_vehicle_is_named_relative_to_the_model_file(
    tmp_path: Path, raptor_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for folder in ("vehicles", "models", "elsewhere"):
        (tmp_path / folder).mkdir()
    (tmp_path / "vehicles" / "raptor.yaml").write_text(raptor_path.read_text())
    monkeypatch.chdir(tmp_path / "vehicles")
    save_model(load_model("raptor.yaml").plus(Sanchez()), "../models/fitted.yaml")
    text = (tmp_path / "models" / "fitted.yaml").read_text()
    assert yaml.safe_load(text)["vehicle"] == "../vehicles/raptor.yaml"
    monkeypatch.chdir(tmp_path / "elsewhere")
    model = load_model("../models/fitted.yaml")
    assert model.effects == (Sanchez(),)
    assert model.vehicle.name == "raptor"
    # and once more from there, now to another place
    save_model(model, "copy.yaml")
    assert yaml.safe_load(Path("copy.yaml").read_text())["vehicle"] == "../vehicles/raptor.yaml"


def test_a_vehicle_written_inline(tmp_path: Path, raptor: Vehicle) -> None:
    save_model(Model(raptor).plus(ConstantScale(0.97)), tmp_path / "inline.yaml")
    assert yaml.safe_load((tmp_path / "inline.yaml").read_text())["vehicle"]["mass_kg"] == 1.5
    back = load_model(tmp_path / "inline.yaml")
    assert back.vehicle == raptor
    assert back.effects == (ConstantScale(0.97),)


def test_effects_may_be_named_in_short(tmp_path: Path, raptor_path: Path) -> None:
    path = tmp_path / "model.yaml"
    path.write_text(
        f"vehicle: {raptor_path}\neffects: [{{effect: sanchez, parameters: {{k_b: 1}}}}, {{effect: inflow}}]"
    )
    assert [e.name for e in load_model(path).effects] == ["ground_effect.sanchez", "inflow.axial"]


def test_shares_of_the_rotors_come_back_from_a_file(tmp_path: Path, raptor: Vehicle) -> None:
    unequal = UnequalRotors.of({1: 0.93, 4: 1.05})
    save_model(Model(raptor).plus(unequal), tmp_path / "unequal.yaml")
    (again,) = load_model(tmp_path / "unequal.yaml").effects
    assert again == unequal == pickle.loads(pickle.dumps(unequal))


@pytest.mark.parametrize("rotor", ["7", "1.5"])
def test_a_rotor_that_the_vehicle_has_not_is_refused(tmp_path: Path, raptor_path: Path, rotor: str) -> None:
    file = tmp_path / "weak.yaml"
    entry = f"  - {{effect: rotor_fault.weak, parameters: {{rotor: {rotor}, loss: 0.2}}}}"
    file.write_text(f"vehicle: {raptor_path}\neffects:\n{entry}\n")
    with pytest.raises(SettingsError, match=rf"effects\[1\]: parameter rotor .* is {rotor}, expected a whole number"):
        load_model(file)


def test_a_model_that_cannot_be_written(tmp_path: Path, raptor: Vehicle) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(SettingsError, match=r"model\.yaml: cannot be written \(.+\)$"):
        save_model(Model(raptor), tmp_path / "file" / "model.yaml")
