"""Damaged and mistaken logs: named for what they are, or read for what is left of them; never taken for physics."""

import dataclasses
import gzip
import json
import math
import sys
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import pytest
import yaml

from quadctl import cli
from quadctl.errors import LogError
from quadctl.lab.flights.dataset import load_dataset
from quadctl.lab.flights.preparation import prepare
from quadctl.logs.columns import rpm_columns
from quadctl.logs.contradictions import contradictions
from quadctl.logs.csv_log import read_csv, write_csv
from quadctl.logs.findings import Kind, of_kind, worded
from quadctl.logs.flight_log import ATTITUDE, POSITION, RATES, VELOCITY, FlightLog, Floats
from quadctl.logs.quality import quality
from quadctl.logs.read import read_log
from quadctl.model import Model
from quadctl.vehicle import Vehicle, load_vehicle
from tests.support.flights import SHORTER, obedient, simulated
from tests.support.places import DATA, ROOT

VEHICLE = ROOT / "config" / "vehicles" / "raptor.yaml"
FEET, KNOTS = 1.0 / 0.3048, 3600.0 / 1852.0
SPEEDS = tuple(rpm_columns(4))
Damage = Callable[[FlightLog], FlightLog]


# --- one good flight and what can happen to it ------------------------------------------------------------------------


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> FlightLog:
    """A simulated flight of runs along north and east: everything moves."""
    return simulated("forward_runs", [], 1, tmp_path_factory.mktemp("runs"))


@pytest.fixture(scope="module")
def climbs(tmp_path_factory: pytest.TempPathFactory) -> FlightLog:
    """A simulated flight up and down."""
    return simulated("vertical_runs", [], 1, tmp_path_factory.mktemp("climbs"))


def having(log: FlightLog, columns: Mapping[str, Floats]) -> FlightLog:
    return dataclasses.replace(log, columns={**log.columns, **columns}, findings=list(log.findings))


def scaled(factor: float, *names: str) -> Damage:
    return lambda log: having(log, {name: factor * log[name] for name in names})


def constant(value: float, *names: str) -> Damage:
    return lambda log: having(log, {name: np.full(len(log), value) for name in names})


def exchanged(*pairs: tuple[str, str]) -> Damage:
    return lambda log: having(log, {a: log[b] for pair in pairs for a, b in (pair, pair[::-1])})


def replaced(name: str, rows: slice, value: float) -> Damage:
    def damage(log: FlightLog) -> FlightLog:
        values = log[name].copy()
        values[rows] = value
        return having(log, {name: values})

    return damage


def without(*names: str) -> Damage:
    return lambda log: dataclasses.replace(log, columns={n: v for n, v in log.columns.items() if n not in names})


def alone(damage: Damage) -> Damage:
    """The damage to a log whose thrust is known from the rotor speeds only."""
    others = ("throttle_cmd", "thrust_cmd_n", *(f"motor{i}_output" for i in range(1, 5)))
    return lambda log: without(*others)(damage(log))


def every(n: int) -> Damage:
    return lambda log: log.rows(slice(None, None, n))


def all_of(*damages: Damage) -> Damage:
    def damage(log: FlightLog) -> FlightLog:
        for one in damages:
            log = one(log)
        return log

    return damage


def sentence(log: FlightLog, vehicle: Vehicle) -> str:
    with pytest.raises(LogError) as refused:
        prepare(log, vehicle)
    said = str(refused.value)
    assert said.startswith(f"{log.name}: ")
    assert "\n" not in said
    return said


# --- units, signs, axes -----------------------------------------------------------------------------------------------

