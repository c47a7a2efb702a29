"""The command that proposes the gains of the position loop from the lags in logs."""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.table import Table

from quadctl.cli.app import app, console
from quadctl.cli.flight import ConfigOption, ModelOption
from quadctl.cli.inputs import find_configuration
from quadctl.cli.lab import LogArguments
from quadctl.cli.output import JsonOption, print_saved, say, write_json
from quadctl.errors import LogError, SettingsError
from quadctl.files import write_text
from quadctl.installed import is_installed

if TYPE_CHECKING:
    from quadctl.control import ControllerSettings
    from quadctl.control.tuning import LagsFound

GAINS = (
    ("position_p",),
    ("velocity_horizontal", "p"),
    ("velocity_horizontal", "i"),
    ("velocity_horizontal", "d"),
    ("position_p_vertical",),
    ("velocity_vertical", "p"),
    ("velocity_vertical", "i"),
    ("velocity_vertical", "d"),
)
"""Gains by their keys below `controller`."""
SAID: dict[str, Callable[[Any], str]] = {
    "largest sensitivity": lambda margins: f"{margins.sensitivity_peak:.2f}" if margins.stable else "unstable",
    "gain margin": lambda margins: f"{margins.gain:.1f}",
    "phase margin, deg": lambda margins: f"{margins.phase_deg:.0f}",
    "delay margin, ms": lambda margins: f"{1e3 * margins.delay_s:.0f}",
}


@app.command()
def tune(
    logs: LogArguments,
    model: ModelOption = None,
    config: ConfigOption = None,
    write: Annotated[
        bool, typer.Option("--write", help="Write the gains into the configuration; the old file is kept beside it.")
    ] = False,
    json_out: JsonOption = None,
) -> None:
    """Propose gains of the position loop from logs.

    They follow from the lags that the logs show; margins before and after are printed.
    """
    from quadctl.control.tuning import tuned
    from quadctl.flight.pilot.settings import choose_models, load_flight_settings

    path = find_configuration(config, logs[0])
    if write and is_installed(path):
        raise SettingsError(f"{path}: comes with quadctl, expected a file of yours: `quadctl init DIR` writes one")
    settings = load_flight_settings(path)
    found = _lags(logs, choose_models(settings, path, model).body.vehicle.rotor.time_constant_s)
    old, new = settings.controller, tuned(settings.controller, found)
    rows = {"old": _margins(old, found), "new": _margins(new, found)}
    _print_lags(new, found)
    console.print(_table(old, new, rows))
    if write:
        _write(path, new)
    write_json(json_out, _result(old, new, found, rows))


def _lags(logs: list[Path], rotors_s: float) -> "LagsFound":
    """The lags that the logs show; raises LogError where they do not show the attitude's."""
    import numpy as np

    from quadctl.control.tuning import LagsFound
    from quadctl.lab.tracking.attitude_response import attitude_response
    from quadctl.logs.read import read_log

    flights = [read_log(log) for log in logs]
    response = attitude_response(flights)
    if response is None:
        names = ", ".join(flight.name for flight in flights)
        raise LogError(
            f"{names}: shows no lag of the attitude, expected 15 s in the air that lean both ways, with roll_cmd_deg "
            "and pitch_cmd_deg: fly missions/excitation.yaml"
        )
    ages = [flight["telemetry_age_s"] for flight in flights if flight.has("telemetry_age_s")]
    age_s = max(0.0, float(np.nanmedian(np.concatenate(ages)))) if ages else 0.0
    return LagsFound(age_s, response, rotors_s)


def _margins(controller: "ControllerSettings", found: "LagsFound") -> dict[str, Any]:
    from quadctl.control.margins import margins
    from quadctl.control.tuning import horizontal_loop, vertical_loop

    loops = {"horizontal": horizontal_loop(controller, found), "vertical": vertical_loop(controller, found)}
    return {name: margins(*of_axis) for name, of_axis in loops.items()}


def _print_lags(controller: "ControllerSettings", found: "LagsFound") -> None:
    low, high = found.attitude.lag_interval_s or (found.attitude.lag_s,) * 2
    say(
        f"Lags: attitude {found.attitude.lag_s:.3f} s [{low:.3f}, {high:.3f}], which holds the way of the setpoint; "
        f"rotors {found.rotors_s:.3f} s; age of the state, as logged, {found.age_s:.3f} s. Gains are for "
        f"{found.horizontal_s(controller):.3f} s horizontally and {found.vertical_s:.3f} s vertically."
    )


def _table(old: "ControllerSettings", new: "ControllerSettings", rows: dict[str, dict[str, Any]]) -> Table:
    table = Table(box=None, pad_edge=False, header_style="bold")
    table.add_column("")
    for column in ("old", "new"):
        table.add_column(column, justify="right")
    for keys in GAINS:
        table.add_row(".".join(keys), f"{_value(old, keys):g}", f"{_value(new, keys):g}")
    for axis in ("horizontal", "vertical"):
        before, after = rows["old"][axis], rows["new"][axis]
        for name, said in SAID.items():
            table.add_row(f"{axis}: {name}", said(before), said(after))
    return table


def _write(path: Path, new: "ControllerSettings") -> None:
    """Write the gains into a configuration, whose old text is kept in a file beside it."""
    from quadctl.flight.pilot.settings import FlightSettings
    from quadctl.settings_text import with_numbers

    values = {("controller", *keys): _value(new, keys) for keys in GAINS}
    text = with_numbers(path, values, FlightSettings, "flight configuration")
    kept = _free_name(path)
    write_text(kept, path.read_text(encoding="utf-8"))
    write_text(path, text)
    say(f"Old gains: {kept}")
    print_saved(path)


def _free_name(path: Path) -> Path:
    """Name of a file beside `path` that does not exist: flight.yaml.before_tune, flight.yaml.before_tune2."""
    number = 1
    while (kept := path.with_name(f"{path.name}.before_tune{number if number > 1 else ''}")).exists():
        number += 1
    return kept


def _value(controller: "ControllerSettings", keys: tuple[str, ...]) -> float:
    value: Any = controller
    for key in keys:
        value = getattr(value, key)
    return float(value)


def _result(
    old: "ControllerSettings", new: "ControllerSettings", found: "LagsFound", rows: dict[str, dict[str, Any]]
) -> dict[str, Any]:
    def numbers(margins: Any) -> dict[str, Any]:
        return {name: value if abs(value) < 1e9 else None for name, value in margins._asdict().items()}

    return {
        "lags_s": {"attitude": found.attitude.lag_s, "age": found.age_s, "rotors": found.rotors_s},
        **{
            name: {
                "gains": {".".join(keys): _value(controller, keys) for keys in GAINS},
                "margins": {axis: numbers(of_axis) for axis, of_axis in rows[name].items()},
            }
            for name, controller in (("old", old), ("new", new))
        },
    }
