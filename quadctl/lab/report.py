"""The lab's results as one page that a person reads from top to bottom: sentences, figures, tables, nothing external.

Every section is a function from the results to a `Section`; the template only sets them. All text passes through the
template's escaping, and the figures carry their text as escaped SVG.
"""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from importlib.resources import files
from pathlib import Path
from typing import NamedTuple

import numpy as np
from jinja2 import Environment, StrictUndefined
from markupsafe import Markup
from matplotlib.figure import Figure as Drawing

from quadctl import __version__
from quadctl.effects import Effect
from quadctl.effects.ground_effect import NearGround
from quadctl.errors import LogError, SettingsError
from quadctl.frames import GRAVITY_M_S2
from quadctl.lab import plots
from quadctl.lab.add import Addition
from quadctl.lab.arrays import Floats
from quadctl.lab.candidate import MATERIAL, SIGNIFICANT, Candidate
from quadctl.lab.compare import Comparison
from quadctl.lab.data import AXES, FOLDS, Dataset, predict, rmse
from quadctl.lab.diagnose import Diagnosis
from quadctl.lab.flight import VARIABLE_NAMES, VARIABLE_UNITS, Flight
from quadctl.lab.locate import Failure
from quadctl.lab.metrics import FlightMetrics, MetricsTable, Tracking, Window, tracking
from quadctl.lab.openloop import OpenLoop, open_loop, open_loop_in_words
from quadctl.lab.prepare import BLOCK_S
from quadctl.lab.resample import drop_interval, resampled_means
from quadctl.logs.flight_log import FlightLog

SHOWN_FLIGHTS, SHOWN_PANELS, SHOWN_FAILURES, SHOWN_CANDIDATES = 2, 6, 12, 8
UNIT = "m/s²"


@dataclass(frozen=True, eq=False)
class StepResponses:
    """Step responses flown with different compensators; the first is the one that the others are compared with."""

    tracks: dict[str, Tracking]
    """By the name that the page gives them, in the order of the table's flights, reference flights last."""
    table: MetricsTable

    @property
    def flown(self) -> dict[str, FlightMetrics]:
        """Metrics of all flights that are no reference flights, by name."""
        pairs = zip(self.tracks, self.table.flights, strict=True)
        return {name: flight for name, flight in pairs if not flight.is_reference}

    @property
    def on_one_reference(self) -> dict[str, Tracking]:
        """All tracks, those flown elsewhere (out of ground effect) shifted to the reference of the first."""
        first = next(iter(self.tracks.values()))
        shown = {}
        for name, track in self.tracks.items():
            reference = np.interp(track.time_s, first.time_s, first.reference_m)
            shown[name] = replace(track, reference_m=reference, position_m=reference + track.error_m)
        return shown


def step_responses(logs: Mapping[str, FlightLog], table: MetricsTable, window: Window | None = None) -> StepResponses:
    """Step responses by name, with their metrics; `logs` in the order of the table's flights, over the same window.

    Raises
    ------
    LogError
        The logs are not those of the table, or one lacks the window.
    """
    names = [log.name for log in logs.values()]
    expected = [flight.flight for flight in table.flights]
    if names != expected:
        raise LogError(f"the step responses are {', '.join(names)}, expected those measured: {', '.join(expected)}")
    tracks = {_stem(name): tracking(log, window or Window(), table.axis) for name, log in logs.items()}
    return StepResponses(tracks, table)


def write_report(
    path: Path,
    *,
    comparison: Comparison,
    diagnosis: Diagnosis | None = None,
    addition: Addition | None = None,
    before_unseen: Comparison | None = None,
    after: Comparison | None = None,
    steps: StepResponses | None = None,
) -> None:
    """Write the page to `path`, whole or not at all.

    Parameters
    ----------
    after
        The improved model on flights that no fit has seen.
    before_unseen
        The model of `comparison` on the same flights; it is worked out where it is not given.

    Raises
    ------
    SettingsError
        `path` cannot be written.
    """
    text = render_report(Results(comparison, diagnosis, addition, before_unseen, after, steps))
    temporary = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        temporary.write_text(text, encoding="utf-8")
        temporary.replace(path)
    except OSError as error:
        raise SettingsError(f"{path}: the report cannot be written ({error.strerror}), expected a file name") from None
    finally:
        _remove(temporary)


def _remove(temporary: Path) -> None:
    try:
        temporary.unlink(missing_ok=True)
    except OSError:  # its folder is a file, or gone: then so is this
        return


class Results(NamedTuple):
    """What a page is made from."""

    comparison: Comparison
    diagnosis: Diagnosis | None = None
    addition: Addition | None = None
    before_unseen: Comparison | None = None
    after: Comparison | None = None
    steps: StepResponses | None = None