UNITS: dict[str, tuple[Damage, str]] = {
    "position in feet": (scaled(FEET, *POSITION), "x_m changes 3.28 times as much as vx_m_s says.*in feet"),
    "altitude in feet": (scaled(FEET, "z_m"), "z_m changes 3.2. times as much as vz_m_s says.*in feet"),
    "position in cm": (scaled(100.0, *POSITION), "x_m changes 100 times.*in centimetres"),
    "position in mm": (scaled(1000.0, *POSITION), r"x_m changes 1e\+03 times.*in millimetres"),
    "velocity in ft/s": (scaled(FEET, *VELOCITY), "x_m changes 0.305 times.*in feet per second"),
    "velocity in km/h": (scaled(3.6, *VELOCITY), "x_m changes 0.278 times.*in km/h"),
    "both in feet": (scaled(FEET, *POSITION, *VELOCITY), "speeds up forward 3.28 times as much as pitch_deg.*feet"),
    "both in cm": (scaled(100.0, *POSITION, *VELOCITY), "speeds up forward 100 times as much as pitch_deg.*centim"),
    "time in ms": (scaled(1e3, "time_s"), "x_m changes 0.001 times as much as vx_m_s says.*milliseconds"),
    "time in us": (scaled(1e6, "time_s"), "x_m changes 1e-06 times as much as vx_m_s says.*microseconds"),
    "attitude in radians": (scaled(math.pi / 180.0, *ATTITUDE), r"5\d(\.\d)? times as much as pitch_deg.*in radians"),
    "rates in deg/s": (scaled(180.0 / math.pi, *RATES), r"_deg changes 0\.01\d+ times.*degrees per second"),
    "rotor speeds in rad/s": (scaled(math.pi / 30.0, *SPEEDS), "0.011 times its weight of 14.7 N.*in rad/s"),
    "rotor speeds in 1/s": (scaled(1.0 / 60.0, *SPEEDS), "times its weight of 14.7 N.*revolutions per second"),
    "electrical rotor speeds": (scaled(7.0, *SPEEDS), "49 times its weight of 14.7 N.*7 pole pairs"),
    "velocity down": (scaled(-1.0, "vz_m_s"), "z_m changes -1 times as much as vz_m_s says.*down"),
    "altitude down": (scaled(-1.0, "z_m"), "z_m changes -1 times as much as vz_m_s says.*down"),
    "both down": (scaled(-1.0, "z_m", "vz_m_s"), "z_m falls at the take-off and stays below the ground in flight.*up"),
    "roll flipped": (scaled(-1.0, "roll_deg"), "to the right -0.989 times as much as roll_deg says.*sign"),
    "pitch flipped": (scaled(-1.0, "pitch_deg", RATES[1]), "forward -0.996 times as much as pitch_deg says.*sign"),
    "rate flipped": (scaled(-1.0, RATES[1]), "pitch_deg changes -0.998 times as much as pitch_rate_rad_s says"),
    "roll for pitch": (exchanged(("roll_deg", "pitch_deg")), "are roll and pitch, or x and y, swapped"),
    "x for y": (exchanged(("x_m", "y_m"), ("vx_m_s", "vy_m_s")), "are roll and pitch, or x and y, swapped"),
    "x for y in position": (exchanged(("x_m", "y_m")), "x_m changes as vy_m_s says"),
    "diagonal motors": (exchanged((SPEEDS[0], SPEEDS[1])), "in the order 2, 1, 3, 4 they do"),
    "front motors": (exchanged((SPEEDS[0], SPEEDS[2])), "in the order 3, 2, 1, 4 they do"),
    "right motors": (exchanged((SPEEDS[0], SPEEDS[3])), "in the order 4, 2, 3, 1 they do"),
}


@pytest.mark.parametrize("kind", UNITS)
def test_a_mistaken_unit_sign_or_axis_is_named(runs: FlightLog, raptor: Vehicle, kind: str) -> None:
    damage, words = UNITS[kind]
    with pytest.raises(LogError, match=words):
        prepare(damage(runs), raptor)


def test_feet_in_a_flight_that_only_climbs_are_named(climbs: FlightLog, raptor: Vehicle) -> None:
    """Without tilt there is only the rotors' thrust to tell."""
    said = sentence(scaled(FEET, *POSITION, *VELOCITY)(climbs), raptor)
    assert "vz_m_s speeds up 3.28 times as much as the rotors' thrust over mass_kg says" in said


