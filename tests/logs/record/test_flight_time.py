"""Which seconds of a log are flight: between two rests, whatever the heights, without what stands on the ground."""

from dataclasses import replace

import numpy as np
import pytest

from quadctl.logs.findings import Kind, of_kind
from quadctl.logs.flight_log import FlightLog
from quadctl.logs.record.flight_time import total, usable, without
from quadctl.logs.record.record import examine
from tests.logs.record.conftest import having


def flown(seconds: float = 50.0, rest_s: float = 10.0, after_s: float = 20.0, height_m: float = 1.4) -> FlightLog:
    """A climb, a wave, and a landing, with noise; rotors idle at the ground at a third of their speed."""
    t = np.arange(0.0, rest_s + seconds + after_s, 0.02)
    random = np.random.default_rng(1)
    up = np.clip((t - rest_s) / 3.0, 0.0, 1.0) * np.clip((rest_s + seconds - t) / 3.0, 0.0, 1.0)
    z = up * (height_m + 0.3 * np.sin(0.7 * t)) + 0.003 * random.standard_normal(len(t))
    vz = np.gradient(up * (height_m + 0.3 * np.sin(0.7 * t)), t) + 0.01 * random.standard_normal(len(t))
    north = 0.4 * np.sin(0.9 * t) * (up > 0.5)
    columns = {"time_s": t, "z_m": z, "vz_m_s": vz, "x_m": np.cumsum(north) * 0.02, "vx_m_s": north}
    columns |= {"y_m": 0.01 * random.standard_normal(len(t)), "vy_m_s": 0.01 * random.standard_normal(len(t))}
    pitch = -np.degrees(np.gradient(north, t) / 9.8)
    columns |= {"pitch_deg": pitch + 0.1 * random.standard_normal(len(t))}
    columns |= {name: 0.1 * random.standard_normal(len(t)) for name in ("roll_deg", "yaw_deg")}
    columns |= {f"{name}_rate_rad_s": 0.01 * random.standard_normal(len(t)) for name in ("roll", "pitch", "yaw")}
    working = (t > rest_s) & (t < rest_s + seconds)
    for i in range(1, 5):
        columns[f"motor{i}_rpm"] = np.where(working, 5100.0, 1700.0) + 20.0 * random.standard_normal(len(t))
    return FlightLog("made.csv", None, columns)


def flight_s(log: FlightLog) -> float:
    return examine(log).flight_s


def test_a_flight_lasts_from_take_off_to_landing() -> None:
    record = examine(flown())
    ((begin, end),) = record.flights
    assert begin == pytest.approx(10.2, abs=0.3) and end == pytest.approx(59.8, abs=0.3)
    assert record.usable == ((begin + 2.0, end - 1.5),)
    assert not record.obstacles


@pytest.mark.parametrize(
    "height",
    [
        pytest.param(lambda t: 0.035 * t, id="a barometer that drifts"),
        pytest.param(lambda t: -0.06 * t, id="one that drifts down"),
        pytest.param(lambda t: np.where(t > 40.0, -0.9, 0.0), id="a landing below the take-off"),
        pytest.param(lambda t: np.where(t > 40.0, 1.45, 0.0), id="a landing on a roof as high as the flight"),
        pytest.param(lambda t: -0.5 * np.exp(-np.abs(t - 12.0)), id="a pressure that rises at the take-off"),
        pytest.param(lambda t: 713.0 + 0.0 * t, id="heights above the sea"),
    ],
)
def test_the_ground_has_its_height_at_a_time(height: object) -> None:
    log = flown()
    moved = having(log, z_m=log["z_m"] + height(log.time_s))  # type: ignore[operator]
    assert flight_s(moved) == pytest.approx(flight_s(log), abs=1.5)


def test_ground_that_is_elsewhere_after_a_flight_is_told() -> None:
    log = flown()
    (moved,) = of_kind(examine(having(log, z_m=log["z_m"] + 0.035 * log.time_s)).findings, Kind.GROUND_MOVED)
    assert moved.figures["after_m"] - moved.figures["before_m"] == pytest.approx(0.035 * 50.0, abs=0.15)
    assert not of_kind(examine(log).findings, Kind.GROUND_MOVED)


@pytest.mark.parametrize(("rest_s", "after_s"), [(300.0, 2.0), (2.0, 400.0), (0.0, 0.0)])
def test_time_on_the_ground_does_not_count(rest_s: float, after_s: float) -> None:
    assert flight_s(flown(rest_s=rest_s, after_s=after_s)) == pytest.approx(49.8, abs=0.6)


def test_an_instant_with_idle_rotors_in_the_air_is_flight() -> None:
    log = flown()
    idle = (log.time_s > 30.0) & (log.time_s < 30.5)
    rpm = {f"motor{i}_rpm": np.where(idle, 900.0, log[f"motor{i}_rpm"]) for i in range(1, 5)}
    assert len(examine(having(log, **rpm)).flights) == 1


def test_a_log_that_ends_in_the_air_says_so() -> None:
    record = examine(flown().rows(slice(None, 2500)))
    (ends,) = of_kind(record.findings, Kind.ENDS_IN_AIR)
    assert ends.times_s[0][0] == pytest.approx(50.0, abs=0.1)
    assert not of_kind(examine(flown()).findings, Kind.ENDS_IN_AIR)


