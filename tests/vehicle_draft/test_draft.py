"""A drafted vehicle file: numbers by hand, and no question about what a log says."""

import math
from pathlib import Path

import pytest
import yaml
from typer.testing import CliRunner

from quadctl.cli import app
from quadctl.errors import SettingsError
from quadctl.frames import GRAVITY_M_S2
from quadctl.settings import validate
from quadctl.vehicle import Vehicle, load_vehicle
from quadctl.vehicle_draft.draft import Answers, answers_of, draft, missing
from quadctl.vehicle_draft.frames import FRAMES, frame_places
from tests.support.log_files import dataflash_bytes
from tests.support.places import DATA
from tests.vehicle_draft.test_frames import QUAD

REPORTED = DATA / "reports" / "23-draft-asks-what-the-log-says" / "parameters.bin"
SMALL = Answers("small", mass_kg=1.0, propeller_m=0.2)
COPTER = {"FRAME_CLASS": 1.0, "FRAME_TYPE": 1.0, "MOT_THST_HOVER": 0.25}


def vehicle(answers: Answers, parameters: dict[str, float]) -> Vehicle:
    return validate(yaml.safe_load(draft(answers, parameters)), Vehicle, "the draft")


def test_ardupilots_thrust_is_proportional_to_its_throttle() -> None:
    drafted = vehicle(SMALL._replace(arm_m=0.15), COPTER)
    assert drafted.throttle.offset == 0.0
    assert drafted.throttle.per_newton == pytest.approx(0.25 / GRAVITY_M_S2, rel=1e-3)
    assert drafted.max_thrust_n == pytest.approx(4.0 * GRAVITY_M_S2, rel=1e-3)  # hovers at a quarter


def test_px4s_is_where_its_curve_is_set() -> None:
    drafted = vehicle(SMALL, QUAD | {"MPC_THR_HOVER": 0.5, "THR_MDL_FAC": 0.3})
    assert (drafted.throttle.offset, drafted.throttle.per_newton) == pytest.approx((0.0, 0.5 / GRAVITY_M_S2), rel=1e-3)


def test_else_the_line_touches_a_square_in_hover() -> None:
    # T = W (u / 0.5)², so dT/du = 4 W and u = 0.5 + (T - W) / 4 W = 0.25 + T / 4 W.
    drafted = vehicle(SMALL, QUAD | {"MPC_THR_HOVER": 0.5})
    assert drafted.throttle.offset == pytest.approx(0.25)
    assert drafted.throttle.per_newton == pytest.approx(0.25 / GRAVITY_M_S2, rel=1e-3)


def test_a_rotor_speed_in_hover_gives_the_thrust_coefficient() -> None:
    drafted = vehicle(SMALL._replace(hover_rpm=7000.0), QUAD | {"MPC_THR_HOVER": 0.5})
    assert drafted.rotor.thrust_n_per_rpm2 == pytest.approx(GRAVITY_M_S2 / 4 / 7000.0**2, rel=1e-3)


def test_only_what_nobody_has_said_is_asked() -> None:
    assert [fact.field for fact in missing(Answers("new"), {})] == [
        "mass_kg",
        "propeller_m",
        "frame",
        "hover_throttle",
    ]
    assert [fact.field for fact in missing(Answers("new"), COPTER)] == ["mass_kg", "propeller_m"]


HOVERS = {"MPC_THR_HOVER": 0.5}
CORNERS, UNIT = (
    QUAD | {name: math.copysign(at, value) for name, value in QUAD.items() if name[-2:] in ("PX", "PY")}
    for at in (1.0, 0.707)
)
"""Directions of rotors at the corners of a square, and on the unit circle."""


