"""The simulated vehicle against physics worked out by hand, and its autopilot against PX4's rules."""

import math
import statistics
import subprocess
import sys
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
import yaml

from quadctl.effects import find_effect
from quadctl.errors import SettingsError
from quadctl.flight.preflight.preparation import prepare_flight
from quadctl.frames import GRAVITY_M_S2, quaternion_from_euler, rotate
from quadctl.logs.read import read_log
from quadctl.model import Model
from quadctl.sitl.rules.px4 import SimulatedAutopilot
from quadctl.sitl.run import simulate
from quadctl.sitl.vehicle.body import REST_HEIGHT_M, STEP_S, Battery, Motion, SimulatedBody
from quadctl.sitl.vehicle.estimator import Estimator
from quadctl.sitl.vehicle.hidden import HiddenTruth, Noise, Telemetry, load_hidden, true_model
from quadctl.sitl.vehicle.inner_loops import allocation
from quadctl.state import AttitudeTarget
from quadctl.vehicle import RotorPlace, Vehicle, load_vehicle
from tests.support.places import ROOT

RAPTOR = load_vehicle(ROOT / "config" / "vehicles" / "raptor.yaml")
K = 1.1382941e-7
HOVER_RPM = math.sqrt(1.5 * 9.80665 / (4 * K))
LEVEL = (1.0, 0.0, 0.0, 0.0)
IDLE = AttitudeTarget(LEVEL, 0.0)


def high_up(vehicle: Vehicle = RAPTOR, truth: Model | None = None) -> SimulatedBody:
    body = SimulatedBody(truth or Model(vehicle))
    body.position = (0.0, 0.0, -100.0)
    return body


def outputs_for(rpm: list[float], vehicle: Vehicle = RAPTOR) -> list[float]:
    """Motor outputs that keep these speeds on a full battery."""
    speed = 1.0 + 0.5 * (Battery.FULL_V / Battery.REFERENCE_V - 1.0)
    k, n = vehicle.rotor.thrust_n_per_rpm2, vehicle.n_rotors
    return [vehicle.throttle.offset + vehicle.throttle.per_newton * n * k * (r / speed) ** 2 for r in rpm]


def acceleration(rpm: list[float], attitude: Any = LEVEL) -> tuple[np.ndarray, np.ndarray]:
    """Linear (NED) and angular (FRD) acceleration, from one step of a body at rest high up."""
    body = high_up()
    body.attitude, body.rpm = attitude, list(rpm)
    body.step(outputs_for(rpm), armed=True)
    return np.array(body.velocity) / STEP_S, np.array(body.rates) / STEP_S


# --- body ------------------------------------------------------------------------------------------------------------


def test_free_fall() -> None:
    body = high_up()
    for _ in range(500):
        body.step([0.0] * 4, armed=False)
    assert body.velocity == pytest.approx((0.0, 0.0, GRAVITY_M_S2))
    assert body.position[2] == pytest.approx(-100.0 + 0.5 * GRAVITY_M_S2, abs=0.5 * GRAVITY_M_S2 * STEP_S * 1.01)
    assert body.rates == (0.0, 0.0, 0.0)


def test_hover_is_where_the_rotors_carry_the_weight() -> None:
    """sqrt(m g / (n k)) = sqrt(1.5 * 9.80665 / (4 * 1.1382941e-7)) = 5684 1/min."""
    assert pytest.approx(5684.0, abs=0.5) == HOVER_RPM
    linear, angular = acceleration([HOVER_RPM] * 4)
    assert linear == pytest.approx([0, 0, 0], abs=1e-3)
    assert angular == pytest.approx([0, 0, 0], abs=1e-9)


@pytest.mark.parametrize(
    ("roll_deg", "pitch_deg", "direction"),
    [(0, 0, (0, 0, -1)), (90, 0, (0, 1, 0)), (-90, 0, (0, -1, 0)), (0, 90, (-1, 0, 0)), (0, -90, (1, 0, 0))],
)
def test_thrust_acts_along_minus_z_of_the_body(
    roll_deg: float, pitch_deg: float, direction: tuple[float, float, float]
) -> None:
    """Rolled right it pushes right (east), nose up it pushes back (south)."""
    attitude = quaternion_from_euler(math.radians(roll_deg), math.radians(pitch_deg), 0.0)
    linear, _ = acceleration([HOVER_RPM] * 4, attitude)
    expected = GRAVITY_M_S2 * np.array(direction) + [0, 0, GRAVITY_M_S2]
    assert linear == pytest.approx(expected, abs=2e-3)


