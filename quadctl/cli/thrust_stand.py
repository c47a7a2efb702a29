"""The command that measures a rotor on a stand."""

import math
import sys
import time
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from quadctl.cli.app import app, console
from quadctl.cli.inputs import find
from quadctl.cli.output import CurvesOption, ForceOption, JsonOption, print_saved, say, write_json
from quadctl.cli.overwriting import Reads, Writes, refuse_existing
from quadctl.errors import FlightError
from quadctl.files import write_text
from quadctl.vehicle import Vehicle, load_vehicle

if TYPE_CHECKING:
    from quadctl.thrust_stand.bench import Schedule
    from quadctl.thrust_stand.measurement import Point

CONFIRMATION = "the vehicle is fixed"
TYPED = "typed"


@app.command("thrust-stand")
def thrust_stand(
    vehicle: Annotated[
        Path,
        Reads(),
        typer.Argument(metavar="VEHICLE.yaml", help="Vehicle file of the rotor's vehicle.", callback=find),
    ],
    link: Annotated[
        str | None,
        typer.Option("--link", metavar="URL", help="Measure over this link: auto, udpin://..., serial:///dev/...:BAUD"),
    ] = None,
    measured: Annotated[
        Path | None, Reads(), typer.Option("--from", metavar="FILE.csv", help="Fit an earlier measurement instead.")
    ] = None,
    output: Annotated[
        Path | None,
        Writes(),
        typer.Option("-o", "--output", metavar="NEW.yaml", help="New vehicle file with the values found."),
    ] = None,
    raw: Annotated[
        Path | None,
        Writes(a_log=True),
        typer.Option("--raw", metavar="FILE.csv", help="File for the measured points [default: named after the time]."),
    ] = None,
    scale: Annotated[
        str,
        typer.Option("--scale", metavar="PORT", help="serial:///dev/ttyUSB0:9600, or typed: you type each reading."),
    ] = TYPED,
    unit: Annotated[
        str | None,
        typer.Option("--unit", metavar="g|kg|n", help="Unit of typed readings, or of a scale that sends no unit."),
    ] = None,
    reads_less: Annotated[
        bool, typer.Option("--reads-less", help="The motor lifts the vehicle: the scale reads less with more thrust.")
    ] = False,
    motor: Annotated[
        int, typer.Option("--motor", metavar="N", min=1, help="Number of the motor in the vehicle file.")
    ] = 1,
    steps: Annotated[int, typer.Option("--steps", min=3, max=50, help="Throttle steps.")] = 12,
    lowest: Annotated[int, typer.Option("--lowest", metavar="PERCENT", min=1, max=100, help="First step.")] = 15,
    highest: Annotated[int, typer.Option("--highest", metavar="PERCENT", min=1, max=100, help="Last step.")] = 85,
    settle: Annotated[
        float, typer.Option("--settle", metavar="S", min=0.1, max=20.0, help="Time to settle before each reading.")
    ] = 1.5,
    average: Annotated[
        float,
        typer.Option("--average", metavar="S", min=0.1, max=20.0, help="Time over which each reading is averaged."),
    ] = 2.0,
    max_current: Annotated[
        float | None, typer.Option("--max-current", metavar="A", min=0.0, help="Stop above this current.")
    ] = None,
    safe: Annotated[
        bool, typer.Option("--yes-props-are-safe", help="The vehicle is fixed and nobody is near: do not ask.")
    ] = False,
    plot: CurvesOption = None,
    json_out: JsonOption = None,
    force: ForceOption = False,
) -> None:
    """Measure a rotor's thrust on a stand.

    Thrust over rpm and throttle, measured or from a CSV, goes into a vehicle file.
    """
    from quadctl.settings_text import with_numbers
    from quadctl.thrust_stand.measurement import read_points

    if (link is None) == (measured is None):
        raise typer.BadParameter("give --link to measure, or --from to fit an earlier measurement")
    refuse_existing(force, output, plot)
    loaded = load_vehicle(vehicle)
    # The companion computer measures; the fit belongs to the desk. A missing package is told before anything turns.
    fits = find_spec("scipy") is not None
    if fits or measured is not None or output is not None or plot is not None or json_out is not None:
        from quadctl.thrust_stand.result import evaluate
    if plot is not None:
        from quadctl.thrust_stand.plot import draw

    if measured is not None:
        points, source = read_points(measured), str(measured)
    else:
        if unit not in (None, "g", "kg", "n"):
            raise typer.BadParameter(f"--unit is {unit}, expected g, kg or n")
        if lowest >= highest:
            raise typer.BadParameter(f"--lowest {lowest} is not below --highest {highest}")
        if motor > loaded.n_rotors:
            raise typer.BadParameter(f"--motor is {motor}, but {loaded.name} has {loaded.n_rotors} rotors")
        _confirm(safe, motor, loaded)
        percents = sorted({round(lowest + i * (highest - lowest) / (steps - 1)) for i in range(steps)})
        schedule = _schedule(percents, settle, average, max_current)
        raw = raw or Path(f"thrust-stand-{time.strftime('%Y%m%d-%H%M%S')}-motor{motor}.csv")
        points, source = _measure(loaded, str(link), motor, scale, unit, reads_less, schedule, raw), str(raw)
    if not fits:
        say(f"Fit it where the lab is installed: quadctl thrust-stand {vehicle} --from {source}")
        return
    result = evaluate(points, loaded, source)
    say(*result.findings())
    write_json(json_out, result.to_dict())
    if plot is not None:
        draw(result, plot)
        print_saved(plot)
    if output is not None:
        write_text(output, with_numbers(vehicle, result.vehicle_values(), Vehicle, "vehicle file"))
        print_saved(output)


def _confirm(safe: bool, motor: int, vehicle: Vehicle) -> None:
    """Ask for confirmation that the vehicle is fixed; nothing turns before."""
    if safe:
        return
    say(
        f"Motor {motor} of {vehicle.name} will run with its propeller on. Fix the vehicle, keep everybody out of the "
        "propeller's plane and reach, and have the battery's plug at hand. Ctrl-C stops the motor."
    )
    if not sys.stdin.isatty():
        raise FlightError("nobody is there to confirm that the vehicle is fixed: say --yes-props-are-safe")
    console.print(f"Type '{CONFIRMATION}' to go on: ", end="", highlight=False)
    if input().strip() != CONFIRMATION:
        raise FlightError("not confirmed: nothing was run")


def _schedule(percents: list[int], settle: float, average: float, max_current: float | None) -> "Schedule":
    from quadctl.thrust_stand.bench import Schedule

    return Schedule(percents, settle, average, math.inf if max_current is None else max_current)


def _measure(
    vehicle: Vehicle,
    link: str,
    number: int,
    scale: str,
    unit: str | None,
    reads_less: bool,
    schedule: "Schedule",
    raw: Path,
) -> "list[Point]":
    from contextlib import ExitStack, closing

    from quadctl.flight.autopilot.ports import resolve
    from quadctl.thrust_stand.measurement import PointWriter
    from quadctl.thrust_stand.motor import StandMotor
    from quadctl.thrust_stand.scale import Scale, SerialScale, TypedScale
    from quadctl.thrust_stand.session import measure

    motor = StandMotor(resolve(link, console), vehicle, number)
    with ExitStack() as stack:
        reader: Scale
        if scale == TYPED:
            reader = TypedScale(unit or "g")
        else:
            reader = stack.enter_context(SerialScale(scale, unit, reads_less))
        points = stack.enter_context(closing(PointWriter(raw)))
        stack.callback(print_saved, raw)  # what was measured until a failure too
        return measure(vehicle, motor, reader, schedule, points, console)
