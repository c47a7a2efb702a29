"""Missions and trajectories against values worked out by hand; what a mission file must not say."""

import itertools
import math
from pathlib import Path
from typing import Any

import pytest
import yaml
from hypothesis import assume, given
from hypothesis import strategies as st

from quadctl.errors import SettingsError
from quadctl.missions import Mission, load_mission
from quadctl.settings import validate
from quadctl.state import Vec3
from quadctl.trajectories import Reference, Trajectory, find_trajectory, known_trajectories
from quadctl.trajectories.hold import Hold
from quadctl.trajectories.move import Move
from quadctl.trajectories.staircase import Staircase
from quadctl.trajectories.step import Step
from tests.support.places import ROOT

MISSIONS = ROOT / "missions"
START: Vec3 = (0.0, 0.0, 0.0)


def move(**keys: Any) -> Move:
    return validate(keys, Move, "test")


def mission_file(where: Path, file: str = "m", **keys: Any) -> Path:
    data: dict[str, Any] = {
        "phases": [{"name": "takeoff", "kind": "move", "to_m": [0, 0, 1], "speed_m_s": 0.5}],
        "limits": {"max_z_m": 2.0},
    }
    path = where / f"{file}.yaml"
    path.write_text(yaml.safe_dump({k: v for k, v in {**data, **keys}.items() if v is not None}))
    return path


def load(where: Path, **keys: Any) -> Mission:
    return load_mission(mission_file(where, **keys))


def sentence(where: Path, **keys: Any) -> str:
    """Error about a mission file with these keys; it names the file."""
    path = mission_file(where, **keys)
    with pytest.raises(SettingsError) as caught:
        load_mission(path)
    text = str(caught.value)
    assert text.startswith(f"{path}")
    assert "\n" not in text
    return text.removeprefix(f"{path}").lstrip(": ")


# --- move ------------------------------------------------------------------------------------------------------------


def test_move_is_a_trapezoid_of_speed() -> None:
    """4 m at 1 m/s with ramps of 2 m/s^2: 0.5 s up (0.25 m), 3.5 s at speed, 0.5 s down."""
    line = move(to_m=[4, 0, 0], speed_m_s=1.0, acceleration_m_s2=2.0)
    assert line.duration_s(START) == pytest.approx(4.5)
    begin, ramp, cruise, brake = (line.reference(t, START) for t in (0.0, 0.25, 2.0, 4.25))
    assert begin == Reference((0, 0, 0), (0, 0, 0), (2, 0, 0))
    assert ramp == Reference((0.0625, 0, 0), (0.5, 0, 0), (2, 0, 0))
    assert cruise == Reference((0.25 + 1.5, 0, 0), (1, 0, 0), (0, 0, 0))
    assert brake == Reference((4 - 0.0625, 0, 0), (0.5, 0, 0), (-2, 0, 0))
    assert line.reference(4.5, START) == Reference((4, 0, 0), (0, 0, 0), (0, 0, 0))


def test_a_short_move_is_a_triangle_that_never_reaches_its_speed() -> None:
    """0.5 m with 2 m/s^2: half of it after sqrt(0.5 / 2) = 0.5 s, at 1 m/s."""
    line = move(to_m=[0, 0.5, 0], speed_m_s=10.0, acceleration_m_s2=2.0)
    assert line.duration_s(START) == pytest.approx(1.0)
    top = line.reference(0.5, START)
    assert top.position_m == pytest.approx((0, 0.25, 0))
    assert top.velocity_m_s == pytest.approx((0, 1, 0))


def test_move_waits_at_its_end() -> None:
    line = move(to_m=[4, 0, 0], speed_m_s=1.0, acceleration_m_s2=2.0, hold_s=3.0)
    assert line.duration_s(START) == pytest.approx(7.5)
    assert line.reference(6.0, START) == Reference((4, 0, 0), (0, 0, 0), (0, 0, 0))


def test_move_follows_the_straight_line() -> None:
    line = move(to_m=[3, 4, 12], speed_m_s=1.0)
    r = line.reference(6.0, START)
    assert r.velocity_m_s == pytest.approx((3 / 13, 4 / 13, 12 / 13))
    assert r.position_m[1] / r.position_m[0] == pytest.approx(4 / 3)


