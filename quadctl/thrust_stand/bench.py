"""The measurement itself: step after step, watched; whatever ends it stops the motor."""

import asyncio
import math
import signal
import statistics
import time
from collections.abc import Awaitable, Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from typing import Never, TypeVar

from quadctl.errors import FlightError, LinkError
from quadctl.state import NAN
from quadctl.thrust_stand.measurement import Point
from quadctl.thrust_stand.motor import ALIVE_S, RENEW_S, StandMotor
from quadctl.thrust_stand.scale import Scale

T = TypeVar("T")

LONGEST_STEP_S = 60.0
"""Whatever the scale, or the person who reads it, does."""
WATCH_S = 0.05
STALL_S = 0.8 * ALIVE_S
RPM_AGE_S = 0.5
"""Older rotor speeds are those of another time."""


@dataclass(frozen=True)
class Schedule:
    """Throttle steps to run, and how long."""

    percents: Sequence[int]
    """Motor outputs, one step each, rising."""
    settle_s: float = 1.5
    """From the change of output until thrust is read."""
    average_s: float = 2.0
    max_current_a: float = math.inf


@dataclass
class _Samples:
    """Telemetry of one step's average."""

    rpm: list[float]
    voltage_v: list[float]
    current_a: list[float]


class Bench:
    """Runs a motor through a schedule."""

    def __init__(self, motor: StandMotor, scale: Scale, schedule: Schedule) -> None:
        self._motor = motor
        self._scale = scale
        self._schedule = schedule
        self._samples = _Samples([], [], [])
        self._commanded_s = math.inf
        """Time of the last command to run the motor."""

    async def run(self, measured: Callable[[Point], None]) -> None:
        """Tare the scale, then measure; `measured` gets each point and may raise to end it.

        The motor is stopped when this returns or raises, for whatever reason; a program that is killed stops it by
        silence.

        Raises
        ------
        FlightError
            The autopilot refuses, the current is too high, a step takes too long.
        LinkError
            The autopilot or the scale has gone silent.
        """
        await self._scale.tare(self._schedule.average_s)
        try:
            for percent in self._motor.on_scale(self._schedule.percents):
                self._refuse_after_stall()
                await self._motor.spin(percent)
                self._commanded_s = time.monotonic()
                measured(await self._watched(self._measure(percent), percent))
        finally:
            with suppress(LinkError):
                self._motor.stop()
                for _ in range(2):  # a message may be lost
                    await asyncio.sleep(0.1)
                    self._motor.stop()

    async def _measure(self, percent: int) -> Point:
        await asyncio.sleep(self._schedule.settle_s)
        self._samples = _Samples([], [], [])
        thrust_n = await self._scale.thrust_n(self._schedule.average_s)
        s = self._samples
        means = (statistics.fmean(values) if values else NAN for values in (s.rpm, s.voltage_v, s.current_a))
        rpm, voltage_v, current_a = means
        if math.isnan(current_a) and math.isfinite(self._schedule.max_current_a):
            raise FlightError(
                f"motor {self._motor.number}: its speed controller reports no current, so --max-current cannot be kept."
            )
        return Point(self._motor.throttle(percent), rpm, thrust_n, voltage_v, current_a)

    async def _watched(self, work: Awaitable[T], percent: int) -> T:
        """The work's result, unless the watch ends first, which it does only by raising."""
        working, watching = asyncio.ensure_future(work), asyncio.create_task(self._watch(percent))
        try:
            await asyncio.wait((working, watching), return_when=asyncio.FIRST_COMPLETED)
            if not working.done():
                await watching
            return working.result()
        finally:
            for task in (working, watching):
                task.cancel()

    async def _watch(self, percent: int) -> Never:
        """Keep the motor running, and look at it, for one step at most."""
        per_renewal = round(RENEW_S / WATCH_S)
        for i in range(round(LONGEST_STEP_S / WATCH_S)):
            if i % per_renewal == 0:
                self._refuse_after_stall()
                self._motor.renew(percent)
                self._commanded_s = time.monotonic()
            self._look()
            await asyncio.sleep(WATCH_S)
        raise FlightError(f"motor {self._motor.number}: the step took longer than {LONGEST_STEP_S:g} s: stopped.")

    def _refuse_after_stall(self) -> None:
        """A motor that has stopped because this program hung does not start again by itself."""
        silent_s = time.monotonic() - self._commanded_s
        if silent_s > STALL_S:
            raise FlightError(
                f"motor {self._motor.number}: this program was held up for {silent_s:.1f} s, in which the motor "
                "stopped by itself: begin again."
            )

    def _look(self) -> None:
        state, i = self._motor.state(), self._motor.number - 1
        if not state.connected:
            raise LinkError(f"motor {i + 1}: the autopilot has gone silent: the motor stops by itself within a second.")
        current_a = state.motor_current_a[i] if i < len(state.motor_current_a) else NAN
        if current_a > self._schedule.max_current_a:
            raise FlightError(
                f"motor {i + 1}: draws {current_a:.1f} A, more than {self._schedule.max_current_a:g} A: stopped."
            )
        fresh = state.age_s("rpm") < RPM_AGE_S and i < len(state.rotor_rpm)
        for values, value in (
            (self._samples.rpm, state.rotor_rpm[i] if fresh else NAN),
            (self._samples.voltage_v, state.battery_v),
            (self._samples.current_a, current_a),
        ):
            if math.isfinite(value):
                values.append(value)


@contextmanager
def cancelled_by_signals() -> Iterator[None]:
    """SIGTERM ends the running task as Ctrl-C does: the motor is stopped first."""
    loop, task = asyncio.get_running_loop(), asyncio.current_task()
    assert task is not None
    loop.add_signal_handler(signal.SIGTERM, task.cancel)
    try:
        yield
    finally:
        loop.remove_signal_handler(signal.SIGTERM)
