"""The commands: parse, call, print. What they do is elsewhere."""

import json
import os
import sys
from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Annotated, Any, NoReturn

import typer
from rich.console import Console

from quadctl import __version__
from quadctl.errors import FlightError, QuadctlError

app = typer.Typer(
    name="quadctl",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)
console = Console()

MAX_NUMBER = 1e9
"""Of a height or a time on the command line, m or s."""

INTERRUPTED = 130
"""Exit status with which typer ends on Ctrl-C."""

LAB_PACKAGES = ("scipy", "joblib", "polars", "matplotlib", "jinja2", "pyulog", "mcap", "pysindy")
"""Of the extra `lab`: not on the companion computer."""

LOG_SUFFIXES = (".csv", ".ulg", ".bin", ".tlog")
"""Of flight logs: a flight cannot be flown again, so no result is ever written to such a file."""

ModelArgument = Annotated[Path, typer.Argument(metavar="MODEL.yaml", help="Model file, or a bare vehicle file.")]
LogArguments = Annotated[list[Path], typer.Argument(metavar="LOG...", help="Flight logs: .csv, .ulg, .bin, .tlog.")]
JsonOption = Annotated[Path | None, typer.Option("--json", metavar="OUT", help="Write the result as JSON.")]
HtmlOption = Annotated[Path | None, typer.Option("--html", metavar="OUT", help="Write a report with plots.")]
HoldOutOption = Annotated[
    str,
    typer.Option(
        "--hold-out",
        metavar="blocks|flights",
        help="What a fit does not see: blocks of time of every flight, or flights.",
    ),
]
JobsOption = Annotated[
    int, typer.Option("--jobs", metavar="N", min=1, help="Processes that share the work; worth it with many logs.")
]
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


def _print_version(wanted: bool) -> None:
    if wanted:
        console.print(f"quadctl {__version__}", highlight=False)
        raise typer.Exit


@app.callback()
def options(
    version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version and exit.")
    ] = False,
) -> None:
    """Fly a multirotor from a companion computer, and find out which physics its model is missing."""


@app.command()
def compare(
    model: ModelArgument,
    logs: LogArguments,
    json_out: JsonOption = None,
    html: HtmlOption = None,
) -> None:
    """How wrong is a model, where, and how small could the error be?"""
    from quadctl.lab.compare import compare as run
    from quadctl.lab.report import write_report

    _check_outputs([model, *logs], json_out, html)
    loaded, data = _model_and_data(model, logs, "blocks")
    result = run(loaded, data)
    console.print(result)
    _print_notes(data)
    _write_json(json_out, result.to_dict())
    if html is not None:
        write_report(html, comparison=result)
        console.print(f"Report: {html}")


@app.command()
def diagnose(
    model: ModelArgument,
    logs: LogArguments,
    json_out: JsonOption = None,
    html: HtmlOption = None,
    hold_out: HoldOutOption = "blocks",
    jobs: JobsOption = 1,
    expression: Annotated[
        Path | None,
        typer.Option("--save-expression", metavar="FILE.py", help="Save what is unexplained as an effect of your own."),
    ] = None,
) -> None:
    """Which physical effect is missing from a model?"""
    from joblib import parallel_config

    from quadctl.lab.compare import compare as run_compare
    from quadctl.lab.diagnose import diagnose as run
    from quadctl.lab.effect_file import as_effect_file
    from quadctl.lab.report import write_report

    _check_outputs([model, *logs], json_out, html, expression)
    with parallel_config("loky", n_jobs=jobs):
        loaded, data = _model_and_data(model, logs, hold_out)
        with console.status("diagnosing") as status:
            result = run(loaded, data, progress=status.update)
    console.print(result)
    if expression is not None and result.symbolic is not None:
        _write_text(expression, as_effect_file(result.symbolic, "unexplained.found"))
        console.print(f"Saved: {expression}", soft_wrap=True, markup=False, highlight=False)
    _print_notes(data)
    _write_json(json_out, result.to_dict())
    if html is not None:
        write_report(html, comparison=run_compare(loaded, data), diagnosis=result)
        console.print(f"Report: {html}")


@app.command()
def suggest(
    model: ModelArgument,
    logs: LogArguments,
    missions: Annotated[Path, typer.Option("--missions", metavar="DIR", help="To choose from.")] = Path("missions"),
    json_out: JsonOption = None,
    hold_out: HoldOutOption = "blocks",
) -> None:
    """Which mission would tell most about what these logs leave open?"""
    from quadctl.lab.diagnose import diagnose as run_diagnose
    from quadctl.lab.suggest import suggest as run

    _check_outputs([model, *logs], json_out)
    loaded, data = _model_and_data(model, logs, hold_out)
    with console.status("diagnosing") as status:
        diagnosis = run_diagnose(loaded, data, progress=status.update)
        status.update("flying the missions in thought")
        result = run(diagnosis, missions)
    found = replace(diagnosis, suggested_mission=None)  # its guess is from the effects' names alone
    console.print("\n".join(found.lines()), soft_wrap=True, markup=False, highlight=False)
    console.print(result)
    _print_notes(data)
    _write_json(json_out, result.to_dict())


