"""Slow forces and moments in exported code: observed in the past of a flight, and replays of what no fit saw.

Each target replays a simulated flight, whose truth is known, and flights of a real Crazyflie.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import pytest

from quadctl.effects import Effect
from quadctl.effects.centre_of_mass import FixedOffset
from quadctl.effects.motor_lag import FirstOrderLag
from quadctl.effects.rate_damping import ProportionalDamping
from quadctl.effects.rotor_drag import LinearDrag
from quadctl.export.crazyflow import crazyflow_code
from quadctl.export.numpy_code import numpy_code
from quadctl.export.rotorpy import rotorpy_code
from quadctl.export.targets import PROGRAMS
from quadctl.lab.arrays import Floats
from quadctl.lab.rotation.model import with_rotation
from quadctl.lab.rotation.parameters import fit_rotation
from quadctl.lab.rotation.replay import Replay, fit_observer
from quadctl.lab.rotation.rollout import State, Track, errors
from quadctl.lab.rotation.unseen import flown_of
from quadctl.logs.table import read_by_map
from quadctl.model import Model, StackedEffect
from quadctl.observer import AXES, rolled_out
from quadctl.vehicle import load_vehicle
from tests.support.places import DATA, ROOT
from tests.support.replayed import (
    STEP_S,
    STEPS,
    Flight,
    disturbed_model,
    flown,
    of_held,
    states,
)

NANOBENCH = DATA / "nanobench"
P = [np.nan, 0.0]
FLIP = np.array([1.0, -1.0, -1.0])
"""Between north, east, down and north, west, up, and between forward, right, down and forward, left, up."""
ROTATION, RATES = 2, 3


@dataclass(frozen=True)
class Case:
    """A model with an observer, and a flight that its fit did not see."""

    model: Model
    track: Track

    @property
    def rows(self) -> Floats:
        return np.arange(250, len(self.track.rates) - max(STEPS) - 1, 25)

    def missed(self, ends: Floats, rows: Floats) -> Floats:
        """Mean errors, shape (horizons, quantities), of states of shape (states, steps + 1, windows)."""
        found = [State(*(ends[part, k].T for part in PARTS)) for k in STEPS]
        return np.array([errors(e, self.track, rows + k).mean(axis=0) for e, k in zip(found, STEPS, strict=True)])


PARTS = (slice(3), slice(3, 6), slice(6, 10), slice(10, 13))


def written(model: Model) -> dict[str, Any]:
    """Names that the NumPy file defines."""
    place: dict[str, Any] = {}
    exec(numpy_code(model)[0], place)
    return place


@dataclass(frozen=True, eq=False)
class Windows:
    """Windows of a flight as the exported NumPy code observes them."""

    case: Case
    code: dict[str, Any]
    rows: Floats
    begin: Floats
    """States, shape (states, windows)."""
    sent: Floats
    """Commands after the delay, shape (rotors, steps + 1, windows)."""

    @property
    def commanded_n(self) -> Floats:
        """Nominal thrusts of the commands, shape as of `sent`."""
        return np.asarray(self.code["commanded_thrust"](self.sent))

    def missed(self, ends: Floats) -> Floats:
        return self.case.missed(ends, self.rows)

    def thrusts_n(self, nominal_n: Floats) -> Floats:
        """Thrust of each rotor, from the nominal ones; the effects on it depend on nothing else here."""
        return np.asarray(self.code["rotor_thrust"](nominal_n, None))

    def without(self, *axes: str) -> Floats:
        """The states without the disturbances along these axes."""
        begin = self.begin.copy()
        for i, name in enumerate(self.code["DISTURBANCES"]):
            if any(f"_{axis}_" in name for axis in axes):
                begin[i - len(self.code["DISTURBANCES"])] = 0.0
        return begin

    def rolled(self, begin: Floats) -> Floats:
        return np.asarray(self.code["roll_out"](begin, self.sent, P))

    def driven(self, begin: Floats) -> Floats:
        """Rollouts that trust all that is observed."""
        return rolled_out(
            lambda x, u: self.code["x_dot_disturbed"](x, u, P), begin, self.sent, self.code["LAGS_S"], STEP_S
        )


def windows(case: Case, every: int = 1) -> Windows:
    code, rows, track = written(case.model), case.rows[::every], case.track
    u = code["sent"](track.command.T)
    begin = code["observed"](states(track), u, P)[:, rows]
    return Windows(case, code, rows, begin, u[:, rows[None, :] + np.arange(max(STEPS) + 1)[:, None]])


@pytest.fixture(scope="session")
def unseen() -> Flight:
    return flown(disturbed_model(), 2)


@pytest.fixture(scope="session")
def made(unseen: Flight) -> Case:
    model = disturbed_model()
    observer = fit_observer([Replay(model, flown(model, 1).track, measured=False)])
    return Case(replace(model, observer=observer), unseen.track)


@pytest.fixture(scope="session")
def real() -> Case:
    if not NANOBENCH.is_dir():
        pytest.skip("the flights of NanoBench are not here")
    vehicle = load_vehicle(NANOBENCH / "crazyflie21.yaml")
    names = ("B2_circle_fast_rep1", "B9_trefoil_fast_rep1", "B7_oval_fast_rep1")
    logs = [read_by_map(NANOBENCH / f"{name}.csv", ROOT / "config" / "maps" / "nanobench.yaml") for name in names]
    *seen, last = [flown_of(log, vehicle) for log in logs]
    model = with_rotation(Model(vehicle), fit_rotation([f.record for f in seen], vehicle))
    observer = fit_observer([Replay(model, f.track, measured=False) for f in seen])
    return Case(replace(model, observer=observer), last.track)


@pytest.fixture(params=["made", "real"])
def case(request: pytest.FixtureRequest) -> Case:
    found: Case = request.getfixturevalue(request.param)
    return found


class TestNumpy:
    def test_it_observes_and_rolls_out_as_the_lab_does(self, case: Case) -> None:
        """The lab by the effects' own code, all windows at once and one alone."""
        w, replay = windows(case), Replay(case.model, case.track, measured=False)
        assert w.begin == pytest.approx(replay.observed()[:, w.rows], abs=1e-9)
        ends = w.rolled(w.begin)
        for k, expected in zip(STEPS, replay.roll_out(w.rows, STEPS), strict=True):
            own = expected.position, expected.velocity, expected.attitude, expected.rates
            for part, values in zip(PARTS, own, strict=True):
                assert pytest.approx(values, abs=1e-9) == ends[part, k].T
        first = w.rows[0]
        u = w.code["sent"](case.track.command.T)
        past = w.code["observed"](states(case.track)[:, : first + 1], u[:, : first + 1], P)
        alone = w.code["roll_out"](past[:, -1], u[:, first : first + 51], P)
        assert alone == pytest.approx(ends[:, :, 0], abs=1e-9)

    def test_a_replay_without_the_slow_moment_is_twice_as_far_off(self, case: Case) -> None:
        w = windows(case)
        whole, without = w.missed(w.rolled(w.begin)), w.missed(w.rolled(w.without("roll", "pitch", "yaw")))
        assert np.all(without[:, ROTATION:] > 2.0 * whole[:, ROTATION:])

    def test_another_centre_of_mass_than_that_of_the_fit_is_observed(self, made: Case) -> None:
        """As of the next flight, with another battery."""
        own = windows(made)
        other = reduced(made, "centre_of_mass", also=[FixedOffset(-0.9, 0.8)])
        assert np.all(other.missed(other.rolled(other.begin)) < 1.3 * own.missed(own.rolled(own.begin)))

    def test_a_simulated_flight_is_replayed_far_better_than_held(self, made: Case) -> None:
        w = windows(made)
        found, held = w.missed(w.rolled(w.begin)), of_held(made.track, w.rows)
        assert np.all(found[1] < np.array([0.2, 0.2, 0.7, 0.8]) * held[1])

    def test_a_real_flight_is_replayed_better_than_held(self, real: Case) -> None:
        """Half a second later the commands have answered what no observer knows: trusted whole they turn it away."""
        w = windows(real)
        found, driven, held = *map(w.missed, (w.rolled(w.begin), w.driven(w.begin))), of_held(real.track, w.rows)
        assert np.all(found < 0.9 * held)
        assert np.all(found[1] < 0.65 * held[1])
        assert np.all(driven[1, ROTATION:] > held[1, ROTATION:])

    def test_it_finds_the_slow_force_and_moment_and_knows_nothing_later(self, made: Case, unseen: Flight) -> None:
        code, track = written(made.model), made.track
        u = code["sent"](track.command.T)
        found = code["observed"](states(track), u, P)[-2 * len(AXES) :]
        both = found[:6] + found[6:]
        for i, true in enumerate((*unseen.force.T, *unseen.moment.T)):
            assert np.corrcoef(both[i, 250:], true[250:])[0, 1] > 0.8, AXES[i]
        later = states(track)
        later[3:6, 701:] += 0.7
        later[10:13, 701:] -= 0.5
        again = code["observed"](later, u, P)[-2 * len(AXES) :]
        np.testing.assert_array_equal(again[:, :701], found[:, :701])
        assert not np.allclose(again[:, 701:], found[:, 701:])

    def test_rotors_without_a_lag_or_with_two_are_observed_as_their_equations_say(self, made: Case) -> None:
        vehicle = made.model.vehicle
        prompt = vehicle.model_copy(update={"rotor": vehicle.rotor.model_copy(update={"time_constant_s": 0.0})})
        for model, n_rotors in (
            (replace(made.model, vehicle=prompt), 0),
            (made.model.plus(FirstOrderLag(0.03)), 8),
        ):
            code = written(model)
            u = code["sent"](made.track.command.T)
            found = code["observed"](states(made.track), u, P)
            assert len(found) == 13 + n_rotors + 12 == 13 + len(code["LAGS_S"])
            ahead = code["roll_out"](found[:, 400], u[:, 400:411], P)
            # Over one step the thrusts follow the same commands as in the past.
            assert ahead[13 : 13 + n_rotors, 1] == pytest.approx(found[13 : 13 + n_rotors, 401], rel=1e-3)