FAST, SLOW = 6000.0, 5000.0
MORE_N = K * (FAST**2 - SLOW**2)
"""Thrust of a fast rotor over that of a slow one."""


@pytest.mark.parametrize(
    ("name", "faster", "axis", "by_hand"),
    [
        ("left rotors roll right", (2, 3), 0, 2 * 0.124 * MORE_N / 0.0123),
        ("right rotors roll left", (1, 4), 0, -2 * 0.124 * MORE_N / 0.0123),
        ("front rotors pitch up", (1, 3), 1, 2 * 0.124 * MORE_N / 0.0123),
        ("rear rotors pitch down", (2, 4), 1, -2 * 0.124 * MORE_N / 0.0123),
        ("ccw rotors turn the body clockwise", (1, 2), 2, 2 * 0.016 * MORE_N / 0.0224),
        ("cw rotors turn it counter-clockwise", (3, 4), 2, -2 * 0.016 * MORE_N / 0.0224),
    ],
)
def test_torque(name: str, faster: tuple[int, int], axis: int, by_hand: float) -> None:
    """Motor 1 is front right, 2 rear left (both ccw), 3 front left, 4 rear right (both cw)."""
    _, angular = acceleration([FAST if motor in faster else SLOW for motor in (1, 2, 3, 4)])
    expected = [0.0, 0.0, 0.0]
    expected[axis] = by_hand
    assert angular == pytest.approx(expected, abs=1e-3 * abs(by_hand)), name


def test_the_ground_holds_the_vehicle_at_its_rest_height() -> None:
    body = SimulatedBody(Model(RAPTOR))
    for _ in range(1000):
        body.step([0.0] * 4, armed=False)
    assert body.in_contact
    assert body.position == pytest.approx((0.0, 0.0, -REST_HEIGHT_M), abs=0.005)
    assert body.velocity == pytest.approx((0.0, 0.0, 0.0), abs=1e-6)


def test_a_fall_onto_the_ground_ends_there_level_and_at_rest() -> None:
    body = high_up()
    body.position, body.velocity = (0.0, 0.0, -1.0), (0.5, -0.3, 0.0)
    body.attitude = quaternion_from_euler(0.2, -0.1, 1.0)
    deepest = 0.0
    for _ in range(2000):
        body.step([0.0] * 4, armed=False)
        deepest = max(deepest, body.position[2])
    assert deepest < 0.05  # it does not go through the floor
    assert body.position[2] == pytest.approx(-REST_HEIGHT_M, abs=0.005)
    assert body.velocity == pytest.approx((0, 0, 0), abs=1e-3)
    assert rotate(body.attitude, (0.0, 0.0, 1.0))[2] == pytest.approx(1.0, abs=1e-4)


def test_linear_drag_takes_speed_away_exponentially() -> None:
    """d = 0.5 1/s: after 2 s a speed of 4 m/s is down to 4 / e."""
    drag = find_effect("rotor_drag.linear", "test").from_values({"d_x": 0.5, "d_y": 0.5}, "test")
    body = high_up(truth=Model(RAPTOR).plus(drag))
    body.velocity = (4.0, 0.0, 0.0)
    for _ in range(1000):
        body.step([0.0] * 4, armed=False)
    assert body.velocity[0] == pytest.approx(4.0 / math.e, rel=1e-3)


def test_a_wind_carries_what_falls_along() -> None:
    """d = 0.5 1/s: after 2 s at rest in air that moves north at 3 m/s, 3 (1 - 1/e)."""
    wind = find_effect("wind", "test").from_values({"north_m_s": 3.0, "east_m_s": 0.0, "drag": 0.5}, "test")
    body = high_up(truth=Model(RAPTOR).plus(wind))
    for _ in range(1000):
        body.step([0.0] * 4, armed=False)
    assert body.velocity[0] == pytest.approx(3.0 * (1.0 - 1.0 / math.e), rel=2e-3)
    assert body.velocity[1] == pytest.approx(0.0, abs=1e-9)


