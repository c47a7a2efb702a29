"""The effects of the vehicle and the air (battery, payload, lag, rotors, wind, moments), against values by hand.

RAPTOR: 1.5 kg, R = 0.12 m, v_h = 5.807795 m/s (v_h^2 = 33.730481), 3.67749375 N per rotor in hover. Its rotors stand at
(+-0.124, +-0.124) m: motor 1 front right, 2 rear left (both ccw), 3 front left, 4 rear right (both cw).
"""

import dataclasses
import math
import pickle
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from quadctl.compensator import check_compensator
from quadctl.effects import Conditions, Effect
from quadctl.effects.airspeed_moment import IsotropicMoment
from quadctl.effects.battery_sag import LinearSag, PowerSag
from quadctl.effects.body_drag import QuadraticDrag
from quadctl.effects.centre_of_mass import FixedOffset
from quadctl.effects.ground_effect import Exponential
from quadctl.effects.ground_torque import Levelling
from quadctl.effects.inflow import AxialInflow
from quadctl.effects.motor_lag import FirstOrderLag
from quadctl.effects.payload import MassStep
from quadctl.effects.rate_damping import ProportionalDamping
from quadctl.effects.rotor_drag import LinearDrag
from quadctl.effects.rotor_fault import FailingRotor, UnequalRotors, WeakRotor
from quadctl.effects.rotor_interaction import FrontWake
from quadctl.effects.rotor_reaction import InertialReaction
from quadctl.effects.tether import HangingTether
from quadctl.effects.thrust_curve import PowerCurve
from quadctl.effects.thrust_map import LineMap, VoltageMap
from quadctl.effects.thrust_scale import ConstantScale
from quadctl.effects.thrust_tilt import FixedTilt
from quadctl.effects.translational_lift import HorizontalLift
from quadctl.effects.wind import Push, SteadyWind, WindOfBothDrags, WindOfEachFlight
from quadctl.errors import SettingsError
from quadctl.export.centred import centred
from quadctl.frames import GRAVITY_M_S2, Quaternion, multiply, quaternion_from_euler, rotate, rotate_inverse
from quadctl.model import Model
from quadctl.sitl.vehicle.body import SimulatedBody
from quadctl.vehicle import Vehicle

LEVEL: Quaternion = (1.0, 0.0, 0.0, 0.0)
HOVER_N = 3.67749375
HEADING_EAST = quaternion_from_euler(0.0, 0.0, 0.5 * math.pi)


def at(
    velocity: Any = (0.0, 0.0, 0.0), attitude: Quaternion = LEVEL, z_m: Any = 1.0, time_s: Any = 0.0, volts: Any = 16.0
) -> Conditions:
    return Conditions(z_m, velocity, attitude, time_s, volts)


# --- battery sag ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("share", "volts", "ratio"),
    [
        # K = 1 + share (V/16 - 1)
        (0.5, 16.0, 1.0),
        (0.5, 15.2, 0.975),  # 5 % less voltage: 2.5 % less thrust
        (0.5, 16.8, 1.025),
        (2.0, 14.0, 0.75),  # 1 - 2/8
        (0.0, 10.0, 1.0),
        (5.0, 8.0, 0.4),  # 1 - 5/2 would pull: cut
        (5.0, 32.0, 1.6),
        (2.0, math.nan, 1.0),  # not known: no correction
    ],
)
def test_battery_sag_by_hand(raptor: Vehicle, share: float, volts: float, ratio: float) -> None:
    assert LinearSag(share, reference_v=16.0).ratio(at(volts=volts), raptor) == pytest.approx(ratio)


def test_a_voltage_that_is_missing_for_a_while_changes_nothing_meanwhile(raptor: Vehicle) -> None:
    volts = np.array([15.2, math.nan, 16.8])
    assert LinearSag(0.5).ratio(at(volts=volts), raptor) == pytest.approx([0.975, 1.0, 1.025])


def test_the_reference_is_the_highest_voltage_seen_or_a_usual_one_of_its_cells(raptor: Vehicle) -> None:
    flights = [at(volts=np.array([15.1, 14.8])), at(volts=np.array([16.5, 15.0]))]
    # 16.5 / 3.95 = 4.18: four cells, 4 * (4.2, 4.0)
    starts = [start.values()["reference_v"] for start in LinearSag.starts(flights, raptor)]
    assert starts == pytest.approx([16.5, 16.8, 16.0])
    assert LinearSag.starts([at(volts=np.array([math.nan]))], raptor) == [LinearSag()]


# --- payload -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("mass_kg", "time_s", "ratio"),
    [
        # K = m / (m + mass_kg) from 10 s on
        (0.5, 9.999, 1.0),
        (0.5, 10.0, 0.75),  # 1.5 / 2.0
        (0.5, 100.0, 0.75),
        (-0.3, 10.0, 1.25),  # 1.5 / 1.2
        (-20.0, 10.0, 10.0),  # a tenth of the vehicle is always left
    ],
)
def test_payload_by_hand(raptor: Vehicle, mass_kg: float, time_s: float, ratio: float) -> None:
    assert MassStep(mass_kg, 10.0).ratio(at(time_s=time_s), raptor) == pytest.approx(ratio)


@given(mass_kg=st.floats(-1.0, 3.0), thrust_n=st.floats(0.0, 9.0), roll=st.floats(-0.5, 0.5))
def test_with_a_payload_the_same_thrust_moves_a_larger_mass(
    raptor: Vehicle, mass_kg: float, thrust_n: float, roll: float
) -> None:
    c = at(attitude=quaternion_from_euler(roll, 0.1, 0.7), time_s=11.0)
    loaded = Model(raptor.model_copy(update={"mass_kg": 1.5 + mass_kg}))
    with_step = Model(raptor).plus(MassStep(mass_kg, 10.0))
    assert with_step.acceleration_ned([thrust_n] * 4, c) == pytest.approx(loaded.acceleration_ned([thrust_n] * 4, c))


def test_a_payload_is_looked_for_all_over_the_flight_but_at_its_ends_and_closer_where_it_may_be(
    raptor: Vehicle,
) -> None:
    flight = [at(time_s=np.arange(0.0, 20.01, 0.1))]
    starts = MassStep.starts(flight, raptor)
    assert starts == [MassStep(0.03, 5.0), MassStep(0.03, 9.0), MassStep(0.03, 13.0)]  # 2 % of 1.5 kg
    times = {start.values()["time_s"] for start in (*starts, *(fine for s in starts for fine in s.closer(flight)))}
    assert sorted(times) == pytest.approx(np.arange(5.0, 15.0, 0.5))
    assert MassStep.starts([at(time_s=np.arange(0.0, 8.0, 0.1))], raptor) == [MassStep()]


OWN = {"mass_kg": 0.5, "time_s": 10.0, "flight": 0.0, "time_2_s": 20.0}


