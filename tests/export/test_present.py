"""Present parameters of the vehicle: what its firmware lacks is not written, what is right already stays."""

from collections.abc import Callable
from pathlib import Path

import pytest

from quadctl.effects.body_drag import QuadraticDrag
from quadctl.effects.rotor_drag import LinearDrag
from quadctl.effects.thrust_scale import ConstantScale
from quadctl.export.ardupilot import ARDUPILOT
from quadctl.export.autopilot import Dialect, Present, Row, parameter_file, parameters
from quadctl.export.px4 import PX4
from quadctl.model import Model, Provenance
from quadctl.parameter_file import read_parameters
from quadctl.vehicle import Vehicle
from tests.support.commands import Result
from tests.support.places import DATA

BODY = Provenance(logs=("a.ulg",), ci95={"area_x_m2": (0.04, 0.06), "area_y_m2": (0.04, 0.07)})
ROTORS = Provenance(logs=("a.ulg",), ci95={"d_x": (0.3, 0.5), "d_y": (0.35, 0.45)})
SCALE = Provenance(logs=("a.bin",), ci95={"factor": (0.88, 0.92)})
REPORTED = DATA / "reports" / "02-export-parameters-the-firmware-lacks"
OLD_PX4 = {"EKF2_AID_MASK": 1.0, "EKF2_BCOEF_X": 22.0, "EKF2_BCOEF_Y": 29.0, "MPC_THR_HOVER": 0.5, "THR_MDL_FAC": 0.0}
"""PX4 1.9."""
OTHERS = {f"OTHER_{i}": float(i) for i in range(300)}


def rows_of(model: Model, dialect: Dialect, values: dict[str, float], is_whole: bool = True) -> dict[str, Row]:
    return {row.name: row for row in parameters(model, dialect, Present(values, "now.params", is_whole))}


def written(rows: dict[str, Row]) -> dict[str, float]:
    return {name: row.to_write for name, row in rows.items() if row.to_write is not None}


@pytest.fixture
def body(raptor: Vehicle) -> Model:
    return Model(raptor).plus(QuadraticDrag(0.05, 0.05, 0.0), BODY)


@pytest.fixture
def rotors(raptor: Vehicle) -> Model:
    return Model(raptor).plus(LinearDrag(0.4, 0.4, 0.0), ROTORS)


class TestOlderFirmware:
    def test_the_older_switch_is_set_where_the_newer_one_is_lacking(self, body: Model) -> None:
        rows = rows_of(body, PX4, OLD_PX4)
        assert written(rows) == {"EKF2_BCOEF_X": pytest.approx(30.0), "EKF2_AID_MASK": 33.0}
        assert rows["EKF2_DRAG_CTRL"].lacking == (
            "this firmware does not have it: up to PX4 1.13 the drag is switched on by bit 5 (value 32) of "
            "EKF2_AID_MASK, here 1 -> 33"
        )
        assert rows["EKF2_MCOEF"].lacking == "this firmware does not have it"

    def test_an_older_switch_that_is_on_stays(self, body: Model) -> None:
        rows = rows_of(body, PX4, OLD_PX4 | {"EKF2_AID_MASK": 33.0})
        assert "EKF2_AID_MASK" not in written(rows)
        assert rows["EKF2_AID_MASK"].is_confirmed

    def test_a_drag_that_it_cannot_hold_does_not_switch_it_on(self, rotors: Model) -> None:
        """Before there were two drags, a coefficient of 0 was none of its values."""
        rows = rows_of(rotors, PX4, OLD_PX4)
        assert written(rows) == {}
        assert rows["EKF2_BCOEF_X"].lacking == "22 stays: this firmware cannot switch it off"
        assert "EKF2_AID_MASK" not in rows

    def test_ardupilot_before_4_1_has_no_drag(self, rotors: Model) -> None:
        rows = rows_of(rotors.plus(ConstantScale(0.9), SCALE), ARDUPILOT, {"MOT_THST_HOVER": 0.2, **OTHERS})
        assert list(written(rows)) == ["MOT_THST_HOVER"]
        lacking = "this firmware does not have it (ArduPilot has it since 4.1)"
        assert rows["EK3_DRAG_MCOEF"].lacking == rows["EK3_DRAG_BCOEF_X"].lacking == lacking

    def test_the_throttle_of_hover_has_its_older_name(self, raptor: Vehicle) -> None:
        model = Model(raptor).plus(ConstantScale(0.9), SCALE)
        now = rows_of(model, ARDUPILOT, {"MOT_THST_HOVER": 0.2, **OTHERS})["MOT_THST_HOVER"]
        rows = rows_of(model, ARDUPILOT, {"THR_MID": 500.0, "MOT_THST_EXPO": 0.5})
        assert now.to_write is not None
        assert written(rows) == {"THR_MID": round(1000.0 * now.to_write)}


def test_a_file_that_is_an_excerpt_is_said_not_to_hold_the_parameter(rotors: Model) -> None:
    rows = rows_of(rotors, PX4, {"EKF2_MCOEF": 0.15}, is_whole=False)
    assert list(written(rows)) == ["EKF2_MCOEF"]
    assert rows["EKF2_DRAG_CTRL"].lacking.startswith("now.params does not hold it, but only 1 parameters")


class TestConfirmed:
    @pytest.mark.parametrize(("now", "stays"), [(0.36, True), (0.52, False)])
    def test_a_value_within_the_interval_stays(self, rotors: Model, now: float, stays: bool) -> None:
        present = {"EKF2_MCOEF": now, "EKF2_BCOEF_X": 0.0, "EKF2_BCOEF_Y": 25.0, "EKF2_DRAG_CTRL": 0.0}
        rows = rows_of(rotors, PX4, present)
        drag, ahead, aside, switch = (
            rows[name].is_confirmed for name in ("EKF2_MCOEF", "EKF2_BCOEF_X", "EKF2_BCOEF_Y", "EKF2_DRAG_CTRL")
        )
        assert (drag, ahead, aside, switch) == (stays, True, False, False)
        assert ("EKF2_MCOEF" in written(rows)) is not stays
        told = parameter_file(list(rows.values()), PX4, "fitted.yaml")
        assert ("# EKF2_MCOEF: confirmed, stays 0.36: mean of d_x and d_y" in told) is stays

    def test_thirty_two_bits_of_a_value_are_the_same_value(self, rotors: Model) -> None:
        """A parameter that was written reads a little different."""
        present = {"EKF2_DRAG_CTRL": 1.0 + 5e-8, "EKF2_MCOEF": 0.1, "EKF2_BCOEF_X": 0.0, "EKF2_BCOEF_Y": 0.0}
        assert rows_of(rotors, PX4, present)["EKF2_DRAG_CTRL"].is_confirmed


@pytest.mark.skipif(not REPORTED.is_dir(), reason="the reports are not here")
def test_the_file_for_px4_1_9_holds_only_what_it_has(quadctl: Callable[..., Result], tmp_path: Path) -> None:
    now, out = REPORTED / "old_px4.params", tmp_path / "out.params"
    done = quadctl("export", REPORTED / "model.yaml", "--to", "px4", "--now", now, "-o", out)
    assert done.status == 0, done.err
    assert read_parameters(out) == {"EKF2_AID_MASK": 33.0}
    assert "EKF2_BCOEF_Y: confirmed, stays 25" in done.out
    assert "EKF2_MCOEF: this firmware does not have it" in done.out
