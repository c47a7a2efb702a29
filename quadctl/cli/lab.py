"""The commands of the lab: from logs to the effects that a model is missing."""

import shlex
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from quadctl.cli.app import app, console
from quadctl.cli.inputs import find, find_first, model_and_logs
from quadctl.cli.output import JsonOption, print_saved, say, tell, write_json
from quadctl.cli.overwriting import Reads, Writes, WritesInto
from quadctl.cli.sensors import (
    PlotOption,
    SensorsOption,
    compare_sensors,
    diagnose_sensors,
    logs_among,
    refuse_beside_sensors,
)
from quadctl.files import write_text
from quadctl.logs.formats import suffixes

if TYPE_CHECKING:
    from quadctl.lab.comparison.unseen_flights import Judgement
    from quadctl.lab.study import Study
    from quadctl.model import Model

MAX_NUMBER = 1e9
"""Largest height or time on the command line, m or s."""

PAPER_FILES = ("model.tex", "model.bib", "model.json")

ModelArgument = Annotated[
    Path,
    Reads(),
    typer.Argument(
        metavar="MODEL.yaml", help="Model file, or a vehicle file, which is a model without effects.", callback=find
    ),
]
LogArguments = Annotated[
    list[Path], Reads(), typer.Argument(metavar="LOG...", help=f"Flight logs: {', '.join(suffixes())}.")
]
ModelAndLogs = Annotated[
    list[Path],
    Reads(),
    typer.Argument(
        metavar="MODEL.yaml LOG...",
        help="Model file, or a vehicle file, which is a model without effects; then flight logs: "
        f"{', '.join(suffixes())}. With --sensors: only logs.",
        callback=find_first,
    ),
]
NewModelOption = Annotated[
    Path, Writes(), typer.Option("-o", "--output", metavar="NEW.yaml", help="The new model file.")
]
HtmlOption = Annotated[Path | None, Writes(), typer.Option("--html", metavar="OUT", help="Write a report with plots.")]
HoldOutOption = Annotated[
    str,
    typer.Option(
        "--hold-out",
        metavar="blocks|flights",
        help="What each fit leaves out to test it: blocks of 5 s, or whole flights.",
    ),
]
NestedOption = Annotated[
    bool,
    typer.Option(
        "--nested",
        help="Nested cross-validation: leave out each part of the data in turn, search in the rest, and test the "
        "effects found on the part left out; several times slower.",
    ),
]
AllOption = Annotated[
    bool, typer.Option("--all", help="Also print what was tried without a result, and what was not tried.")
]
UnseenOption = Annotated[
    list[Path] | None,
    Reads(),
    typer.Option(
        "--unseen",
        metavar="LOG",
        help="A flight that no fit uses: the error on it is computed before and after. May be repeated.",
    ),
]
RolloutsOption = Annotated[
    bool,
    typer.Option(
        "--rollouts",
        help="Also fit rotor lag, moments and thrust map to a part of the logs, and predict position, velocity, "
        "attitude and rates over the rest from the commands alone; takes a minute or more.",
    ),
]
JobsOption = Annotated[
    int,
    typer.Option("--jobs", metavar="N", min=1, help="Number of processes that read logs."),
]


@app.command()
def compare(
    files: ModelAndLogs,
    json_out: JsonOption = None,
    html: HtmlOption = None,
    sensors: SensorsOption = False,
    plot: PlotOption = None,
    rollouts: RolloutsOption = False,
) -> None:
    """Tell how wrong a model is on flights, and where.

    The error of a regression on all logged variables is printed as a reference.
    """
    if sensors:
        refuse_beside_sensors(html=html, rollouts=rollouts)
        compare_sensors(logs_among(files), json_out, plot)
        return
    model, logs = model_and_logs(files)
    study = _study(model, logs)
    result = study.compare()
    _answer(result, study, json_out)
    _report(html, comparison=result)
    if rollouts:  # a refusal of forecasts loses nothing of the comparison
        from quadctl.lab.rotation import interface
        from quadctl.lab.rotation.words import forecasts

        with console.status("forecasting the whole state"):
            unseen = interface.rollouts(study.model, logs)
        console.print(forecasts(unseen))
        write_json(json_out, result.to_dict() | {"rollouts": unseen.to_dict()})


