"""The residual of the model goes out twice a second, while there is one."""

import math

from quadctl.flight.model_watch.watch import NO_ERROR, ModelError
from quadctl.flight.session import ModelLink
from tests.flight.record.test_recorder import tick
from tests.support.in_process import InProcess


def test_the_residual_is_told_twice_a_second_while_there_is_one() -> None:
    autopilot = InProcess()
    link = ModelLink(autopilot)
    for i in range(100):
        link(tick(i))
    assert [name for name, _ in autopilot.told] == ["residual"] * 4
    assert autopilot.told[0][1] == (0.11, -0.12, 0.13)
    for i in range(100, 200):
        link(tick(i)._replace(model_error=NO_ERROR))
    link(tick(200)._replace(model_error=ModelError((math.inf, 0.0, 0.0))))
    assert len(autopilot.told) == 4
