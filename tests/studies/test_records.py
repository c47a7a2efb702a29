"""Records that are wrong: each distortion of a log does what it says, by its size, and nothing else."""

import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest

from studies.worlds.borrowed.cases import Case, roam
from studies.worlds.borrowed.records import (
    ATTITUDE,
    IMU,
    PLACE,
    RATES,
    VELOCITY,
    Flaws,
    between_packets,
    commanded,
    cut,
    delayed,
    distorted,
    draw_flaws,
    lagged,
    leaning,
    metered,
    repeated,
    shaken,
    turned,
    wandering,
)
from studies.worlds.borrowed.sensors import Columns

T = np.arange(0.0, 60.0, 0.02)
RATE = 2.0
"""Angular rate of the motion, rad/s."""


def log() -> Columns:
    """Log of a motion by sines, with a heading that passes 180 degrees, and a battery that sinks."""
    out: Columns = {"time_s": T}
    for i, name in enumerate((*PLACE, *VELOCITY, *ATTITUDE[:2], *RATES)):
        out[name] = (i + 1.0) * np.sin(RATE * T + i)
    out["yaw_deg"] = np.mod(170.0 + 3.0 * T + 180.0, 360.0) - 180.0
    out |= {name: np.full(len(T), value) for name, value in zip(IMU, (0.5, -0.4, -9.6), strict=True)}
    return out | {"throttle_cmd": np.full(len(T), 0.4), "battery_v": 12.4 - 0.02 * T}


def only(before: Columns, after: Columns, names: tuple[str, ...]) -> bool:
    """True where these columns are changed, and no other."""
    return {name for name in before if not np.array_equal(before[name], after[name])} == set(names)


def rng() -> np.random.Generator:
    return np.random.default_rng(4)


def test_a_filter_delays_and_weakens_a_wave_as_a_pole_does() -> None:
    before = log()
    after = lagged(before, VELOCITY, 0.12)
    assert only(before, after, VELOCITY)
    late = np.arctan(RATE * 0.12)
    expected = 5.0 / np.hypot(1.0, RATE * 0.12) * np.sin(RATE * T + 4 - late)
    assert after["vy_m_s"][100:] == pytest.approx(expected[100:], abs=0.03)


def test_a_delay_shows_each_value_later_and_the_heading_across_its_end() -> None:
    before = log()
    after = delayed(before, (*PLACE, *ATTITUDE), np.full(len(T), 0.07))
    assert only(before, after, (*PLACE, *ATTITUDE))
    assert after["y_m"][10:] == pytest.approx(2.0 * np.sin(RATE * (T[10:] - 0.07) + 1), abs=2e-3)
    turn = np.mod(before["yaw_deg"] - after["yaw_deg"] + 180.0, 360.0) - 180.0
    assert turn[10:] == pytest.approx(3.0 * 0.07, abs=1e-6)
    early = delayed(before, PLACE, np.full(len(T), -0.04))
    assert early["x_m"][:-10] == pytest.approx(np.sin(RATE * (T[:-10] + 0.04)), abs=2e-3)


def test_a_delay_wanders_slowly_about_its_mean_by_its_amplitude() -> None:
    delay = wandering(T, 0.05, 0.03, rng())
    assert delay.max() == pytest.approx(0.08, abs=2e-3) and delay.min() == pytest.approx(0.02, abs=2e-3)
    assert np.abs(np.gradient(delay, T)).max() < 0.03 * 2 * np.pi / 25.0
    assert wandering(T, 0.05, 0.0, rng()) == pytest.approx(0.05)


def test_an_attitude_error_by_place_is_the_same_at_the_same_place_smooth_and_of_its_size() -> None:
    before = log()
    walk = np.cumsum(np.random.default_rng(1).normal(0.0, 0.3, (len(T), 3)), axis=0)
    before |= dict(zip(PLACE, walk.T, strict=True))
    after = leaning(before, 1.1, 1.5, rng())
    assert only(before, after, ATTITUDE[:2])
    error = after["pitch_deg"] - before["pitch_deg"]
    assert np.std(error) == pytest.approx(1.1, rel=0.25) and np.mean(error) == pytest.approx(0.0, abs=1e-9)
    there = before | {name: np.roll(before[name], 500) for name in PLACE}
    again = leaning(there, 1.1, 1.5, rng())
    assert again["pitch_deg"] - there["pitch_deg"] == pytest.approx(np.roll(error, 500), abs=1e-9)
    near = before | {"x_m": before["x_m"] + 0.05}
    change = leaning(near, 1.1, 1.5, rng())["pitch_deg"] - after["pitch_deg"]
    assert 0.0 < np.abs(change).max() < 0.05 / 1.5 * 1.1 * 5.0