@pytest.mark.parametrize(
    ("parameters", "n_rotors", "first_m", "source"),
    # The first rotor of propellers of 0.2 m whose axes are 0.24 m apart.
    [
        (COPTER, 4, (0.12, 0.12), "frame from FRAME_CLASS and FRAME_TYPE"),
        (COPTER | {"FRAME": 1.0}, 4, (0.12, 0.12), "frame from FRAME and the message of the log"),
        (COPTER | {"FRAME_CLASS": 3.0}, 8, (0.2897, 0.12), "frame from FRAME_CLASS and FRAME_TYPE"),
        (CORNERS | HOVERS, 4, (0.12, 0.12), "as CA_ROTOR*"),
        (UNIT | HOVERS, 4, (0.12, 0.12), "as CA_ROTOR*"),
        (HOVERS | {"SYS_AUTOSTART": 4001.0, "MAV_TYPE": 2.0}, 4, (0.12, 0.12), "frame from SYS_AUTOSTART"),
        (HOVERS | {"SYS_AUTOSTART": 5001.0, "MAV_TYPE": 2.0}, 4, (0.0, 0.1697), "frame from SYS_AUTOSTART"),
        (HOVERS | {"SYS_AUTOSTART": 7001.0, "MAV_TYPE": 13.0}, 6, (0.24, 0.0), "frame from SYS_AUTOSTART"),
        (HOVERS | {"SYS_AUTOSTART": 10016.0, "MAV_TYPE": 2.0}, 4, (0.12, 0.12), "frame from MAV_TYPE, taken for an x"),
    ],
)
def test_mass_and_propellers_are_enough_where_the_parameters_say_the_frame(
    parameters: dict[str, float], n_rotors: int, first_m: tuple[float, float], source: str
) -> None:
    assert missing(SMALL, parameters) == []
    text = draft(SMALL, parameters)
    drafted = validate(yaml.safe_load(text), Vehicle, "the draft")
    assert drafted.n_rotors == n_rotors
    assert drafted.rotors[0].position_m[:2] == pytest.approx(first_m, abs=1e-4)
    assert f"{source}, the arm assumed" in text
    assert "rotors" in (drafted.assumed or ())
    assert answers_of(drafted).arm_m is None


def test_places_that_the_parameters_say_are_not_assumed() -> None:
    assert "rotors" not in (vehicle(SMALL, QUAD | HOVERS).assumed or ())
    assert "rotors" not in (vehicle(SMALL._replace(arm_m=0.15), COPTER).assumed or ())


def test_a_frame_that_cannot_be_drawn_is_no_matter_where_another_is_given() -> None:
    coaxial = COPTER | {"FRAME_CLASS": 4.0}
    with pytest.raises(SettingsError, match="FRAME_CLASS is 4 with FRAME_TYPE 1, expected 1 with 0"):
        missing(SMALL, coaxial)
    assert vehicle(SMALL._replace(frame="octa-x"), coaxial).n_rotors == 8


def test_copter_3_3_says_the_throttle_of_hover_in_thousandths() -> None:
    drafted = vehicle(SMALL, {"FRAME_CLASS": 1.0, "FRAME_TYPE": 0.0, "THR_MID": 420.0})
    assert drafted.throttle.offset == 0.0
    assert drafted.throttle.per_newton * drafted.weight_n == pytest.approx(0.42, rel=1e-3)


@pytest.mark.parametrize("frame", FRAMES)
@pytest.mark.parametrize("hover_rpm", [None, 5400.0])
def test_the_answers_come_back(frame: str, hover_rpm: float | None) -> None:
    said = Answers("mine", 2.5, 0.3, frame, 0.31, 0.42, hover_rpm)
    back = answers_of(vehicle(said, {}))
    assert (back.name, back.frame) == ("mine", frame)
    assert (back.hover_rpm is None) is (hover_rpm is None)
    assert [x for x in back[1:] if isinstance(x, float)] == pytest.approx(
        [x for x in said[1:] if isinstance(x, float)], rel=1e-3
    )


def test_rotors_on_no_regular_frame_come_back_as_none() -> None:
    assert answers_of(vehicle(SMALL, QUAD | {"MPC_THR_HOVER": 0.5, "CA_ROTOR0_AX": 0.2})).frame is None