@pytest.mark.parametrize(("flight", "time_s"), [(0, 10.0), (1, 10.0), (2, 20.0), (3, 10.0)])
def test_a_flight_may_have_a_moment_of_its_own(raptor: Vehicle, flight: int, time_s: float) -> None:
    effect = MassStep.from_values(OWN, "model.yaml")
    times_s = np.array([time_s - 0.1, time_s + 0.1])
    c = dataclasses.replace(at(time_s=times_s), flight=flight)
    assert effect.ratio(c, raptor) == pytest.approx([1.0, 0.75])  # 1.5 kg / (1.5 + 0.5) kg


def test_moments_of_flights_survive_a_model_file_and_another_process() -> None:
    effect = MassStep.from_values(OWN, "model.yaml")
    assert effect.values() == OWN
    assert pickle.loads(pickle.dumps(effect)) == effect
    assert type(effect).from_values(effect.values(), "model.yaml") == effect
    with pytest.raises(SettingsError, match=r"parameter time_2_s of payload\.step is -1, expected a number from 0"):
        MassStep.from_values({"time_2_s": -1}, "model.yaml")


def test_the_best_moments_of_single_flights_are_joined() -> None:
    tried = {
        MassStep(0.03, 5.0, 1.0): 2.0,
        MassStep(0.03, 9.0, 1.0): 7.0,
        MassStep(0.03, 13.0, 2.0): 4.0,
        MassStep(0.03, 5.0, 2.0): 1.0,
        MassStep(0.03, 5.0): 3.0,
    }
    (joined,) = MassStep.joined(tried)
    assert joined.values() == {"mass_kg": 0.03, "time_s": 9.0, "flight": 0.0, "time_1_s": 9.0, "time_2_s": 13.0}
    assert MassStep.joined({MassStep(0.03, 5.0): 3.0}) == []  # one flight


def test_joined_moments_are_searched_more_finely_in_each_flight() -> None:
    flights = [dataclasses.replace(at(time_s=np.arange(0.0, 20.01, 0.1)), flight=n) for n in (1, 2)]
    (joined,) = MassStep.joined({MassStep(0.03, 5.0, 1.0): 1.0, MassStep(0.03, 9.0, 2.0): 1.0})
    found = [(fine.values()["flight"], fine.values()["time_s"]) for fine in joined.closer(flights)]
    assert all(type(fine) is MassStep for fine in joined.closer(flights))
    assert [time_s for n, time_s in found if n == 1.0] == pytest.approx(np.arange(5.5, 8.9, 0.5))
    second = [*np.arange(5.5, 8.9, 0.5), *np.arange(9.5, 12.9, 0.5)]  # about 9.0 s, which was tried
    assert [time_s for n, time_s in found if n == 2.0] == pytest.approx(second)


def test_a_failing_rotor_is_joined_rotor_by_rotor() -> None:
    tried = {
        FailingRotor(rotor=2.0, time_s=5.0, flight=1.0): 3.0,
        FailingRotor(rotor=2.0, time_s=9.0, flight=2.0): 2.0,
        FailingRotor(rotor=3.0, time_s=13.0, flight=1.0): 9.0,
    }
    (joined,) = FailingRotor.joined(tried)
    assert joined.values()["rotor"] == 2.0


@pytest.mark.parametrize(
    ("mass_kg", "believed"),
    [(0.1, True), (-0.5, True), (-1.1, False), (0.01, False), (-0.01, False)],  # 70 % and 1 % of 1.5 kg
)
def test_which_payload_is_believed(raptor: Vehicle, mass_kg: float, believed: bool) -> None:
    assert MassStep(mass_kg, 10.0).believable([], raptor) is believed


# --- translational lift --------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("velocity", "ratio"),
    [
        # K = 1 + 0.3 x^2 / (1 + x^2), x = V_h / v_h
        ((0.0, 0.0, 0.0), 1.0),
        ((5.807795, 0.0, 0.0), 1.15),  # x = 1
        ((3.0, -4.0, 0.0), 1.1277020),  # x^2 = 25 / 33.730481 = 0.7411694; 0.7411694 / 1.7411694 = 0.4256734
        ((-3.0, 4.0, 0.0), 1.1277020),  # it has no sign
        ((0.0, 0.0, 9.0), 1.0),  # the climb rate does not count
        ((1e5, 0.0, 0.0), 1.3),  # nothing more to gain
    ],
)
def test_translational_lift_by_hand(raptor: Vehicle, velocity: tuple[float, float, float], ratio: float) -> None:
    assert HorizontalLift(0.3).ratio(at(velocity), raptor) == pytest.approx(ratio, abs=1e-7)


# --- wind ----------------------------------------------------------------------------------------------------------


def test_a_hover_in_the_wind_is_pushed_with_it(raptor: Vehicle) -> None:
    # Air moving north at 3 m/s, nose to the east: it comes from the right, so the vehicle moves right through it.
    model = Model(raptor).plus(SteadyWind(north_m_s=3.0, east_m_s=0.0, drag=0.3))
    c = model.in_air(at(attitude=HEADING_EAST))
    assert c.velocity_body_m_s == pytest.approx((0.0, 3.0, 0.0))
    # -1.5 * 0.3 * 3 = -1.35 N, to the left, which is north: 0.9 m/s^2
    assert model.side_force(14.7, c) == pytest.approx((0.0, -1.35, 0.0))
    assert model.acceleration_ned([HOVER_N] * 4, at(attitude=HEADING_EAST)) == pytest.approx((0.9, 0.0, 0.0))


def test_who_drifts_with_the_wind_feels_none(raptor: Vehicle) -> None:
    model = Model(raptor).plus(SteadyWind(2.0, -1.0)).plus(HorizontalLift()).plus(AxialInflow())
    assert model.acceleration_ned([HOVER_N] * 4, at((2.0, -1.0, 0.0))) == pytest.approx((0.0, 0.0, 0.0), abs=1e-12)


@given(north=st.floats(-20.0, 20.0), east=st.floats(-20.0, 20.0), yaw=st.floats(-3.0, 3.0))
def test_a_wind_pushes_the_same_way_whatever_the_heading(
    raptor: Vehicle, north: float, east: float, yaw: float
) -> None:
    heading = quaternion_from_euler(0.0, 0.0, yaw)
    model = Model(raptor).plus(SteadyWind(north, east, drag=0.2))
    push = rotate(heading, model.side_force(14.7, model.in_air(at(attitude=heading))))
    assert push == pytest.approx((0.3 * north, 0.3 * east, 0.0), abs=1e-9)  # 1.5 * 0.2 per m/s


