"""A flight over MAVLink in real time, with quadctl in a process of its own; only the autopilot is simulated."""

import csv
import math
import resource
import signal
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

import yaml
from pymavlink.dialects.v20 import ardupilotmega as dialect

from quadctl.flight.pilot.guards import unfit
from quadctl.state import AttitudeTarget

from ..faults.scene import PROFILES, Scene, Setting
from .draw import Sequence as Drawn
from .evidence import Asked, Evidence, Noted, Sent
from .kinds import KINDS
from .plan import plan_of
from .simulated_time import LIFTED_M
from .stage import Stage

START_S, HORIZON_S, EXIT_S = 60.0, 110.0, 15.0
MACHINE_S = 0.3
"""Time by which a busy machine may hold up what is seen at the autopilot."""
LEVEL = (1.0, 0.0, 0.0, 0.0)
COMMANDS = {
    dialect.MAV_CMD_COMPONENT_ARM_DISARM: "arm",
    dialect.MAV_CMD_NAV_TAKEOFF: "take off",
    dialect.MAV_CMD_DO_SET_MODE: "",
}


class LiveStage(Stage):
    """The stage of a flight in real time."""

    def __init__(self, scene: Scene) -> None:
        super().__init__(scene.px, scene.profile, scene.line.down, scene.line.up)
        self.scene = scene
        self.due: list[tuple[float, Callable[[], object]]] = []

    def refresh(self) -> None:
        super().refresh()
        self.scene.line.apply()

    @property
    def now_s(self) -> float:
        return time.monotonic()

    def later(self, after_s: float, action: Callable[[], object]) -> None:
        self.due.append((self.now_s + after_s, action))

    def act(self) -> None:
        """Do what is due."""
        for entry in sorted((e for e in self.due if e[0] <= self.now_s), key=lambda e: e[0]):
            self.due.remove(entry)
            entry[1]()

    def stall(self, seconds: float, how: str) -> None:
        if how == "process":
            self.signal("SIGSTOP")
            self.later(seconds, partial(self.signal, "SIGCONT"))
        else:
            self.signal("SIGUSR1" if how == "loop" else "SIGUSR2")

    def interrupt(self, name: str) -> None:
        self.signal(name)

    def kill(self) -> None:
        self.killed = self.killed or self.scene.process.poll() is None
        self.signal("SIGKILL")

    def fill_disk(self) -> None:
        with suppress(OSError, ValueError):
            size = self.scene.log.stat().st_size
            resource.prlimit(self.scene.process.pid, resource.RLIMIT_FSIZE, (size, size))
            self.disk_full = True

    def signal(self, name: str) -> None:
        if self.scene.process.poll() is None:
            self.scene.process.send_signal(signal.Signals[name])


def fly(sequence: Drawn, folder: Path) -> Evidence:
    """Fly a sequence, and watch until all is over."""
    plan = plan_of(sequence, folder)
    stalls = [fault.size["seconds"] for fault in sequence.faults if fault.kind == "stall"]
    setting = Setting(
        stall_s=next(iter(stalls), 3.0),
        guards=sequence.guards,
        vehicle=sequence.vehicle,
        on_a_line=True,
        mission=folder / "random.yaml",
    )
    logs = folder / "logs"
    logs.mkdir()
    scene = Scene(PROFILES[sequence.autopilot], logs, setting)
    stage = LiveStage(scene)
    scene.px.autopilot.parameters.update(sequence.parameters)
    evidence = Evidence(scene.profile.offboard, taken=stage.taken, guards=plan.settings.guards)
    evidence.max_throttle = plan.settings.controller.max_throttle
    delays_s = sum(fault.size["delay_s"] for fault in sequence.faults if fault.kind == "delay")
    jitters_s = sum(fault.size["jitter_s"] for fault in sequence.faults if "jitter_s" in fault.size)
    evidence.slack_s = MACHINE_S + delays_s + jitters_s
    try:
        _watch(sequence, stage, evidence)
    finally:
        scene.close()
    evidence.disk_full = stage.disk_full
    _read_log(evidence, stage, logs)
    return evidence


