"""The commands that fly, in the simulated world or the real one."""

import re
from contextlib import AbstractContextManager, ExitStack
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from quadctl.cli.app import app, console
from quadctl.cli.inputs import find, find_configuration, find_mission
from quadctl.cli.output import JsonOption, print_warning, say, write_json
from quadctl.cli.overwriting import Reads, WritesInto
from quadctl.errors import FlightError
from quadctl.installed import is_installed
from quadctl.sitl.autopilots import Simulated

if TYPE_CHECKING:
    from quadctl.flight.preflight.plan import FlightPlan

TOKEN = re.compile(r"[\w-]{8,}", re.ASCII)
"""Token of the live view: characters that an address can hold, too many to be guessed."""


MissionArgument = Annotated[
    Path,
    Reads(),
    typer.Argument(
        metavar="MISSION", help="Mission file, or the name of one in missions/, e.g. figure8.", callback=find_mission
    ),
]
ModelOption = Annotated[
    str | None,
    Reads(),
    typer.Option(
        "--model",
        metavar="MODEL",
        help="Effects to compensate: none, a ground effect such as hayden, or a model file [default: as configured].",
    ),
]
ConfigOption = Annotated[
    Path | None,
    Reads(),
    typer.Option("--config", metavar="FILE", help="Flight configuration [default: config/flight.yaml].", callback=find),
]
LogDirOption = Annotated[Path, WritesInto(), typer.Option("--log-dir", metavar="DIR", help="Folder of the logs.")]
HiddenOption = Annotated[
    Path | None,
    Reads(),
    typer.Option(
        "--hidden",
        metavar="FILE",
        help="In simulation: effects that the controller does not know, from a file of hidden effects or a model.",
        callback=find,
    ),
]
SeedOption = Annotated[int, typer.Option("--seed", metavar="N", min=0, help="In simulation: seed of the noise.")]
OffsetOption = Annotated[
    float | None, typer.Option("--offset-up", metavar="M", help="Raise the whole mission by M metres.")
]
SetOption = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="NAME=VALUE", help="Other value for one of the mission's parameters."),
]

TimeScaleOption = Annotated[
    str | None,
    typer.Option(
        "--time-scale",
        metavar="FACTOR|fit",
        help="Stretch the time of the mission (2: half the speed); fit: the smallest >= 1 that keeps all limits.",
    ),
]

SystemIdOption = Annotated[
    int | None,
    typer.Option(
        "--system-id",
        metavar="N",
        min=1,
        max=255,
        help="MAVLink system id of quadctl [default: as configured, else 1].",
    ),
]

WithoutFailsafeOption = Annotated[
    bool,
    typer.Option(
        "--without-failsafe",
        help="Accept an autopilot that does not land by itself when quadctl stops: keep a hand on the mode switch.",
    ),
]

RestoreOption = Annotated[
    bool,
    typer.Option(
        "--restore-params",
        help="First restore the parameters that an interrupted `fly --set-params` changed, from its file in --log-dir.",
    ),
]


@app.command()
def simulate(
    mission: MissionArgument,
    model: ModelOption = None,
    hidden: HiddenOption = None,
    seed: SeedOption = 0,
    log_dir: LogDirOption = Path("logs"),
    config: ConfigOption = None,
    offset_up: OffsetOption = None,
    overrides: SetOption = None,
    time_scale: TimeScaleOption = None,
    json_out: JsonOption = None,
) -> None:
    """Fly a mission in simulated time, reproducible from a seed."""
    from quadctl.flight.preflight.preparation import prepare_flight

    configuration = find_configuration(config, mission)
    plan = prepare_flight(mission, configuration, model, offset_up, overrides or (), time_scale)
    say_time_scale(plan, time_scale)
    _print_warnings(plan, simulated=True)
    _finish(simulator().simulate(plan, log_dir, hidden, seed), json_out)