def test_the_drag_of_a_wind_acts_along_all_axes_of_the_body(raptor: Vehicle) -> None:
    """A vehicle that leans into the wind feels some of it from above: m d w = 1.5 kg 0.3 1/s 4 m/s."""
    assert SteadyWind(1.0, 0.0, drag=0.3, drag_z=0.3).force(14.7, at((0.0, 0.0, -4.0)), raptor) == pytest.approx(
        (0.0, 0.0, 1.8)
    )


@pytest.mark.parametrize("drag", [LinearDrag(0.4, 0.4), QuadraticDrag(0.02, 0.02, 0.02)])
@pytest.mark.parametrize("order", [1, -1])
def test_beside_a_drag_the_wind_moves_the_air_and_leaves_the_force_to_the_drag(
    raptor: Vehicle, drag: Effect, order: int
) -> None:
    model = Model(raptor)
    for effect in (SteadyWind(3.0, 0.0, drag=0.3), drag)[::order]:
        model = model.plus(effect)
    c = model.in_air(at())
    assert c.velocity_body_m_s == pytest.approx((-3.0, 0.0, 0.0))  # hover, nose to the north: wind from behind
    alone = drag.force(14.7, at((-3.0, 0.0, 0.0)), raptor)
    assert alone[0] > 0.0  # pushed forward
    assert model.side_force(14.7, c) == pytest.approx(alone)


def test_the_wind_does_not_stand_back_for_what_is_no_drag(raptor: Vehicle) -> None:
    model = Model(raptor).plus(HorizontalLift(0.3)).plus(SteadyWind(5.807795, 0.0, drag=0.1))
    c = model.in_air(at())
    # It moves the air for the lift too: x = 1. -1.5 * 0.1 * -5.807795 = 0.8711693 N
    assert model.rotor_thrust([1.0] * 4, c) == pytest.approx([1.15] * 4)
    assert model.side_force(14.7, c) == pytest.approx((0.8711693, 0.0, 0.0), abs=1e-7)


def test_a_wind_is_told_from_a_tilt_where_headings_differ_or_where_no_tilt_pushes_as_hard(raptor: Vehicle) -> None:
    straight = [at(attitude=quaternion_from_euler(*np.zeros((2, 5)), np.radians([0, 10, 20, 10, 0])))]
    turning = [at(attitude=quaternion_from_euler(*np.zeros((2, 5)), np.radians([0, 90, 180, 270, 360])))]
    weak, strong = SteadyWind(1.0, 0.0, drag=0.3), SteadyWind(0.0, -2.0, drag=0.3)  # 0.3 and 0.6 m/s^2
    assert not weak.distinct(straight, raptor)
    assert weak.distinct(turning, raptor)
    assert strong.distinct(straight, raptor)


# --- thrust curve --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("exponent", "nominal_n", "thrust_n"),
    [
        # T_h (T/T_h)^(exponent/2)
        (2.0, 7.0, 7.0),
        (2.4, HOVER_N, HOVER_N),  # right in hover, whatever the exponent
        (2.4, 2.0 * HOVER_N, 8.4486620),  # 2^1.2 = 2.2973967
        (1.0, 4.0 * HOVER_N, 2.0 * HOVER_N),
        (4.0, 0.5 * HOVER_N, 0.25 * HOVER_N),
        (2.4, 0.0, 0.0),
        (2.4, -0.1, 0.0),  # noise about zero has no root
    ],
)
def test_thrust_curve_by_hand(raptor: Vehicle, exponent: float, nominal_n: float, thrust_n: float) -> None:
    given_n = PowerCurve(exponent).rotor_thrust([nominal_n] * 4, at(), raptor)
    assert list(given_n) == pytest.approx([thrust_n] * 4, abs=1e-6)


@pytest.mark.parametrize(
    ("kind", "values"),
    [
        (FixedTilt, {"pitch_deg": -7.0}),  # motors canted on purpose
        (FixedTilt, {"roll_deg": 12.0}),
        (PowerCurve, {"exponent": 1.0}),  # a command that sets thrust, in a file that takes it for speed
        (PowerCurve, {"exponent": 1.65}),
    ],
)
def test_bounds_are_what_is_possible_not_what_is_usual(kind: type[Effect], values: dict[str, float]) -> None:
    assert kind.from_values(values, "model.yaml").values().items() >= values.items()


# --- motor lag -----------------------------------------------------------------------------------------------------

CLOCK_S = np.arange(0.0, 1.0, 0.001)


def lagged(raptor: Vehicle, tau_s: float, signal: Any) -> Any:
    """Answer of the first rotor; the others are still."""
    still = np.zeros_like(signal)
    thrusts = FirstOrderLag(tau_s).rotor_thrust([signal, still, still, still], at(time_s=CLOCK_S), raptor)
    assert not np.any(thrusts[1:])
    return np.asarray(thrusts[0])


@pytest.mark.parametrize("tau_s", [0.02, 0.05, 0.1])
def test_a_lag_answers_a_step_with_1_minus_e_to_the_minus_t_over_tau(raptor: Vehicle, tau_s: float) -> None:
    rise_s = 0.2995  # joined by straight lines, the signal rises from 0.299 to 0.3 s
    after = rise_s < CLOCK_S
    answer = lagged(raptor, tau_s, np.where(after, 1.0, 0.0))
    expected = 1.0 - np.exp(-np.maximum(CLOCK_S - rise_s, 0.0) / tau_s)
    assert not np.any(answer[~after])
    # e^-8 = 3e-4 is where its memory ends
    assert answer[after] == pytest.approx(expected[after], abs=5e-4)
    assert np.interp(rise_s + tau_s, CLOCK_S, answer) == pytest.approx(0.632, abs=1e-3)  # 63 % after tau


def test_a_steady_climb_of_the_thrust_comes_tau_late(raptor: Vehicle) -> None:
    answer = lagged(raptor, 0.05, 2.0 * CLOCK_S)
    late = CLOCK_S > 0.5  # ten time constants on
    assert answer[late] == pytest.approx(2.0 * (CLOCK_S[late] - 0.05), abs=5e-4)


def test_a_lag_leaves_what_is_constant_and_a_lag_of_nothing_leaves_all(raptor: Vehicle) -> None:
    assert lagged(raptor, 0.3, np.full_like(CLOCK_S, 3.7)) == pytest.approx(np.full_like(CLOCK_S, 3.7))
    wave = 3.7 + np.sin(40.0 * CLOCK_S)
    assert lagged(raptor, 0.0, wave) == pytest.approx(wave, abs=0.0)
    assert lagged(raptor, 1e-5, wave) == pytest.approx(wave, abs=1e-3)  # and it gets there without a jump
    assert lagged(raptor, 1e-6, wave) == pytest.approx(wave, abs=1e-4)


def test_an_instant_has_no_past(raptor: Vehicle) -> None:
    assert FirstOrderLag(0.2).rotor_thrust([1.0, 2.0, 3.0, 4.0], at(time_s=7.0), raptor) == [1.0, 2.0, 3.0, 4.0]


