"""A delay of the link counts, constant or growing, on each of the two autopilots."""

import asyncio
import json
import subprocess
import sys
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

import pytest

from quadctl.errors import LinkError
from quadctl.flight.autopilot.mavsdk_autopilot import MavsdkAutopilot
from quadctl.flight.pilot.guards import Guard, GuardLimits, defect
from quadctl.flight.pilot.reasons import Kind
from quadctl.sitl.rules.copter import SimulatedCopter
from quadctl.sitl.rules.px4 import SimulatedAutopilot
from quadctl.state import VehicleState
from quadctl.vehicle import load_vehicle
from studies.faults.line import Line
from tests.support.configurations import configuration
from tests.support.links import RAPTOR, Link, connected, free_port, mock
from tests.support.places import ROOT

pytestmark = pytest.mark.realtime

VEHICLE = load_vehicle(RAPTOR)
KINDS = [SimulatedAutopilot, SimulatedCopter]


@asynccontextmanager
async def over(line: Line, port: int, autopilot: SimulatedAutopilot) -> AsyncIterator[Link]:
    """An adapter at the other end of a line, with its telemetry."""
    adapter = MavsdkAutopilot(f"udpin://127.0.0.1:{port}", 4)
    with line, mock(autopilot, line.autopilot_port) as px:
        try:
            await adapter.connect()
            await adapter.request_telemetry()
            yield Link(px, adapter)
        finally:
            await adapter.close()


def flown_over(line: Line, autopilot: SimulatedAutopilot, where: Path) -> tuple[int, str]:
    """Exit status and end of a short flight over a line, by the command."""
    words = f"fly missions/short_hop.yaml --set-params --link udpin://127.0.0.1:{line.flight_port}".split()
    words += ["--log-dir", str(where), "--config", str(configuration(where)), "--json", str(where / "out.json")]
    with line, mock(autopilot, line.autopilot_port):
        code = "from quadctl.cli import main; main()"
        process = subprocess.Popen([sys.executable, "-c", code, *words], cwd=ROOT, stdout=subprocess.DEVNULL)
        status = process.wait(timeout=90)
    return status, json.loads((where / "out.json").read_text())["ended"]


@pytest.mark.parametrize("kind", KINDS)
def test_a_constant_delay_is_measured(kind: type[SimulatedAutopilot]) -> None:
    port = free_port()
    line = Line(free_port(), port)
    line.delay(0.15)

    async def look() -> None:
        async with over(line, port, kind(VEHICLE)) as link:
            # A busy machine adds to the first answers, and may leave a state stale for a moment: both go again.
            def found_slow(s: VehicleState) -> bool:
                found = defect(s, GuardLimits())
                return found is not None and found.guard is Guard.STATE_AGE and found.reason.kind is Kind.SLOW_LINK

            def measured(s: VehicleState) -> bool:
                return s.finite and abs(s.setpoint_delay_s - 0.15) < 0.03 and abs(s.control_age_s - 0.16) < 0.04

            await link.until(lambda s: measured(s) and found_slow(s))

    asyncio.run(look())


@pytest.mark.parametrize("kind", KINDS)
def test_a_short_link_counts_next_to_nothing(kind: type[SimulatedAutopilot]) -> None:
    port = free_port()

    async def look() -> None:
        async with over(Line(free_port(), port), port, kind(VEHICLE)) as link:
            await link.pass_time(2.0)
            # Whatever a busy machine adds, it does not always.
            await link.until(lambda s: s.control_age_s + s.setpoint_delay_s < 0.03)
            assert link.adapter.warnings == []

    asyncio.run(look())


def test_an_autopilot_that_does_not_answer_is_a_warning() -> None:
    port = free_port()

    async def look() -> None:
        adapter = MavsdkAutopilot(f"udpin://127.0.0.1:{port}", 4)
        with mock(SimulatedAutopilot(VEHICLE), port) as px:
            px.faults.withheld = frozenset({"TIMESYNC"})
            try:
                await adapter.connect()
                await adapter.request_telemetry()
                (warning,) = adapter.warnings
                assert "does not answer TIMESYNC: a delay of the link that is constant or grows slowly" in warning
            finally:
                await adapter.close()

    asyncio.run(look())


@pytest.mark.parametrize("kind", KINDS)
def test_a_mode_is_entered_where_only_the_acknowledgement_is_lost(kind: type[SimulatedAutopilot]) -> None:
    with connected(kind(VEHICLE)) as link:
        link.px.faults.withheld = frozenset({"COMMAND_ACK"})
        asyncio.run(link.adapter.hold())
        assert link.adapter.state().mode == link.adapter.firmware.hold_mode
        with pytest.raises(LinkError, match="no answer"):
            asyncio.run(link.adapter.take_off(1.0))


@pytest.mark.parametrize("kind", [SimulatedAutopilot, pytest.param(SimulatedCopter, marks=pytest.mark.long)])
def test_no_flight_begins_over_a_link_with_250_ms_each_way(kind: type[SimulatedAutopilot], tmp_path: Path) -> None:
    """On the real autopilots such flights swung by metres; the age of the state was logged as 5 ms."""
    autopilot, line = kind(VEHICLE), Line(free_port(), free_port())
    line.delay(0.25)
    status, ended = flown_over(line, autopilot, tmp_path)
    assert status == 1
    assert "s old, allowed are 0.2 s" in ended
    assert not autopilot.armed
    assert autopilot.body.position[2] > -0.05


@pytest.mark.long
@pytest.mark.parametrize("kind", KINDS)
def test_a_flight_over_a_link_that_loses_a_fifth_from_its_start_is_completed(
    kind: type[SimulatedAutopilot], tmp_path: Path
) -> None:
    line = Line(free_port(), free_port())
    line.down.loss = line.up.loss = 0.2
    line.up.chance.seed(1)
    assert flown_over(line, kind(VEHICLE), tmp_path) == (0, "completed")
