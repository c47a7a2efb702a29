"""A hidden file gives the simulated vehicle a barometer that errs; its height, its log and its messages carry it."""

from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
import yaml

import quadctl.sitl.run
from quadctl.errors import SettingsError
from quadctl.export.ardupilot import ARDUPILOT
from quadctl.export.autopilot import Dialect
from quadctl.export.px4 import PX4
from quadctl.export.sensors import sensor_rows
from quadctl.flight.preflight.preparation import prepare_flight
from quadctl.lab.sensors.diagnosis import diagnose_sensor
from quadctl.lab.sensors.heights import Heights, Reference, heights
from quadctl.logs.flight_log import FlightLog
from quadctl.logs.read import read_log
from quadctl.sitl.rules.copter import SimulatedCopter
from quadctl.sitl.rules.px4 import SimulatedAutopilot
from quadctl.sitl.server import messages
from quadctl.sitl.vehicle.body import Motion
from quadctl.sitl.vehicle.hidden import HiddenTruth, height_sensors, load_hidden, true_model
from quadctl.state import VehicleState
from quadctl.vehicle import load_vehicle
from tests.support.places import ROOT

RAPTOR = load_vehicle(ROOT / "config" / "vehicles" / "raptor.yaml")
ERRORS = {
    "rotor_drag.linear": {"d_x": 0.35, "d_y": 0.35},
    "barometer.ground": {"at_ground_m": -0.4, "fade_m": 0.4},
    "barometer.airspeed": {"forward": 0.9, "backward": -0.7, "right": 0.8},
}


def hidden(where: Path, **others: object) -> Path:
    path = where / "hidden.yaml"
    entries = [{"effect": name, "parameters": values} for name, values in ERRORS.items()]
    path.write_text(yaml.safe_dump({"effects": entries, **others}))
    return path


def moving(height_m: float, north_m_s: float, time_s: float) -> Motion:
    hover_rpm = (RAPTOR.weight_n / RAPTOR.n_rotors / RAPTOR.rotor.thrust_n_per_rpm2) ** 0.5
    level = (1.0, 0.0, 0.0, 0.0)
    position, velocity = (0.0, 0.0, -height_m), (north_m_s, 0.0, 0.0)
    return Motion(time_s, position, velocity, level, (0.0, 0.0, 0.0), (hover_rpm,) * RAPTOR.n_rotors, 16.0)


def test_the_height_follows_the_barometer_with_a_lag_and_the_climb_rate_errs_meanwhile(tmp_path: Path) -> None:
    truth = load_hidden(hidden(tmp_path, barometer={"noise_m": 0.0, "follow_rad_s": 1.5}))
    sensors = height_sensors(RAPTOR, truth, true_model(RAPTOR, truth, "hidden.yaml"), "hidden.yaml", 1)
    assert sensors is not None
    sensors.update(moving(2.05, 0.0, 0.0), 0.01)
    wrong = -0.9 * 5.0**2 / (2.0 * 9.80665)
    climbs = []
    for i in range(1, 1200):
        sensors.update(moving(2.05, 5.0, 0.01 * i), 0.01)
        climbs.append(sensors.climb_error_m_s)
        assert sensors.baro_m == pytest.approx(2.05 + wrong, abs=1e-9)  # from where it began
        if i == 20:
            assert 0.2 * wrong > sensors.height_error_m > 0.7 * wrong
    assert sensors.height_error_m == pytest.approx(wrong, abs=0.01)
    assert min(climbs) < -0.4 and climbs[-1] == pytest.approx(0.0, abs=0.01)


def test_a_barometer_that_is_not_asked_for_is_not_there() -> None:
    truth = HiddenTruth()
    assert height_sensors(RAPTOR, truth, true_model(RAPTOR, truth, ""), "", 0) is None
    assert np.isnan(SimulatedAutopilot(RAPTOR).estimate().baro_m)


