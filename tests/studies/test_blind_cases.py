"""The generator of hidden truths does what its physics says, and the lab is right on a few quick cases."""

import math
import random
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import least_squares

from quadctl.effects import CATALOG
from quadctl.effects.ground_effect import Exponential
from quadctl.logs.flight_log import FlightLog
from quadctl.missions import load_mission
from quadctl.model import conditions
from quadctl.state import Quat, Vec3
from quadctl.vehicle import Vehicle, load_vehicle
from studies.blind_cases import nuisances as limits
from studies.blind_cases.cases import HERE, MISSIONS, STRENGTHS, TRUTHS, VEHICLES, Case, all_cases
from studies.blind_cases.fly import fly
from studies.blind_cases.judge import Result, judge
from studies.blind_cases.nuisances import Nuisances
from studies.blind_cases.scoreboard import scores
from studies.blind_cases.truths_air import (
    BladeElements,
    Breeze,
    GroundCushion,
    GroundImages,
    HubForce,
    LevellingGround,
    SkewedWakes,
)
from studies.blind_cases.truths_rotation import OffCentre, OtherInertia, StiffHubs
from studies.blind_cases.truths_vehicle import BentArms, Cable, Cargo, ChippedBlade, OtherMass, ReynoldsThrust
from studies.blind_cases.world import HiddenBody, Truth

LEVEL: Quat = (1.0, 0.0, 0.0, 0.0)
FAMILIES = {
    *("ground_effect", "ceiling_effect", "rotor_drag", "body_drag", "inflow", "translational_lift", "wind"),
    *("thrust_scale", "payload", "battery_sag", "motor_lag", "thrust_tilt", "tether", "rotor_fault", "imu_bias"),
    *("thrust_curve", "rotor_interaction", "ground_torque", "airspeed_moment"),
}


def calm(vehicle: Vehicle) -> Nuisances:
    """A set-up without any error."""
    return Nuisances((1.0,) * vehicle.n_rotors, LEVEL, 0.0, (0.0, 0.0), 0.0, 0.0, 25.0, 0.0, (0.0, 0.0, 0.0), 0)


def wrench(
    vehicle: Vehicle,
    kind: type[Truth] | None,
    strength: float = 1.0,
    height_m: float = 10.0,
    velocity: Vec3 = (0.0, 0.0, 0.0),
    rpm: float = 1.0,
    attitude: Quat = LEVEL,
    seed: int = 0,
    time_s: float = 0.0,
) -> np.ndarray:
    """Force and torque, FRD, in hover at `rpm` times the hover speed, NED velocity, in a world of one truth."""
    truths = [] if kind is None else [kind(vehicle, strength, random.Random(seed))]
    body = HiddenBody(vehicle, truths, calm(vehicle))
    hover = math.sqrt(vehicle.weight_n / vehicle.n_rotors / vehicle.rotor.thrust_n_per_rpm2)
    body.rpm = [rpm * hover] * vehicle.n_rotors
    body.position, body.velocity, body.attitude, body.time_s = (0.3, 0.2, -height_m), velocity, attitude, time_s
    force, torque = body._force_and_torque()
    return np.array([*force, *torque])


def gain(vehicle: Vehicle, kind: type[Truth], **at: Any) -> float:
    """Thrust with the truth over thrust without it, minus 1."""
    return float(wrench(vehicle, kind, **at)[2] / wrench(vehicle, None, **at)[2] - 1.0)


