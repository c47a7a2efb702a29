"""The command that fits ground-effect formulas to static measurements."""

from pathlib import Path
from typing import Annotated

import typer

from quadctl.cli.app import app
from quadctl.cli.inputs import find
from quadctl.cli.output import CurvesOption, ForceOption, JsonOption, print_saved, say, write_json
from quadctl.cli.overwriting import Reads, Writes, refuse_existing
from quadctl.model import save_model
from quadctl.vehicle import load_vehicle


@app.command("ground-curve")
def ground_curve(
    table: Annotated[
        Path,
        Reads(),
        typer.Argument(metavar="FILE.csv", help="Table: height_m and thrust_ratio, thrust_n, thrust_g or thrust_kg."),
    ],
    vehicle: Annotated[
        Path,
        Reads(),
        typer.Option("--vehicle", metavar="VEHICLE.yaml", help="Vehicle file of the rotors.", callback=find),
    ],
    output: Annotated[
        Path | None,
        Writes(),
        typer.Option("-o", "--out", metavar="MODEL.yaml", help="Model file with the best formula."),
    ] = None,
    formula: Annotated[
        str | None,
        typer.Option("--formula", metavar="NAME", help="Formula of the model file, in the best one's place."),
    ] = None,
    surface: Annotated[
        str | None, typer.Option("--surface", metavar="NAME", help="One surface for the model file, in place of all.")
    ] = None,
    plot: CurvesOption = None,
    json_out: JsonOption = None,
    force: ForceOption = False,
) -> None:
    """Fit ground-effect formulas to thrusts over height.

    All formulas are ranked, and the best one is written as a model file.
    """
    from quadctl.ground_curve.measurement import read_measurement
    from quadctl.ground_curve.plot import draw
    from quadctl.ground_curve.result import evaluate

    refuse_existing(force, output, plot)
    loaded = load_vehicle(vehicle)
    result = evaluate(read_measurement(table, loaded), loaded, str(table))
    model = result.model(result.chosen(formula), surface, vehicle) if output is not None else None
    say(*result.findings())
    write_json(json_out, result.to_dict())
    if plot is not None:
        draw(result, plot)
        print_saved(plot)
    if output is not None and model is not None:
        save_model(model, output)
        print_saved(output)
