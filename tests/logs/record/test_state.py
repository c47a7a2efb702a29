"""Jumps, resets, lost control, clocks and witnesses: what the record does wrong is told, and taken for no physics."""

from dataclasses import replace

import numpy as np
import pytest

from quadctl.frames import euler_from_quaternion, multiply, quaternion_from_euler
from quadctl.logs.findings import Kind, finding, of_kind
from quadctl.logs.flight_log import ATTITUDE, IMU, POSITION, RATES, VELOCITY, FlightLog
from quadctl.logs.record.copies import copies, without_copies
from quadctl.logs.record.heading import heading_error
from quadctl.logs.record.record import examine
from tests.logs.record.conftest import Change, added, having, turned, with_imu


def kinds(log: FlightLog) -> set[Kind]:
    return {found.kind for found in examine(log).findings}


def during(log: FlightLog, begin_s: float, end_s: float) -> np.ndarray:
    return (log.time_s >= begin_s) & (log.time_s < end_s)


def test_a_sound_flight_has_no_findings(excited: FlightLog, hovering: FlightLog) -> None:
    assert kinds(excited) == set() and kinds(hovering) == set()


# --- jumps ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "size", "lasts_s", "quantity"),
    [
        ("z_m", 5270.0, 0.06, "height"),
        ("z_m", -1.3, 2.5, "height"),
        ("x_m", 30.0, 0.5, "horizontal position"),
        ("vy_m_s", 25.0, 0.3, "velocity"),
    ],
)
def test_a_value_that_leaves_and_comes_back_is_left_out(
    excited: FlightLog, name: str, size: float, lasts_s: float, quantity: str
) -> None:
    wrong = during(excited, 30.0, 30.0 + lasts_s)
    record = examine(added(excited, name, size * wrong))
    spikes = {found.figures["of"]: found for found in of_kind(record.findings, Kind.SPIKE)}
    assert quantity in spikes
    assert spikes[quantity].figures["largest"] == pytest.approx(size, rel=0.1)
    assert np.isnan(record.log[name][wrong]).mean() > 0.9
    assert not record.obstacles


@pytest.mark.parametrize(("name", "size", "quantity"), [("z_m", 0.72, "height"), ("x_m", 4.0, "horizontal position")])
def test_a_jump_that_stays_is_a_reset(excited: FlightLog, name: str, size: float, quantity: str) -> None:
    record = examine(added(excited, name, size * (excited.time_s > 30.0)))
    (reset,) = of_kind(record.findings, Kind.RESET)
    assert (reset.figures["of"], reset.figures["by"]) == (quantity, [pytest.approx(size, rel=0.1)])
    assert reset.times_s[0][0] == pytest.approx(30.0, abs=0.05)
    assert all(end < 30.0 or begin > 30.0 for begin, end in record.usable)


def test_a_reset_that_the_estimator_says_and_the_state_shows_is_one(excited: FlightLog) -> None:
    said = [finding(Kind.RESET, [(29.9, 29.9)], of="height"), finding(Kind.RESET, [(45.0, 45.0)], of="velocity")]
    found = of_kind(examine(replace(added(excited, "z_m", excited.time_s > 30.0), findings=said)).findings, Kind.RESET)
    assert [(one.figures["of"], one.figures["by"]) for one in found] == [
        ("height", [pytest.approx(1.0, rel=0.1)]),
        ("velocity", [0]),
    ]


# --- heading ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("degrees", [35.0, -120.0])
@pytest.mark.parametrize("wrong", ["before", "after"])
def test_the_side_of_a_heading_reset_that_does_not_fit_the_motion_is_turned(
    excited: FlightLog, degrees: float, wrong: str
) -> None:
    """The motion tells the heading: a vehicle speeds up to where it leans."""
    of_side = excited.time_s < 35.0 if wrong == "before" else excited.time_s >= 35.0
    yaw = (excited["yaw_deg"] + degrees * of_side + 180.0) % 360.0 - 180.0
    record = examine(having(excited, yaw_deg=yaw))
    (reset,) = of_kind(record.findings, Kind.RESET)
    assert reset.figures["done"] == f"turned {wrong}"
    assert abs(reset.figures["by"][0]) == pytest.approx(abs(degrees), abs=2.0)
    off = (record.log["yaw_deg"] - excited["yaw_deg"] + 180.0) % 360.0 - 180.0
    assert np.abs(off).max() < 2.0