class TestTruths:
    @pytest.mark.parametrize("name", TRUTHS)
    def test_a_truth_of_strength_0_changes_nothing(self, raptor: Vehicle, name: str) -> None:
        tilted = (0.99, 0.05, -0.08, 0.0)
        for height_m, rpm in ((0.15, 1.0), (2.4, 1.15)):
            at: dict[str, Any] = {"height_m": height_m, "velocity": (2.0, -1.0, 0.5), "rpm": rpm, "attitude": tilted}
            nothing = wrench(raptor, None, **at)
            assert wrench(raptor, TRUTHS[name], 0.0, **at) == pytest.approx(nothing, abs=1e-12)
        body = HiddenBody(raptor, [TRUTHS[name](raptor, 0.0, random.Random(1))], calm(raptor))
        assert body.voltage_exponent == 0.0
        assert body.lag_s == (raptor.rotor.time_constant_s,) * 2
        assert body.truths[0].mass_kg(1e3) == 0.0

    @pytest.mark.parametrize("kind", [GroundCushion, GroundImages])
    def test_the_ground_lifts_as_measured_and_fades(self, raptor: Vehicle, kind: type[Truth]) -> None:
        r = raptor.rotor.radius_m
        assert 0.05 < gain(raptor, kind, height_m=1.9 * r) < 0.15
        assert gain(raptor, kind, height_m=1.2 * r) > gain(raptor, kind, height_m=1.9 * r)
        assert abs(gain(raptor, kind, height_m=20 * r)) < 0.002

    def test_the_ceiling_lifts(self, raptor: Vehicle) -> None:
        below = (raptor.ceiling_m or 0.0) - raptor.rotor.radius_m
        assert 0.1 < gain(raptor, TRUTHS["CeilingSuction"], height_m=below) < 0.2
        assert gain(raptor, TRUTHS["CeilingSuction"], height_m=1.0) < 0.002

    @pytest.mark.parametrize(("name", "power"), [("HubForce", 1.0), ("CrossflowDrag", 2.0)])
    def test_drag_pushes_against_the_velocity_and_grows_with_its_power(
        self, raptor: Vehicle, name: str, power: float
    ) -> None:
        slow, fast = (wrench(raptor, TRUTHS[name], velocity=(v, 0.0, 0.0))[0] for v in (1.0, 2.0))
        assert slow < 0.0
        assert fast / slow == pytest.approx(2.0**power)
        sideways = wrench(raptor, TRUTHS[name], velocity=(0.0, -2.0, 0.0))[1]
        assert sideways > 0.0

    def test_the_hub_force_grows_with_the_rotor_speed(self, raptor: Vehicle) -> None:
        slow, fast = (wrench(raptor, HubForce, velocity=(1.0, 0.0, 0.0), rpm=rpm)[0] for rpm in (1.0, 1.2))
        assert fast / slow == pytest.approx(1.2)

    def test_climbing_costs_thrust_and_sinking_gives_it(self, raptor: Vehicle) -> None:
        vh = raptor.hover_induced_velocity_m_s
        up, down = (gain(raptor, TRUTHS["AxialBlades"], velocity=(0.0, 0.0, w)) for w in (-0.2 * vh, 0.2 * vh))
        assert -0.6 < up / 0.2 < -0.2  # k of small rotors lies between 0.2 and 0.6
        assert 0.2 < down / 0.2 < 0.6

    def test_blade_elements_and_momentum_agree_on_the_thrust(self, raptor: Vehicle) -> None:
        blades = BladeElements(raptor, 5700.0)
        assert blades.ratio(0.0, 0.0) == pytest.approx(1.0, abs=1e-9)
        for climb, across in ((2.0, 0.0), (-1.5, 0.0), (0.0, 4.0), (1.0, 6.0)):
            thrust = blades.ratio(climb, across) * blades.hover_n
            theta = blades.pitch_m_s * (1.0 + 1.5 * (across / blades.tip_m_s) ** 2)
            inflow = theta - climb - thrust / blades.slope
            assert blades.momentum * inflow * math.hypot(across, climb + inflow) == pytest.approx(thrust, rel=1e-6)

    def test_level_flight_gives_lift(self, raptor: Vehicle) -> None:
        assert 0.02 < gain(raptor, TRUTHS["FreshAir"], velocity=(3.0, 0.0, 0.0)) < 0.15

    def test_the_breeze_pushes_where_it_blows(self, raptor: Vehicle) -> None:
        wind = Breeze(raptor, 1.0, random.Random(3))
        push = wrench(raptor, Breeze, seed=3)
        assert push[:2] / np.hypot(*push[:2]) == pytest.approx(np.array(wind.mean) / 3.0, abs=1e-6)
        assert np.hypot(*push[:2]) / raptor.mass_kg == pytest.approx(1.0, rel=0.4)

    def test_wakes_take_thrust_from_the_rear_and_lift_the_nose(self, raptor: Vehicle) -> None:
        flying = wrench(raptor, SkewedWakes, velocity=(4.0, 0.0, 0.0)) - wrench(raptor, None)
        assert flying[2] > 0.0
        assert flying[4] > 0.0
        assert abs(flying[3]) < 1e-9
        assert wrench(raptor, SkewedWakes) == pytest.approx(wrench(raptor, None))

    def test_the_ground_levels_a_tilted_vehicle_without_lifting_it(self, raptor: Vehicle) -> None:
        rolled = (math.cos(0.05), math.sin(0.05), 0.0, 0.0)
        change = wrench(raptor, LevellingGround, height_m=0.2, attitude=rolled)
        change -= wrench(raptor, None, height_m=0.2, attitude=rolled)
        assert change[:3] == pytest.approx(0.0)
        assert change[3] < -0.01
        assert abs(change[4]) < 1e-9

    def test_rotors_on_bent_arms_lean_by_two_degrees_each_by_its_own(self, raptor: Vehicle) -> None:
        truth = BentArms(raptor, 1.0, random.Random(5))
        force = wrench(raptor, BentArms, seed=5)
        assert math.degrees(math.atan2(math.hypot(force[0], force[1]), -force[2])) == pytest.approx(2.0, rel=0.01)
        assert len(set(truth.leans)) == raptor.n_rotors
        tilt = truth.parameters()["thrust_tilt.fixed"]
        effect = CATALOG["thrust_tilt.fixed"].from_values(tilt, "test")
        c = conditions(raptor, 10.0, (0.0, 0.0, 0.0), LEVEL)
        assert force[:2] == pytest.approx(effect.force(raptor.weight_n, c, raptor)[:2], abs=0.01)

    def test_stiff_hubs_lift_the_side_that_meets_the_air(self, raptor: Vehicle) -> None:
        """1.1 mm of 14.71 N per m/s: at 3 m/s forward and 1 to the left 0.04854 and 0.01618 N m."""
        turned = wrench(raptor, StiffHubs, velocity=(3.0, -1.0, 0.0)) - wrench(raptor, None)
        assert turned == pytest.approx([0.0, 0.0, 0.0, 0.01618, 0.04854, 0.0], abs=2e-5)

    def test_a_centre_of_mass_that_is_off_turns_with_the_thrust(self, raptor: Vehicle) -> None:
        """2.8 mm of 14.71 N, and 1.21 times as much at 1.1 times the speed; no force."""
        for rpm, moment_n_m in ((1.0, 0.04119), (1.1, 0.04984)):
            turned = wrench(raptor, OffCentre, rpm=rpm) - wrench(raptor, None, rpm=rpm)
            assert np.abs(turned) == pytest.approx([0.0, 0.0, 0.0, moment_n_m, moment_n_m, 0.0], rel=1e-3, abs=1e-9)

    def test_a_body_of_other_inertia_answers_a_moment_otherwise(self, raptor: Vehicle) -> None:
        truth = OtherInertia(raptor, 1.0, random.Random(3))
        body, plain = (HiddenBody(raptor, truths, calm(raptor)) for truths in ([truth], []))
        for one in (body, plain):
            one.position = (0.0, 0.0, -50.0)
            one.rpm = [6200.0, 5800.0, 6000.0, 6000.0]
            one.step([0.5] * 4, armed=True)
        factors = np.array(plain.rates)[:2] / np.array(body.rates)[:2]
        assert factors == pytest.approx([1.0 + share for share in truth.shares[:2]])
        assert all(0.1 <= abs(share) <= 0.2 for share in truth.shares)

    def test_the_cable_pulls_down_by_its_weight_and_more(self, raptor: Vehicle) -> None:
        pulls = [wrench(raptor, Cable, height_m=h)[2] - wrench(raptor, None)[2] for h in (0.0, 0.5, 1.0, 2.0)]
        assert pulls[0] == pytest.approx(0.0)
        assert pulls[2] > 0.5
        assert pulls[1] / 0.5 > pulls[3] / 2.0  # a catenary, not a straight line

    def test_a_chipped_rotor_turns_the_body_toward_itself(self, raptor: Vehicle) -> None:
        weak = ChippedBlade(raptor, 1.0, random.Random(2)).rotor
        change = wrench(raptor, ChippedBlade, seed=2) - wrench(raptor, None)
        x, y, _ = raptor.rotors[weak].position_m
        assert change[2] == pytest.approx(0.15 * raptor.weight_n / raptor.n_rotors)
        assert change[3] == pytest.approx(y * change[2])
        assert change[4] == pytest.approx(-x * change[2])

    def test_the_thrust_coefficient_is_right_in_hover_and_grows_with_speed(self, raptor: Vehicle) -> None:
        assert gain(raptor, ReynoldsThrust, rpm=1.0) == pytest.approx(0.0)
        assert 0.01 < gain(raptor, ReynoldsThrust, rpm=1.1) < 0.05

    def test_masses_change_by_the_share_said(self, raptor: Vehicle) -> None:
        assert abs(OtherMass(raptor, 1.0, random.Random(0)).mass_kg(0.0)) == pytest.approx(0.08 * raptor.mass_kg)
        cargo = Cargo(raptor, 0.5, random.Random(0))
        assert cargo.mass_kg(cargo.at_s - 0.1) == 0.0
        assert abs(cargo.mass_kg(cargo.at_s + 0.1)) == pytest.approx(0.05 * raptor.mass_kg)

    def test_the_cushion_is_no_exponential(self, raptor: Vehicle) -> None:
        heights = np.linspace(0.1, 1.5, 60)
        true = np.array([1.0 + gain(raptor, GroundCushion, height_m=float(h)) for h in heights])

        def misfit(p: np.ndarray) -> np.ndarray:
            c = conditions(raptor, heights, (0.0, 0.0, 0.0), LEVEL)
            return np.asarray(Exponential(a=float(p[0]), b=float(p[1])).ratio(c, raptor) - true)

        assert np.abs(misfit(least_squares(misfit, [0.2, 5.0]).x)).max() > 0.01

    def test_inflow_is_no_straight_line(self, raptor: Vehicle) -> None:
        blades = BladeElements(raptor, 5700.0)
        vh = raptor.hover_induced_velocity_m_s
        assert abs(blades.ratio(0.4 * vh, 0.0) + blades.ratio(-0.4 * vh, 0.0) - 2.0) > 0.01


