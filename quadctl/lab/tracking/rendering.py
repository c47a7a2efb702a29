"""Metrics of flights as a table on a terminal."""

import itertools
from enum import unique
from pathlib import Path

from rich import box
from rich.console import Group, RenderableType
from rich.markup import escape
from rich.table import Table
from rich.text import Text

from quadctl.lab.tracking.metrics import VALUES, GroupMetrics, MetricsTable
from quadctl.words import Fact, Kinds, Words, fact

_HEADINGS = {
    "m_a_signed": "M_A\nsigned",
    "m_a_absolute": "M_A\nabsolute",
    "m_b_signed": "M_B\nsigned",
    "m_b_absolute": "M_B\nabsolute",
    "mae_m": "MAE",
    "rmse_m": "RMSE",
    "max_error_m": "largest\nerror",
}


_WORDS = Words({"order": lambda errors: "; ".join(f"'{name}' {error:.3f}" for error, name in errors)})


@unique
class Answer(Kinds, words=_WORDS):
    """Order of flights by their errors, with its template."""

    BY_M_B = "Best first, by absolute M_B (m s): {errors:order}."
    BY_RMSE = "Best first, by RMSE of the error (m): {errors:order}."


def render(result: MetricsTable) -> RenderableType:
    """The metrics: which flight follows best, then a table, one line per flight and mean and deviation of flights flown
    more than once."""
    notes = ["M_A: integral of the error."]
    if any(flight.m_b_absolute is not None for flight in result.flights):
        notes = [
            "M_A: integral of the error. M_B: integral of the difference between this error and the reference flight's."
        ]
    notes += [f"{note}." for note in result.notes]
    return Group(*(Text(str(found)) for found in _answer(result)), _table(result), *(Text(note) for note in notes))


def _answer(result: MetricsTable) -> list[Fact]:
    """Order of what was flown by the error that is most to the point, the least first; none of a single flight."""
    flown = [group for group in result.groups if not group.is_reference]
    kind, value = Answer.BY_M_B, "m_b_absolute"
    if any(group.mean.get(value) is None for group in flown):
        kind, value = Answer.BY_RMSE, "rmse_m"
    errors = sorted((group.mean[value] or 0.0, group.group) for group in flown)
    return [fact(kind, errors=errors)] if len(errors) > 1 else []


def _table(result: MetricsTable) -> Table:
    columns = [value for value in VALUES if any(getattr(flight, value) is not None for flight in result.flights)]
    table = Table(
        title=escape(f"Tracking of {result.axis}, {result.window}: integrals in m*s, errors in m"),
        title_justify="left",
        box=box.SIMPLE_HEAD,
        show_edge=False,
        padding=0,
    )
    table.add_column("flight, compensator", overflow="fold")
    for value in columns:
        table.add_column(_HEADINGS[value], justify="right", no_wrap=True)
    alone = {group.group for group in result.groups if group.n_runs == 1}
    for is_reference, flights in itertools.groupby(result.flights, key=lambda flight: flight.is_reference):
        if is_reference:
            table.add_section()
            table.add_row("reference flights:")
        for flight in flights:
            name = flight.group if flight.group in alone else Path(flight.flight).stem
            table.add_row(escape(name), *(_number(getattr(flight, value)) for value in columns))
    for group in result.groups:
        if group.n_runs > 1:
            table.add_section()
            for name, values in _lines_of(group):
                table.add_row(escape(name), *(_number(values.get(value)) for value in columns))
    return table


def _lines_of(group: GroupMetrics) -> list[tuple[str, dict[str, float | None]]]:
    lines = [(f"{group.group}, mean of {group.n_runs}", group.mean), ("  standard deviation", group.std)]
    if group.m_b_absolute_of_mean is not None and not group.is_reference:
        lines.append(("  of the mean flight", {"m_b_absolute": group.m_b_absolute_of_mean}))
    return lines


def _number(value: float | None) -> str:
    return "" if value is None else f"{value:.3f}"
