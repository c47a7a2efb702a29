"""Suggestion of the next flight: the mission that best answers the open questions, and only one that can be flown."""

import json
import math
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from typer.testing import CliRunner

from quadctl.cli import app
from quadctl.effects import find_effect
from quadctl.effects.thrust_scale import ConstantScale
from quadctl.errors import SettingsError
from quadctl.frames import rotate
from quadctl.lab import diagnose, prepare_flights
from quadctl.lab.fitting.fitter import Fitter
from quadctl.lab.flights.dataset import Dataset, load_dataset
from quadctl.lab.flights.prediction import predict
from quadctl.lab.planning.information import Information, information, prior
from quadctl.lab.planning.planned_flight import planned_flight
from quadctl.lab.planning.suggestion import Option, Said, Suggestion, suggest
from quadctl.lab.selection.diagnosis import Diagnosis
from quadctl.missions import load_mission
from quadctl.model import Model
from quadctl.vehicle import Vehicle
from tests.support import flights
from tests.support.flights import MISSIONS, simulated

UP = {"name": "takeoff", "kind": "move", "to_m": [0, 0, 1.2], "hold_s": 3}
HOVER = [UP, {"kind": "hold", "duration_s": 30}]
SQUARE = [UP] + [
    {"kind": "move", "to_m": [x, y, 1.2], "speed_m_s": 0.8, "acceleration_m_s2": 3.0}
    for x, y in ((2, 0), (-2, 0), (-2, 2), (-2, -2))
]
"""Mission at a single speed."""
LIMITS = {"max_z_m": 2.5, "max_distance_m": 4.0}
FEW = (
    *("excitation", "excitation_east", "forward_runs", "forward_sweep", "headings", "hover_staircase"),
    *("hover_staircase_high", "step_response", "vertical_runs"),
)
"""Missions of every kind to choose from; each is planned, which takes its time."""


def write_mission(where: Path, name: str, phases: list[dict[str, Any]], **keys: Any) -> Path:
    where.mkdir(exist_ok=True)
    path = where / f"{name}.yaml"
    path.write_text(yaml.safe_dump({"description": "test", "phases": phases, "limits": LIMITS, **keys}))
    return path


class World:
    """Simulated flights of the tests' missions, each prepared once."""

    def __init__(self, where: Path, raptor: Vehicle) -> None:
        self.where, self.rigid = where, Model(raptor)
        self._flown: dict[str, Dataset] = {}

    def flown(self, name: str, phases: list[dict[str, Any]], effects: list[tuple[str, dict[str, float]]]) -> Dataset:
        if name not in self._flown:
            write_mission(self.where, name, phases)
            with pytest.MonkeyPatch.context() as patch:
                patch.setattr(flights, "MISSIONS", self.where)
                log = simulated(name, effects, 1, self.where / "logs" / name)
            self._flown[name] = load_dataset([log], self.rigid.vehicle)
        return self._flown[name]

    def hover(self) -> Dataset:
        return self.flown("hover", HOVER, [])


def some(where: Path, *names: str) -> Path:
    """The folder `where` with these missions of the repository."""
    where.mkdir(exist_ok=True)
    for name in names:
        shutil.copy(MISSIONS / f"{name}.yaml", where)
    return where


