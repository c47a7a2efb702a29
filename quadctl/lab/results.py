"""Base class of the lab's results: they print as a table on a terminal and in a notebook, and have one figure.

The figures register themselves (`quadctl.lab.figures`), so that no result imports plotting code.
"""

import io
from collections.abc import Callable, Iterable, Mapping
from typing import TYPE_CHECKING, Any, TypeVar

from rich.console import Console, RenderableType
from rich.table import Table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

WIDTH = 120
"""Width of a result as text, characters."""
_NOTEBOOK = '<pre style="white-space:pre;overflow-x:auto;line-height:normal">{code}</pre>'


class Result:
    """Base of all results: prints as a table, also in a notebook, and has one figure."""

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
        """Draw the most informative figure of this result (`quadctl.lab.plots` has more).

        Raises
        ------
        TypeError
            No figure is registered for results of this kind.
        """
        for kind in type(self).__mro__:
            if kind in _FIGURES:
                return _FIGURES[kind](self)
        raise TypeError(f"no figure is registered for {type(self).__name__}, expected one by `draws`")


_FIGURES: dict[type, "Callable[[Any], Figure]"] = {}

_Draw = TypeVar("_Draw", bound="Callable[[Any], Figure]")


def draws(kind: type[Result]) -> "Callable[[_Draw], _Draw]":
    """Register the decorated function as the figure of results of `kind`."""

    def register(draw: _Draw) -> _Draw:
        _FIGURES[kind] = draw
        return draw

    return register


def errors_table(title: str, rows: Iterable[tuple[str, Mapping[str, float]]]) -> Table:
    """Table of errors per axis and total, m/s^2, one row each."""
    table = Table(title=title, title_justify="left")
    table.add_column("m/s^2")
    columns = ("north", "east", "up", "total")
    for axis in columns:
        table.add_column(axis, justify="right")
    for name, errors in rows:
        table.add_row(name, *(f"{errors[axis]:.4f}" for axis in columns))
    return table