@app.command()
def add(
    effect: Annotated[
        str,
        typer.Argument(
            metavar="EFFECT", help="Name of an effect, e.g. ground_effect.exponential, or FILE.py of your own."
        ),
    ],
    model: ModelArgument,
    logs: LogArguments,
    output: Annotated[Path, typer.Option("-o", "--output", metavar="NEW.yaml", help="The new model file.")],
    json_out: JsonOption = None,
    html: HtmlOption = None,
    hold_out: HoldOutOption = "blocks",
) -> None:
    """Add an effect to a model: fit it, and see the error on data that the fit did not see."""
    from quadctl.effects import choose_effect
    from quadctl.lab.add import add as run
    from quadctl.lab.compare import compare as run_compare
    from quadctl.lab.report import write_report
    from quadctl.model import load_model, save_model

    _check_outputs([model, *logs], output, json_out, html)
    kind, files = choose_effect(effect, "EFFECT", load_model(model).effect_files)
    loaded, data = _model_and_data(model, logs, hold_out)
    result = run(kind, replace(loaded, effect_files=files), data)
    save_model(result.model, output)
    console.print(result)
    _print_notes(data)
    _print_saved(output)
    _write_json(json_out, result.to_dict())
    if html is not None:
        write_report(html, comparison=run_compare(loaded, data), addition=result)
        console.print(f"Report: {html}")


@app.command()
def fit(
    model: ModelArgument,
    logs: LogArguments,
    output: Annotated[Path, typer.Option("-o", "--output", metavar="NEW.yaml", help="The new model file.")],
    json_out: JsonOption = None,
    hold_out: HoldOutOption = "blocks",
) -> None:
    """Refit all effects of a model, and see the error on data that the fit did not see."""
    from quadctl.lab.refit import fit as run
    from quadctl.model import save_model

    _check_outputs([model, *logs], output, json_out)
    loaded, data = _model_and_data(model, logs, hold_out)
    result = run(loaded, data)
    save_model(result.model, output)
    console.print(result)
    _print_notes(data)
    _print_saved(output)
    _write_json(json_out, result.to_dict())


@app.command()
def remove(
    effect: Annotated[str, typer.Argument(metavar="EFFECT", help="Name, family or variant of an effect of the model.")],
    model: ModelArgument,
    output: Annotated[Path, typer.Option("-o", "--output", metavar="NEW.yaml", help="The new model file.")],
    logs: Annotated[
        list[Path] | None, typer.Argument(metavar="LOG...", help="Flight logs to refit the rest on.")
    ] = None,
    json_out: JsonOption = None,
    hold_out: HoldOutOption = "blocks",
) -> None:
    """Take an effect out of a model; with logs, refit the rest and see what it costs on data the fit did not see."""
    from quadctl.lab.remove import held_effect, without
    from quadctl.lab.remove import remove as run
    from quadctl.model import load_model, save_model

    _check_outputs([model, *(logs or [])], output, json_out)
    if not logs:
        loaded = load_model(model)
        taken = held_effect(effect, loaded)
        save_model(without(taken, loaded), output)
        kept = "Nothing was refitted: the others keep the parameters that they had beside it."
        console.print(f"{taken.name} is taken out. {kept}", soft_wrap=True, markup=False, highlight=False)
        _print_saved(output)
        _write_json(json_out, {"removed": taken.name, "refitted": False})
        return
    held_effect(effect, load_model(model))  # a wrong name is said before the logs are read
    loaded, data = _model_and_data(model, logs, hold_out)
    result = run(effect, loaded, data)
    save_model(result.model, output)
    console.print(result)
    _print_notes(data)
    _print_saved(output)
    _write_json(json_out, {**result.to_dict(), "refitted": True})


@app.command()
def discover(
    model: ModelArgument,
    logs: LogArguments,
    output: Annotated[Path, typer.Option("-o", "--output", metavar="NEW.yaml", help="The model with what was found.")],
    json_out: JsonOption = None,
    html: HtmlOption = None,
    hold_out: HoldOutOption = "blocks",
    jobs: JobsOption = 1,
) -> None:
    """Compare, diagnose and add in one go, until nothing significant is missing."""
    from joblib import parallel_config

    from quadctl.lab.discover import discover as run
    from quadctl.lab.report import write_report
    from quadctl.model import save_model

    with parallel_config("loky", n_jobs=jobs):
        loaded, data = _model_and_data(model, logs, hold_out)
        with console.status("discovering") as status:
            result = run(loaded, data, progress=status.update)
    save_model(result.model, output)
    console.print(result)
    _print_saved(output)
    _write_json(json_out, result.to_dict())
    if html is not None:
        last = result.additions[-1] if result.additions else None
        write_report(html, comparison=result.before, diagnosis=result.diagnosis, addition=last)
        console.print(f"Report: {html}", soft_wrap=True, markup=False, highlight=False)


