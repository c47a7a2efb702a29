"""The short forms of a mission file: parameters, groups, loops, headings; and what is said about wrong ones."""

import math
from pathlib import Path
from typing import Any

import pytest
import yaml

from quadctl.errors import SettingsError
from quadctl.missions import Mission, load_mission
from tests.support.places import ROOT

UP = {"name": "up", "kind": "move", "to_m": [0, 0, 1]}
HOLD = {"kind": "hold", "duration_s": 2}


def written(where: Path, *phases: Any, **keys: Any) -> Path:
    path = where / "m.yaml"
    path.write_text(yaml.safe_dump({"phases": [UP, *phases], "limits": {"max_z_m": 2.0}, **keys}))
    return path


def names(mission: Mission) -> list[str]:
    return [phase.name for phase in mission.phases]


def test_the_mission_of_the_documentation_loads(tmp_path: Path) -> None:
    page = (ROOT / "docs" / "missions.md").read_text()
    path = tmp_path / "m.yaml"
    path.write_text(page.partition("```yaml\n")[2].partition("```")[0])
    mission = load_mission(path, overrides=["speed_m_s=2"])
    assert names(mission) == [
        "takeoff",
        *["down_to_1", *["forward", "back"] * 3],
        "down_to_0.3",
        *["forward", "back"] * 3,
    ]
    assert math.degrees(mission.yaw_rad(mission.duration_s, 1.0)) == pytest.approx(90)


# --- loops -----------------------------------------------------------------------------------------------------------


def test_a_phase_and_a_group_are_repeated_in_place(tmp_path: Path) -> None:
    group = {"repeat": 2, "phases": [{"name": "a", **HOLD}, {"name": "b", "repeat": 2, **HOLD}]}
    mission = load_mission(written(tmp_path, group, {"name": "c", **HOLD}))
    assert names(mission) == ["up", "a", "b", "b", "a", "b", "b", "c"]
    assert mission.phases[-1].start_s == pytest.approx(mission.phases[0].end_s + 6 * 2)


def test_a_loop_within_a_loop_flies_every_pair(tmp_path: Path) -> None:
    inner = {"for_each": {"t": [1, 2]}, "phases": [{"name": "z${z_m}_$t", "kind": "hold", "duration_s": "$t"}]}
    outer = {
        "for_each": {"z_m": [0.5, 0.25]},
        "phases": [{"name": "to", "kind": "move", "to_m": [0, 0, "$z_m"]}, inner],
    }
    mission = load_mission(written(tmp_path, outer))
    assert names(mission) == ["up", "to", "z0.5_1", "z0.5_2", "to", "z0.25_1", "z0.25_2"]
    assert [mission.phases[i].start_m[2] for i in (2, 5)] == [0.5, 0.25]
    assert mission.phases[3].end_s - mission.phases[3].start_s == 2


def test_a_loop_over_the_values_of_a_parameter(tmp_path: Path) -> None:
    phase = {"name": "t$t", "for_each": {"t": "$times_s"}, "kind": "hold", "duration_s": "$t"}
    path = written(tmp_path, phase, parameters={"times_s": [1, 2.5]})
    assert names(load_mission(path)) == ["up", "t1", "t2.5"]
    assert names(load_mission(path, overrides=["times_s=[3]"])) == ["up", "t3"]


# --- parameters ------------------------------------------------------------------------------------------------------


def test_a_parameter_is_put_in_wherever_the_file_refers_to_it(tmp_path: Path) -> None:
    path = written(
        tmp_path,
        {"name": "wait", "kind": "hold", "duration_s": "$wait_s", "repeat": "$times"},
        parameters={"wait_s": 3.0, "times": 2, "fence_m": 4.0},
        limits={"max_z_m": 2.0, "max_distance_m": "$fence_m"},
    )
    mission = load_mission(path, overrides=["wait_s=7"])
    assert [p.end_s - p.start_s for p in mission.phases[1:]] == pytest.approx([7, 7])
    assert mission.limits.max_distance_m == 4.0
    assert mission.parameters == {"wait_s": 7, "times": 2, "fence_m": 4.0}