def test_a_move_to_where_it_stands_takes_no_time() -> None:
    line = move(to_m=[1, 2, 3])
    assert line.duration_s((1, 2, 3)) == 0.0
    assert line.reference(0.0, (1, 2, 3)) == Reference((1, 2, 3), (0, 0, 0), (0, 0, 0))


places = st.tuples(*[st.floats(-20, 20)] * 3)


@given(places, places, st.floats(0.05, 20), st.floats(0.1, 10), st.floats(0, 1))
def test_velocity_is_the_derivative_of_position_and_acceleration_that_of_velocity(
    begin: Vec3, end: Vec3, speed: float, acceleration: float, share: float
) -> None:
    assume(math.dist(begin, end) > 1e-3)
    line = move(to_m=list(end), speed_m_s=speed, acceleration_m_s2=acceleration)
    h = 1e-6
    whole = line.duration_s(begin)
    ramp = whole / 2 if math.dist(begin, end) < speed**2 / acceleration else speed / acceleration
    t = h + share * (whole - 2 * h)
    assume(min(abs(t - corner) for corner in (ramp, whole - ramp)) > 2 * h)  # the acceleration jumps there
    before, here, after = (line.reference(t + dt, begin) for dt in (-h, 0.0, h))
    for i in range(3):
        slope = (after.position_m[i] - before.position_m[i]) / (2 * h)
        assert here.velocity_m_s[i] == pytest.approx(slope, abs=1e-5 + 1e-6 * speed)
        slope = (after.velocity_m_s[i] - before.velocity_m_s[i]) / (2 * h)
        assert here.acceleration_m_s2[i] == pytest.approx(slope, abs=1e-4 * acceleration + 1e-6)
    assert math.hypot(*here.velocity_m_s) <= speed * (1 + 1e-9)


@given(places, places, st.floats(0.05, 20), st.floats(0.1, 10), st.floats(0, 10))
def test_move_ends_where_it_should_and_never_jumps(
    begin: Vec3, end: Vec3, speed: float, acceleration: float, hold: float
) -> None:
    line = move(to_m=list(end), speed_m_s=speed, acceleration_m_s2=acceleration, hold_s=hold)
    assert line.end_m(begin) == end
    assert line.reference(0.0, begin).position_m == pytest.approx(begin, abs=1e-9)
    moving = line.duration_s(begin) - hold
    just_before = line.reference(max(0.0, moving - 1e-6), begin)
    assert just_before.position_m == pytest.approx(end, abs=1e-4)
    assert just_before.velocity_m_s == pytest.approx((0, 0, 0), abs=1e-4)


# --- hold, staircase, step -------------------------------------------------------------------------------------------


def test_hold_stays_where_the_phase_before_ended() -> None:
    hold = validate({"duration_s": 30}, Hold, "test")
    assert hold.duration_s((1, 2, 3)) == 30
    assert hold.reference(29.0, (1, 2, 3)) == Reference((1, 2, 3), (0, 0, 0), (0, 0, 0))


def test_staircase_takes_its_first_step_at_once() -> None:
    stairs = validate({"to_z_m": 0.5, "step_m": 0.2, "hold_s": 5}, Staircase, "test")
    begin = (1.0, 2.0, 1.0)
    assert stairs.duration_s(begin) == 15  # 0.8, 0.6, 0.5: the last step is the rest
    heights = [stairs.reference(t, begin).position_m[2] for t in (0.0, 4.99, 5.0, 10.0, 15.0, 99.0)]
    assert heights == pytest.approx([0.8, 0.8, 0.6, 0.5, 0.5, 0.5])
    assert stairs.reference(0.0, begin)[1:3] == ((0, 0, 0), (0, 0, 0))
    assert stairs.reference(7.0, (0, 0, 0)).position_m[2] == pytest.approx(0.4)  # upward too


@given(st.floats(0.05, 50), st.floats(0.05, 50), st.floats(0.01, 5), st.floats(0.1, 60))
def test_every_staircase_reaches_its_last_height(begin: float, end: float, step: float, hold: float) -> None:
    stairs = validate({"to_z_m": end, "step_m": step, "hold_s": hold}, Staircase, "test")
    start = (0.0, 0.0, begin)
    assert stairs.end_m(start)[2] == end
    n = round(stairs.duration_s(start) / hold)
    heights = [begin] + [stairs.reference((i + 0.5) * hold, start).position_m[2] for i in range(n)]
    rises = [b - a for a, b in itertools.pairwise(heights)]
    assert all(abs(rise) <= step * (1 + 1e-5) for rise in rises)
    assert sum(rises) == pytest.approx(end - begin)


