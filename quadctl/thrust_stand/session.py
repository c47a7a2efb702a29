"""A measurement from the link to the points: connect, run the bench, write each point down, let go."""

import asyncio
from collections.abc import Callable

from rich.console import Console

from quadctl.errors import FlightError
from quadctl.thrust_stand.bench import Bench, Schedule, cancelled_by_signals
from quadctl.thrust_stand.measurement import Point, PointWriter, check_plausible
from quadctl.thrust_stand.motor import StandMotor
from quadctl.thrust_stand.scale import Scale
from quadctl.vehicle import Vehicle

HEADER = "throttle     rpm  thrust N  voltage V  current A"


def measure(
    vehicle: Vehicle, motor: StandMotor, scale: Scale, schedule: Schedule, raw: PointWriter, console: Console
) -> list[Point]:
    """Measure one rotor of the vehicle; each point is printed, and written to `raw`, as it comes.

    Raises
    ------
    LinkError
        The autopilot or the scale is not there, or has gone silent.
    FlightError
        The autopilot refuses, something is too much, or Ctrl-C came; the motor is stopped.
    LogError
        What comes cannot be measurements of this vehicle.
    """
    points: list[Point] = []

    def measured(point: Point) -> None:
        points.append(point)
        raw.write(point)
        console.print(_row(point), markup=False, highlight=False)
        check_plausible(points, vehicle, "the measurement")

    try:
        asyncio.run(_run(motor, Bench(motor, scale, schedule), measured, console))
    except (KeyboardInterrupt, asyncio.CancelledError):
        raise FlightError(f"interrupted after {len(points)} steps: the motor is stopped.") from None
    return points


async def _run(motor: StandMotor, bench: Bench, measured: Callable[[Point], None], console: Console) -> None:
    with cancelled_by_signals():
        try:
            with console.status("waiting for the autopilot"):
                await motor.prepare()
            for warning in motor.warnings:
                console.print(f"warning: {warning}", style="yellow", soft_wrap=True, markup=False, highlight=False)
            console.print(HEADER, markup=False, highlight=False)
            await bench.run(measured)
        finally:
            await motor.close()


def _row(point: Point) -> str:
    return f"{point.throttle:8.3f}{point.rpm:8.0f}{point.thrust_n:10.3f}{point.voltage_v:11.2f}{point.current_a:11.2f}"
