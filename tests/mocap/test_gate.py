"""Poses that pass to the autopilot, those that do not, and the count of both."""

import math

import pytest

from quadctl.errors import LinkError
from quadctl.mocap.findings import Kind
from quadctl.mocap.forward import Forwarder
from quadctl.mocap.gate import Gate, Pose
from quadctl.mocap.statistics import Flow
from quadctl.state import Quat, VehicleState
from quadctl.words import Fact

SAME: Quat = (1.0, 0.0, 0.0, 0.0)


def pose(at_s: float, x: float = 0.0, q: Quat = SAME, sent_s: float = math.nan) -> Pose:
    return Pose("raptor", at_s, (x, 0.0, 0.0), q, sent_s)


def test_only_numbers_of_unit_attitude_pass() -> None:
    gate = Gate()
    assert gate.objection(pose(0.0, math.nan), 0.0) is Kind.NOT_FINITE
    assert gate.objection(pose(0.0, q=(math.inf, 0.0, 0.0, 0.0)), 0.0) is Kind.NOT_FINITE
    assert gate.objection(pose(0.0, q=(0.0, 0.0, 0.0, 0.0)), 0.0) is Kind.NO_ATTITUDE
    assert gate.objection(pose(0.0), 0.0) is None


def test_a_pose_that_is_old_or_came_late_does_not_pass() -> None:
    gate = Gate()
    assert gate.objection(pose(1.0, 0.0), 1.2) is Kind.STALE
    assert gate.objection(pose(2.0, 0.1, sent_s=1002.0), 2.0) is None
    assert gate.objection(pose(3.0, 0.2, sent_s=1002.8), 3.0) is Kind.STALE  # 0.2 s longer on its way
    assert gate.objection(pose(3.1, 0.3, sent_s=1003.05), 3.1) is None


def test_a_pose_that_repeats_itself_does_not_pass_and_is_soon_called_frozen() -> None:
    gate = Gate()
    reasons = [gate.objection(pose(0.01 * i, 1.0), 0.01 * i) for i in range(13)]
    assert reasons[0] is None
    assert set(reasons[1:10]) == {Kind.REPEATED}
    assert reasons[-1] is Kind.FROZEN
    assert gate.objection(pose(0.2, 1.001), 0.2) is None


def test_a_jump_does_not_pass_and_the_new_place_does_when_it_could_have_been_reached() -> None:
    gate = Gate()
    assert gate.objection(pose(0.0, 0.0), 0.0) is None
    assert gate.objection(pose(0.01, 3.0), 0.01) is Kind.JUMPED
    assert gate.objection(pose(0.02, 0.01), 0.02) is None
    assert gate.objection(pose(0.22, 3.0), 0.22) is None


def test_rate_age_and_dropouts_are_counted() -> None:
    flow = Flow()
    for i in range(101):
        flow.add(0.01 * i + (0.5 if i > 50 else 0.0), 0.002)
    assert flow.rate_hz(None) == pytest.approx(100 / 1.5)
    assert (flow.dropouts, flow.longest_gap_s) == (1, pytest.approx(0.51))
    assert "age when sent 2.0 ms" in flow.line()


def test_a_silent_autopilot_and_a_link_that_is_down_are_told() -> None:
    sent: list[dict[str, object]] = []
    there = True

    def send(fields: dict[str, object]) -> None:
        if not there:
            raise LinkError("unplugged")
        sent.append(fields)

    forwarder = Forwarder(send, lambda: VehicleState(0.0, connected=there), "nwu", 0.0)
    assert forwarder.take(pose(0.0, 0.0), 0.0) == []
    there = False
    assert forwarder.take(pose(0.01, 0.01), 0.01) == [Fact(Kind.SILENT)]
    assert forwarder.take(pose(0.02, 0.02), 0.02) == []
    there = True
    assert forwarder.take(pose(0.03, 0.03), 0.03) == [Fact(Kind.HEARD_AGAIN)]
    assert (len(sent), forwarder.flow.sent) == (2, 2)
    assert forwarder.flow.withheld == {Kind.LINK_DOWN: 2}