@pytest.mark.parametrize("kind", [SimulatedAutopilot, SimulatedCopter])
def test_both_autopilots_tell_it(tmp_path: Path, kind: type[SimulatedAutopilot]) -> None:
    autopilot = kind(RAPTOR, load_hidden(hidden(tmp_path, range_finder={"noise_m": 0.0})), 2)
    autopilot.step(0.5)
    state = autopilot.estimate()
    assert state.baro_m == pytest.approx(0.05, abs=0.3)
    assert state.range_m == pytest.approx(0.05, abs=0.01)


def test_the_messages_hold_the_reading_and_not_the_height() -> None:
    state = VehicleState(1.0, position_ned_m=(0.0, 0.0, -3.0), baro_m=2.6, range_m=3.02)
    (altitude,) = messages.altitude(state)
    assert (altitude.altitude_monotonic, altitude.altitude_local) == (pytest.approx(2.6), pytest.approx(3.0))
    (distance,) = messages.distance_sensor(state)
    assert distance.current_distance == 302
    pressure = messages.scaled_pressure(95000.0, 15.0)
    (high,), (ground,) = pressure(state), pressure(replace(state, baro_m=float("nan")))
    assert 100.0 * (ground.press_abs - high.press_abs) == pytest.approx(95000.0 / 287.0 / 288.15 * 9.81 * 2.6, rel=0.01)
    assert not list(messages.altitude(replace(state, baro_m=float("nan"))))


def test_an_unknown_parameter_of_a_sensor_is_refused() -> None:
    truth = HiddenTruth.model_validate({"effects": [{"effect": "barometer.ground", "parameters": {"deep_m": 1.0}}]})
    with pytest.raises(SettingsError, match="deep_m"):
        SimulatedAutopilot(RAPTOR, truth, 0, "hidden.yaml")


@pytest.mark.long
def test_a_simulated_flight_is_diagnosed_from_its_own_log(tmp_path: Path) -> None:
    """The autopilot flies by the wrong height; the range finder beside it tells the errors."""
    mission, config = ROOT / "missions" / "barometer_runs.yaml", ROOT / "config" / "flight_thesis.yaml"
    plan = prepare_flight(mission, config, "none", None, ())
    world = hidden(tmp_path, range_finder={"noise_m": 0.02})
    log = read_log(quadctl.sitl.run.simulate(plan, tmp_path, world, 3).log)
    lowest = log["z_ref_m"] == 0.2
    assert np.nanmean((log["range_m"] - log["z_m"])[lowest]) > 0.1  # it flies higher than it believes
    found = heights(log, "barometer")
    assert isinstance(found, Heights) and found.reference is Reference.RANGE
    named = {one.name: one for one in diagnose_sensor([found]).missing}
    assert {"barometer.ground", "barometer.airspeed"} <= set(named)
    told = named["barometer.airspeed"].parameters
    for side, true in {"forward": 0.9, "backward": -0.7, "right": 0.8, "left": 0.0}.items():
        assert told[side].low - 0.05 <= true <= told[side].high + 0.05, side


class Firmware(NamedTuple):
    """A simulated autopilot, the names of its parameters, and those without which it uses no coefficient."""

    kind: type[SimulatedAutopilot]
    dialect: Dialect
    switches: dict[str, float]


FIRMWARES = {
    "PX4": Firmware(SimulatedAutopilot, PX4, {"EKF2_DRAG_CTRL": 1.0}),
    "ArduPilot": Firmware(SimulatedCopter, ARDUPILOT, {"GUID_OPTIONS": 8.0}),
}
OF_SPEED = {"forward": 0.15, "backward": -0.12, "right": 0.1}
NOISE_M = 0.01
"""Noise of the range finder, which tells the error of the height."""


