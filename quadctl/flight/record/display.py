"""The display of a flight in the terminal: phase, progress, height, tracking error, lateness. Drawn on its own thread,
because a terminal can block (a slow ssh link, Ctrl-S) and the loop must not."""

import math
import queue
import threading
from collections.abc import Sequence
from types import TracebackType

from rich.console import Console
from rich.live import Live
from rich.markup import escape
from rich.progress_bar import ProgressBar
from rich.table import Table

from quadctl.flight.pilot.pilot import Pilot
from quadctl.flight.pilot.tick import Tick
from quadctl.state import StatusText

REFRESH_S = 0.25


class Display:
    """A listener of the loop that keeps the last tick, and a thread that draws it."""

    def __init__(self, pilot: Pilot, console: Console, real_time: Sequence[str] = ()) -> None:
        self._pilot = pilot
        self._real_time = ", ".join(real_time)
        self._console = console
        self._tick: Tick | None = None
        self._texts: queue.SimpleQueue[StatusText] = queue.SimpleQueue()
        self._said: set[str] = set()
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._draw, name="display", daemon=True)

    def __call__(self, tick: Tick) -> None:
        self._tick = tick
        for text in tick.texts:
            self._texts.put(text)

    def __enter__(self) -> "Display":
        self._thread.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, tb: TracebackType | None) -> None:
        self._stop.set()
        self._thread.join(timeout=2.0)

    def _draw(self) -> None:
        with Live(console=self._console, auto_refresh=False, transient=True) as live:
            while not self._stop.wait(REFRESH_S):
                self._say()
                if self._tick is not None:
                    live.update(picture(self._tick, self._pilot, self._real_time), refresh=True)
            self._say()

    def _say(self) -> None:
        """Print the texts of the autopilot, each once, which stay above the table."""
        while not self._texts.empty():
            text = self._texts.get()
            if str(text) in self._said:
                continue
            self._said.add(str(text))
            style = "yellow" if text.grave else "default"
            self._console.print(str(text), style=style, soft_wrap=True, markup=False, highlight=False)


def picture(tick: Tick, pilot: Pilot, real_time: str = "") -> Table:
    """The state of the flight as a table of two columns."""
    table = Table.grid(padding=(0, 2))
    table.add_column(style="bold")
    table.add_column()
    state = tick.state
    height = tick.ground_down_m - state.position_ned_m[2]
    total = pilot.mission.duration_s
    table.add_row("mission", f"{escape(pilot.mission.name)}: {tick.stage.value}, phase [cyan]{tick.phase}[/]")
    table.add_row("progress", ProgressBar(total=total, completed=min(pilot.flight_s, total), width=40))
    table.add_row("", f"{pilot.flight_s:.0f} of {total:.0f} s")
    if tick.setpoint is not None:
        pairs = zip(tick.setpoint.position_ned_m, state.position_ned_m, strict=True)
        error = math.hypot(*(at - wanted for wanted, at in pairs if not math.isnan(wanted)))  # nan: not held
        wanted = tick.ground_down_m - tick.setpoint.position_ned_m[2]
        table.add_row("height", f"{height:6.3f} m, wanted {wanted:6.3f} m, error in position {100 * error:.1f} cm")
    else:
        table.add_row("height", f"{height:6.3f} m")
    rpm = " ".join(f"{r:.0f}" for r in state.rotor_rpm if math.isfinite(r)) or "none reported"
    table.add_row("rotors", f"{rpm} rpm, battery {state.battery_v:.2f} V")
    known = f"{escape(state.mode) or 'no mode'}, {'armed' if state.armed else 'disarmed'}"
    gone = f"[bold red]gone[/]: no message for {state.silence_s:.0f} s"
    table.add_row("autopilot", gone if pilot.autopilot_gone else known)
    table.add_row("ticks", f"late {1e3 * tick.late_s:.2f} ms, state {1e3 * state.control_age_s:.0f} ms old")
    if real_time:
        table.add_row("", f"kept by {real_time}")
    return table
