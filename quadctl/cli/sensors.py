"""`compare` and `diagnose` on the sensors of the height."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from quadctl.cli.app import console
from quadctl.cli.inputs import no_log
from quadctl.cli.output import print_saved, say, write_json
from quadctl.cli.overwriting import Writes
from quadctl.errors import LogError, QuadctlError
from quadctl.files import writing
from quadctl.logs.formats import suffixes

if TYPE_CHECKING:
    from quadctl.effects.sensor_error import SensorError
    from quadctl.lab.sensors.heights import Heights
    from quadctl.logs.flight_log import FlightLog

SensorsOption = Annotated[
    bool,
    typer.Option(
        "--sensors",
        help="Judge barometer and range finder instead of the model.",
    ),
]
PlotOption = Annotated[
    Path | None, Writes(), typer.Option("--plot", metavar="PNG", help="With --sensors: draw the sensor's error.")
]


def logs_among(files: Sequence[Path]) -> list[Path]:
    """The logs of a command whose first argument may be a model, which `--sensors` does not need.

    Raises
    ------
    BadParameter
        There is none.
    """
    first, *others = files
    logs = [*([first] if first.suffix in suffixes() or first.is_dir() else []), *others]
    if not logs:
        raise no_log()
    return logs


def refuse_beside_sensors(**given: object) -> None:
    """Refuse options that say something of a motion, by their names.

    Raises
    ------
    BadParameter
        One of them is given.
    """
    for name, value in given.items():
        if value:
            option = f"--{name.replace('_', '-')}"
            raise typer.BadParameter(f"{option} is of a diagnosis of the motion, expected none with --sensors")


def compare_sensors(logs: Sequence[Path], json_out: Path | None, plot: Path | None) -> None:
    """Print where the barometer fails."""
    from quadctl.lab.sensors.comparison import compare_sensor
    from quadctl.lab.sensors.words import REFERENCES, comparison_table
    from quadctl.logs.read import read_logs

    flights = _flights(read_logs(list(logs)), json_out)
    compared = compare_sensor(flights)
    by = ", ".join(dict.fromkeys(REFERENCES[flight.reference] for flight in flights))
    say(f"The {compared.sensor} differs from {by} by {100.0 * compared.rms_m:.1f} cm, its level left out.")
    console.print(comparison_table(compared))
    write_json(json_out, compared.to_dict())
    _draw(plot, flights, ())


def diagnose_sensors(logs: Sequence[Path], json_out: Path | None, plot: Path | None, output: Path | None) -> None:
    """Print the errors of the barometer, and of the range finder where it has a reference of its own."""
    from quadctl.lab.sensors.diagnosis import diagnose_sensor
    from quadctl.lab.sensors.heights import Heights, heights
    from quadctl.lab.sensors.words import answer
    from quadctl.logs.read import read_logs
    from quadctl.sensor_model import save_sensors

    read = read_logs(list(logs))
    flights = _flights(read, json_out)
    beside = [known for log in read if isinstance(known := heights(log, "rangefinder"), Heights)]
    with console.status("diagnosing"):
        found = diagnose_sensor(flights)
        finder = diagnose_sensor(beside) if beside else None
    both = [found] if finder is None else [found, finder]
    say(*(fact for one in both for fact in answer(one)))
    if output is not None:
        model = found.model()
        save_sensors(model if finder is None else model.beside(finder.model()), output)
        print_saved(output)
        say(f"Next: quadctl export {output} --to ardupilot (or px4)")
    write_json(json_out, {"sensors": [one.to_dict() for one in both]})
    _draw(plot, flights, tuple(one.error for one in found.missing))


def _flights(logs: "Sequence[FlightLog]", json_out: Path | None) -> "list[Heights]":
    """The barometer of each log beside its reference; those without one are said.

    Raises
    ------
    LogError
        A log has no barometer, or none has a reference: then the JSON file says what they need.
    """
    from quadctl.lab.sensors.diagnosis import NoAnswer
    from quadctl.lab.sensors.heights import Heights, heights
    from quadctl.lab.sensors.words import no_reference

    lacking = [log.name for log in logs if not log.has("baro_m")]
    if lacking:
        raise LogError(f"{lacking[0]}: holds no barometer (baro_m), expected one")
    found = [(log.name, heights(log, "barometer")) for log in logs]
    known = [each for _, each in found if isinstance(each, Heights)]
    without = NoAnswer("barometer", tuple((name, each) for name, each in found if not isinstance(each, Heights)))
    if not known:
        write_json(json_out, {"sensors": [without.to_dict()]})
        raise LogError("; ".join(map(str, no_reference(without))))
    for fact in no_reference(without):
        say(f"Left out is {fact}")
    return known


def _draw(plot: Path | None, flights: "Sequence[Heights]", errors: "Sequence[SensorError]") -> None:
    if plot is None:
        return
    from quadctl.lab.plots.height_sensor import height_sensor

    with writing(plot, QuadctlError):
        height_sensor(flights, errors).savefig(plot, dpi=110)
    print_saved(plot)
