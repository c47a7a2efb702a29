"""How the lab's results look: as tables on a terminal and in a notebook, and each as one figure."""

import io
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING

from rich.console import Console, RenderableType
from rich.table import Table

from quadctl.lab.flights.prediction import AXES

if TYPE_CHECKING:
    from matplotlib.figure import Figure

WIDTH = 120
"""Of a result as text, characters."""
_NOTEBOOK = '<pre style="white-space:pre;overflow-x:auto;line-height:normal">{code}</pre>'


class Result:
    """What every result of the lab does: it prints as a table, in a notebook too, and draws itself."""

    def __rich__(self) -> RenderableType:
        raise TypeError(f"{type(self).__name__} does not say how it looks")

    def __str__(self) -> str:
        console = Console(file=io.StringIO(), width=WIDTH, color_system=None)
        with console.capture() as capture:
            console.print(self)
        return "\n".join(line.rstrip() for line in capture.get().rstrip().splitlines())

    __repr__ = __str__

    def _repr_html_(self) -> str:
        console = Console(file=io.StringIO(), width=WIDTH, record=True)
        console.print(self)
        return console.export_html(inline_styles=True, code_format=_NOTEBOOK)

    def plot(self) -> "Figure":
        """The one figure that says most of this result (`quadctl.lab.plots` has more)."""
        from quadctl.lab.plots.of_results import drawn

        return drawn(self)


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
