"""Surfaces of the ground: their map, the ground effect over each of them, and what flights over several tell."""

import copy
import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from quadctl.compensator import Compensator
from quadctl.effects import find_effect
from quadctl.effects.ground_effect import Surface
from quadctl.effects.ground_effect_surfaces import Surfaces
from quadctl.errors import SettingsError
from quadctl.flight.preflight.check import check_flight
from quadctl.flight.preflight.findings import Verdict
from quadctl.flight.preflight.plan import read_flight
from quadctl.lab.flights.dataset import load_dataset
from quadctl.lab.planning.suggestion import Suggestion, least_known_surface
from quadctl.lab.surfaces import SurfaceComparison, compare_surfaces
from quadctl.logs.flight_log import FlightLog
from quadctl.logs.read import read_log
from quadctl.missions import load_mission
from quadctl.model import Model, Provenance, conditions, load_model, save_model
from quadctl.settings import validate
from quadctl.sitl.run import simulate
from quadctl.state import VehicleState
from quadctl.surfaces import Place, read_place
from quadctl.vehicle import load_vehicle
from tests.support.links import RAPTOR
from tests.support.places import ROOT

VEHICLE = load_vehicle(RAPTOR)
HALVES = {"mat": {"north_m": [-5, 0], "east_m": [-5, 5]}, "turf": {"north_m": [0, 5], "east_m": [-5, 5]}}
EDGE = {"surfaces": HALVES, "edge_m": 0.4}
LEVEL = (1.0, 0.0, 0.0, 0.0)


def place(data: dict[str, Any]) -> Place:
    found = read_place(data, "mission.yaml")
    assert found is not None
    return found


def shares(north: float, east: float = 0.0) -> dict[str, float]:
    return dict(place(EDGE).shares((north, east)))


class TestPlace:
    def test_deep_inside_an_area_all_ground_is_its_own(self) -> None:
        assert shares(-2.0) == {"mat": 1.0, "turf": 0.0}
        assert shares(3.0, 4.0) == {"mat": 0.0, "turf": 1.0}

    def test_over_an_edge_one_passes_linearly_into_the_other(self) -> None:
        assert shares(0.0) == pytest.approx({"mat": 0.5, "turf": 0.5})
        assert shares(0.1) == pytest.approx({"mat": 0.25, "turf": 0.75})
        assert shares(-0.2) == pytest.approx({"mat": 1.0, "turf": 0.0})

    def test_beyond_the_map_no_surface_has_a_name(self) -> None:
        assert shares(9.0) == {"mat": 0.0, "turf": 0.0}

    def test_a_whole_log_is_mapped_at_once(self) -> None:
        north = np.array([-2.0, 0.1, 2.0])
        found = dict(place(EDGE).shares((north, 0.0 * north)))
        assert found["turf"] == pytest.approx([0.0, 0.75, 1.0])

    def test_one_surface_is_everywhere(self) -> None:
        assert place({"surface": "turf"}).shares((100.0, -3.0)) == (("turf", 1.0),)

    @pytest.mark.parametrize(
        ("data", "said"),
        [
            ({"surface": "turf", **EDGE}, "has surface and surfaces, expected one of them"),
            ({"edge_m": 0.3}, "edge_m is 0.3, expected surfaces with it"),
            ({"surface": "dry soil"}, "'dry soil', expected lower-case letters, digits and underscores"),
            ({"surfaces": {"mat": None, "turf": HALVES["turf"]}}, "mat has no area"),
            ({"surfaces": {**HALVES, "mat": {"north_m": [1, 0], "east_m": [0, 1]}}}, "expected the smaller number"),
            ({"surfaces": {"mat": {"north_m": [-1, 1], "east_m": [0, 1]}, "turf": HALVES["turf"]}}, "overlap"),
            ({**EDGE, "edge_m": 0}, "edge_m"),
        ],
    )
    def test_a_map_that_cannot_be_right_is_one_sentence(self, data: dict[str, Any], said: str) -> None:
        with pytest.raises(SettingsError, match=said) as refused:
            read_place(data, "mission.yaml")
        assert str(refused.value).startswith("mission.yaml: ")
        assert "\n" not in str(refused.value)


def effect(**values: float) -> Surfaces:
    made = find_effect("ground_effect.surfaces", "model.yaml").from_values(values, "model.yaml")
    assert isinstance(made, Surfaces)
    return made


