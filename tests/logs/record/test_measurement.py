"""The measured point, quantity and time: a lever arm, a setpoint for an attitude, rotors by another clock or in turn,
and heights in the wash of the rotors."""

import numpy as np
import pytest

from quadctl.frames import GRAVITY_M_S2, quaternion_from_euler, rotate
from quadctl.logs.columns import rpm_columns
from quadctl.logs.findings import Kind, of_kind
from quadctl.logs.flight_log import ATTITUDE, POSITION, RATES, VELOCITY, FlightLog
from quadctl.logs.record.lever_arm import at_centre_of_mass
from quadctl.logs.record.record import examine
from quadctl.model import Model
from quadctl.vehicle import Vehicle
from tests.logs.record.conftest import having
from tests.support.flights import obedient

RPM = tuple(f"motor{i}_rpm" for i in range(1, 5))


def at_point(log: FlightLog, arm_m: tuple[float, float, float]) -> FlightLog:
    """The log with position and velocity of a point of the body, FRD."""
    attitude = quaternion_from_euler(*(np.radians(log[name]) for name in ATTITUDE))
    rates = np.array([log[name] for name in RATES])
    beside = rotate(attitude, tuple(np.full(len(log), part) for part in arm_m))
    speed = rotate(attitude, tuple(np.cross(rates, np.reshape(arm_m, (3, 1)), axis=0)))
    signs = (1.0, 1.0, -1.0)
    moved = {name: log[name] + sign * part for name, sign, part in zip(POSITION, signs, beside, strict=True)}
    moved |= {name: log[name] + sign * part for name, sign, part in zip(VELOCITY, signs, speed, strict=True)}
    return having(log, **moved)


@pytest.mark.parametrize("arm_m", [(-0.2, 0.15, -0.1), (0.0, 0.0, 0.35)])
def test_the_motion_of_another_point_is_that_of_the_centre_of_mass_again(
    excited: FlightLog, arm_m: tuple[float, float, float]
) -> None:
    record = examine(at_point(excited, arm_m))
    (told,) = of_kind(record.findings, Kind.LEVER_ARM)
    assert told.figures["arm_m"] == [pytest.approx(part, abs=0.03) for part in arm_m]
    flying = (excited.time_s > record.usable[0][0]) & (excited.time_s < record.usable[-1][1])
    for name in VELOCITY:
        assert np.nanstd((record.log[name] - excited[name])[flying]) < 0.02


@pytest.mark.parametrize("arm_m", [None, (0.15, -0.1, 0.0)])
def test_the_drag_of_a_wind_along_a_leaning_body_is_no_other_point(
    in_wind: FlightLog, arm_m: tuple[float, float, float] | None
) -> None:
    """Across a body that leans by 20 degrees a wind of 5 m/s blows along its z axis with 1.7 m/s."""
    log = in_wind if arm_m is None else at_point(in_wind, arm_m)
    told = of_kind(examine(log).findings, Kind.LEVER_ARM, Kind.HEIGHT_ERROR)
    arms = [] if arm_m is None else [[pytest.approx(part, abs=0.03) for part in arm_m]]
    assert [found.figures["arm_m"] for found in told] == arms