def test_a_twin_may_give_one_parameter_another_value(tmp_path: Path) -> None:
    written(tmp_path, {"kind": "hold", "duration_s": "$a", "repeat": "$b"}, parameters={"a": 1, "b": 2})
    twin = tmp_path / "twin.yaml"
    twin.write_text("extends: m.yaml\nparameters: {a: 5}\n")
    assert load_mission(twin).parameters == {"a": 5, "b": 2}


def test_a_twin_with_phases_of_its_own_leaves_the_parameters_behind_that_these_do_not_need(tmp_path: Path) -> None:
    written(tmp_path, {"kind": "hold", "duration_s": "$a"}, parameters={"a": 1})
    twin = tmp_path / "twin.yaml"
    twin.write_text(f"extends: m.yaml\nphases: {[UP]}\n")
    assert load_mission(twin).parameters == {}


@pytest.mark.parametrize(
    "text",
    [
        "phases: &p [{phases: *p}]",
        "a: &a [1, 1, 1, 1, 1, 1, 1, 1, 1, 1]\nb: &b [*a, *a, *a, *a, *a, *a, *a, *a, *a, *a]\n"
        "c: &c [*b, *b, *b, *b, *b, *b, *b, *b, *b, *b]\nd: &d [*c, *c, *c, *c, *c, *c, *c, *c, *c, *c]\n"
        "phases: [*d, *d, *d, *d, *d, *d, *d, *d, *d, *d]",
    ],
    ids=["without end", "huge"],
)
def test_a_file_without_end_is_one_sentence(tmp_path: Path, text: str) -> None:
    path = tmp_path / "m.yaml"
    path.write_text(text)
    with pytest.raises(SettingsError, match=r"m\.yaml: holds more than 100000 values with all its aliases"):
        load_mission(path)


def test_what_is_set_is_checked_as_if_it_stood_in_the_file(tmp_path: Path) -> None:
    path = written(tmp_path, {"kind": "move", "to_m": [0, 0, "$z_m"]}, parameters={"z_m": 1.5})
    with pytest.raises(SettingsError, match=r"m\.yaml: phase 'move' goes to z = 2\.\d\d m, expected at most limits"):
        load_mission(path, overrides=["z_m=3"])