def test_the_body_obeys_the_moments_of_its_effects() -> None:
    """Tilted right by 0.1 rad at z = R: -T 0.5 R e^-1 0.1 about x, in hover with T = 14.709975 N, over I_x."""
    levelling = find_effect("ground_torque", "test").from_values({"stiffness": 0.5, "reach": 1.0}, "test")
    body = high_up(truth=Model(RAPTOR).plus(levelling))
    body.position, body.attitude = (0.0, 0.0, -0.12), quaternion_from_euler(0.1, 0.0, 0.0)
    body.rpm = [HOVER_RPM] * 4
    body.step(outputs_for([HOVER_RPM] * 4), armed=True)
    by_hand = -14.709975 * 0.5 * 0.12 * math.exp(-1.0) * 0.1 / 0.0123
    assert np.array(body.rates) / STEP_S == pytest.approx([by_hand, 0.0, 0.0], abs=1e-3 * abs(by_hand))


def test_a_weak_rotor_turns_the_body_toward_itself() -> None:
    """A tenth of 3.67749 N is missing front right: 0.124 m and 0.016 m of it, over the inertia."""
    weak = find_effect("rotor_fault", "test").from_values({"loss": 0.1, "rotor": 1}, "test")
    body = high_up(truth=Model(RAPTOR).plus(weak))
    body.rpm = [HOVER_RPM] * 4
    body.step(outputs_for([HOVER_RPM] * 4), armed=True)
    lost_n = 0.1 * 14.709975 / 4.0
    by_hand = [0.124 * lost_n / 0.0123, -0.124 * lost_n / 0.0123, -0.016 * lost_n / 0.0224]
    assert np.array(body.rates) / STEP_S == pytest.approx(by_hand, rel=1e-3)


def test_free_tumbling_keeps_its_angular_momentum_and_makes_no_energy() -> None:
    inertia = np.array([0.01, 0.02, 0.028])
    body = high_up(RAPTOR.model_copy(update={"inertia_kg_m2": tuple(inertia)}))
    body.rates = (3.0, 2.0, -1.0)

    def momentum() -> np.ndarray:
        return np.array(rotate(body.attitude, tuple(inertia * np.array(body.rates))))

    def energy() -> float:
        return float(0.5 * np.sum(inertia * np.array(body.rates) ** 2))

    before, energy_before = momentum(), energy()
    for _ in range(1000):
        body.step([0.0] * 4, armed=False)
    assert not np.allclose(body.rates, (3.0, 2.0, -1.0), atol=0.5)  # it does tumble
    assert np.linalg.norm(momentum() - before) < 0.03 * np.linalg.norm(before)
    assert energy() == pytest.approx(energy_before, rel=0.03)
    assert math.hypot(*body.attitude) == pytest.approx(1.0)


def test_rotors_follow_with_their_time_constant() -> None:
    """After 0.04 s, 63.2 % of the way from one speed to another."""
    body = high_up()
    body.rpm = [4000.0] * 4
    for _ in range(round(0.04 / STEP_S)):
        body.step(outputs_for([6000.0] * 4), armed=True)
    assert body.rpm == pytest.approx([4000.0 + 2000.0 * (1.0 - math.exp(-1.0))] * 4, rel=5e-3)


def test_disarmed_rotors_stop_and_a_battery_that_is_used_sags() -> None:
    body = high_up()
    body.rpm = [6000.0] * 4
    for _ in range(500):
        body.step(outputs_for([6000.0] * 4), armed=True)
    assert body.battery.voltage_v < Battery.FULL_V - 0.1
    drawn = body.battery.drawn_c
    assert drawn > 0.0
    for _ in range(500):
        body.step([1.0] * 4, armed=False)
    assert max(body.rpm) < 1.0
    assert body.battery.voltage_v > Battery.FULL_V - 0.1  # the load is gone, the charge is not back
    assert body.battery.drawn_c >= drawn


def canted_hexarotor() -> Vehicle:
    """Six rotors on a circle of 0.28 m, canted by 20 degrees to alternate sides."""
    rotors = []
    for i in range(6):
        azimuth = math.radians(30.0 + 60.0 * i)
        rotors.append(
            RotorPlace(
                position_m=(0.28 * math.cos(azimuth), 0.28 * math.sin(azimuth), 0.0),
                spin="ccw" if i % 2 else "cw",
                cant_deg=20.0 if i % 2 else -20.0,
            )
        )
    throttle = RAPTOR.throttle.model_copy(update={"per_newton": 0.015})
    return RAPTOR.model_copy(
        update={"name": "hexa", "mass_kg": 2.5, "rotors": tuple(rotors), "throttle": throttle, "ceiling_m": None}
    )