def render_report(results: Results) -> str:
    """The page as HTML."""
    sections = [section for make in _SECTIONS if (section := make(results)) is not None]
    template = files("quadctl.lab").joinpath("report.html.j2").read_text(encoding="utf-8")
    environment = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    return environment.from_string(template).render(
        model=results.comparison.model.name,
        vehicle=results.comparison.model.vehicle.name,
        headline=_headline(results),
        sections=sections,
        software=f"quadctl {__version__}",
        written=f"{datetime.now(UTC):%Y-%m-%d %H:%M} UTC",
    )


# --- what a page consists of ------------------------------------------------------------------------------------------


class Cell(NamedTuple):
    """One cell of a table, with smaller text below it where there is some."""

    text: str
    note: str = ""


@dataclass(frozen=True)
class Table:
    """Columns after the first `words` hold numbers."""

    head: list[str]
    rows: list[list[Cell]]
    words: int = 1
    marked: frozenset[int] = frozenset()
    """Rows that stand out."""


@dataclass(frozen=True)
class Figure:
    """SVG for a screen, and for a telephone where the same would be too small."""

    svg: Markup
    caption: str
    narrow: Markup | None = None
    whole_width: bool = False


@dataclass(frozen=True)
class Section:
    """Sentences first, then figures, lists, and tables."""

    anchor: str
    title: str
    text: list[str]
    figures: list[Figure] = field(default_factory=list)
    points: list[str] = field(default_factory=list)
    tables: list[Table] = field(default_factory=list)
    after_text: list[str] = field(default_factory=list)


class Tile(NamedTuple):
    """One number at the top of the page."""

    value: str
    name: str


@dataclass(frozen=True)
class Headline:
    """The number that matters, and what it means."""

    before: str
    after: str
    change: str
    what: str
    sentences: list[str]
    tiles: list[Tile]


# --- the headline -----------------------------------------------------------------------------------------------------


def _headline(r: Results) -> Headline:
    before, after, what = _main_number(r)
    change = "" if after is None else _change(1.0 - after / before)
    return Headline(
        before=number(before),
        after="" if after is None else number(after),
        change=change,
        what=what,
        sentences=[*_verdict(r), *_what_is_left(r)],
        tiles=_tiles(r),
    )


def _main_number(r: Results) -> tuple[float, float | None, str]:
    """Error before, after, and on which data: the strictest there is."""
    if r.after is not None:
        flights = _flights_in_words(r.after.dataset.names)
        return _unseen_before(r)["total"], r.after.rmse["total"], f"on {flights}, which no fit has seen"
    if r.diagnosis is not None and len(r.diagnosis.steps) > 1:
        steps = r.diagnosis.steps
        return steps[0].rmse["total"], steps[-1].rmse["total"], f"on {_held_out(r.diagnosis.dataset)}"
    if r.addition is not None:
        a = r.addition
        return a.before["total"], a.after["total"], f"on {_held_out(a.dataset)}"
    return r.comparison.rmse["total"], None, f"on {_flights_in_words(r.comparison.dataset.names)}"


def _verdict(r: Results) -> list[str]:
    name = r.comparison.model.name
    if r.diagnosis is not None:
        if r.diagnosis.verdict == "none":
            return [f"Nothing significant is missing from {name}: what is left is noise."]
        if r.diagnosis.verdict == "unexplained":
            return [f"Something is missing from {name}, and no effect of the catalogue explains it."]
        return [f"Missing from {name}: {_listed([_plain(f) for f in r.diagnosis.missing])}."]
    if r.addition is not None:
        added = r.addition.added.name
        if r.addition.conclusion:
            return [f"{added} does not help on unseen data: it is better left out."]
        return [f"{added} takes {_percent(r.addition.held_out_drop)} off the error on unseen data."]
    if not r.comparison.fails_where:
        return [f"{name} fails nowhere beyond the noise."]
    return [f"{_failure_in_words(_most_telling(r.comparison)[0])}."]


def _what_is_left(r: Results) -> list[str]:
    if r.after is not None:
        old, new = _unseen_residuals(r)
        low, high = drop_interval(old, new, r.after.dataset.block)
        floor = r.after.noise_floor["total"]
        return [
            f"The error on the unseen data falls by {_percent(1.0 - _total(new) / _total(old))} "
            f"(95% interval {_percent(low)} to {_percent(high)}).",
            f"What is left is {r.after.rmse['total'] / floor:.2f} times the noise floor of {quantity(floor)}.",
        ]
    floor = r.comparison.noise_floor["total"]
    if r.diagnosis is not None and r.diagnosis.verdict == "missing":
        left = r.diagnosis.steps[-1].rmse["total"]
        return [f"With all of it in, what is left is {left / floor:.2f} times the noise floor of {quantity(floor)}."]
    low, high = rmse_interval(r.comparison.residual, r.comparison.dataset)
    return [
        f"The model's error is {quantity(r.comparison.rmse['total'])} (95% interval {low:.3g} to {high:.3g}); "
        f"no model of the logged variables would get far below {quantity(floor)}, the noise floor."
    ]


