"""The commands that look at missions without flying them."""

from pathlib import Path
from typing import Annotated

import typer
from rich.padding import Padding
from rich.text import Text

from quadctl.cli.app import app, console
from quadctl.cli.flight import ConfigOption, MissionArgument, OffsetOption, SetOption
from quadctl.cli.inputs import find, find_configuration
from quadctl.cli.output import print_saved
from quadctl.cli.overwriting import App, Reads, Writes

missions = App(no_args_is_help=True, help="Look at missions: list, show.", rich_markup_mode=None)
app.add_typer(missions, name="mission")


@missions.command()
def show(
    mission: MissionArgument,
    output: Annotated[
        Path | None,
        Writes(),
        typer.Option("-o", "--output", metavar="PNG", help="Draw into this file, not on the terminal."),
    ] = None,
    config: ConfigOption = None,
    offset_up: OffsetOption = None,
    overrides: SetOption = None,
) -> None:
    """Draw a mission with its limits, and list its phases."""
    from quadctl.flight.pilot.settings import load_flight_settings
    from quadctl.missions import load_mission
    from quadctl.missions.sketch import sketch

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
        Path, Reads(), typer.Argument(metavar="DIR", help="Folder with mission files.", callback=find)
    ] = Path("missions"),
) -> None:
    """List the missions of a folder: duration, heights, the parameters of --set, and the purpose."""
    from quadctl.missions import load_mission, mission_files
    from quadctl.missions.profile import flown_heights_m, sampled

    read = (load_mission(path) for path in mission_files(folder))
    listed = [(mission, *flown_heights_m(sampled(mission))) for mission in read]
    width = max(len(name) for name in ("mission", *(mission.name for mission, *_ in listed)))
    _print_heading(width, "mission", "s", "heights m", "--set")
    for mission, lowest, highest in listed:
        heights = f"{lowest:.2f}..{highest:.2f}"
        _print_heading(width, mission.name, f"{mission.duration_s:.0f}", heights, ", ".join(mission.parameters))
        if mission.description:
            console.print(Padding(Text(mission.description), (0, 0, 0, 2), expand=False))


def _print_heading(width: int, name: str, duration: str, heights: str, settable: str) -> None:
    console.print(Text(f"{name:<{width}}  {duration:>4}  {heights:>10}  {settable}".rstrip(), style="bold"))
