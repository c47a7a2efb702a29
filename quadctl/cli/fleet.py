"""The command that follows the vehicles of a fleet over their flights."""

from pathlib import Path
from typing import Annotated

import typer

from quadctl.cli.app import app, console
from quadctl.cli.inputs import find
from quadctl.cli.output import JsonOption, say, write_json
from quadctl.cli.overwriting import Reads, Writes


@app.command()
def fleet(
    folder: Annotated[
        Path, Reads(), typer.Argument(metavar="DIR", help="Folder with a folder of logs for each vehicle.")
    ],
    model: Annotated[
        Path,
        Reads(),
        typer.Option("--model", metavar="MODEL.yaml", help="Vehicle or model file of the fleet.", callback=find),
    ],
    index: Annotated[
        Path | None,
        Writes(),
        typer.Option("--index", metavar="FILE", help="Index of what was measured (DIR/fleet.jsonl)."),
    ] = None,
    html: Annotated[
        Path | None, Writes(), typer.Option("--html", metavar="OUT.html", help="Write a report with all vehicles.")
    ] = None,
    json_out: JsonOption = None,
    jobs: Annotated[int, typer.Option("--jobs", metavar="N", min=1, help="Number of processes.")] = 1,
    cluster: Annotated[
        str | None,
        typer.Option("--cluster", metavar="ADDRESS", help="Scheduler of a Dask cluster, which does the work instead."),
    ] = None,
) -> None:
    """Find the vehicles of a fleet that have changed.

    Every flight is measured once, and kept in an index.
    """
    from quadctl.fleet.index import Index, find_logs
    from quadctl.fleet.report import write_report
    from quadctl.fleet.summary import summarise
    from quadctl.fleet.work import measure_fleet

    index = index or folder / "fleet.jsonl"
    logs = find_logs(folder, model)
    known = Index(index)
    with console.status("measuring") as status:
        measure_fleet(logs, known, jobs, cluster, lambda done, of: status.update(f"measured {done} of {of} flights"))
    result = summarise(known.of(logs))
    console.print(result)
    write_json(json_out, result.to_dict())
    if html is not None:
        write_report(html, result, folder, model)
        say(f"Report: {html}")