@pytest.mark.parametrize("vehicle", [RAPTOR, canted_hexarotor()], ids=lambda v: v.name)
def test_the_allocation_gives_the_torque_that_was_asked_and_no_thrust(vehicle: Vehicle) -> None:
    rows = np.array(allocation(vehicle))
    effect = np.zeros((4, 3))
    for per_torque, rotor in zip(rows, vehicle.rotors, strict=True):
        axis = np.array(rotor.axis)
        reaction = vehicle.rotor.torque_to_thrust_m * (-1.0 if rotor.spin == "ccw" else 1.0)
        torque = np.cross(rotor.position_m, axis) + reaction * axis
        effect += np.outer([*torque, axis[2]], per_torque)
    np.testing.assert_allclose(effect, [[1, 0, 0], [0, 1, 0], [0, 0, 1], [0, 0, 0]], atol=1e-9)


def test_a_canted_hexarotor_flies(tmp_path: Path) -> None:
    plan = prepare_flight(ROOT / "missions" / "short_hop.yaml", ROOT / "config" / "flight.yaml", None, None)
    body = Model(canted_hexarotor(), name="none")
    outcome = simulate(plan._replace(body=body, compensator=body), tmp_path, None, seed=0)
    assert outcome.completed
    log = read_log(outcome.log)
    assert log.n_rotors == 6
    assert max(outcome.tracking_rmse_m.values()) < 0.05
    hover = (log.phase == "hover") & (log["z_m"] > 0.5)
    by_hand = math.sqrt(2.5 * 9.80665 / (6 * K * math.cos(math.radians(20.0))))
    assert np.mean(log["motor3_rpm"][hover]) == pytest.approx(by_hand, rel=0.01)


# --- estimator -------------------------------------------------------------------------------------------------------


class Seen(NamedTuple):
    """The estimate at one physics step."""

    time_s: float
    updated_s: float
    rpm_updated_s: float
    position: tuple[float, ...]
    velocity: tuple[float, ...]
    attitude: tuple[float, ...]
    rates: tuple[float, ...]
    rpm: tuple[float, ...]
    battery_v: float


def observe(noise: Noise, telemetry: Telemetry, seconds: float) -> list[Seen]:
    """Estimates of a vehicle that moves north at 1 m/s and whose rotors gain 1000 1/min each second."""
    e = Estimator(noise, telemetry, seed=1)
    seen = []
    for i in range(round(seconds / STEP_S)):
        t = i * STEP_S
        e.observe(Motion(t, (t, 0.0, 0.0), (1.0, 0.0, 0.0), LEVEL, (0.0, 0.0, 0.0), (1000.0 * t,) * 4, 16.0))
        when = (t, e.updated_s, e.rpm_updated_s)
        seen.append(Seen(*when, e.position, e.velocity, e.attitude, e.rates, e.rotor_rpm, e.battery_v))
    return seen


SILENT = Noise(position_m=0, velocity_m_s=0, attitude_deg=0, rates_rad_s=0, rpm=0, battery_v=0)


@pytest.mark.parametrize("delay_s", [0.0, 0.02, 0.1])
def test_the_estimate_is_as_old_as_the_telemetry_says(delay_s: float) -> None:
    for seen in observe(SILENT, Telemetry(delay_s=delay_s), 1.0):
        assert seen.time_s - seen.updated_s < 0.01  # 100 Hz
        assert seen.position[0] == pytest.approx(max(seen.updated_s - delay_s, 0.0), abs=1e-9)


def test_rotor_speeds_are_late_and_come_at_their_own_rate() -> None:
    log = observe(SILENT, Telemetry(rpm_delay_s=0.1, rpm_rate_hz=10.0), 3.0)
    times = sorted({seen.rpm_updated_s for seen in log})
    assert len(times) == 30
    assert np.diff(times) == pytest.approx(0.1, abs=STEP_S)
    for seen in log:
        assert seen.rpm[0] == pytest.approx(1000.0 * max(seen.rpm_updated_s - 0.1, 0.0), abs=0.51)  # whole numbers


