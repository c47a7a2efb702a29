"""Preparation of a log: the part in flight, the filter, and the delay of the rotor signal."""

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest

from quadctl.effects.motor_lag import FirstOrderLag
from quadctl.errors import LogError
from quadctl.lab.fitting.fitted_model import fit_model
from quadctl.lab.fitting.initial_guesses import Unmodelled
from quadctl.lab.flights.dataset import load_dataset
from quadctl.lab.flights.prediction import rmse
from quadctl.lab.flights.preparation import prepare
from quadctl.lab.selection.rule import is_supported
from quadctl.lab.selection.trial import try_effect
from quadctl.logs.columns import rpm_columns
from quadctl.logs.flight_log import FlightLog
from quadctl.model import Model
from quadctl.vehicle import Vehicle
from tests.support.flights import SHORTER, obedient, simulated, with_late_rotors


def with_noisy_speeds(log: FlightLog) -> FlightLog:
    """The same flight with the noise of a sensor in each rotor speed."""
    random = np.random.default_rng(0)
    noisy = {name: log[name] + 10.0 * random.standard_normal(len(log)) for name in rpm_columns(4)}
    return dataclasses.replace(log, columns={**log.columns, **noisy})


class TestPrepare:
    def test_the_filter_passes_a_slow_acceleration_and_halves_the_power_at_its_bandwidth(self, raptor: Vehicle) -> None:
        log = obedient(Model(raptor))
        for hz, gain in ((0.3, math.exp(-0.5 * math.log(2.0) * (0.3 / 3.0) ** 2)), (3.0, math.sqrt(0.5))):
            w = 2.0 * math.pi * hz
            columns = dict(log.columns)
            columns["vx_m_s"] = np.sin(w * log.time_s) / w
            flight = prepare(dataclasses.replace(log, columns=columns), raptor)
            assert flight.bandwidth_hz == pytest.approx(3.0)
            expected = gain * np.cos(w * flight.time_s)
            # The 50 Hz samples are joined by a spline; straight lines would cost 1.2 % of the amplitude at 3 Hz.
            assert np.abs(flight.measured[:, 0] - expected).max() < 0.012 * gain + 0.004

    def test_both_sides_of_the_comparison_agree_for_a_log_that_obeys_the_model(self, rigid: Model) -> None:
        data = load_dataset([obedient(rigid)], rigid.vehicle)
        assert rmse(data.aligned_for(rigid).residual(rigid))["up"] < 0.01 * float(np.std(data.measured[:, 2]))

    def test_held_values_are_joined_not_stepped(self, rigid: Model) -> None:
        log = obedient(rigid, rate_hz=100.0)
        held = {name: np.repeat(values[::10], 10) for name, values in log.columns.items() if name != "time_s"}
        slow = dataclasses.replace(log, columns={**held, "time_s": log.time_s})
        flight = prepare(slow, rigid.vehicle)
        residual = load_dataset([slow], rigid.vehicle).aligned_for(rigid).residual(rigid)
        assert rmse(residual)["up"] < 0.1 * float(np.std(flight.measured[:, 2]))

    @pytest.mark.parametrize("delay_s", [-3.0, -0.037, -0.0001, 0.0, 0.02, 0.1234, 1e4])
    def test_a_later_signal_is_interpolated_and_stays_beyond_its_ends(self, rigid: Model, delay_s: float) -> None:
        flight = prepare(obedient(rigid), rigid.vehicle)
        thrust = flight.nominal_n[0]
        expected = np.interp(flight.grid_s + delay_s, flight.grid_s, thrust)
        assert flight.later(thrust, delay_s) == pytest.approx(expected, abs=1e-6)

    @pytest.mark.parametrize("late_s", [-0.04, 0.0, 0.057, 0.12])
    def test_the_delay_of_the_rotor_signal_is_found(self, rigid: Model, late_s: float) -> None:
        flight = prepare(with_late_rotors(obedient(rigid), late_s), rigid.vehicle)
        assert flight.delay_s == pytest.approx(late_s, abs=0.003)

    @pytest.mark.parametrize("late_s", [-0.03, 0.05])
    def test_a_lag_is_told_from_the_age_of_the_rotor_signal(self, rigid: Model, late_s: float) -> None:
        """Half of a lag looks like a delay: they are right only when they are estimated together."""
        data = load_dataset([with_late_rotors(obedient(rigid), late_s, lag_s=0.08)], rigid.vehicle)
        found = try_effect(FirstOrderLag, Unmodelled(fit_model(rigid, data)), 1)
        assert is_supported(found)
        assert found.effect.values()["time_constant_s"] == pytest.approx(0.08, rel=0.05)
        assert data.aligned_for(found.model).flights[0].delay_s == pytest.approx(late_s, abs=0.005)

    def test_a_rotor_speed_that_freezes_while_the_others_change_is_not_used(self, rigid: Model) -> None:
        log = with_noisy_speeds(obedient(rigid, seconds=60.0))
        speed = np.where(log.time_s < 40.0, log["motor3_rpm"], log["motor3_rpm"][log.time_s < 40.0][-1])
        frozen = dataclasses.replace(log, columns={**log.columns, "motor3_rpm": speed})
        flight = prepare(frozen, rigid.vehicle)
        assert flight.time_s.max() < 40.0 < prepare(log, rigid.vehicle).time_s.max()
        assert any("the speed of rotor 3 stays the same from 40.0 to" in note for note in flight.notes)

    def test_rounded_rotor_speeds_are_not_frozen(self, rigid: Model) -> None:
        log = with_noisy_speeds(obedient(rigid, seconds=60.0))
        rounded = {name: np.round(log[name] / 200.0) * 200.0 for name in rpm_columns(4)}
        flight = prepare(dataclasses.replace(log, columns={**log.columns, **rounded}), rigid.vehicle)
        assert not any("stays the same" in note for note in flight.notes)

    def test_too_little_of_a_flight_is_left_and_the_reason_is_said(self, rigid: Model) -> None:
        log = with_noisy_speeds(obedient(rigid, seconds=60.0))
        frozen = {**log.columns, "motor1_rpm": np.where(log.time_s < 8.0, log["motor1_rpm"], 5000.0)}
        with pytest.raises(LogError, match=r"at least 10 s; the speed of rotor 1 stays the same from 8\.0 to"):
            prepare(dataclasses.replace(log, columns=frozen), rigid.vehicle)

    def test_only_the_flight_is_used(self, raptor: Vehicle, tmp_path: Path) -> None:
        log = simulated("step_response", [], 1, tmp_path, SHORTER["step_response"])
        flight = prepare(log, raptor)
        assert log["z_m"].min() < 0.05  # on the ground
        assert flight.filtered(flight.conditions.height_m).min() > 0.15
        assert any("are flight" in note for note in flight.notes)

    def test_a_gap_is_left_out_and_said(self, raptor: Vehicle) -> None:
        log = obedient(Model(raptor))
        kept = (log.time_s < 30.0) | (log.time_s > 34.0)
        flight = prepare(log.rows(kept), raptor)
        assert not np.any((flight.time_s > 30.0) & (flight.time_s < 34.0))
        assert any("gaps" in note for note in flight.notes)

    def test_thrust_comes_from_the_throttle_where_there_is_no_rotor_speed(self, rigid: Model) -> None:
        log = obedient(rigid)
        columns = {name: values for name, values in log.columns.items() if not name.endswith("_rpm")}
        vehicle = rigid.vehicle
        total = 4 * vehicle.rotor.thrust_n_per_rpm2 * log["motor1_rpm"] ** 2
        columns["throttle_cmd"] = vehicle.throttle.offset + vehicle.throttle.per_newton * total
        data = load_dataset([dataclasses.replace(log, columns=columns)], vehicle)
        assert data.flights[0].thrust_source == "throttle command"
        assert rmse(data.aligned_for(rigid).residual(rigid))["up"] < 0.1 * float(np.std(data.measured[:, 2]))

    def test_commanded_thrust_serves_where_nothing_else_tells_the_thrust(self, rigid: Model) -> None:
        log = obedient(rigid)
        columns = {name: values for name, values in log.columns.items() if not name.endswith("_rpm")}
        columns["thrust_cmd_n"] = 4 * rigid.vehicle.rotor.thrust_n_per_rpm2 * log["motor1_rpm"] ** 2
        data = load_dataset([dataclasses.replace(log, columns=columns)], rigid.vehicle)
        assert data.flights[0].thrust_source == "thrust command"
        assert data.flights[0].torque is None
        assert rmse(data.aligned_for(rigid).residual(rigid))["up"] < 0.1 * float(np.std(data.measured[:, 2]))

    def test_commanded_thrust_in_another_unit_is_said(self, rigid: Model) -> None:
        log = obedient(rigid)
        columns = {name: values for name, values in log.columns.items() if not name.endswith("_rpm")}
        columns["thrust_cmd_n"] = 0.5 + 0.01 * np.sin(log.time_s)
        with pytest.raises(LogError, match="is thrust_cmd_n the thrust of all rotors in newtons"):
            prepare(dataclasses.replace(log, columns=columns), rigid.vehicle)

    def test_motors_that_the_vehicle_lacks_and_that_never_ran_are_left_out(self, raptor: Vehicle) -> None:
        log = obedient(Model(raptor))
        empty = {"motor5_rpm": 0.0 * log.time_s, "motor6_rpm": np.nan * log.time_s, "motor5_output": 0.0 * log.time_s}
        flight = prepare(dataclasses.replace(log, columns={**log.columns, **empty}), raptor)
        plain = prepare(log, raptor)
        np.testing.assert_array_equal(flight.measured, plain.measured)
        assert any("motor5_rpm, motor6_rpm, motor5_output" in note for note in flight.notes)
        assert not any("motor5" in note for note in plain.notes)

    @pytest.mark.parametrize("motors", [3, 6])
    def test_outputs_of_another_number_of_motors_are_of_another_vehicle(self, raptor: Vehicle, motors: int) -> None:
        log = obedient(Model(raptor))
        columns = {name: values for name, values in log.columns.items() if not name.endswith("_rpm")}
        columns |= {f"motor{i}_output": 0.4 + 0.01 * np.sin(log.time_s) for i in range(1, motors + 1)}
        columns["throttle_cmd"] = 0.4 + 0.01 * np.sin(log.time_s)
        expected = f"has the outputs of {motors} motors, expected 4 as the vehicle 'raptor' has"
        with pytest.raises(LogError, match=expected):
            prepare(dataclasses.replace(log, columns=columns), raptor)

    def test_the_torque_is_what_the_body_rates_tell(self, raptor: Vehicle) -> None:
        """Torque I dw/dt + w x I w, filtered as the acceleration: turning about two axes takes a torque about the
        third."""
        log = obedient(Model(raptor))
        w = 2.0 * math.pi * 0.3
        yaw_rate = 0.5 + log["yaw_rate_rad_s"]
        rates = {"roll_rate_rad_s": np.sin(w * log.time_s), "yaw_rate_rad_s": yaw_rate}
        angles = {"roll_deg": np.degrees((1.0 - np.cos(w * log.time_s)) / w), "yaw_deg": np.degrees(0.5 * log.time_s)}
        flight = prepare(dataclasses.replace(log, columns={**log.columns, **rates, **angles}), raptor)
        t, gain = flight.time_s, math.exp(-0.5 * math.log(2.0) * (0.3 / 3.0) ** 2)
        assert flight.torque is not None
        assert flight.torque[:, 0] == pytest.approx(0.0123 * gain * w * np.cos(w * t), abs=2e-4)
        # about y: (I_x - I_z) r p = (0.0123 - 0.0224) 0.5 sin
        assert flight.torque[:, 1] == pytest.approx(-0.0101 * 0.5 * gain * np.sin(w * t), abs=2e-4)

    def test_the_torque_that_rotor_speeds_promise_is_that_of_their_levers(self, raptor: Vehicle) -> None:
        log = obedient(Model(raptor))
        front = {f"motor{i}_rpm": 6000.0 if i in (1, 3) else 5000.0 for i in (1, 2, 3, 4)}
        rpm = {name: value + 0.01 * np.sin(log.time_s) for name, value in front.items()}
        flight = prepare(dataclasses.replace(log, columns={**log.columns, **rpm}), raptor)
        # nose up: 2 * 0.124 * 1.1382941e-7 * (6000^2 - 5000^2) = 0.3105266 N m
        assert flight.nominal_torque.mean(axis=0) == pytest.approx([0.0, 0.3105266, 0.0], abs=1e-5)

    def test_there_is_no_torque_without_body_rates_or_single_rotors(self, raptor: Vehicle) -> None:
        log = obedient(Model(raptor))
        blind = {**log.columns, "roll_rate_rad_s": np.nan * log.time_s}
        assert prepare(dataclasses.replace(log, columns=blind), raptor).torque is None
        throttle = {name: values for name, values in log.columns.items() if not name.endswith("_rpm")}
        throttle["throttle_cmd"] = 0.52 + 0.001 * np.sin(log.time_s)
        assert prepare(dataclasses.replace(log, columns=throttle), raptor).torque is None

    def test_rotors_that_idle_for_an_instant_in_the_air_do_not_end_the_flight(self, raptor: Vehicle) -> None:
        log = obedient(Model(raptor))
        kept = {}
        for seconds in (0.6, 6.0):
            idle = (log.time_s > 30.0) & (log.time_s < 30.0 + seconds)
            rpm = {name: np.where(idle, 500.0, v) for name, v in log.columns.items() if name.endswith("_rpm")}
            times = prepare(dataclasses.replace(log, columns={**log.columns, **rpm}), raptor).time_s
            kept[seconds] = np.any((times > 30.0) & (times < 30.0 + seconds))
        assert kept == {0.6: True, 6.0: False}

    def test_bad_logs_are_sentences(self, raptor: Vehicle) -> None:
        log = obedient(Model(raptor))
        grounded = dataclasses.replace(
            log, columns={**log.columns, **{f"motor{i}_rpm": 0 * log.time_s for i in (1, 2, 3, 4)}}
        )
        with pytest.raises(LogError, match="never leaves the ground"):
            prepare(grounded, raptor)
        six = {**log.columns, "motor5_rpm": log["motor1_rpm"], "motor6_rpm": log["motor1_rpm"]}
        with pytest.raises(LogError, match=r"6 rotors.*expected 4"):
            prepare(dataclasses.replace(log, columns=six), raptor)
        without = {name: values for name, values in log.columns.items() if not name.endswith("_rpm")}
        with pytest.raises(LogError, match="neither rotor speeds nor motor outputs"):
            prepare(dataclasses.replace(log, columns=without), raptor)
        with pytest.raises(LogError, match="holds no values of vz_m_s"):
            prepare(dataclasses.replace(log, columns={**log.columns, "vz_m_s": np.nan * log.time_s}), raptor)
        with pytest.raises(LogError, match="usable flight, expected at least 10 s"):
            prepare(log.rows(log.time_s < 8.0), raptor)
