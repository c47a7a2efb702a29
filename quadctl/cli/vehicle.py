"""The commands about vehicle files."""

from pathlib import Path
from typing import Annotated

import typer

from quadctl.cli.app import app, console
from quadctl.cli.inputs import find
from quadctl.cli.output import check_outputs, print_saved

vehicles = typer.Typer(no_args_is_help=True, help="Look at vehicles: show.", rich_markup_mode=None)
app.add_typer(vehicles, name="vehicle")


@vehicles.command()
def show(
    vehicle: Annotated[Path, typer.Argument(metavar="VEHICLE.yaml", help="Vehicle file.", callback=find)],
    plot: Annotated[
        Path | None, typer.Option("--plot", metavar="PNG", help="Draw the rotors from above into this file.")
    ] = None,
) -> None:
    """Show what a vehicle's rotors can do: thrust over weight, throttle in hover, lateral force without leaning."""
    from quadctl.control.throttle import throttle_for_thrust
    from quadctl.vehicle import load_vehicle

    check_outputs([vehicle], plot)
    loaded = load_vehicle(vehicle)
    allocation, weight_n = loaded.allocation, loaded.weight_n
    reach_n = allocation.lateral_reach_n(weight_n)
    lifted = loaded.max_thrust_n * loaded.axial_share / weight_n
    lateral = f"{reach_n:.2f} N in level hover, {reach_n / weight_n:.0%} of the weight" if reach_n else "none"
    for what, value in (
        ("vehicle", f"{loaded.name}, {loaded.mass_kg:g} kg, {loaded.n_rotors} rotors"),
        ("thrust to weight", f"{lifted:.2f}"),
        ("hover throttle", f"{throttle_for_thrust(weight_n / loaded.axial_share, loaded):.2f}"),
        ("allocation rank", f"{allocation.rank} of 6"),
        ("lateral reach", lateral),
    ):
        console.print(f"{what:17} {value}", highlight=False)
    if plot is None:
        return
    from quadctl.lab.plots.vehicle import save_vehicle_plot

    save_vehicle_plot(loaded, plot)
    print_saved(plot)