class TestEffect:
    TWO = effect(k_b=0.5, k_mat=0.4, k_turf=-0.3)

    def ratio(self, north: float, made: Surfaces | None = None) -> float:
        c = conditions(VEHICLE, 0.2, (0.0, 0.0, 0.0), LEVEL, position_ne_m=(north, 0.0), place=place(EDGE))
        return float((made or self.TWO).ratio(c, VEHICLE))

    def one(self, k: float) -> float:
        return float(Surface(k, 0.0).at_height(0.2 + VEHICLE.rotor_height_m, VEHICLE))

    def test_over_each_surface_it_is_eq_20_with_its_k_s(self) -> None:
        assert self.ratio(-2.0) == pytest.approx(self.one(0.9))
        assert self.ratio(2.0) == pytest.approx(self.one(0.2))

    def test_over_the_edge_and_beyond_the_map_it_is_between_and_the_mean(self) -> None:
        assert self.ratio(0.0) == pytest.approx(self.one(0.55))
        assert self.ratio(9.0) == pytest.approx(self.one(0.5))

    def test_a_surface_swallows_the_fountain_but_does_not_pull(self) -> None:
        assert self.ratio(2.0, effect(k_b=0.2, k_turf=-1.0)) == pytest.approx(self.one(0.0))

    def test_it_survives_copies_pickles_and_files(self, tmp_path: Path) -> None:
        assert copy.deepcopy(self.TWO).values() == pickle.loads(pickle.dumps(self.TWO)).values() == self.TWO.values()
        save_model(Model(VEHICLE, vehicle_path=RAPTOR).plus(self.TWO), tmp_path / "m.yaml")
        assert load_model(tmp_path / "m.yaml").effects == (self.TWO,)

    def test_a_weight_out_of_bounds_is_one_sentence(self) -> None:
        with pytest.raises(SettingsError, match=r"model.yaml: parameter k_turf of ground_effect.surfaces is 99"):
            effect(k_turf=99.0)
        with pytest.raises(SettingsError, match="has no parameter 'b'"):
            effect(b=1.0)

    def test_the_compensator_takes_the_weight_of_the_place_where_it_is(self) -> None:
        model = Model(VEHICLE).plus(self.TWO)
        with_map, without = Compensator(model, place=place(EDGE)), Compensator(model)

        def ratio(compensator: Compensator, north: float) -> float:
            state = VehicleState(0.0, (north, 0.0, -0.2), (0.0, 0.0, 0.0), LEVEL, (0.0, 0.0, 0.0))
            return compensator(state, 0.0, VEHICLE.weight_n).thrust_ratio

        assert ratio(with_map, -2.0) == pytest.approx(self.one(0.9))
        assert ratio(with_map, 2.0) == pytest.approx(self.one(0.2))
        assert ratio(without, 2.0) == pytest.approx(self.one(0.5))


class TestMissions:
    def test_one_surface_is_a_parameter_of_the_mission(self) -> None:
        mission = load_mission(ROOT / "missions/surface_heights.yaml", overrides=["surface=turf"])
        assert mission.place == place({"surface": "turf"})

    def test_a_map_is_in_the_mission(self) -> None:
        mission = load_mission(ROOT / "missions/surface_edge.yaml")
        assert mission.place is not None
        assert list(mission.place.surfaces) == ["concrete", "turf"]
        assert load_mission(ROOT / "missions/short_hop.yaml").place is None

    @pytest.mark.parametrize(
        ("mission", "said"),
        [("surface_edge", "the model knows mat, turf, not concrete"), ("hover_staircase", "does not say over which")],
    )
    def test_check_warns_of_a_surface_that_the_model_does_not_know(
        self, mission: str, said: str, tmp_path: Path
    ) -> None:
        save_model(Model(VEHICLE, vehicle_path=RAPTOR).plus(TestEffect.TWO), tmp_path / "m.yaml")
        plan = read_flight(ROOT / f"missions/{mission}.yaml", None, str(tmp_path / "m.yaml"), None)
        findings = [finding for finding in check_flight(plan) if finding.topic == "surfaces"]
        assert [finding.verdict for finding in findings] == [Verdict.WARNING]
        assert said in findings[0].text


