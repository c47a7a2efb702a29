"""A flight over a serial line: what it costs beside the same flight over UDP."""

import time
from pathlib import Path

import psutil
import pytest

from quadctl.sitl.run import mock_process
from quadctl.vehicle import load_vehicle
from studies.serial_line import SerialLine
from tests.support.flight_process import Flight
from tests.support.links import RAPTOR

pytestmark = pytest.mark.realtime


class Usage:
    """Processor time of a flight per wall time, since this was made."""

    def __init__(self, flight: Flight) -> None:
        self._process = psutil.Process(flight.process.pid)
        self._began_s, self._began_cpu_s = time.monotonic(), self._cpu_s()

    def share(self) -> float:
        return (self._cpu_s() - self._began_cpu_s) / (time.monotonic() - self._began_s)

    def _cpu_s(self) -> float:
        times = self._process.cpu_times()
        return float(times.user + times.system)


@pytest.mark.long
def test_a_flight_over_a_serial_line_takes_about_as_much_of_the_processor_as_one_over_udp(tmp_path: Path) -> None:
    """Both fly at the same time; with VMIN 0, the one over the line takes a whole core, some eight times as much."""
    vehicle = load_vehicle(RAPTOR)
    with mock_process(vehicle, None, 1) as udp, mock_process(vehicle, None, 1) as carried:
        port = int(carried.rpartition(":")[2])
        with SerialLine(tmp_path / "tty", port) as line:
            flights = [Flight(tmp_path / "udp", udp), Flight(tmp_path / "serial", f"serial://{line.device}:921600")]
            for flight in flights:
                flight.until_recorded("hover")
            usages = [Usage(flight) for flight in flights]
            for flight in flights:
                flight.until_recorded("down")
            over_udp, over_serial = (usage.share() for usage in usages)
            for flight in flights:
                _, says = flight.ended()
                assert "completed" in says
    assert over_serial < 2.5 * over_udp, (over_serial, over_udp)
