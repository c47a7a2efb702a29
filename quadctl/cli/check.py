"""The command that checks whether a flight may begin."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.text import Text

from quadctl.cli.app import app, console
from quadctl.cli.flight import (
    ConfigOption,
    LogDirOption,
    ModelOption,
    OffsetOption,
    RestoreOption,
    SetOption,
    SystemIdOption,
    TimeScaleOption,
    WithoutFailsafeOption,
    say_time_scale,
)
from quadctl.cli.inputs import find_all, find_configuration, find_mission
from quadctl.cli.output import JsonOption, write_json
from quadctl.cli.overwriting import Reads
from quadctl.errors import FlightError

if TYPE_CHECKING:
    from quadctl.flight.preflight.attitude import LastFlight

STYLES = {"ok": "green", "warning": "yellow", "refused": "bold red"}


def _found(files: list[Path]) -> list[Path]:
    """Vehicle file, if any, and mission file."""
    *vehicles, mission = files
    return [*find_all(vehicles), find_mission(mission)]


def _last_flight(log: Path) -> "LastFlight":
    """Attitude and parameters of an earlier flight from its log, by the lab (an extra of the installation)."""
    from quadctl.flight.preflight.attitude import LastFlight
    from quadctl.lab.tracking.attitude_response import attitude_response
    from quadctl.logs.parameters import parameters_of
    from quadctl.logs.read import read_log

    flown = read_log(log)
    return LastFlight(log.name, attitude_response([flown]), parameters_of(flown))


@app.command()
def check(
    files: Annotated[
        list[Path],
        Reads(),
        typer.Argument(
            metavar="[VEHICLE.yaml] MISSION",
            help="Mission file or name (figure8). Without a vehicle file before it, the vehicle is that of --model or "
            "of the configuration.",
            callback=_found,
        ),
    ],
    model: ModelOption = None,
    config: ConfigOption = None,
    link: Annotated[
        str | None, typer.Option("--link", metavar="URL", help="Ask the autopilot too: auto, udpin://..., serial://...")
    ] = None,
    seconds: Annotated[
        float, typer.Option("--seconds", metavar="S", min=1.0, max=60.0, help="With --link: how long to listen.")
    ] = 3.0,
    system_id: SystemIdOption = None,
    without_failsafe: WithoutFailsafeOption = False,
    restore_params: RestoreOption = False,
    log_dir: LogDirOption = Path("logs"),
    offset_up: OffsetOption = None,
    overrides: SetOption = None,
    time_scale: TimeScaleOption = None,
    log: Annotated[
        Path | None,
        Reads(),
        typer.Option(
            "--log", metavar="LOG", help="Compare autopilot parameters and attitude lag with an earlier flight."
        ),
    ] = None,
    json_out: JsonOption = None,
) -> None:
    """Check whether a mission may be flown.

    Mission, vehicle, compensator (--model) and limits are checked, and with --link the autopilot.
    """
    from quadctl.flight.autopilot.ports import resolve
    from quadctl.flight.preflight.attitude import compare_with_log
    from quadctl.flight.preflight.check import check_flight
    from quadctl.flight.preflight.computer import check_computer
    from quadctl.flight.preflight.findings import Verdict, of_verdict
    from quadctl.flight.preflight.plan import read_flight
    from quadctl.flight.preflight.time_scale import with_time_scale
    from quadctl.words import count

    if len(files) > 2:
        raise typer.BadParameter(f"{len(files)} files are given, expected a mission, or a vehicle and a mission")
    *vehicles, mission = files
    last = None if log is None else _last_flight(log)
    plan = read_flight(
        mission,
        find_configuration(config, mission),
        model,
        offset_up,
        overrides or (),
        vehicles[0] if vehicles else None,
    ).speaking_as(system_id)
    plan = with_time_scale(plan, time_scale)
    say_time_scale(plan, time_scale)
    findings = [*check_flight(plan), check_computer()]
    if last is not None:
        findings.append(compare_with_log(plan, last))
    if link is not None:
        from quadctl.flight.preflight.inquiry import ask_autopilot

        url = resolve(link, console)
        with console.status(f"listening to {url}"):
            findings += ask_autopilot(plan, url, seconds, log_dir, without_failsafe, restore_params, last)
    refused, warnings = (len(of_verdict(findings, verdict)) for verdict in (Verdict.REFUSED, Verdict.WARNING))
    if not refused:
        console.print(
            f"{plan.mission.name} may be flown: {count(len(findings), 'check')}, {count(warnings, 'warning')}."
        )
    for finding in sorted(findings, key=lambda f: list(reversed(Verdict)).index(f.verdict)):
        line = Text(f"{finding.verdict.value:8}", style=STYLES[finding.verdict.value])
        line.append(f" {finding.topic:12} {finding.text}", style="default not bold")
        console.print(line, soft_wrap=not console.is_terminal)
    write_json(json_out, {"mission": plan.mission.name, "findings": [finding.to_dict() for finding in findings]})
    if refused:
        raise FlightError(f"{mission} must not be flown like this: {refused} of {len(findings)} checks refuse it")
