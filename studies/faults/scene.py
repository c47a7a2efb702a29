"""One flight with one fault: a simulated autopilot on the wire, the flight in its own process, and the observations."""

import json
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Mapping
from contextlib import nullcontext
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from quadctl.flight.autopilot.ardupilot import ARDUPILOT
from quadctl.flight.autopilot.mavlink import OWN_SYSTEM_ID
from quadctl.flight.pilot.guards import GuardLimits, unfit
from quadctl.logs.read import read_log
from quadctl.sitl.rules.copter import Guided, SimulatedCopter
from quadctl.sitl.rules.px4 import SimulatedAutopilot
from quadctl.sitl.server.ardupilot import MavlinkArduPilot
from quadctl.sitl.server.px4 import MavlinkPx4
from quadctl.sitl.server.server import MavlinkMock
from quadctl.vehicle import Vehicle, load_vehicle

from .line import Line

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
CONFIG = ROOT / "config" / "flight.yaml"
VEHICLES = CONFIG.parent / "vehicles"
PERSON_S = 14.0
"""Time after which a person lands a vehicle that nothing has landed: longer than any failsafe takes."""
HOVER_M = 0.4
CALM_S = 0.3
START_TIMEOUT_S, END_TIMEOUT_S, EXIT_TIMEOUT_S = 60.0, 25.0, 2.0
TICK_S = 0.02
MIN_BATTERY_V = 13.5


@dataclass(frozen=True)
class Profile:
    """An autopilot that faults are tried on."""

    name: str
    make: Callable[[Vehicle, int], MavlinkMock]
    """Function from a vehicle and a port to the autopilot on the wire."""
    offboard: str
    boot: str
    """Its mode after power-up."""
    failsafe: str
    """Result of `mode_of` when setpoints stop."""
    stick: str
    """The mode that a person's stick takes."""
    land_speed: str
    """Name of the parameter with the landing speed."""


def px4(vehicle: Vehicle, port: int) -> MavlinkMock:
    autopilot = SimulatedAutopilot(vehicle)
    autopilot.parameters["COM_DISARM_LAND"] = 0.3  # the default would only make us wait
    return MavlinkPx4(autopilot, port)


def ardupilot(vehicle: Vehicle, port: int) -> MavlinkMock:
    copter = SimulatedCopter(vehicle)
    for need in ARDUPILOT.requirements(OWN_SYSTEM_ID):
        copter.parameters[need.parameter] = need.to_meet(copter.parameters[need.parameter])
    return MavlinkArduPilot(copter, port)


PROFILES = {
    "px4": Profile("px4", px4, "OFFBOARD", "HOLD", "RTL", "POSCTL", "MPC_LAND_SPEED"),
    "ardupilot": Profile("ardupilot", ardupilot, "GUIDED", "STABILIZE", "GUIDED levelled", "LOITER", "LAND_SPEED"),
}


def mode_of(autopilot: SimulatedAutopilot) -> str:
    """Its mode; ArduPilot's failsafe for missing targets levels it, and the mode stays GUIDED."""
    levelled = isinstance(autopilot, SimulatedCopter) and autopilot.guided is Guided.LEVEL
    return f"{autopilot.mode} levelled" if levelled and autopilot.mode == "GUIDED" else autopilot.mode


def waits_for_a_person(autopilot: SimulatedAutopilot) -> bool:
    """True when no failsafe of its own will ever land it."""
    return (
        isinstance(autopilot, SimulatedCopter) and autopilot.mode == "GUIDED" and autopilot.guided is not Guided.TARGETS
    )


@dataclass
class Seen:
    """Consequences of a fault; times are seconds after it began."""

    last_setpoint_s: float = 0.0
    setpoints: int = 0
    """Setpoints that arrived after the fault began."""
    unfit: list[str] = field(default_factory=list)
    """Setpoints of the whole flight that should not have reached the wire."""
    modes: list[tuple[str, float]] = field(default_factory=list)
    """Changes of mode after the fault."""
    at_rest_s: float = float("nan")
    """Time at which the vehicle was landed and disarmed."""
    ended: str = ""
    """End of the flight, as the log says."""
    events: list[tuple[str, str]] = field(default_factory=list)
    """Events from the log, as (what, answer)."""
    rows_lost_s: float = 0.0
    """Setpoints that arrived and are not in the log, in seconds of flight."""
    exited_s: float = float("nan")
    """Time at which the flight's process had ended by itself."""
    problem: str = ""
    """Further content of its result file."""

    @property
    def mode(self) -> str:
        """The first mode after the fault."""
        return self.modes[0][0] if self.modes else ""


@dataclass(frozen=True)
class Setting:
    """Settings in which one flight differs from the others before its fault."""

    stall_s: float = 3.0
    """Time for which SIGUSR1 and SIGUSR2 stall the process, s."""
    guards: Mapping[str, Any] = field(default_factory=dict)
    model: Path | None = None
    """Compensator of the flight."""
    vehicle: str = "raptor"
    """Name of a file in config/vehicles."""
    on_a_line: bool = False
    """True: a `Line` lies between autopilot and flight."""
    mission: Path = HERE / "hover.yaml"