def _tiles(r: Results) -> list[Tile]:
    c = r.comparison
    tiles = [
        Tile(quantity(c.rmse["total"]), f"error of {c.model.name} on the flights analysed"),
        Tile(quantity(c.noise_floor["total"]), "noise floor of the same flights"),
    ]
    if c.explained > 0.0:
        tiles.append(Tile(_percent(c.explained), f"of the acceleration's variance is predicted by {c.model.name}"))
    if r.steps is not None and (pair := _first_and_last(r.steps)) is not None:
        (_, first), (_, last) = pair
        if first.m_b_absolute and last.m_b_absolute is not None:
            change = _change(1.0 - last.m_b_absolute / first.m_b_absolute)
            tiles.append(Tile(change, "M_B (absolute) of the step response, compensated"))
    return tiles


# --- sections ---------------------------------------------------------------------------------------------------------


def _flights(r: Results) -> Section:
    dataset = r.comparison.dataset
    widths = sorted({f"{flight.bandwidth_hz:.2g}" for flight in dataset.flights})
    duration = sum(_duration_s(flight) for flight in dataset.flights)
    text = [
        f"{_count(len(dataset.flights), 'flight')} with {duration:.0f} s in the air and {len(dataset.measured)} "
        f"nearly independent samples, filtered to {_listed(widths)} Hz: what the slowest logged channel can carry. "
        "Measured and predicted acceleration have gone through the same filter.",
        f"Held-out errors below are on {_held_out(dataset)}. The rotor delay is how much later the rotor signal is "
        "logged than the force it makes; it is taken out. Below the table: what was left out of the logs, and why.",
    ]
    rows = [[Cell(f.name), *_flight_cells(f)] for f in dataset.flights]
    if r.after is not None:
        rows += [[Cell(f.name, "unseen: no fit has used it"), *_flight_cells(f)] for f in r.after.dataset.flights]
    head = ["flight", "thrust from", "in the air / s", "samples", "bandwidth / Hz", "rotor delay / ms"]
    shown = [*dataset.flights, *(r.after.dataset.flights if r.after else ())]
    return Section(
        anchor="flights",
        title="The flights",
        text=text,
        tables=[Table([*head, "rotor height / m"], rows, words=2)],
        points=[f"{flight.name}: {note}." for flight in shown for note in flight.notes],
    )


def _flight_cells(flight: Flight) -> list[Cell]:
    height = flight.filtered(flight.conditions.height_m)
    return [
        Cell(flight.thrust_source),
        Cell(f"{_duration_s(flight):.0f}"),
        Cell(f"{len(flight.time_s)}"),
        Cell(f"{flight.bandwidth_hz:.2f}"),
        Cell(f"{1000.0 * flight.delay_s:.0f}".replace("-", "\u2212")),
        Cell(f"{height.min():.2f} to {height.max():.2f}"),
    ]


def _over_time(r: Results) -> Section:
    c = r.comparison
    worst = max(AXES, key=lambda axis: c.rmse[axis])
    low, high = rmse_interval(c.residual, c.dataset)
    text = [
        f"Where the coloured line leaves the black one, {c.model.name} is wrong: by {quantity(c.rmse['total'])} on the "
        f"whole (RMSE over all axes, 95% interval {low:.3g} to {high:.3g}), most on the {worst} axis "
        f"({quantity(c.rmse[worst])}).",
        f"{_variance_in_words(c)} The noise floor is {quantity(c.noise_floor['total'])}: "
        "less than that is chance, or something that the log does not hold.",
    ]
    return Section("over-time", "Measured against predicted", text, _time_figures(c, {c.model.name: c}, "seen"))


def _time_figures(c: Comparison, models: Mapping[str, Comparison], name: str) -> list[Figure]:
    """The flights with the largest errors, in the order of the dataset."""
    index = c.dataset.flight_index
    errors = [_total(c.residual[index == i]) for i in range(len(c.dataset.flights))]
    chosen = sorted(np.argsort(errors)[::-1][:SHOWN_FLIGHTS].tolist())
    others = len(errors) - len(chosen)
    figures = []
    for i in chosen:
        flight = c.dataset.flights[i]
        predicted = {label: predict(comparison.model, flight) for label, comparison in models.items()}
        more = f" The other {_count(others, 'flight')} have smaller errors." if others and i == chosen[-1] else ""
        caption = f"{flight.name}: acceleration north, east, up and height of the rotors.{more}"
        figures.append(
            _both_widths(
                f"{name}-{i}",
                caption,
                plots.acceleration_over_time(flight, flight.measured, predicted),
                plots.acceleration_over_time(flight, flight.measured, predicted, plots.NARROW_PX),
            )
        )
    return figures


