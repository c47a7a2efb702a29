"""Poses that pass to the autopilot, those that do not, and the count of both."""

import math

import pytest

from quadctl.errors import LinkError
from quadctl.mocap.forward import Forwarder
from quadctl.mocap.gate import Gate, Pose
from quadctl.mocap.statistics import Flow
from quadctl.state import Quat, VehicleState

SAME: Quat = (1.0, 0.0, 0.0, 0.0)


def pose(at_s: float, x: float = 0.0, q: Quat = SAME, sent_s: float = math.nan) -> Pose:
    return Pose("raptor", at_s, (x, 0.0, 0.0), q, sent_s)


def test_only_numbers_of_unit_attitude_pass() -> None:
    gate = Gate()
    assert gate.objection(pose(0.0, math.nan), 0.0) == "not a number"
    assert gate.objection(pose(0.0, q=(math.inf, 0.0, 0.0, 0.0)), 0.0) == "not a number"
    assert gate.objection(pose(0.0, q=(0.0, 0.0, 0.0, 0.0)), 0.0) == "the quaternion is not of length 1"
    assert gate.objection(pose(0.0), 0.0) == ""


def test_a_pose_that_is_old_or_came_late_does_not_pass() -> None:
    gate = Gate()
    assert gate.objection(pose(1.0, 0.0), 1.2) == "stale"
    assert gate.objection(pose(2.0, 0.1, sent_s=1002.0), 2.0) == ""
    assert gate.objection(pose(3.0, 0.2, sent_s=1002.8), 3.0) == "stale"  # 0.2 s longer on its way than the one before
    assert gate.objection(pose(3.1, 0.3, sent_s=1003.05), 3.1) == ""


def test_a_pose_that_repeats_itself_does_not_pass_and_is_soon_called_frozen() -> None:
    gate = Gate()
    reasons = [gate.objection(pose(0.01 * i, 1.0), 0.01 * i) for i in range(13)]
    assert reasons[0] == ""
    assert set(reasons[1:10]) == {"repeated"}
    assert reasons[-1] == "frozen"
    assert gate.objection(pose(0.2, 1.001), 0.2) == ""


def test_a_jump_does_not_pass_and_the_new_place_does_when_it_could_have_been_reached() -> None:
    gate = Gate()
    assert gate.objection(pose(0.0, 0.0), 0.0) == ""
    assert gate.objection(pose(0.01, 3.0), 0.01) == "jumped"
    assert gate.objection(pose(0.02, 0.01), 0.02) == ""
    assert gate.objection(pose(0.22, 3.0), 0.22) == ""


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
    assert forwarder.take(pose(0.01, 0.01), 0.01) == ["the autopilot has gone silent"]
    assert forwarder.take(pose(0.02, 0.02), 0.02) == []
    there = True
    assert forwarder.take(pose(0.03, 0.03), 0.03) == ["the autopilot is heard again"]
    assert (len(sent), forwarder.flow.sent) == (2, 2)
    assert forwarder.flow.withheld == {"with the link down": 2}