class TestNuisances:
    @given(seed=st.integers(0, 3_000_000))
    @settings(max_examples=100)
    def test_they_stay_within_what_is_said(self, seed: int) -> None:
        n = Nuisances.draw(4, seed)
        assert all(abs(c - 1.0) <= limits.COEFFICIENT_ERROR[1] + 1e-9 for c in n.rotor_coefficients)
        lean = 2.0 * math.degrees(math.acos(min(n.attitude_bias[0], 1.0)))
        assert lean <= limits.ATTITUDE_BIAS_DEG + 1e-3
        assert abs(n.datum_m) <= limits.DATUM_M
        assert math.degrees(math.atan(math.hypot(*n.slope))) <= limits.SLOPE_DEG + 1e-9
        assert 0.02 <= n.delay_s <= 0.04 < n.rpm_delay_s + 0.03
        assert n.rpm_delay_s > n.delay_s

    def test_flights_of_a_case_share_the_set_up_but_not_the_gusts(self) -> None:
        first, second = (Nuisances.draw(4, 7, flight) for flight in (0, 1))
        assert first.rotor_coefficients == second.rotor_coefficients
        assert first.attitude_bias == second.attitude_bias
        assert first.gusts().value != second.gusts().value

    def test_some_samples_are_lost_and_some_are_held(self) -> None:
        t = np.arange(0.0, 100.0, 0.02)
        log = FlightLog("made.csv", None, {"time_s": t, "z_m": np.sin(t), "motor1_rpm": np.cos(t)})
        damaged = Nuisances.draw(4, 3).with_lost_samples(log)
        assert 0.005 < 1.0 - len(damaged) / len(log) < 0.06
        held = np.mean(np.diff(damaged["z_m"]) == 0.0)
        assert 0.005 < held < 0.08
        assert np.all(np.diff(damaged["motor1_rpm"]) != 0.0)

    def test_gusts_have_the_size_said(self) -> None:
        gusts = Nuisances.draw(4, 11).gusts()
        size = Nuisances.draw(4, 11).gust_m_s2
        north = np.array([gusts.step(0.02)[0] for _ in range(50_000)])
        assert north.std() == pytest.approx(size, rel=0.15)