def test_the_noise_has_the_deviation_of_the_file() -> None:
    noise = Noise(position_m=0.01, velocity_m_s=0.2, attitude_deg=2.0, rates_rad_s=0.3, rpm=30, battery_v=0.05)
    log = observe(noise, Telemetry(delay_s=0.0, rpm_delay_s=0.0, rpm_rate_hz=100.0), 30.0)
    updates = list({seen.updated_s: seen for seen in log}.values())
    assert len(updates) == 3000
    spread = statistics.pstdev
    for axis in (1, 2):
        assert spread(u.position[axis] for u in updates) == pytest.approx(0.01, rel=0.1)
        assert statistics.fmean(u.position[axis] for u in updates) == pytest.approx(0.0, abs=0.001)
    for axis in range(3):
        assert spread(u.velocity[axis] for u in updates) == pytest.approx(0.2, rel=0.1)
        assert spread(2.0 * u.attitude[axis + 1] for u in updates) == pytest.approx(math.radians(2.0), rel=0.1)
        assert spread(u.rates[axis] for u in updates) == pytest.approx(0.3, rel=0.1)
    assert spread(u.rpm[0] - 1000.0 * u.rpm_updated_s for u in updates if u.time_s > 1.0) == pytest.approx(30, rel=0.1)
    assert spread(u.battery_v for u in updates) == pytest.approx(0.05, rel=0.1)
    assert all(math.hypot(*u.attitude) == pytest.approx(1.0) for u in updates)


# --- autopilot: PX4's rules ------------------------------------------------------------------------------------------


class Stick:
    """An autopilot and a companion that streams to it."""

    def __init__(self, vehicle: Vehicle = RAPTOR) -> None:
        self.px = SimulatedAutopilot(vehicle)
        self.target = IDLE

    def stream(self, seconds: float) -> "Stick":
        for _ in range(round(seconds * 50)):
            self.px.set_attitude_target(self.target)
            self.px.step(self.px.time_s + 0.02)
        return self

    def wait(self, seconds: float) -> "Stick":
        self.px.step(self.px.time_s + seconds)
        return self

    def in_the_air(self) -> "Stick":
        self.stream(0.1)
        assert self.px.request_mode("OFFBOARD") is None
        assert self.px.request_arm() is None
        hover = RAPTOR.throttle.offset + RAPTOR.throttle.per_newton * RAPTOR.weight_n
        self.target = AttitudeTarget(LEVEL, 1.05 * hover)
        self.stream(1.5)
        assert not self.px.landed
        return self


def test_offboard_needs_a_stream_once_it_is_armed() -> None:
    """Measured on the real PX4: disarmed, it accepts offboard without setpoints, and refuses to arm then."""
    stick = Stick()
    assert stick.px.request_mode("OFFBOARD") is None
    assert stick.px.request_arm() == "no offboard setpoints are arriving"
    assert stick.px.request_mode("HOLD") is None
    assert stick.px.request_arm() is None
    assert stick.px.request_mode("OFFBOARD") == "no offboard setpoints are arriving"
    stick.stream(0.1)
    assert stick.px.request_mode("OFFBOARD") is None
    assert stick.px.mode == "OFFBOARD"


def test_an_old_stream_is_none() -> None:
    stick = Stick().stream(0.1).wait(0.6)
    assert stick.px.request_arm() is None
    assert stick.px.request_mode("OFFBOARD") is not None
    assert stick.px.mode == "HOLD"


def test_arming_in_offboard_without_a_stream_is_refused() -> None:
    stick = Stick().stream(0.1)
    assert stick.px.request_mode("OFFBOARD") is None
    stick.wait(0.6)
    assert stick.px.mode == "OFFBOARD"
    assert stick.px.request_arm() == "no offboard setpoints are arriving"
    assert not stick.px.armed


@pytest.mark.parametrize("loss_s", [1.0, 0.5])
def test_a_stream_that_ends_makes_it_return_after_its_time(loss_s: float) -> None:
    stick = Stick()
    stick.px.parameters["COM_OF_LOSS_T"] = loss_s
    stick.in_the_air()
    stick.wait(loss_s - 0.04)
    assert stick.px.mode == "OFFBOARD"
    stick.wait(0.06)
    assert stick.px.mode == "RTL"
    stick.wait(30.0)
    assert not stick.px.armed
    assert stick.px.landed
    assert -stick.px.body.position[2] == pytest.approx(REST_HEIGHT_M, abs=0.01)


