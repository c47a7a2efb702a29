"""The command that looks at flight logs, and converts them."""

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from quadctl.cli.app import app, console
from quadctl.cli.inputs import find
from quadctl.cli.lab import LogArguments
from quadctl.cli.output import JsonOption, print_saved, say, write_json
from quadctl.cli.overwriting import Reads, Writes, WritesInto
from quadctl.logs.formats import CONVERTERS

if TYPE_CHECKING:
    from quadctl.logs.flight_log import FlightLog


@app.command("logs")
def inspect_logs(
    logs: LogArguments,
    to: Annotated[
        str | None, typer.Option("--to", metavar="|".join(CONVERTERS), help="Convert each log to this format too.")
    ] = None,
    output: Annotated[
        Path | None,
        WritesInto(),
        typer.Option("-o", "--output", metavar="DIR", help="Folder to write to [default: beside each log]."),
    ] = None,
    by_map: Annotated[
        Path | None,
        Reads(),
        typer.Option("--map", metavar="MAP.yaml", help="Column map for tables of another program.", callback=find),
    ] = None,
    guess: Annotated[bool, typer.Option("--guess", help="Propose a map of one table, and print it.")] = False,
    plot: Annotated[
        Path | None,
        Writes(),
        typer.Option("--plot", metavar="PNG", help="Plot each channel against what the others predict."),
    ] = None,
    json_out: JsonOption = None,
) -> None:
    """Tell whether flight logs can be analysed, and convert them.

    True update rates, gaps and clock errors are shown.
    """
    from quadctl.logs.convert import convert
    from quadctl.logs.quality import quality
    from quadctl.logs.read import read_logs
    from quadctl.logs.record.copies import marked

    if guess and (by_map or plot or to or json_out or len(logs) != 1):
        raise typer.BadParameter("--guess takes one table, and no other option")
    if plot is not None and len(logs) != 1:
        raise typer.BadParameter("--plot takes one log")
    if guess:
        _propose_map(logs[0])
        return
    reports = []
    for log in marked(read_logs(logs) if by_map is None else list(_mapped(logs, by_map))):
        if plot is not None:
            from quadctl.logs.consistency_plot import draw

            draw(log, plot)
            print_saved(plot)
        reports.append(quality(log))
        console.print(reports[-1])
        if to is not None:
            say(f"Written: {convert(log, to, output)}")
    write_json(json_out, {"logs": [report.to_dict() for report in reports]})


def _propose_map(path: Path) -> None:
    from quadctl.logs.consistency import complaints
    from quadctl.logs.map_guess import as_yaml, proposed

    by, log = proposed(path)
    say(as_yaml(by, f"A guess from {path.name}: check it with quadctl logs --map, and with its --plot"), end="")
    for sentence in complaints(log):
        print(f"{path.name}: {sentence}", file=sys.stderr)


def _mapped(paths: list[Path], by_map: Path) -> Iterator["FlightLog"]:
    """The logs as the map reads them; what is wrong with one is printed, with the field that would mend it."""
    from quadctl.logs.consistency import complaints
    from quadctl.logs.map_guess import better_reading
    from quadctl.logs.table import read_by_map

    for path in paths:
        log = read_by_map(path, by_map)
        found = complaints(log)
        if better := better_reading(path, by_map, log):
            found.append(f"the channels agree with `{better}` in the map")
        for sentence in found:
            say(f"{path.name}: {sentence}")
        yield log