class TestCases:
    def test_every_family_is_hidden_on_every_vehicle_at_every_strength(self) -> None:
        singles = [case for case in all_cases("tuning") if case.kind == "single"]
        for strength in STRENGTHS:
            for vehicle in VEHICLES:
                hidden = {c.families[0] for c in singles if c.strength == strength and c.vehicle == vehicle}
                assert hidden == FAMILIES

    def test_the_two_sets_of_seeds_share_none(self) -> None:
        tuning, final = ({case.seed for case in all_cases(name)} for name in ("tuning", "final"))
        assert not tuning & final
        assert len(tuning) == len(all_cases("tuning"))
        assert len(final) == len(all_cases("final"))

    def test_nothing_is_hidden_in_24_and_six_are_unknown_at_each_strength(self) -> None:
        cases = all_cases("final")
        assert sum(case.kind == "none" for case in cases) == 24
        assert all(sum(c.kind == "unexplained" and c.strength == s for c in cases) == 6 for s in STRENGTHS)

    @pytest.mark.parametrize("mission", sorted({m for missions in MISSIONS.values() for m in missions}))
    def test_missions_fit_between_ground_and_ceiling(self, mission: str) -> None:
        loaded = load_mission(HERE / "missions" / f"{mission}.yaml")
        assert 55.0 < loaded.duration_s < 95.0
        assert loaded.limits.max_z_m <= 2.5


