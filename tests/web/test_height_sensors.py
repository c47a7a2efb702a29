"""The page tells where the barometer fails, from the same values as the command line."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml

import quadctl.sitl.run
from quadctl.flight.preflight.preparation import prepare_flight
from quadctl.lab.sensors.answers import answers_on_sensors
from quadctl.lab.sensors.diagnosis import NoAnswer, SensorDiagnosis
from quadctl.logs.flight_log import ATTITUDE, POSITION, RATES, VELOCITY, FlightLog
from quadctl.web.elements.theme import LIGHT
from quadctl.web.figures.height_sensor import sensor_figure
from tests.support.lab_pages import served
from tests.support.places import ROOT
from tests.support.visitors import Browser, Visitor, needs_chromium

WRONG = {"forward": 0.9, "backward": -0.7, "right": 0.8}


def hops(size_m: float) -> FlightLog:
    """Hovers at three heights, 20 s each, beside a range finder, with a barometer that errs near the ground."""
    time_s = np.arange(0.0, 90.0, 0.1)
    height = 0.05 + np.interp(time_s, [4, 6, 30, 33, 55, 58, 80, 84], [0.0, 0.25, 0.25, 0.7, 0.7, 2.2, 2.2, 0.0])
    random = np.random.default_rng(7)
    columns = {name: 1e-6 * random.standard_normal(len(time_s)) for name in (*POSITION, *VELOCITY, *ATTITUDE, *RATES)}
    columns |= {"time_s": time_s, "z_m": height, "vz_m_s": np.gradient(height, time_s)}
    columns["throttle_cmd"] = np.where(height > 0.06, 0.4, 0.0) + 1e-4 * random.standard_normal(len(time_s))
    columns["range_m"] = height + 0.01 * random.standard_normal(len(time_s))
    wrong = size_m * np.exp(-height / 0.4)
    columns["baro_m"] = height + wrong + 0.03 * random.standard_normal(len(time_s)) + 120.0
    meta = {"autopilot": "PX4", "parameters": {"EKF2_HGT_REF": 1.0}}
    return FlightLog("hops.csv", None, columns, None, meta)


def test_a_figure_shows_the_difference_before_and_after() -> None:
    found = answers_on_sensors([hops(-0.5)])
    assert found is not None
    (barometer,) = found.answers
    assert isinstance(barometer, SensorDiagnosis)
    assert [one.name for one in barometer.missing] == ["barometer.ground"]
    curves = {curve["name"]: curve for curve in sensor_figure(barometer, "height", LIGHT)["data"]}
    as_read, after = (np.ptp(curves[name]["y"]) for name in ("as read", "errors taken away"))
    assert as_read == pytest.approx(0.5 * np.exp(-0.3 / 0.4), abs=0.06)
    assert after < 0.3 * as_read


def test_without_a_reference_the_answer_says_what_is_needed_and_without_a_barometer_there_is_none() -> None:
    whole = hops(0.3)
    alone = replace(whole, columns={name: own for name, own in whole.columns.items() if name != "range_m"})
    found = answers_on_sensors([alone])
    assert found is not None
    (barometer,) = found.answers
    assert isinstance(barometer, NoAnswer)
    assert barometer.to_dict()["verdict"] == "cannot tell"
    none = replace(alone, columns={name: own for name, own in alone.columns.items() if name != "baro_m"})
    assert answers_on_sensors([none]) is None


def test_a_reading_in_another_unit_is_a_problem_and_the_page_goes_on() -> None:
    log = hops(0.3)
    log.columns["baro_m"] = 100.0 * log["baro_m"]
    found = answers_on_sensors([log])
    assert found is not None and not found.answers
    assert "expected once, in metres" in found.problems[0]


@needs_chromium
@pytest.mark.long
def test_a_visitor_sees_where_the_barometer_fails(browser: Browser, tmp_path: Path) -> None:
    hidden = tmp_path / "hidden.yaml"
    entries = [{"effect": "rotor_drag.linear", "parameters": {"d_x": 0.35, "d_y": 0.35}}]
    entries.append({"effect": "barometer.airspeed", "parameters": WRONG})
    hidden.write_text(yaml.safe_dump({"effects": entries, "range_finder": {}}))
    mission, config = ROOT / "missions" / "barometer_runs.yaml", ROOT / "config" / "flight_thesis.yaml"
    plan = prepare_flight(mission, config, "none", None, ())
    log = quadctl.sitl.run.simulate(plan, tmp_path / "flown", hidden, 5).log
    with served(tmp_path / "lab", str(log)) as (url, _):
        visitor = Visitor(browser, url)
        visitor.sees("#error-now")
        visitor.click("[role=tab]:has-text('Where it fails')")
        said = visitor.sees("[data-sensor=barometer]")
        assert "The barometer has an error: barometer.airspeed" in said
        assert "forward = 0." in said and "range finder" in said
        figure = visitor.figure("barometer over speed forward")
        assert visitor.points(figure, "as read") > 5
        assert visitor.points(figure, "errors taken away") > 5
        assert visitor.barriers() == []
        visitor.leaves()