# --- rotor fault ---------------------------------------------------------------------------------------------------


def test_a_weak_rotor_gives_less_thrust_and_turns_the_body(raptor: Vehicle) -> None:
    weak = WeakRotor(loss=0.1, rotor=1.0)
    assert weak.rotor_thrust([5.0, 6.0, 7.0, 8.0], at(), raptor) == pytest.approx([4.5, 6.0, 7.0, 8.0])
    # 0.36774938 N are missing front right: it rolls right (0.124 m), pitches nose down, and yaws left, as a ccw rotor
    # drives the body clockwise: 0.36774938 * (0.124, -0.124, -0.016)
    moment = Model(raptor).plus(weak).body_torque([HOVER_N] * 4, at())
    assert moment == pytest.approx((0.0456009, -0.0456009, -0.0058840), abs=1e-7)


def test_unequal_rotors_share_what_is_left_and_turn_the_body_also_about_yaw(raptor: Vehicle) -> None:
    """Rotors 2 and 4, which turn clockwise, have (4 - 0.93 - 1.04) / 2 = 1.015 each."""
    unequal = UnequalRotors.of({3: 1.04, 1: 0.93})
    assert unequal.values() == {"share_1": 0.93, "share_3": 1.04}
    given_n = unequal.rotor_thrust([5.0, 6.0, 7.0, 8.0], at(), raptor)
    assert given_n == pytest.approx([4.65, 6.09, 7.28, 8.12])
    even_n = unequal.rotor_thrust([HOVER_N] * 4, at(), raptor)
    assert sum(even_n) == pytest.approx(4.0 * HOVER_N)
    # Rotor 1 front right, 3 front left or behind it: what the mean of the arms says of a centre of mass, but for yaw.
    moment = Model(raptor).plus(unequal).body_torque([HOVER_N] * 4, at())
    places = np.array([rotor.position_m[:2] for rotor in raptor.rotors])
    forward_m, right_m = -(np.array(even_n) - HOVER_N) @ places / (4.0 * HOVER_N)
    offset = FixedOffset(forward_mm=1e3 * forward_m, right_mm=1e3 * right_m)
    shifted = Model(raptor).plus(offset).body_torque([HOVER_N] * 4, at())
    assert moment[:2] == pytest.approx(shifted[:2]) and max(map(abs, moment[:2])) > 0.01
    assert abs(moment[2]) > 1e-4 and shifted[2] == pytest.approx(0.0)


def test_a_share_of_no_rotor_is_refused_by_the_name_that_was_expected() -> None:
    with pytest.raises(SettingsError, match=r"model: rotor_fault.unequal has no parameter 'share_0'.*'share_1'"):
        UnequalRotors.from_values({"share_0": 1.1}, "model")


def test_a_weak_rotor_beside_others_that_are_alike_is_one_of_unequal_rotors(raptor: Vehicle) -> None:
    weak, scaled = WeakRotor(loss=0.1, rotor=2.0), 4.0 / 3.9
    unequal = UnequalRotors.of({2: 0.9 * scaled})
    thrust_n = [1.0, 2.0, 3.0, 4.0]
    expected = [scaled * given_n for given_n in weak.rotor_thrust(thrust_n, at(), raptor)]
    assert unequal.rotor_thrust(thrust_n, at(), raptor) == pytest.approx(expected)


@pytest.mark.parametrize("shares", [{5: 0.9}, {1: 0.9, 2: 1.1, 3: 1.0, 4: 1.0}, {1: 2.0, 2: 2.0}])
def test_shares_that_no_rotors_of_the_vehicle_have_are_refused(raptor: Vehicle, shares: dict[int, float]) -> None:
    assert "expected those of at most 3 of the 4 rotors" in UnequalRotors.of(shares).mismatch(raptor)
    assert UnequalRotors.of({1: 0.9, 2: 1.1, 4: 1.0}).mismatch(raptor) == ""


def test_every_rotor_may_be_the_weak_one(raptor: Vehicle) -> None:
    starts = WeakRotor.starts([], raptor)
    assert [start.values()["rotor"] for start in starts] == [1.0, 2.0, 3.0, 4.0]
    for i, start in enumerate(starts):
        given_n = start.rotor_thrust([1.0] * 4, at(), raptor)
        assert given_n[i] == 0.95 and sum(given_n) == pytest.approx(3.95)


def test_a_failing_rotor_is_a_weak_one_from_one_moment_of_one_flight_on(raptor: Vehicle) -> None:
    weak = WeakRotor(loss=0.1, rotor=2.0)
    failing = FailingRotor(loss=0.1, rotor=2.0, time_s=10.0)
    before, after, elsewhere = at(time_s=9.9), at(time_s=10.0), dataclasses.replace(at(time_s=11.0), flight=3.0)
    thrust_n = [1.0, 2.0, 3.0, 4.0]
    assert failing.rotor_thrust(thrust_n, before, raptor) == thrust_n
    assert failing.rotor_thrust(thrust_n, after, raptor) == weak.rotor_thrust(thrust_n, after, raptor)
    assert dataclasses.replace(failing, flight=2.0).rotor_thrust(thrust_n, elsewhere, raptor) == thrust_n


def test_any_rotor_may_fail_at_any_moment(raptor: Vehicle) -> None:
    flight = [at(time_s=np.arange(0.0, 20.01, 0.1))]
    starts = FailingRotor.starts(flight, raptor)
    found = {(start.values()["rotor"], start.values()["time_s"]) for start in starts}
    assert found == {(rotor, time_s) for rotor in (1.0, 2.0, 3.0, 4.0) for time_s in (5.0, 9.0, 13.0)}
    assert {fine.values()["rotor"] for fine in starts[0].closer(flight)} == {1.0}


def test_no_moment_is_looked_for_where_a_log_has_a_gap(raptor: Vehicle) -> None:
    flight = [at(time_s=np.concatenate([np.arange(0.0, 20.0, 0.1), np.arange(1000.0, 1020.0, 0.1)]))]
    times = [start.values()["time_s"] for start in MassStep.starts(flight, raptor)]
    assert len(times) < 10 and all(t < 20.0 or t > 1000.0 for t in times)


# --- rotor interaction ---------------------------------------------------------------------------------------------

ONE_ARM = 0.5 * 0.248 * math.sqrt(2.0)  # of the raptor: half the distance between opposite rotors
SHARE = 0.1 * 0.5 * math.sqrt(2.0)  # at v_h, of rotors 0.124 m behind: 0.1 * 0.124 / 0.1753625 = 0.0707107


