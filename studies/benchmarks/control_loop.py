"""The real-time loop over MAVLink: how late its ticks are on an idle and on a busy machine, beside the loop that
everybody writes first, what a tick costs, and whether a long flight grows.

make bench-loop; with --seconds and --minutes shorter, for a look. Nothing else should run meanwhile.
"""

import argparse
import asyncio
import contextlib
import json
import os
import platform
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple
from unittest.mock import patch

import numpy as np
import yaml
from rich.console import Console
from rich.table import Table

import quadctl.sitl.run
from quadctl.compensator import Compensator
from quadctl.control import ControllerSettings, Memory, control
from quadctl.effects import CATALOG
from quadctl.flight import session
from quadctl.flight.autopilot.mavsdk_autopilot import MavsdkAutopilot
from quadctl.flight.preflight.plan import FlightPlan
from quadctl.flight.preflight.preparation import prepare_flight
from quadctl.logs.read import read_log
from quadctl.model import load_model
from quadctl.state import AttitudeTarget, Setpoint, VehicleState
from quadctl.vehicle import load_vehicle
from quadctl.web.live.history import Brief
from quadctl.web.live.viewer import Viewer, live_view
from studies.page import ROOT, write_page
from studies.serial_line import SerialLine

CONFIG = ROOT / "config/flight.yaml"
RAPTOR = ROOT / "config/vehicles/raptor.yaml"
CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
VIEW_PORT = 8092
IN_THE_AIR_M = 0.5
MOST_TICKS = 100_000
"""Largest number of ticks of a flight: more than half an hour."""
SHARES = (50.0, 99.0, 99.9, 100.0)
ABOUT = """# The control loop

Written by `make bench-loop` on one machine: {machine}.
*Idle* and *all cores busy* are flights of {seconds:g} s over MAVLink with `sanchez` at 50 ticks per second, on an idle
machine and beside one computing process on each core. A *control tick* is one computation of the controller, without
compensator and with the slowest effect. *Lateness* is that of the start of a tick.
"""
HEADINGS = ("what", "p50", "p99", "p99.9", "max", "goal", "")


Floats = np.ndarray[Any, np.dtype[np.float64]]


class Unit(NamedTuple):
    """Unit of the figures of a line."""

    name: str
    per_second: float
    decimals: int


MS, US = Unit("ms", 1e3, 2), Unit("us", 1e6, 1)