def test_unknown_modes_are_refused() -> None:
    assert Stick().px.request_mode("ORBIT") == "there is no mode ORBIT"


def test_an_armed_vehicle_that_does_not_fly_disarms_itself() -> None:
    stick = Stick()
    assert stick.px.request_arm() is None
    assert stick.wait(9.9).px.armed
    assert not stick.wait(0.3).px.armed


def test_landing_ends_disarmed_some_seconds_after_the_touchdown() -> None:
    stick = Stick().in_the_air()
    assert stick.px.request_disarm() == "the vehicle is not landed"
    assert stick.px.request_mode("LAND") is None
    while stick.px.armed:
        stick.wait(0.02)
        if not stick.px.body.in_contact:
            touchdown_s = stick.px.time_s
        assert stick.px.time_s < 30.0
    assert stick.px.time_s - touchdown_s == pytest.approx(2.0, abs=0.2)
    assert stick.px.mode == "HOLD"


def test_other_modes_hold_their_place() -> None:
    stick = Stick().in_the_air()
    assert stick.px.request_mode("POSCTL") is None
    stick.wait(6.0)
    x, y, z = stick.px.body.position
    stick.wait(5.0)
    assert stick.px.body.position == pytest.approx((x, y, z), abs=0.02)
    assert stick.px.mode == "POSCTL"


# --- the hidden truth ------------------------------------------------------------------------------------------------


def flown(where: Path, hidden: dict[str, Any] | None, seed: int = 0) -> Any:
    path = None
    if hidden is not None:
        path = where / "hidden.yaml"
        path.write_text(yaml.safe_dump(hidden))
    plan = prepare_flight(ROOT / "missions" / "short_hop.yaml", ROOT / "config" / "flight.yaml", None, None)
    outcome = simulate(plan, where, path, seed)
    assert outcome.completed
    return read_log(outcome.log)


def settled(log: Any, phase: str) -> tuple[float, float]:
    """Mean height and mean speed of all rotors over the last second and a half of a phase."""
    rows = np.flatnonzero(log.phase == phase)[-75:]
    return float(np.mean(log["z_m"][rows])), float(np.mean([log[f"motor{i}_rpm"][rows] for i in (1, 2, 3, 4)]))


def test_weak_rotors_turn_faster_in_hover(tmp_path: Path) -> None:
    _, plain = settled(flown(tmp_path, None), "hover")
    truth = {"effects": [{"effect": "thrust_scale", "parameters": {"factor": 0.9}}]}
    _, weak = settled(flown(tmp_path, truth), "hover")
    assert plain == pytest.approx(HOVER_RPM, rel=2e-3)
    assert weak == pytest.approx(HOVER_RPM / math.sqrt(0.9), rel=2e-3)


def test_a_hidden_cushion_carries_near_the_ground(tmp_path: Path) -> None:
    """K = 1 + 0.25 / (1 + (z / (1.8 * 0.12 m))^2)^1.5: 1.0499 at 0.3 m."""
    cushion = {"effect": "hidden.ground_cushion", "parameters": {"gain": 0.25, "width": 1.8}}
    height, rpm = settled(flown(tmp_path, {"effects": [cushion]}), "down")
    assert height == pytest.approx(0.3, abs=0.025)
    at_height = 1.0499 - 0.25 * 3.0 * 0.3 / 0.216**2 / (1.0 + (0.3 / 0.216) ** 2) ** 2.5 * (height - 0.3)
    assert rpm == pytest.approx(HOVER_RPM / math.sqrt(at_height), rel=2e-3)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("", "hidden.yaml: is empty, expected settings in YAML"),
        ("effects: [", "hidden.yaml, line 1, column 11: is not valid YAML"),
        ("effect: []", "hidden.yaml: unknown key 'effect' (did you mean 'effects'?)"),
        ("effects: [{effect: hidden.ground_cushon}]", "hidden.yaml: there is no effect 'hidden.ground_cushon'"),
        ("effects: [{effect: ground_effect.sanches}]", "(did you mean 'ground_effect.sanchez'?)"),
        ("effects: [{effect: hidden.ground_cushion, parameters: {gain: 7}}]", "gain"),
        ("effects: [{effect: hidden.ground_cushion, parameters: {gein: 0.2}}]", "gein"),
        ("noise: {rpm: -1}", "hidden.yaml: noise.rpm is -1, expected"),
        ("noise: {position_m: .nan}", "hidden.yaml: noise.position_m is nan, expected"),
        ("telemetry: {rpm_rate_hz: 0}", "hidden.yaml: telemetry.rpm_rate_hz is 0, expected"),
    ],
)
def test_a_hidden_file_that_cannot_be_used_is_one_sentence(tmp_path: Path, text: str, expected: str) -> None:
    path = tmp_path / "hidden.yaml"
    path.write_text(text)
    with pytest.raises(SettingsError) as caught:
        true_model(RAPTOR, load_hidden(path), str(path))
    assert expected in str(caught.value)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_no_hidden_file_is_a_rigid_body_with_noise() -> None:
    truth = load_hidden(None)
    assert truth == HiddenTruth()
    assert true_model(RAPTOR, truth, "x").stack == ()


