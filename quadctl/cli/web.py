"""The lab as a page in the browser."""

from pathlib import Path
from typing import Annotated

import typer

from quadctl.cli.app import app
from quadctl.cli.flight import HiddenOption, simulator
from quadctl.cli.inputs import find
from quadctl.cli.output import say
from quadctl.cli.overwriting import Reads, WritesInto


@app.command("lab")
def lab_page(
    logs: Annotated[
        list[Path] | None, Reads(), typer.Argument(metavar="[LOG...]", help="Flight logs; or drop them on the page.")
    ] = None,
    model: Annotated[
        Path | None,
        Reads(),
        typer.Option("--model", metavar="MODEL.yaml", help="Model or vehicle file to begin with.", callback=find),
    ] = None,
    session: Annotated[
        Path | None, Reads(), typer.Option("--session", metavar="FILE", help="Continue a saved session.")
    ] = None,
    anew: Annotated[
        bool, typer.Option("--new", help="Begin a new session, even where --out holds a session of these logs.")
    ] = False,
    out: Annotated[
        Path, WritesInto(), typer.Option("--out", metavar="DIR", help="Folder for all that is saved.")
    ] = Path("lab"),
    missions: Annotated[
        Path, Reads(), typer.Option("--missions", metavar="DIR", help="Folder of the missions.", callback=find)
    ] = Path("missions"),
    hidden: HiddenOption = None,
    port: Annotated[int, typer.Option("--port", metavar="N", min=1, max=65535)] = 8090,
    show: Annotated[bool, typer.Option("--open/--no-open", help="Open the browser.")] = True,
) -> None:
    """Find what a model is missing, on a page in the browser.

    If --out holds a session, it is continued, unless other logs are given.
    """
    from quadctl.web.work.worker import prepare_workers

    prepare_workers()  # while the libraries of the page are loaded here
    from quadctl.sample_world import HIDDEN
    from quadctl.web.page.server import serve
    from quadctl.web.session.earlier import set_aside
    from quadctl.web.session.session import AUTOSAVED
    from quadctl.web.session.start import check_folders, first_session, kept_session, vehicle_files
    from quadctl.web.work.simulated import Simulation
    from quadctl.web.workbench.intake import Intake
    from quadctl.web.workbench.workbench import Workbench

    if session is not None and (logs or model is not None):
        raise typer.BadParameter("give --session, or LOG and --model, not both")
    check_folders(out, missions)
    begun = first_session(logs or [], model, session)
    kept = None if session is not None or anew else kept_session(out, begun, model_given=model is not None)
    if kept is not None:
        say(f"The session in {out} is continued; --new begins another.")
    elif session is None or session.resolve() != (out / AUTOSAVED).resolve():
        before = set_aside(out)
        if before is not None:
            say(f"The session before is kept as {before}.")
    simulation = Simulation(simulator().simulate, missions, out, hidden, HIDDEN)
    serve(
        lambda: Workbench(out, simulation),
        kept or begun,
        lambda bench: Intake(bench, vehicle_files()),
        port,
        show,
        lambda url: say(f"The lab is at {url}, for this machine only. Ctrl-C ends it."),
    )
