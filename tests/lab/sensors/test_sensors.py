"""Errors of a barometer are named where the log has a reference, with intervals that hold the truth; else it is said
what the log needs."""

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from quadctl.cli import app
from quadctl.effects.barometer import AirspeedError, DriftError, GroundError, ThrottleError
from quadctl.effects.rangefinder import MountingError
from quadctl.effects.sensor_error import SensorConditions, SensorError
from quadctl.errors import LogError
from quadctl.export.ardupilot import ARDUPILOT
from quadctl.export.autopilot import Present
from quadctl.export.px4 import PX4
from quadctl.export.sensors import sensor_rows
from quadctl.frames import quaternion_from_euler, rotate_inverse
from quadctl.lab.arrays import Floats
from quadctl.lab.sensors.comparison import compare_sensor
from quadctl.lab.sensors.diagnosis import SensorDiagnosis, Verdict, diagnose_sensor
from quadctl.lab.sensors.heights import SOUGHT, Heights, NoReference, Reference, heights, leans_on_barometer
from quadctl.lab.sensors.wander import Noise, Rows, estimate
from quadctl.lab.sensors.words import parameters
from quadctl.logs.csv_log import write_csv
from quadctl.logs.flight_log import ATTITUDE, VELOCITY, FlightLog
from quadctl.logs.read import read_log
from quadctl.sensor_model import FittedError, SensorModel, load_sensors, save_sensors
from tests.support.flights import flown_once
from tests.support.places import DATA

ARDUPILOT47 = DATA / "real" / "ardupilot47"
needs_logs = pytest.mark.skipif(not ARDUPILOT47.is_dir(), reason="the logs of ArduPilot 4.7 are not here")
DRAG = ("rotor_drag.linear", {"d_x": 0.35, "d_y": 0.35, "d_z": 0.0})
REST_M = 0.05
"""Logged height at which the simulated vehicle rests."""
WIND_NE_M_S = (1.2, -0.8)
WIND = ("wind.steady", {"north_m_s": WIND_NE_M_S[0], "east_m_s": WIND_NE_M_S[1], "drag": 0.35})
STORM_NE_M_S = (3.2, -2.4)
STORM = ("wind.steady", {"north_m_s": STORM_NE_M_S[0], "east_m_s": STORM_NE_M_S[1], "drag": 0.3})
PAYLOAD = ("payload.step", {"mass_kg": 0.25})
SPEEDS = AirspeedError(forward=1.2, backward=-0.8, right=0.0, left=0.7)
"""Seen at 2.2 m/s as coefficients of 0.1 to 0.16 are at 6 m/s."""


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory, testrun_uid: str) -> FlightLog:
    where = tmp_path_factory.getbasetemp().parent / f"sensors-{testrun_uid}"
    return flown_once("barometer_runs", [DRAG], 11, where)


@pytest.fixture(scope="module")
def stormy_runs(tmp_path_factory: pytest.TempPathFactory, testrun_uid: str) -> FlightLog:
    where = tmp_path_factory.getbasetemp().parent / f"sensors-{testrun_uid}"
    return flown_once("barometer_runs", [STORM, PAYLOAD], 13, where)


@pytest.fixture(scope="module")
def windy_runs(tmp_path_factory: pytest.TempPathFactory, testrun_uid: str) -> FlightLog:
    where = tmp_path_factory.getbasetemp().parent / f"sensors-{testrun_uid}"
    return flown_once("barometer_runs", [WIND], 12, where)


def conditions(log: FlightLog, wind: tuple[float, float] = (0.0, 0.0)) -> SensorConditions:
    attitude = quaternion_from_euler(*(np.radians(log[name]) for name in ATTITUDE))
    north, east, up = (log[name] for name in VELOCITY)
    speed = np.mean([log[f"motor{i}_rpm"] for i in range(1, 5)], axis=0)
    share = (speed / np.nanmedian(speed[log["z_m"] > 0.15])) ** 2
    relative = rotate_inverse(attitude, (north - wind[0], east - wind[1], -up))
    return SensorConditions(log["z_m"], relative, attitude, share, log.time_s)


