"""Every mission of the project is flown, in simulated time, from the ground to the disarmed motors."""

from pathlib import Path

import pytest
from _pytest.mark.structures import ParameterSet

import quadctl.sitl.run
from quadctl.flight.preflight.preparation import prepare_flight
from quadctl.lab.comparison.comparison import compare
from quadctl.lab.study import prepare_flights
from quadctl.logs.read import read_log
from tests.support.places import ROOT

MISSIONS = sorted((ROOT / "missions").glob("*.yaml"))
SHORTER = {
    "excitation": ["waves_s=20"],
    "forward_sweep": ["heights_m=[0.1]", "speeds_m_s=[2.75]"],
    "vertical_sweep": ["heights_m=[1.1, 0.1]", "speeds_m_s=[0.9]"],
    "hover_heights": ["hover_s=1.5"],
    "surface_heights": ["hover_s=1.5"],
    "hover_staircase": ["hover_s=5", "step_s=1"],
    "headings": ["headings_deg=[-90]"],
    "figure8": ["laps=1"],
    "garofano_cosine": ["cycles=2"],
    "oscillation": ["cycles=3"],
    "step_forward": ["runs=[2]"],
    "swoop": ["times=1"],
}
"""Overrides that shorten long missions, at the lowest height and the highest speed."""


def _flown(path: Path) -> ParameterSet:
    """Parameter set of the mission `path`; variants of another mission are long tests."""
    variant = "\nextends: " in path.read_text()
    return pytest.param(path, id=path.stem, marks=pytest.mark.long if variant else ())


@pytest.mark.parametrize("path", [_flown(path) for path in MISSIONS])
def test_it_is_fit_to_fly_and_flies_to_its_end(path: Path, tmp_path: Path) -> None:
    shorter = [override for name, overrides in SHORTER.items() if path.stem.startswith(name) for override in overrides]
    plan = prepare_flight(path, None, "none", None, shorter)
    outcome = quadctl.sitl.run.simulate(plan, tmp_path, None, seed=1)
    assert outcome.ended == "completed"
    assert list(dict.fromkeys(outcome.phases)) == list(dict.fromkeys(phase.name for phase in plan.mission.phases))
    rmse = outcome.tracking_rmse_m
    assert rmse["up"] < (0.25 if "step" in path.stem else 0.06)
    assert max(rmse["north"], rmse["east"]) < 0.3
    log = read_log(outcome.log)
    assert log["z_m"][-1] == pytest.approx(0.05, abs=0.02)  # it stands
    assert log.phase is not None
    assert log.phase[-1] == "done"


def test_the_log_of_runs_flown_by_velocity_is_compared_in_the_lab(tmp_path: Path) -> None:
    """A position that is not held has no reference: its columns are empty, and the lab reads the log."""
    path = next(path for path in MISSIONS if path.stem == "forward_sweep")
    plan = prepare_flight(path, None, "none", None, SHORTER["forward_sweep"])
    log = quadctl.sitl.run.simulate(plan, tmp_path, None, seed=1).log
    running = [str(phase).startswith(("forward_", "back_")) for phase in read_log(log).phase]
    assert 0.2 < float((read_log(log)["x_ref_m"][running] != read_log(log)["x_ref_m"][running]).mean()) < 0.9
    result = compare(plan.body, prepare_flights([Path(log)], plan.body.vehicle, "blocks"))
    assert result.rmse["total"] < 0.5


def test_fast_runs_against_strong_drag_are_made_up_for_and_do_not_end_the_flight(tmp_path: Path) -> None:
    """A run by velocity at 2.75 m/s ends metres behind the place where position control begins again."""
    plan = prepare_flight(ROOT / "missions/forward_sweep.yaml", None, "none", None, SHORTER["forward_sweep"])
    plan = plan._replace(settings=plan.settings.model_copy(update={"height_datum": "takeoff"}))
    outcome = quadctl.sitl.run.simulate(plan, tmp_path, ROOT / "sitl/px4/like_sih.yaml", seed=1)
    assert outcome.ended == "completed"


@pytest.mark.parametrize("seed", [0, 1])
def test_an_estimate_that_wanders_on_the_ground_does_not_end_the_flight(seed: int, tmp_path: Path) -> None:
    """The floor of this mission, min_z_m less margin_m, is the ground, where the estimate is off by decimetres."""
    plan = prepare_flight(ROOT / "sitl/staircase.yaml", ROOT / "sitl/px4/flight.yaml", None, None)
    outcome = quadctl.sitl.run.simulate(plan, tmp_path, ROOT / "sitl/px4/like_sih.yaml", seed)
    assert outcome.ended == "completed"
