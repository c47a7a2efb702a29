"""Result of the search for formulas: laws with coefficients and intervals, as text, table and JSON."""

import re
from dataclasses import dataclass
from typing import Any, Literal

from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from quadctl.lab.arrays import Floats

Frame = Literal["world", "body"]
FRAME_AXES: dict[Frame, tuple[str, str, str]] = {"world": ("north", "east", "up"), "body": ("forward", "right", "top")}
"""Names of the axes in each frame; `top` is opposite to body z, i.e. along the thrust."""

COMPACT_SHARE = 0.95
"""Least share of the sparse expression's explained error at which the compact form is preferred."""


@dataclass(frozen=True, eq=False)
class Formula:
    """Expression with numbers: acceleration along one axis, m/s^2, as a function of `library.VARIABLES`."""

    parts: tuple[str, ...]
    """Python text of the terms of the sum, with the names of the coefficients in braces."""
    variables: tuple[str, ...]
    coefficients: dict[str, float]
    ci95: dict[str, tuple[float, float]]
    """95 % intervals by bootstrap over blocks of time."""
    bounds: dict[str, tuple[float, float]]
    """Bounds of each coefficient in a refit to other data."""
    held_out_share: float
    """Share of the axis' squared residual that is explained on held-out data."""
    predicted: Floats
    """Prediction at the samples, m/s^2, shape (n,)."""

    @property
    def text(self) -> str:
        """Readable text of the expression."""
        numbers = {k: f"({v:.4g})" if v < 0.0 else f"{v:.4g}" for k, v in self.coefficients.items()}
        text = " + ".join(self.parts).format(**numbers)
        text = re.sub(r"\(-\(-([^()]*)\)", r"(\1", text)  # exp(-(-2)*x)
        text = re.sub(r"\+ \(-([^()]*)\)", r"- \1", text)
        text = re.sub(r"- \(-([^()]*)\)", r"+ \1", text)
        return re.sub(r"^\((-[^()]*)\)", r"\1", text)

    def to_dict(self) -> dict[str, Any]:
        return {
            "expression": self.text,
            "variables": list(self.variables),
            "coefficients": self.coefficients,
            "ci95": {name: list(ci) for name, ci in self.ci95.items()},
            "held_out_share": self.held_out_share,
        }


@dataclass(frozen=True, eq=False)
class Law:
    """Formulas found for one axis."""

    axis: str
    sparse: Formula
    compact: Formula
    """Compact form of the single variable that explains most."""
    p_value: float
    """Probability of such a held-out improvement by chance, corrected for the axes and numbers of terms tried."""

    @property
    def best(self) -> Formula:
        """Compact form where it explains about as much on held-out data, else the sparse expression."""
        as_good = self.compact.held_out_share >= COMPACT_SHARE * self.sparse.held_out_share
        return self.compact if as_good else self.sparse

    def to_dict(self) -> dict[str, Any]:
        return {
            "axis": self.axis,
            **self.sparse.to_dict(),
            "p_value": self.p_value,
            "compact": self.compact.to_dict(),
        }


@dataclass(frozen=True, eq=False)
class Symbolic:
    """Laws of one frame; the one that explains most comes first."""

    frame: Frame
    laws: tuple[Law, ...]
    ranges: dict[str, tuple[float, float]]
    """Range of each variable in the data."""

    @property
    def variables(self) -> list[str]:
        """Variables that the laws depend on."""
        return list(dict.fromkeys(name for law in self.laws for name in law.best.variables))

    def to_dict(self) -> dict[str, Any]:
        """The JSON field `symbolic` of a diagnosis."""
        return {
            "expression": "; ".join(f"{law.axis} = {law.sparse.text}" for law in self.laws),
            "variables": list(dict.fromkeys(name for law in self.laws for name in law.sparse.variables)),
            "frame": self.frame,
            "unit": "m/s^2",
            "laws": [law.to_dict() for law in self.laws],
        }

    def __rich__(self) -> RenderableType:
        table = Table(
            title=f"Expressions for the unexplained acceleration, m/s^2, {self.frame} axes", title_justify="left"
        )
        table.add_column("expression, and its coefficients [95 %]", overflow="fold")
        table.add_column("explains", justify="right", no_wrap=True)
        table.add_column("p", justify="right", no_wrap=True)
        for law in self.laws:
            for formula in (law.sparse, law.compact):
                ci = [
                    f"  {name} = {formula.coefficients[name]:.3g} [{low:.3g}, {high:.3g}]"
                    for name, (low, high) in formula.ci95.items()
                ]
                p = "" if formula is law.compact else "< 1e-4" if law.p_value < 1e-4 else f"{law.p_value:.2g}"
                head = f"{law.axis}{', of one variable' if formula is law.compact else ''} = {formula.text}"
                table.add_row(Text("\n".join([head, *ci])), f"{formula.held_out_share:.0%}", p)
        up = "'top' is along the thrust, against body z. " if self.frame == "body" else ""
        share = f"{up}'explains' is the share of the squared error of that axis on held-out data."
        return Group(table, Text(share))
