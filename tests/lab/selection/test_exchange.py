"""Two effects that hide each other from a greedy search, or that a third one stands for, which has a little of both."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from quadctl.effects import CATALOG, Effect
from quadctl.effects.battery_sag import LinearSag
from quadctl.effects.ground_effect import Exponential
from quadctl.effects.inflow import AxialInflow
from quadctl.effects.rotor_drag import LinearDrag
from quadctl.effects.tether import HangingTether
from quadctl.effects.thrust_scale import ConstantScale
from quadctl.lab.arrays import Floats
from quadctl.lab.fitting.fitted_model import fit_model
from quadctl.lab.flights.dataset import Dataset, load_dataset
from quadctl.lab.selection.diagnosis import diagnose
from quadctl.lab.selection.rule import score
from quadctl.lab.selection.search import Selection, judged_beside, search
from quadctl.logs.flight_log import FlightLog
from quadctl.logs.read import read_logs
from quadctl.model import Model, load_model
from quadctl.vehicle import Vehicle
from studies.blind_cases.cases import all_cases
from studies.blind_cases.fly import fly_case
from studies.worlds.borrowed.cases import Case, roam, stairs
from tests.support.flights import obedient, to_and_fro
from tests.support.places import ROOT

pytestmark = pytest.mark.long


def test_a_drag_and_a_tilted_thrust_are_no_wind(tmp_path: Path) -> None:
    """A wind alone explains a part of both."""
    (case,) = (c for c in all_cases("tuning") if c.truths == ("HubForce", "BentArms") and c.strength == 1.0)
    vehicle = load_model(ROOT / "config/vehicles/raptor.yaml").vehicle
    assert case.vehicle == vehicle.name
    flown = load_dataset(read_logs(fly_case(case, tmp_path).seen), vehicle)
    pool = of_families("wind", "rotor_drag", "thrust_tilt")
    assert sorted(found_in(flown, *pool).missing) == ["rotor_drag", "thrust_tilt"]


def test_what_a_ground_effect_implies_counts_for_no_other_explanation(tmp_path: Path) -> None:
    """Rotors that each feel their own height give a levelling moment, which a ground effect at one height leaves. A
    cable in the place of the ground effect, beside a levelling moment of its own, is no better for that."""
    hidden = {"ground_effect.images": {"rho": 2.5}, "thrust_scale": {"error": -0.07}}
    case = Case("pair", "hummingbird", (stairs(60.0), stairs(45.0, "steps")), hidden, quick=True)
    model, flown = in_rotorpy(case, tmp_path)
    found = diagnose(model, flown, of_families("ground_effect", "thrust_scale", "tether", "ground_torque"))
    assert sorted(found.missing) == ["ground_effect", "thrust_scale"]


def test_a_wind_on_a_quadratic_drag_beside_a_wrong_mass_is_no_further_drag(tmp_path: Path) -> None:
    missions = (roam(60.0, 2.0, 6.0, 12.0), roam(45.0, 2.5, 5.0, 9.0, "steps"))
    hidden = {"wind": {"speed": 6.0, "course_deg": -110.0, "area": 0.03}, "thrust_scale": {"error": 0.06}}
    _, flown = in_rotorpy(Case("pair", "px4_quadx", missions, hidden, outdoors=True), tmp_path)
    pool = of_families("wind", "thrust_scale", "body_drag")
    assert sorted(found_in(flown, *pool).missing) == ["thrust_scale", "wind"]


def in_rotorpy(case: Case, folder: Path) -> tuple[Model, Dataset]:
    """Model of the vehicle file, and the flights of a case, flown in RotorPy."""
    worlds = pytest.importorskip("studies.worlds.borrowed.__main__", exc_type=ImportError)
    worlds.make_case(worlds.SIMULATORS["rotorpy"], case, [1.0], 1, [folder])
    model = load_model(folder / case.name / "vehicle.yaml")
    return model, load_dataset(read_logs(sorted((folder / case.name).glob("*.csv"))), model.vehicle)


def of_families(*families: str) -> list[type[Effect]]:
    """Effects of the catalogue of these families."""
    return [effect for effect in CATALOG.values() if effect.family() in families]


def weakened(logs: list[FlightLog], share: Callable[[Floats], Floats], vehicle: Vehicle) -> Dataset:
    """The same flights by rotors that give this share of their thrust, and turn faster for it.

    `share` is a function of the time of the flight, from 0 to 1; the voltage falls from 16.8 to 15.2 V.
    """
    made = []
    for log in logs:
        time = (log.time_s - log.time_s[0]) / np.ptp(log.time_s)
        turned = {name: log[name] / np.sqrt(share(time)) for name in log.columns if name.endswith("_rpm")}
        made.append(replace(log, columns={**log.columns, **turned, "battery_v": 16.8 - 1.6 * time}))
    return load_dataset(made, vehicle)


def found_in(dataset: Dataset, *pool: type[Effect]) -> Selection:
    return search(fit_model(Model(dataset.flights[0].vehicle), dataset), pool, lambda text: None)


@pytest.mark.parametrize("share", [0.95, 0.85])
def test_a_wrong_mass_over_a_ground_effect_is_no_cable(
    staircases: list[FlightLog], raptor: Vehicle, share: float
) -> None:
    """Thrust that is too low everywhere and grows near the ground: alone, a cable explains most of it."""
    pool = (ConstantScale, HangingTether, Exponential)
    found = found_in(weakened(staircases, lambda time: np.full_like(time, share), raptor), *pool)
    assert sorted(found.missing) == ["ground_effect", "thrust_scale"]


def test_a_battery_and_a_ground_effect_that_hide_each_other_are_found(
    staircases: list[FlightLog], raptor: Vehicle
) -> None:
    pool = (LinearSag, Exponential)
    found = found_in(weakened(staircases, lambda time: 1.0 - 0.1 * time, raptor), *pool)
    assert sorted(found.missing) == ["battery_sag", "ground_effect"]
    hidden, other = found.chosen
    assert hidden.p_value > 0.01 > other.p_value
    said = judged_beside(hidden, found)
    assert said.p_value < 1e-4
    assert said.remarks[-1].startswith("alone it would not be significant (p 0.")
    assert judged_beside(other, found) is other


def test_what_explains_most_alone_comes_first(rigid: Model) -> None:
    """A vehicle that is dragged, and whose rotors give 85 % of their thrust."""
    truth = rigid.plus(ConstantScale(0.85))
    log = to_and_fro(obedient(truth, 90.0, noise_m_s=0.01), 2.0)
    slowed = {name: log[name] for name in log.columns}
    lean = np.degrees(np.arctan(0.3 * log["vx_m_s"] / 9.81 + np.gradient(log["vx_m_s"], log.time_s) / 9.81))
    slowed["pitch_deg"] = slowed["pitch_deg"] - lean
    path = found_in(load_dataset([replace(log, columns=slowed)], rigid.vehicle), LinearDrag, ConstantScale)
    assert path.missing == ("thrust_scale", "rotor_drag")
    first, second, last = (step.rmse["total"] for step in path.steps)
    assert first > 2.0 * second > 2.0 * last


def test_an_effect_at_its_bound_is_not_found(rigid: Model) -> None:
    """No inflow takes three times the thrust away at a climb rate of v_h; twice, the bound, explains most of it."""
    flown = load_dataset([obedient(rigid.plus(AxialInflow(k=3.0)), 60.0, noise_m_s=0.01)], rigid.vehicle)
    path = found_in(flown, AxialInflow)
    tried = path.latest[AxialInflow.name]
    assert tried.at_bound and score(tried.residual) < score(path.residual) - 0.1
    assert path.missing == ()