class Row(NamedTuple):
    """One line of the table."""

    what: str
    values: tuple[str, ...]
    goal: str = ""
    met: bool | None = None

    def cells(self) -> tuple[str, ...]:
        verdict = "" if self.met is None else "met" if self.met else "MISSED"
        return (self.what, *self.values, *[""] * (len(SHARES) - len(self.values)), self.goal, verdict)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=60.0, help="of each measurement of lateness")
    parser.add_argument("--minutes", type=float, default=10.0, help="of the long flight")
    parser.add_argument("--out", type=Path, help="write the table as a page")
    parser.add_argument("--fly", nargs=3, metavar=("URL", "MISSION", "FOLDER"), help=argparse.SUPPRESS)
    parser.add_argument("--view", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.fly:
        url, mission, folder = options.fly
        _fly(url, mission, folder, options.view)
        return
    table = Table(*HEADINGS, title=_machine())
    rows = []
    for row in _rows(options.seconds, options.minutes):
        rows.append(row)
        table.add_row(*row.cells())
        Console(stderr=True, soft_wrap=True).print("  ".join(row.cells()), markup=False, highlight=False)
    Console(width=160).print(table)
    if options.out:
        write_page(options.out, _page(rows, options.seconds))


def _rows(seconds: float, minutes: float) -> Iterator[Row]:
    yield from _compute()
    for load, burners, goal_ms in (("idle", 0, 1.0), ("all cores busy", os.cpu_count() or 1, 3.0)):
        with _burning(burners):
            plain = asyncio.run(_plain_loop(seconds))
        flight = _flight(seconds, burners)
        viewed = _flight(seconds, burners, view=True)
        yield _percentiles(f"tick lateness, {load}", flight.late_s, MS, "p99", goal_ms)
        yield _percentiles(f"excess of a 20 ms sleep of another process, {load}", flight.machine_s, MS)
        yield _percentiles(f"tick lateness, {load}, {_viewed()}", viewed.late_s, MS, "p99", goal_ms)
        yield _percentiles(f"plain `await asyncio.sleep(0.02)` loop, {load}", plain, MS)
        yield _percentiles(f"compute of a tick in flight, {load}", flight.compute_s, US, "p99", 300.0)
        yield _percentiles(f"tick to setpoint out, {load}", flight.out_s, MS, "p50", 1.0)
        yield _percentiles(f"state message in to setpoint out, {load}", flight.age_s, MS)
    yield from _over_serial(seconds)
    flight = _flight(60.0 * minutes)
    what = f"CPU of the flight process over {minutes:g} min, of one core"
    yield Row(what, (f"{100.0 * flight.cpu:.1f} %",), "< 20 %", flight.cpu < 0.2)
    tenth = max(len(flight.memory_mb) // 10, 1)
    first, last = np.mean(flight.memory_mb[tenth : 2 * tenth]), np.mean(flight.memory_mb[-tenth:])
    what = f"growth of the memory of the flight process from the second tenth ({first:.1f} MB) to the last"
    yield Row(what, (f"{last - first:+.2f} MB",), "< 1 MB", bool(last - first < 1.0))
    yield Row(f"real-time settings of the flights: {flight.used}", ())


def _over_serial(seconds: float) -> Iterator[Row]:
    over_udp, over_serial = _flight(seconds), _flight(seconds, serial=True)
    yield _percentiles("tick lateness, idle, over a serial line", over_serial.late_s, MS, "p99", 1.0)
    shares = f"{100.0 * over_serial.cpu:.1f} % of a core against {100.0 * over_udp.cpu:.1f} %"
    ratio = over_serial.cpu / over_udp.cpu
    yield Row("CPU of a flight over a serial line, beside UDP", (f"{ratio:.2f} x", shares), "< 1.5 x", ratio < 1.5)


# --- flights ---------------------------------------------------------------------------------------------------------


class Flight(NamedTuple):
    """Measurements of one flight; one value per tick, s."""

    late_s: Floats
    compute_s: Floats
    out_s: Floats
    age_s: Floats
    machine_s: Floats
    memory_mb: Sequence[float]
    cpu: float
    used: str


def _viewed() -> str:
    return "with --view and a browser on this machine" if CHROMIUM else "with --view"


def _flight(seconds: float, burners: int = 0, view: bool = False, serial: bool = False) -> Flight:
    """A hover of so many seconds, in a process of its own; with a live `view`, and a browser that shows it; over a
    `serial` line in the place of UDP.

    The burning processes begin in the air: nobody takes off on a machine that is as busy as that.
    """
    with contextlib.ExitStack() as stack:
        name = stack.enter_context(tempfile.TemporaryDirectory())
        folder = Path(name)
        url = stack.enter_context(quadctl.sitl.run.mock_process(load_vehicle(RAPTOR), None, 1))
        if serial:
            line = stack.enter_context(SerialLine(folder / "tty", int(url.rpartition(":")[2])))
            url = f"serial://{line.device}:921600"
        mission = folder / "hover.yaml"
        phases = [
            {"name": "takeoff", "kind": "move", "to_m": [0, 0, 0.6], "speed_m_s": 0.5},
            {"name": "hover", "kind": "hold", "duration_s": seconds},
        ]
        limits = {"min_z_m": 0.1, "max_z_m": 1.0, "max_distance_m": 1.0, "max_duration_s": seconds + 60.0}
        mission.write_text(yaml.safe_dump({"name": "hover", "phases": phases, "limits": limits}))
        command = [
            sys.executable,
            "-m",
            "studies.benchmarks.control_loop",
            "--fly",
            url,
            str(mission),
            name,
            *(["--view"] if view else []),
        ]
        with subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE) as child:
            assert child.stdout is not None
            child.stdout.readline()  # that it is in the air, or nothing where it ended before
            with _burning(burners):
                machine_s = _asleep(child)
            if child.returncode != 0:
                sys.exit("the flight was not completed")
        found = json.loads((folder / "out.json").read_text())
        log = read_log(found["log"])
        meta = yaml.safe_load(Path(found["log"]).with_suffix(".meta.yaml").read_text())
        hover = log["tick_late_s"][log.phase == "hover"]
    compute_s, out_s, age_s = (np.array(found[name]) for name in ("compute_s", "out_s", "age_s"))
    privileges = ", ".join(meta["real_time"])
    return Flight(hover, compute_s, out_s, age_s, machine_s, found["memory_mb"], found["cpu"], privileges)


def _asleep(child: "subprocess.Popen[bytes]") -> Floats:
    """Measure by how much sleeps of 20 ms are too long until `child` ends, s: the lateness of the machine itself."""
    late = []
    with contextlib.suppress(PermissionError):  # before the flight, so that it never waits for that
        os.sched_setscheduler(0, os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, os.sched_param(30))
    while child.poll() is None:
        before_s = time.monotonic()
        time.sleep(0.02)
        late.append(time.monotonic() - before_s - 0.02)
    with contextlib.suppress(PermissionError):
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
    return np.array(late)


@contextlib.contextmanager
def _burning(processes: int) -> Iterator[None]:
    burners = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(processes)]
    try:
        yield
    finally:
        for burner in burners:
            burner.kill()
            burner.wait()


