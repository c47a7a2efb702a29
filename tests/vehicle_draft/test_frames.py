"""Places of rotors: regular frames against what autopilots document, tilted axes against the vehicle's own."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from quadctl.errors import SettingsError
from quadctl.vehicle import RotorPlace
from quadctl.vehicle_draft.frames import FRAMES, ardupilot_frame, frame_places, overlap, px4_places

H = 0.1 / math.sqrt(2.0)
QUAD = {
    f"CA_ROTOR{i}_{name}": value
    for i, (x, y, km) in enumerate([(0.1, 0.1, 0.05), (-0.1, -0.1, 0.05), (0.1, -0.1, -0.05), (-0.1, 0.1, -0.05)])
    for name, value in (("PX", x), ("PY", y), ("KM", km))
} | {"CA_ROTOR_COUNT": 4.0}


def test_motor_1_of_a_quad_x_is_in_front_on_the_right_and_turns_counter_clockwise() -> None:
    first = frame_places("quad-x", 0.1)[0]
    assert first.position_m == pytest.approx((H, H, 0.0))
    assert first.spin == "ccw"


def test_motor_1_of_a_hexa_plus_is_in_front_and_turns_clockwise() -> None:
    first = frame_places("hexa-plus", 0.2)[0]
    assert first.position_m == pytest.approx((0.2, 0.0, 0.0))
    assert first.spin == "cw"


@pytest.mark.parametrize("frame", FRAMES)
def test_neighbours_turn_against_each_other_and_the_centre_is_the_middle(frame: str) -> None:
    places = sorted(frame_places(frame, 0.2), key=lambda p: math.atan2(p.position_m[1], p.position_m[0]))
    assert all(place.spin != places[i - 1].spin for i, place in enumerate(places))
    assert [sum(p.position_m[axis] for p in places) for axis in (0, 1)] == pytest.approx([0.0, 0.0])


def test_an_unknown_frame_is_refused_with_those_that_there_are() -> None:
    with pytest.raises(SettingsError, match="the frame is 'y6', expected one of quad-x, quad-plus, hexa-x, hexa-plus"):
        frame_places("y6", 0.2)


def test_px4_says_where_its_rotors_are() -> None:
    places = px4_places(QUAD)
    assert places is not None
    assert [(p.position_m, p.spin) for p in places] == [
        ((0.1, 0.1, 0.0), "ccw"),
        ((-0.1, -0.1, 0.0), "ccw"),
        ((0.1, -0.1, 0.0), "cw"),
        ((-0.1, 0.1, 0.0), "cw"),
    ]


def test_px4_without_places_says_nothing() -> None:
    assert px4_places({"CA_ROTOR_COUNT": 4.0}) is None
    assert px4_places({}) is None


@given(
    x=st.floats(-1.0, 1.0),
    y=st.floats(-1.0, 1.0),
    cant_deg=st.floats(-60.0, 60.0),
    dihedral_deg=st.floats(-60.0, 60.0),
)
def test_a_tilt_in_px4s_parameters_is_that_of_the_vehicle_file(
    x: float, y: float, cant_deg: float, dihedral_deg: float
) -> None:
    tilted = RotorPlace(position_m=(x, y, 0.0), spin="cw", cant_deg=cant_deg, dihedral_deg=dihedral_deg)
    axis = {f"CA_ROTOR0_A{name}": 2.0 * value for name, value in zip("XYZ", tilted.axis, strict=True)}
    places = px4_places({"CA_ROTOR_COUNT": 1.0, "CA_ROTOR0_PX": x, "CA_ROTOR0_PY": y, **axis})
    assert places is not None
    assert (places[0].cant_deg, places[0].dihedral_deg) == pytest.approx((cant_deg, dihedral_deg), abs=1e-6)


def test_a_rotor_that_points_down_is_refused() -> None:
    with pytest.raises(SettingsError, match="CA_ROTOR0_AX, AY, AZ are 0, 0, 1, expected an axis that points up"):
        px4_places(QUAD | {"CA_ROTOR0_AZ": 1.0})


def test_ardupilot_names_its_frame() -> None:
    assert ardupilot_frame({"FRAME_CLASS": 1.0, "FRAME_TYPE": 1.0}) == "quad-x"
    assert ardupilot_frame({"FRAME_CLASS": 2.0, "FRAME_TYPE": 0.0}) == "hexa-plus"
    assert ardupilot_frame({"MOT_THST_HOVER": 0.3}) is None


def test_a_frame_without_a_table_is_refused() -> None:
    with pytest.raises(SettingsError, match=r"FRAME_CLASS is 7 with FRAME_TYPE 1, expected 1 with 0 .quad-plus"):
        ardupilot_frame({"FRAME_CLASS": 7.0, "FRAME_TYPE": 1.0})


def positions_m(frame: str, arm_m: float) -> list[tuple[float, float, float]]:
    return [place.position_m for place in frame_places(frame, arm_m)]


class TestOverlap:
    def test_propellers_that_reach_into_each_other_are_told_with_the_diagonal_that_frees_them(self) -> None:
        """On a hexarotor neighbours are as far apart as the arm is long."""
        assert str(overlap(positions_m("hexa-x", 0.2), 0.254)) == (
            "The propellers would touch: their axes are 0.2 m apart, less than the diameter of 0.254 m. "
            "On this frame they turn free from a diagonal of 0.508 m on."
        )

    @pytest.mark.parametrize("frame", FRAMES)
    def test_the_diagonal_that_is_named_is_the_least_one(self, frame: str) -> None:
        touching = overlap(positions_m(frame, 0.1), 0.254)
        assert touching is not None
        free_m = touching.facts["free_m"]
        assert overlap(positions_m(frame, 0.5 * free_m + 1e-6), 0.254) is None
        assert overlap(positions_m(frame, 0.5 * free_m - 0.001), 0.254)

    def test_coaxial_rotors_at_two_heights_may_overlap(self) -> None:
        assert overlap([(0.2, 0.0, 0.0), (0.2, 0.0, 0.06)], 0.254) is None