def test_an_arm_that_is_given_scales_the_layout_of_the_parameters() -> None:
    drafted = vehicle(SMALL._replace(arm_m=0.115), QUAD | {"MPC_THR_HOVER": 0.5, "CA_ROTOR0_PZ": 0.02})
    as_told = vehicle(SMALL, QUAD | {"MPC_THR_HOVER": 0.5, "CA_ROTOR0_PZ": 0.02})
    arms_m = [math.hypot(*rotor.position_m[:2]) for rotor in drafted.rotors]
    assert max(arms_m) == pytest.approx(0.115, abs=1e-4)
    scale = 0.115 / max(math.hypot(*rotor.position_m[:2]) for rotor in as_told.rotors)
    for rotor, told in zip(drafted.rotors, as_told.rotors, strict=True):
        assert rotor.position_m == pytest.approx([scale * value for value in told.position_m], abs=1e-4)
        assert rotor.spin == told.spin


def test_a_tilted_rotor_stays_tilted() -> None:
    drafted = vehicle(SMALL, QUAD | {"MPC_THR_HOVER": 0.5, "CA_ROTOR0_AX": 0.2, "CA_ROTOR0_AZ": -1.0})
    assert drafted.rotors[0].axis == pytest.approx((0.2 / 1.04**0.5, 0.0, -1.0 / 1.04**0.5), abs=1e-4)


@pytest.mark.parametrize(
    ("answers", "parameters", "sentence"),
    [
        (SMALL, {}, "the vehicle's frame is not known, expected the frame: quad-x, quad-plus"),
        (SMALL._replace(mass_kg=-1.0), QUAD | {"MPC_THR_HOVER": 0.5}, "mass_kg is -1.0, expected a number above 0"),
        (SMALL, QUAD | {"MPC_THR_HOVER": 1.2}, r"hover_throttle is 1.2, expected less than 1 .hover throttle from MPC"),
        (SMALL._replace(propeller_m=10.0), QUAD | {"MPC_THR_HOVER": 0.5}, "rotor.radius_m is 5"),
    ],
)
def test_what_makes_no_vehicle_is_one_sentence(answers: Answers, parameters: dict[str, float], sentence: str) -> None:
    with pytest.raises(SettingsError, match=sentence):
        draft(answers, parameters)


