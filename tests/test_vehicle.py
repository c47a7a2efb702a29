"""The vehicle's derived quantities, worked out by hand for the RAPTOR, and the axes of tilted rotors."""

import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from quadctl.vehicle import RotorPlace, Vehicle

SIN_20, COS_20 = 0.3420201433, 0.9396926208


def place(x: float, y: float, **tilt_deg: float) -> RotorPlace:
    return RotorPlace(position_m=(x, y, 0.0), spin="cw", **tilt_deg)


def with_rotors(vehicle: Vehicle, rotors: list[RotorPlace]) -> Vehicle:
    data: dict[str, Any] = {**vehicle.model_dump(), "rotors": [r.model_dump() for r in rotors]}
    return Vehicle.model_validate(data)


def test_weight_is_mass_times_standard_gravity(raptor: Vehicle) -> None:
    assert raptor.weight_n == pytest.approx(14.709975)  # 1.5 * 9.80665


def test_largest_thrust(raptor: Vehicle) -> None:
    assert raptor.max_thrust_n == pytest.approx(35.9056)  # 4 * 8.9764


def test_induced_velocity_in_hover(raptor: Vehicle) -> None:
    # T of one rotor = 14.709975 / 4 = 3.67749375 N; pi R^2 = pi * 0.0144 = 0.0452389 m^2;
    # v_h^2 = 3.67749375 / (2 * 1.205 * 0.0452389) = 3.67749375 / 0.1090258 = 33.73048; v_h = 5.80779 m/s.
    # With R in place of R^2, as in the thesis' code, it would be 5.80779 * sqrt(0.12) = 2.01 m/s.
    assert raptor.hover_induced_velocity_m_s == pytest.approx(5.80779, abs=1e-5)


def test_moment_arms_by_hand(raptor: Vehicle) -> None:
    # 1 N up in front and on the right (motor 1) rolls left and pitches up by 0.124 N m; a ccw rotor's drag torque of
    # 0.016 N m turns the body clockwise, which is positive about down.
    assert raptor.moment_arms_m == (
        pytest.approx((-0.124, 0.124, 0.016)),
        pytest.approx((0.124, -0.124, 0.016)),
        pytest.approx((0.124, 0.124, -0.016)),
        pytest.approx((-0.124, -0.124, -0.016)),
    )


def test_a_canted_rotor_has_a_lever_about_the_vertical(raptor: Vehicle) -> None:
    # Thrust (0, sin 20, -cos 20) at (0.2, 0, 0): lever (0, 0.2 cos 20, 0.2 sin 20); cw: 0.016 along the thrust.
    vehicle = with_rotors(raptor, [place(0.2, 0.0, cant_deg=20.0), place(-0.1, 0.2), place(-0.1, -0.2)])
    expected = (0.0, 0.2 * COS_20 + 0.016 * SIN_20, 0.2 * SIN_20 - 0.016 * COS_20)
    assert vehicle.moment_arms_m[0] == pytest.approx(expected)


def test_rotor_distances(raptor: Vehicle) -> None:
    assert raptor.adjacent_distance_m == pytest.approx(0.248)  # 2 * 0.124
    assert raptor.opposite_distance_m == pytest.approx(0.3507250)  # 0.248 * sqrt(2)


def test_inertia_of_a_file_that_says_none(raptor: Vehicle) -> None:
    # Mass on a ring of half the arm: r = 0.350725 / 4 = 0.0876812 m, r^2 = 0.007688;
    # about x and y m r^2 / 2 = 1.5 * 0.003844 = 0.005766, about z twice that.
    vehicle = raptor.model_copy(update={"inertia_kg_m2": None})
    assert vehicle.principal_inertia_kg_m2 == pytest.approx((0.005766, 0.005766, 0.011532))
    assert raptor.principal_inertia_kg_m2 == (0.0123, 0.0123, 0.0224)


def test_upright_rotors_push_up(raptor: Vehicle) -> None:
    assert [rotor.axis for rotor in raptor.rotors] == [pytest.approx((0.0, 0.0, -1.0))] * 4
    assert raptor.axial_share == pytest.approx(1.0, abs=1e-15)


@pytest.mark.parametrize(
    ("rotor", "axis"),
    [
        # Cant: right-handed about the outward arm. In front: (0, 0, -1) about +x leans right;
        # on the right: about +y it leans backward; behind: left.
        (place(1.0, 0.0, cant_deg=20.0), (0.0, SIN_20, -COS_20)),
        (place(0.0, 1.0, cant_deg=20.0), (-SIN_20, 0.0, -COS_20)),
        (place(-1.0, 0.0, cant_deg=20.0), (0.0, -SIN_20, -COS_20)),
        (place(1.0, 0.0, cant_deg=-20.0), (0.0, -SIN_20, -COS_20)),
        # Dihedral: toward the centre.
        (place(1.0, 0.0, dihedral_deg=20.0), (-SIN_20, 0.0, -COS_20)),
        (place(0.0, 1.0, dihedral_deg=20.0), (0.0, -SIN_20, -COS_20)),
        (place(0.0, -1.0, dihedral_deg=20.0), (0.0, SIN_20, -COS_20)),
        # Both, in front: (-cos c sin d, sin c, -cos c cos d) = (-0.939693 * 0.342020, 0.342020, -0.939693^2).
        (place(1.0, 0.0, cant_deg=20.0, dihedral_deg=20.0), (-0.3213938, SIN_20, -0.8830222)),
    ],
)
def test_axis_of_a_tilted_rotor(rotor: RotorPlace, axis: tuple[float, float, float]) -> None:
    assert rotor.axis == pytest.approx(axis, abs=1e-7)


@given(
    x=st.floats(-1.0, 1.0), y=st.floats(-1.0, 1.0), cant_deg=st.floats(-89.0, 89.0), dihedral_deg=st.floats(-89.0, 89.0)
)
def test_an_axis_is_a_unit_vector_that_points_up(x: float, y: float, cant_deg: float, dihedral_deg: float) -> None:
    axis = place(x, y, cant_deg=cant_deg, dihedral_deg=dihedral_deg).axis
    assert math.hypot(*axis) == pytest.approx(1.0)
    assert axis[2] < 0.0


def test_axial_share_of_a_canted_hexarotor(raptor: Vehicle) -> None:
    corners = [math.radians(30.0 + 60.0 * i) for i in range(6)]
    rotors = [place(math.cos(a), math.sin(a), cant_deg=(-1.0) ** i * 20.0) for i, a in enumerate(corners)]
    assert with_rotors(raptor, rotors).axial_share == pytest.approx(COS_20)


def test_a_rotor_inside_another_is_refused_and_a_coaxial_one_is_not(raptor: Vehicle) -> None:
    # radius 0.12 m: a hub at 0.05 m from another's, at its height, lies in its disc; 0.05 m below, it is coaxial
    places = [place(0.2, 0.0), place(-0.2, 0.1), place(-0.2, -0.1)]
    inside = RotorPlace(position_m=(0.25, 0.0, 0.0), spin="ccw")
    with pytest.raises(ValidationError, match=r"rotors\[4\] turns inside rotors\[1\], 0\.05 m from it"):
        with_rotors(raptor, [*places, inside])
    below = RotorPlace(position_m=(0.2, 0.0, 0.05), spin="ccw")
    assert with_rotors(raptor, [*places, below]).n_rotors == 4
