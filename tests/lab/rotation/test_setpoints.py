"""Rotation of logs whose outputs are slow: from the setpoints of torque and thrust, filled in by the gyro."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from quadctl.errors import LogError
from quadctl.lab.rotation.commands import fit_mixer
from quadctl.lab.rotation.innovations import held_response
from quadctl.lab.rotation.parameters import AXES, Rotation, fit_axis, fit_rotation, known_lag, together
from quadctl.lab.rotation.records import AROUND_S, Record, records_of
from quadctl.lab.rotation.unseen import flown_of
from quadctl.lab.rotation.value import Value
from quadctl.logs.columns import TORQUE
from quadctl.logs.flight_log import ATTITUDE, POSITION, VELOCITY, FlightLog
from quadctl.logs.read import read_imu_log
from quadctl.model import load_model
from tests.lab.rotation.logged_loop import STEP_S, VEHICLE, Truth, flight, mixer
from tests.support.commands import Result
from tests.support.places import DATA

TRUTH = Truth()


@pytest.fixture(scope="module")
def log() -> FlightLog:
    return flight(TRUTH, 3)


@pytest.fixture(scope="module")
def records() -> list[Record]:
    return [record for seed in (3, 4, 5) for record in records_of(flight(TRUTH, seed), VEHICLE)]


@pytest.fixture(scope="module")
def found(records: list[Record]) -> Rotation:
    return fit_rotation(records, VEHICLE)


class TestSetpoints:
    def test_gain_lag_and_damping_lie_in_their_intervals(self, found: Rotation) -> None:
        for i, axis in enumerate(AXES):
            told = found.told(axis)
            assert told["slope"].low < TRUTH.slope[i] * found.hover / TRUTH.hover < told["slope"].high
            assert told["damping_1_s"].low < TRUTH.damping_1_s < told["damping_1_s"].high
        for i, axis in enumerate(AXES[:2]):
            told = found.told(axis)
            assert told["slope"].high - told["slope"].low < 0.3 * TRUTH.slope[i]
            assert told["lag_s"].low < TRUTH.lag_s < told["lag_s"].high
        assert found.lag is not None
        assert found.lag.low < TRUTH.lag_s < found.lag.high < found.lag.low + 0.03

    def test_commands_in_straight_lines_between_their_samples_miss_lag_and_damping(
        self, records: list[Record], found: Rotation
    ) -> None:
        """As they would be without the gyro."""
        made = []
        for record in records:
            every = np.arange(len(record.drive))
            straight = [np.interp(every, every[::5], column[::5]) for column in record.drive.T]
            made.append(replace(record, drive=np.column_stack(straight)))
        wrong = fit_axis(made, VEHICLE, 0, found.hover, found.thrust).values
        assert not wrong["lag_s"].low < TRUTH.lag_s < wrong["lag_s"].high
        assert not wrong["damping_1_s"].low < TRUTH.damping_1_s < wrong["damping_1_s"].high

    def test_the_output_of_level_hover_lies_in_its_interval(self, found: Rotation) -> None:
        assert found.level is not None
        assert found.level.low < TRUTH.hover < found.level.high < found.level.low + 0.03

    def test_the_rotors_own_commands_are_told_with_intervals(self, found: Rotation) -> None:
        """The trim torques show in the commands; yaw's is the largest."""
        assert found.share_half is not None and np.all(found.share_half < 0.03)
        own = 1.0 + np.sign(np.array(VEHICLE.moment_arms_m)) @ np.array(TRUTH.trim)
        assert np.all(np.abs(found.share - own) < found.share_half)
        assert found.share.argmax() == own.argmax()

    def test_seconds_in_which_outputs_saturate_are_left_out(self) -> None:
        pushed = (20.0, 43.0)
        parts = records_of(flight(TRUTH, 4, pushed=pushed), VEHICLE)
        assert len(parts) == 3
        assert all(part.drive.max() < 1.0 for part in parts)
        left_s = 70.0 - sum(len(part.rates) for part in parts) * STEP_S
        # Half a second each, with what is left out on both sides of it; a flight of 70 s begins and ends in it.
        assert left_s > 2.0 * (0.5 + 1.8 * AROUND_S)
        told = fit_rotation(parts, VEHICLE).told("roll")
        assert told["lag_s"].low < TRUTH.lag_s < told["lag_s"].high

    def test_the_track_of_a_forecast_has_the_times_of_its_record(self) -> None:
        """The longest part begins after an output has saturated: position and rates are of the same instants."""
        log = flight(TRUTH, 4, pushed=(20.0,))
        pose = dict.fromkeys((*POSITION, *VELOCITY, *ATTITUDE), np.full(len(log), 0.3)) | {"x_m": 2.0 * log.time_s}
        flown = flown_of(replace(log, columns=log.columns | pose), VEHICLE, (0.0, 70.0))
        times = flown.record.begin_s + 0.01 * np.arange(len(flown.track.rates))
        assert 20.5 < times[0] < 21.5 and 69.0 < times[-1] <= 70.0
        assert flown.track.position[:, 0] == pytest.approx(2.0 * times)
        logged = np.interp(times, log.time_s, log["roll_rate_rad_s"])
        assert flown.track.rates[:, 0] == pytest.approx(logged, abs=1e-9)

    def test_a_log_without_fast_commands_is_refused_with_what_it_has(self, log: FlightLog) -> None:
        slow = replace(log, columns={name: c for name, c in log.columns.items() if name not in TORQUE})
        with pytest.raises(LogError, match=r"rotor outputs come at 10 Hz and no torque setpoint"):
            records_of(slow, VEHICLE)
        every = np.arange(len(log)) // 25 * 25
        late = {name: log[name][every] if name in TORQUE else c for name, c in log.columns.items()}
        with pytest.raises(LogError, match=r"at 10 Hz and its torque setpoint at 10 Hz"):
            records_of(replace(log, columns=late), VEHICLE)

    def test_outputs_that_follow_no_setpoint_are_refused(self, log: FlightLog) -> None:
        random = np.random.default_rng(0)
        every = np.arange(len(log)) // 25
        loose = {f"motor{i}_output": random.uniform(0.4, 0.7, every[-1] + 1)[every] for i in range(1, 5)}
        with pytest.raises(LogError, match="follow"):
            records_of(replace(log, columns=log.columns | loose), VEHICLE)