@pytest.mark.parametrize(("lag_s", "roll_rad_s"), [(0.09, 1.0), (0.14, -1.5)])
def test_a_thrust_that_follows_late_is_no_other_point(raptor: Vehicle, lag_s: float, roll_rad_s: float) -> None:
    """Rotors that are not all alike roll the vehicle with its thrust, `roll_rad_s` per weight, and the thrust lags."""
    log = obedient(Model(raptor), 60.0, noise_m_s=0.002)
    t, v, w = log.time_s, np.array([[1.1], [3.3]]), 2.0 * np.pi * np.array([[0.17], [0.43], [0.9]])
    climb = 0.5 * np.sin(w * log.time_s).sum(axis=0)
    up = 0.5 * (w * np.cos(w * log.time_s)).sum(axis=0)
    commanded = raptor.weight_n / GRAVITY_M_S2 * (GRAVITY_M_S2 + up + lag_s * np.gradient(up, t))
    rpm = np.sqrt(commanded / raptor.n_rotors / raptor.rotor.thrust_n_per_rpm2)
    log = having(
        log,
        z_m=3.0 - (0.5 / w * np.cos(w * t)).sum(axis=0),
        vz_m_s=climb + 0.002 * np.random.default_rng(4).standard_normal(len(t)),
        roll_rate_rad_s=roll_rad_s * up / GRAVITY_M_S2,
        roll_deg=np.degrees(roll_rad_s * climb / GRAVITY_M_S2),
        pitch_deg=np.degrees(0.1 * np.sin(v * t).sum(axis=0)),
        pitch_rate_rad_s=(0.1 * v * np.cos(v * t)).sum(axis=0),
        vx_m_s=(0.1 / v * GRAVITY_M_S2 * np.cos(v * t)).sum(axis=0),
        vy_m_s=-roll_rad_s * (0.5 / w * np.cos(w * t)).sum(axis=0),
        **dict.fromkeys(rpm_columns(raptor.n_rotors), rpm),
    )
    assert at_centre_of_mass(log, "rpm", ((3.0, 57.0),))[1] == []


def test_an_attitude_that_was_commanded_is_put_on_the_clock_of_the_motion(excited: FlightLog) -> None:
    commanded = {name: excited[f"{name.removesuffix('_deg')}_cmd_deg"] for name in ATTITUDE}
    commanded = {name: np.where(np.isfinite(values), values, excited[name]) for name, values in commanded.items()}
    record = examine(having(excited, **commanded))
    (told,) = of_kind(record.findings, Kind.DELAY)
    assert told.figures["moved"] == "attitude"
    assert told.figures["median_s"] > 0.04


@pytest.mark.parametrize("share", [0.008, -0.008])
def test_rotors_by_a_clock_of_their_own_are_put_on_that_of_the_motion(excited: FlightLog, share: float) -> None:
    middle = excited.time_s[len(excited) // 2]
    at = excited.time_s + share * (excited.time_s - middle)
    record = examine(having(excited, **{name: np.interp(at, excited.time_s, excited[name]) for name in RPM}))
    told = next(found for found in of_kind(record.findings, Kind.DELAY) if found.figures["of"] == "thrust")
    flown_s = record.usable[-1][1] - record.usable[0][0]
    assert told.figures["most_s"] - told.figures["least_s"] == pytest.approx(abs(share) * flown_s, rel=0.35)


def test_rotors_that_are_told_in_turn_have_the_rate_of_one(excited: FlightLog) -> None:
    held = {}
    for i, name in enumerate(RPM):
        taken_s = np.floor((excited.time_s - 0.05 * i) / 0.2) * 0.2 + 0.05 * i
        rows = np.clip(np.searchsorted(excited.time_s, taken_s - 1e-6), 0, len(excited) - 1)
        held[name] = excited[name][rows]
    record = examine(having(excited, **held))
    assert not record.obstacles
    assert not any(found.figures.get("of") == "rotors" for found in of_kind(record.findings, Kind.SPIKES))


def test_heights_below_the_rest_are_told(hovering: FlightLog) -> None:
    wash_m = 0.9 * np.exp(-np.maximum(hovering["z_m"], 0.0) / 0.4) * (hovering[RPM[0]] > 2000.0)
    assert not of_kind(examine(hovering).findings, Kind.BELOW_REST)
    (told,) = of_kind(examine(having(hovering, z_m=hovering["z_m"] + 0.2 - wash_m)).findings, Kind.BELOW_REST)
    assert told.figures["rest_m"] == pytest.approx(0.2, abs=0.05)
    assert told.figures["lowest_m"] < 0.1