@app.command()
def diagnose(
    files: ModelAndLogs,
    json_out: JsonOption = None,
    html: HtmlOption = None,
    hold_out: HoldOutOption = "blocks",
    nested: NestedOption = False,
    jobs: JobsOption = 1,
    expression: Annotated[
        Path | None,
        Writes(),
        typer.Option(
            "--save-expression",
            metavar="FILE.py",
            help="If the residual is unexplained and a formula for it is found: save that as an effect file.",
        ),
    ] = None,
    sensors: SensorsOption = False,
    output: Annotated[
        Path | None,
        Writes(),
        typer.Option(
            "-o", "--output", metavar="FILE", help="With --sensors: save the errors found, for `quadctl export`."
        ),
    ] = None,
    plot: PlotOption = None,
    everything: AllOption = False,
) -> None:
    """Find which physical effects are missing from a model."""
    if sensors:
        refuse_beside_sensors(all=everything, html=html, nested=nested, save_expression=expression)
        diagnose_sensors(logs_among(files), json_out, plot, output)
        return
    model, logs = model_and_logs(files)
    from joblib import parallel_config

    from quadctl.lab.symbolic.effect_file import as_effect_file

    with parallel_config("loky", n_jobs=jobs):
        study = _study(model, logs, hold_out)
        with console.status("diagnosing") as status:
            result = study.diagnose(progress=status.update, nested=nested)
    console.print(result)
    if everything:
        console.print(result.details())
    if expression is not None and result.symbolic is not None:
        write_text(expression, as_effect_file(result.symbolic, "unexplained.found"))
        print_saved(expression)
    elif expression is not None:
        say(f"No expression was found: {expression} is not written.")
    _print_notes(study)
    _point_to_verify(study, model, logs)
    write_json(json_out, result.to_dict())
    if html is not None:
        _report(html, comparison=study.compare(), diagnosis=result)


@app.command()
def suggest(
    model: ModelArgument,
    logs: LogArguments,
    missions: Annotated[
        Path,
        Reads(),
        typer.Option("--missions", metavar="DIR", help="Folder of the missions to choose from.", callback=find),
    ] = Path("missions"),
    json_out: JsonOption = None,
    hold_out: HoldOutOption = "blocks",
) -> None:
    """Suggest the mission to fly next.

    It is the one that would best answer what these logs leave open.
    """
    from quadctl.lab.comparison.wording import on_terminal
    from quadctl.lab.planning.suggestion import suggest as run

    study = _study(model, logs, hold_out)
    with console.status("diagnosing") as status:
        diagnosis = study.diagnose(progress=status.update)
        status.update("flying the missions in thought")
        result = run(diagnosis, missions)
    found = replace(diagnosis, suggested_mission=None)  # its guess is from the effects' names alone
    say(on_terminal("\n".join(found.lines())))
    _answer(result, study, json_out)


@app.command()
def add(
    effect: Annotated[
        str,
        Reads(),
        typer.Argument(
            metavar="EFFECT", help="Effect or family, e.g. rotor_drag.linear or rotor_drag; or FILE.py of your own."
        ),
    ],
    model: ModelArgument,
    logs: LogArguments,
    output: NewModelOption,
    json_out: JsonOption = None,
    html: HtmlOption = None,
    hold_out: HoldOutOption = "blocks",
    unseen: UnseenOption = None,
) -> None:
    """Add an effect to a model and fit it.

    The change of the held-out error is printed.
    """
    from quadctl.effects import choose_effect
    from quadctl.model import load_model

    loaded = load_model(model)
    kind, files = choose_effect(effect, "EFFECT", loaded.effect_files)  # a wrong name is said before the logs are read
    study = _study(replace(loaded, effect_files=files), logs, hold_out, unseen)
    result = study.add(kind)
    _answer(result, study, json_out, saved=(result.model, output))
    if html is not None:
        _report(html, comparison=study.compare(), addition=result)


@app.command()
def verify(
    model: ModelArgument,
    logs: LogArguments,
    json_out: JsonOption = None,
) -> None:
    """Tell whether a fitted model holds on new flights.

    The exit status is 1 where it does not.
    """
    from quadctl.lab.flights.dataset import load_dataset
    from quadctl.lab.verification import verify as run
    from quadctl.logs.read import read_logs
    from quadctl.logs.record.copies import without_copies
    from quadctl.model import load_model

    loaded = load_model(model)
    result = run(loaded, [load_dataset([log], loaded.vehicle) for log in without_copies(read_logs(logs))])
    console.print(result)
    write_json(json_out, result.to_dict())
    if not result.holds:
        raise typer.Exit(1)


