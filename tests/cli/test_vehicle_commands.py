"""The commands about vehicles as a user meets them: `vehicle show`."""

from collections.abc import Callable
from pathlib import Path

from tests.support.commands import Result


def test_a_vehicle_is_shown_with_what_its_rotors_can_do(quadctl: Callable[..., Result]) -> None:
    shown = quadctl("vehicle", "show", "config/vehicles/f550_tilted.yaml")
    assert shown.status == 0
    lines = {line[:17].strip(): line[18:] for line in shown.out.splitlines()}
    # 6 * 8.33 N * cos 20 * cos 20 over 21.57 N; 0.1 + 0.018 * 21.57 / 0.883
    assert (lines["thrust to weight"], lines["hover throttle"]) == ("2.05", "0.54")
    assert (lines["allocation rank"], lines["lateral reach"]) == ("6 of 6", "2.87 N in level hover, 13% of the weight")
    upright = quadctl("vehicle", "show", "config/vehicles/raptor.yaml").out
    assert "allocation rank   4 of 6\nlateral reach     none" in upright


def test_a_vehicle_is_drawn_into_a_picture(quadctl: Callable[..., Result], tmp_path: Path) -> None:
    picture = tmp_path / "v.png"
    assert quadctl("vehicle", "show", "config/vehicles/f550_tilted.yaml", "--plot", picture).status == 0
    assert picture.read_bytes().startswith(b"\x89PNG")
    wrong = quadctl("vehicle", "show", "config/vehicles/raptor.yaml", "--plot", tmp_path / "v.txt")
    assert (wrong.status, wrong.err.count("\n")) == (1, 1)
    assert "expected .png" in wrong.err