@pytest.mark.parametrize("turn_rad_s", [-0.8, 0.8])
def test_a_vehicle_that_turns_as_it_speeds_up_is_pushed_to_the_side_of_its_first_heading(turn_rad_s: float) -> None:
    t = np.arange(0.0, 80.0, 0.02)
    yaw, ahead = turn_rad_s * t, 3.0 * np.sin(0.5 * t) + 0.3 * np.sin(1.3 * t)
    aside = math.copysign(0.25, turn_rad_s) * ahead + 0.02 * np.sin(3.1 * t)
    north, east = ahead * np.cos(yaw) - aside * np.sin(yaw), ahead * np.sin(yaw) + aside * np.cos(yaw)
    columns = {"roll_deg": np.degrees(np.arctan(aside / 9.80665)), "yaw_deg": np.degrees(yaw)}
    columns["pitch_deg"] = np.degrees(np.arctan(-ahead * np.cos(np.radians(columns["roll_deg"])) / 9.80665))
    for axis, push in {"x": north, "y": east, "z": 0.0 * t}.items():
        columns[f"v{axis}_m_s"] = 0.02 * np.cumsum(push) + 0.001 * np.sin(t)
        columns[f"{axis}_m"] = 0.02 * np.cumsum(columns[f"v{axis}_m_s"])
    log = FlightLog("turning.csv", None, {"time_s": t, **columns})
    assert contradictions(log) == []
    (found,) = contradictions(scaled(-1.0, "pitch_deg")(log))
    said = worded(found)
    assert "the vehicle speeds up forward -" in said


def test_acceleration_in_g_is_named(runs: FlightLog, raptor: Vehicle) -> None:
    t = runs.time_s
    in_g = {f"a{axis}_m_s2": np.gradient(runs[f"v{axis}_m_s"], t) / 9.80665 for axis in "xyz"}
    assert "vx_m_s changes 9.8" in sentence(having(runs, in_g), raptor)
    imu = {"imu_x_m_s2": 0.0 * t, "imu_y_m_s2": 0.01 * np.sin(t), "imu_z_m_s2": -1.0 + 0.0 * t}
    assert "have a median length of 1 m/s^2, expected about 9.8" in sentence(having(runs, imu), raptor)
    imu["imu_z_m_s2"] = 9.8 + 0.0 * t
    assert "imu_z_m_s2 is 9.8 in the middle, expected about -9.8 in hover" in sentence(having(runs, imu), raptor)


def test_what_looks_wrong_is_told_by_the_look_at_the_log_too(runs: FlightLog) -> None:
    report = quality(scaled(FEET, *POSITION)(runs))
    assert not report.can_be_analysed
    assert any("is the position in feet?" in obstacle for obstacle in report.obstacles)


def test_a_missing_column_is_told_by_the_look_at_the_log_too(runs: FlightLog) -> None:
    assert "it holds no values of vx_m_s" in quality(constant(math.nan, "vx_m_s")(runs)).obstacles


# --- channels ---------------------------------------------------------------------------------------------------------

CHANNELS: dict[str, tuple[Damage, str]] = {
    "velocity constant": (constant(0.0, "vx_m_s"), "vx_m_s is 0 throughout while x_m changes"),
    "position constant": (constant(1.0, "z_m"), "z_m is 1 throughout while vz_m_s changes"),
    "roll constant": (constant(0.0, "roll_deg"), "roll_deg is 0 throughout while roll_rate_rad_s changes"),
    "one rotor constant": (
        alone(constant(4800.0, SPEEDS[0])),
        "motor1_rpm is 4800 throughout while the speeds of other",
    ),
    "all rotors constant": (
        alone(constant(5000.0, *SPEEDS)),
        "rpm: never changes in flight, an analysis needs at",
    ),
    "velocity missing": (constant(math.nan, "vx_m_s"), "holds no values of vx_m_s"),
    "one rotor missing": (alone(constant(math.nan, SPEEDS[2])), "motor3_rpm holds no values while motor1_rpm does"),
    "first rotor missing": (alone(constant(math.nan, SPEEDS[0])), "motor1_rpm holds no values while motor2_rpm does"),
    "one rotor only": (without(*SPEEDS[1:]), "has the speeds of 1 rotors, expected 4"),
    "rotors by turns": (
        alone(all_of(replaced(SPEEDS[0], slice(0, 1800), math.nan), replaced(SPEEDS[1], slice(1800, None), math.nan))),
        "never hold values in one row",
    ),
    "1 Hz": (every(50), "position: 1.0. updates per second in flight, an analysis needs at least 2.4 per second"),
    "10 s": (lambda log: log.rows(slice(1000, 1500)), "holds 6 s of usable flight, expected at least 10 s"),
    "one row": (lambda log: log.rows(slice(1000, 1001)), "never leaves the ground"),
    "ground": (lambda log: log.rows(log[SPEEDS[0]] < 2000.0), "never leaves the ground.*z ranges over 0.00 m"),
    "perfect hover": (
        lambda log: having(log, {n: np.full(len(log), v[1800]) for n, v in log.columns.items() if n != "time_s"}),
        r"position: (never changes|0\.\d+ updates per second) in flight",
    ),
}


