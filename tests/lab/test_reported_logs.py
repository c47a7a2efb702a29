"""Logs that carry what public bug reports showed: what the record does wrong is told, and taken for no physics."""

from pathlib import Path

import pytest

from quadctl.effects.rotor_drag import LinearDrag
from quadctl.lab.comparison.comparison import compare
from quadctl.lab.flights.dataset import load_dataset
from quadctl.lab.flights.preparation import prepare
from quadctl.lab.selection.diagnosis import Diagnosis, diagnose
from quadctl.logs.findings import Finding, Kind, of_kind
from quadctl.logs.quality import QualityReport, quality
from quadctl.logs.read import read_log
from quadctl.model import Model, load_model
from tests.support.places import DATA

REPORTS = DATA / "reports"
pytestmark = pytest.mark.skipif(not REPORTS.is_dir(), reason="the logs of public reports are not here")


def flight(number: int) -> Path:
    (found,) = REPORTS.glob(f"{number:02d}-*/flight.*")
    return found


def model(number: int) -> Model:
    return load_model(flight(number).parent / "vehicle.yaml")


def seen(number: int) -> QualityReport:
    return quality(read_log(flight(number)))


def told(number: int, kind: Kind) -> Finding:
    (found,) = of_kind(seen(number).findings, kind)
    return found


def searched(number: int) -> Diagnosis:
    own = model(number)
    return diagnose(own, load_dataset([read_log(flight(number))], own.vehicle))


def drag_of(found: Diagnosis) -> tuple[float, float]:
    drag = next(effect for effect in found.best.effects if isinstance(effect, LinearDrag))
    return drag.d_x, drag.d_y


def test_a_camera_servo_is_no_motor() -> None:
    log = read_log(flight(8))
    assert [name for name in log.columns if name.endswith("_output")] == [f"motor{i}_output" for i in range(1, 5)]
    assert seen(8).can_be_analysed
    assert prepare(log, model(8).vehicle).time_s.max() < 138.0  # the crash at 138.7 s is left out


def test_a_flight_whose_ground_drifts_is_used_whole() -> None:
    assert seen(9).flight_s == pytest.approx(68.0, abs=1.0)
    assert prepare(read_log(flight(9)), model(9).vehicle).duration_s == pytest.approx(65.0, abs=1.5)


def test_rates_are_those_of_the_flight() -> None:
    report = seen(11)
    assert report.can_be_analysed and report.flight_s == pytest.approx(37.0, abs=1.0)
    assert prepare(read_log(flight(11)), model(11).vehicle).duration_s == pytest.approx(34.0, abs=1.5)


def test_scatter_is_no_correction_of_the_autopilot() -> None:
    report = seen(13)
    assert not of_kind(report.findings, Kind.OWN_CORRECTION)
    assert not report.clock.runs_wrong


def test_a_log_that_was_cut_says_so_and_that_the_flight_went_on() -> None:
    """This one was cut between two messages."""
    assert told(22, Kind.ENDS_IN_AIR).times_s[0][0] == pytest.approx(54.4, abs=0.1)


def test_a_height_of_five_kilometres_is_left_out_with_its_time() -> None:
    spike = told(19, Kind.SPIKE)
    assert (spike.figures["of"], spike.times_s[0][0]) == ("height", pytest.approx(30.0, abs=0.1))
    own = model(19)
    errors = compare(own, load_dataset([read_log(flight(19))], own.vehicle)).open_loop
    (after_2_s,) = [e for e in errors if e.horizon_s == 2.0]
    assert after_2_s.position["total"].rmse == pytest.approx(0.52, abs=0.05)


@pytest.mark.parametrize("number", [15, 16, 21])
def test_what_could_not_be_read_is_read(number: int) -> None:
    assert len(read_log(flight(number))) > 100


@pytest.mark.long
@pytest.mark.parametrize(
    ("number", "kind"),
    [
        (5, Kind.PARAMETER_CHANGED),
        (9, Kind.GROUND_MOVED),
        (14, Kind.RESET),
        (17, Kind.WITNESSES_DISAGREE),
        (18, Kind.DEAD_CHANNEL),
        (19, Kind.SPIKE),
    ],
)
def test_of_a_flight_with_drag_alone_drag_alone_is_named(number: int, kind: Kind) -> None:
    """0.35 and 0.40 1/s, whatever the record does wrong."""
    found = searched(number)
    assert found.missing == ["rotor_drag"]
    assert drag_of(found) == pytest.approx((0.35, 0.40), abs=0.02)
    assert of_kind(found.dataset.flights[0].findings, kind)


@pytest.mark.long
def test_the_start_of_a_cruise_is_no_payload() -> None:
    found = searched(6)
    assert set(found.missing) <= {"rotor_drag", "body_drag", "thrust_scale"}
    assert {"rotor_drag", "body_drag"} & set(found.missing)


@pytest.mark.long
def test_a_flight_that_is_low_in_one_stretch_only_is_diagnosed() -> None:
    found = searched(3)
    assert not {"wind", "payload", "ground_effect"} & set(found.missing)
    assert {"rotor_drag", "body_drag"} & set(found.missing)