def wandering(seed: int, n: int, size_m: float, time_s: float, step_s: float = 0.02) -> Floats:
    random, walk = np.random.default_rng(seed), np.zeros(n)
    decay = np.exp(-step_s / time_s)
    for i in range(1, n):
        walk[i] = decay * walk[i - 1] + size_m * np.sqrt(1.0 - decay**2) * random.standard_normal()
    return walk


def measured(
    log: FlightLog,
    errors: tuple[SensorError, ...],
    reference: Reference,
    seed: int = 0,
    wind: tuple[float, float] = (0.0, 0.0),
) -> FlightLog:
    """The log with a barometer that has `errors`, scatters and wanders, beside one reference."""
    random, n = np.random.default_rng(seed), len(log)
    c = conditions(log, wind)
    true = log["z_m"]
    baro = true + sum(np.asarray(error.error_m(c)) for error in errors) + 31.7
    baro = baro + 0.09 * random.standard_normal(n) + wandering(seed + 1, n, 0.15, 80.0)
    columns = {**log.columns, "baro_m": baro}
    meta = {"autopilot": "ArduPilot", "parameters": {"EK3_SRC1_POSZ": 1.0}}
    if reference is Reference.RANGE:
        lean = np.cos(np.radians(log["roll_deg"])) * np.cos(np.radians(log["pitch_deg"]))
        columns["range_m"] = true / lean + 0.02 * random.standard_normal(n)
    elif reference is Reference.DOPPLER:
        columns["gps_vz_m_s"] = log["vz_m_s"] + wandering(seed + 2, n, 0.03, 2.0)
    else:
        meta = {}
    return replace(log, columns=columns, meta=meta)


def diagnosed(log: FlightLog) -> SensorDiagnosis:
    found = heights(log, "barometer")
    assert isinstance(found, Heights)
    return diagnose_sensor([found])


@pytest.mark.parametrize("reference", SOUGHT)
def test_an_error_with_the_air_speed_is_named_and_its_intervals_hold_the_truth(
    runs: FlightLog, reference: Reference
) -> None:
    found = diagnosed(measured(runs, (SPEEDS,), reference))
    beside = Reference.ESTIMATE if reference is Reference.DOPPLER else reference  # which is truer here
    assert [flight.reference for flight in found.flights] == [beside]
    assert [one.name for one in found.missing] == ["barometer.airspeed"]
    told = found.missing[0].parameters
    for name, true in SPEEDS.values().items():
        assert told[name].low - 0.02 <= true <= told[name].high + 0.02, name
    assert told["forward"].is_identified and told["backward"].is_identified and not told["right"].is_identified
    assert found.after_m < found.before_m


def hall_flight(error: SensorError, seed: int) -> Heights:
    """One run at 0.7 and one at 4 m/s to each side, 3 s long, with hovers between them; a barometer beside motion
    capture that scatters by 1.6 cm and wanders by 1.4 cm in 5 s."""
    time_s = np.arange(0.0, 140.0, 0.5)
    north, east = np.zeros((2, len(time_s)))
    for i, (speed, along) in enumerate((v, a) for v in (0.7, 4.0) for a in ((1, 0), (-1, 0), (0, 1), (0, -1))):
        shape = speed * np.clip(3.0 - 2.0 * np.abs(time_s - 12.0 - 15.5 * i), 0.0, 1.0)
        north, east = north + shape * along[0], east + shape * along[1]
    still, one = np.zeros(len(time_s)), np.ones(len(time_s))
    height = 1.5 + 0.3 * np.sin(0.1 * time_s)
    level = (one, still, still, still)
    climb = np.gradient(height, time_s)
    read = height + np.asarray(error.error_m(SensorConditions(height, (north, east, -climb), level)))
    read = read + 0.016 * np.random.default_rng(seed).standard_normal(len(time_s))
    read = read + wandering(seed + 1, len(time_s), 0.014, 5.0, 0.5)
    return Heights(
        "hall.csv", "barometer", Reference.POSITION, time_s, read, height, climb, (north, east, -climb), level, height,
        one, still, (0.0, 0.0), 0.3, 0.06, 0.4,
    )  # fmt: skip