def flown(firmware: Firmware, parameters: dict[str, float], where: Path, seed: int) -> FlightLog:
    """The runs of a field, in a world whose barometer errs with the air speed."""
    world = {
        "effects": [
            {"effect": "rotor_drag.linear", "parameters": {"d_x": 0.35, "d_y": 0.35}},
            {"effect": "barometer.airspeed", "parameters": OF_SPEED},
        ],
        "range_finder": {"noise_m": NOISE_M},
        "autopilot": {"parameters": firmware.switches | parameters},
    }
    (where / "world.yaml").write_text(yaml.safe_dump(world))
    mission = yaml.safe_load((ROOT / "missions" / "barometer_runs.yaml").read_text())
    mission["limits"]["max_distance_m"] = 30.0
    (where / "runs.yaml").write_text(yaml.safe_dump(mission, sort_keys=False))
    room = ("speeds_m_s=[3, 6]", "reach_m=12", "low_m=-12", "heights_m=[0.2, 2.0]")
    plan = prepare_flight(where / "runs.yaml", ROOT / "config" / "flight_thesis.yaml", "none", None, room)
    autopilot = firmware.kind(plan.body.vehicle, load_hidden(where / "world.yaml"), seed)
    pilot = plan.pilot(autopilot_takes_off=firmware.kind is SimulatedCopter)
    recorder = plan.recorder(where / str(seed), "simulated", heights=True)
    quadctl.sitl.run.fly_lockstep(autopilot, pilot, plan.settings.controller.rate_hz, [recorder])
    recorder.close(pilot.ended)
    assert pilot.ended == "completed"
    return read_log(recorder.path)


def height_error_m(log: FlightLog) -> float:
    """Root mean square of the estimated height's error in fast runs, without the range finder's noise."""
    lean = np.cos(np.radians(log["roll_deg"])) * np.cos(np.radians(log["pitch_deg"]))
    fast = np.hypot(log["vx_m_s"], log["vy_m_s"]) > 3.0
    error = (log["z_m"] - log["range_m"] * lean)[fast]
    return float(np.sqrt(max(np.mean(error**2) - NOISE_M**2, 0.0)))


@pytest.mark.long
@pytest.mark.parametrize("name", FIRMWARES)
def test_with_the_exported_parameters_the_flown_error_is_gone(tmp_path: Path, name: str) -> None:
    firmware = FIRMWARES[name]
    before = flown(firmware, {}, tmp_path, 3)
    found = heights(before, "barometer")
    assert isinstance(found, Heights)
    rows = sensor_rows(diagnose_sensor([found]).model(), firmware.dialect)
    known = firmware.kind.default_parameters
    exported = {row.name: row.to_write for row in rows if row.to_write is not None and row.name in known}
    after = flown(firmware, exported, tmp_path, 4)
    assert height_error_m(before) > 0.1
    assert height_error_m(after) < 0.03


@pytest.mark.parametrize(
    ("name", "switch", "coefficients"),
    [
        ("PX4", "EKF2_DRAG_CTRL", {"EKF2_PCOEF_XN": 0.2, "EKF2_PCOEF_YP": 0.1, "EKF2_PCOEF_Z": -0.3}),
        ("ArduPilot", "BARO1_WCF_ENABLE", {"BARO1_WCF_BCK": 0.2, "BARO1_WCF_RGT": 0.1, "BARO1_WCF_UP": -0.3}),
    ],
)
def test_each_coefficient_acts_to_its_side_and_only_while_it_is_switched_on(
    name: str, switch: str, coefficients: dict[str, float]
) -> None:
    autopilot = FIRMWARES[name].kind(RAPTOR)
    backward_right_down, forward_left = (-5.0, 3.0, 2.0), (5.0, -3.0, 0.0)
    autopilot.parameters |= coefficients
    autopilot.parameters[switch] = 0.0
    assert autopilot.baro_correction_m(backward_right_down, backward_right_down) == 0.0
    autopilot.parameters[switch] = 1.0
    expected = (0.2 * 25.0 + 0.1 * 9.0 - 0.3 * 4.0) / (2.0 * 9.80665)
    assert autopilot.baro_correction_m(backward_right_down, backward_right_down) == pytest.approx(expected)
    assert autopilot.baro_correction_m(forward_left, forward_left) == 0.0