@pytest.mark.parametrize("kind", CHANNELS)
def test_a_channel_that_says_nothing_is_named(runs: FlightLog, raptor: Vehicle, kind: str) -> None:
    damage, words = CHANNELS[kind]
    with pytest.raises(LogError, match=words):
        prepare(damage(runs), raptor)


def test_rotor_speeds_of_which_many_updates_repeat_the_last_are_slow_but_not_refused(
    runs: FlightLog, raptor: Vehicle
) -> None:
    """A rounded speed that stays the same is no update: the mean rate falls below the least, the usual one does not."""
    ticks = np.flatnonzero(np.arange(len(runs)) % 15 == 0)  # 3.3 updates per second
    kept = ticks[~np.isin(np.arange(len(ticks)) % 10, (7, 8, 9))]
    shown = kept[np.maximum(np.searchsorted(kept, np.arange(len(runs)), "right") - 1, 0)]
    flight = prepare(having(runs, {name: runs[name][shown] for name in SPEEDS}), raptor)
    assert flight.bandwidth_hz == pytest.approx(0.35 * 2.33, rel=0.05)


def impaired(log: FlightLog, vehicle: Vehicle) -> tuple[float, str]:
    """Error of the rigid body, which flew, on what is left of a log, and what is said to have been left out."""
    data = load_dataset([log], vehicle)
    return float(np.sqrt(np.mean(data.aligned_for(Model(vehicle)).residual(Model(vehicle)) ** 2))), "; ".join(
        data.flights[0].notes
    )


@pytest.mark.parametrize(
    ("damage", "words"),
    [
        pytest.param(lambda log: log, "are flight", id="none"),
        pytest.param(
            all_of(
                *(replaced(name, slice(1000, 1300), math.nan) for name in (*POSITION, *VELOCITY, *ATTITUDE, *SPEEDS))
            ),
            "6.0 s without new values",
            id="rows without values",
        ),
        pytest.param(
            all_of(*(replaced(name, slice(1000, 1500), math.nan) for name in SPEEDS)),
            "10.0 s without new values",
            id="rotor speeds for part of the time",
        ),
        pytest.param(replaced(SPEEDS[1], slice(None, None, 97), 5e4), "rotor speeds that jump away", id="rpm spikes"),
        pytest.param(replaced("vx_m_s", slice(1000, 1010), 1e9), "the velocity jumps away", id="velocity spikes"),
        pytest.param(replaced("vx_m_s", slice(1000, 1010), 1e300), "the velocity jumps away", id="huge numbers"),
        pytest.param(replaced("x_m", slice(1500, None), 20.0), "are flight", id="position jumps"),
        pytest.param(scaled(-1.0, *SPEEDS[:2]), "are flight", id="sense of rotation in the rotor speeds"),
        pytest.param(constant(math.nan, *RATES), "are flight", id="no rates"),
        pytest.param(
            constant(math.nan, *SPEEDS), "without rotor speeds, thrust is taken from the motor output", id="no rpm"
        ),
    ],
)
def test_what_is_damaged_is_left_out_and_the_rest_still_fits(
    runs: FlightLog, raptor: Vehicle, damage: Damage, words: str
) -> None:
    error, notes = impaired(damage(runs), raptor)
    assert words in notes
    assert error < (0.2 if "motor output" in notes else 0.065)  # 0.057 undamaged