class TestCasadi:
    def test_its_third_and_fourth_functions_are_those_of_the_numpy_file(self, made: Case, tmp_path: Path) -> None:
        PROGRAMS["casadi"](made.model, tmp_path / "body.casadi")
        file = ca.FileDeserializer(str(tmp_path / "body.casadi"))
        *_, disturbed, foreseen = (file.unpack() for _ in range(4))
        w = windows(made)
        for function, name in ((disturbed, "x_dot_disturbed"), (foreseen, "x_dot_foreseen")):
            expected = w.code[name](w.begin, w.sent[:, 0], P)
            assert np.array(function(w.begin, w.sent[:, 0], P)) == pytest.approx(expected, abs=1e-9)

    def test_a_flight_is_replayed_as_by_the_numpy_file(self, case: Case, tmp_path: Path) -> None:
        PROGRAMS["casadi"](case.model, tmp_path / "body.casadi")
        file = ca.FileDeserializer(str(tmp_path / "body.casadi"))
        *_, foreseen = (file.unpack() for _ in range(4))
        w = windows(case, every=3)
        ends = rolled_out(lambda x, u: np.array(foreseen(x, u, P)), w.begin, w.sent, w.code["LAGS_S"], STEP_S)
        assert ends == pytest.approx(w.rolled(w.begin), abs=1e-9)