@app.command()
def metrics(
    logs: LogArguments,
    reference: Annotated[
        list[Path] | None,
        typer.Option("--reference", metavar="LOG", help="The same flight out of ground effect (may be repeated)."),
    ] = None,
    setpoint: Annotated[
        float | None, typer.Option("--setpoint", metavar="Z", help="Where the log has none, m.")
    ] = None,
    begin: Annotated[float | None, typer.Option("--from", metavar="T", help="Begin of the window, s.")] = None,
    end: Annotated[float | None, typer.Option("--to", metavar="T", help="End of the window, s.")] = None,
    phase: Annotated[str | None, typer.Option("--phase", metavar="NAME", help="Mission phase to measure.")] = None,
    json_out: JsonOption = None,
) -> None:
    """Tracking errors: M_A, M_B (signed and absolute), MAE, RMSE."""
    from quadctl.lab.metrics import Window, render
    from quadctl.lab.metrics import metrics as run
    from quadctl.logs.read import read_logs

    _check_outputs([*logs, *(reference or [])], json_out)
    for name, value in (("--setpoint", setpoint), ("--from", begin), ("--to", end)):
        if value is not None and not abs(value) < MAX_NUMBER:
            raise typer.BadParameter(
                f"{name} is {value:g}, expected a number between -{MAX_NUMBER:g} and {MAX_NUMBER:g}"
            )
    result = run(
        read_logs(logs),
        read_logs(reference or []),
        window=Window(from_s=begin, to_s=end, phase=phase),
        setpoint_m=setpoint,
    )
    console.print(render(result))
    _write_json(json_out, result.to_dict())


@app.command("logs")
def inspect_logs(
    logs: LogArguments,
    to: Annotated[str | None, typer.Option("--to", metavar="csv|parquet|mcap", help="Convert each log too.")] = None,
    output: Annotated[Path | None, typer.Option("-o", "--output", metavar="DIR", help="Where to.")] = None,
    json_out: JsonOption = None,
) -> None:
    """What is in flight logs: true update rates, gaps, clock, and whether they can be analysed."""
    from quadctl.logs.convert import convert
    from quadctl.logs.quality import quality
    from quadctl.logs.read import read_logs

    _check_outputs(logs, json_out)
    reports = []
    for log in read_logs(logs):
        reports.append(quality(log))
        console.print(reports[-1])
        if to is not None:
            console.print(f"Written: {convert(log, to, output)}", soft_wrap=True, markup=False, highlight=False)
    _write_json(json_out, {"logs": [report.to_dict() for report in reports]})


@app.command()
def simulate(
    mission: MissionArgument,
    model: ModelOption = None,
    hidden: HiddenOption = None,
    seed: SeedOption = 0,
    log_dir: LogDirOption = Path("logs"),
    config: ConfigOption = None,
    offset_up: OffsetOption = None,
    json_out: JsonOption = None,
) -> None:
    """Fly a mission in simulated time, as fast as the machine can, reproducible from a seed."""
    from quadctl.flight.session import prepare_flight

    _check_outputs([mission, config, hidden], json_out)
    plan = prepare_flight(mission, config, model, offset_up)
    _print_warnings(plan.warnings)
    _finish(_simulator().simulate(plan, log_dir, hidden, seed), json_out)


@app.command()
def fly(
    mission: MissionArgument,
    link: Annotated[
        str | None, typer.Option("--link", metavar="URL", help="udpin://..., serial:///dev/...:BAUD")
    ] = None,
    sitl: Annotated[bool, typer.Option("--sitl", help="Fly a simulated PX4 over MAVLink, in real time.")] = False,
    model: ModelOption = None,
    hidden: HiddenOption = None,
    seed: SeedOption = 0,
    log_dir: LogDirOption = Path("logs"),
    config: ConfigOption = None,
    offset_up: OffsetOption = None,
    json_out: JsonOption = None,
) -> None:
    """Fly a mission on an autopilot. Ctrl-C lands."""
    from quadctl.flight.session import fly_real_time, prepare_flight

    if sitl and link is not None:
        raise typer.BadParameter("give --link or --sitl, not both")
    if not sitl and (hidden is not None or seed):
        raise typer.BadParameter("--hidden and --seed are for the simulated autopilot: they need --sitl")
    _check_outputs([mission, config, hidden], json_out)
    plan = prepare_flight(mission, config, model, offset_up)
    _print_warnings(plan.warnings)
    if not sitl:
        _finish(fly_real_time(plan, plan.settings.link.url if link is None else link, log_dir, console), json_out)
        return
    with _simulator().mock_px4_process(plan.body.vehicle, hidden, seed) as url:
        _finish(fly_real_time(plan, url, log_dir, console), json_out)