def test_step_jumps_at_once() -> None:
    step = validate({"to_m": [0, 0, 0.2], "duration_s": 29}, Step, "test")
    assert step.duration_s((0, 0, 1.2)) == 29
    assert step.reference(0.0, (0, 0, 1.2)) == Reference((0, 0, 0.2), (0, 0, 0), (0, 0, 0))


def test_lifting_raises_absolute_heights_only() -> None:
    assert move(to_m=[1, 2, 3]).lifted(0.5).to_m == (1, 2, 3.5)
    assert validate({"to_m": [1, 2, 3], "duration_s": 1}, Step, "t").lifted(0.5).to_m == (1, 2, 3.5)
    stairs = validate({"to_z_m": 1, "step_m": 0.1, "hold_s": 1}, Staircase, "t").lifted(0.5)
    assert (stairs.to_z_m, stairs.step_m) == (1.5, 0.1)
    hold = validate({"duration_s": 30}, Hold, "test")
    assert hold.lifted(0.5) == hold


def test_every_trajectory_says_its_duration_and_its_reference() -> None:
    assert set(known_trajectories()) >= {"hold", "move", "staircase", "step"}
    for kind in known_trajectories().values():
        assert kind.duration_s is not Trajectory.duration_s
        assert kind.reference is not Trajectory.reference


# --- missions --------------------------------------------------------------------------------------------------------


def test_phases_follow_each_other_in_time_and_place(tmp_path: Path) -> None:
    mission = load(
        tmp_path,
        phases=[
            {"name": "takeoff", "kind": "move", "to_m": [0, 0, 1], "speed_m_s": 0.5},  # 1 / 0.5 + 0.5 / 2 = 2.25 s
            {"name": "wait", "kind": "hold", "duration_s": 3},
            {"kind": "staircase", "to_z_m": 0.5, "step_m": 0.25, "hold_s": 2},
        ],
    )
    assert [(p.name, p.start_s, p.end_s) for p in mission.phases] == [
        ("takeoff", 0.0, 2.25),
        ("wait", 2.25, 5.25),
        ("staircase", 5.25, 9.25),
    ]
    assert [p.start_m for p in mission.phases] == [(0, 0, 0), (0, 0, 1), (0, 0, 1)]
    assert mission.duration_s == 9.25
    names = [mission.phase_at(t).name for t in (-1.0, 0.0, 2.2499, 2.25, 5.25, 9.25, 1e9)]
    assert names == ["takeoff", "takeoff", "takeoff", "wait", "staircase", "staircase", "staircase"]
    assert mission.reference(4.0).position_m == (0, 0, 1)
    assert mission.reference(6.0).position_m == (0, 0, 0.75)
    assert mission.reference(1e9).position_m == (0, 0, 0.5)


def test_repeat_flies_the_phases_again_from_where_they_ended(tmp_path: Path) -> None:
    there_and_back = [
        {"name": "up", "kind": "move", "to_m": [0, 0, 1]},
        {"name": "out", "kind": "move", "to_m": [1, 0, 1]},
    ]
    mission = load(tmp_path, phases=there_and_back, repeat=3)
    assert [p.name for p in mission.phases] == ["up", "out"] * 3
    assert mission.phases[2].start_m == (1, 0, 1)
    assert all(a.end_s == b.start_s for a, b in itertools.pairwise(mission.phases))


def test_offset_up_lifts_all_heights_and_the_limit(tmp_path: Path) -> None:
    path = mission_file(tmp_path, phases=[{"kind": "move", "to_m": [0, 0, 2]}, {"kind": "hold", "duration_s": 1}])
    low, high = load_mission(path), load_mission(path, offset_up_m=1.5)
    assert low.reference(100.0).position_m == (0, 0, 2)
    assert high.reference(100.0).position_m == (0, 0, 3.5)
    assert (high.offset_up_m, high.limits.max_z_m, high.limits.min_z_m) == (1.5, 3.5, low.limits.min_z_m)


def test_offset_up_of_the_command_takes_the_place_of_the_files(tmp_path: Path) -> None:
    path = mission_file(tmp_path, offset_up_m=5.0)
    assert load_mission(path).reference(99.0).position_m[2] == 6.0
    assert load_mission(path, 0.0).reference(99.0).position_m[2] == 1.0