@app.command()
def surfaces(
    model: ModelArgument,
    logs: LogArguments,
    output: NewModelOption,
    json_out: JsonOption = None,
    hold_out: HoldOutOption = "blocks",
) -> None:
    """Compare the ground effect over different surfaces.

    One weight is fitted for each surface that the flights passed over.
    """
    from quadctl.lab.surfaces import compare_surfaces

    study = _study(model, logs, hold_out)
    result = compare_surfaces(study.model, study.seen)
    _answer(result, study, json_out, saved=(result.model, output))


@app.command()
def fit(
    model: ModelArgument,
    logs: LogArguments,
    output: NewModelOption,
    json_out: JsonOption = None,
    hold_out: HoldOutOption = "blocks",
    unseen: UnseenOption = None,
) -> None:
    """Refit the parameters of a model.

    The lag of the attitude is found, too, and the change of the held-out error is printed. For a vehicle file
    only the lag is found; `discover` finds missing effects.
    """
    from quadctl.lab.tracking.attitude_response import attitude_response, with_response
    from quadctl.logs.read import read_log
    from quadctl.model import load_model, save_model

    bare, response = load_model(model), attitude_response([read_log(log) for log in logs])
    if response is not None and not bare.stack:
        if unseen:
            raise typer.BadParameter(f"--unseen judges a fit, but {model} holds no effect to fit")
        save_model(with_response(bare, response), output)
        _print_lag(response.lag_s, output)
        say(f"{model} holds no effect to fit: quadctl discover finds them.")
        print_saved(output)
        write_json(json_out, {"attitude_response": response.model_dump(mode="json")})
        return
    study = _study(model, logs, hold_out, unseen)
    result = study.refit()
    fitted = result.model if response is None else with_response(result.model, response)
    _answer(result, study, json_out, saved=(fitted, output))
    if response is not None:
        _print_lag(response.lag_s, output)


def _print_lag(lag_s: float, output: Path) -> None:
    say(f"The attitude follows its setpoint {lag_s:.2f} s later, which {output} holds in any case.")


@app.command()
def remove(
    effect: Annotated[str, typer.Argument(metavar="EFFECT", help="Name, family or variant of an effect of the model.")],
    model: ModelArgument,
    output: NewModelOption,
    logs: Annotated[
        list[Path] | None, Reads(), typer.Argument(metavar="LOG...", help="Flight logs to refit the other effects on.")
    ] = None,
    json_out: JsonOption = None,
    hold_out: HoldOutOption = "blocks",
) -> None:
    """Remove an effect from a model.

    With logs the others are refitted, and the change of the held-out error is printed.
    """
    from quadctl.lab.selection.removal import held_effect
    from quadctl.model import load_model, save_model

    if not logs:
        loaded = load_model(model)
        taken = held_effect(effect, loaded)
        save_model(loaded.without(taken), output)
        kept = "Nothing was refitted: the others keep the parameters that they had beside it."
        say(f"{taken.name} is taken out. {kept}")
        print_saved(output)
        write_json(json_out, {"removed": taken.name, "refitted": False})
        return
    held_effect(effect, load_model(model))  # a wrong name is said before the logs are read
    study = _study(model, logs, hold_out)
    result = study.remove(effect)
    _answer(result, study, json_out, saved=(result.model, output), refitted=True)


@app.command()
def discover(
    model: ModelArgument,
    logs: LogArguments,
    output: NewModelOption,
    json_out: JsonOption = None,
    html: HtmlOption = None,
    hold_out: HoldOutOption = "blocks",
    nested: NestedOption = False,
    jobs: JobsOption = 1,
    everything: AllOption = False,
    unseen: UnseenOption = None,
) -> None:
    """Find and add all missing effects in one go."""
    from joblib import parallel_config

    with parallel_config("loky", n_jobs=jobs):
        study = _study(model, logs, hold_out, unseen)
        with console.status("discovering") as status:
            result = study.discover(progress=status.update, nested=nested)
    judged = _answer(result, study, json_out, saved=(result.model, output))
    if everything:
        console.print(result.diagnosis.details())
    last = result.additions[-1] if result.additions else None
    seen = {} if judged is None else {"before_unseen": judged.before, "after": judged.after}
    _report(html, comparison=result.before, diagnosis=result.diagnosis, addition=last, **seen)