def test_a_heading_that_wraps_is_no_jump(raptor: Vehicle) -> None:
    log = obedient(Model(raptor), noise_m_s=0.01)
    steady, _ = impaired(log, raptor)
    turning = having(log, {"yaw_deg": (175.0 + 20.0 * log.time_s + 180.0) % 360.0 - 180.0})
    assert impaired(turning, raptor)[0] == pytest.approx(steady, rel=0.01)


def test_steady_turning_at_a_constant_rate_is_no_dead_channel(raptor: Vehicle) -> None:
    log = obedient(Model(raptor))
    steady = {"yaw_rate_rad_s": np.full(len(log), 0.5), "yaw_deg": np.degrees(0.5 * log.time_s)}
    assert not contradictions(having(log, steady))


def test_a_clock_that_leaps_at_the_end_costs_its_row(runs: FlightLog, raptor: Vehicle) -> None:
    time_s = runs.time_s.copy()
    time_s[-1] = 1e12
    assert impaired(having(runs, {"time_s": time_s}), raptor)[0] < 0.065


@pytest.mark.parametrize(
    ("damage", "why"),
    [
        pytest.param(constant(4800.0, SPEEDS[0]), "frozen", id="one stands"),
        pytest.param(constant(0.0, SPEEDS[1]), "stands", id="one is silent"),
        pytest.param(constant(5000.0, *SPEEDS), "frozen", id="all stand"),
        pytest.param(replaced(SPEEDS[2], slice(1500, None), 4700.0), "frozen", id="one stands from a moment on"),
        pytest.param(replaced(SPEEDS[2], slice(5, None), np.nan), "not measured", id="one is lost"),
        pytest.param(
            lambda log: having(log, {name: np.where(np.arange(len(log)) < 5, log[name], np.nan) for name in SPEEDS}),
            "not measured",
            id="none is measured in flight",
        ),
    ],
)
def test_rotor_speeds_that_do_not_live_give_way_to_the_motor_outputs(
    runs: FlightLog, raptor: Vehicle, damage: Damage, why: str
) -> None:
    flight = prepare(damage(runs), raptor)
    assert flight.thrust_source == "motor output"
    dead = of_kind(flight.findings, Kind.DEAD_CHANNEL)
    assert {found.figures["why"] for found in dead} == {why}
    json.dumps([found.to_dict() for found in dead], allow_nan=False)


# --- vehicles ---------------------------------------------------------------------------------------------------------


def altered(vehicle: Vehicle, **settings: object) -> Vehicle:
    return Vehicle.model_validate({**vehicle.model_dump(), **settings})


def test_a_vehicle_of_another_weight_is_named(runs: FlightLog, raptor: Vehicle) -> None:
    curve = {"per_newton": 0.002, "offset": 0.1, "max_thrust_per_rotor_n": 90.0}
    heavy = altered(raptor, mass_kg=15.0, throttle=curve)
    assert "give 14.7 N in flight, 0.1 times its weight of 147 N" in sentence(runs, heavy)
    strong = altered(raptor, rotor={**raptor.rotor.model_dump(), "thrust_n_per_rpm2": 4e-7})
    assert "3.5 times its weight of 14.7 N, expected about once: are mass_kg and" in sentence(runs, strong)


def test_a_vehicle_of_half_the_mass_is_asked_about(runs: FlightLog, raptor: Vehicle) -> None:
    """A thrust that is wrong by a factor of two would be named as a thrust scale, and is rather another vehicle."""
    assert not any("is it the vehicle" in note for note in prepare(runs, raptor).notes)
    light = altered(raptor, mass_kg=0.75)
    (asked,) = [note for note in prepare(runs, light).notes if "is it the vehicle that flew" in note]
    assert "by the rotor speed the rotors of 'raptor' give 2 times the thrust that carries its 0.75 kg" in asked