def test_extends_takes_everything_but_what_is_given(tmp_path: Path) -> None:
    mission_file(tmp_path, "base", name="base", description="d", yaw_deg=90, repeat=2)
    (tmp_path / "twin.yaml").write_text("extends: base.yaml\noffset_up_m: 0.5\nrepeat: 1")
    (tmp_path / "deep").mkdir()
    (tmp_path / "deep" / "grandchild.yaml").write_text("extends: ../twin.yaml\nyaw_deg: -90\n")
    base, twin = load_mission(tmp_path / "base.yaml"), load_mission(tmp_path / "twin.yaml")
    child = load_mission(tmp_path / "deep" / "grandchild.yaml")
    assert [m.name for m in (base, twin, child)] == ["base", "twin", "grandchild"]
    assert [m.yaw_rad(m.duration_s, 0.0) for m in (base, twin, child)] == pytest.approx(
        [math.pi / 2, math.pi / 2, -math.pi / 2]
    )
    assert (twin.offset_up_m, child.offset_up_m, twin.description) == (0.5, 0.5, "d")
    assert (len(base.phases), len(twin.phases)) == (2, 1)


@pytest.mark.parametrize("path", sorted(MISSIONS.glob("*.yaml")), ids=lambda path: path.stem)
def test_the_missions_of_the_project_load(path: Path) -> None:
    mission = load_mission(path)
    assert mission.name == path.stem
    assert mission.description
    assert mission.phases[0].name == "takeoff"


def test_hover_staircase_is_that_of_the_thesis() -> None:
    """30 s at 0.9 m, then 16 steps of 0.05 m down to 0.1 m, 5 s each, and 16 up."""
    mission = load_mission(MISSIONS / "hover_staircase.yaml")
    takeoff, hover, down, up = mission.phases
    assert takeoff.trajectory.end_m(START) == (0, 0, 0.9)
    assert hover.end_s - hover.start_s == pytest.approx(30)
    assert mission.reference(hover.start_s + 10).position_m == (0, 0, 0.9)
    for phase, begin, sign in ((down, 0.9, -1), (up, 0.1, 1)):
        assert phase.end_s - phase.start_s == pytest.approx(16 * 5)
        middles = [mission.reference(phase.start_s + 5 * i + 2.5).position_m[2] for i in range(16)]
        assert middles == pytest.approx([begin + sign * 0.05 * (i + 1) for i in range(16)])


@pytest.mark.parametrize(("name", "offset"), [("hover_staircase", 1.0), ("step_response", 0.9)])
def test_the_high_twins_differ_in_height_alone(name: str, offset: float) -> None:
    low, high = load_mission(MISSIONS / f"{name}.yaml"), load_mission(MISSIONS / f"{name}_high.yaml")
    assert [p.name for p in high.phases] == [p.name for p in low.phases]
    later = high.phases[0].end_s - low.phases[0].end_s  # the climb is longer
    for t in (low.phases[0].end_s + 0.1 * i for i in range(int(10 * low.duration_s))):
        (x, y, z), (hx, hy, hz) = low.reference(t).position_m, high.reference(t + later).position_m
        assert (hx, hy, hz) == pytest.approx((x, y, z + offset))


def test_step_response_steps_from_out_of_ground_effect_into_it() -> None:
    mission = load_mission(MISSIONS / "step_response.yaml")
    step = mission.phases[-1]
    assert (step.name, step.end_s - step.start_s) == ("step", 29)
    assert mission.reference(step.start_s - 1e-6).position_m == (0, 0, 1.2)
    assert mission.reference(step.start_s).position_m == (0, 0, 0.2)


# --- limits ----------------------------------------------------------------------------------------------------------

UP = {"name": "up", "kind": "move", "to_m": [0, 0, 1]}


def test_a_mission_exactly_at_its_limits_is_allowed(tmp_path: Path) -> None:
    phases = [UP, {"kind": "move", "to_m": [3, 4, 1]}, {"kind": "step", "to_m": [3, 4, 0.2], "duration_s": 1}]
    load(tmp_path, phases=phases, limits={"min_z_m": 0.2, "max_z_m": 1.0, "max_distance_m": 5.0})