@pytest.mark.parametrize(
    ("velocity", "lost"),
    [
        ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0)),  # hover
        ((0.0, 0.0, -5.0), (0.0, 0.0, 0.0, 0.0)),  # straight up
        ((5.807795, 0.0, 0.0), (0.0, SHARE, 0.0, SHARE)),  # forward at v_h: motors 2 and 4 are the rear ones
        ((2.9038975, 0.0, 3.0), (0.0, SHARE / 2, 0.0, SHARE / 2)),
        ((20.0, 0.0, 0.0), (0.0, SHARE, 0.0, SHARE)),  # beyond v_h no more
        ((-5.807795, 0.0, 0.0), (SHARE, 0.0, SHARE, 0.0)),  # backward: the front ones
        ((0.0, 5.807795, 0.0), (0.0, SHARE, SHARE, 0.0)),  # to the right: the left ones
        ((7.0, 7.0, 0.0), (0.0, 0.1, 0.0, 0.0)),  # along the diagonal: the rearmost alone, a whole arm behind
    ],
)
def test_interaction_by_hand(raptor: Vehicle, velocity: tuple[float, ...], lost: tuple[float, ...]) -> None:
    given_n = FrontWake(0.1).rotor_thrust([2.0] * 4, at(velocity), raptor)
    assert list(given_n) == pytest.approx([2.0 * (1.0 - share) for share in lost], abs=1e-7)


def test_interaction_pitches_the_nose_up_in_forward_flight(raptor: Vehicle) -> None:
    model = Model(raptor).plus(FrontWake(0.1))
    assert model.body_torque([3.0] * 4, at()) == pytest.approx((0.0, 0.0, 0.0), abs=1e-12)
    # two rotors of 3 N lose 7.07107 % at 0.124 m: 2 * 3 * 0.0707107 * 0.124; one of each spin: no yaw
    forward = model.body_torque([3.0] * 4, at((5.807795, 0.0, 0.0)))
    assert forward == pytest.approx((0.0, 0.0526087, 0.0), abs=1e-7)
    # to the right the leading right side goes up: roll left
    rightward = model.body_torque([3.0] * 4, at((0.0, 5.807795, 0.0)))
    assert rightward == pytest.approx((-0.0526087, 0.0, 0.0), abs=1e-7)


# --- airspeed moment -------------------------------------------------------------------------------------------------


def test_an_airspeed_moment_by_hand(raptor: Vehicle) -> None:
    """10 N in all, rolled, pitched and heading east: a moment by the airspeed in the body, and no force."""
    turned = multiply(HEADING_EAST, quaternion_from_euler(0.2, -0.3, 0.0))
    effect = IsotropicMoment(k=1.1)
    moment = effect.torque([1.0, 2.0, 3.0, 4.0], at((3.0, -2.0, 0.7), attitude=turned), raptor)
    assert moment == pytest.approx((10.0 * -1.1e-3 * -2.0, 10.0 * 1.1e-3 * 3.0, 0.0))
    assert not effect.acts_by("force") and not effect.acts_by("rotor_thrust")


def test_a_drag_above_the_centre_of_mass_is_an_airspeed_moment(raptor: Vehicle) -> None:
    """d = 0.4 1/s, 20 mm above: in hover roll and pitch are -/+ d h / g, the moment of its force about the centre."""
    height_m, velocity = 0.02, (2.0, -1.5, 0.0)
    x, y, _ = LinearDrag(d_x=0.4, d_y=0.4).force(4.0 * HOVER_N, at(velocity), raptor)
    per_airspeed = 1e3 * 0.4 * height_m / 9.80665
    moment = IsotropicMoment(per_airspeed).torque([HOVER_N] * 4, at(velocity), raptor)
    assert moment == pytest.approx((height_m * y, -height_m * x, 0.0), rel=1e-4)


def test_in_a_wind_the_moment_is_that_of_the_airspeed(raptor: Vehicle) -> None:
    """Flying north at 3 m/s, heading east, in a wind to the north of 5 m/s: the air comes from the right at 2 m/s."""
    model = Model(raptor).plus(SteadyWind(north_m_s=5.0, east_m_s=0.0, drag=0.0)).plus(IsotropicMoment(0.7))
    c = at(rotate_inverse(HEADING_EAST, (3.0, 0.0, 0.0)), attitude=HEADING_EAST)
    assert model.body_torque([3.0] * 4, c) == pytest.approx((12.0 * -0.7e-3 * 2.0, 0.0, 0.0), abs=1e-9)


def test_a_moment_of_less_than_a_tenth_of_a_millimetre_is_negligible() -> None:
    assert IsotropicMoment(-0.09).negligible()
    assert not IsotropicMoment(-0.11).negligible()


def test_a_rate_is_damped_in_proportion_to_the_inertia(raptor: Vehicle) -> None:
    """-(0.0123 x 2 x 1.5, 0.0123 x 3 x -0.5, 0.0224 x 0.5 x 2) N m."""
    turning = dataclasses.replace(at(), rates_rad_s=(1.5, -0.5, 2.0))
    torque = ProportionalDamping(2.0, 3.0, 0.5).torque([HOVER_N] * 4, turning, raptor)
    assert torque == pytest.approx((-0.0369, 0.01845, -0.0224))


def test_the_simulated_body_stops_turning_by_it(raptor: Vehicle) -> None:
    """A free yaw rate falls to exp(-d t): 2 rad/s to 2 exp(-1.5 x 0.4) = 1.0976 rad/s."""
    body = SimulatedBody(Model(raptor).plus(ProportionalDamping(0.0, 0.0, 1.5)))
    body.position, body.rates = (0.0, 0.0, -50.0), (0.0, 0.0, 2.0)
    for _ in range(200):
        body.step([0.0] * 4, armed=False)
    assert body.rates[2] == pytest.approx(1.0976, rel=2e-3)


def test_a_rotor_that_spins_up_turns_the_body_against_its_spin(raptor: Vehicle) -> None:
    """0.08 s x 0.016 m x (2 + 1 - 0.5 + 3) N/s: motors 1 and 2 turn ccw and gain thrust."""
    changing = dataclasses.replace(at(), thrust_rate_n_s=(2.0, 1.0, 0.5, -3.0))
    assert InertialReaction(0.08).torque([HOVER_N] * 4, changing, raptor) == pytest.approx((0.0, 0.0, 0.00704))
    assert InertialReaction(0.08).torque([HOVER_N] * 4, at(), raptor) == (0.0, 0.0, 0.0)


def test_a_delay_of_the_command_comes_before_the_lag(raptor: Vehicle) -> None:
    """10 ms are five steps, in which the rotors do not yet turn."""
    late = Vehicle.model_validate(
        raptor.model_dump(exclude_none=True) | {"rotor": raptor.rotor.model_dump() | {"delay_s": 0.01}}
    )
    bodies = SimulatedBody(Model(late)), SimulatedBody(Model(raptor))
    turned = []
    for body in bodies:
        rpm = []
        for _ in range(20):
            body.step([0.5] * 4, armed=True)
            rpm.append(body.rpm[0])
        turned.append(rpm)
    assert turned[0][:5] == [0.0] * 5
    assert turned[0][5:] == pytest.approx(turned[1][:15], rel=1e-3)
    assert turned[1][0] > 0.0


