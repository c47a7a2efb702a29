"""Allocation: matrix, rank and lateral reach, against rotors worked out by hand."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from quadctl.allocation import MOMENT_SHARE, Allocation
from quadctl.vehicle import Vehicle, load_vehicle
from tests.support.places import ROOT

TILTED = load_vehicle(ROOT / "config" / "vehicles" / "f550_tilted.yaml")


def hexarotor(cant_deg: float, dihedral_deg: float = 0.0, alternating: bool = True) -> Vehicle:
    """TILTED with other tilts."""
    rotors = [
        {
            **rotor.model_dump(),
            "cant_deg": cant_deg if not alternating or rotor.spin == "ccw" else -cant_deg,
            "dihedral_deg": dihedral_deg,
        }
        for rotor in TILTED.rotors
    ]
    return Vehicle.model_validate({**TILTED.model_dump(), "rotors": rotors})


def test_upright_rotors_push_up_and_turn_but_never_sideward(raptor: Vehicle) -> None:
    # 1 N of motor 1, in front on the right, ccw: up, rolls left, pitches up, and its drag turns the body clockwise.
    assert raptor.allocation.matrix[:, 0] == pytest.approx([0.0, 0.0, -1.0, -0.124, 0.124, 0.016])
    assert raptor.allocation.rank == 4
    assert not raptor.allocation.fully_actuated
    assert raptor.allocation.lateral_reach_n(raptor.weight_n) == 0.0
    assert raptor.allocation.widest_angle_rad(raptor.weight_n) == 0.0
    assert raptor.allocation.lateral_mix == ((0.0, 0.0),) * 4


def test_six_rotors_that_cant_to_alternating_sides_are_fully_actuated() -> None:
    assert TILTED.allocation.rank == 6
    assert hexarotor(20.0).allocation.rank == 6


@pytest.mark.parametrize("vehicle", [hexarotor(0.0, 20.0), hexarotor(20.0, 20.0, alternating=False)])
def test_dihedral_alone_or_cant_to_one_side_gives_no_side_force_without_a_moment(vehicle: Vehicle) -> None:
    assert vehicle.allocation.rank == 4
    assert vehicle.allocation.lateral_reach_n(vehicle.weight_n) == 0.0


def test_lateral_reach_by_hand() -> None:
    # One rotor for each force and moment: those for the sides carry nothing of the thrust and cannot pull, so no reach.
    bare = Allocation(np.diag([1.0, 1.0, -1.0, 1.0, 1.0, 1.0]), 10.0, 1.0)
    assert bare.rank == 6
    assert bare.lateral_reach_n(5.0) == 0.0
    # The paper's hexarotor in hover: each rotor carries weight / (6 cos 20 cos 20) = 21.5746 / 5.298 = 4.072 N, and the
    # most that a rotor needs per N across is 0.9947 (its row of the inverse), so 4.072 * 0.7 / 0.9947 = 2.866 N.
    assert max(np.hypot(*TILTED.allocation.inverse[:, :2].T)) == pytest.approx(0.9947, abs=1e-4)
    assert TILTED.allocation.lateral_reach_n(TILTED.weight_n) == pytest.approx(2.866, abs=1e-3)
    # At 40 N each carries 7.550 N of its 8.33 N: 0.780 * 0.7 / 0.9947 = 0.549 N; at 45 N more than there is.
    assert TILTED.allocation.lateral_reach_n(40.0) == pytest.approx(0.549, abs=1e-3)
    assert TILTED.allocation.lateral_reach_n(45.0) == 0.0


@given(thrust_n=st.floats(0.0, 44.0), direction=st.floats(-math.pi, math.pi))
def test_every_force_within_reach_is_held_without_a_moment_and_with_room_for_moments(
    thrust_n: float, direction: float
) -> None:
    allocation = TILTED.allocation
    side_n = allocation.lateral_reach_n(thrust_n)
    wrench = np.array([side_n * math.cos(direction), side_n * math.sin(direction), -thrust_n, 0.0, 0.0, 0.0])
    thrusts = allocation.inverse @ wrench
    assert allocation.matrix @ thrusts == pytest.approx(wrench, abs=1e-9)
    carried_n = -allocation.inverse[0, 2] * thrust_n
    kept_n = MOMENT_SHARE * min(carried_n, allocation.max_thrust_n - carried_n) - 1e-4
    assert kept_n <= thrusts.min()
    assert thrusts.max() <= allocation.max_thrust_n - kept_n


@given(force_n=st.floats(0.0, 100.0), change_n=st.floats(-0.01, 0.01))
def test_the_widest_angle_keeps_within_reach_and_is_continuous(force_n: float, change_n: float) -> None:
    allocation = TILTED.allocation
    angle = allocation.widest_angle_rad(force_n)
    if angle > 0.0:
        assert force_n * math.sin(angle) <= allocation.lateral_reach_n(force_n * math.cos(angle)) + 1e-4
    assert abs(allocation.widest_angle_rad(max(force_n + change_n, 0.0)) - angle) < 0.005


def test_a_lateral_command_of_one_changes_the_thrusts_by_one_on_average() -> None:
    mix = np.abs(np.array(TILTED.allocation.lateral_mix))
    for column in mix.T:
        assert column[column > 1e-7].mean() == pytest.approx(1.0)
