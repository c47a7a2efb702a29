"""A mission that ends when a quantity of the vehicle is known: `until` in its file."""

from pathlib import Path

import pytest

from quadctl.errors import SettingsError
from quadctl.missions import load_mission

MISSION = """
phases: [{name: up, kind: move, to_m: [0, 0, 1], speed_m_s: 0.5, hold_s: 3}]
limits: {max_z_m: 1.5}
"""


def mission_file(folder: Path, until: str) -> Path:
    path = folder / "wanted.yaml"
    path.write_text(f"{MISSION}until: {until}\n")
    return path


def test_shares_are_given_in_percent(tmp_path: Path) -> None:
    until = load_mission(mission_file(tmp_path, "{drag: 10 %, thrust: 0.5%}")).until
    assert until == pytest.approx({"drag": 0.1, "thrust": 0.005})
    (tmp_path / "plain.yaml").write_text(MISSION)
    assert load_mission(tmp_path / "plain.yaml").until == {}


@pytest.mark.parametrize(
    ("until", "sentence"),
    [
        ("{grip: 10 %}", r"wanted\.yaml: until\.grip is not known, expected one of thrust, drag, inflow"),
        ("{drag: 0.1}", r"wanted\.yaml: until\.drag is 0\.1, expected a share such as 10 %, up to 100 %"),
        ("{drag: 0 %}", r"until\.drag is '0 %', expected a share such as 10 %"),
        ("{drag: 101 %}", r"until\.drag is '101 %', expected a share such as 10 %"),
        ("{drag: [10]}", r"until\.drag is \[10\], expected a share such as 10 %"),
        ("10 %", r"wanted\.yaml: until"),
    ],
)
def test_anything_else_is_refused_with_its_field(tmp_path: Path, until: str, sentence: str) -> None:
    with pytest.raises(SettingsError, match=sentence):
        load_mission(mission_file(tmp_path, until))