@pytest.mark.parametrize("seed", [51, 61])
def test_one_fast_run_to_each_side_is_enough(seed: int) -> None:
    """Without it the coefficient of its side is hardly known, and what is hardly known foretells nothing wrong."""
    found = diagnose_sensor([hall_flight(AirspeedError(0.1, 0.12, -0.09, 0.0), seed)])
    assert [one.name for one in found.missing] == ["barometer.airspeed"]
    assert found.after_m < found.before_m


@pytest.mark.parametrize("at_ground_m", [0.35, -0.35])
def test_an_error_near_the_ground_is_named_with_its_sign(runs: FlightLog, at_ground_m: float) -> None:
    found = diagnosed(measured(runs, (GroundError(at_ground_m, 0.45),), Reference.RANGE, seed=4))
    assert [one.name for one in found.missing] == ["barometer.ground"]
    told = found.missing[0].parameters["at_ground_m"]
    where_it_rests = at_ground_m * np.exp(-REST_M / 0.45)
    assert told.low - 0.02 <= where_it_rests <= told.high + 0.02 and told.is_identified
    fade = found.missing[0].parameters["fade_m"]
    assert 0.8 * fade.low <= 0.45 <= 1.2 * fade.high
    rows = {row.name: row for row in sensor_rows(found.model(), PX4)}
    if at_ground_m < 0.0:
        assert rows["EKF2_GND_EFF_DZ"].estimate is not None and rows["EKF2_GND_EFF_DZ"].estimate.value > 0.2
        assert rows["EKF2_GND_MAX_HGT"].estimate is not None
    else:
        assert rows["EKF2_GND_EFF_DZ"].estimate is None and "too high" in rows["EKF2_GND_EFF_DZ"].lacking


def hovers(levels_m: tuple[float, ...], error: SensorError, seed: int) -> Heights:
    """Hovers of 10 s at each of these heights in turn; a barometer beside a range finder that scatters by 1.6 cm and
    wanders by 3 cm in 15 s."""
    time_s = np.arange(0.0, 160.0, 0.5)
    n = len(time_s)
    level_m = np.array(levels_m)[(time_s / 10.0).astype(int) % len(levels_m)]
    height = np.convolve(np.pad(level_m, 3, mode="edge"), np.ones(7) / 7.0, "valid")
    still, one, climb = np.zeros(n), np.ones(n), np.gradient(height, time_s)
    attitude, velocity = (one, still, still, still), (still, still, -climb)
    read = height + np.asarray(error.error_m(SensorConditions(height, velocity, attitude)))
    read = read + 0.016 * np.random.default_rng(seed).standard_normal(n) + wandering(seed + 1, n, 0.03, 15.0, 0.5)
    return Heights(
        "hovers.csv", "barometer", Reference.RANGE, time_s, read, height, climb, velocity, attitude, height,
        one, still, (0.0, 0.0), 0.3, 0.06, 0.4,
    )  # fmt: skip


@pytest.mark.parametrize(("levels_m", "told"), [((0.5, 2.0), False), ((0.2, 0.4, 0.7, 2.0), True)])
def test_an_error_of_the_ground_is_as_unsure_as_the_height_over_which_it_fades(
    levels_m: tuple[float, ...], told: bool
) -> None:
    """One low hover tells that the barometer errs there, but not how much at the ground."""
    found = diagnose_sensor([hovers(levels_m, GroundError(0.3, 0.4), 1)])
    every = {one.name: one for one in (*found.missing, *found.small, *found.absent)}
    assert (every["barometer.ground"] in found.missing) == told
    assert (every["barometer.ground"].p < 1e-3) == told