@app.command()
def report(
    model: ModelArgument,
    logs: LogArguments,
    paper: Annotated[
        Path,
        WritesInto(PAPER_FILES),
        typer.Option("--paper", metavar="DIR", help="Folder for model.tex, model.bib and model.json."),
    ],
    json_out: JsonOption = None,
    hold_out: HoldOutOption = "blocks",
) -> None:
    """Write a fitted model for a paper: LaTeX, BibTeX, JSON."""
    from quadctl.lab.paper import paper_files, state

    study = _study(model, logs, hold_out)
    statement = state(study.model, study.seen, shlex.join(["quadctl", *sys.argv[1:]]))
    _print_notes(study)
    for name, text in paper_files(statement).items():
        write_text(paper / name, text)
        print_saved(paper / name)
    write_json(json_out, statement.to_dict())


@app.command()
def metrics(
    logs: LogArguments,
    reference: Annotated[
        list[Path] | None,
        Reads(),
        typer.Option(
            "--reference", metavar="LOG", help="The same flight out of ground effect, for M_B. May be repeated."
        ),
    ] = None,
    setpoint: Annotated[
        float | None, typer.Option("--setpoint", metavar="Z", help="Constant setpoint, m, where the log has none.")
    ] = None,
    begin: Annotated[float | None, typer.Option("--from", metavar="T", help="Start of the window, s.")] = None,
    end: Annotated[float | None, typer.Option("--to", metavar="T", help="End of the window, s.")] = None,
    phase: Annotated[str | None, typer.Option("--phase", metavar="NAME", help="Mission phase to measure.")] = None,
    json_out: JsonOption = None,
) -> None:
    """Measure the tracking errors of a step.

    M_A is the integral of the error, M_B that of its difference from the error of --reference; signed and absolute.
    Also MAE and RMSE.

    The window: --from and --to; else --phase; else the phases named 'step'; else the step found in the log.
    """
    from quadctl.lab.tracking.metrics import Window
    from quadctl.lab.tracking.metrics import metrics as run
    from quadctl.lab.tracking.rendering import render
    from quadctl.logs.read import read_logs

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
    write_json(json_out, result.to_dict())


def _study(
    model: "Path | Model", logs: list[Path], hold_out: Any = "blocks", unseen: list[Path] | None = None
) -> "Study":
    """The model of a file on the flights of the logs; wrong usage of --hold-out ends as such."""
    from quadctl.lab.study import HoldOutError, Study
    from quadctl.logs.memory import give_memory_back

    try:
        study = Study.of(model, logs, hold_out, unseen or None)
    except HoldOutError as error:
        raise typer.BadParameter(str(error).replace("hold_out", "--hold-out", 1)) from None
    give_memory_back()  # the logs are as large as what is analysed
    return study


def _answer(
    result: Any, study: "Study", json_out: Path | None, saved: "tuple[Model, Path] | None" = None, **more: Any
) -> "Judgement | None":
    """Save the model of a result where it has one, print the result, the judgement of that model on unseen flights and
    the notes on its flights, and write all of it as JSON."""
    if saved is not None:
        from quadctl.model import save_model

        save_model(*saved)
    console.print(result)
    judged = None if saved is None else study.judge(result.model)
    if judged is not None:
        console.print(judged)
        more["unseen_flights"] = judged.to_dict()
    _print_notes(study)
    if saved is not None:
        print_saved(saved[1])
    write_json(json_out, {**result.to_dict(), **more})
    return judged


def _report(html: Path | None, **results: Any) -> None:
    """Write a report, where one is asked for."""
    if html is not None:
        from quadctl.lab.report.page import write_report

        write_report(html, **results)
        say(f"Report: {html}")


def _print_notes(study: "Study") -> None:
    """Print which parts of the logs were left out, and why: a result on half a file must not look like one on all."""
    for flight in study.seen.flights:
        for note in flight.notes:
            tell(f"{flight.name}: {note}")


def _point_to_verify(study: "Study", model: Path, logs: Sequence[Path]) -> None:
    """Say which command sees what has changed since the model was fitted to other flights: a diagnosis fits it anew."""
    from quadctl.lab.comparison.agreement import flights_of_the_fit

    used, new = flights_of_the_fit(study.model, study.seen.names)
    if used and new:
        say(
            f"{model} was fitted to {', '.join(used)}, and here its parameters were fitted again before anything was "
            f"called missing: whether they still hold says `quadctl verify {model} {' '.join(map(str, logs))}`."
        )