def _open_loop(r: Results) -> Section | None:
    c = r.comparison
    if not c.open_loop:
        return None
    told = c.open_loop[min(1, len(c.open_loop) - 1)]
    text = [
        open_loop_in_words(told),
        "A simulation with the model is started at many instants of the flights and driven by the logged attitude and "
        "rotor speeds alone; height, velocity and every effect of them are its own. The brackets and error bars are "
        "95% intervals. To beat is the grey line: no model at all, only the velocity at the start.",
    ]
    names = _flights_in_words(c.dataset.names)
    figures = [_figure(plots.open_loop_errors({c.model.name: c.open_loop}), "open-loop", f"Flights analysed: {names}.")]
    rows = _open_loop_rows(c.model.name, c.open_loop)
    if r.after is not None and r.after.open_loop:
        unseen = r.before_unseen.open_loop if r.before_unseen is not None else open_loop(c.model, r.after.dataset)
        models = {"before": unseen, "after": r.after.open_loop}
        names = _flights_in_words(r.after.dataset.names)
        figures.append(_figure(plots.open_loop_errors(models), "open-loop-unseen", f"Unseen data: {names}."))
        for name, errors in models.items():
            rows += _open_loop_rows(f"{name}, unseen data", errors)
    head = ["model", "after", "horizontal / m", "up / m", "position / m", "velocity / m/s", "velocity held / m"]
    return Section(
        "open-loop", "Simulated for seconds: open-loop prediction", text, figures, tables=[Table(head, rows, words=2)]
    )


def _open_loop_rows(name: str, by_horizon: Sequence[OpenLoop]) -> list[list[Cell]]:
    return [
        [
            Cell(name),
            Cell(f"{e.horizon_s:g} s"),
            *(Cell(e.position[part].in_words()) for part in ("horizontal", "up", "total")),
            Cell(e.velocity["total"].in_words()),
            Cell(e.held_position["total"].in_words()),
        ]
        for e in by_horizon
    ]


def _over_variables(r: Results) -> Section:
    c = r.comparison
    telling = [p for p in c.profiles if p.share > MATERIAL and p.p_value < SIGNIFICANT]
    shown = (telling or c.profiles[:2])[:SHOWN_PANELS]
    text = [
        "Dots are means over equal numbers of samples with their 95% error bars (autocorrelation included); grey is "
        "every sample. A model that lacks nothing has all dots on the zero line. The most telling variables come first."
    ]
    if shown:
        best = shown[0]
        text.append(
            f"The {best.axis} residual goes with {VARIABLE_NAMES[best.variable]} most: its means hold "
            f"{_percent(best.share)} of that axis' error power (p {plots.p_in_words(best.p_value)} "
            "that they differ by chance)."
        )
    figures = [
        _figure(
            plots.residual_over_variable(c, profile),
            f"profile-{i}",
            f"{_sentence(profile.axis)} over {VARIABLE_NAMES[profile.variable]}: {_percent(profile.share)} of the "
            f"axis' error power, p {plots.p_in_words(profile.p_value)}.",
        )
        for i, profile in enumerate(shown)
    ]
    return Section("variables", "The residual against the variables that matter", text, figures)


def _where_it_fails(r: Results) -> Section:
    c = r.comparison
    title = "Where the model fails"
    if not c.fails_where:
        return Section("fails", title, [f"{c.model.name} fails nowhere beyond the noise."])
    shown = _most_telling(c)[:SHOWN_FAILURES]
    rows = [
        [
            Cell(_failure_in_words(f)),
            Cell(_plus(f.mean_residual)),
            Cell(f"{abs(f.sigma):.0f}"),
            Cell(str(f.n)),
        ]
        for f in shown
    ]
    text = [
        f"{_count(len(c.fails_where), 'range')} in which the residual's mean is off by more than its noise explains; "
        f"on the up axis, thrust is a share of the weight (1% is {0.01 * GRAVITY_M_S2:.2f} {UNIT}). "
        "Ranges of different variables may well be the same thing seen from two sides. Those that hold most of the "
        "squared error come first."
    ]
    more = len(c.fails_where) - len(shown)
    return Section(
        "fails",
        title,
        text,
        tables=[Table(["where and how", f"mean residual / {UNIT}", "sigma", "samples"], rows)],
        after_text=[f"{_count(more, 'range')} more, all less telling, are in the JSON output."] if more else [],
    )