def test_the_simulated_body_keeps_its_angular_momentum_with_that_of_its_rotors(raptor: Vehicle) -> None:
    """Turning faster than without the rotors' inertia, by lead x c x change of the thrusts over its own."""

    def flown(lead_s: float) -> SimulatedBody:
        body = SimulatedBody(Model(raptor).plus(InertialReaction(lead_s)))
        body.position = (0.0, 0.0, -50.0)
        for _ in range(30):
            body.step([0.6, 0.6, 0.3, 0.3], armed=True)
        return body

    heavy, light = flown(0.09), flown(0.0)
    k, c = raptor.rotor.thrust_n_per_rpm2, raptor.rotor.torque_to_thrust_m
    thrust = [k * rpm * rpm for rpm in heavy.rpm]
    gained = 0.09 * c * (thrust[0] + thrust[1] - thrust[2] - thrust[3])
    assert gained > 0.0
    more = heavy.rates[2] - light.rates[2]
    assert more == pytest.approx(gained / raptor.principal_inertia_kg_m2[2], rel=1e-6)


def test_a_wake_takes_no_more_than_nine_tenths(raptor: Vehicle) -> None:
    assert min(FrontWake(3.0).rotor_thrust([1.0] * 4, at((6.0, 6.0, 0.0)), raptor)) == pytest.approx(0.1)


# --- ground torque -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("z_m", "moment_n_m"),
    [
        # -12 N * 0.5 * 0.12 m e^(-z/R) * (0.1, -0.05) rad, e^-1 = 0.3678794
        (0.12, (-0.0264873, 0.0132437, 0.0)),
        (0.0, (-0.072, 0.036, 0.0)),
        (-0.1, (-0.072, 0.036, 0.0)),  # below the ground as on it
        (5.0, (0.0, 0.0, 0.0)),
    ],
)
def test_levelling_by_hand(raptor: Vehicle, z_m: float, moment_n_m: tuple[float, ...]) -> None:
    c = at(attitude=quaternion_from_euler(0.1, -0.05, 2.0), z_m=z_m)
    assert Levelling(0.5, 1.0).torque([1.0, 2.0, 4.0, 5.0], c, raptor) == pytest.approx(moment_n_m, abs=1e-7)


@given(roll=st.floats(-1.0, 1.0), pitch=st.floats(-1.0, 1.0), yaw=st.floats(-3.0, 3.0), z_m=st.floats(0.0, 0.5))
def test_levelling_turns_back_to_level(raptor: Vehicle, roll: float, pitch: float, yaw: float, z_m: float) -> None:
    c = at(attitude=quaternion_from_euler(roll, pitch, yaw), z_m=z_m)
    mx, my, mz = Levelling(2.0, 3.0).torque([3.0] * 4, c, raptor)
    assert mx * roll <= 1e-12 and my * pitch <= 1e-12 and mz == 0.0


DAYS = {"north_m_s": -4.0, "east_m_s": 0.0, "drag": 0.25, "drag_z": 0.0, "north_2_m_s": 0.0, "east_2_m_s": 2.5}


@pytest.mark.parametrize(("flight", "wind"), [(0, (-4.0, 0.0, 0.0)), (1, (-4.0, 0.0, 0.0)), (2, (0.0, 2.5, 0.0))])
def test_a_flight_may_have_a_wind_of_its_own(raptor: Vehicle, flight: int, wind: tuple[float, ...]) -> None:
    effect = WindOfEachFlight.from_values(DAYS, "model.yaml")
    hover = dataclasses.replace(at(), flight=flight)
    assert effect.wind_ned_m_s(hover) == wind
    assert pickle.loads(pickle.dumps(effect)) == effect
    assert effect.values() == {**DAYS, "area_m2": 0.0, "area_z_m2": 0.0}
    still = {**DAYS, "north_m_s": 0.0}
    assert not WindOfEachFlight.from_values(still, "model.yaml").negligible()  # no wind in the first flight only
    assert WindOfEachFlight.from_values({**still, "east_2_m_s": 0.1}, "model.yaml").negligible()


def test_a_push_has_its_direction_over_ground(raptor: Vehicle) -> None:
    east = at(attitude=quaternion_from_euler(0.0, 0.0, math.pi / 2.0))  # its right side points south
    assert Push(0.5, 0.2).force(14.7, east, raptor) == pytest.approx((0.3, -0.75, 0.0))  # 1.5 kg


def test_a_push_is_more_than_a_frame_that_is_askew_gives(raptor: Vehicle) -> None:
    """A level that is off by 2.2 degrees gives 0.38 m/s^2 to one side, whatever the heading."""
    assert not Push(0.3, -0.23).believable([at()], raptor)
    assert Push(-0.4, 0.3).believable([at()], raptor)  # 0.5 m/s^2


def test_the_wind_of_each_flight_shows_in_one_of_them(raptor: Vehicle) -> None:
    """A thrust that is tilted leans the same way in flights that point north and east, as two winds may do."""
    north, east = (at(attitude=quaternion_from_euler(*np.zeros((2, 2)), np.full(2, yaw))) for yaw in (0.0, 1.6))
    flights = [dataclasses.replace(c, flight=number) for number, c in enumerate((north, east), start=1)]
    tilted = {**DAYS, "north_m_s": -1.2, "east_m_s": 0.0, "north_2_m_s": 0.0, "east_2_m_s": -1.2}  # 0.3 m/s^2
    assert not WindOfEachFlight.from_values(tilted, "model.yaml").distinct(flights, raptor)
    assert WindOfEachFlight.from_values({**tilted, "north_m_s": -4.0}, "model.yaml").distinct(flights, raptor)


# --- what they promise ---------------------------------------------------------------------------------------------

THEM: tuple[type[Effect], ...] = (
    *(LinearSag, MassStep, HorizontalLift, SteadyWind, PowerCurve, FirstOrderLag),
    *(WeakRotor, FailingRotor, FrontWake, Levelling),
)
speed = st.floats(-12.0, 12.0)
angle = st.floats(-1.0, 1.0)