@pytest.mark.parametrize("seed", [21, 22, 23])
@pytest.mark.parametrize("reference", [Reference.RANGE, Reference.DOPPLER])
def test_a_clean_barometer_gets_no_name(runs: FlightLog, reference: Reference, seed: int) -> None:
    assert diagnosed(measured(runs, (), reference, seed=seed)).verdict is Verdict.NONE


@pytest.mark.parametrize("seed", [31, 32])
def test_quick_noise_of_the_climb_rate_passes_for_no_error(runs: FlightLog, seed: int) -> None:
    """Integrated it wanders by a metre: a scale told by the wandering height itself came out as -0.4 to -0.7."""
    log = measured(runs, (), Reference.DOPPLER, seed=seed)
    log.columns["gps_vz_m_s"] = log["vz_m_s"] + wandering(seed + 3, len(log), 0.075, 0.4)
    assert diagnosed(log).verdict is Verdict.NONE


@pytest.mark.parametrize("factor", [-11.9, -0.119, 3.281, 100.0], ids=["Pa", "hPa", "feet", "cm"])
@pytest.mark.parametrize("reference", [Reference.POSITION, Reference.RANGE, Reference.DOPPLER])
def test_a_reading_in_another_unit_is_refused(runs: FlightLog, reference: Reference, factor: float) -> None:
    log = measured(runs, (GroundError(at_ground_m=0.3),), reference, seed=8)
    log.columns["baro_m"] = factor * log["baro_m"] + 950.0
    with pytest.raises(LogError) as refused:
        diagnosed(log)
    told = re.search(r"baro_m changes (\S+) times as much as the height, expected once, in metres", str(refused.value))
    assert told is not None
    assert float(told[1]) == pytest.approx(factor, rel=0.1, abs=0.06)  # beside the error of the ground


def test_in_a_wind_the_air_speed_counts(windy_runs: FlightLog) -> None:
    found = diagnosed(measured(windy_runs, (SPEEDS,), Reference.RANGE, seed=5, wind=WIND_NE_M_S))
    wind = found.flights[0].wind_ne_m_s
    assert wind == (pytest.approx(WIND_NE_M_S[0], abs=0.5), pytest.approx(WIND_NE_M_S[1], abs=0.5))
    every = {one.name: one for one in (*found.missing, *found.small, *found.absent)}
    told = every["barometer.airspeed"].parameters
    assert told["backward"].is_identified
    for name in ("forward", "backward", "left"):
        assert told[name].low - 0.03 <= SPEEDS.values()[name] <= told[name].high + 0.03, name


@pytest.mark.parametrize("at_ground_m", [0.35, -0.35, 0.0])
def test_beside_gps_in_a_wind_of_4_m_s_with_a_payload_the_ground_alone_is_named(
    stormy_runs: FlightLog, at_ground_m: float
) -> None:
    log = measured(stormy_runs, (GroundError(at_ground_m, 0.45),), Reference.DOPPLER, seed=30, wind=STORM_NE_M_S)
    found = diagnosed(log)
    assert [one.name for one in found.missing] == (["barometer.ground"] if at_ground_m else [])
    if at_ground_m:
        told = found.missing[0].parameters["at_ground_m"]
        assert told.is_identified and told.low - 0.02 <= at_ground_m * np.exp(-REST_M / 0.45) <= told.high + 0.02


def test_without_a_reference_it_is_said_why(runs: FlightLog) -> None:
    alone = measured(runs, (SPEEDS,), Reference.POSITION)
    leaning = replace(alone, meta={"autopilot": "PX4", "parameters": {"EKF2_HGT_REF": 1.0}})
    assert heights(leaning, "barometer") is NoReference.LEANS


@pytest.fixture
def leaning(runs: FlightLog, tmp_path: Path) -> Path:
    """A log whose height leans on its barometer, without another reference."""
    log = measured(runs, (), Reference.POSITION)
    write_csv(replace(log, meta={"autopilot": "PX4"}), tmp_path / "leaning.csv")
    (tmp_path / "leaning.meta.yaml").write_text("autopilot: PX4\nparameters: {EKF2_HGT_REF: 1.0}\n")
    return tmp_path / "leaning.csv"