def _watch(sequence: Drawn, stage: LiveStage, evidence: Evidence) -> None:
    mock, process, autopilot = stage.mock, stage.scene.process, stage.mock.autopilot
    _listen(mock, evidence)
    with stage.scene.line, mock:
        mock.wait_until(lambda: bool(mock.heartbeats_heard) or process.poll() is not None, START_S)
        _plan(sequence, stage, early=True)
        end_s = time.monotonic() + HORIZON_S

        def over() -> bool:
            stage.act()
            if evidence.lifted_s is None and -autopilot.body.position[2] > LIFTED_M:
                evidence.lifted_s = time.monotonic()
                _plan(sequence, stage, early=False)
            stands = not autopilot.armed and autopilot.landed
            return process.poll() is not None and stands

        mock.wait_until(over, max(end_s - time.monotonic(), 0.0))
        evidence.at_rest = not autopilot.armed and autopilot.landed
        evidence.last_mode, evidence.armed_at_end = autopilot.mode, autopilot.armed
        with suppress(Exception):
            process.wait(0.1)
        code = process.poll()
        complaints = (stage.scene.where / "stderr.txt").read_text()
        hung = "Timeout (" in complaints  # the watchdog's word
        evidence.killed = stage.killed or hung
        if code is not None and not evidence.killed:
            evidence.outcome = complaints.strip() or "it has ended"
            if "Traceback" in complaints:
                evidence.failure = f"the process ended by an error: {complaints.strip().splitlines()[-1]}"
    wrong = [p for s in mock.setpoints_received if (p := unfit(s.target, evidence.guards, evidence.max_throttle))]
    if wrong:
        evidence.failure = f"{len(wrong)} setpoints unfit: {wrong[0]}"


def _plan(sequence: Drawn, stage: LiveStage, early: bool) -> None:
    for fault in sequence.faults:
        if fault.early == early:
            stage.later(fault.at_s, partial(KINDS[fault.kind].act, stage, fault.size, fault.lasts_s))


def _listen(mock: Any, evidence: Evidence) -> None:
    """Note the commands that arrive."""
    heard = mock._command
    names = {number: name for name, number in mock.manners.custom_modes.items()}

    def command(message: Any) -> None:
        if message.command in COMMANDS:
            shift = mock.manners.sub_mode_shift
            mode = names.get(int(message.param2) << shift | int(message.param3) << shift + 8, "an unknown mode")
            evidence.asked.append(Asked(time.monotonic(), COMMANDS[message.command] or mode))
        heard(message)

    mock._on_message["COMMAND_LONG"] = command


def _read_log(evidence: Evidence, stage: LiveStage, logs: Path) -> None:
    """Read events and commanded rows, put on the autopilot's clock by the first setpoint."""
    found: Sequence[Path] = sorted(logs.glob("*.csv"))
    evidence.has_begun = bool(found)
    if not found:
        evidence.ended = evidence.outcome or ""
        return
    try:
        meta = yaml.safe_load(found[0].with_suffix(".meta.yaml").read_text())
    except (OSError, yaml.YAMLError) as error:
        evidence.failure = evidence.failure or f"the sidecar cannot be read ({error!r})"
        return
    evidence.ended = meta["ended"]
    if evidence.outcome is not None:
        evidence.outcome = meta["ended"]
    with found[0].open() as file:
        commanded = [(float(row["time_s"]), float(row["throttle_cmd"])) for row in csv.DictReader(file) if _whole(row)]
    rows = [(at_s, throttle) for at_s, throttle in commanded if math.isfinite(throttle)]
    received = stage.mock.setpoints_received
    began_s = received[0].received_s - rows[0][0] if received and rows else math.inf
    evidence.sent = [Sent(began_s + at_s, AttitudeTarget(LEVEL, throttle)) for at_s, throttle in rows]
    evidence.noted = [Noted(began_s + e["time_s"], e["what"], e["answer"]) for e in meta["events"] if e["answer"]]
    evidence.mission_flown = True  # what it calls completed is judged in simulated time


def _whole(row: dict[str, Any]) -> bool:
    """True for a row that was not cut by a full disk or the end of the process."""
    try:
        return math.isfinite(float(row["time_s"])) and bool(float(row["throttle_cmd"]) or True)
    except (TypeError, ValueError):
        return False