@pytest.mark.parametrize("kind", [kind for kind in THEM if kind is not FirstOrderLag])
@given(
    data=st.data(),
    samples=st.lists(
        st.tuples(speed, speed, speed, angle, angle, st.floats(0.0, 2.0), st.floats(0.0, 60.0), st.floats(10.0, 17.0)),
        min_size=1,
        max_size=6,
    ),
)
def test_moments_and_air_of_a_log_at_once_are_those_of_one_sample_at_a_time(
    raptor: Vehicle, kind: type[Effect], data: st.DataObject, samples: list[tuple[float, ...]]
) -> None:
    effect = kind(**{p.name: data.draw(st.floats(p.low, p.high)) for p in kind.parameters()})
    model = Model(raptor).plus(effect).plus(HorizontalLift(0.2) if kind is not HorizontalLift else LinearDrag())
    u, v, w, roll, pitch, z, time, volts = (np.array(column) for column in zip(*samples, strict=True))
    log = at((u, v, w), quaternion_from_euler(roll, pitch, 0.3), z, time, volts)
    nominal = [1.0, 2.0, 3.0, 4.0]
    at_once = [
        np.broadcast_to(x, z.shape)
        for x in (*model.body_force(nominal, log), *model.body_torque(nominal, log), *effect.wind_ned_m_s(log))
    ]
    for i, (ui, vi, wi, ri, pi, zi, ti, bi) in enumerate(samples):
        c = at((ui, vi, wi), quaternion_from_euler(ri, pi, 0.3), zi, ti, bi)
        one = (*model.body_force(nominal, c), *model.body_torque(nominal, c), *effect.wind_ned_m_s(c))
        assert all(type(number) is float for number in one), "no numpy numbers in the control loop"
        assert [x[i] for x in at_once] == pytest.approx(one, rel=1e-9, abs=1e-9)


@pytest.mark.parametrize(
    ("small", "real"),
    [
        (SteadyWind(0.2, -0.2), SteadyWind(0.5, 0.0)),
        (PowerCurve(2.04), PowerCurve(1.84)),
        (FirstOrderLag(0.01), FirstOrderLag(0.05)),
        (WeakRotor(0.05), WeakRotor(0.08)),
    ],
)
def test_what_any_vehicle_is_off_by_is_negligible(small: Effect, real: Effect) -> None:
    assert small.negligible() and not real.negligible()


def test_no_fit_moves_a_rotors_number_the_time_and_flight_of_an_onset_or_the_reference_voltage() -> None:
    held = {f"{kind.family()}.{p.name}" for kind in THEM for p in kind.parameters() if not p.fitted}
    onsets = {f"{family}.{name}" for family in ("payload", "rotor_fault") for name in ("time_s", "flight")}
    assert held == {"battery_sag.reference_v", "rotor_fault.rotor", *onsets}


def test_what_turns_the_body_says_so(raptor: Vehicle) -> None:
    c = at((4.0, 1.0, 0.0), quaternion_from_euler(0.1, -0.2, 0.0), z_m=0.1, time_s=1.0, volts=15.0)
    balanced = Model(raptor).body_torque([3.0] * 4, c)
    for kind in THEM:
        turned = Model(raptor).plus(kind()).body_torque([3.0] * 4, c)
        assert (math.dist(turned, balanced) > 1e-6) is kind.affects_moment, kind.name


@pytest.mark.parametrize("effect", [SteadyWind(), MassStep()])
def test_what_belongs_to_one_day_may_not_fly(raptor: Vehicle, effect: Effect) -> None:
    with pytest.raises(SettingsError, match=f"{effect.name} cannot be compensated"):
        check_compensator(Model(raptor).plus(effect), 0.1, 2.0, "model.yaml")


# --- what others imply, and what has more than one form ---------------------------------------------------------------


def test_a_thrust_map_by_hand(raptor: Vehicle) -> None:
    """Four rotors of 3 N with 20 % more slope, and a tenth of the weight of 14.71 N on top: 3.6 + 0.368 N each."""
    thrust = LineMap(factor=1.2, offset=0.1).rotor_thrust([3.0] * 4, at(), raptor)
    assert thrust == pytest.approx([3.6 + 0.1 * raptor.weight_n / 4] * 4)


def test_a_thrust_map_with_voltage_by_hand(raptor: Vehicle) -> None:
    """Hover takes w = V / V_ref of each rotor: 0.9 at 14.4 V, so W / 4 (0.7 x 0.9 + 0.4 x 0.81)."""
    thrust_map, each = VoltageMap(linear=0.7, square=0.4, reference_v=16.0), raptor.weight_n / 4
    assert thrust_map.rotor_thrust([each] * 4, at(volts=14.4), raptor) == pytest.approx([0.954 * each] * 4)
    assert thrust_map.rotor_thrust([each] * 4, at(volts=float("nan")), raptor) == pytest.approx([1.1 * each] * 4)
    more_n = 1.5 * each
    w = (raptor.throttle.offset + raptor.throttle.per_newton * 4 * more_n) / raptor.hover_throttle
    one = thrust_map.rotor_thrust([more_n, each, each, each], at(), raptor)[0]
    assert one == pytest.approx(each * (0.7 * w + 0.4 * w * w))


def test_the_reference_of_a_thrust_map_is_the_mean_voltage(raptor: Vehicle) -> None:
    flights = [at(volts=np.array([16.0, 15.0])), at(volts=np.array([14.0, 13.0]))]
    (start,) = VoltageMap.starts(flights, raptor)
    assert start.values()["reference_v"] == pytest.approx(14.5)


def test_a_centre_of_mass_forward_and_right_turns_down_there(raptor: Vehicle) -> None:
    """12 N at 5 mm and 3 mm: pitch down by 0.06, roll right by 0.036 N m; the moments about the shifted point."""
    offset, thrust = FixedOffset(forward_mm=5.0, right_mm=3.0), [3.5, 2.5, 3.2, 2.8]
    assert offset.torque(thrust, at(), raptor) == pytest.approx((0.036, -0.06, 0.0))
    shifted = centred(Model(raptor).plus(offset))
    assert shifted.effects == ()
    expected = Model(raptor).plus(offset).body_torque(thrust, at())
    assert shifted.body_torque(thrust, at()) == pytest.approx(expected)


def test_a_battery_that_sags_by_a_tenth_takes_a_fifth_of_the_thrust(raptor: Vehicle) -> None:
    """(0.9)^2 = 0.81; without a voltage nothing is corrected."""
    sag = PowerSag(share=2.0, reference_v=16.0)
    assert sag.ratio(at(volts=14.4), raptor) == pytest.approx(0.81)
    assert sag.ratio(at(volts=float("nan")), raptor) == 1.0


def test_a_payload_of_one_flight_leaves_the_others(raptor: Vehicle) -> None:
    step = MassStep(mass_kg=0.5, time_s=10.0, flight=2.0)
    first, second = (dataclasses.replace(at(time_s=20.0), flight=number) for number in (1, 2))
    assert (step.ratio(first, raptor), step.ratio(second, raptor)) == (1.0, pytest.approx(0.75))


def test_a_wind_on_rotors_and_frame_pushes_with_the_speed_and_its_square(raptor: Vehicle) -> None:
    """m drag v + 1/2 rho A v^2 = 1.5 0.2 4 + 0.5 1.205 0.02 16 = 1.2 + 0.1928 N on a vehicle of 1.5 kg that hovers in a
    wind of 4 m/s from behind."""
    model = Model(raptor).plus(WindOfBothDrags(4.0, 0.0, drag=0.2, area_m2=0.02))
    assert model.side_force(14.7, model.in_air(at())) == pytest.approx((1.3928, 0.0, 0.0))


