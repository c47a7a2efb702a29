"""The commands that fly, in the simulated world or the real one."""

import enum
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any

import typer

from quadctl.cli.app import app, console
from quadctl.cli.output import JsonOption, check_outputs, write_json
from quadctl.errors import FlightError


class Simulated(enum.StrEnum):
    """The autopilots that the simulator can be."""

    PX4 = "px4"
    ARDUPILOT = "ardupilot"


MissionArgument = Annotated[Path, typer.Argument(metavar="MISSION.yaml")]
ModelOption = Annotated[
    str | None,
    typer.Option("--model", metavar="MODEL", help="Compensator: none, an effect such as hayden, or a model file."),
]
ConfigOption = Annotated[
    Path | None, typer.Option("--config", metavar="FILE", help="Flight configuration [default: config/flight.yaml].")
]
LogDirOption = Annotated[Path, typer.Option("--log-dir", metavar="DIR", help="Where the log goes.")]
HiddenOption = Annotated[
    Path | None, typer.Option("--hidden", metavar="FILE", help="What the simulated world hides from us.")
]
SeedOption = Annotated[int, typer.Option("--seed", metavar="N", min=0, help="Same seed, same flight.")]
OffsetOption = Annotated[
    float | None, typer.Option("--offset-up", metavar="M", help="Fly the mission so much higher than its file says.")
]
SetOption = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="NAME=VALUE", help="Fly with another value of one of the mission's parameters."),
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
    json_out: JsonOption = None,
) -> None:
    """Fly a mission in simulated time, as fast as the machine can, reproducible from a seed."""
    from quadctl.flight.session import prepare_flight

    check_outputs([mission, config, hidden], json_out)
    plan = prepare_flight(mission, config, model, offset_up, overrides or ())
    _print_warnings(plan.warnings)
    _finish(simulator().simulate(plan, log_dir, hidden, seed), json_out)


@app.command()
def fly(
    mission: MissionArgument,
    link: Annotated[
        str | None, typer.Option("--link", metavar="URL", help="auto, udpin://..., serial:///dev/...:BAUD")
    ] = None,
    sitl: Annotated[bool, typer.Option("--sitl", help="Fly a simulated autopilot over MAVLink, in real time.")] = False,
    autopilot: Annotated[
        Simulated | None, typer.Option("--autopilot", help="With --sitl: which one is simulated [default: px4].")
    ] = None,
    set_params: Annotated[
        bool, typer.Option("--set-params", help="Set the autopilot's parameters as needed, restore them afterwards.")
    ] = False,
    model: ModelOption = None,
    hidden: HiddenOption = None,
    seed: SeedOption = 0,
    log_dir: LogDirOption = Path("logs"),
    config: ConfigOption = None,
    offset_up: OffsetOption = None,
    overrides: SetOption = None,
    json_out: JsonOption = None,
) -> None:
    """Fly a mission on an autopilot. Ctrl-C lands."""
    from quadctl.flight.ports import resolve
    from quadctl.flight.session import fly_real_time, prepare_flight

    if sitl and link is not None:
        raise typer.BadParameter("give --link or --sitl, not both")
    if not sitl and (hidden is not None or seed or autopilot is not None):
        raise typer.BadParameter("--hidden, --seed and --autopilot are for the simulated autopilot: they need --sitl")
    check_outputs([mission, config, hidden], json_out)
    plan = prepare_flight(mission, config, model, offset_up, overrides or ())
    _print_warnings(plan.warnings)
    if not sitl:
        url = resolve(plan.settings.link.url if link is None else link, console)
        _finish(fly_real_time(plan, url, log_dir, console, set_params), json_out)
        return
    kind = (autopilot or Simulated.PX4).value
    with simulator().mock_process(plan.body.vehicle, hidden, seed, kind) as url:
        _finish(fly_real_time(plan, url, log_dir, console, set_params), json_out)


@app.command()
def demo(
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Where logs, models and the report go.")] = Path(
        "demo"
    ),
    real_time: Annotated[bool, typer.Option(help="Include a short flight over MAVLink in real time.")] = True,
) -> None:
    """The whole circle without hardware: fly, compare, diagnose, add, fly again."""
    from quadctl.demo import run

    run(out, console, simulator(), real_time)


def _finish(outcome: Any, json_out: Path | None) -> None:
    """Print how a flight went; exit status 1 when it was not completed."""
    console.print("\n".join(outcome.lines()), soft_wrap=True, markup=False, highlight=False)
    write_json(json_out, asdict(outcome))
    if not outcome.completed:
        raise FlightError(f"the flight was not completed: {outcome.ended}")


def _print_warnings(warnings: Sequence[str]) -> None:
    for warning in warnings:
        console.print(f"warning: {warning}", style="yellow", soft_wrap=True, markup=False, highlight=False)


def simulator() -> Any:
    """The one way from the commands to the simulator."""
    import sitl.run

    return sitl.run