class Scene:
    """The stage on which a fault acts."""

    def __init__(self, profile: Profile, where: Path, setting: Setting) -> None:
        self.profile = profile
        self.where = where
        port = _free_port()
        self._line = Line(_free_port(), port) if setting.on_a_line else None
        vehicle = VEHICLES / f"{setting.vehicle}.yaml"
        self.px = profile.make(load_vehicle(vehicle), port if self._line is None else self._line.autopilot_port)
        self.began_s = time.monotonic()
        self._later: list[tuple[float, Callable[[], object]]] = []
        words = ["fly", str(setting.mission), "--link", f"udpin://127.0.0.1:{port}", "--log-dir", str(where)]
        words += ["--config", str(_config(where, vehicle, setting.guards)), "--json", str(where / "out.json")]
        words += [] if setting.model is None else ["--model", str(setting.model)]
        self._complaints = where / "stderr.txt"
        with self._complaints.open("w") as complaints:
            self.process = subprocess.Popen(
                [sys.executable, "-m", "studies.faults.flier", *words],
                cwd=ROOT,
                env={**os.environ, "STALL_S": str(setting.stall_s)},
                stdout=subprocess.DEVNULL,
                stderr=complaints,
                start_new_session=True,
            )

    @property
    def log(self) -> Path:
        (path,) = self.where.glob("*.csv")
        return path

    @property
    def line(self) -> Line:
        assert self._line is not None, "this setting has no line"
        return self._line

    def signal(self, number: signal.Signals) -> None:
        """Send a signal to the flight's process."""
        self.process.send_signal(number)

    def later(self, after_s: float, action: Callable[[], object]) -> None:
        """Do `action` so long after the fault began."""
        self._later.append((after_s, action))

    def after_heartbeat(self) -> None:
        """Let the fault begin just after the next heartbeat."""
        sent = self.px.heartbeats_sent
        self.px.wait_until(lambda: self.px.heartbeats_sent > sent, START_TIMEOUT_S)
        self.began_s = time.monotonic()

    def stick(self, mode: str) -> None:
        """A person takes the mode."""
        assert self.px.autopilot.request_mode(mode) is None

    def watch(self, inject: Callable[["Scene"], None]) -> Seen:
        """Fly, let the fault begin in the hover, watch until the vehicle is at rest."""
        with self._line or nullcontext(), self.px as px:
            self._reach_hover()
            seen = Seen()
            before, mode = len(px.setpoints_received), mode_of(px.autopilot)
            self.began_s = flown_s = time.monotonic()
            inject(self)

            def look() -> bool:
                nonlocal mode, flown_s
                now_s = time.monotonic() - self.began_s
                if not waits_for_a_person(px.autopilot):
                    flown_s = time.monotonic()
                elif time.monotonic() - flown_s > PERSON_S:
                    self.stick("LAND")
                for entry in [e for e in self._later if e[0] <= now_s]:
                    self._later.remove(entry)
                    entry[1]()
                if mode_of(px.autopilot) != mode:
                    mode = mode_of(px.autopilot)
                    seen.modes.append((mode, now_s))
                if self.process.poll() is not None and np.isnan(seen.exited_s):
                    seen.exited_s = now_s
                if not px.autopilot.armed and px.autopilot.landed and np.isnan(seen.at_rest_s):
                    seen.at_rest_s = now_s
                return not np.isnan(seen.at_rest_s) and not self._later

            px.wait_until(look, END_TIMEOUT_S)
            px.wait_until(lambda: look() and not np.isnan(seen.exited_s), EXIT_TIMEOUT_S)
            self._end()
            received = list(px.setpoints_received)
        seen.setpoints = len(received) - before
        if seen.setpoints:
            seen.last_setpoint_s = received[-1].received_s - self.began_s
        limits = GuardLimits()
        seen.unfit = [str(problem) for s in received if (problem := unfit(s.target, limits, 0.9))]
        self._read_log(seen, len(received))
        return seen

    def close(self) -> None:
        """Leave nothing running."""
        self.process.kill()
        self.process.wait()

    def _reach_hover(self) -> None:
        px, autopilot = self.px, self.px.autopilot

        def hovering() -> bool:
            hovers = -autopilot.body.position[2] > HOVER_M and bool(px.setpoints_received)
            return self.process.poll() is not None or hovers

        hovers = px.wait_until(hovering, START_TIMEOUT_S) and self.process.poll() is None
        if not hovers:
            raise RuntimeError(f"the flight did not begin: {self._complaints.read_text().strip()}")
        end_s = autopilot.time_s + CALM_S
        px.wait_until(lambda: autopilot.time_s > end_s, START_TIMEOUT_S)

    def _end(self) -> None:
        """Interrupt a process that waits for a link that does not come back."""
        for _ in range(2):
            if self.process.poll() is None:
                self.signal(signal.SIGINT)
                time.sleep(0.1)
        try:
            self.process.wait(5.0 * EXIT_TIMEOUT_S)
        except subprocess.TimeoutExpired:
            self.process.kill()

    def _read_log(self, seen: Seen, setpoints: int) -> None:
        meta: dict[str, Any] = yaml.safe_load(self.log.with_suffix(".meta.yaml").read_text())
        seen.ended = meta["ended"]
        seen.events = [(event["what"], event["answer"]) for event in meta["events"]]
        commanded = int(np.isfinite(read_log(self.log)["throttle_cmd"]).sum())
        seen.rows_lost_s = max(setpoints - commanded, 0) * TICK_S
        result = self.where / "out.json"
        if result.is_file():
            seen.problem = json.loads(result.read_text())["problem"] or ""


def _config(where: Path, vehicle: Path, guards: Mapping[str, Any]) -> Path:
    settings = yaml.safe_load(CONFIG.read_text())
    settings["vehicle"] = str(vehicle)
    settings["guards"] |= {"min_battery_v": MIN_BATTERY_V, **guards}
    path = where / "flight.yaml"
    path.write_text(yaml.safe_dump(settings))
    return path


def _free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])