class TestCommand:
    def test_parameters_and_options_make_a_file_that_loads(self, tmp_path: Path) -> None:
        parameters, path = tmp_path / "copter.parm", tmp_path / "mine.yaml"
        parameters.write_text("FRAME_CLASS,1\nFRAME_TYPE,1\nMOT_THST_HOVER,0.25\n")
        words = [str(path), "--parameters", str(parameters), "--mass", "1.0", "--propeller", "0.2", "--arm", "0.15"]
        result = CliRunner().invoke(app, ["vehicle", "new", *words])
        assert result.exit_code == 0
        assert "4 rotors, 1 kg, thrust up to 4.0 times the weight, throttle in hover 0.25" in result.output
        assert load_vehicle(path).name == "mine"

    @pytest.mark.parametrize("log", ["px4/excitation.ulg", "ardupilot/excitation.bin"])
    def test_a_log_holds_the_parameters_that_it_was_flown_with(self, log: str, tmp_path: Path) -> None:
        if not (DATA / "real" / log).exists():
            pytest.skip("the real logs are not here")
        path = tmp_path / "mine.yaml"
        words = ["--parameters", str(DATA / "real" / log), "--mass", "1.0", "--propeller", "0.24"]
        result = CliRunner().invoke(app, ["vehicle", "new", str(path), *words])
        assert result.exit_code == 0, result.output
        assert load_vehicle(path).n_rotors == 4

    @pytest.mark.parametrize(
        ("parameters", "text", "first"),
        [
            ({"FRAME": 1.0}, "Frame: QUAD", "quad-x"),
            ({"FRAME": 0.0}, "Frame: HEXA", "hexa-plus"),
            ({"FRAME": 1.0}, "Frame: OCTA", "octa-x"),
            ({}, "Frame: QUAD/PLUS", "quad-plus"),
            ({"FRAME_CLASS": 2.0, "FRAME_TYPE": 1.0}, "Frame: QUAD", "hexa-x"),
        ],
        ids=["3.4", "plus", "octa", "message alone", "parameters first"],
    )
    def test_the_frame_is_in_the_messages_of_an_older_log(
        self, tmp_path: Path, parameters: dict[str, float], text: str, first: str
    ) -> None:
        log, path = tmp_path / "flight.bin", tmp_path / "mine.yaml"
        values = parameters | {"MOT_THST_HOVER": 0.3}
        rows = [(1, name.encode(), value) for name, value in values.items()]
        said = [(1, b"APM:Copter V3.4.4"), (2, text.encode())]
        log.write_bytes(
            dataflash_bytes(("PARM", "QNf", "TimeUS,Name,Value", rows), ("MSG", "QZ", "TimeUS,Message", said))
        )
        words = ["vehicle", "new", str(path), "--parameters", str(log), "--mass", "1.5", "--propeller", "0.254"]
        result = CliRunner().invoke(app, words)
        assert result.exit_code == 0, result.exception
        places = [rotor.position_m for rotor in load_vehicle(path).rotors]
        arm_m = max(math.hypot(*place[:2]) for place in places)
        assert places == [pytest.approx(place.position_m, abs=2e-4) for place in frame_places(first, arm_m)]

    @pytest.mark.skipif(not REPORTED.is_file(), reason="the reports are not here")
    def test_of_copter_3_4_mass_and_propellers_are_asked(self, tmp_path: Path) -> None:
        words = ["--parameters", str(REPORTED), "--mass", "1.5", "--propeller", "0.254"]
        result = CliRunner().invoke(app, ["vehicle", "new", str(tmp_path / "mine.yaml"), *words])
        assert result.exit_code == 0, result.exception
        assert load_vehicle(tmp_path / "mine.yaml").n_rotors == 4

    def test_all_that_is_missing_is_named_where_nobody_can_be_asked(self, tmp_path: Path) -> None:
        result = CliRunner().invoke(app, ["vehicle", "new", str(tmp_path / "mine.yaml"), "--mass", "1.0"])
        assert str(result.exception) == (
            "facts are missing, expected --propeller, the diameter of a propeller, m (10 inches are 0.254); "
            "--frame, the frame: quad-x, quad-plus, hexa-x, hexa-plus, octa-x or octa-plus; "
            "--hover-throttle, the throttle in hover, 0 to 1"
        )

    def test_propellers_that_would_touch_are_told(self, tmp_path: Path) -> None:
        words = ["--mass", "2", "--propeller", "0.254", "--frame", "hexa-x", "--arm", "0.2", "--hover-throttle", "0.5"]
        result = CliRunner().invoke(app, ["vehicle", "new", str(tmp_path / "mine.yaml"), *words])
        assert result.exit_code == 0
        assert "warning: The propellers would touch: their axes are 0.2 m apart" in result.output

    def test_no_file_is_overwritten(self, tmp_path: Path) -> None:
        path = tmp_path / "mine.yaml"
        path.write_text("mine\n")
        result = CliRunner().invoke(app, ["vehicle", "new", str(path)])
        assert "is there already, expected a new file (or --force)" in str(result.exception)
        assert path.read_text() == "mine\n"


class TestAssumed:
    """The file names the numbers that nobody has said, so that results can say what rests on them."""

    def test_the_thrust_coefficient_and_the_throttle_where_nobody_has_said_them(self) -> None:
        drafted = vehicle(SMALL, QUAD | {"MPC_THR_HOVER": 0.5})
        assert {"rotor.thrust_n_per_rpm2", "throttle"} < set(drafted.assumed or ())

    def test_not_what_was_said(self) -> None:
        drafted = vehicle(SMALL._replace(arm_m=0.15, hover_rpm=7000.0), COPTER)
        assert {"rotor.thrust_n_per_rpm2", "throttle"}.isdisjoint(drafted.assumed or ())