def test_where_the_motion_does_not_tell_the_estimator_is_believed(hovering: FlightLog) -> None:
    at = float(hovering.time_s[len(hovering) // 2])
    record = examine(added(hovering, "yaw_deg", 50.0 * (hovering.time_s < at)))
    (reset,) = of_kind(record.findings, Kind.RESET)
    assert reset.figures["done"] == "left out before"
    assert record.usable[0][0] > at


@pytest.mark.parametrize("degrees", [12.0, -75.0])
def test_a_heading_that_is_off_all_the_time_is_found_and_corrected(excited: FlightLog, degrees: float) -> None:
    record = examine(having(excited, yaw_deg=turned(excited, degrees)["yaw_deg"]))
    (off,) = of_kind(record.findings, Kind.HEADING_OFF)
    assert off.figures["by_deg"] == pytest.approx(degrees, abs=3.0 * off.figures["std_deg"] + 1.0)
    assert heading_error(record.log, record.usable).angle_deg == pytest.approx(0.0, abs=1.0)


# --- control ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("change", "why"),
    [
        (lambda log: added(log, "roll_deg", 130.0 * during(log, 40.0, 90.0)), "upside down"),
        (lambda log: added(log, "pitch_cmd_deg", -40.0 * during(log, 40.0, 90.0)), "attitude not as commanded"),
        (
            lambda log: having(
                log,
                motor3_output=np.where(during(log, 40.0, 90.0), 1.0, log["motor3_output"]),
                yaw_rate_rad_s=log["yaw_rate_rad_s"] + 4.0 * during(log, 41.5, 90.0),
            ),
            "motor at its limit",
        ),
        (
            lambda log: replace(log, meta={"events": [{"time_s": 40.0, "what": "Crash: Disarming: AngErr=58>30"}]}),
            "said by the autopilot",
        ),
        (
            lambda log: replace(log, meta={"events": [{"time_s": 40.0, "what": "Attitude failure detected"}]}),
            "said by the autopilot",
        ),
    ],
)
def test_nothing_is_used_from_the_moment_on_at_which_control_is_lost(
    excited: FlightLog, change: Change, why: str
) -> None:
    record = examine(change(excited))
    (lost,) = of_kind(record.findings, Kind.OUT_OF_CONTROL)
    assert lost.figures["why"] == why
    assert lost.times_s[0][0] == pytest.approx(40.0, abs=0.1)
    assert record.usable[-1][1] == pytest.approx(38.5, abs=0.2)


@pytest.mark.parametrize(
    "change",
    [
        lambda log: having(log, motor3_output=np.where(during(log, 40.0, 46.0), 1.0, log["motor3_output"])),
        lambda log: added(log, "roll_deg", 130.0 * during(log, 40.0, 40.1)),
        lambda log: added(log, "pitch_cmd_deg", -40.0 * during(log, 40.0, 40.4)),
        lambda log: replace(log, meta={"events": [{"time_s": 40.0, "what": "Crash dump disabled"}]}),
        lambda log: replace(log, meta={"events": [{"time_s": 40.0, "what": "mode LOITER"}]}),
    ],
)
def test_a_glitch_or_another_message_is_no_loss_of_control(excited: FlightLog, change: Change) -> None:
    assert Kind.OUT_OF_CONTROL not in kinds(change(excited))


# --- channels ---------------------------------------------------------------------------------------------------------


def test_a_battery_of_a_tenth_of_a_volt_is_not_read(excited: FlightLog) -> None:
    record = examine(having(excited, battery_v=0.1 + 0.001 * np.sin(excited.time_s)))
    assert [dead.figures["channel"] for dead in of_kind(record.findings, Kind.DEAD_CHANNEL)] == ["battery_v"]
    assert "battery_v" not in record.log.columns


@pytest.mark.parametrize(
    ("name", "value"),
    [("pitch_rate_rad_s", 900.0), ("motor2_output", 31.0), ("imu_x_m_s2", 2e4), ("throttle_cmd", -7.0)],
)
def test_values_beyond_any_sensor_or_motor_are_missing(excited: FlightLog, name: str, value: float) -> None:
    wrong = during(excited, 20.0, 20.5)
    record = examine(having(excited, **{name: np.where(wrong, value, excited[name])}))
    (impossible,) = of_kind(record.findings, Kind.IMPOSSIBLE_VALUES)
    assert (impossible.figures["column"], impossible.figures["values"]) == (name, int(wrong.sum()))


# --- time -------------------------------------------------------------------------------------------------------------


def resampled(log: FlightLog, names: tuple[str, ...], every_s: float, jitter_s: float = 0.0) -> FlightLog:
    """The log whose channel comes in packets, between which a program drew straight lines."""
    packets = np.arange(log.time_s[0], log.time_s[-1], every_s)
    packets = np.sort(packets + jitter_s * np.random.default_rng(0).standard_normal(len(packets)))
    drawn = {name: np.interp(log.time_s, packets, np.interp(packets, log.time_s, log[name])) for name in names}
    return having(log, **drawn)


@pytest.mark.parametrize(("every_s", "at_most"), [(0.2, 12.0), (0.05, 40.0), (0.045, 45.0)])
def test_rows_that_were_drawn_between_packets_do_not_count(excited: FlightLog, every_s: float, at_most: float) -> None:
    record = examine(resampled(excited, IMU, every_s, 0.1 * every_s))
    (drawn,) = of_kind(record.findings, Kind.INTERPOLATED)
    assert drawn.figures["channel"] == "imu"
    assert 0.8 / every_s < drawn.figures["at_most_hz"] < at_most


def test_a_channel_that_follows_a_straight_line_for_ever_was_lost(excited: FlightLog) -> None:
    """A program that goes on with the last slope: outputs reach millions, rates thousands."""
    t, columns = excited.time_s, {}
    lost = t > 40.0
    for name in (*RATES, *IMU):
        slope = 3.0 if name in RATES else -20.0
        columns[name] = np.where(lost, excited[name][~lost][-1] + slope * (t - 40.0), excited[name])
    record = examine(having(excited, **columns))
    told = {found.figures["channel"]: found.times_s[0][0] for found in of_kind(record.findings, Kind.EXTRAPOLATED)}
    assert told == {"rates": pytest.approx(40.0, abs=0.1), "imu": pytest.approx(40.0, abs=0.1)}
    assert np.isnan(record.log["roll_rate_rad_s"][t > 40.1]).all()


def test_smooth_motion_without_noise_was_not_drawn(excited: FlightLog) -> None:
    """A simulation may fly straight at a constant speed for seconds."""
    t = excited.time_s
    smooth = having(excited, x_m=np.clip(0.7 * (t - 20.0), 0.0, 9.0), vx_m_s=np.where(abs(t - 26.4) < 6.4, 0.7, 0.0))
    assert not {Kind.INTERPOLATED, Kind.EXTRAPOLATED} & kinds(smooth)


@pytest.mark.parametrize("middle_s", [0.0, 0.03])
def test_a_delay_that_wanders_is_found_told_and_taken_out(excited: FlightLog, middle_s: float) -> None:
    t = excited.time_s
    delay = middle_s + 0.04 * np.sin(2.0 * np.pi * t / 35.0)
    late = having(excited, **{name: np.interp(t - delay, t, excited[name]) for name in (*RATES, *IMU)})
    record = examine(late)
    (told,) = of_kind(record.findings, Kind.DELAY)
    assert told.figures["least_s"] == pytest.approx(middle_s - 0.04, abs=0.012)
    assert told.figures["most_s"] == pytest.approx(middle_s + 0.04, abs=0.012)
    inside = during(record.log, 15.0, 60.0)

    def off(log: FlightLog) -> float:
        both = inside & np.isfinite(log["pitch_rate_rad_s"])
        return float(np.std((log["pitch_rate_rad_s"] - excited["pitch_rate_rad_s"])[both]))

    assert off(record.log) < 0.5 * off(late)


def test_a_constant_delay_under_noise_does_not_wander(excited: FlightLog) -> None:
    t, rng = excited.time_s, np.random.default_rng(3)
    late = {name: np.interp(t - 0.02, t, excited[name]) for name in (*RATES, *IMU)}
    noisy = {name: excited[name] + rng.normal(0.0, 0.4, len(t)) for name in ATTITUDE}
    (told,) = of_kind(examine(having(excited, **late, **noisy)).findings, Kind.DELAY)
    assert told.figures["least_s"] == told.figures["most_s"] == pytest.approx(0.02, abs=0.004)


def test_a_clock_that_jumps_ahead_in_flight_is_told(excited: FlightLog) -> None:
    """The vehicle flies at 1 m/s or more there, and stands where it was before the jump."""
    fast = np.hypot(excited["vx_m_s"], excited["vy_m_s"])
    at = float(excited.time_s[int(np.argmax(fast))])
    record = examine(having(excited, time_s=excited.time_s + 0.8 * (excited.time_s > at)))
    (jump,) = of_kind(record.findings, Kind.CLOCK_JUMP)
    assert jump.figures["by_s"] == [pytest.approx(0.8, abs=0.05)]


# --- witnesses --------------------------------------------------------------------------------------------------------


def test_a_height_that_is_wrong_with_speed_is_the_odd_witness(excited: FlightLog) -> None:
    """A barometer in fast flight: 0.3 m per (m/s)^2, in height and climb rate."""
    wrong = 0.3 * (excited["vx_m_s"] ** 2 + excited["vy_m_s"] ** 2)
    record = examine(
        having(excited, z_m=excited["z_m"] - wrong, vz_m_s=excited["vz_m_s"] - np.gradient(wrong, excited.time_s))
    )
    (odd,) = of_kind(record.findings, Kind.WITNESSES_DISAGREE)
    assert (odd.figures["odd"], odd.figures["axes"]) == ("velocity", ["up"])
    assert record.velocity_doubted == ("up",)


@pytest.mark.parametrize(
    "change",
    [
        pytest.param(
            lambda log: added(log, "imu_x_m_s2", 4.0 * np.sin(2.1 * log.time_s) * (log.time_s > 30.0)), id="it swings"
        ),
        pytest.param(lambda log: added(log, "imu_z_m_s2", 2.0 * np.sin(0.9 * log.time_s)), id="clipped by vibration"),
    ],
)
def test_an_accelerometer_that_follows_neither_velocity_nor_thrust_is_the_odd_witness(
    excited: FlightLog, change: Change
) -> None:
    record = examine(change(excited))
    (odd,) = of_kind(record.findings, Kind.WITNESSES_DISAGREE)
    assert odd.figures["odd"] == "imu"
    assert not any(name in record.log.columns for name in IMU)


def test_an_attitude_that_is_off_by_place_is_the_odd_witness(excited: FlightLog) -> None:
    """It turns accelerometer and thrust alike: across the thrust these two agree, in the body."""
    off = added(added(excited, "roll_deg", 2.0 * np.sin(excited["x_m"] / 0.8 + 0.4)), "pitch_deg", 1.3)
    record = examine(added(off, "pitch_deg", 2.0 * np.cos(excited["y_m"] / 0.6 + excited["x_m"])))
    (odd,) = of_kind(record.findings, Kind.WITNESSES_DISAGREE)
    assert odd.figures["odd"] == "attitude"
    assert record.velocity_doubted == ("north", "east")
    assert all(name in record.log.columns for name in IMU)


@pytest.mark.parametrize("lag_s", [0.06, 0.14])
def test_a_velocity_that_lags_is_no_disagreement(excited: FlightLog, lag_s: float) -> None:
    share, late = 1.0 - np.exp(-np.diff(excited.time_s) / lag_s), {}
    for name in VELOCITY:
        late[name] = excited[name].copy()
        for i, part in enumerate(share, start=1):
            late[name][i] = late[name][i - 1] + part * (excited[name][i] - late[name][i - 1])
    assert Kind.WITNESSES_DISAGREE not in kinds(having(excited, **late))


@pytest.mark.parametrize(("every", "size_m_s2", "gap_s"), [(5, 0.8, 0.0), (2, 1.5, 0.9)])
def test_vibration_is_no_disagreement_and_hides_none(
    excited: FlightLog, every: int, size_m_s2: float, gap_s: float
) -> None:
    random = np.random.default_rng(3)
    log = excited.rows(slice(None, None, every))
    for name in IMU:
        log = added(log, name, size_m_s2 * random.standard_normal(len(log)))
    assert Kind.WITNESSES_DISAGREE not in kinds(log.rows(log.time_s % 17.0 >= gap_s))
    (odd,) = of_kind(
        examine(added(log, "imu_z_m_s2", 2.0 * np.sin(0.9 * log.time_s))).findings, Kind.WITNESSES_DISAGREE
    )
    assert odd.figures["odd"] == "imu"


def test_an_offset_of_the_accelerometer_is_no_disagreement(excited: FlightLog) -> None:
    assert Kind.WITNESSES_DISAGREE not in kinds(added(added(excited, "imu_x_m_s2", 0.4), "imu_z_m_s2", -0.3))


def test_an_offset_that_turns_with_the_heading_is_no_disagreement(excited: FlightLog) -> None:
    """At 45 degrees a second it comes back after 8 s, as quick as a manoeuvre in the world."""
    heading = np.radians(45.0) * excited.time_s
    attitude = quaternion_from_euler(*(np.radians(excited[name]) for name in ATTITUDE))
    turning = multiply(attitude, quaternion_from_euler(0.0 * heading, 0.0 * heading, heading))
    p, q, r = (excited[name] for name in RATES)
    c, s = np.cos(heading), np.sin(heading)
    rates = (c * p + s * q, c * q - s * p, r + np.radians(45.0))
    angles = np.degrees(euler_from_quaternion(turning))
    columns = dict(zip((*ATTITUDE, *RATES), (*angles, *rates), strict=True))
    flight = with_imu(having(excited, **columns))
    off = examine(added(added(flight, "imu_x_m_s2", 0.5), "imu_y_m_s2", -0.4))
    assert not of_kind(off.findings, Kind.WITNESSES_DISAGREE)
    assert all(name in off.log.columns for name in IMU)


# --- copies -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "change",
    [
        lambda log: replace(log, name="b.csv"),
        lambda log: having(log, time_s=log.time_s + 1.7e9),
        lambda log: log.rows(slice(600, -900)),
        lambda log: log.rows(slice(None, None, 3)),
        lambda log: replace(log, columns={name: np.round(values, 3) for name, values in log.columns.items()}),
        lambda log: replace(
            log, columns={name: values.astype(np.float32).astype(float) for name, values in log.columns.items()}
        ),
    ],
)
def test_the_same_flight_under_another_name_is_a_copy(excited: FlightLog, hovering: FlightLog, change: Change) -> None:
    assert copies([excited, hovering, change(excited)]) == [(0, 2)]
    kept = without_copies([excited, hovering, replace(change(excited), name="b.csv")])
    assert [log.name for log in kept] == [excited.name, hovering.name]
    assert [copy.figures["other"] for copy in of_kind(kept[0].findings, Kind.COPY)] == ["b.csv"]


def test_the_same_mission_flown_again_is_no_copy(excited: FlightLog) -> None:
    random = np.random.default_rng(2)
    noise = {name: excited[name] + 0.002 * random.standard_normal(len(excited)) for name in (*POSITION, *VELOCITY)}
    tilt = {name: excited[name] + 0.05 * random.standard_normal(len(excited)) for name in ATTITUDE}
    assert copies([excited, having(excited, **noise, **tilt)]) == []
