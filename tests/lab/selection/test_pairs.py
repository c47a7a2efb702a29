"""Specification of the pairs of families that a diagnosis reports as inseparable."""

from dataclasses import dataclass
from typing import Any, cast

import pytest

from quadctl.effects import Effect
from quadctl.effects.ground_effect import Hayden
from quadctl.effects.imu_bias import ConstantBias
from quadctl.effects.inflow import AxialInflow
from quadctl.effects.rotor_drag import LinearDrag
from quadctl.effects.thrust_tilt import FixedTilt
from quadctl.lab.selection.candidate import Candidate
from quadctl.lab.selection.diagnosis import _inseparable


@dataclass
class Found:
    """Effect and intervals of a candidate."""

    effect: Effect
    ci95: dict[str, tuple[float, float]]

    @property
    def family(self) -> str:
        return self.effect.family()


def pairs(missing: list[str], *found: Any, speed_m_s: float = 3.0, levelled: float = 0.0) -> list[tuple[str, str]]:
    span = {"speed": speed_m_s, "levelled": levelled}.__getitem__
    return _inseparable(missing, [cast(Candidate, each) for each in found], span)


DOWN = Found(LinearDrag(0.3, 0.3, 0.3), {"d_x": (0.28, 0.32), "d_y": (0.28, 0.32), "d_z": (0.25, 0.35)})
LEVEL = Found(LinearDrag(0.3, 0.3, 0.02), {"d_x": (0.28, 0.32), "d_y": (0.28, 0.32), "d_z": (0.01, 0.03)})
INFLOW = Found(AxialInflow(0.4), {"k": (0.3, 0.5)})
GROUND = Found(Hayden(), {})
BIAS, TILT = Found(ConstantBias(), {}), Found(FixedTilt(), {})


def test_a_drag_along_body_z_may_be_inflow() -> None:
    assert pairs(["ground_effect", "rotor_drag"], GROUND, DOWN) == [("rotor_drag", "inflow")]


def test_a_drag_of_runs_alone_may_not() -> None:
    assert pairs(["rotor_drag"], LEVEL) == []


def test_beside_an_inflow_that_was_found_it_is_no_question() -> None:
    assert pairs(["rotor_drag", "inflow"], DOWN) == []


def test_an_inflow_may_be_a_drag_where_nobody_flew_sideward() -> None:
    assert pairs(["inflow"], INFLOW, speed_m_s=0.5) == [("inflow", "rotor_drag")]
    assert pairs(["inflow"], INFLOW, speed_m_s=3.0) == []


@pytest.mark.parametrize("found", [[BIAS, TILT], [TILT, GROUND, BIAS]])
def test_a_bias_with_a_tilt_may_be_an_error_of_the_attitude(found: list[Found]) -> None:
    assert pairs([each.family for each in found], *found) == [("imu_bias", "thrust_tilt")]


def test_a_tilt_may_be_a_bias_by_which_the_estimator_levels() -> None:
    assert pairs(["thrust_tilt"], TILT, levelled=1.0) == [("thrust_tilt", "imu_bias")]
    assert pairs(["thrust_tilt"], TILT, levelled=0.0) == []
    assert pairs(["imu_bias", "thrust_tilt"], BIAS, TILT, levelled=1.0) == [("imu_bias", "thrust_tilt")]