def test_a_storm_without_drag_is_no_wind(raptor: Vehicle) -> None:
    hover = [array_conditions(np.zeros(3))]
    assert SteadyWind(5.0, 0.0, drag=0.2).believable(hover, raptor)
    assert not SteadyWind(12.0, 0.0, drag=0.01).believable(hover, raptor)
    assert not SteadyWind(1.0, 0.0, drag=0.0, drag_z=0.2).believable(hover, raptor)  # an inflow, and no wind
    assert SteadyWind(1.0, 0.0, drag=0.2, drag_z=0.2).standing_back().believable(hover, raptor)
    assert not SteadyWind(0.1, 0.0, drag=0.2).believable(hover, raptor)
    assert not SteadyWind(0.2, 0.0, drag=0.4).believable(hover, raptor)  # a drag, in air that hardly moves


def array_conditions(height_above_m: np.ndarray) -> Conditions:
    """Level hover at heights of 0.1 m and more above the ground."""
    zero = np.zeros_like(height_above_m)
    return Conditions(0.1 + height_above_m, (zero, zero, zero), (zero + 1.0, zero, zero, zero), zero)


def test_the_levelling_that_a_ground_effect_on_each_rotor_gives_is_implied_by_it(raptor: Vehicle) -> None:
    """K = 1 + 0.3 exp(-6 z): -K' y^2 = 1.8 0.124^2 exp(-6 z) N m / rad per N, a stiffness of 0.23 that fades over
    0.17 m, or 1.39 radii."""
    flights = [array_conditions(np.linspace(0.0, 0.5, 50))]
    ground, reach = Exponential(a=0.3, b=6.0), 1.0 / (6.0 * raptor.rotor.radius_m)
    as_much = Levelling(stiffness=1.8 * 0.124**2 / raptor.rotor.radius_m, reach=reach)
    assert as_much.implied_by([ground], flights, raptor)
    assert not as_much.implied_by([], flights, raptor)
    assert not dataclasses.replace(as_much, stiffness=4.0 * as_much.stiffness).implied_by([ground], flights, raptor)


def test_a_moment_that_an_inflow_on_each_rotor_gives_is_implied_by_it(raptor: Vehicle) -> None:
    """A vehicle that flies to and fro at 0.3 Hz pitches at -0.06 rad/s per m/s. Its rotors at the arm x climb at -x q,
    and lose k x q / v_h of their thrust: -k x^2 q / v_h T, a moment of 0.06 k x^2 / v_h per m/s and thrust."""
    t = np.arange(0.0, 40.0, 0.1)
    speed, zero = 2.0 * np.sin(0.6 * np.pi * t), np.zeros_like(t)
    level, rates = (zero + 1.0, zero, zero, zero), (zero, -0.06 * speed, zero)
    flights = [Conditions(zero + 3.0, (speed, zero, zero), level, t, rates_rad_s=rates)]
    x2 = np.mean([rotor.position_m[0] ** 2 for rotor in raptor.rotors])
    as_much = IsotropicMoment(k=1e3 * 0.06 * 0.4 * x2 / raptor.hover_induced_velocity_m_s)
    assert as_much.implied_by([AxialInflow(0.4)], flights, raptor)
    assert as_much.implied_by([LinearDrag(), AxialInflow(0.25)], flights, raptor)
    assert not as_much.implied_by([AxialInflow(0.1)], flights, raptor)
    assert not as_much.implied_by([LinearDrag()], flights, raptor)
    assert not IsotropicMoment(-as_much.k).implied_by([AxialInflow(0.4)], flights, raptor)


def test_a_cable_shows_where_heights_are_flown(raptor: Vehicle) -> None:
    climbs, held = (array_conditions(np.linspace(0.0, span, 50)) for span in (1.0, 0.4))
    assert HangingTether(0.1).distinct([climbs], raptor)
    assert not HangingTether(0.1).distinct([held], raptor)
    assert HangingTether(0.1).distinct([held, climbs], raptor)


def test_an_inflow_as_small_as_a_drag_that_does_not_count_is_negligible(raptor: Vehicle) -> None:
    """At the induced velocity of hover a drag d along body z is an inflow of d v_h / g."""
    per_drag = raptor.hover_induced_velocity_m_s / GRAVITY_M_S2
    for drag, counts in ((0.02, False), (0.09, True)):
        assert LinearDrag(0.0, 0.0, drag).negligible() is not counts
        assert AxialInflow(drag * per_drag).negligible() is not counts


def test_a_small_scale_beside_a_sag_is_its_reference_voltage(raptor: Vehicle) -> None:
    flights = [array_conditions(np.zeros(3))]
    assert ConstantScale(0.97).implied_by([LinearSag()], flights, raptor)
    assert not ConstantScale(0.9).implied_by([LinearSag()], flights, raptor)
    assert not ConstantScale(0.97).implied_by([], flights, raptor)


def test_drag_areas_far_beyond_the_rotor_disks_are_not_believed(raptor: Vehicle) -> None:
    flights = [array_conditions(np.zeros(3))]
    assert QuadraticDrag(0.03, 0.03, 0.1).believable(flights, raptor)
    assert not QuadraticDrag(0.03, 0.03, 0.7).believable(flights, raptor)


def test_a_drag_along_the_thrust_axis_alone_is_no_drag_where_the_others_were_flown(raptor: Vehicle) -> None:
    hover, run = (
        [dataclasses.replace(array_conditions(np.zeros(3)), velocity_body_m_s=(u, 0.0 * u, 0.0 * u))]
        for u in (np.zeros(3), np.array([0.0, 2.0, 4.0]))
    )
    assert not LinearDrag(0.0, 0.01, 0.3).believable(run, raptor)
    assert LinearDrag(0.0, 0.01, 0.3).believable(hover, raptor)
    assert LinearDrag(0.2, 0.0, 0.3).believable(run, raptor)
    assert not QuadraticDrag(0.0, 0.0, 0.02).believable(run, raptor)


def test_a_drag_along_the_thrust_axis_alone_is_part_of_an_inflow(raptor: Vehicle) -> None:
    flights = [array_conditions(np.zeros(3))]
    for vertical, every in (
        (LinearDrag(0.0, 0.0, 0.2), LinearDrag(0.2, 0.2, 0.2)),
        (QuadraticDrag(0.0, 0.0, 0.02), QuadraticDrag(0.02, 0.02, 0.02)),
    ):
        assert vertical.implied_by([AxialInflow(0.2)], flights, raptor)
        assert not every.implied_by([AxialInflow(0.2)], flights, raptor)
        assert not vertical.implied_by([], flights, raptor)