def test_a_heading_drifts_from_zero_to_no_more_than_its_size() -> None:
    before = log()
    after = turned(before, -4.0, rng())
    assert only(before, after, ("yaw_deg",))
    error = np.mod(after["yaw_deg"] - before["yaw_deg"] + 180.0, 360.0) - 180.0
    assert error[0] == pytest.approx(0.0, abs=1e-9)
    assert -4.0 <= error.min() < -1.6 and error.max() <= 1.2
    assert np.all(np.abs(after["yaw_deg"]) <= 180.0)


def test_accelerometers_get_bias_scale_and_noise_where_there_are_any() -> None:
    flaws = Flaws((), accelerometer_bias_m_s2=(0.1, -0.2, 0.15), accelerometer_scale=(0.02, 0.01, -0.01))
    before = log()
    still = shaken(before, flaws, rng())
    assert only(before, still, IMU)
    assert [still[name][0] for name in IMU] == pytest.approx([0.61, -0.604, -9.354])
    loud = shaken(before, dataclasses.replace(flaws, vibration_m_s2=1.2), rng())["imu_y_m_s2"]
    assert np.std(loud) == pytest.approx(1.2, rel=0.05) and np.mean(loud) == pytest.approx(-0.604, abs=0.08)
    assert abs(np.corrcoef(loud[1:], loud[:-1])[0, 1]) < 0.06
    without = {name: values for name, values in before.items() if name not in IMU}
    assert shaken(without, flaws, rng()).keys() == without.keys()


def test_a_command_grows_as_the_battery_sinks_by_the_power_of_the_voltage() -> None:
    before = log()
    after = commanded(before, 1.5)
    assert only(before, after, ("throttle_cmd",))
    assert after["throttle_cmd"][-1] == pytest.approx(0.4 * (12.396 / 11.2004) ** 1.5, rel=1e-3)
    assert commanded(before, 0.0) is before


def test_a_battery_is_read_late_off_and_in_steps() -> None:
    before = log()
    flaws = Flaws((), battery_lag_s=3.0, battery_noise=0.004, battery_offset=0.02, battery_step=0.006)
    after = metered(before, flaws, rng())
    assert only(before, after, ("battery_v",))
    nominal = np.median(before["battery_v"])
    steps = after["battery_v"] / (0.006 * nominal)
    assert steps == pytest.approx(np.round(steps), abs=1e-6)
    # A ramp through a pole is late by its time constant.
    error = (after["battery_v"] - before["battery_v"])[T > 15.0]
    assert np.mean(error) == pytest.approx(0.02 * nominal + 0.02 * 3.0, abs=0.01)
    assert np.std(error) == pytest.approx(nominal * np.hypot(0.004, 0.006 / np.sqrt(12.0)), rel=0.1)


def test_rows_between_packets_lie_on_straight_lines() -> None:
    before = log()
    after = between_packets(before, (*PLACE, "yaw_deg"), 3)
    assert only(before, after, (*PLACE, "yaw_deg"))
    assert np.array_equal(after["z_m"][::3], before["z_m"][::3])
    bend = np.diff(after["z_m"], 2)
    assert np.abs(bend[0::3]).max() < 1e-12 < np.abs(bend[2::3]).max()
    turn = np.mod(after["yaw_deg"] - before["yaw_deg"] + 180.0, 360.0) - 180.0
    assert turn[:-3] == pytest.approx(0.0, abs=1e-9)


def test_repeated_packets_hold_all_their_columns_at_once_by_their_share() -> None:
    before = log()
    after = repeated(before, (*PLACE, *VELOCITY), 0.15, rng())
    assert only(before, after, (*PLACE, *VELOCITY))
    same = np.diff(after["x_m"]) == 0.0
    assert np.mean(same) == pytest.approx(0.15, abs=0.02)
    assert np.array_equal(same, np.diff(after["vz_m_s"]) == 0.0)