OWN_EFFECT = """
from dataclasses import dataclass
from typing import ClassVar
from quadctl.effects import Conditions, Effect, parameter
from quadctl.numeric import Number, Vector
from quadctl.vehicle import Vehicle

@dataclass(frozen=True)
class Updraught(Effect):
    name: ClassVar[str] = "updraught.constant"
    source: ClassVar[str] = "this test"
    depends_on: ClassVar[tuple[str, ...]] = ()
    physics: ClassVar[str] = "Air rises."
    distinguished_by: ClassVar[str] = "flying elsewhere"
    mission: ClassVar[str] = "missions/hover_staircase.yaml"
    force_n: float = parameter(0.1, -1.0, 1.0, "N", "force up")

    def force(self, total_thrust_n: Number, c: Conditions, vehicle: Vehicle) -> Vector:
        return (0.0, 0.0, -self.force_n)
"""


def test_a_model_file_is_a_world_with_its_effects_also_those_of_ones_own(tmp_path: Path) -> None:
    (tmp_path / "own.py").write_text(OWN_EFFECT)
    (tmp_path / "model.yaml").write_text(
        yaml.safe_dump(
            {
                "vehicle": RAPTOR.model_dump(mode="json", exclude_none=True),
                "effect_files": ["own.py"],
                "effects": [
                    {"effect": "ground_effect.sanchez", "parameters": {"k_b": 1.5}, "fitted": {"logs": ["a.csv"]}},
                    {"effect": "updraught.constant", "parameters": {"force_n": 0.2}},
                ],
            }
        )
    )
    truth = load_hidden(tmp_path / "model.yaml")
    stack = true_model(RAPTOR, truth, "model.yaml").effects
    assert [(effect.name, *effect.values().values()) for effect in stack] == [
        ("ground_effect.sanchez", 1.5),
        ("updraught.constant", 0.2),
    ]
    assert truth.noise == HiddenTruth().noise


# --- the command -----------------------------------------------------------------------------------------------------


def command(where: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    code = "from quadctl.cli import main; main()"
    words = ["simulate", "missions/short_hop.yaml", "--log-dir", str(where), *arguments]
    return subprocess.run(
        [sys.executable, "-c", code, *words], cwd=ROOT, capture_output=True, text=True, check=False, timeout=60
    )


def test_the_same_seed_gives_the_same_log_to_the_last_byte(tmp_path: Path) -> None:
    logs = []
    for name, seed in (("a", "5"), ("b", "5"), ("c", "6")):
        done = command(tmp_path / name, "--seed", seed)
        assert done.returncode == 0, done.stderr
        (path,) = (tmp_path / name).glob("*.csv")
        logs.append(path.read_bytes())
    assert logs[0] == logs[1]
    assert logs[0] != logs[2]


def test_a_hidden_file_that_is_not_there_is_one_sentence_and_exit_status_1(tmp_path: Path) -> None:
    done = command(tmp_path, "--hidden", str(tmp_path / "none.yaml"))
    assert done.returncode == 1
    assert done.stderr == f"quadctl: {tmp_path / 'none.yaml'}: there is no such file\n"
    assert not list(tmp_path.glob("*.csv"))
