"""Plots: pure functions from results to matplotlib figures, one kind per file, and conversion of figures to SVG."""

from quadctl.lab.plots.bars import before_after
from quadctl.lab.plots.candidates import chosen, ranking
from quadctl.lab.plots.effect import effect_over_variable
from quadctl.lab.plots.ground import thrust_ratio
from quadctl.lab.plots.mission_gains import mission_gains
from quadctl.lab.plots.model_sequence import model_sequence
from quadctl.lab.plots.open_loop import open_loop_errors
from quadctl.lab.plots.over_time import acceleration_over_time
from quadctl.lab.plots.over_variable import residual_over_variable
from quadctl.lab.plots.steps import step_heights, step_tail
from quadctl.lab.plots.style import NARROW_PX
from quadctl.lab.plots.svg import to_svg

__all__ = [
    "NARROW_PX",
    "acceleration_over_time",
    "before_after",
    "chosen",
    "effect_over_variable",
    "mission_gains",
    "model_sequence",
    "open_loop_errors",
    "ranking",
    "residual_over_variable",
    "step_heights",
    "step_tail",
    "thrust_ratio",
    "to_svg",
]
