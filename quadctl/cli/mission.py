"""The commands that look at missions without flying them."""

from pathlib import Path
from typing import Annotated

import typer
from rich.table import Table

from quadctl.cli.app import app, console
from quadctl.cli.flight import ConfigOption, MissionArgument, OffsetOption, SetOption
from quadctl.cli.inputs import find_configuration, find_missions
from quadctl.cli.output import check_outputs, print_saved

missions = typer.Typer(no_args_is_help=True, help="Look at missions: list, show.", rich_markup_mode=None)
app.add_typer(missions, name="mission")


@missions.command()
def show(
    mission: MissionArgument,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="PNG", help="Draw into this file, not on the terminal.")
    ] = None,
    config: ConfigOption = None,
    offset_up: OffsetOption = None,
    overrides: SetOption = None,
) -> None:
    """Draw a mission with its limits, and list its phases."""
    from quadctl.flight.pilot.settings import load_flight_settings
    from quadctl.missions import load_mission
    from quadctl.missions.sketch import sketch

    check_outputs([mission, config], output)
    loaded = load_mission(mission, offset_up, overrides or ())
    settings = load_flight_settings(find_configuration(config, mission))
    speed, tilt_deg = settings.guards.max_speed_m_s, settings.controller.max_tilt_deg
    if output is None:
        console.print(sketch(loaded, speed, tilt_deg), highlight=False)
        return
    from quadctl.lab.plots.mission import save_mission_plot

    save_mission_plot(loaded, speed, tilt_deg, output)
    print_saved(output)


@missions.command("list")
def list_missions(
    folder: Annotated[
        Path, typer.Argument(metavar="DIR", help="Folder with mission files.", callback=find_missions)
    ] = Path("missions"),
) -> None:
    """List the missions of a folder: duration, heights, purpose, and the parameters of --set."""
    from quadctl.missions import load_mission, mission_files
    from quadctl.missions.profile import flown_heights_m, sampled

    table = Table(box=None, pad_edge=False, header_style="bold")
    for column, right in (("mission", False), ("s", True), ("heights m", True), ("what", False), ("--set", False)):
        table.add_column(column, justify="right" if right else "left", no_wrap=right)
    for path in mission_files(folder):
        loaded = load_mission(path)
        lowest, highest = flown_heights_m(sampled(loaded))
        table.add_row(
            loaded.name,
            f"{loaded.duration_s:.0f}",
            f"{lowest:.2f}..{highest:.2f}",
            loaded.description,
            ", ".join(loaded.parameters),
        )
    console.print(table, highlight=False)