@app.command()
def demo(
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Where logs, models and the report go.")] = Path(
        "demo"
    ),
    real_time: Annotated[bool, typer.Option(help="Include a short flight over MAVLink in real time.")] = True,
) -> None:
    """The whole circle without hardware: fly, compare, diagnose, add, fly again."""
    from quadctl.demo import run

    run(out, console, _simulator(), real_time)


def _finish(outcome: Any, json_out: Path | None) -> None:
    """Print how a flight went; exit status 1 when it was not completed."""
    console.print("\n".join(outcome.lines()), soft_wrap=True, markup=False, highlight=False)
    _write_json(json_out, asdict(outcome))
    if not outcome.completed:
        raise FlightError(f"the flight was not completed: {outcome.ended}")


def _print_warnings(warnings: Sequence[str]) -> None:
    for warning in warnings:
        console.print(f"warning: {warning}", style="yellow", soft_wrap=True, markup=False, highlight=False)


def _print_notes(dataset: Any) -> None:
    """What was left out of the logs, and why: a result on half of a file must not look like one on all of it."""
    for flight in dataset.flights:
        for note in flight.notes:
            console.print(f"{flight.name}: {note}", soft_wrap=True, markup=False, highlight=False)


def _print_saved(path: Path) -> None:
    console.print(f"Saved: {path}", soft_wrap=True, markup=False, highlight=False)


def _check_outputs(inputs: Sequence[Path | None], *outputs: Path | None) -> None:
    """Refuse an output file that would destroy something, or that cannot be one, before any work is done.

    Raises
    ------
    QuadctlError
        An output is a directory, named like a flight log, one of the inputs, or the same as another output.
    """
    taken = {os.path.realpath(path): "is read by this command" for path in inputs if path is not None}
    for path in outputs:
        if path is None:
            continue
        if path.is_dir():
            raise QuadctlError(f"{path}: is a directory, expected the name of a file to write")
        if path.suffix.lower() in LOG_SUFFIXES:
            raise QuadctlError(f"{path}: is the name of a flight log, expected another file to write the result to")
        place = os.path.realpath(path)
        if place in taken:
            raise QuadctlError(f"{path}: {taken[place]}, expected another file to write the result to")
        taken[place] = "is written by this command already"


def _write_json(path: Path | None, result: dict[str, Any]) -> None:
    if path is not None:
        _write_text(path, json.dumps(result, indent=1, allow_nan=False) + "\n")


def _write_text(path: Path, text: str) -> None:
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise QuadctlError(f"{path}: cannot be written ({error.strerror})") from None


def _simulator() -> Any:
    """The one way from the commands to the simulator."""
    import sitl.run

    return sitl.run


def _model_and_data(model: Path, logs: list[Path], hold_out: str) -> tuple[Any, Any]:
    from quadctl.lab.interface import prepare_flights
    from quadctl.model import load_model

    if hold_out not in ("blocks", "flights"):
        raise typer.BadParameter(f"--hold-out is '{hold_out}', expected blocks or flights")
    if hold_out == "flights" and len(logs) < 2:
        raise typer.BadParameter("--hold-out is flights with 1 log, expected at least 2 logs, or blocks")
    loaded = load_model(model)
    return loaded, prepare_flights(logs, loaded.vehicle, hold_out)  # type: ignore[arg-type]


def main() -> NoReturn:
    """Entry point: errors that the user can mend are one sentence and exit status 1."""
    try:
        app()
    except QuadctlError as error:
        _fail(str(error), 1)
    except ModuleNotFoundError as error:
        if error.name is None or error.name.partition(".")[0] not in LAB_PACKAGES:
            raise
        _fail(f"this command needs {error.name}, which the lean install leaves out: pip install 'quadctl[lab]'", 1)
    except MemoryError:
        _fail("there is not enough memory for a file of this size", 1)
    except OSError as error:
        # Whoever opens a file says which one; what is left is the output, such as a full disk behind `> file`.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        _fail(f"{error.filename or 'the output'}: {error.strerror or error}", 1)
    except SystemExit as ended:
        if ended.code == INTERRUPTED:
            _fail("interrupted", 1)
        raise
    sys.exit(0)


def _fail(sentence: str, status: int) -> NoReturn:
    Console(stderr=True, soft_wrap=True, markup=False, highlight=False).print(f"quadctl: {sentence}")
    sys.exit(status)