class TestMixer:
    def test_it_is_found_beside_outputs_that_saturate(self) -> None:
        random = np.random.default_rng(1)
        setpoint = random.normal([0.01, -0.02, 0.0, 0.7], [0.1, 0.08, 0.03, 0.1], (400, 4))
        output = np.clip(setpoint @ mixer() + 0.02, 0.0, 1.0)
        assert np.mean(np.any(output == 1.0, axis=1)) > 0.02
        made = fit_mixer(setpoint, output)
        assert made is not None and made.followed > 0.999
        assert made.weights == pytest.approx(mixer(), abs=1e-6)
        assert made.outputs(np.array([[0.0, 0.0, 0.0, 2.0]])) == pytest.approx(2.02)

    def test_few_instants_tell_nothing(self) -> None:
        assert fit_mixer(np.zeros((20, 4)), np.full((20, 4), 0.5)) is None


@pytest.mark.parametrize(("rate", "lag"), [(2.0, 0.05), (20.0, 0.05), (0.0, 0.03), (3.0, 1e-6)])
@pytest.mark.parametrize("ahead", [0.0, 0.25])
def test_the_answer_to_commands_that_are_held_is_exact(rate: float, lag: float, ahead: float) -> None:
    step_s, per = 0.01, 4000
    commands = np.random.default_rng(0).standard_normal(12)
    commands[0] = 0.0
    x, y, true = 0.0, 0.0, [0.0]
    for command in commands[1:]:
        for k in range(per + round(ahead * per)):
            x += step_s / per * (y - rate * x)
            y = command if lag < 1e-5 else y + step_s / per * (command - y) / lag
            if k == per - 1:
                at_sample = (x, y)
        true.append(x)
        x, y = at_sample
    assert held_response(commands, rate, lag, step_s, ahead * step_s) == pytest.approx(np.array(true), abs=1e-4)


def test_one_parameter_by_two_estimates() -> None:
    near = together([Value(1.0, 0.9, 1.1), Value(1.04, 0.94, 1.14)])
    assert (near.value, near.high - near.value) == pytest.approx((1.02, 0.1 / np.sqrt(2.0)))
    apart = together([Value(1.0, 0.99, 1.01), Value(2.0, 1.99, 2.01)])
    assert apart.low < 1.0 and apart.high > 2.0