def reduced(case: Case, *families: str, also: Sequence[Effect] = (), every: int = 1) -> Windows:
    """Windows by a model without the effects that a target cannot hold, and with others."""
    stack = tuple(item for item in case.model.stack if item.effect.family() not in families)
    model = replace(case.model, stack=(*stack, *map(StackedEffect, also)))
    return windows(Case(model, case.track), every)


TOLERATED = 0.1
"""Difference of a target's errors from those of the NumPy file: its lag is of speed, and its drag grows with it."""


class TestRotorpy:
    def test_a_flight_is_replayed_as_without_what_it_cannot_hold(self, case: Case) -> None:
        """Lag of the rotors, inertia, moments by the places of the rotors and by the airspeed; neither damping and
        reaction nor slow forces and moments."""
        multirotor = pytest.importorskip("rotorpy.vehicles.multirotor")
        place: dict[str, Any] = {}
        text, left_out = rotorpy_code(case.model)
        exec(text, place)
        vehicle = multirotor.Multirotor(place["quad_params"], aero=True)
        w = windows(case, every=4)
        k_eta = place["quad_params"]["k_eta"]
        begin, sent = (np.sqrt(w.thrusts_n(of) / k_eta) for of in (w.begin[13:17], w.commanded_n))
        ends = np.empty((13, max(STEPS) + 1, len(w.rows)))
        for i, x in enumerate(w.begin.T):
            state = {"x": FLIP * x[:3], "v": FLIP * x[3:6], "q": np.array([x[7], -x[8], -x[9], x[6]])}
            state |= {"w": FLIP * x[10:13], "wind": np.zeros(3), "rotor_speeds": begin[:, i]}
            ends[:, 0, i] = x[:13]
            for step in range(max(STEPS)):
                command = sent[:, step : step + 2, i].mean(axis=1)
                state = vehicle.step(state, {"cmd_motor_speeds": command}, STEP_S)
                a, b, c, d = state["q"]
                moved = (*(FLIP * state["x"]), *(FLIP * state["v"]), d, a, -b, -c, *(FLIP * state["w"]))
                ends[:, step + 1, i] = moved
        # Its drag along the rotors' axes acts at each rotor, and damps roll and pitch.
        own, place_m = case.model.vehicle, np.array([rotor.position_m for rotor in case.model.vehicle.rotors])
        (drag,) = (e for e in case.model.effects if isinstance(e, LinearDrag))
        roll, pitch = own.mass_kg * drag.d_z * np.mean(place_m[:, 1::-1] ** 2, axis=0) / own.principal_inertia_kg_m2[:2]
        also = [ProportionalDamping(roll, pitch, 0.0)]
        without = reduced(case, "rate_damping", "rotor_reaction", also=also, every=4)
        expected = without.driven(w.without(*AXES))
        assert w.missed(ends) == pytest.approx(w.missed(expected), rel=TOLERATED, abs=2e-3)
        assert "observer of slow forces and moments: RotorPy has no such states" in " ".join(map(str, left_out))