def _most_telling(c: Comparison) -> list[Failure]:
    """Ranges that hold most of the squared error first."""
    return sorted(c.fails_where, key=lambda failure: -failure.n * failure.mean_residual**2)


def _failure_in_words(failure: Failure) -> str:
    return _sentence(failure.text).replace("m/s^2", UNIT)


def _missing(r: Results) -> Section | None:
    d = r.diagnosis
    if d is None:
        return None
    floor = r.comparison.noise_floor["total"]
    figures = []
    if d.ranking:
        figures.append(
            _figure(
                plots.ranking(d, floor),
                "ranking",
                "Error drop on held-out parts of the flights analysed: what is missing, each on top of those before "
                "it, then the rest on top of what was found. Dark blue: missing; light blue: did well too, but is not "
                "needed; grey: not supported.",
            )
        )
    if len(d.steps) > 1:
        caption = "The error ladder: held-out error of the model as it is, then with each family added, all refitted."
        figures.append(_figure(plots.ladder(d, floor), "ladder", caption))
    tables = [_verdict_table(d)]
    if d.ranking:
        tables.append(_ranking_table(d))
    return Section(
        "missing", "What is missing", _diagnosis_text(d, floor), figures, tables=tables, after_text=_look_alikes(d)
    )


def _diagnosis_text(d: Diagnosis, floor: float) -> list[str]:
    tried = _count(len(d.ranking), "effect")
    text = [
        f"{tried} of the catalogue were fitted on top of {d.model.name}, each judged on {_held_out(d.dataset)}. "
        "p counts autocorrelation and the number of candidates tried."
    ]
    if d.verdict == "missing":
        first, last = d.steps[0].rmse["total"], d.steps[-1].rmse["total"]
        them = "it" if len(d.steps) == 2 else "them"
        families = _listed([f"{_plain(step.family)} ({step.effect})" for step in d.steps[1:]])
        text.append(
            f"Missing, in the order of adding: {families}. With {them} in, the held-out error goes "
            f"from {quantity(first)} to {quantity(last)}, {_percent(1.0 - last / first)} less; the noise floor is "
            f"{quantity(floor)}."
        )
        if d.unexplained:
            text.append("Even so, something is left that the logged variables explain and these effects do not.")
    elif d.verdict == "none":
        text.append("No effect earns its place on unseen data: nothing significant is missing, what is left is noise.")
    else:
        text.append(
            "No effect earns its place on unseen data, yet the logged variables explain part of what is left: "
            "something is there that the catalogue does not hold."
        )
    return text


def _verdict_table(d: Diagnosis) -> Table:
    finding = f"yes: {_listed([step.effect for step in d.steps[1:]])}" if d.missing else "no effect does"
    explained = "explain a part that matters" if d.unexplained else "explain nothing that matters"
    left = f"the variables {explained} of what {'these leave' if d.missing else 'the model leaves'}"
    test = f"an effect has p < {SIGNIFICANT:g} and takes more than {MATERIAL:.0%} off one axis, on unseen data"
    rows = {
        "missing": [Cell("missing", test), Cell(finding)],
        "none": [Cell("none", "no effect does, and the logged variables explain nothing of what is left"), Cell(left)],
        "unexplained": [
            Cell("unexplained", "no effect does, yet the variables explain some of what is left"),
            Cell(left),
        ],
    }
    marked = frozenset({list(rows).index(d.verdict)})
    return Table(["possible verdict", "what these data say"], list(rows.values()), words=2, marked=marked)


def _ranking_table(d: Diagnosis) -> Table:
    shown = [c for i, c in enumerate(d.ranking) if i < SHOWN_CANDIDATES or c.supported]
    first_of_family = {c.family: c for c in reversed(shown)}
    rows = [
        [
            Cell(c.effect.name, _candidate_note(c, with_physics=c is first_of_family[c.family])),
            Cell(_parameters(c.effect, c.ci95)),
            Cell(f"{number(c.before['total'])} → {number(c.after['total'])}"),
            Cell(_change(c.held_out_drop)),
            Cell(plots.p_in_words(c.p_value)),
        ]
        for c in shown
    ]
    marked = frozenset(i for i, c in enumerate(shown) if c.effect.name in plots.chosen(d))
    head = ["effect", "parameters [95% interval]", f"held-out error / {UNIT}", "change", "p"]
    return Table(head, rows, words=2, marked=marked)


def _candidate_note(c: Candidate, with_physics: bool) -> str:
    said = [c.effect.physics] if with_physics else []
    return " ".join([*said, *(f"Note: {remark}." for remark in c.remarks)])


