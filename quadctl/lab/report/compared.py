"""Sections on the model as given: the flights, its errors, and where it fails."""

from collections.abc import Mapping, Sequence

import numpy as np

from quadctl.frames import GRAVITY_M_S2
from quadctl.lab import plots
from quadctl.lab.comparison.comparison import Comparison
from quadctl.lab.comparison.failures import followed, told, unexplained
from quadctl.lab.comparison.open_loop import OpenLoop, open_loop
from quadctl.lab.comparison.wording import (
    FLOOR,
    UNIT,
    Said,
    flights_in_words,
    held_out,
    listed,
    p_in_words,
    percent,
    plus,
    quantity,
    roughly,
    sentence,
)
from quadctl.lab.flights.flight import VARIABLE_NAMES, Flight
from quadctl.lab.flights.prediction import AXES, predict
from quadctl.lab.report.numbers import floor_total, rmse_interval, total
from quadctl.lab.report.parts import Cell, Figure, Section, Table, both_widths, figure
from quadctl.lab.report.results import ADDED, Results
from quadctl.words import count, fact

SHOWN_FLIGHTS, SHOWN_PANELS, SHOWN_FAILURES = 2, 6, 12


def flights(r: Results) -> Section:
    dataset = r.comparison.dataset
    widths = sorted({f"{flight.bandwidth_hz:.2g}" for flight in dataset.flights})
    duration = sum(flight.duration_s for flight in dataset.flights)
    text = [
        f"{count(len(dataset.flights), 'flight')} with {duration:.0f} s in the air and {len(dataset.measured)} "
        f"samples, filtered to {listed(widths)} Hz. "
        "Measured and predicted acceleration pass the same filter.",
        f"Held-out errors below refer to {held_out(dataset)}. The rotor delay is the delay of the logged rotor signal "
        "relative to the force it makes; it has been corrected. Parts of the logs that are not used are listed below "
        "the table, with the reason.",
    ]
    rows = [[Cell(f.name), *_flight_cells(f)] for f in dataset.flights]
    if r.after is not None:
        rows += [[Cell(f.name, "unseen: used by no fit"), *_flight_cells(f)] for f in r.after.dataset.flights]
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
        Cell(f"{flight.duration_s:.0f}"),
        Cell(f"{len(flight.time_s)}"),
        Cell(f"{flight.bandwidth_hz:.2f}"),
        Cell(f"{1000.0 * flight.delay_s:.0f}".replace("-", "\u2212")),
        Cell(f"{height.min():.2f} to {height.max():.2f}"),
    ]


def over_time(r: Results) -> Section:
    c = r.comparison
    worst = max(AXES, key=lambda axis: c.rmse[axis])
    low, high = rmse_interval(c.residual, c.dataset)
    text = [
        f"The difference between the line of {c.model.name} and the black line is its acceleration error: "
        f"{quantity(c.rmse['total'])} (RMSE over all axes, per-flight bias not removed, 95% interval {low:.3g} to "
        f"{high:.3g}), largest on the {worst} axis ({quantity(c.rmse[worst])}).",
        f"{c.variance} The reference error is {roughly(floor_total(r))}: {FLOOR}.",
    ]
    if r.shown.errors_m_s2 is not None:
        text.append(
            "Here nothing is fitted to these flights, not even the per-flight bias; the number at the top is "
            f"{r.shown.where}."
        )
    models = {c.model.name: c}
    if r.improved is not None:
        models |= {ADDED: r.improved}
        text.append(f"{sentence(ADDED)} it is {quantity(r.improved.rmse['total'])}.")
    return Section("over-time", "Measured against predicted", text, time_figures(c, models, "seen"))


def time_figures(c: Comparison, models: Mapping[str, Comparison], name: str) -> list[Figure]:
    """Figures of the flights with the largest errors, in the order of the dataset."""
    index = c.dataset.flight_index
    errors = [total(c.residual[index == i]) for i in range(len(c.dataset.flights))]
    chosen = sorted(np.argsort(errors)[::-1][:SHOWN_FLIGHTS].tolist())
    others = len(errors) - len(chosen)
    figures = []
    for i in chosen:
        flight = c.dataset.flights[i]
        predicted = {label: predict(comparison.model, flight) for label, comparison in models.items()}
        more = f" The other {count(others, 'flight')} have smaller errors." if others and i == chosen[-1] else ""
        caption = f"{flight.name}: acceleration north, east, up and height of the rotors.{more}"
        figures.append(
            both_widths(
                f"{name}-{i}",
                caption,
                plots.acceleration_over_time(flight, flight.measured, predicted),
                plots.acceleration_over_time(flight, flight.measured, predicted, plots.NARROW_PX),
            )
        )
    return figures