def test_the_answer_without_a_reference_is_in_the_json_file_too(leaning: Path, tmp_path: Path) -> None:
    said = CliRunner().invoke(app, ["diagnose", "--sensors", str(leaning), "--json", str(tmp_path / "out.json")])
    assert said.exit_code != 0
    (found,) = json.loads((tmp_path / "out.json").read_text())["sensors"]
    assert (found["sensor"], found["verdict"], found["reasons"]) == ("barometer", "cannot tell", ["leans"])
    assert "range finder" in found["needs"]


def test_a_log_without_a_reference_is_left_out_beside_one_that_has_it(
    runs: FlightLog, leaning: Path, tmp_path: Path
) -> None:
    known = measured(runs, (GroundError(-0.4, 0.4),), Reference.RANGE, seed=9)
    write_csv(known, tmp_path / "known.csv")
    said = CliRunner().invoke(app, ["diagnose", "--sensors", str(leaning), str(tmp_path / "known.csv")])
    assert said.exit_code == 0
    assert "Left out is leaning.csv" in said.output and "barometer.ground" in said.output


@pytest.mark.parametrize("option", [["--all"], ["--nested"], ["--html", "out.html"]])
def test_an_option_of_the_motion_is_refused(leaning: Path, option: list[str]) -> None:
    said = CliRunner().invoke(app, ["diagnose", "--sensors", str(leaning), *option])
    assert said.exit_code == 2
    assert f"{option[0]} is of a diagnosis of the motion" in said.output


def test_the_time_near_the_ground_is_that_of_the_slowest_take_off() -> None:
    ground = FittedError(GroundError(-0.4, 0.3), {"at_ground_m": (-0.5, -0.3)}, True)
    up_to_m = 0.3 * np.log(0.4 / 0.05)
    for near_s, hold in (((1.4, 2.6), 2.6), ((1.4, 8.0), None), ((), None)):
        rows = {row.name: row for row in sensor_rows(SensorModel((ground,), ("a.bin",), None, 0.4, near_s), ARDUPILOT)}
        assert rows["GNDEFF_ALT"].to_write == pytest.approx(up_to_m)
        assert rows["GNDEFF_TMO"].to_write == hold
    assert "take off faster" in sensor_rows(SensorModel((ground,), (), None, 0.4, (8.0,)), ARDUPILOT)[-1].lacking


def test_the_parameters_say_what_the_height_leans_on() -> None:
    assert leans_on_barometer({"EK3_SRC1_POSZ": 1.0}, "ArduPilot")
    assert not leans_on_barometer({"EK3_SRC1_POSZ": 6.0}, "ArduPilot")
    assert not leans_on_barometer({"EKF2_HGT_REF": 3.0, "EKF2_BARO_CTRL": 0.0}, "PX4")
    assert leans_on_barometer({"EKF2_HGT_MODE": 0.0}, "PX4")
    assert leans_on_barometer({}, "PX4") and not leans_on_barometer({}, "")


def test_where_it_fails_is_shown_over_the_height(runs: FlightLog) -> None:
    found = heights(measured(runs, (GroundError(-0.6, 0.3),), Reference.RANGE), "barometer")
    assert isinstance(found, Heights)
    low, *_, high = [b for b in compare_sensor([found]).bins if b.variable == "height"]
    assert low.mean_m < -3.0 * low.std_error_m and low.mean_m < high.mean_m - 0.15


def test_noise_that_wanders_is_weighed_as_its_covariance_says() -> None:
    random = np.random.default_rng(3)
    time_s, flight = np.sort(random.uniform(0.0, 80.0, 50)), np.repeat([0.0, 1.0], 25)
    noise = Noise(0.1, (0.2, 0.5), (3.0, 40.0))
    dense = 0.01 * np.eye(50)
    for size, tau in zip(noise.sizes_m, noise.times_s, strict=True):
        together = flight[:, np.newaxis] == flight
        dense += size**2 * np.exp(-np.abs(time_s[:, np.newaxis] - time_s) / tau) * together
    columns, target = random.standard_normal((50, 2)), random.standard_normal(50)
    inverse = np.linalg.inv(dense)
    covariance = np.linalg.inv(columns.T @ inverse @ columns)
    found = estimate(Rows(time_s, flight, columns, target), noise)
    np.testing.assert_allclose(found.covariance, covariance, rtol=1e-6)
    np.testing.assert_allclose(found.value, covariance @ columns.T @ inverse @ target, rtol=1e-6)


