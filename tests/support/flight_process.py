"""A flight by the command `quadctl fly` in a process of its own."""

import subprocess
import sys
import time
from collections.abc import Mapping
from pathlib import Path

from quadctl.logs.flight_log import FlightLog
from quadctl.logs.read import read_log
from tests.support.configurations import FORGIVING, configuration
from tests.support.places import ROOT

NO_CHANGES: Mapping[str, float] = {}
START_TIMEOUT_S = 60.0
"""Longest time until a flight in a process of its own is in the air: libraries are loaded before."""


class Flight:
    """`quadctl fly` in a process of its own, on the autopilot at a link."""

    def __init__(
        self, where: Path, url: str, *words: str, mission: str = "short_hop", guards: Mapping[str, float] = NO_CHANGES
    ) -> None:
        where.mkdir(exist_ok=True)
        config = configuration(where, height_datum="takeoff", guards=FORGIVING | dict(guards))
        fly = ["fly", f"missions/{mission}.yaml", "--link", url, "--config", str(config), *words]
        code = "from quadctl.cli import main; main()"
        self.where = where
        self.process = subprocess.Popen(
            [sys.executable, "-c", code, *fly, "--log-dir", str(where)],
            cwd=ROOT,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )

    def until_recorded(self, phase: str) -> None:
        end_s = time.monotonic() + START_TIMEOUT_S
        while not any(f",{phase}\n" in path.read_text() for path in self.where.glob("*.csv")):
            assert self.process.poll() is None, self.process.communicate()
            assert time.monotonic() < end_s, "it takes too long"
            time.sleep(0.05)

    def ended(self) -> tuple[FlightLog, str]:
        """The log, and all that was printed."""
        out, err = self.process.communicate(timeout=60.0)
        (path,) = self.where.glob("*.csv")
        return read_log(path), out + err
