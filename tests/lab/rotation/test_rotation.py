"""Rotation from commands: estimates that hold in closed loop, and rollouts with an observer."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console
from scipy.stats import binom

from quadctl.effects.airspeed_moment import IsotropicMoment
from quadctl.effects.base import Conditions
from quadctl.effects.body_drag import QuadraticDrag
from quadctl.effects.centre_of_mass import FixedOffset
from quadctl.effects.motor_lag import FirstOrderLag
from quadctl.effects.rate_damping import ProportionalDamping
from quadctl.effects.rotor_drag import LinearDrag
from quadctl.effects.rotor_fault import UnequalRotors, WeakRotor
from quadctl.effects.rotor_reaction import InertialReaction
from quadctl.effects.thrust_map import LineMap
from quadctl.effects.thrust_scale import ConstantScale
from quadctl.errors import SettingsError
from quadctl.frames import GRAVITY_M_S2
from quadctl.lab import identify_rotation
from quadctl.lab.arrays import Floats
from quadctl.lab.rotation.innovations import Noise, first_order, rate_filter, unforeseen
from quadctl.lab.rotation.model import with_rotation
from quadctl.lab.rotation.parameters import Rotation, differences, fit_axis, fit_rotation
from quadctl.lab.rotation.records import Delayed, Record
from quadctl.lab.rotation.regression import change, changed
from quadctl.lab.rotation.rollout import (
    Driven,
    Physics,
    State,
    Track,
    errors,
    held,
    roll_out,
    rotation_vector,
    turned_by,
)
from quadctl.lab.rotation.shares import fit_shares
from quadctl.lab.rotation.thrust import ThrustMap, hover_command
from quadctl.lab.rotation.value import Value
from quadctl.lab.rotation.words import answer
from quadctl.model import Model, conditions, load_model
from tests.lab.rotation.closed_loop import REACTION_M, VEHICLE, Truth, flights
from tests.lab.rotation.test_forecast import observe
from tests.support.commands import Result
from tests.support.places import DATA, ROOT

TRUTH = Truth()
STILL = conditions(VEHICLE, 2.0, (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0))


class TestFilters:
    def test_the_solution_of_a_linear_equation_is_exact(self) -> None:
        time_s = np.linspace(0.0, 2.0, 201)
        for rate in (0.0, 1e-7, 3.0, -1.0):
            found = first_order(np.ones(201), rate, 0.01)
            true = time_s if abs(rate) < 1e-6 else (1.0 - np.exp(-rate * time_s)) / rate
            # The forcing begins as a ramp over the step before.
            assert found[1:] - found[0] * np.exp(-rate * time_s[1:]) == pytest.approx(true[1:], rel=1e-6)

    @pytest.mark.parametrize("damping", [0.0, 3.0])
    def test_the_noise_that_a_filter_is_made_for_leaves_it_white(self, damping: float) -> None:
        noise, step_s, n = Noise(quick_s=0.03, slow_s=1.5, slow=2.0, sensor=0.02), 0.01, 40_000
        random = np.random.default_rng(0)
        rate, quick, slow, seen = 0.0, 0.0, 0.0, np.empty(n)
        fine, per = step_s / 10.0, 10
        draws = random.standard_normal((n * per, 2))
        for k in range(n):
            seen[k] = rate + noise.sensor * random.standard_normal()
            for a, b in draws[k * per : (k + 1) * per]:
                rate += fine * (quick + slow - damping * rate)
                quick += -fine * quick / noise.quick_s + np.sqrt(2.0 * fine / noise.quick_s) * a
                slow += -fine * slow / noise.slow_s + noise.slow * np.sqrt(2.0 * fine / noise.slow_s) * b
        left = rate_filter(noise, damping, step_s).whitened(seen)[500:]
        wrong = rate_filter(Noise(0.03, 1.5, 0.02, 0.02), damping, step_s).whitened(seen)[500:]

        def correlation(x: Floats) -> float:
            return max(abs(float(x[k:] @ x[:-k] / (x @ x))) for k in (1, 2, 5, 20))

        assert correlation(left) < 0.03 < correlation(wrong)

    def test_a_disturbance_that_is_gone_within_a_step_is_one_of_each_step_by_itself(self) -> None:
        """A part that fades by e^60 within a step must not hide the slow one beside it in round-off."""
        step_s, quick_s = 0.02, 3.4e-4
        found = rate_filter(Noise(quick_s, 4.0, 1e-3, 150.0), 0.9, step_s)
        assert np.all(np.abs(np.linalg.eigvals(found.transition)) < 1.0)
        assert found.transition[0] == pytest.approx([np.exp(-0.9 * step_s), quick_s, step_s], rel=0.03)
        assert 0.0 < found.gain[0] < 1e-6  # of a sensor that tells nothing the filter takes nothing
        told = rate_filter(Noise(quick_s, 4.0, 1e-3, 1e-6), 0.9, step_s)
        assert told.gain[0] == pytest.approx(1.0, abs=0.02)


def test_what_the_log_does_not_foresee_of_a_command_is_found() -> None:
    random, n = np.random.default_rng(5), 4000
    rate, new, command = random.standard_normal(n), 0.3 * random.standard_normal(n), np.zeros(n)
    for k in range(2, n):
        command[k] = 0.2 - 0.7 * rate[k] + 0.4 * rate[k - 2] + 0.8 * command[k - 1] - 0.3 * command[k - 2] + new[k]
    assert unforeseen(command, rate, 4)[4:] == pytest.approx(new[4:], abs=0.07)
    later = rate.copy()
    later[3001:] += 1.0
    assert not np.allclose(unforeseen(command, later, 4)[3001:], new[3001:], atol=0.07)


def missed_moment(model: Model, flight: Record, truth: Truth) -> Floats:
    """Mean moment that turned a vehicle beyond what a model predicts from its commands, N m, shape (3,), of its size.

    The thrust at a command is that of rotors that are alike.
    """
    assert flight.airspeed is not None
    u, step_s = flight.drive, flight.step_s
    nominal = truth.full_n * ((1.0 - truth.bend) * u + truth.bend * u**2)
    body, rates = (tuple(signal.T) for signal in (flight.airspeed, flight.rates))
    predicted = model.body_torque(list(nominal.T), Conditions(2.0, body, (1.0, 0.0, 0.0, 0.0), rates_rad_s=rates))
    turned = np.array(truth.inertia) * np.gradient(flight.rates, step_s, axis=0)
    return np.abs(np.mean(np.array(predicted).T - turned, axis=0))


@pytest.fixture(scope="module")
def records() -> list[Record]:
    return flights(TRUTH, 4, 45.0)


@pytest.fixture(scope="module")
def found(records: list[Record]) -> Rotation:
    return fit_rotation(records, VEHICLE)


class TestInClosedLoop:
    def test_gain_lag_damping_and_airspeed_moment_lie_in_their_intervals(self, found: Rotation) -> None:
        for i, axis in enumerate(("roll", "pitch")):
            told = found.told(axis)
            assert told["gain"].low < TRUTH.gain(i) < told["gain"].high
            assert told["lag_s"].low < TRUTH.lag_s < told["lag_s"].high
            assert told["damping_1_s"].low < TRUTH.damping_1_s < told["damping_1_s"].high
            assert told["airspeed"].low < (-1.0, 1.0)[i] * TRUTH.airspeed < told["airspeed"].high
            assert told["gain"].high - told["gain"].low < 0.5 * TRUTH.gain(i)

    def test_the_reaction_of_the_rotors_lies_in_its_interval(self, found: Rotation) -> None:
        """And with it the gain in yaw, which would be half without it."""
        told, true = found.told("yaw"), VEHICLE.weight_n * REACTION_M / TRUTH.inertia[2]
        assert max(told["lead_s"].low, 0.01) < TRUTH.lead_s < told["lead_s"].high < 3.0 * TRUTH.lead_s
        assert told["gain"].low < true < told["gain"].high < 2.0 * true
        assert "lag_s" not in told

    def test_the_delay_of_the_command_lies_in_its_interval(self, found: Rotation) -> None:
        assert found.delay is not None
        assert 0.0 < found.delay.low < TRUTH.delay_s < found.delay.high < 0.05

    def test_a_loop_that_is_faster_than_the_log_does_not_make_its_commands_late(self) -> None:
        """It answers samples of the gyro that are not logged: without reckoning with that 6 ms come out as 15."""
        delays, at_hover = [], ThrustMap(1.2, False, None)
        for record in flights(replace(TRUTH, delay_s=0.006), 6, 60.0, log_every=5):
            fit = fit_axis([record], VEHICLE, 0, hover_command([record], False), at_hover)
            delays.append(fit.values["delay_s"].value)
        assert np.median(delays) < 0.0125

    def test_in_still_air_unequal_rotors_look_like_a_centre_of_mass(self) -> None:
        """It is where the thrusts of the same commands have their centre, as the controller evens them out."""
        uneven = (1.08, 0.95, 0.93, 1.04)
        still = replace(TRUTH, rotor_share=uneven, wind_m_s=(0.0, 0.0, 0.0))
        found = fit_rotation(flights(still, 1, 40.0), VEHICLE)
        places = np.array([rotor.position_m[:2] for rotor in VEHICLE.rotors])
        carried = 1.0 / np.array(uneven)
        for axis, name in enumerate(("forward", "right")):
            true = float(places[:, axis] @ carried / carried.sum())
            told = found.centre_m[name]
            assert told.low < true < told.high < told.low + 6e-3
        assert found.shares is not None and not found.shares.turns
        for number, share in enumerate(uneven, start=1):
            told = found.shares.rotors[number]
            assert told.low < share < told.high
        offset = next(e for e in with_rotation(Model(VEHICLE), found).effects if isinstance(e, FixedOffset))
        assert offset.forward_mm < -4.0

    def test_unequal_rotors_are_those_of_a_model_that_predicts_a_fresh_flight(self, found: Rotation) -> None:
        """They are told from a centre of mass by what they turn about yaw; either takes the place of the other."""
        uneven = (0.93, 1.04, 0.98, 1.05)
        truth = replace(TRUTH, rotor_share=uneven, wind_m_s=(0.0, 0.0, 0.0))
        *used, fresh = flights(truth, 9, 60.0, first=20)
        told, *alone = (
            fit_shares(some, VEHICLE, hover_command(some, False), found.thrust, found.axes)
            for some in (used, *([flight] for flight in used))
        )
        assert told is not None and told.turns and len(told.told) == 3
        for number, share in enumerate(uneven, start=1):
            assert told.rotors[number].value == pytest.approx(share, abs=0.02)
        inside = [
            one.rotors[number].low < share < one.rotors[number].high
            for one in alone
            if one is not None
            for number, share in enumerate(uneven, start=1)
        ]
        assert len(inside) == 32 and sum(inside) >= 27  # of 95 %, with four that hang together
        console = Console(width=300)
        with console.capture() as shown:
            console.print(answer(replace(found, shares=told)))
        assert "-o saves the unequal rotors." in shown.get()
        before = Model(VEHICLE).plus(FixedOffset(9.0, -4.0)).plus(WeakRotor(0.3, 2.0))
        model = with_rotation(before, replace(found, shares=told))
        (unequal,) = (effect for effect in model.effects if isinstance(effect, UnequalRotors))
        assert not {FixedOffset, WeakRotor} & set(map(type, model.effects))
        bodies = (model, model.without(unequal))
        missed, without = (missed_moment(body, fresh, truth) for body in bodies)
        assert np.all(missed < 0.5 * without)

    def test_the_elasticity_of_the_thrust_lies_in_its_interval(self, records: list[Record], found: Rotation) -> None:
        bend, weights = TRUTH.bend, -np.mean([r.force[:, 2] for r in records if r.force is not None]) / GRAVITY_M_S2
        true = weights * (1.0 - bend + 2.0 * bend * found.hover) / (1.0 - bend + bend * found.hover)
        told = found.thrust.found
        assert told is not None and told.low < true < told.high < told.low + 0.2

    def test_an_inertia_whose_interval_reaches_zero_is_not_told(self, found: Rotation) -> None:
        assert found.thrust.found is not None and set(found.inertia) >= {"roll", "pitch"}
        value = found.thrust.found.value
        unsure = replace(found.thrust, found=Value(value, -value, 3.0 * value))
        assert replace(found, thrust=unsure).inertia == {}

    def test_a_regression_of_the_angular_acceleration_misses_the_gain(
        self, records: list[Record], found: Rotation
    ) -> None:
        """The commands hold what the controller knows of the disturbances; the regression takes it for an answer."""
        wanted, columns = [], []
        for r in records:
            split = differences(r.command(False) / found.hover, found.thrust.value, VEHICLE)[:, 0]
            assert r.airspeed is not None
            columns.append(
                np.column_stack(
                    [Delayed(split, r.step_s).by(0.02, TRUTH.lag_s), r.rates[:, 0], r.airspeed[:, 1], 0.0 * split + 1.0]
                )
            )
            wanted.append(np.gradient(r.rates[:, 0], r.step_s))
        slope = np.linalg.lstsq(np.concatenate(columns), np.concatenate(wanted), rcond=None)[0][0]
        assert not found.told("roll")["slope"].low < slope < found.told("roll")["slope"].high

    def test_the_rotors_own_thrust_shows_in_their_commands(self, found: Rotation) -> None:
        """Front right and back left are strong, so they are asked for less than their neighbours of the same spin."""
        assert found.share[0] < found.share[3]
        assert found.share.mean() == pytest.approx(1.0)

    def test_what_was_not_flown_is_not_told(self, records: list[Record]) -> None:
        blind = [Record(r.name, r.step_s, r.rates, r.drive, None, None, False, None) for r in records[:1]]
        told = fit_rotation(blind, VEHICLE)
        assert not told.drag and told.thrust.found is None and not told.gain
        assert "slope" in told.told("roll") and "airspeed" not in told.told("roll")
        assert json.loads(json.dumps(told.to_dict()))["drag"] == {}

    def test_imu_and_commands_alone_tell_gain_and_lag(self, records: list[Record]) -> None:
        found = fit_rotation([replace(r, airspeed=None) for r in records], VEHICLE)
        for i, axis in enumerate(("roll", "pitch")):
            told = found.told(axis)
            assert told["gain"].low < TRUTH.gain(i) < told["gain"].high
            assert told["lag_s"].low < TRUTH.lag_s < told["lag_s"].high

    def test_a_model_turns_as_the_flights_do(self, found: Rotation) -> None:
        """Numbers of the vehicle and two effects, each within a fifth of the truth; the moment by airspeed over the
        weight, 3.5 rad/s² times the inertia, lies between 2.46 mm per m/s in roll and 2.93 in pitch."""
        before = Model(VEHICLE).plus(LinearDrag(0.3, 0.3, 0.0)).plus(ProportionalDamping(9.0, 9.0, 9.0))
        model = with_rotation(before, found)
        assert model.vehicle.principal_inertia_kg_m2[:2] == pytest.approx(TRUTH.inertia[:2], rel=0.2)
        assert model.vehicle.rotor.time_constant_s == pytest.approx(TRUTH.lag_s, rel=0.2)
        assert model.vehicle.rotor.delay_s == pytest.approx(TRUTH.delay_s, rel=0.5)
        thrust, drag, damping, moment, *others = model.effects
        assert InertialReaction in map(type, others)
        assert isinstance(thrust, LineMap) and drag == LinearDrag(0.3, 0.3, 0.0)
        assert isinstance(damping, ProportionalDamping) and isinstance(moment, IsotropicMoment)
        assert damping.roll_1_s == pytest.approx(TRUTH.damping_1_s, rel=0.4)
        assert 2.2 < moment.k < 3.2
        fitted = model.stack[3].fitted
        assert fitted is not None and fitted.logs == found.names
        assert fitted.ci95["k"][0] < moment.k < fitted.ci95["k"][1]

    def test_thrust_and_drag_are_added_where_the_model_has_none_and_a_lag_is_not_there_twice(
        self, found: Rotation
    ) -> None:
        """The map of the truth around level hover, u + bend (u^2 - u) with the weight at 0.6 or so."""
        model = with_rotation(Model(VEHICLE).plus(FirstOrderLag(0.03)), found)
        thrust, *_, drag = model.effects
        assert not model.late().effects
        assert isinstance(thrust, LineMap) and isinstance(drag, LinearDrag)
        share = VEHICLE.weight_n / (4.0 * TRUTH.full_n)
        hover = (TRUTH.bend - 1.0 + np.sqrt((1.0 - TRUTH.bend) ** 2 + 4.0 * TRUTH.bend * share)) / (2.0 * TRUTH.bend)
        line = VEHICLE.throttle
        nominal_n = [(u - line.offset) / (4.0 * line.per_newton) for u in (hover, hover + 0.02)]
        each_n = thrust.rotor_thrust(nominal_n, STILL, VEHICLE)
        assert each_n[0] == pytest.approx(VEHICLE.weight_n / 4.0, rel=0.03)
        slope = TRUTH.full_n * (1.0 - TRUTH.bend + 2.0 * TRUTH.bend * hover)
        assert (each_n[1] - each_n[0]) / 0.02 == pytest.approx(slope, rel=0.15)
        assert (drag.d_x, drag.d_y) == pytest.approx(TRUTH.drag_1_s, abs=0.1)
        with_both = with_rotation(Model(VEHICLE).plus(ConstantScale(1.1)).plus(QuadraticDrag()), found)
        assert not {LineMap, LinearDrag} & {type(effect) for effect in with_both.effects}

    def test_what_may_be_zero_is_no_effect_and_nothing_identified_is_no_model(self, found: Rotation) -> None:
        def replaced(**values: Value) -> Rotation:
            axes = {name: replace(fit, values={**fit.values, **values}) for name, fit in found.axes.items()}
            return replace(found, axes=axes)

        none = {
            "damping_1_s": Value(0.4, -0.1, 0.9),
            "airspeed": Value(0.1, -0.3, 0.5),
            "lead_s": Value(0.1, -0.1, 0.3),
        }
        centre = {"right": Value(1e-3, -1e-3, 3e-3)}
        nothing = replace(replaced(**none), centre_m=centre, shares=None, drag={}, level=None)
        assert with_rotation(Model(VEHICLE), nothing).effects == ()
        with pytest.raises(SettingsError, match="nothing of the rotation is identified"):
            with_rotation(Model(VEHICLE), replace(replaced(slope=Value(1.0, -1.0, 3.0)), centre_m={}, shares=None))

    def test_a_damping_that_may_be_a_disturbance_of_short_memory_is_not_told(self, found: Rotation) -> None:
        fit = found.axes["yaw"]
        for memory, damping, at_bound, own in (
            (-1.5, 8.0, {"log_slow_s"}, False),
            (-1.5, 0.8, {"log_slow_s"}, True),  # the rate remembers for longer
            (-1.5, 8.0, {"log_slow_s", "log_slow"}, True),  # there is no such disturbance
            (3.0, 8.0, {"log_slow_s"}, True),
        ):
            values = fit.values | {"log_slow_s": Value(memory, memory - 1.0, memory + 1.0)}
            values["damping_1_s"] = Value(damping, damping - 0.5, damping + 0.5)
            short = replace(fit, values=values, at_bound=frozenset(at_bound))
            told = replace(found, axes=found.axes | {"yaw": short}).told("yaw")
            assert ("damping_1_s" in told) == own and "slope" in told


def assert_intervals_of_forty_flights_hold_the_truth(log_every: int) -> None:
    """Those that are told, as often as 95 % intervals do, but for one chance in a thousand for each parameter; and
    nearly every flight tells every one."""
    held: dict[str, list[bool]] = {}
    for record in flights(TRUTH, 40, 63.0, log_every=log_every):
        rotation = fit_rotation([record], VEHICLE)
        pairs = []
        for i, axis in enumerate(("roll", "pitch")):
            truth = {"gain": TRUTH.gain(i), "damping_1_s": TRUTH.damping_1_s, "lag_s": TRUTH.lag_s}
            truth["airspeed"] = (-1.0, 1.0)[i] * TRUTH.airspeed
            told = rotation.told(axis)
            pairs += [(name, told[name], true) for name, true in truth.items() if name in told]
            pairs.append(("drag", rotation.drag[f"d_{'xy'[i]}"].values["drag_1_s"], TRUTH.drag_1_s[i]))
            pairs += [("inertia", rotation.inertia[axis], TRUTH.inertia[i])] if axis in rotation.inertia else []
        for name, value, true in pairs:
            held.setdefault(name, []).append(value.low <= true <= value.high)
    assert min(map(len, held.values())) >= 60 and len(held) == 6
    least = {name: binom.ppf(0.001, len(of), 0.95) for name, of in held.items()}
    assert all(sum(of) >= least[name] for name, of in held.items()), {n: np.mean(of) for n, of in held.items()}


# A class each, so that two processes can share them.
@pytest.mark.long
@pytest.mark.timeout(3000)
class TestFortyFlightsLoggedAt250Hz:
    def test_intervals_hold_the_truth(self) -> None:
        assert_intervals_of_forty_flights_hold_the_truth(log_every=2)


@pytest.mark.long
@pytest.mark.timeout(3000)
class TestFortyFlightsLoggedAt100Hz:
    def test_intervals_hold_the_truth(self) -> None:
        assert_intervals_of_forty_flights_hold_the_truth(log_every=5)


def hovering(force: Floats, moment: Floats, seconds: float = 8.0) -> tuple[Track, Driven]:
    """A vehicle that a steady force, NED, m/s^2, and moment, rad/s^2, move from rest; 100 Hz."""
    n, step_s = round(seconds / 0.01), 0.01
    time_s = step_s * np.arange(n)[:, None]
    rates = time_s * moment
    attitude = turned_by(np.tile([1.0, 0.0, 0.0, 0.0], (n, 1)), 0.5 * time_s**2 * moment)
    down = np.array([0.0, 0.0, 1.0])
    # Yaw alone: the thrust keeps its direction.
    velocity, position = time_s * force, 0.5 * time_s**2 * force
    assert np.cross(moment, down) == pytest.approx(0.0)
    return Track("made", step_s, position, velocity, attitude, rates, np.ones((n, 4))), Driven(
        np.zeros((n, 3)), np.zeros(n), np.zeros(n)
    )


PHYSICS = Physics((100.0, 100.0, 20.0), (0.0, 0.0, 0.0), (0.0, 0.0), 1.3, (0.0, 0.0, 0.0))


class TestRollouts:
    def test_the_observer_finds_a_steady_disturbance_and_the_rollout_goes_on_with_it(self) -> None:
        force, moment = np.array([0.3, -0.2, 0.5]), np.array([0.0, 0.0, 0.4])
        track, driven = hovering(force, moment)
        seen = observe(track, driven, PHYSICS)
        assert (seen[0].slow + seen[0].quick)[400] == pytest.approx(moment, abs=0.02)
        assert (seen[1].slow + seen[1].quick)[400] == pytest.approx(force, abs=0.02)
        rows = np.arange(400, 600, 20)
        (end,) = roll_out(track, driven, PHYSICS, seen, rows, [50])
        assert np.all(errors(end, track, rows + 50) < 0.1 * errors(held(track, rows, 50), track, rows + 50))

    def test_the_observer_knows_nothing_later(self) -> None:
        track, driven = hovering(np.array([0.3, 0.0, 0.0]), np.zeros(3))
        other, _ = hovering(np.array([0.3, 0.0, 0.0]), np.zeros(3))
        other.velocity[500:] += 3.0
        one, two = (observe(t, driven, PHYSICS)[1] for t in (track, other))
        np.testing.assert_array_equal(one.slow[:500], two.slow[:500])
        assert not np.allclose(one.slow[500:], two.slow[500:])

    def test_a_step_of_thrust_and_moment_is_integrated(self) -> None:
        track, driven = hovering(np.zeros(3), np.zeros(3))
        driven.mean[:] = 0.1
        driven.differences[:, 0] = 0.01
        still = observe(*hovering(np.zeros(3), np.zeros(3)), PHYSICS)
        (end,) = roll_out(track, driven, PHYSICS, still, np.array([300]), [20])
        assert end.rates[0] == pytest.approx([0.2, 0.0, 0.0], abs=1e-6)
        assert rotation_vector(track.attitude[:1], end.attitude)[0, 0] == pytest.approx(0.02, rel=1e-3)
        assert end.velocity[0, 2] == pytest.approx(-0.13 * GRAVITY_M_S2 * 0.2, rel=1e-2)


class TestChange:
    def test_a_change_leads_back_to_its_end(self) -> None:
        random = np.random.default_rng(3)
        q = random.standard_normal((2, 5, 4))
        q /= np.linalg.norm(q, axis=2, keepdims=True)
        start, end = (State(*random.standard_normal((2, 5, 3)), q[i], random.standard_normal((5, 3))) for i in (0, 1))
        back = changed(start, change(start, end, 0.5), 0.5)
        np.testing.assert_allclose(back.position, end.position)
        np.testing.assert_allclose(back.velocity, end.velocity)
        np.testing.assert_allclose(back.rates, end.rates)
        assert rotation_vector(back.attitude, end.attitude) == pytest.approx(0.0, abs=1e-9)


SIH = DATA / "px4"


@pytest.mark.skipif(not SIH.is_dir(), reason="the logs of PX4 are not here")
def test_the_command_tells_the_drag_of_the_simulator_and_no_more_than_was_flown(
    quadctl: Callable[..., Result], tmp_path: Path
) -> None:
    """PX4's SIH has a drag of 1.0 1/s; the runs were along x alone."""
    out, saved = tmp_path / "rotation.json", tmp_path / "turning.yaml"
    given = (str(SIH / "sih_quadx.yaml"), str(SIH / "B_forward.ulg"))
    shown = quadctl("rotation", *given, "--json", str(out), "-o", str(saved))
    assert shown.status == 0, shown.err
    assert load_model(saved).observer is not None
    assert quadctl("export", saved, "--to", "numpy", "-o", tmp_path / "body.py").status == 0
    assert "def roll_out(x, u, p):" in (tmp_path / "body.py").read_text()
    found = json.loads(out.read_text())
    low, high = found["drag"]["d_x"]["ci95"]
    assert low < 1.0 < high < 1.2
    assert "d_y" not in found["drag"]
    from_python = identify_rotation(SIH / "sih_quadx.yaml", SIH / "B_forward.ulg")
    assert json.loads(json.dumps(from_python.to_dict())) == found
    assert "d_x = " in shown.out