def case_of(truths: tuple[str, ...], vehicle: str, strength: float = 1.0) -> Case:
    """The first such case of the tuning set."""
    wanted = (truths, vehicle, strength)
    return next(c for c in all_cases("tuning") if (c.truths, c.vehicle, c.strength) == wanted)


def short(case: Case) -> Case:
    """The same case with one flight to be seen."""
    return replace(case, missions=(case.missions[0], case.missions[-1]))


class TestFlights:
    def test_the_same_case_gives_the_same_log_which_gives_nothing_away(self) -> None:
        case = replace(case_of(("GroundCushion",), "raptor"), missions=("hop",))
        (one, effect), (two, _) = fly(case, 0), fly(case, 0)
        assert all(np.array_equal(one[name], two[name], equal_nan=True) for name in one.columns)
        assert not one.meta
        assert not one.notes
        assert effect[:, 3].max() > 0.5  # the judge knows of the cushion

    def test_vehicles_load(self) -> None:
        assert {load_vehicle(path).n_rotors for path in VEHICLES.values()} == {4, 6}


@pytest.mark.long
class TestBlindCases:
    """A handful of the scoreboard's cases; `make hidden` runs them all."""

    @pytest.mark.parametrize(
        ("truth", "vehicle"), [("GroundCushion", "raptor"), ("HubForce", "small_quad")], ids=["ground", "drag"]
    )
    def test_the_hidden_effect_is_named_and_nothing_else(self, truth: str, vehicle: str, tmp_path: Path) -> None:
        result = judge(short(case_of((truth,), vehicle)), tmp_path)
        assert result.missing == list(result.case.families), result.effects
        assert result.error_left is not None
        assert result.error_left < 1.3

    def test_where_nothing_is_hidden_nothing_is_found(self, tmp_path: Path) -> None:
        case = next(c for c in all_cases("tuning") if c.kind == "none" and c.vehicle == "raptor")
        result = judge(short(case), tmp_path)
        assert result.missing == [], result.effects


def test_a_wrong_number_of_the_file_that_no_effect_corrects_must_get_no_name() -> None:
    case = next(c for c in all_cases("tuning") if c.kind == "nameless")
    answers: list[tuple[str, list[str], tuple[str, ...]]] = [
        ("none", [], ()),
        ("unexplained", [], ()),
        ("small", [], ("tether",)),
        ("missing", ["wind"], ()),
    ]
    results = [Result(case, verdict, names, [], 1.0, None, [], small=small) for verdict, names, small in answers]
    assert [result.right for result in results] == [True, True, False, False]
    rows = {row[0]: row[1] for row in scores(results)}
    assert rows["inertia off by 20 %, centre of mass by 4 mm: nothing named"] == "2/4 = 50%"


def test_what_is_small_is_counted_by_itself_and_is_an_alarm_where_nothing_is_hidden() -> None:
    cases = all_cases("tuning")
    hidden = next(c for c in cases if c.kind == "single" and c.strength == 1.0)
    clean = next(c for c in cases if c.kind == "none")
    answers = [("small", hidden.families), ("small", ("tether",)), ("none", ())]
    results = [Result(hidden, verdict, [], [], 1.0, None, [], small=small) for verdict, small in answers]
    results += [Result(clean, verdict, [], [], 1.0, None, [], small=small) for verdict, small in answers[1:]]
    rows = {row[0]: row[1] for row in scores(results)}
    assert rows["one effect: named, and nothing else"] == "0/3 = 0%"
    assert rows["one effect: nothing named, and the right one first of what is small"] == "1/3 = 33%"
    assert rows["one effect: verdict none"] == "1/3 = 33%"
    assert rows["false alarms where nothing is hidden"] == "1 of 2"