def _look_alikes(d: Diagnosis) -> list[str]:
    by_family = {c.family: c.effect for c in reversed(d.ranking)}
    text = []
    for pair in d.confounded:
        known = [by_family[family] for family in pair if family in by_family]
        how = "; ".join(f"{_plain(effect.family())} is told by {effect.told_apart_by}" for effect in known)
        text.append(
            f"Look-alikes: these data cannot tell {' from '.join(_plain(family) for family in pair)}"
            + (f" ({how})." if how else ".")
        )
    if not d.confounded and d.verdict == "missing":
        text.append("Look-alikes: none; no other effect did as well as those found.")
    if d.suggested_mission:
        text.append(f"To tell more, fly {d.suggested_mission}.")
    return text


def _before_and_after(r: Results) -> Section | None:
    figures, text = [], []
    for name, (what, dataset, before, after) in _held_out_results(r).items():
        change = _change(1.0 - after["total"] / before["total"])
        text.append(
            f"On {_held_out(dataset)}, the error goes from {quantity(before['total'])} to {quantity(after['total'])} "
            f"({change}) with {what} in."
        )
        floor = r.comparison.noise_floor if dataset.names == r.comparison.dataset.names else None
        caption = f"The flights of the fit, held-out parts: without and with {what}."
        figures.append(_figure(plots.before_after(before, after, floor), name, caption))
    if r.after is not None:
        old, new = _unseen_residuals(r)
        low, high = drop_interval(old, new, r.after.dataset.block)
        flights = _flights_in_words(r.after.dataset.names)
        before = _unseen_before(r)
        text.append(
            f"On {flights}, which no fit has seen, the error goes from {quantity(before['total'])} to "
            f"{quantity(r.after.rmse['total'])}: {_percent(1.0 - r.after.rmse['total'] / before['total'])} less "
            f"(95% interval {_percent(low)} to {_percent(high)})."
        )
        places = len(r.after.fails_where)
        text.append(
            f"There the improved model still fails in {_count(places, 'range')}. "
            f"{_failure_in_words(_most_telling(r.after)[0])}."
            if places
            else "There the improved model fails nowhere beyond the noise."
        )
        figures.append(
            _figure(
                plots.before_after(before, r.after.rmse, r.after.noise_floor), "unseen-bars", f"Unseen data: {flights}."
            )
        )
        improved = {"before": r.comparison, "after": r.after}
        figures += _time_figures(r.after, improved, "unseen")
    if not figures:
        return None
    return Section("before-after", "Error before and after, on data that the fit has not seen", text, figures)


class _HeldOut(NamedTuple):
    what: str
    dataset: Dataset
    before: dict[str, float]
    after: dict[str, float]


def _held_out_results(r: Results) -> dict[str, _HeldOut]:
    """All that was found missing, and what was added last where that is only a part of it."""
    found = {}
    d, a = r.diagnosis, r.addition
    if d is not None and len(d.steps) > 1:
        what = _listed([step.effect for step in d.steps[1:]])
        found["found"] = _HeldOut(what, d.dataset, d.steps[0].rmse, d.steps[-1].rmse)
    if a is not None and (not found or a.model.effects[-1].name != found["found"].what):
        found["added"] = _HeldOut(a.model.effects[-1].name, a.dataset, a.before, a.after)
    return found


def _fitted_effects(r: Results) -> Section | None:
    a = r.addition
    if a is None:
        return None
    text, figures, rows = [], [], []
    order = list(range(len(a.model.stack)))[::-1]  # what was added last is what the page is about
    for index in order:
        item = a.model.stack[index]
        ci95 = item.fitted.ci95 if item.fitted else {}
        rows.append([Cell(item.effect.name, item.effect.source), Cell(_parameters(item.effect, ci95))])
        if isinstance(item.effect, NearGround):
            sentences, figure = _ground_effect(a, index)
            text += sentences
            figures.append(figure)
        else:
            figures += _other_effect(a, index)
    figures.sort(key=lambda figure: not figure.whole_width)
    if any(not isinstance(effect, NearGround) for effect in a.model.effects):
        text.append(
            "For effects that are not a ratio over height: the residual without the effect, with it, and what it adds "
            "(band: 95% of its parameters' bootstrap draws); forward and right are those of the vehicle's heading."
        )
    return Section(
        "effects",
        "The fitted effect" if len(order) == 1 else "The fitted effects",
        text,
        figures,
        points=[f"Note: {remark}." for remark in a.remarks],
        tables=[Table(["effect", "parameters [95% interval]"], rows, words=2)],
    )


