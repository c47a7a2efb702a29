"""The command that says a model in the words of an autopilot."""

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.table import Table

from quadctl.cli.app import app, console
from quadctl.cli.inputs import find
from quadctl.cli.output import JsonOption, print_saved, say, tell, write_json
from quadctl.cli.overwriting import Reads, Writes, WritesInto
from quadctl.errors import FlightError, QuadctlError
from quadctl.files import write_text

if TYPE_CHECKING:
    from collections.abc import Callable

    from quadctl.export.autopilot import Dialect, Present, Row
    from quadctl.model import Model
    from quadctl.words import Fact

CONFIRMATION = "apply"


@app.command()
def export(
    model: Annotated[
        Path,
        Reads(),
        typer.Argument(
            metavar="MODEL.yaml",
            help="Fitted model (of add, discover), or sensor errors (of diagnose --sensors -o).",
            callback=find,
        ),
    ],
    to: Annotated[
        str,
        typer.Option(
            "--to",
            metavar="px4|ardupilot|casadi|numpy|rotorpy|crazyflow|gazebo|sih|sitl",
            help="Autopilot, equations of motion, or simulator (sih: PX4's, sitl: ArduPilot's).",
        ),
    ],
    output: Annotated[
        Path | None, Writes(), typer.Option("-o", "--output", metavar="FILE", help="File to write.")
    ] = None,
    now: Annotated[
        Path | None,
        Reads(),
        typer.Option(
            "--now", metavar="FILE", help="The vehicle's present parameters (.params, .parm), or a flight log."
        ),
    ] = None,
    link: Annotated[
        str | None, typer.Option("--link", metavar="URL", help="Ask the vehicle for its present parameters.")
    ] = None,
    apply: Annotated[
        bool, typer.Option("--apply", help="Write the exported parameters to --link, after a question.")
    ] = False,
    undo: Annotated[bool, typer.Option("--undo", help="Restore what --apply has changed.")] = False,
    yes: Annotated[bool, typer.Option("--yes", help="Do not ask before --apply.")] = False,
    kept: Annotated[
        Path, WritesInto(), typer.Option("--kept", metavar="DIR", help="Folder in which --apply keeps the old values.")
    ] = Path("exported"),
    json_out: JsonOption = None,
) -> None:
    """Export a fitted model to an autopilot or a simulator.

    The model becomes parameters with 95 % intervals, equations of motion, or a vehicle of a simulator. The export lists
    parameters that the flights do not determine and effects that the target cannot represent.
    """
    from quadctl.export.autopilot import check_same_vehicle, left_out, parameter_file, parameters
    from quadctl.export.sensors import sensor_rows
    from quadctl.export.targets import AUTOPILOTS, PROGRAMS
    from quadctl.model import load_model
    from quadctl.sensor_model import is_sensor_file, load_sensors

    if to not in AUTOPILOTS and to not in PROGRAMS:
        raise typer.BadParameter(f"--to is {to}, expected one of {', '.join([*AUTOPILOTS, *PROGRAMS])}")
    if to in PROGRAMS and (output is None or now or link or apply or undo or json_out):
        raise typer.BadParameter(f"--to {to} needs -o FILE, and has no other option")
    if (apply or undo) and link is None:
        raise typer.BadParameter("--apply and --undo need --link")
    if now is not None and link is not None:
        raise typer.BadParameter("give --now or --link, not both")
    if to in PROGRAMS:
        assert output is not None
        _write_program(PROGRAMS[to], model, output)
        return
    dialect = AUTOPILOTS[to]
    if undo:
        from quadctl.export.apply import undo as undo_at

        undo_at(str(link), dialect, kept, say)
        return
    of_sensors = is_sensor_file(model)
    present = _present(now, link, dialect, of_sensors)
    lacking: tuple[Fact, ...] = ()
    if of_sensors:
        rows = sensor_rows(load_sensors(model), dialect, present)
    else:
        loaded = load_model(model)
        if present is not None:
            check_same_vehicle(present, dialect, loaded)
        rows, lacking = parameters(loaded, dialect, present), left_out(loaded, dialect)
    text = parameter_file(rows, dialect, str(model))
    _print(rows)
    tell(*(f"Left out: {reason}." for reason in lacking))
    result = {"model": str(model), "autopilot": dialect.name, "parameters": [_as_dict(row) for row in rows]}
    write_json(json_out, {**result, "left_out": [str(reason) for reason in lacking]})
    if output is not None:
        write_text(output, text)
        print_saved(output)
    if apply:
        from quadctl.export.apply import write_parameters

        _confirm(yes)
        write_parameters(str(link), dialect, rows, kept, say)