def test_a_vehicle_with_half_the_rotors_is_named(runs: FlightLog, raptor: Vehicle) -> None:
    more = {f"motor{i}_rpm": runs[f"motor{i - 4}_rpm"] for i in range(5, 9)}
    assert "has the speeds of 8 rotors, expected 4 as the vehicle 'raptor' has" in sentence(having(runs, more), raptor)


def test_a_sidecar_that_names_another_vehicle_is_believed(runs: FlightLog, raptor: Vehicle) -> None:
    assert runs.meta["vehicle"]["name"] == "raptor"
    light = altered(raptor, name="kestrel", mass_kg=1.1)
    said = sentence(runs, light)
    assert "its sidecar says that 'raptor' flew it (mass_kg 1.5), expected the vehicle of the model, 'kestrel'" in said
    prepare(runs, altered(raptor, name="kestrel"))  # the same vehicle under another name


def test_logs_of_two_vehicles_are_not_analysed_together(runs: FlightLog, climbs: FlightLog, raptor: Vehicle) -> None:
    load_dataset([runs, climbs], raptor)
    other = dataclasses.replace(scaled(math.sqrt(1.8), *SPEEDS)(climbs), name="other.csv")
    with pytest.raises(LogError, match=r"other\.csv: by its rotor speed .* 1\.80 times .*1\.00 times, .*different"):
        load_dataset([runs, other], raptor)


# --- files ------------------------------------------------------------------------------------------------------------


FILES: dict[str, tuple[Callable[[str], bytes], str]] = {
    "empty.ulg": (lambda text: b"", "is empty, expected a flight log"),
    "header.csv": (lambda text: text.partition("\n")[0].encode() + b"\n", "has a header and no complete row"),
    "semicolons.csv": (lambda text: text.replace(",", ";").encode(), "line 1: separates columns by semicolons"),
    "decimal.csv": (lambda text: text.replace(",", ";").replace(".", ",").encode(), "decimal points"),
    "tabs.csv": (lambda text: text.replace(",", "\t").encode(), "line 1: separates columns by tabs"),
    "utf16.csv": (lambda text: text.encode("utf-16"), "is text in UTF-16, expected UTF-8"),
    "packed.csv.gz": (lambda text: gzip.compress(text.encode()), "is compressed by gzip, expected it unpacked"),
    "packed.csv": (lambda text: b"PK\x03\x04" + text.encode(), "is a zip archive"),
    "mac.csv": (lambda text: text.replace("\n", "\r").encode(), "ends its lines by carriage returns alone"),
    "twice.csv": (lambda text: text.replace("y_m", "x_m", 1).encode(), "column 'x_m' is there twice"),
    "model.yaml": (lambda text: VEHICLE.read_bytes(), "MODEL comes first, then LOG"),
    "log.ulg": (lambda text: text.encode(), "does not begin as a PX4 ULog does"),
    "cut.ulg": (lambda text: b"ULog\x01\x12\x35" + bytes(9), "holds no values of x_m"),
    "cut.bin": (lambda text: b"\xa3\x95\x80" + bytes(9), "expected an ArduPilot DataFlash log"),
    "cut.tlog": (lambda text: bytes(7), "expected LOCAL_POSITION_NED and ATTITUDE"),
}


@pytest.mark.parametrize("name", FILES)
def test_a_file_that_is_no_log_is_named(runs: FlightLog, tmp_path: Path, name: str) -> None:
    make, words = FILES[name]
    good = tmp_path / "good.csv"
    write_csv(runs.rows(slice(0, 200)), good)
    path = tmp_path / name
    path.write_bytes(make(good.read_text()))
    with pytest.raises(LogError) as refused:
        read_log(path)
    assert str(refused.value).startswith(str(path))
    assert words in str(refused.value)


