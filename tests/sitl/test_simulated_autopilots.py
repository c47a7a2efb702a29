"""Every autopilot that the simulator can be is one that quadctl flies, under the same names of modes."""

import pytest

from quadctl.flight.autopilot.firmwares import FIRMWARES
from quadctl.sitl.autopilots import Simulated
from quadctl.vehicle import Vehicle


@pytest.fixture(params=Simulated)
def simulated(request: pytest.FixtureRequest) -> Simulated:
    kind: Simulated = request.param
    return kind


def test_its_name_is_that_of_the_command_line(simulated: Simulated) -> None:
    assert Simulated(simulated.value) is simulated


def test_it_is_told_by_its_heartbeat(simulated: Simulated, raptor: Vehicle) -> None:
    mock = simulated.on_the_wire(simulated.on_the_wire.rules(raptor))
    firmware = FIRMWARES[mock.manners.mav_autopilot]
    assert firmware.name == mock.autopilot.name
    assert firmware.offboard_mode == mock.autopilot.offboard_mode
    assert firmware.takes_off_itself == mock.manners.takes_off_by_command
    assert {name: firmware.modes[name] for name in mock.autopilot.modes} == mock.manners.custom_modes


def test_it_has_the_parameters_that_are_judged_before_a_flight(simulated: Simulated, raptor: Vehicle) -> None:
    mock = simulated.on_the_wire(simulated.on_the_wire.rules(raptor))
    firmware = FIRMWARES[mock.manners.mav_autopilot]
    judged = {check.parameter for check in firmware.checks} | {need.parameter for need in firmware.requirements(1)}
    assert judged <= mock.autopilot.parameters.keys()