class Times:
    """One value per tick, where memory for all of them is taken before the flight: a list would grow with it."""

    def __init__(self) -> None:
        self._values = np.full(MOST_TICKS, np.nan)
        self._count = 0

    def append(self, value: float) -> None:
        self._values[self._count] = value
        self._count += 1

    def clear(self) -> None:
        self._count = 0

    def __len__(self) -> int:
        return self._count

    def to_list(self) -> list[float]:
        return [float(value) for value in self._values[: self._count]]


class Timed(MavsdkAutopilot):
    """The adapter with a stop watch."""

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self.compute_s, self.out_s, self.age_s, self.memory_mb = Times(), Times(), Times(), Times()
        self._asked_s = self._given_s = self._arrived_s = 0.0
        self._in_the_air, self._height_m = False, 0.0
        TIMED.append(self)

    def state(self) -> VehicleState:
        self._asked_s = time.monotonic()
        state = super().state()
        self._arrived_s = max(state.received_s[part] for part in ("position", "attitude"))
        self._height_m = -state.position_ned_m[2]
        self._given_s = time.monotonic()
        return state

    def send(self, target: AttitudeTarget) -> None:
        self.compute_s.append(time.monotonic() - self._given_s)
        super().send(target)
        now_s = time.monotonic()
        self.out_s.append(now_s - self._asked_s)
        self.age_s.append(now_s - self._arrived_s)
        if not self._in_the_air and self._height_m > IN_THE_AIR_M:
            self._in_the_air = True
            print("in the air", flush=True)
            for measured in (self.compute_s, self.out_s, self.age_s):
                measured.clear()
        if len(self.out_s) % 50 == 0:
            pages = int(Path("/proc/self/statm").read_text().split()[1])
            self.memory_mb.append(pages * resource.getpagesize() / 1e6)


TIMED: list[Timed] = []


def _fly(url: str, mission: str, folder: str, view: bool) -> None:
    """Fly in the child process."""
    plan = prepare_flight(Path(mission), _patient(Path(folder)), "sanchez", None)
    began_s, began_cpu_s = time.monotonic(), time.process_time()
    with (
        patch.object(session, "MavsdkAutopilot", Timed),  # the session makes its adapter itself
        _live_view(plan, Path(folder)) if view else contextlib.nullcontext() as viewer,
    ):
        outcome = session.fly_real_time(
            plan, url, Path(folder), Console(quiet=True), view=viewer.end if viewer else None
        )
        if viewer is not None:
            viewer.tell(outcome)
    cpu = (time.process_time() - began_cpu_s) / (time.monotonic() - began_s)
    if not outcome.completed:
        sys.exit(f"the flight was not completed: {outcome.ended}")
    (timed,) = TIMED
    found = {name: getattr(timed, name).to_list() for name in ("compute_s", "out_s", "age_s", "memory_mb")}
    (Path(folder) / "out.json").write_text(json.dumps({"log": outcome.log, "cpu": cpu, **found}))


def _patient(folder: Path) -> Path:
    """The settings of a flight that is not given up when the machine itself stands still: that is to be measured."""
    settings = yaml.safe_load(CONFIG.read_text())
    settings["vehicle"] = str(RAPTOR)
    settings["guards"] |= {"max_state_age_s": 1.0, "max_tick_late_s": 1.0}
    path = folder / "flight.yaml"
    path.write_text(yaml.safe_dump(settings))
    return path


@contextlib.contextmanager
def _live_view(plan: FlightPlan, folder: Path) -> Iterator[Viewer]:
    brief = Brief(plan.mission, plan.settings.guards, plan.body.vehicle, plan.compensator.name)
    with live_view(brief, VIEW_PORT, None, lambda said: None) as viewer:
        words = ["--headless", "--no-sandbox", "--disable-gpu", f"--user-data-dir={folder / 'browser'}"]
        url = f"http://127.0.0.1:{VIEW_PORT}"
        keep = "--remote-debugging-port=0"  # else it leaves when the page is loaded
        browser = CHROMIUM and subprocess.Popen([CHROMIUM, *words, keep, url], stderr=subprocess.DEVNULL)
        try:
            yield viewer
        finally:
            if browser:
                browser.terminate()
                browser.wait()


