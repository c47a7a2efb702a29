"""Specification of what is measured beyond doubt, and too small to be called missing."""

import math
from dataclasses import replace

import numpy as np
import pytest

from quadctl.effects.inflow import AxialInflow
from quadctl.effects.rotor_drag import LinearDrag
from quadctl.effects.thrust_scale import ConstantScale
from quadctl.frames import GRAVITY_M_S2
from quadctl.lab.comparison.open_loop import OFF_M, STEP_S, off_after_s
from quadctl.lab.finding import Kind
from quadctl.lab.flights.dataset import load_dataset
from quadctl.lab.selection.diagnosis import Diagnosis, diagnose
from quadctl.lab.selection.rule import is_usual
from quadctl.model import Model
from quadctl.vehicle import Vehicle
from quadctl.web.session.findings import Findings
from tests.support.flights import obedient

CANDIDATES = (AxialInflow, LinearDrag, ConstantScale)


def diagnosed(raptor: Vehicle, k: float, noise_m_s: float = 0.002) -> Diagnosis:
    """Diagnosis of climbs and descents with an inflow of this size."""
    log = obedient(Model(raptor).plus(AxialInflow(k)), 120.0, noise_m_s=noise_m_s)
    return diagnose(Model(raptor), load_dataset([log], raptor), CANDIDATES)


@pytest.fixture(scope="module")
def weak(raptor: Vehicle) -> Diagnosis:
    return diagnosed(raptor, 0.03)


class TestVerdict:
    def test_it_is_small_where_nothing_is_missing_and_something_is_measured(self, weak: Diagnosis) -> None:
        found = weak.to_dict()
        assert (found["verdict"], found["missing"], found["small"]) == ("small", [], ["inflow"])

    def test_it_is_missing_where_the_same_is_large(self, raptor: Vehicle) -> None:
        found = diagnosed(raptor, 0.5).to_dict()
        assert (found["verdict"], found["missing"], found["small"]) == ("missing", ["inflow"], [])

    def test_it_is_none_where_nothing_is_measured(self, raptor: Vehicle) -> None:
        found = diagnosed(raptor, 0.0).to_dict()
        assert (found["verdict"], found["small"]) == ("none", [])

    def test_what_stands_for_another_small_effect_is_not_small_itself(self, weak: Diagnosis) -> None:
        """The drag along the thrust explains a part of the inflow, and nothing beside it."""
        assert {c.family for c in weak.measured} == {"inflow", "rotor_drag"}
        assert [[c.family for c in group] for group in weak.small] == [["inflow"]]

    def test_what_every_vehicle_has_is_not_small(self, weak: Diagnosis) -> None:
        like = weak.small[0][0]
        usual = replace(like, effect=ConstantScale(1.01))
        assert is_usual(usual)
        assert not is_usual(replace(like, effect=ConstantScale(1.02)))
        most = replace(usual, after={axis: 0.4 * error for axis, error in usual.before.items()})
        assert not is_usual(most)


class TestAnswer:
    def test_it_comes_first_with_value_interval_cost_and_command(self, weak: Diagnosis) -> None:
        verdict, fact = weak.answer[:2]
        assert (verdict.kind, verdict.facts) == (Kind.ONLY_SMALL, {"families": ["inflow"]})
        assert fact.kind is Kind.SMALL
        k = fact.facts["parameters"]["k"]
        assert k["ci95"][0] < 0.03 < k["ci95"][1] and k["ci95"][0] > 0.0
        assert fact.facts["after"] < fact.facts["before"]
        assert fact.facts["depends_on"] == list(AxialInflow.depends_on)
        assert "quadctl add inflow.axial MODEL.yaml LOG... -o NEW.yaml" in " ".join(str(weak).split())
        assert not [note for note in weak.notes if note.kind is Kind.SMALL]

    def test_a_saved_session_keeps_it(self, weak: Diagnosis) -> None:
        text = Findings.of(weak, {}).to_json()
        kept = Findings.from_json(text, weak.model).diagnosed(weak.model, weak.dataset).diagnosis
        assert kept.lines() == weak.lines()


class TestOff:
    @pytest.mark.parametrize("error", [0.01, -0.04])
    def test_a_constant_error_of_the_thrust_moves_with_half_its_acceleration_times_time_squared(
        self, raptor: Vehicle, error: float
    ) -> None:
        (flight,) = load_dataset([obedient(Model(raptor), 30.0)], raptor).flights
        thrust_m_s2 = np.mean(sum(flight.nominal_n)) / raptor.mass_kg
        assert thrust_m_s2 == pytest.approx(GRAVITY_M_S2, rel=0.01)
        found = off_after_s(Model(raptor).plus(ConstantScale(1.0 + error)), Model(raptor), [flight])
        expected = math.sqrt(2.0 * OFF_M / (abs(error) * GRAVITY_M_S2))
        assert found is not None and expected < found < expected + STEP_S

    def test_what_moves_nothing_in_the_flight_has_no_time(self, raptor: Vehicle) -> None:
        (flight,) = load_dataset([obedient(Model(raptor), 30.0)], raptor).flights
        assert off_after_s(Model(raptor).plus(ConstantScale(1.0 + 1e-6)), Model(raptor), [flight]) is None