def test_a_lag_is_told_where_it_is_bounded() -> None:
    assert known_lag(Value(0.05, 0.045, 0.055), 0.004) == Value(0.05, pytest.approx(0.043), pytest.approx(0.057))
    none = known_lag(Value(0.001, -0.006, 0.008), 0.004)
    assert none is not None and none.low == 0.0
    assert known_lag(Value(0.001, -0.5, 0.5), 0.004) is None


SIH = (
    "real/px4/excitation",
    "px4/B_forward",
    *(pytest.param(f"real/px4/{name}", marks=pytest.mark.long) for name in ("forward_runs", "vertical_runs")),
)
LAG_S, GAIN, DAMPING_1_S, HOVER = 0.05, (78.45, 78.45, 6.54), (1.0, 1.0, 0.833), 0.4903
"""PX4's SIH: SIH_T_TAU; weight times arm over inertia, yaw by SIH_Q_MAX; SIH_KDW over inertia; weight over full
thrust."""


@pytest.mark.parametrize("name", SIH)
@pytest.mark.skipif(not (DATA / "real" / "px4").is_dir(), reason="the logs of PX4 are not here")
def test_logs_of_px4_tell_the_simulators_rotation(name: str, quadctl: Callable[..., Result], tmp_path: Path) -> None:
    """Its outputs are logged at 10 Hz, its torque setpoint at 50 Hz, its gyro at 250 Hz."""
    out = tmp_path / "rotation.json"
    vehicle = DATA / "real" / "px4" / "vehicle.yaml"
    shown = quadctl("rotation", str(vehicle), str(DATA / f"{name}.ulg"), "--json", str(out))
    assert shown.status == 0, shown.err
    found = json.loads(out.read_text())
    low, high = found["lag_s"]["ci95"]
    assert low < LAG_S < high < low + 0.04
    for i, axis in enumerate(AXES):
        low, high = found["axes"][axis]["gain"]["ci95"]
        assert low < GAIN[i] < high < 1.5 * low
        low, high = found["axes"][axis]["damping_1_s"]["ci95"]
        assert low < DAMPING_1_S[i] < high
    for axis in AXES[:2]:
        low, high = found["inertia_kg_m2"][axis]["ci95"]
        assert low < 0.025 < high
    low, high = found["level_hover_command"]["ci95"]
    assert low < HOVER < high < low + 0.03
    assert all(value["ci95"][0] < 1.0 < value["ci95"][1] for value in found["drag"].values())


@pytest.mark.skipif(not (DATA / "real" / "ardupilot").is_dir(), reason="the logs of ArduPilot are not here")
def test_logs_of_ardupilot_whose_commands_change_between_their_samples_tell_no_gain(
    quadctl: Callable[..., Result], tmp_path: Path
) -> None:
    """But in yaw, whose loop is slow: flights that turn a lot have 10.5 and 10.6 rad/s² there."""
    vehicle = str(DATA / "real" / "ardupilot" / "vehicle.yaml")
    slow = quadctl("rotation", vehicle, str(DATA / "real" / "ardupilot" / "excitation.bin"))
    assert slow.status == 1 and slow.err.count("at 10 Hz") == 2
    out = tmp_path / "rotation.json"
    for name in ("fwd_vib", "stair_eq0"):
        shown = quadctl("rotation", vehicle, str(DATA / "ardupilot" / f"{name}.bin"), "--json", str(out))
        assert shown.status == 0, shown.err
        found = json.loads(out.read_text())
        assert found["axes"]["roll"] == found["axes"]["pitch"] == {} and found["lag_s"] is None
        assert min(found["unknown_of_commands"][axis] for axis in ("roll", "pitch")) > 0.5
    low, high = found["axes"]["yaw"]["slope"]["ci95"]
    assert 6.0 < low < 10.5 < high < 15.0


@pytest.mark.skipif(not (DATA / "px4").is_dir(), reason="the logs of PX4 are not here")
def test_a_ulog_gives_the_gyro_before_its_filters_at_its_own_times() -> None:
    log = read_imu_log(DATA / "px4" / "B_forward.ulg")
    rows = log.updates("pitch_rate_rad_s")
    assert np.median(np.diff(log.time_s[rows])) == pytest.approx(STEP_S, abs=1e-6)
    record = records_of(log, load_model(DATA / "px4" / "sih_quadx.yaml").vehicle)[0]
    assert record.integrated and record.every == 1
    assert record.drive.mean() == pytest.approx(0.503, abs=0.002)