def test_a_directory_is_no_log(tmp_path: Path) -> None:
    with pytest.raises(LogError, match="is a directory, expected a flight log"):
        read_log(tmp_path)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda t: np.where(np.arange(len(t)) > 500, t - 3.0, t), "time does not increase in 149 rows of 3635"),
        (lambda t: 5.0 - t, "time does not increase in"),
    ],
    ids=["once", "always"],
)
def test_time_that_goes_back_is_named(
    runs: FlightLog, tmp_path: Path, change: Callable[[Floats], Floats], words: str
) -> None:
    write_csv(having(runs, {"time_s": change(runs.time_s)}), tmp_path / "back.csv")
    with pytest.raises(LogError, match=words):
        read_csv(tmp_path / "back.csv")


def test_rows_given_twice_and_a_clock_that_stutters_are_mended(
    runs: FlightLog, raptor: Vehicle, tmp_path: Path
) -> None:
    write_csv(runs.rows(np.repeat(np.arange(len(runs)), 2)), tmp_path / "twice.csv")
    error, notes = impaired(read_csv(tmp_path / "twice.csv"), raptor)
    assert error < 0.065
    assert f"{len(runs)} rows in which time does not increase left out" in notes


def test_time_in_microseconds_since_1970_is_named(runs: FlightLog, raptor: Vehicle, tmp_path: Path) -> None:
    write_csv(having(runs, {"time_s": 1.7e15 + 1e6 * runs.time_s}), tmp_path / "epoch.csv")
    assert "is time_s in microseconds?" in sentence(read_csv(tmp_path / "epoch.csv"), raptor)


# --- commands ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "command",
    [
        ["compare", "VEHICLE", "LOG"],
        ["diagnose", "VEHICLE", "LOG"],
        ["discover", "VEHICLE", "LOG", "-o", "OUT"],
        ["add", "rotor_drag.linear", "VEHICLE", "LOG", "-o", "OUT"],
        ["fit", "MODEL", "LOG", "-o", "OUT"],
        ["remove", "rotor_drag", "MODEL", "LOG", "-o", "OUT"],
    ],
    ids=lambda command: command[0],
)
def test_every_command_refuses_with_one_sentence(
    runs: FlightLog,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    command: list[str],
) -> None:
    log, model, out = tmp_path / "down.csv", tmp_path / "model.yaml", tmp_path / "out.yaml"
    write_csv(scaled(-1.0, "vz_m_s")(runs), log)
    drag = {"effect": "rotor_drag.linear", "parameters": {"d_x": 0.3, "d_y": 0.3}}
    model.write_text(yaml.safe_dump({"vehicle": str(VEHICLE), "effects": [drag]}))
    places = {"VEHICLE": VEHICLE, "MODEL": model, "LOG": log, "OUT": out}
    monkeypatch.setattr(sys, "argv", ["quadctl", *(str(places.get(word, word)) for word in command)])
    with pytest.raises(SystemExit) as ended:
        cli.main()
    said = capsys.readouterr().err
    assert ended.value.code == 1
    assert said.count("\n") == 1
    assert "down.csv: z_m changes -1 times as much as vz_m_s says" in said
    assert not out.exists()


# --- no false alarms --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("mission", ["step_response", "vertical_runs", "forward_runs"])
def test_good_flights_are_not_refused(raptor: Vehicle, tmp_path: Path, mission: str) -> None:
    """In a world of strong effects, which bend every relation that is looked at."""
    effects = [
        ("ground_effect.exponential", {"a": 0.3, "b": 4.0}),
        ("thrust_scale.constant", {"factor": 0.7}),
        ("rotor_drag.linear", {"d_x": 0.6, "d_y": 0.6, "d_z": 0.3}),
    ]
    prepare(simulated(mission, effects, 2, tmp_path, SHORTER.get(mission, ())), raptor)


@pytest.mark.skipif(not DATA.is_dir(), reason="the real logs are not here")
@pytest.mark.parametrize("folder", ["raptor", "px4", "ardupilot"])
def test_real_logs_are_not_refused(folder: str, raptor: Vehicle) -> None:
    vehicle = load_vehicle(DATA / "px4" / "sih_quadx.yaml") if folder == "px4" else raptor
    paths = sorted(p for p in (DATA / folder).iterdir() if p.suffix in (".csv", ".ulg", ".bin", ".tlog"))
    load_dataset([read_log(path) for path in paths], vehicle)