def open_loop_section(r: Results) -> Section | None:
    c = r.comparison
    if not c.open_loop:
        return None
    text = [
        str(_told(c.open_loop).said),
        "Simulations with the model start at many instants of the flights. Their inputs are the logged attitude and "
        "rotor speeds; height and velocity are simulated. Brackets and error bars are 95% intervals. The grey line "
        "is without a model: the velocity stays as it was at the start.",
    ]
    names = flights_in_words(c.dataset.names)
    seen = {c.model.name: c.open_loop}
    if r.improved is not None and r.improved.open_loop:
        seen |= {ADDED: r.improved.open_loop}
        text.insert(1, f"{sentence(ADDED)}: {_told(r.improved.open_loop).said}")
    figures = [figure(plots.open_loop_errors(seen), "open-loop", f"Flights analysed: {names}.")]
    rows = [row for name, errors in seen.items() for row in _open_loop_rows(name, errors)]
    if r.after is not None and r.after.open_loop:
        unseen = r.before_unseen.open_loop if r.before_unseen is not None else open_loop(c.model, r.after.dataset)
        models = {"before": unseen, "after": r.after.open_loop}
        names = flights_in_words(r.after.dataset.names)
        figures.append(figure(plots.open_loop_errors(models), "open-loop-unseen", f"Unseen data: {names}."))
        for name, errors in models.items():
            rows += _open_loop_rows(f"{name}, unseen data", errors)
    title = "Open-loop prediction over several seconds"
    head = [
        "model",
        "after",
        "horizontal / m",
        "up / m",
        "position / m",
        "velocity / m/s",
        "position, no model / m",
    ]
    return Section(
        "open-loop",
        title,
        text,
        figures,
        tables=[Table(head, rows, words=2)],
    )


def _told(by_horizon: Sequence[OpenLoop]) -> OpenLoop:
    """The horizon that is told in words: the second, or the only one."""
    return by_horizon[min(1, len(by_horizon) - 1)]


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


def over_variables(r: Results) -> Section:
    c = r.comparison
    telling = c.telling
    shown = (telling or c.profiles[:2])[:SHOWN_PANELS]
    text = [
        "Dots are means over equal numbers of samples with 95% error bars (autocorrelation included); grey points are "
        "the samples. A complete model has all dots on the zero line. Percentages are the share of an axis' squared "
        "residual that the differences between the dots explain, an offset common to all not counted; the largest "
        "come first."
    ]
    if shown:
        best = shown[0]
        text.append(
            f"The {best.axis} residual depends most on {VARIABLE_NAMES[best.variable]}: the differences between "
            f"the dots explain {percent(best.share)} of that axis' squared residual (p {p_in_words(best.p_value)})."
        )
    figures = [
        figure(
            plots.residual_over_variable(c, profile),
            f"profile-{i}",
            f"{sentence(profile.axis)} over {VARIABLE_NAMES[profile.variable]}: {percent(profile.share)} of the "
            f"axis' squared residual, p {p_in_words(profile.p_value)}.",
        )
        for i, profile in enumerate(shown)
    ]
    return Section("variables", r.titled("The residual over the variables that explain most of it"), text, figures)


def where_it_fails(r: Results) -> Section:
    return _failures(r.comparison, "fails", r.titled("Where the model fails"), r.comparison.model.name)


def where_it_still_fails(r: Results) -> Section | None:
    """Section on the model with what was added; where flights are held out, another section says it of those."""
    if r.improved is None or r.after is not None:
        return None
    name = f"{r.comparison.model.name} {ADDED}"
    return _failures(r.improved, "still-fails", f"Where the model still fails: {name}", name)


def _failures(c: Comparison, anchor: str, title: str, name: str) -> Section:
    if not c.fails_where:
        return Section(anchor, title, [str(fact(Said.NO_FAILURE, model=name))])
    shown = told(c.fails_where, SHOWN_FAILURES)
    rows = [
        [Cell(str(f.said)), Cell("" if f.kind == "dependence" else plus(f.mean_residual)), Cell(f"{abs(f.sigma):.0f}")]
        for f in shown
    ]
    text = [
        f"{count(len(shown), 'finding')}, the largest squared error first; several may have the same cause. An error "
        f"of the thrust of 1% of the weight is {0.01 * GRAVITY_M_S2:.2f} {UNIT}. Every real vehicle has a per-flight "
        "bias; an error no larger than that needs no further effect."
    ]
    more = len(c.fails_where) - len(shown)
    said = (followed(shown, c.dataset), unexplained(c.fails_where, c.rmse))
    return Section(
        anchor,
        title,
        text,
        tables=[Table(["where and how", f"mean residual / {UNIT}", "sigma"], rows)],
        after_text=[
            *(
                [f"Not listed: {count(more, 'finding')} of smaller errors, or of parts of those listed."]
                if more
                else []
            ),
            *(str(part) for part in said if part is not None),
        ],
    )