@pytest.mark.parametrize(
    ("phase", "expected"),
    [
        (
            {"name": "leg", "kind": "move", "to_m": [0, 0, 2.5]},
            r"phase 'leg' goes to z = 2.\d\d m, expected at most limits.max_z_m = 2",
        ),
        (
            {"name": "leg", "kind": "step", "to_m": [0, 0, 0.1], "duration_s": 1},
            r"phase 'leg' goes to z = 0.10 m, expected at least limits.min_z_m = 0.2",
        ),
        (
            {"name": "leg", "kind": "move", "to_m": [3, 4.1, 1]},
            r"phase 'leg' goes to 5.\d\d m from the take-off point, expected at most limits.max_distance_m = 5",
        ),
        (
            {"name": "leg", "kind": "hold", "duration_s": 100},
            r"the mission lasts 102 s, expected at most limits.max_duration_s = 100",
        ),
    ],
)
def test_a_mission_outside_its_own_limits_is_refused(tmp_path: Path, phase: dict[str, Any], expected: str) -> None:
    limits = {"min_z_m": 0.2, "max_z_m": 2.0, "max_distance_m": 5.0, "max_duration_s": 100}
    with pytest.raises(SettingsError, match=expected):
        load(tmp_path, phases=[UP, phase], limits=limits)


def test_only_the_climb_from_the_ground_may_be_below_the_lower_limit(tmp_path: Path) -> None:
    limits = {"min_z_m": 0.2, "max_z_m": 2.0}
    low = {"kind": "move", "to_m": [0, 0, 0.1]}
    assert "z = 0.10 m, expected at least" in sentence(tmp_path, phases=[low], limits=limits)
    assert "z = 0.19 m, expected at least" in sentence(tmp_path, phases=[UP, low], limits=limits)
    nowhere = [{"kind": "hold", "duration_s": 10}]  # would spin on the ground, reference at z = 0
    assert "z = 0.00 m, expected at least" in sentence(tmp_path, phases=nowhere, limits=limits)


def test_an_offset_down_into_the_ground_is_refused(tmp_path: Path) -> None:
    with pytest.raises(SettingsError, match=r"z = -0\.50 m, expected at least"):
        load_mission(mission_file(tmp_path), offset_up_m=-1.5)


# --- bad input -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("phase", "expected"),
    [
        ({"kind": "mov", "to_m": [0, 0, 1]}, "phases[1]: there is no trajectory 'mov' (did you mean 'move'?)"),
        ({"kind": "qqq"}, "phases[1]: there is no trajectory 'qqq', expected one of: "),
        ({"to_m": [0, 0, 1]}, "phases[1].kind is None, expected the name of a trajectory"),
        ({"kind": 3}, "phases[1].kind is 3, expected the name of a trajectory"),
        (
            {"kind": "move", "to_m": [0, 0, 1], "sped_m_s": 1},
            "phases[1]: unknown key 'sped_m_s' (did you mean 'speed_m_s'?)",
        ),
        ({"kind": "hold", "seconds": 3}, "phases[1]: unknown key 'seconds', expected one of: duration_s"),
        ({"kind": "hold"}, "phases[1]: duration_s is missing"),
        ({"kind": "hold", "duration_s": -3}, "phases[1]: duration_s is -3, expected"),
        ({"kind": "hold", "duration_s": 0}, "phases[1]: duration_s is 0, expected"),
        ({"kind": "hold", "duration_s": math.nan}, "phases[1]: duration_s is nan, expected"),
        ({"kind": "hold", "duration_s": math.inf}, "phases[1]: duration_s is inf, expected"),
        ({"kind": "hold", "duration_s": "long"}, "phases[1]: duration_s is 'long', expected"),
        ({"kind": "move", "to_m": [0, 0]}, "phases[1]: to_m"),
        ({"kind": "move", "to_m": [0, math.nan, 1]}, "phases[1]: to_m[2] is nan, expected"),
        ({"kind": "move", "to_m": [0, 0, 1], "speed_m_s": 0}, "phases[1]: speed_m_s is 0, expected"),
        ({"kind": "staircase", "to_z_m": 1, "step_m": 0, "hold_s": 1}, "phases[1]: step_m is 0, expected"),
        ({"kind": "staircase", "to_z_m": 1, "step_m": 1e-320, "hold_s": 1}, "phases[1]: step_m is 1e-320, expected"),
        ({"kind": "step", "to_m": [0, 0, 1], "duration_s": -1}, "phases[1]: duration_s is -1, expected"),
    ],
    ids=str,
)
def test_a_phase_that_cannot_be_flown_is_one_sentence(tmp_path: Path, phase: dict[str, Any], expected: str) -> None:
    assert sentence(tmp_path, phases=[phase]).startswith(expected)


