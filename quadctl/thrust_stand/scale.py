"""Sources of the thrust: a scale on a serial line, or a person who reads one."""

import asyncio
import math
import os
import re
import statistics
import threading
import time
from collections import deque
from collections.abc import Callable
from types import TracebackType
from typing import Protocol, Self

import serial

from quadctl.errors import FlightError, LinkError
from quadctl.thrust_stand.table import NEWTONS_PER

READING = re.compile(r"(?<![\w.,])([-+]?)\s*(\d+(?:[.,]\d+)?(?:[eE][-+]?\d+)?)\s*([A-Za-z]*)(?![\w.,])")
SILENCE_S = 2.0
"""Without a reading in so long, the scale is not there."""
SHOWN = 40
"""Characters of a line that holds no reading, in the sentence about it."""


class Scale(Protocol):
    """Gives the thrust in newtons."""

    async def tare(self, seconds: float) -> None:
        """Take what it reads with the motor at rest as zero."""

    async def thrust_n(self, seconds: float) -> float:
        """The mean over the coming time; raises LinkError when it gives none."""


class SerialScale:
    """Reads lines such as `123.4 g` or `ST,GS,+0123.4g` from a serial port, on a thread; a context manager."""

    def __init__(self, url: str, unit: str | None, reads_less: bool = False) -> None:
        """`url`: serial:///dev/ttyUSB0:9600. `unit`: of lines that name none, and checked against those that do.
        `reads_less`: the motor lifts the vehicle off the scale.

        Raises LinkError when the port cannot be opened.
        """
        match = re.fullmatch(r"(?:serial://)?([^:]+)(?::(\d+))?", url)
        if match is None:
            raise LinkError(f"The scale {url!r} is not one that can be opened: expected serial:///dev/ttyUSB0:9600.")
        self.name = match[1]
        self._unit = unit
        self._sign = -1.0 if reads_less else 1.0
        self._zero_n = 0.0
        self._readings: deque[tuple[float, float]] = deque(maxlen=100_000)
        self._strange: deque[tuple[float, str]] = deque(maxlen=1000)
        self._contradiction = ""
        self._stopping = threading.Event()
        try:
            self._port = serial.Serial(match[1], int(match[2] or 9600), timeout=0.1)
        except (OSError, ValueError) as error:
            number = getattr(error, "errno", None)
            reason = os.strerror(number) if number else str(error)
            raise LinkError(f"The scale at {self.name} cannot be opened ({reason}): check its name.") from None
        self._thread = threading.Thread(target=self._listen, name="scale", daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, tb: TracebackType | None) -> None:
        self._stopping.set()
        self._thread.join()
        self._port.close()

    async def tare(self, seconds: float) -> None:
        self._zero_n = await self._mean(seconds)

    async def thrust_n(self, seconds: float) -> float:
        return self._sign * (await self._mean(seconds) - self._zero_n)

    async def _mean(self, seconds: float) -> float:
        """Mean of the readings that arrive from now on; waits a little longer where they are rare."""
        begin_s = time.monotonic()
        await asyncio.sleep(seconds)
        while True:
            found = [value for at, value in list(self._readings) if at >= begin_s]
            strange = [line for at, line in list(self._strange) if at >= begin_s]
            if self._contradiction:
                raise LinkError(self._contradiction)
            if len(strange) > len(found):
                raise LinkError(
                    f"The scale at {self.name} sends {strange[-1]!r}, expected lines such as '123.4 g': "
                    "check its baud rate and its output format."
                )
            if found:
                return statistics.fmean(found)
            if time.monotonic() - begin_s > SILENCE_S:
                raise LinkError(
                    f"The scale at {self.name} sends nothing: check its cable, and that it sends by itself."
                )
            await asyncio.sleep(0.02)

    def _listen(self) -> None:
        rest = b""
        while not self._stopping.is_set():
            try:
                rest += self._port.read(max(self._port.in_waiting, 1))
            except OSError:  # unplugged: its silence tells
                return
            *lines, rest = re.split(rb"[\r\n]+", rest[-4096:])
            for line in lines:
                if line.strip():
                    self._take(line.decode("ascii", errors="replace").strip())

    def _take(self, line: str) -> None:
        reading = parse_reading(line)
        if reading is None:
            self._strange.append((time.monotonic(), line[:SHOWN]))
            return
        value, unit = reading
        if not unit and self._unit is None:
            self._contradiction = (
                f"The scale at {self.name} sends '{line[:SHOWN]}' without a unit: say --unit g, kg or n."
            )
        elif unit and self._unit is not None and unit != self._unit:
            self._contradiction = f"The scale at {self.name} sends '{line[:SHOWN]}', but --unit says {self._unit}."
        else:
            self._readings.append((time.monotonic(), value * NEWTONS_PER[unit or self._unit or "n"]))


class TypedScale:
    """Asks a person for each reading."""

    def __init__(self, unit: str, ask: Callable[[str], str] = input) -> None:
        self._unit = unit
        self._ask = ask

    async def tare(self, seconds: float) -> None:
        """The person sets the scale to zero."""
        del seconds
        await self._answer("set the scale to zero, then press Enter ")

    async def thrust_n(self, seconds: float) -> float:
        del seconds
        while True:
            reading = parse_reading(await self._answer(f"thrust in {self._unit}: "))
            if reading is not None and reading[1] in ("", self._unit):
                return reading[0] * NEWTONS_PER[self._unit]

    async def _answer(self, question: str) -> str:
        """On a thread that nobody waits for: Ctrl-C must not wait for Enter."""
        loop = asyncio.get_running_loop()
        answer: asyncio.Future[str] = loop.create_future()

        def settle(text: str | None) -> None:
            if answer.done():
                return
            if text is None:
                answer.set_exception(FlightError("the thrust is to be typed in, but nobody is there to type"))
            else:
                answer.set_result(text)

        def ask() -> None:
            try:
                text: str | None = self._ask(question)
            except EOFError:
                text = None
            loop.call_soon_threadsafe(settle, text)

        threading.Thread(target=ask, name="typed", daemon=True).start()
        return await answer


def parse_reading(line: str) -> tuple[float, str] | None:
    """The last number of a line and its unit (g, kg, n, or none at all); None where there is neither, or noise."""
    if not (line.isascii() and line.isprintable()):
        return None
    for sign, digits, unit in reversed(READING.findall(line)):
        value = float(f"{sign}{digits.replace(',', '.')}")
        if math.isfinite(value) and unit.lower() in ("", *NEWTONS_PER):
            return value, unit.lower()
    return None