def _ground_effect(a: Addition, index: int) -> tuple[list[str], Figure]:
    curve = plots.ratio_curve(a, index)
    lowest = max(curve.data_range[0], float(curve.height_over_radius[0]))
    ratio, low, high = (
        float(np.interp(lowest, curve.height_over_radius, y)) for y in (curve.ratio, curve.low, curve.high)
    )
    sure = f"95% interval {low:.3f} to {high:.3f}" if high > low else "the form has no free parameter"
    text = [
        f"At the lowest height flown, {lowest:.2f} rotor radii, the rotors give {ratio:.3f} times the thrust they give "
        f"far from the ground ({sure}).",
        "Dots are the measured thrust over what the model without this effect predicts: no form was assumed for them, "
        "so where they leave the curve, the fitted form is wrong.",
    ]
    name = a.model.effects[index].name
    figure = _both_widths(
        f"ratio-{index}",
        f"{name}: thrust ratio over height, with textbook curves for comparison; the shaded heights were flown.",
        plots.thrust_ratio(a, index),
        plots.thrust_ratio(a, index, plots.NARROW_PX),
    )
    return text, figure


def _other_effect(a: Addition, index: int) -> list[Figure]:
    name = a.model.effects[index].name
    return [
        _figure(
            plots.effect_over_variable(curve),
            f"effect-{index}-{i}",
            f"{name}: {curve.component} residual over {VARIABLE_NAMES[curve.variable]} "
            f"({VARIABLE_UNITS[curve.variable]}).",
        )
        for i, curve in enumerate(plots.effect_curves(a, index))
    ]


def _step_section(r: Results) -> Section | None:
    steps = r.steps
    if steps is None:
        return None
    tracks = steps.on_one_reference
    figures = [
        _figure(plots.step_heights(tracks), "steps", "Height over time; flights at other heights are shifted."),
        _figure(plots.step_tail(tracks), "steps-tail", "The same, about the reference: what the ground does."),
    ]
    note = "Flights out of ground effect are shifted to the same reference. " if len(tracks) > len(steps.flown) else ""
    explained = (
        f"{note}M_A is the integral of the tracking error, M_B of what differs from the flight out of ground effect; "
        "signed, too high at one time pays for too low at another (as in the published tables); absolute, nothing "
        f"cancels. Measured over the {steps.table.window}."
    )
    return Section(
        "steps",
        "Flown again: step responses",
        [*_steps_in_words(steps), explained],
        figures,
        tables=[_metrics_table(steps)],
        after_text=[f"{_sentence(note)}." for note in steps.table.notes],
    )


def _steps_in_words(steps: StepResponses) -> list[str]:
    pair = _first_and_last(steps)
    if pair is None:
        return []
    (first_name, first), (last_name, last) = pair
    text = []
    if first.m_b_absolute and first.m_b_signed and last.m_b_absolute is not None and last.m_b_signed is not None:
        absolute = _change(1.0 - last.m_b_absolute / first.m_b_absolute)
        signed = _change(1.0 - abs(last.m_b_signed) / abs(first.m_b_signed))
        text.append(
            f"From compensator '{first_name}' to '{last_name}', what the ground does to the flight (M_B) goes from "
            f"{first.m_b_absolute:.3f} to {last.m_b_absolute:.3f} m s in the absolute integral ({absolute}) and from "
            f"{_plus(first.m_b_signed)} to {_plus(last.m_b_signed)} m s in the signed one ({signed} in size)."
        )
    text.append(
        f"The tracking error goes from {1000.0 * first.rmse_m:.1f} to {1000.0 * last.rmse_m:.1f} mm (RMSE); that "
        "includes the step itself, which no compensator makes shorter."
    )
    return text


def _metrics_table(steps: StepResponses) -> Table:
    columns = {
        "M_A signed / m s": "m_a_signed",
        "M_A absolute / m s": "m_a_absolute",
        "M_B signed / m s": "m_b_signed",
        "M_B absolute / m s": "m_b_absolute",
        "MAE / m": "mae_m",
        "RMSE / m": "rmse_m",
        "largest error / m": "max_error_m",
    }
    signed = ("m_a_signed", "m_b_signed", "max_error_m")
    rows = []
    for name, flight in zip(steps.tracks, steps.table.flights, strict=True):
        cells = []
        for value in columns.values():
            v = getattr(flight, value)
            cells.append(Cell("none" if v is None else _plus(v) if value in signed else f"{v:.3f}"))
        rows.append([Cell(name, f"{flight.flight}{' (reference flight)' if flight.is_reference else ''}"), *cells])
    unbroken = [name.replace("/ ", "/\u00a0").replace("m s", "m\u00a0s") for name in columns]
    return Table(["compensator", *unbroken], rows)


