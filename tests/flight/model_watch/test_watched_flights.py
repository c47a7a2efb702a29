"""Flights in lockstep of a vehicle that is, or becomes, another than the one of the model that flies."""

import math
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import pytest

from quadctl.compensator import Compensator
from quadctl.effects import find_effect
from quadctl.effects.rotor_fault import WeakRotor
from quadctl.effects.thrust_scale import ConstantScale
from quadctl.flight.pilot.guards import GuardLimits
from quadctl.flight.pilot.model_guard import ModelErrorLimits
from quadctl.flight.pilot.pilot import Pilot
from quadctl.flight.pilot.settings import load_flight_settings
from quadctl.flight.pilot.tick import Stage, Tick
from quadctl.flight.record.recorder import Recorder
from quadctl.lab import add
from quadctl.missions import load_mission
from quadctl.model import Model
from quadctl.sitl.rules.copter import SimulatedCopter
from quadctl.sitl.rules.px4 import SimulatedAutopilot
from quadctl.sitl.run import fly_lockstep
from quadctl.sitl.vehicle.hidden import load_hidden
from quadctl.vehicle import load_vehicle
from tests.support.places import ROOT

Alter = Callable[[SimulatedAutopilot], None]
CHANGE_S = 30.0
"""Time after boot at which the vehicle changes, some seconds into the mission's waves."""
WITHIN_S = 10.0


class Mock(NamedTuple):
    """A simulated autopilot that behaves as measured, and the thrust of its full battery over that of its file."""

    folder: str
    hidden: str
    rules: type[SimulatedAutopilot]
    full_battery: float


MOCKS = {
    "px4": Mock("px4", "like_sih_good_imu.yaml", SimulatedAutopilot, 1.026),
    "ardupilot": Mock("ardupilot", "like_sitl.yaml", SimulatedCopter, 1.0),
}


class Told(NamedTuple):
    """Sentence about the model, and the time after the change at which it came."""

    after_s: float
    sentence: str


class Flown(NamedTuple):
    ended: str
    told: list[Told]
    events: list[str]
    duration_s: float
    log: Path | None
    """File of the log, where one was asked for."""


def fly(
    name: str,
    mission: str,
    alter: Alter | None = None,
    seed: int = 1,
    limits: ModelErrorLimits | None = None,
    until: dict[str, float] | None = None,
    base: bool = False,
    log_dir: Path | None = None,
) -> Flown:
    """Fly a mission with the true model of a vehicle, altered at CHANGE_S; `base`: with the bare vehicle."""
    mock = MOCKS[name]
    folder = ROOT / "sitl" / mock.folder
    truth, body = load_hidden(folder / mock.hidden), Model(load_vehicle(folder / "vehicle.yaml"))
    autopilot = mock.rules(body.vehicle, truth, seed, mock.hidden)
    if isinstance(autopilot, SimulatedCopter):
        autopilot.parameters |= {"GUID_OPTIONS": 8.0, "ATC_ANGLE_BOOST": 0.0}
    model = body
    for entry in [] if base else truth.effects:
        model = model.plus(find_effect(entry.effect, "")(**entry.parameters))
    if not base:
        model = model.plus(ConstantScale(mock.full_battery))
    settings = load_flight_settings(folder / "flight.yaml")
    settings = settings.model_copy(update={"guards": GuardLimits(model_error=limits or ModelErrorLimits())})
    plan = load_mission(ROOT / "missions" / f"{mission}.yaml")._replace(until=until or {})
    compensator = Compensator(model, settings.compensator_limits)
    pilot = Pilot(plan, body, settings, compensator, isinstance(autopilot, SimulatedCopter))
    told: list[Told] = []
    events: list[str] = []
    flown_s = [0.0]

    def listen(tick: Tick) -> None:
        if alter is not None and tick.stage is Stage.FLY and autopilot.time_s > CHANGE_S > autopilot.time_s - 0.021:
            alter(autopilot)
        end_s, still = getattr(autopilot, "later", (math.inf, None))
        if autopilot.time_s > end_s:
            autopilot.body.truth = still
        told.extend(Told(autopilot.time_s - CHANGE_S, e.what) for e in tick.events if " the model since" in e.what)
        events.extend(event.what for event in tick.events)
        if tick.stage is Stage.FLY:
            flown_s[0] = pilot.flight_s

    recorder = Recorder(log_dir, mission, body.vehicle.n_rotors, {}) if log_dir else None
    fly_lockstep(autopilot, pilot, 50.0, [listen, *([recorder] if recorder else [])])
    if recorder:
        recorder.close(pilot.ended)
    return Flown(pilot.ended, told, events, flown_s[0], recorder and recorder.path)


def heavier(autopilot: SimulatedAutopilot) -> None:
    body = autopilot.body
    body.vehicle = body.vehicle.model_copy(update={"mass_kg": 1.15 * body.vehicle.mass_kg})
    body.truth = replace(body.truth, vehicle=body.vehicle)