@app.command()
def fly(
    mission: MissionArgument,
    link: Annotated[
        str | None, typer.Option("--link", metavar="URL", help="auto, udpin://..., serial:///dev/...:BAUD")
    ] = None,
    sitl: Annotated[
        bool, typer.Option("--sitl", help="Fly quadctl's own simulated autopilot (no firmware) in real time.")
    ] = False,
    autopilot: Annotated[
        Simulated | None,
        typer.Option("--autopilot", help="With --sitl: the autopilot to imitate [default: px4]."),
    ] = None,
    set_params: Annotated[
        bool, typer.Option("--set-params", help="Set the autopilot's parameters as needed, restore them afterwards.")
    ] = False,
    system_id: SystemIdOption = None,
    without_failsafe: WithoutFailsafeOption = False,
    restore_params: RestoreOption = False,
    model: ModelOption = None,
    hidden: HiddenOption = None,
    seed: SeedOption = 0,
    log_dir: LogDirOption = Path("logs"),
    config: ConfigOption = None,
    offset_up: OffsetOption = None,
    overrides: SetOption = None,
    time_scale: TimeScaleOption = None,
    json_out: JsonOption = None,
    view: Annotated[
        bool, typer.Option("--view", help="Show the flight on a page in the browser, with a button that lands.")
    ] = False,
    view_port: Annotated[
        int, typer.Option("--view-port", metavar="N", min=1, max=65535, help="Port of that page.")
    ] = 8091,
    view_token: Annotated[
        str | None,
        typer.Option(
            "--view-token",
            metavar="T",
            help="Token that lets other computers open the page and press its landing button.",
        ),
    ] = None,
) -> None:
    """Fly a mission on an autopilot, unless `check` refuses it. Ctrl-C lands."""
    from quadctl.flight.preflight.computer import check_computer, lacking_to_fly

    if (lacking := lacking_to_fly()) is not None:
        raise FlightError(f"a flight needs {lacking}")
    from quadctl.flight.autopilot.ports import resolve
    from quadctl.flight.preflight.findings import Verdict
    from quadctl.flight.preflight.preparation import prepare_flight
    from quadctl.flight.session import Allowed, fly_real_time

    if sitl and link is not None:
        raise typer.BadParameter("give --link or --sitl, not both")
    if not sitl and (hidden is not None or seed or autopilot is not None):
        raise typer.BadParameter("--hidden, --seed and --autopilot are for the simulated autopilot: they need --sitl")
    if view_token is not None and not view:
        raise typer.BadParameter("--view-token is for the live view: it needs --view")
    if view_token is not None and not TOKEN.fullmatch(view_token):
        raise typer.BadParameter("--view-token lands a vehicle: give 8 or more letters, digits, - or _")
    configuration = find_configuration(config, mission)
    if not sitl and is_installed(configuration):
        raise FlightError(
            "there is no config/flight.yaml here, expected one that describes your vehicle: `quadctl init DIR` writes "
            "an example to edit, --config names another file"
        )
    plan = prepare_flight(mission, configuration, model, offset_up, overrides or (), time_scale).speaking_as(system_id)
    say_time_scale(plan, time_scale)
    _print_warnings(plan, simulated=sitl)
    if not sitl and (computer := check_computer()).verdict is Verdict.WARNING:
        print_warning(str(computer))
    with ExitStack() as stack:
        viewer = stack.enter_context(_viewer(plan, view_port, view_token)) if view else None
        if sitl:
            kind = autopilot or Simulated.PX4
            url = stack.enter_context(simulator().mock_process(plan.body.vehicle, hidden, seed, kind))
        else:
            url = resolve(plan.settings.link.url if link is None else link, console)
        allowed = Allowed(set_params, without_failsafe, restore_params, None if sitl else log_dir)
        outcome = fly_real_time(plan, url, log_dir, console, allowed, viewer and viewer.end)
        if viewer is not None:
            viewer.tell(outcome)
        _finish(outcome, json_out)


@app.command()
def demo(
    out: Annotated[
        Path, WritesInto(), typer.Option("--out", metavar="DIR", help="Folder for logs, models and the report.")
    ] = Path("demo"),
    real_time: Annotated[bool, typer.Option(help="Include a short flight over MAVLink in real time.")] = True,
) -> None:
    """Show the whole workflow without hardware.

    It flies, compares, diagnoses, adds the effect that is missing, and flies again.
    """
    from quadctl.demo import run

    run(out, console, simulator(), real_time)


def _viewer(plan: Any, port: int, token: str | None) -> AbstractContextManager[Any]:
    """The live view of a flight."""
    from quadctl.web.live.history import Brief
    from quadctl.web.live.viewer import live_view

    brief = Brief(plan.mission, plan.settings.guards, plan.body.vehicle, plan.compensator.name)
    return live_view(brief, port, token, say)


def _finish(outcome: Any, json_out: Path | None) -> None:
    """Print how a flight went; exit status 1 when it was not completed."""
    say(*outcome.lines())
    write_json(json_out, asdict(outcome))
    if not outcome.completed:
        raise FlightError(f"the flight was not completed: {outcome.ended}")


def say_time_scale(plan: "FlightPlan", wanted: str | None) -> None:
    """Say in which time a mission is flown whose time is scaled."""
    if wanted is not None:
        mission = plan.mission
        say(f"time scale {mission.time_scale:g}: '{mission.name}' lasts {mission.duration_s:.0f} s")


def _print_warnings(plan: Any, simulated: bool) -> None:
    for warning in plan.warnings:
        if not (simulated and warning.topic == "battery"):  # nobody's is at stake
            print_warning(str(warning))


def simulator() -> Any:
    """Import the simulator: the one way from the commands to it."""
    import quadctl.sitl.run

    return quadctl.sitl.run