def test_errors_are_what_their_formulas_say() -> None:
    c = SensorConditions(0.3, (3.0, -2.0, -1.0), (1.0, 0.0, 0.0, 0.0), 1.2, 50.0, 4.0)
    speed = AirspeedError(0.2, 9.0, 9.0, -0.1, 9.0, 0.5)
    assert speed.error_m(c) == pytest.approx(-(0.2 * 9.0 - 0.1 * 4.0 + 0.5 * 1.0) / (2.0 * 9.80665))
    assert GroundError(-0.5, 0.2).error_m(c) == pytest.approx(-0.5 * 1.2 * np.exp(-1.5))
    assert ThrottleError(0.7).error_m(c) == pytest.approx(0.84)
    assert DriftError(0.01, -0.1).error_m(c) == pytest.approx(0.1)


def test_the_export_takes_each_firmwares_own_names_and_signs() -> None:
    speed = FittedError(
        AirspeedError(forward=0.15, down=0.3, up=-0.2),
        {"forward": (0.1, 0.2), "backward": (-0.02, 0.03), "right": (-0.2, 0.4), "left": (-0.01, 0.01)}
        | {"down": (0.25, 0.35), "up": (-0.25, -0.15)},
        True,
    )
    thrust = FittedError(ThrottleError(0.8), {"in_hover_m": (0.6, 1.0)}, True)
    model = SensorModel((speed, thrust), ("a.bin",), 0.1, 0.4)
    copter = {row.name: row for row in sensor_rows(model, ARDUPILOT)}
    written = {name: row.to_write for name, row in copter.items() if row.to_write is not None}
    # ArduPilot's UP acts in a descent; the pressure is lower where the height reads too high.
    assert written == {
        "BARO1_WCF_ENABLE": 1.0,
        "BARO1_WCF_FWD": 0.15,
        "BARO1_WCF_UP": 0.3,
        "BARO1_WCF_DN": -0.2,
        "BARO1_THST_SCALE": pytest.approx(-0.8 * 1.225 * 9.80665 / 0.4),
    }
    assert "fly" in copter["BARO1_WCF_RGT"].lacking and "fly" not in copter["BARO1_WCF_LFT"].lacking
    px4 = {row.name: row for row in sensor_rows(model, PX4)}
    assert "differ" in px4["EKF2_PCOEF_Z"].lacking
    older = Present({"EKF2_PCOEF_XP": 0.0}, "old.params", is_whole=True)
    assert {row.name for row in sensor_rows(model, PX4, older) if row.estimate is not None} == {"EKF2_PCOEF_XP"}


def test_a_file_of_sensor_errors_comes_back_as_it_was(tmp_path: Path) -> None:
    model = SensorModel((FittedError(SPEEDS, {"forward": (0.4, 0.6)}, True),), ("a.bin", "b.ulg"), 0.12, 0.37)
    save_sensors(model, tmp_path / "sensors.yaml")
    assert load_sensors(tmp_path / "sensors.yaml") == model


@needs_logs
def test_coefficients_of_a_real_copter_are_in_their_intervals(tmp_path: Path) -> None:
    """Flown: FWD +0.15, BCK -0.10, no others; and the same flight with a barometer that is right."""
    for log, hidden in (("baro_wcf.bin", (0.15, -0.1)), ("baro_clean.bin", None)):
        found = diagnosed(read_log(ARDUPILOT47 / log))
        every = {one.name: one for one in (*found.missing, *found.small, *found.absent)}
        told = every["barometer.airspeed"].parameters
        assert (found.verdict is Verdict.MISSING) == (hidden is not None)
        truth = dict(zip(("forward", "backward"), hidden or (0.0, 0.0), strict=True))
        for name, each in told.items():
            assert each.low <= truth.get(name, 0.0) <= each.high, (log, name)
            assert each.is_identified == (truth.get(name, 0.0) != 0.0), (log, name)


