"""Parameter files as each ground station writes them."""

from pathlib import Path

import pytest

from quadctl.errors import SettingsError
from quadctl.parameter_file import read_parameters

FILES = {
    "QGroundControl": "# Onboard parameters\n#\n1\t1\tMPC_THR_HOVER\t0.500000000000\t9\n1\t1\tCA_AIRFRAME\t0\t6\n",
    "Mission Planner": "MPC_THR_HOVER,0.5\r\nCA_AIRFRAME,0\r\n",
    "MAVProxy": "MPC_THR_HOVER     0.500000\nCA_AIRFRAME       0.000000 # a comment\n\n",
}


@pytest.mark.parametrize("station", FILES)
def test_names_and_values_are_read(station: str, tmp_path: Path) -> None:
    path = tmp_path / "vehicle.params"
    path.write_text(FILES[station])
    assert read_parameters(path) == {"MPC_THR_HOVER": 0.5, "CA_AIRFRAME": 0.0}


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("MOT_THST_HOVER,much\n", "line 1: MOT_THST_HOVER is much, expected a number"),
        ("MOT_THST_HOVER,nan\n", "line 1: MOT_THST_HOVER is nan, expected a number"),
        ("A_B,1\n12 34\n", "line 2 is '12 34', expected a parameter's name and value"),
        ("# nothing\n", "holds no parameters, expected lines such as MOT_THST_HOVER,0.35"),
    ],
)
def test_a_bad_file_is_one_sentence(text: str, sentence: str, tmp_path: Path) -> None:
    path = tmp_path / "bad.parm"
    path.write_text(text)
    with pytest.raises(SettingsError, match=sentence):
        read_parameters(path)


def test_neither_a_missing_file_nor_a_binary_one_is_a_crash(tmp_path: Path) -> None:
    with pytest.raises(SettingsError, match=r"none\.parm: cannot be read"):
        read_parameters(tmp_path / "none.parm")
    (tmp_path / "log.parm").write_bytes(b"\xa3\x95\x80\xff")
    with pytest.raises(SettingsError, match="is no text, expected an autopilot's parameter file"):
        read_parameters(tmp_path / "log.parm")