async def _plain_loop(seconds: float) -> list[float]:
    """Measure by how much each round of the simplest loop (work, then sleep for 20 ms) exceeds 20 ms, s."""
    late = []
    before = time.monotonic()
    for _ in range(int(seconds / 0.02)):
        await asyncio.sleep(0.02)
        now = time.monotonic()
        late.append(now - before - 0.02)
        before = now
    return late


# --- one tick --------------------------------------------------------------------------------------------------------


def _compute() -> Iterator[Row]:
    """A tick without compensator and with the slowest of the catalogue, and the slowest compensator by itself."""
    rigid = load_model(RAPTOR)
    state = VehicleState(
        0.0, (0.0, 0.0, -0.3), (0.1, 0.0, 0.1), (1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (5600.0,) * 4, battery_v=16.0
    )
    setpoint, settings = Setpoint((0.0, 0.0, -0.4)), ControllerSettings()
    ticks: dict[str, Floats] = {}
    alone: dict[str, Floats] = {}
    for name, model in {"none": rigid, **{n: rigid.plus(e()) for n, e in CATALOG.items()}}.items():
        compensator = Compensator(model)
        tick = partial(control, setpoint, state, Memory(), 0.02, 0.0, rigid.vehicle, settings, compensator)
        ticks[name] = _timed(tick)
        alone[name] = _timed(partial(compensator, state, 0.0, 14.7))
    for name in ("none", max(ticks, key=lambda name: float(np.median(ticks[name])))):
        yield _percentiles(f"control tick with {name}", ticks[name], US, "p99", 300.0)
    slowest = max(alone, key=lambda name: float(np.median(alone[name])))
    yield _percentiles(f"slowest compensator alone ({slowest})", alone[slowest], US, "p50", 10.0)


def _timed(call: Callable[[], object], rounds: int = 5000) -> Floats:
    """Seconds of each of so many calls."""
    clock = time.perf_counter
    found = np.empty(rounds)
    for i in range(rounds):
        began = clock()
        call()
        found[i] = clock() - began
    return found


# --- the table -------------------------------------------------------------------------------------------------------


def _percentiles(what: str, values_s: Floats | list[float], unit: Unit, share: str = "", goal: float = 0.0) -> Row:
    found = unit.per_second * np.percentile(values_s, SHARES)
    cells = tuple(f"{value:.{unit.decimals}f} {unit.name}" for value in found)
    if not share:
        return Row(what, cells)
    return Row(what, cells, f"{share} < {goal:g} {unit.name}", bool(found[HEADINGS.index(share) - 1] < goal))


def _machine() -> str:
    return f"{platform.machine()}, {os.cpu_count()} cores, {platform.system()} {platform.release()}, " + (
        f"Python {platform.python_version()}"
    )


NOT_SHOWN = ("excess of a 20 ms sleep", "state message in")
"""Beginnings of the rows that only the terminal shows."""


def _on_page(row: Row) -> tuple[str, ...]:
    """Cells of a row: the unit stands once, and p99.9 is left out."""
    numbers = [value.split()[0] for value in row.values]
    shown = [*numbers[:2], numbers[-1]] if len(numbers) == len(SHARES) else [numbers[0], "", ""]
    goal = row.goal and f"{row.goal}{'' if row.met else ', MISSED'}"
    return f"{row.what}, {row.values[0].split()[1]}", *shown, goal


def _page(rows: Sequence[Row], seconds: float) -> str:
    missed = [row.what for row in rows if row.met is False]
    lines = [
        ABOUT.format(machine=_machine(), seconds=seconds),
        f"Goals missed: {'; '.join(missed) or 'none'}.",
        *(f"\n{row.what[0].upper()}{row.what[1:]}." for row in rows if not row.values),
        "",
        "| what | p50 | p99 | max | goal |",
        "| --- | --- | --- | --- | --- |",
        *(f"| {' | '.join(_on_page(row))} |" for row in rows if row.values and not row.what.startswith(NOT_SHOWN)),
        "",
    ]
    return "\n".join(lines)


if __name__ == "__main__":
    main()