_SECTIONS = (
    _flights,
    _over_time,
    _open_loop,
    _over_variables,
    _where_it_fails,
    _missing,
    _before_and_after,
    _fitted_effects,
    _step_section,
)


# --- numbers ----------------------------------------------------------------------------------------------------------


def rmse_interval(residual: Floats, dataset: Dataset) -> tuple[float, float]:
    """95% interval of the total RMSE, from resampled blocks of time."""
    means = resampled_means(np.sum(residual**2, axis=1, keepdims=True), dataset.block)
    low, high = np.percentile(np.sqrt(means), [2.5, 97.5])
    return float(low), float(high)


def _unseen_residuals(r: Results) -> tuple[Floats, Floats]:
    """Of the model as it was and as it is now, on the flights of `after`."""
    if r.after is None:
        raise LogError("no unseen flights are given, expected the comparison of the improved model on some")
    if r.before_unseen is not None:
        return r.before_unseen.residual, r.after.residual
    return r.after.dataset.residual(r.comparison.model), r.after.residual


def _unseen_before(r: Results) -> dict[str, float]:
    return rmse(_unseen_residuals(r)[0])


def _total(residual: Floats) -> float:
    return float(np.sqrt(np.mean(np.sum(residual**2, axis=1))))


def _duration_s(flight: Flight) -> float:
    """In the air, gaps left out: every sample stands for one sampling step."""
    return float(len(flight.time_s) * np.median(np.diff(flight.time_s)))


def _first_and_last(steps: StepResponses) -> tuple[tuple[str, FlightMetrics], tuple[str, FlightMetrics]] | None:
    flown = list(steps.flown.items())
    return (flown[0], flown[-1]) if len(flown) > 1 else None


# --- words ------------------------------------------------------------------------------------------------------------


def number(value: float) -> str:
    """Three significant digits."""
    return f"{value:#.3g}".removesuffix(".")


def quantity(value: float) -> str:
    """An acceleration with its unit."""
    return f"{number(value)} {UNIT}"


def _percent(share: float) -> str:
    return f"{share:.0%}".replace("-", "\u2212")


def _change(drop: float) -> str:
    """`-63%`, with a true minus sign, for a drop of 0.63."""
    return plots.change_in_words(drop)


def _plus(value: float) -> str:
    return f"{value:+.3f}".replace("-", "\u2212")


def _parameters(effect: Effect, ci95: Mapping[str, tuple[float, float]]) -> str:
    """`a = 0.114 [0.1, 0.12], b = 5.4 1/m [5, 5.8]`"""
    values, units = effect.values(), {p.name: f" {p.unit}" if p.unit else "" for p in effect.parameters()}
    parts = [
        f"{name} = {_parameter(values[name])}{units[name]} [{_parameter(low)}, {_parameter(high)}]"
        for name, (low, high) in ci95.items()
    ]
    return ", ".join(parts) or "no free parameters"


def _parameter(value: float) -> str:
    """Less than a millionth is a zero that the solver has not quite reached."""
    return f"{value if abs(value) > 1e-6 else 0.0:.4g}".replace("-", "\u2212")


def _held_out(dataset: Dataset) -> str:
    if dataset.hold_out == "flights" and len(dataset.flights) > 1:
        return "whole flights that the fit had not used, each in turn"
    return f"blocks of {BLOCK_S:.0f} s that the fit had not used ({FOLDS} folds of every flight)"


def _flights_in_words(names: Sequence[str]) -> str:
    return _listed(names) if len(names) <= 3 else f"{len(names)} flights"


def _variance_in_words(c: Comparison) -> str:
    if c.explained > 0.0:
        return f"The model explains {_percent(c.explained)} of the acceleration's variance."
    return "The model predicts worse than assuming no acceleration at all."


def _count(n: int, what: str) -> str:
    return f"{n} {what}{'' if n == 1 else 's'}"


def _listed(words: Sequence[str]) -> str:
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} and {words[-1]}"


def _plain(family: str) -> str:
    return family.replace("_", " ")


def _sentence(text: str) -> str:
    return text[:1].upper() + text[1:]


def _stem(name: str) -> str:
    """A compensator as a person calls it: a model file by its name without folder and ending."""
    return Path(name).stem if name.endswith((".yaml", ".yml")) else name


# --- figures ----------------------------------------------------------------------------------------------------------


def _figure(drawing: Drawing, name: str, caption: str) -> Figure:
    return Figure(Markup(plots.to_svg(drawing, name)), caption)


def _both_widths(name: str, caption: str, wide: Drawing, narrow: Drawing) -> Figure:
    return Figure(
        Markup(plots.to_svg(wide, f"{name}-wide")), caption, Markup(plots.to_svg(narrow, f"{name}-narrow")), True
    )