@pytest.mark.long
@pytest.mark.skipif(not SIH.is_dir(), reason="the logs of PX4 are not here")
def test_rollouts_of_the_half_of_a_flight_that_no_fit_saw_are_better_than_a_held_state(
    quadctl: Callable[..., Result], tmp_path: Path
) -> None:
    out = tmp_path / "rotation.json"
    shown = quadctl(
        "rotation", str(SIH / "sih_quadx.yaml"), str(SIH / "B_forward.ulg"), "--rollouts", "--json", str(out)
    )
    assert shown.status == 0, shown.err
    models = json.loads(out.read_text())["rollouts"]
    for quantity in ("velocity_m_s", "rotation_rad", "rates_rad_s"):
        stayed, told = (models[model]["0.5"][quantity] for model in ("held", "forecast"))
        assert told["ci95"][1] < 0.7 * stayed["ci95"][0], quantity
    assert set(models["forecast"]) == {"0.01", "0.1", "0.5", "2"}


@pytest.mark.skipif(not SIH.is_dir(), reason="the logs of PX4 are not here")
def test_a_log_of_px4_without_position_tells_its_hover_throttle_and_what_it_cannot_tell(
    quadctl: Callable[..., Result], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """A vehicle of 1 kg, whose rotors give 20 N: it hovers at 0.49 of its output."""
    from quadctl.logs import ulog

    known = {"vehicle_angular_velocity", "sensor_combined", "actuator_motors", "actuator_armed"}
    monkeypatch.setattr(ulog, "TOPICS", [name for name in ulog.TOPICS if name in known])
    logs = [str(SIH / name) for name in ("A_staircase.ulg", "B_forward.ulg")]
    refused = quadctl("compare", str(SIH / "sih_quadx.yaml"), logs[1])
    assert refused.status != 0 and "x_m" in refused.err
    out = tmp_path / "rotation.json"
    shown = quadctl("rotation", str(SIH / "sih_quadx.yaml"), *logs, "--json", str(out))
    assert shown.status == 0, shown.err
    assert "Not identified without velocity: drag" in shown.out
    found = json.loads(out.read_text())
    assert found["drag"] == {} and not any("airspeed" in axis for axis in found["axes"].values())
    assert found["hover_command"] == pytest.approx(0.49, abs=0.01)
    assert all({"slope", "gain"} <= set(axis) or not axis for axis in found["axes"].values())


@pytest.mark.skipif(not SIH.is_dir(), reason="the logs of PX4 are not here")
def test_a_log_of_other_rotors_than_the_vehicles_is_refused(quadctl: Callable[..., Result]) -> None:
    refused = quadctl("rotation", str(ROOT / "config/vehicles/f550.yaml"), str(SIH / "B_forward.ulg"))
    assert refused.status == 1 and "has the outputs of 4 motors, expected 6 as the vehicle" in refused.err
