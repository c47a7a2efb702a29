"""How the lab's results look on a terminal."""

from collections.abc import Iterable, Mapping

from rich.table import Table

from quadctl.lab.data import AXES


def errors_table(title: str, rows: Iterable[tuple[str, Mapping[str, float]]]) -> Table:
    """Errors per axis and total, m/s^2, a row each."""
    table = Table(title=title, title_justify="left")
    table.add_column("m/s^2")
    columns = (*AXES, "total")
    for axis in columns:
        table.add_column(axis, justify="right")
    for name, errors in rows:
        table.add_row(name, *(f"{errors[axis]:.4f}" for axis in columns))
    return table