def standing(log: FlightLog, begin_s: float, end_s: float, **columns: float) -> FlightLog:
    """The same flight, which stands on the ground between two times, with these values there."""
    stands = (log.time_s > begin_s) & (log.time_s < end_s)
    still = {"z_m": 0.02, "vz_m_s": 0.0, "vx_m_s": 0.0, "vy_m_s": 0.0}
    moved = {name: np.where(stands, value, log[name]) for name, value in {**still, **columns}.items()}
    jitter = 0.01 * np.random.default_rng(3).standard_normal(len(log))
    return having(log, **{name: values + jitter * stands for name, values in moved.items()})


def test_rotors_that_do_not_carry_the_weight_stand_on_the_ground() -> None:
    slow = {f"motor{i}_rpm": 3500.0 for i in range(1, 5)}  # 47 % of the thrust
    record = examine(standing(flown(), 25.0, 33.0, **slow))
    (told,) = of_kind(record.findings, Kind.ON_GROUND)
    assert told.times_s[0] == pytest.approx((25.0, 33.0), abs=0.7)
    assert total(record.usable) == pytest.approx(49.6 - 3.5 - 8.0 - 1.0, abs=1.5)


def test_legs_that_hold_a_tilt_which_was_not_commanded_tell_of_the_ground() -> None:
    """With 85 % of the thrust, and a command to lean and to move."""
    log = flown()
    commanded = having(log, pitch_cmd_deg=log["pitch_deg"].copy(), roll_cmd_deg=log["roll_deg"].copy())
    slow = {f"motor{i}_rpm": 4700.0 for i in range(1, 5)}
    contact = standing(commanded, 25.0, 33.0, pitch_cmd_deg=-12.0, pitch_deg=0.5, roll_deg=0.4, **slow)
    (told,) = of_kind(examine(contact).findings, Kind.ON_GROUND)
    assert told.times_s[0] == pytest.approx((25.0, 33.0), abs=0.8)


def test_rotors_that_run_on_after_a_touchdown_are_no_flight() -> None:
    """Seven seconds at 85 % of the thrust, on ground whose height has drifted by 0.6 m."""
    slow = {f"motor{i}_rpm": 4700.0 for i in range(1, 5)}
    log = standing(flown(after_s=10.0), 53.0, 60.0, **slow)
    record = examine(having(log, z_m=log["z_m"] + np.clip(log.time_s - 53.0, 0.0, None) * 0.09))
    assert record.flights[-1][1] == pytest.approx(53.0, abs=0.7)


def test_a_log_that_begins_while_the_rotors_spin_up_begins_on_the_ground() -> None:
    """It has no rest: the first row has 60 % of the thrust already."""
    log = flown().rows(slice(500, None))
    t = log.time_s - log.time_s[0]
    share = np.clip(0.6 + 0.1 * t, 0.0, 1.0)
    rpm = {f"motor{i}_rpm": log[f"motor{i}_rpm"] * np.sqrt(np.where(t < 4.0, share, 1.0)) for i in range(1, 5)}
    log = having(log, **rpm, z_m=np.where(t < 4.0, 0.0, log["z_m"]) + 0.001 * np.sin(9.0 * t))
    log = having(log, vz_m_s=np.where(t < 4.0, 0.0, log["vz_m_s"]), vx_m_s=np.where(t < 4.0, 0.0, log["vx_m_s"]))
    assert examine(log).flights[0][0] - log.time_s[0] == pytest.approx(3.4, abs=0.7)


def test_a_hover_in_ground_effect_is_flight() -> None:
    """Near the ground three quarters of the thrust carry the vehicle, which obeys."""
    log = flown()
    low = (log.time_s > 25.0) & (log.time_s < 35.0)
    z = np.where(low, 0.08, log["z_m"]) + 0.003 * np.random.default_rng(5).standard_normal(len(log))
    rpm = {f"motor{i}_rpm": np.where(low, 0.87 * log[f"motor{i}_rpm"], log[f"motor{i}_rpm"]) for i in range(1, 5)}
    record = examine(having(log, z_m=z, vz_m_s=np.where(low, 0.0, log["vz_m_s"]) + 1e-3 * z, **rpm))
    assert not of_kind(record.findings, Kind.ON_GROUND)


def test_a_position_held_in_a_steady_wind_is_flight() -> None:
    """It leans by 12 degrees all the time, without speeding up."""
    log = flown()
    leaning = having(log, pitch_deg=log["pitch_deg"] - 12.0 * (log["z_m"] > 0.2))
    assert not of_kind(examine(leaning).findings, Kind.ON_GROUND)


def test_parts_are_cut_out_of_stretches_of_time() -> None:
    assert without([(0.0, 10.0), (20.0, 30.0)], [(5.0, 22.0), (29.0, 40.0)]) == ((0.0, 5.0), (22.0, 29.0))
    assert usable([(0.0, 10.0), (20.0, 22.0)], [(4.0, 5.0)]) == ((2.0, 4.0), (5.0, 8.5))


def test_phases_of_our_own_logs_that_fly_no_mission_are_left_out() -> None:
    log = flown()
    phase = np.where(log.time_s > 40.0, "land", "hover")
    assert examine(replace(log, phase=phase)).flights[-1][1] == pytest.approx(40.0, abs=0.1)
