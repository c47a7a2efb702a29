"""Specification of the lab on a fully actuated vehicle: level flights with sideward force are predicted and explained
in three dimensions."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml

from quadctl.flight.preflight.preparation import prepare_flight
from quadctl.lab.comparison.comparison import compare
from quadctl.lab.flights.dataset import load_dataset
from quadctl.lab.selection.diagnosis import diagnose
from quadctl.logs.columns import LATERAL_COLUMNS, LATERAL_THROTTLE, motor_of
from quadctl.logs.contradictions import contradictions
from quadctl.logs.findings import worded
from quadctl.logs.flight_log import FlightLog
from quadctl.logs.read import read_log
from quadctl.model import Model
from quadctl.sitl.run import simulate
from quadctl.vehicle import load_vehicle
from tests.support.flights import CUSHION, MISSIONS
from tests.support.places import ROOT

VEHICLE = ROOT / "config" / "vehicles" / "f550_tilted.yaml"
RIGID = Model(load_vehicle(VEHICLE))
DRAG = ("rotor_drag.linear", {"d_x": 0.3, "d_y": 0.3})


def flown(mission: str, effect: tuple[str, dict[str, float]], seed: int, where: Path) -> FlightLog:
    """The log of a fully actuated flight in a world that hides `effect`."""
    where.mkdir(parents=True, exist_ok=True)
    hidden = where / "hidden.yaml"
    hidden.write_text(yaml.safe_dump({"effects": [{"effect": effect[0], "parameters": effect[1]}]}))
    plan = prepare_flight(MISSIONS / f"{mission}.yaml", ROOT / "config" / "flight_f550_tilted.yaml", None, None)
    outcome = simulate(plan, where, hidden, seed)
    assert outcome.completed, outcome.ended
    return read_log(outcome.log)


@pytest.fixture(scope="module")
def dragged(tmp_path_factory: pytest.TempPathFactory) -> FlightLog:
    return flown("excitation", DRAG, 2, tmp_path_factory.mktemp("drag"))


def without(log: FlightLog, names: Sequence[str]) -> FlightLog:
    return replace(log, columns={name: values for name, values in log.columns.items() if name not in names})


def of_commands(log: FlightLog) -> FlightLog:
    """The log without anything that a motor tells."""
    return without(log, [name for name in log.columns if motor_of(name) is not None])


@pytest.mark.long
def test_a_ground_effect_that_is_in_no_catalogue_is_named(tmp_path: Path) -> None:
    logs = [flown("hover_staircase", CUSHION, 1, tmp_path), flown("excitation", CUSHION, 2, tmp_path)]
    found = diagnose(RIGID, load_dataset(logs, RIGID.vehicle))
    assert found.missing == ["ground_effect"]


@pytest.mark.long
def test_rotor_drag_is_named_and_measured_to_the_side(dragged: FlightLog) -> None:
    found = diagnose(RIGID, load_dataset([dragged], RIGID.vehicle))
    assert found.missing == ["rotor_drag"]
    effect = next(trial for trial in found.ranking if trial.family == "rotor_drag").effect
    assert effect.values()["d_y"] == pytest.approx(0.3, abs=0.06)


def test_speeding_up_without_leaning_contradicts_nothing_where_side_force_was_commanded(dragged: FlightLog) -> None:
    assert contradictions(dragged) == []
    assert "the vehicle speeds up" in worded(contradictions(without(dragged, LATERAL_COLUMNS))[0])


def test_without_signals_of_motors_the_commands_predict_in_three_dimensions(dragged: FlightLog) -> None:
    def error_to_the_side(log: FlightLog) -> float:
        return compare(RIGID, load_dataset([log], RIGID.vehicle)).rmse["east"]

    by_speeds, by_throttle = error_to_the_side(dragged), error_to_the_side(of_commands(dragged))
    assert by_throttle == pytest.approx(by_speeds, rel=0.25)
    by_force = error_to_the_side(without(of_commands(dragged), ["throttle_cmd", *LATERAL_THROTTLE]))
    assert by_force == pytest.approx(by_speeds, rel=0.25)
    # without the lateral commands a level flight is not explained at all
    blind = error_to_the_side(without(of_commands(dragged), LATERAL_COLUMNS))
    assert blind > 2.0 * by_throttle


def test_the_flight_was_level_for_the_most_part(dragged: FlightLog) -> None:
    assert np.median(np.hypot(dragged["roll_deg"], dragged["pitch_deg"])) < 1.0