class TestCrazyflow:
    def test_a_flight_is_replayed_with_the_slow_force_and_moment_as_disturbances(
        self, case: Case, dynamics: Callable[..., Any]
    ) -> None:
        """Lag of the rotors, inertia, reaction in yaw; neither damping nor moment by airspeed."""
        place: dict[str, Any] = {}
        text, left_out = crazyflow_code(case.model)
        exec(text, place)
        # Observed by the equations that it holds, the slow moment has the others' mean.
        w, vehicle = reduced(case, "rate_damping", "airspeed_moment"), case.model.vehicle
        inertia = np.array(vehicle.principal_inertia_kg_m2)[:, None]

        def rpm(nominal_n: Floats) -> Floats:
            return np.asarray(np.sqrt(w.thrusts_n(nominal_n) / vehicle.rotor.thrust_n_per_rpm2))

        def x_dot(x: Floats, command_rpm: Floats) -> Floats:
            q, d = x[[7, 8, 9, 6]].T * np.array([1.0, -1.0, -1.0, 1.0]), x[17:23] + x[23:]
            force, moment = vehicle.mass_kg * d[:3], w.code["to_world"](x[6:10], inertia * d[3:])
            position, velocity, rates, dist_f, dist_t = (
                FLIP * of.T for of in (*np.split(x[:6], 2), x[10:13], force, moment)
            )
            found = dynamics(
                position, q, velocity, rates, command_rpm.T, x[13:17].T, dist_f, dist_t, **place["parameters"]
            )
            turned = w.code["x_dot"](x[:13], np.zeros(4), P)[6:10]  # its authors warn of their own
            linear, angular = ((FLIP * of).T for of in found[2:4])
            fading = -x[17:] / w.code["LAGS_S"][4:, None]
            return np.concatenate([x[3:6], linear, turned, angular, found[4].T, fading])

        begin = np.concatenate([w.begin[:13], rpm(w.begin[13:17]), w.begin[17:]])
        ends = rolled_out(x_dot, begin, rpm(w.commanded_n), w.code["LAGS_S"], STEP_S)
        assert w.missed(ends) == pytest.approx(w.missed(w.driven(w.begin)), rel=TOLERATED, abs=2e-3)
        assert "observer of slow forces and moments: crazyflow has no such states" in " ".join(map(str, left_out))