@pytest.mark.parametrize(
    ("override", "said"),
    [
        ("wait_m=3", "has no parameter 'wait_m' (did you mean 'wait_s'?), expected one of: times_s, wait_s"),
        ("wait_s", "--set is 'wait_s', expected NAME=VALUE"),
        ("wait_s=long", "--set wait_s is long, expected a number, as 3.0 is"),
        ("wait_s=", "--set wait_s is , expected a number, as 3.0 is"),
        ("wait_s=yes", "--set wait_s is yes, expected a number"),
        ("wait_s=[1]", "--set wait_s is [1], expected a number"),
        ("times_s=[]", "phases[3]: for_each.t is [], expected"),
        ("times_s=3", "--set times_s is 3, expected a list"),
        ("wait_s={", "--set wait_s, line 1"),
        ("wait_s=-1", "phases[2]: duration_s is -1, expected"),
        ("wait_s=.nan", "is nan, expected"),
    ],
)
def test_a_wrong_override_is_one_sentence(tmp_path: Path, override: str, said: str) -> None:
    phases = [
        {"kind": "hold", "duration_s": "$wait_s"},
        {"for_each": {"t": "$times_s"}, "kind": "hold", "duration_s": "$t"},
    ]
    path = written(tmp_path, *phases, parameters={"wait_s": 3.0, "times_s": [1, 2]})
    with pytest.raises(SettingsError) as caught:
        load_mission(path, overrides=[override])
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("phase", "keys", "said"),
    [
        ({"kind": "hold", "duration_s": "$wat"}, {}, "phases[2].duration_s: there is no parameter 'wat', the mission"),
        ({"kind": "hold", "duration_s": 1}, {"parameters": {"idle": 1}}, "nothing refers to the parameter 'idle'"),
        ({"kind": "hold", "duration_s": 1}, {"parameters": [1]}, "parameters is [1], expected names"),
        ({"repeat": 0, **HOLD}, {}, "phases[2]: repeat is 0, expected"),
        ({"repeat": "$n", **HOLD}, {"parameters": {"n": "many"}}, "phases[2]: repeat is 'many', expected a whole"),
        ({"for_each": {"a": 3}, **HOLD}, {}, "phases[2]: for_each.a is 3, expected a list"),
        ({"for_each": {"a": [1], "b": [2]}, **HOLD}, {}, "phases[2]: for_each is"),
        ({"phases": []}, {}, "phases[2].phases is [], expected a list of phases"),
        ({"phases": [HOLD], "speed": 1}, {}, "phases[2]: unknown key 'speed' of a group"),
        ({"phases": [{"kind": "hold"}]}, {}, "phases[2].phases[1]: duration_s is missing"),
        ({"repeat": 1000, "phases": [{"repeat": 1000, **HOLD}]}, {}, "more than 10000"),
        ({"repeat": 100, **HOLD}, {"repeat": 1000}, "more than 10000"),
        ({"yaw_deg": "north", **HOLD}, {}, "phases[2]: yaw_deg is 'north', expected a number"),
        (HOLD, {"yaw_rate_deg_s": 0}, "yaw_rate_deg_s is 0, expected"),
    ],
    ids=str,
)
def test_a_wrong_short_form_is_one_sentence(tmp_path: Path, phase: Any, keys: dict[str, Any], said: str) -> None:
    path = written(tmp_path, phase, **keys)
    with pytest.raises(SettingsError) as caught:
        load_mission(path)
    assert str(caught.value).startswith(str(path))
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


# --- headings --------------------------------------------------------------------------------------------------------


def test_each_phase_turns_to_its_heading_the_short_way_at_the_rate_of_the_mission(tmp_path: Path) -> None:
    """UP takes 2.25 s. At 90 deg/s: to 170 in 1.9 s, and on to -170 in 0.2 s more, not back by 340."""
    long = {"kind": "hold", "duration_s": 4}
    group = {"yaw_deg": 170, "phases": [long, {"yaw_deg": -170, **long}, long]}
    mission = load_mission(written(tmp_path, group, long, yaw_rate_deg_s=90))
    begin = mission.phases[0].end_s

    def heading_deg(t_s: float) -> float:
        return math.degrees(mission.yaw_rad(t_s, 0.0)) % 360

    assert heading_deg(begin) == 0.0
    assert heading_deg(begin + 1.0) == pytest.approx(90)
    assert heading_deg(begin + 3.9) == pytest.approx(170)
    assert heading_deg(begin + 4.1) == pytest.approx(179)
    assert heading_deg(begin + 5.0) == pytest.approx(190)
    assert heading_deg(begin + 9.0) == pytest.approx(170)  # the group's, of the third phase again
    assert heading_deg(1e6) == pytest.approx(170)


def test_a_turn_that_the_next_one_breaks_off_goes_on_from_where_it_is(tmp_path: Path) -> None:
    one_second = {"kind": "hold", "duration_s": 1}
    mission = load_mission(written(tmp_path, {"yaw_deg": 90, **one_second}, {"yaw_deg": 0, **HOLD}))
    begin = mission.phases[0].end_s
    assert math.degrees(mission.yaw_rad(begin + 1.0, 0.0)) == pytest.approx(45)
    assert math.degrees(mission.yaw_rad(begin + 1.5, 0.0)) == pytest.approx(22.5)
    assert mission.yaw_rad(begin + 3.0, 0.0) == pytest.approx(0.0)


def test_without_a_heading_that_of_take_off_is_kept(tmp_path: Path) -> None:
    assert load_mission(written(tmp_path, HOLD)).yaw_rad(3.0, 1.25) == pytest.approx(1.25)