TRUE = {"mat": 0.2, "turf": 1.4}


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> list[FlightLog]:
    """A hover at 13 heights over each of two surfaces, in one world."""
    folder, logs = tmp_path_factory.mktemp("surfaces"), []
    parameters = {"k_b": 0.8, **{f"k_{name}": k - 0.8 for name, k in TRUE.items()}}
    for seed, name in enumerate(TRUE):
        hidden = folder / f"{name}.yaml"
        truth = {"effects": [{"effect": "ground_effect.surfaces", "parameters": parameters}]}
        hidden.write_text(yaml.safe_dump({**truth, "ground": {"surfaces": {name: None}}}))
        path = ROOT / "missions/surface_heights.yaml"
        plan = read_flight(path, None, None, None, [f"surface={name}", "hover_s=6"])
        logs.append(read_log(simulate(plan, folder / name, hidden, seed).log))
    return logs


@pytest.fixture(scope="module")
def compared(flown: list[FlightLog]) -> SurfaceComparison:
    return compare_surfaces(Model(VEHICLE), load_dataset(flown, VEHICLE))


class TestComparison:
    def test_the_log_says_over_what_it_was_flown(self, flown: list[FlightLog]) -> None:
        assert [log.meta["surfaces"] for log in flown] == [{"mat": None}, {"turf": None}]

    def test_each_weight_is_within_its_interval_and_the_surfaces_differ(self, compared: SurfaceComparison) -> None:
        assert compared.differ
        for name, told in compared.to_dict()["surfaces"].items():
            assert told["ci95"][0] <= TRUE[name] <= told["ci95"][1]
        assert compared.thrust_ratios["turf"][0] - compared.thrust_ratios["mat"][0] == pytest.approx(0.055, abs=0.01)
        assert "The surfaces differ" in str(compared)

    def test_parameters_of_the_model_are_within_their_intervals(self, compared: SurfaceComparison) -> None:
        (item,) = compared.model.stack
        assert item.fitted is not None
        for name, value in item.effect.values().items():
            low, high = item.fitted.ci95[name]
            assert low <= value <= high

    def test_the_same_ground_under_two_names_is_not_told_apart(self, flown: list[FlightLog]) -> None:
        mat, _ = flown
        halves = {
            "a": {"north_m": [-5.0, 5.0], "east_m": [-5.0, 0.0]},
            "b": {"north_m": [-5.0, 5.0], "east_m": [0.0, 5.0]},
        }
        one = FlightLog(mat.name, None, mat.columns, mat.phase, {**mat.meta, "surfaces": halves, "edge_m": 0.001})
        result = compare_surfaces(Model(VEHICLE), load_dataset([one], VEHICLE))
        assert not result.differ
        assert "cannot be told apart" in str(result)

    def test_one_surface_is_none_to_compare(self, flown: list[FlightLog]) -> None:
        with pytest.raises(SettingsError, match="say only mat of the surfaces below them, expected two or more"):
            compare_surfaces(Model(VEHICLE), load_dataset(flown[:1], VEHICLE))

    def test_a_map_that_cannot_be_right_is_refused_with_the_name_of_the_log(self, flown: list[FlightLog]) -> None:
        bad = FlightLog("bad.csv", None, flown[0].columns, flown[0].phase, {"surface": "Dry soil"})
        with pytest.raises(SettingsError, match=r"bad\.csv: surfaces: 'Dry soil'"):
            load_dataset([bad], VEHICLE)


class TestSuggestion:
    def test_the_surface_with_the_widest_interval_is_the_next_to_fly(self) -> None:
        model = Model(VEHICLE).plus(TestEffect.TWO, Provenance(ci95={"k_mat": (0.3, 0.5), "k_turf": (-0.5, -0.1)}))
        assert least_known_surface(model) == "turf"
        said = Suggestion([], [], None, None, [], [], unexplained=False, surface="turf").answer
        assert str(said[1]).endswith("over it: quadctl fly missions/surface_heights.yaml --set surface=turf")

    def test_without_surfaces_there_is_none(self) -> None:
        assert least_known_surface(Model(VEHICLE)) is None


def test_a_place_of_no_surfaces_is_refused() -> None:
    with pytest.raises(SettingsError, match="surfaces"):
        validate({"surfaces": {}}, Place, "mission.yaml")