RECORDINGS = [*sorted((DATA / "real").glob("ardupilot*/*.bin")), *sorted((DATA / "ardupilot").glob("*.bin"))]


@needs_logs
@pytest.mark.long
@pytest.mark.parametrize("log", [path for path in RECORDINGS if path.name != "baro_wcf.bin"], ids=lambda p: p.stem)
def test_a_real_barometer_without_an_error_gets_no_name(log: Path) -> None:
    """Simulated by ArduPilot, without an error of the barometer: some last half a minute, some differ from GPS by
    millimetres, with the lag of the sensor in it."""
    assert not diagnosed(read_log(log)).missing


def test_a_flight_of_half_a_minute_is_judged_on_shorter_parts(runs: FlightLog) -> None:
    n = int(np.searchsorted(runs.time_s, runs.time_s[0] + 32.0))
    first = replace(runs, columns={name: values[:n] for name, values in runs.columns.items()}, phase=None)
    found = diagnosed(measured(first, (GroundError(0.6, 0.4),), Reference.RANGE))
    assert [one.name for one in found.missing] == ["barometer.ground"]


@needs_logs
def test_two_commands_lead_from_a_log_to_a_parameter_file(tmp_path: Path) -> None:
    run = CliRunner()
    file, parameters = tmp_path / "sensors.yaml", tmp_path / "baro.parm"
    log = str(ARDUPILOT47 / "baro_wcf.bin")
    assert run.invoke(app, ["diagnose", "--sensors", log, "-o", str(file)]).exit_code == 0
    assert run.invoke(app, ["export", str(file), "--to", "ardupilot", "-o", str(parameters)]).exit_code == 0
    lines = [line for line in parameters.read_text().splitlines() if not line.startswith("#")]
    assert [line.partition(",")[0] for line in lines] == ["BARO1_WCF_ENABLE", "BARO1_WCF_FWD", "BARO1_WCF_BCK"]


def test_a_range_finder_that_is_turned_on_the_body_is_named_beside_motion_capture(runs: FlightLog) -> None:
    mounting = MountingError(offset_m=0.08, scale=0.0, roll_rad=0.0, pitch_rad=0.12)
    log = measured(runs, (), Reference.POSITION)
    lean = np.cos(np.radians(log["roll_deg"])) * np.cos(np.radians(log["pitch_deg"]))
    above = replace(conditions(log), height_m=log["z_m"] - np.nanmin(log["z_m"]))  # above where it stands
    noise = 0.01 * np.random.default_rng(8).standard_normal(len(log))
    height = log["z_m"] + np.asarray(mounting.error_m(above)) + noise
    found = heights(replace(log, columns={**log.columns, "range_m": height / lean}), "rangefinder")
    assert isinstance(found, Heights) and found.reference is Reference.POSITION
    named = diagnose_sensor([found])
    told = {one.name: one.parameters for one in (*named.missing, *named.small, *named.absent)}
    pitch = told["rangefinder.mounting"]["pitch_rad"]
    assert pitch.low <= 0.12 <= pitch.high and pitch.is_identified


@needs_logs
def test_a_range_finder_beside_an_integrated_climb_rate_has_no_offset_that_could_be_told() -> None:
    """Neither the level nor the scale of the reference is known: either interval was thousands of metres wide."""
    found = heights(read_log(ARDUPILOT47 / "baro_clean.bin"), "rangefinder")
    assert isinstance(found, Heights) and found.reference is Reference.DOPPLER
    (mounting,) = diagnose_sensor([found]).absent
    assert mounting.unknown == ("offset_m", "scale")
    assert set(mounting.parameters) == {"roll_rad", "pitch_rad"}
    assert parameters(mounting).endswith(", these flights do not identify offset_m, scale")