def test_gaps_take_rows_out_by_their_lengths() -> None:
    before = log()
    after = cut(before, (0.8, 0.3), np.random.default_rng(1))
    steps = np.sort(np.diff(after["time_s"]))
    assert steps[-2:] == pytest.approx([0.32, 0.82], abs=0.021) and steps[-3] == pytest.approx(0.02)
    assert len({len(values) for values in after.values()}) == 1


def test_flaws_are_several_at_once_of_the_sizes_of_real_logs_and_the_equipment_is_the_same_in_all_flights() -> None:
    drawn = [
        draw_flaws(2, outdoors=False, radius_m=0.1, by_voltage=i == 0, rng=np.random.default_rng(i)) for i in range(80)
    ]
    first = [flaws[0] for flaws in drawn]
    assert all(-0.04 <= f.delay_s <= 0.08 and f.heading_deg == 0.0 for f in first)
    assert {f.velocity_lag_s > 0 for f in first} == {True, False}
    assert all(f.velocity_lag_s == 0 or 0.05 <= f.velocity_lag_s <= 0.15 for f in first)
    sizes = [np.linalg.norm(f.accelerometer_bias_m_s2) for f in first if any(f.accelerometer_bias_m_s2)]
    assert 30 < len(sizes) < 65 and min(sizes) >= 0.05 and max(sizes) <= 0.3
    assert max(abs(f.datum_m) for f in first) <= 0.05
    assert all(a.lean_deg == b.lean_deg and a.between == b.between for a, b in drawn)
    assert any(a.delay_s != b.delay_s for a, b in drawn)
    assert "battery_sag" in first[0].also and not any("battery_sag" in f.also for f in first[1:])
    assert all(("imu_bias" in f.also) == any((*f.accelerometer_bias_m_s2, *f.accelerometer_scale)) for f in first)
    outdoors = draw_flaws(40, outdoors=True, radius_m=0.1, by_voltage=False, rng=rng())
    assert all(f.lean_deg == 0.0 and not set(ATTITUDE) & set(f.pose) for f in outdoors)
    assert 1.0 <= max(abs(f.heading_deg) for f in outdoors) <= 5.0


def test_without_a_flaw_a_log_stays_as_it_is_and_a_datum_moves_the_height() -> None:
    before = log()
    after = distorted(before, Flaws((*PLACE, *VELOCITY)), 1, rng())
    assert all(after[name] == pytest.approx(before[name], abs=1e-9) for name in before)
    high = distorted(before, Flaws(PLACE, datum_m=0.04), 1, rng())
    assert high["z_m"] - before["z_m"] == pytest.approx(0.04)


@pytest.mark.long
def test_a_world_of_wrong_records_flies_as_the_ordinary_one_and_tells_its_flaws(tmp_path: Path) -> None:
    worlds = pytest.importorskip("studies.worlds.borrowed.__main__", exc_type=ImportError)
    case = Case("clean", "cf21B_500", (roam(8.0, 1.0, 1.0, 2.0),), source="throttle")
    for folder, wrong in (("a", True), ("b", True), ("plain", False)):
        worlds.make_case(worlds.SIMULATORS["drone_models"], case, [1.0], 3, [tmp_path / folder], wrong)
    a, b, plain = (tmp_path / folder / "clean" for folder in ("a", "b", "plain"))
    assert all((a / path.name).read_bytes() == path.read_bytes() for path in b.iterdir())
    assert (a / "vehicle.yaml").read_bytes() == (plain / "vehicle.yaml").read_bytes()
    assert (a / "flight1.csv").read_bytes() != (plain / "flight1.csv").read_bytes()
    assert "imu_x_m_s2" in (a / "flight1.csv").read_text().partition("\n")[0]
    truth, ordinary = (json.loads((folder / "truth.json").read_text()) for folder in (a, plain))
    assert truth["families"] == [] and len(truth["records"]) == 1 and set(truth["also"]) <= {"imu_bias"}
    assert "records" not in ordinary and "also" not in ordinary
