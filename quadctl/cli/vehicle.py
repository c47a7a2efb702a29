"""The commands for vehicle files."""

import sys
from pathlib import Path
from typing import Annotated

import typer

from quadctl.cli.app import app, console
from quadctl.cli.inputs import find
from quadctl.cli.output import print_saved, print_warning, say
from quadctl.cli.overwriting import App, Reads, Writes, refuse_existing
from quadctl.errors import SettingsError
from quadctl.files import write_text
from quadctl.logs.formats import suffixes_with_parameters
from quadctl.vehicle import load_vehicle

vehicles = App(no_args_is_help=True, help="Vehicle files: new, show.", rich_markup_mode=None)
app.add_typer(vehicles, name="vehicle")


@vehicles.command()
def new(
    output: Annotated[Path, Writes(), typer.Argument(metavar="NEW.yaml", help="Vehicle file to write.")],
    parameters: Annotated[
        Path | None,
        Reads(),
        typer.Option(
            "--parameters",
            metavar="FILE",
            help="The autopilot's parameters: .params, .param, .parm, or a log "
            f"({', '.join(suffixes_with_parameters())}).",
        ),
    ] = None,
    mass: Annotated[float | None, typer.Option("--mass", metavar="KG", help="Take-off mass with battery.")] = None,
    propeller: Annotated[
        float | None, typer.Option("--propeller", metavar="M", help="Diameter of a propeller: 10 inches are 0.254.")
    ] = None,
    frame: Annotated[
        str | None,
        typer.Option("--frame", metavar="NAME", help="quad-x, quad-plus, hexa-x, hexa-plus, octa-x or octa-plus."),
    ] = None,
    arm: Annotated[float | None, typer.Option("--arm", metavar="M", help="From the centre to a rotor's axis.")] = None,
    hover_throttle: Annotated[
        float | None, typer.Option("--hover-throttle", metavar="0..1", help="Throttle in hover.")
    ] = None,
    hover_rpm: Annotated[
        float | None, typer.Option("--hover-rpm", metavar="RPM", help="Rotor speed in hover, where it is known.")
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Overwrite NEW.yaml.")] = False,
) -> None:
    """Write a vehicle file; what neither the parameters nor the options say is asked."""
    from quadctl.logs.parameters import read_present_parameters
    from quadctl.vehicle_draft.draft import Answers, draft, missing
    from quadctl.vehicle_draft.frames import overlap

    refuse_existing(force, output)
    known = read_present_parameters(parameters) if parameters is not None else {}
    answers = Answers(output.stem, mass, propeller, frame, arm, hover_throttle, hover_rpm)
    facts = missing(answers, known)
    if facts and not sys.stdin.isatty():
        options = "; ".join(f"{OPTIONS[fact.field]}, the {fact.question}" for fact in facts)
        raise SettingsError(f"facts are missing, expected {options}")
    for fact in facts:
        kind = str if fact.field == "frame" else float
        answers = answers._replace(
            **{fact.field: typer.prompt(fact.question[0].upper() + fact.question[1:], type=kind)}
        )
    write_text(output, draft(answers, known))
    print_saved(output)
    vehicle = load_vehicle(output)
    most = vehicle.max_thrust_n / vehicle.weight_n
    say(
        f"{vehicle.n_rotors} rotors, {vehicle.mass_kg:g} kg, thrust up to {most:.1f} "
        f"times the weight, throttle in hover {vehicle.hover_throttle:.2f}. Read the comments in the file: what is "
        "assumed is worth measuring (quadctl thrust-stand, or a flight and quadctl discover)."
    )
    if touching := overlap([rotor.position_m for rotor in vehicle.rotors], 2.0 * vehicle.rotor.radius_m):
        print_warning(str(touching))


OPTIONS = {
    "mass_kg": "--mass",
    "propeller_m": "--propeller",
    "frame": "--frame",
    "hover_throttle": "--hover-throttle",
}
"""The option that says each fact."""


@vehicles.command()
def show(
    vehicle: Annotated[Path, Reads(), typer.Argument(metavar="VEHICLE.yaml", help="Vehicle file.", callback=find)],
    plot: Annotated[
        Path | None, Writes(), typer.Option("--plot", metavar="PNG", help="Draw the rotors from above into this file.")
    ] = None,
) -> None:
    """Show what a vehicle's rotors can do: thrust over weight, throttle in hover, lateral force without leaning."""
    from quadctl.control.throttle import throttle_for_thrust

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