@pytest.mark.parametrize(
    "name", ["a,b", 'a"b', "'", "a\nb", "a\n", "\n", "a\rb", "", " a", "a ", "a\tb", "a;b", "[/]", 7, None, ["a"]]
)
def test_phase_names_that_would_break_a_csv_are_refused(tmp_path: Path, name: object) -> None:
    """The recorder writes them without quotes."""
    text = sentence(tmp_path, phases=[{"name": name, "kind": "move", "to_m": [0, 0, 1]}])
    assert text.startswith("phases[1].name is ")
    assert "expected words" in text


@pytest.mark.parametrize("name", ["up", "forward_050", "run 3", "1.5 m", "höhe", "a-b+c"])
def test_ordinary_phase_names_are_allowed(tmp_path: Path, name: str) -> None:
    assert load(tmp_path, phases=[{"name": name, "kind": "move", "to_m": [0, 0, 1]}]).phases[0].name == name


@pytest.mark.parametrize("name", ["../../etc/passwd", "a/b", "a\nb", ""])
def test_a_mission_name_that_is_no_file_name_is_refused(tmp_path: Path, name: str) -> None:
    """A mission's name becomes part of the log's name."""
    text = sentence(tmp_path, name=name)
    assert text.startswith("name is ")
    assert "expected words" in text


@pytest.mark.parametrize(
    ("keys", "expected"),
    [
        ({"phases": []}, "phases is [], expected"),
        ({"phases": "up"}, "phases is 'up', expected"),
        ({"phases": None}, "phases is missing"),
        ({"limits": None}, "limits is missing"),
        ({"limits": {"min_z_m": 0.1}}, "limits.max_z_m is missing"),
        ({"limits": {"max_z": 1.0}}, "unknown key 'limits.max_z' (did you mean 'max_z_m'?)"),
        ({"limits": {"max_z_m": -1.0}}, "limits.max_z_m is -1.0, expected"),
        ({"limits": {"max_z_m": math.nan}}, "limits.max_z_m is nan, expected"),
        ({"limits": {"max_z_m": 1.0, "min_z_m": -1.0}}, "limits.min_z_m is -1.0, expected"),
        ({"phase": []}, "unknown key 'phase' (did you mean 'phases'?)"),
        ({"repeat": 0}, "repeat is 0, expected"),
        ({"repeat": 1.5}, "repeat is 1.5, expected"),
        ({"yaw_deg": "north"}, "yaw_deg is 'north', expected"),
        ({"offset_up_m": math.inf}, "offset_up_m is inf, expected"),
    ],
    ids=str,
)
def test_a_mission_file_that_cannot_be_used_is_one_sentence(
    tmp_path: Path, keys: dict[str, Any], expected: str
) -> None:
    assert sentence(tmp_path, **keys).startswith(expected)


def test_an_offset_that_is_no_number_is_refused(tmp_path: Path) -> None:
    with pytest.raises(SettingsError, match="offset_up_m is nan"):
        load_mission(mission_file(tmp_path), math.nan)


def test_files_that_lead_back_to_themselves_are_refused(tmp_path: Path) -> None:
    a, b = tmp_path / "a.yaml", tmp_path / "b.yaml"
    a.write_text("extends: b.yaml")
    b.write_text("extends: a.yaml")
    with pytest.raises(SettingsError, match=r"extends is .*, expected the name of a mission file that does not lead"):
        load_mission(a)


def test_extending_what_is_not_there_names_the_missing_file(tmp_path: Path) -> None:
    path = tmp_path / "a.yaml"
    path.write_text("extends: base.yaml")
    with pytest.raises(SettingsError, match=r"base\.yaml: there is no such file"):
        load_mission(path)
    path.write_text("extends: [base.yaml]")
    with pytest.raises(SettingsError, match=r"a\.yaml: extends is \['base.yaml'\], expected the name"):
        load_mission(path)


def test_find_trajectory_gives_the_class() -> None:
    assert find_trajectory("move", "x") is Move