@pytest.fixture(scope="module")
def few(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return some(tmp_path_factory.mktemp("few"), *FEW)


@pytest.fixture(scope="module")
def world(tmp_path_factory: pytest.TempPathFactory, raptor: Vehicle) -> World:
    return World(tmp_path_factory.mktemp("suggest"), raptor)


def option(result: Suggestion, name: str) -> Option:
    return next(o for o in result.options if o.mission.name == name)


def asked(model: Model, dataset: Dataset, candidates: list[str], *pair: str, missions: Path) -> Suggestion:
    """Suggestion after a diagnosis with `candidates`, in which the `pair` counts as not distinguished."""
    diagnosis = diagnose(model, dataset, candidates)
    return suggest(replace(diagnosis, confounded=[list(pair)] if pair else []), missions)


# --- what is suggested -----------------------------------------------------------------------------------------------


@pytest.mark.long
def test_wind_or_a_tilted_thrust_asks_for_another_heading(world: World, few: Path) -> None:
    data = world.flown("leaning", HOVER, [("thrust_tilt.fixed", {"roll_deg": 2.0, "pitch_deg": -2.0})])
    result = asked(world.rigid, data, ["thrust_tilt", "wind"], "thrust_tilt", "wind", missions=few)
    assert result.pairs == [("thrust_tilt", "wind")]
    assert result.best is not None
    assert result.best.command in {f"quadctl fly {few / f'{name}.yaml'}" for name in ("headings", "excitation_east")}
    assert result.best.sigmas[0] > option(result, "excitation").sigmas[0] + 3


@pytest.mark.long
def test_a_breeze_that_drag_and_tilt_explain_too_asks_for_another_heading(world: World, few: Path) -> None:
    breeze = {"north_m_s": 0.7, "east_m_s": -0.5, "drag": 0.35}
    found = diagnose(
        world.rigid, world.flown("breeze", SQUARE, [("wind.steady", breeze)]), ["wind", "rotor_drag", "thrust_tilt"]
    )
    result = suggest(found, few)
    assert result.pairs == [("wind", "thrust_tilt")]
    assert result.best is not None
    assert result.best.mission.name in ("headings", "excitation_east")
    assert option(result, "excitation").sigmas[0] < 0.5 * result.best.sigmas[0]


@pytest.mark.long
def test_linear_or_quadratic_drag_asks_for_several_speeds(world: World, few: Path) -> None:
    data = world.flown("square", SQUARE, [("rotor_drag.linear", {"d_x": 0.3, "d_y": 0.3})])
    result = asked(world.rigid, data, ["rotor_drag", "body_drag"], "rotor_drag", "body_drag", missions=few)
    assert result.best is not None
    flight = planned_flight(result.best.mission, world.rigid, data)
    low, high = flight.span("speed")
    assert high - low > 1.2
    assert result.best.sigmas[0] > 20
    assert option(result, "hover_staircase").sigmas[0] < 1


@pytest.mark.long
def test_an_unknown_ground_effect_asks_for_a_flight_near_the_ground(world: World, few: Path) -> None:
    model = world.rigid.plus(find_effect("ground_effect.exponential", "test")())
    result = asked(model, world.hover(), [], missions=few)
    assert result.parameter is not None
    assert "ground_effect" in result.parameter
    assert result.best is not None
    lowest = planned_flight(result.best.mission, model, world.hover()).conditions.height_m.min()
    assert lowest < 2 * world.rigid.vehicle.rotor.radius_m
    assert result.best.width is not None
    assert result.width is not None
    assert result.best.width < 0.2 * result.width
    assert option(result, "hover_staircase_high").width == pytest.approx(result.width, rel=0.1)


@pytest.mark.long
def test_an_unknown_inflow_asks_for_climbs_and_descents(world: World, few: Path) -> None:
    result = asked(world.rigid.plus(find_effect("inflow", "test")()), world.hover(), [], missions=few)
    assert result.parameter == "k (inflow.axial)"
    assert result.best is not None
    assert result.best.mission.name.startswith("vertical_")
    climbs, runs = option(result, "vertical_runs").width, option(result, "forward_runs").width
    assert climbs is not None
    assert runs is not None
    assert climbs < 0.5 * runs


@pytest.mark.long
def test_with_nothing_else_open_the_flight_lets_more_effects_be_tried(world: World, few: Path) -> None:
    result = asked(world.rigid, world.hover(), [find_effect("body_drag", "test")], missions=few)
    assert (result.pairs, result.parameter) == ([], None)
    assert "body_drag.quadratic" in result.untried
    assert result.best is not None
    assert "body_drag.quadratic" in result.best.tries
    assert option(result, "step_response").tries == []


# --- what is not suggested -------------------------------------------------------------------------------------------


def test_a_mission_that_cannot_be_flown_is_left_out_with_the_reason(world: World, tmp_path: Path) -> None:
    wide = {**UP, "hold_s": 20}
    write_mission(tmp_path, "below_its_limits", [wide, {"kind": "move", "to_m": [0, 0, 0.01], "hold_s": 9}])
    write_mission(
        tmp_path,
        "into_the_floor",
        [wide, {"kind": "move", "to_m": [0, 0, 0.0], "hold_s": 9}],
        limits={"min_z_m": 0.0, "max_z_m": 2},
    )
    write_mission(tmp_path, "into_the_ceiling", [wide, {"kind": "move", "to_m": [0, 0, 2.5], "hold_s": 9}])
    quick = {"kind": "move", "to_m": [3, 0, 1.2], "speed_m_s": 9.0, "acceleration_m_s2": 9.0, "hold_s": 9}
    write_mission(tmp_path, "leaning_too_far", [wide, quick])
    write_mission(tmp_path, "too_short", [{**UP, "hold_s": 2}])
    write_mission(tmp_path, "fair", [wide, {"kind": "move", "to_m": [2, 0, 1.2], "speed_m_s": 1.5, "hold_s": 1}] * 2)
    result = asked(world.rigid, world.hover(), [], missions=tmp_path)
    assert [o.mission.name for o in result.options] == ["fair"]
    reasons = "\n".join(result.left_out)
    for sentence in (
        "below_its_limits.yaml: phase 'move' goes to z =",
        "into_the_floor: goes down to z = 0.00 m, expected 0.02 m or more",
        "into_the_ceiling: the rotors reach 2.50 m, expected a rotor radius or more below the ceiling",
        "leaning_too_far: tilts by 4",
        "too_short: ",
    ):
        assert sentence in reasons
    assert len(result.left_out) == 5


def test_no_flight_is_suggested_when_none_tells_more(world: World, tmp_path: Path) -> None:
    write_mission(tmp_path, "hover_again", HOVER)
    result = asked(world.rigid, world.hover(), [find_effect("body_drag", "test")], missions=tmp_path)
    assert result.best is None
    assert "No flight is suggested: none of these missions would give more information." in str(result)
    assert result.to_dict()["command"] is None


def test_why_no_flight_is_suggested_is_said() -> None:
    nothing, unexplained = (Suggestion([], [], None, None, [], [], unexplained=flag) for flag in (False, True))
    assert [found.kind for found in nothing.answer] == [Said.NO_QUESTION]
    assert [found.kind for found in unexplained.answer] == [Said.NO_CANDIDATE]


def test_a_folder_without_missions_is_one_sentence(world: World, tmp_path: Path) -> None:
    with pytest.raises(SettingsError, match="holds no mission"):
        suggest(diagnose(world.rigid, world.hover(), []), tmp_path)


# --- whether the expectation is right --------------------------------------------------------------------------------


@pytest.mark.long
def test_the_interval_after_the_flight_is_as_expected(world: World, tmp_path: Path) -> None:
    """Expected widths are within a factor of two of those after the mission is flown in the simulator."""
    model = world.rigid.plus(find_effect("inflow", "test")(k=0.4))
    before = world.flown("hover_inflow", HOVER, [("inflow.axial", {"k": 0.4})])
    missions = some(tmp_path / "missions", "vertical_runs")
    expected = option(asked(model, before, [], missions=missions), "vertical_runs").width
    log = simulated("vertical_runs", [("inflow.axial", {"k": 0.4})], 2, tmp_path)
    both = Dataset((*before.flights, *load_dataset([log], model.vehicle).flights))
    fitter = Fitter(model, both)
    fitted = fitter.fit()
    low, high = np.percentile(fitter.bootstrap(fitted)[:, 0], [2.5, 97.5])
    fitted_before: Any = Fitter(model, before).fit().model.effects[0]
    assert expected is not None
    assert 0.5 < expected * max(fitted_before.k, 0.02) / (high - low) < 2.0


def test_the_planned_flight_obeys_the_model(world: World) -> None:
    """Attitude and rotor speeds are those that give the reference's acceleration, whatever effects there are."""
    effects = ("rotor_drag", "thrust_scale", "ground_effect.exponential", "thrust_tilt")
    model = world.rigid
    for name in effects:
        model = model.plus(find_effect(name, "test")())
    for name in ("excitation_low", "hover_staircase", "step_response"):
        flight = planned_flight(load_mission(MISSIONS / f"{name}.yaml"), model, world.hover())
        assert np.sqrt(np.mean((predict(model, flight) - flight.measured) ** 2)) < 0.02
        assert abs(flight.delay_s) <= 0.01
        assert flight.bandwidth_hz == pytest.approx(world.hover().flights[0].bandwidth_hz, rel=0.05)


def test_the_planned_flight_keeps_the_heading_unless_the_mission_has_one(world: World) -> None:
    for name, heading in (("excitation", 0.0), ("excitation_east", math.pi / 2)):
        flight = planned_flight(load_mission(MISSIONS / f"{name}.yaml"), world.rigid, world.hover())
        nose = rotate(flight.conditions.attitude, (1.0, 0.0, 0.0))
        assert np.median(np.arctan2(nose[1], nose[0])) == pytest.approx(heading, abs=0.03)


# --- information -----------------------------------------------------------------------------------------------------


def test_information_of_a_line_is_that_of_the_textbook() -> None:
    """y = a + b x at x = -1, 0, 1 with noise 1: var a = 1/3, var b = 1/2; a parabola's rest is 2/3."""
    x = np.array([-1.0, 0.0, 1.0])
    j, parabola = np.column_stack([np.ones(3), x]), x**2
    told = Information(j.T @ j, j.T @ parabola, float(parabola @ parabola))
    assert told.standard_errors**2 == pytest.approx([1 / 3, 1 / 2])
    assert told.left == pytest.approx(2 / 3)
    assert (told + told).left == pytest.approx(4 / 3)


def test_without_data_a_parameter_is_as_uncertain_as_its_bounds_leave_it(world: World) -> None:
    model = world.rigid.plus(find_effect("inflow", "test")())
    assert prior(model).standard_errors == pytest.approx([2.0 / math.sqrt(12.0)])
    assert prior(world.rigid).left == 0.0


def test_nuisances_take_information_away(world: World) -> None:
    """A hanging tether in hover acts like a thrust scale that is off by 0.5 %, within the prior of every flight: more
    noise-free samples do not help."""
    model = world.rigid.plus(find_effect("tether", "test")())
    flight = world.hover().flights[0]
    told = prior(model) + information(model, flight, ("total",), np.full(3, 0.1))
    assert (
        told.standard_errors[0] > 0.9 * 0.005 * model.vehicle.weight_n / 1.2
    )  # more, as its slack is not known either


# --- the command -----------------------------------------------------------------------------------------------------


def test_the_command_prints_what_to_run_and_writes_it(world: World, tmp_path: Path, raptor_path: Path) -> None:
    world.hover()
    log = next((world.where / "logs" / "hover").glob("*.csv"))
    short = tmp_path / "missions"
    write_mission(short, "runs", SQUARE)
    out = tmp_path / "out.json"
    arguments = ["suggest", str(raptor_path), str(log), "--missions", str(short), "--json", str(out)]
    result = CliRunner().invoke(app, arguments)
    assert result.exit_code == 0, result.output
    told = json.loads(out.read_text())
    assert told["command"] in (None, f"quadctl fly {short / 'runs.yaml'}")
    assert [o["mission"] for o in told["options"]] == ["runs"]
    assert "missions would tell more" in " ".join(result.output.split())


def test_a_result_needs_no_more_than_a_diagnosis(world: World, tmp_path: Path) -> None:
    diagnosis = diagnose(world.rigid, prepare_flights(world.hover(), world.rigid.vehicle), [])
    assert isinstance(diagnosis, Diagnosis)
    assert isinstance(suggest(diagnosis, some(tmp_path, "short_hop")), Suggestion)


@pytest.mark.parametrize(
    ("now", "then", "found"),
    [(1.0, 0.48, [(Said.NARROWS, 0.48)]), (50.0, 0.5, [(Said.IDENTIFIES, 0.01)]), (1.0, 1.0, [])],
)
def test_what_it_tells_of_a_parameter_is_a_share_of_its_interval(
    now: float, then: float, found: list[tuple[Said, float]]
) -> None:
    option = Option(load_mission(MISSIONS / "short_hop.yaml"), "quadctl fly", [], then, [], (0.0, 1.0, 0.0))
    reasons = Suggestion([option], [], "b", now, [], [], unexplained=False).reasons
    assert [(reason.kind, reason.facts["share"]) for reason in reasons] == found


def test_a_look_alike_that_is_not_known_here_is_no_question(world: World, tmp_path: Path) -> None:
    """A session names what its search knew, effects of somebody else's file among them."""
    scaled = world.rigid.plus(ConstantScale(1.0))
    missions = some(tmp_path, "short_hop")
    assert asked(scaled, world.hover(), ["tether"], "thrust_scale", "of_somebody_else", missions=missions).pairs == []