def _present(now: Path | None, link: str | None, dialect: "Dialect", of_sensors: bool) -> "Present | None":
    """Parameters that are on the vehicle, by a file or by itself; None where neither is given."""
    from quadctl.export.autopilot import WHOLE, Present, check_same_autopilot
    from quadctl.export.sensors import needed
    from quadctl.logs.parameters import read_present_parameters

    if now is not None:
        values = read_present_parameters(now)
        present = Present(values, str(now), is_whole=len(values) >= WHOLE)
        if not of_sensors:
            check_same_autopilot(present, dialect)
        return present
    if link is None:
        return None
    from quadctl.export.apply import present_parameters

    return present_parameters(link, dialect, needed(dialect) if of_sensors else None)


def _write_program(write: "Callable[[Model, Path], tuple[Fact, ...]]", file: Path, output: Path) -> None:
    from quadctl.model import load_model
    from quadctl.sensor_model import is_sensor_file

    if is_sensor_file(file):
        raise QuadctlError(f"{file}: holds errors of sensors, expected a model of the motion: --to px4 or ardupilot")
    model = load_model(file)
    try:
        output.parent.mkdir(parents=True, exist_ok=True)
        left_out = write(model, output)
    except OSError as error:
        raise QuadctlError(f"{output}: cannot be written ({error.strerror})") from None
    tell(*(f"Left out: {reason}." for reason in left_out))
    print_saved(output)


def _confirm(yes: bool) -> None:
    if yes:
        return
    if not sys.stdin.isatty():
        raise FlightError("nobody is there to confirm the new parameters: say --yes")
    console.print(f"Type '{CONFIRMATION}' to write these parameters to the vehicle: ", end="", highlight=False)
    if input().strip() != CONFIRMATION:
        raise FlightError("not confirmed: nothing was written")


def _print(rows: "list[Row]") -> None:
    from quadctl.export.autopilot import said

    table = Table(box=None, pad_edge=False)
    for heading in ("parameter", "value", "95 % interval", "now"):
        table.add_column(heading, justify="left" if heading == "parameter" else "right", no_wrap=True)
    for row in rows:
        if row.estimate is not None:
            found = row.estimate
            interval = "" if found.low == found.high else f"{found.low:.4g} to {found.high:.4g}"
            present = "" if row.present is None else f"{row.present:.4g}{' confirmed' if row.is_confirmed else ''}"
            table.add_row(row.name, f"{found.value:.4g}", interval, present)
    console.print(table)
    for row in (row for row in rows if row.estimate is not None):
        tell(f"{row.name}: {said(row, with_interval=False)}")
    for row in (row for row in rows if row.estimate is None):
        tell(f"Not exported: {row.name}: {said(row, with_interval=False)}")


def _as_dict(row: "Row") -> dict[str, object]:
    found = row.estimate
    return {
        "name": row.name,
        "value": None if found is None else found.value,
        "ci95": None if found is None else [found.low, found.high],
        "now": row.present,
        "confirmed": row.is_confirmed,
        "formula": row.formula,
        "logs": list(row.logs),
        "lacking": row.lacking,
        "note": row.note,
    }