def weaker(autopilot: SimulatedAutopilot) -> None:
    autopilot.body.truth = autopilot.body.truth.plus(WeakRotor(loss=0.2, rotor=1.0))


def draggier(autopilot: SimulatedAutopilot) -> None:
    truth = autopilot.body.truth
    doubled = [type(e)(**{name: 2.0 * value for name, value in e.values().items()}) for e in truth.effects]
    autopilot.body.truth = truth.with_effects(doubled)


def blown_at(autopilot: SimulatedAutopilot) -> None:
    """A gust of 2 m/s, for the rest of the flight, as nothing ends it here."""
    gust = find_effect("wind.steady", "")(north_m_s=1.6, east_m_s=-1.2, drag=0.3)
    autopilot.body.truth = autopilot.body.truth.plus(gust)


CHANGED: dict[str, tuple[Alter, str]] = {
    "mass +15 %": (heavier, "thrust 1"),
    "a rotor at 80 %": (weaker, "thrust "),
    "drag doubled": (draggier, "drag "),
}


@pytest.mark.parametrize("name", MOCKS)
@pytest.mark.parametrize(
    "what", ["mass +15 %", *(pytest.param(w, marks=pytest.mark.long) for w in ("a rotor at 80 %", "drag doubled"))]
)
def test_a_vehicle_that_changes_in_flight_is_told_within_seconds(name: str, what: str) -> None:
    alter, begin = CHANGED[what]
    flown = fly(name, "excitation", alter)
    assert flown.told, flown.events
    after_s, sentence = flown.told[0]
    assert 0.0 < after_s < WITHIN_S
    assert sentence.startswith(begin)
    side = "above" if what == "drag doubled" else "below"
    assert f"{side} the model since" in sentence


@pytest.mark.long
@pytest.mark.parametrize("name", MOCKS)
def test_a_wind_that_comes_up_is_no_change_of_the_vehicle(name: str) -> None:
    assert fly(name, "excitation", blown_at).told == []


@pytest.mark.long
@pytest.mark.parametrize("mission", ["excitation", "forward_runs", "vertical_runs", "figure8", "swoop"])
@pytest.mark.parametrize("name", MOCKS)
def test_a_vehicle_that_is_the_one_of_the_model_is_not_mentioned(name: str, mission: str) -> None:
    for seed in (11, 12):
        assert fly(name, mission, seed=seed).told == []


@pytest.mark.long
def test_a_gust_from_below_is_told_while_it_lasts_as_nothing_tells_it_from_less_mass() -> None:
    push = find_effect("thrust_scale.constant", "")

    def blown(autopilot: SimulatedAutopilot) -> None:
        still = autopilot.body.truth
        autopilot.body.truth = still.plus(push(1.1))
        autopilot.later = (autopilot.time_s + 6.0, still)  # type: ignore[attr-defined]

    flown = fly("px4", "excitation", blown)
    (told,) = flown.told
    assert re.match(r"thrust (9|10|11)% above the model since", told.sentence)
    assert "thrust as in the model again" in flown.events


def test_the_guard_lands_a_vehicle_that_is_not_the_one_of_the_model() -> None:
    flown = fly("px4", "figure8", heavier, limits=ModelErrorLimits(max_m_s2=0.8, max_s=0.5))
    assert flown.ended.startswith(
        "the vehicle is not the one of the model: the residual has been over 0.8 m/s^2 for more than 0.5 s, it is "
    )
    assert flown.ended.endswith("most of it down")


def test_a_mission_ends_once_what_it_is_flown_for_is_known() -> None:
    flown = fly("px4", "excitation", until={"drag": 0.1, "thrust": 0.02}, base=True)
    whole_s = load_mission(Path(ROOT / "missions" / "excitation.yaml")).duration_s
    assert flown.ended == "completed"
    assert 10.0 < flown.duration_s < 0.9 * whole_s
    (known,) = [event for event in flown.events if event.startswith("known by now: drag ")]
    drag, thrust = known.removeprefix("known by now: ").split("; ")
    assert [float(word) for word in re.findall(r"[\d.]+", drag)] == pytest.approx([1.0, 1.0, 8.0], abs=2.0)
    assert [float(word) for word in re.findall(r"[\d.]+", thrust)] == pytest.approx([1.03, 1.0], abs=1.0)


@pytest.mark.long
@pytest.mark.parametrize("seed", [3, 4, 5])
def test_the_fit_to_a_mission_that_ended_early_holds_the_truth(seed: int, tmp_path: Path) -> None:
    flown = fly("px4", "excitation", seed=seed, until={"drag": 0.1}, base=True, log_dir=tmp_path)
    assert flown.log is not None
    fitted = add("rotor_drag.linear", ROOT / "sitl" / "px4" / "vehicle.yaml", flown.log).model.stack[-1].fitted
    assert fitted is not None
    for name in ("d_x", "d_y"):
        low, high = fitted.ci95[name]
        assert 0.5 < low < 1.0 < high < 1.6  # as like_sih_good_imu.yaml says
