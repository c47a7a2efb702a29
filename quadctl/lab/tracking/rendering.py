"""Metrics of flights as a table on a terminal."""

import itertools
from pathlib import Path

from rich import box
from rich.console import Group, RenderableType
from rich.markup import escape
from rich.table import Table
from rich.text import Text

from quadctl.lab.tracking.metrics import VALUES, GroupMetrics, MetricsTable

_HEADINGS = {
    "m_a_signed": "M_A\nsigned",
    "m_a_absolute": "M_A\nabsolute",
    "m_b_signed": "M_B\nsigned",
    "m_b_absolute": "M_B\nabsolute",
    "mae_m": "MAE",
    "rmse_m": "RMSE",
    "max_error_m": "largest\nerror",
}


_DEFINITION = {
    "m_b_absolute": "absolute M_B, the integral of the difference from the reference flight, m s",
    "rmse_m": "RMSE of the error, m",
}


def render(result: MetricsTable) -> RenderableType:
    """The metrics: which flight follows best, then a table, one line per flight and mean and deviation of flights flown
    more than once."""
    said = filter(None, [_answer(result)])
    notes = ("M_A: integral of the error.", *(f"{note}." for note in result.notes))
    return Group(*(Text(sentence) for sentence in said), _table(result), *(Text(note) for note in notes))


def _answer(result: MetricsTable) -> str:
    """Order of what was flown by the error that is most to the point, the least first; empty of a single flight."""
    flown = [group for group in result.groups if not group.is_reference]
    value = "m_b_absolute" if all(group.mean.get("m_b_absolute") is not None for group in flown) else "rmse_m"
    errors = sorted((group.mean[value] or 0.0, group.group) for group in flown)
    if len(errors) < 2:
        return ""
    return f"Least first by {_DEFINITION[value]}: " + "; ".join(f"{name} {error:.3f}" for error, name in errors) + "."


def _table(result: MetricsTable) -> Table:
    columns = [value for value in VALUES if any(getattr(flight, value) is not None for flight in result.flights)]
    table = Table(
        title=escape(f"Tracking of {result.axis}, {result.window}: integrals in m s, errors in m"),
        title_justify="left",
        box=box.SIMPLE_HEAD,
        show_edge=False,
        padding=0,
    )
    table.add_column("flight", overflow="fold")
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
