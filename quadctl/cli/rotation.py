"""`quadctl rotation`: moment gains, rotor lag, damping and thrust map from gyro, accelerometer and commands."""

from pathlib import Path
from typing import Annotated

import typer

from quadctl.cli.app import app, console
from quadctl.cli.inputs import find
from quadctl.cli.lab import LogArguments, RolloutsOption
from quadctl.cli.output import JsonOption, print_saved, write_json
from quadctl.cli.overwriting import Reads, Writes


@app.command()
def rotation(
    vehicle: Annotated[
        Path, Reads(), typer.Argument(metavar="VEHICLE.yaml", help="Vehicle file, for its rotors.", callback=find)
    ],
    logs: LogArguments,
    rollouts: RolloutsOption = False,
    json_out: JsonOption = None,
    output: Annotated[
        Path | None,
        Writes(),
        typer.Option("-o", "--output", metavar="NEW.yaml", help="Save a model with the rotational dynamics found."),
    ] = None,
) -> None:
    """Identify the rotational dynamics from logs.

    Moment gains, rotor lag, damping and thrust map follow from commands and IMU, logged at 100 Hz or more in flights
    that turn a lot; a position is not needed.
    """
    from quadctl.lab.rotation import interface
    from quadctl.lab.rotation.words import answer, forecasts
    from quadctl.logs.read import read_imu_log
    from quadctl.model import load_model, save_model

    model = load_model(vehicle)
    read = [read_imu_log(path) for path in logs]
    with console.status("estimating"):
        found = interface.identify_rotation(model, read)
        unseen = interface.rollouts(model, read) if rollouts else None
    console.print(answer(found))
    if unseen is not None:
        console.print(forecasts(unseen))
    write_json(json_out, found.to_dict() | ({"rollouts": unseen.to_dict()} if unseen is not None else {}))
    if output is not None:  # a refusal of a new model loses nothing of what was found
        with console.status("fitting the observer"):
            new = interface.add_rotation(model, found, read)
        save_model(new, output)
        print_saved(output)
