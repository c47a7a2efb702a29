"""Figures of the lab: pure functions from results to matplotlib figures, and figures to SVG for a page.

Sizes are in CSS pixels and fonts are drawn at their size on screen, so that text stays legible where a figure is shown
at its own width. Colours are Okabe and Ito's, which colour-blind readers tell apart: what was measured is black, what
was there before is vermilion, what an added effect makes of it is blue, what no model can better is green.
"""

import io
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import wraps
from itertools import pairwise
from typing import Any, ParamSpec

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from quadctl.effects import CATALOG, Conditions, Effect
from quadctl.effects.ground_effect import LOWEST_HEIGHT_OVER_RADIUS, NearGround
from quadctl.frames import GRAVITY_M_S2, euler_from_quaternion
from quadctl.lab.add import Addition
from quadctl.lab.arrays import Floats
from quadctl.lab.compare import Comparison
from quadctl.lab.data import AXES, Dataset, variance_of_sum
from quadctl.lab.diagnose import Diagnosis
from quadctl.lab.fit import free_parameters, with_values
from quadctl.lab.flight import VARIABLE_NAMES, VARIABLE_UNITS, Flight
from quadctl.lab.locate import Profile
from quadctl.lab.metrics import Tracking
from quadctl.lab.openloop import OpenLoop
from quadctl.model import Model

WIDE_PX, PANEL_PX, NARROW_PX = 980, 440, 360
MAX_DRAWN = 4000
"""Longer lines are drawn as pixels, and of longer clouds only so many points: a page must stay light."""
RATIO_DRAWS, CURVE_DRAWS = 400, 60
"""Bootstrap draws behind a band: of a formula over height, and of a whole prediction."""
RATIO_BINS = 14
HIGHEST_HEIGHT_OVER_RADIUS = 10.0
"""Above it nothing happens that a ground-effect plot should give room to."""
BODY_AXES = ("forward", "right", "up")
_ACROSS = {"speed_forward": "forward", "speed_right": "right"}
"""Variables whose effects push along the heading; all others are looked at along up."""

BLACK, ORANGE, SKY, GREEN, BLUE, VERMILION, PURPLE, GREY = (
    *("#222222", "#E69F00", "#56B4E9", "#009E73", "#0072B2", "#D55E00", "#CC79A7", "#8A8A8A"),
)
LIGHT = "#C4C4C4"
BEFORE, AFTER, FLOOR = VERMILION, BLUE, GREEN
FLIGHT_COLOURS = (VERMILION, ORANGE, BLUE, GREEN, PURPLE, SKY)
TEXTBOOK = {"cheeseman": (ORANGE, "--"), "hayden": (PURPLE, "-."), "sanchez": (GREEN, ":")}

STYLE: dict[Any, Any] = {
    "font.size": 11.0,
    "axes.titlesize": 11.5,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.labelsize": 11.0,
    "xtick.labelsize": 10.5,
    "ytick.labelsize": 10.5,
    "legend.fontsize": 10.5,
    "legend.frameon": False,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": "#666666",
    "axes.labelcolor": BLACK,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#E4E4E4",
    "grid.linewidth": 0.7,
    "lines.linewidth": 1.4,
    "figure.facecolor": "white",
    "figure.dpi": 72.0,
    "figure.constrained_layout.use": True,
    "svg.fonttype": "none",
    "text.parse_math": False,  # a dollar sign in the name of a file is a dollar sign
}
_GROUP_ID = re.compile(r' id="[a-zA-Z0-9.]+_[0-9]+"')
_PATH = re.compile(r' d="[^"]*"')
_LONG_NUMBER = re.compile(r"-?\d+\.\d{3,}")
_P = ParamSpec("_P")


def _figure(draw: Callable[_P, Figure]) -> Callable[_P, Figure]:
    """The house style for the figures that `draw` makes, whatever the caller's style is."""

    @wraps(draw)
    def styled(*args: _P.args, **kwargs: _P.kwargs) -> Figure:
        with mpl.rc_context(STYLE):
            return draw(*args, **kwargs)

    return styled


def to_svg(figure: Figure, name: str) -> str:
    """The figure as an SVG element for a page: text as text, no addresses, ids that are unique to `name`."""
    out = io.StringIO()
    with mpl.rc_context({**STYLE, "svg.hashsalt": name}):
        nothing = dict.fromkeys(("Date", "Creator", "Format", "Type"))
        figure.savefig(out, format="svg", metadata=nothing, dpi=120)
    svg = out.getvalue()
    svg = svg[svg.index("<svg") :].strip()
    # A page knows these namespaces; the size is the page's affair; the ids of matplotlib's groups repeat per figure.
    head, _, body = svg.partition(">")
    view = re.search(r'viewBox="0 0 ([\d.]+) [\d.]+"', head)
    width = f"{float(view[1]):.0f}px" if view else "100%"
    head = f'<svg {view[0] if view else ""} style="max-width:calc({width}*1.15)" aria-hidden="true"'
    body = _PATH.sub(
        lambda path: _LONG_NUMBER.sub(_rounded, path[0]).replace("\n", "").replace("L ", "L"), _GROUP_ID.sub("", body)
    )
    return f"{head}>{body}"


def _rounded(digits: re.Match[str]) -> str:
    """A tenth of a pixel is more than anyone sees."""
    return f"{float(digits[0]):.1f}"


# --- the model against the measurement --------------------------------------------------------------------------------


@_figure
def acceleration_over_time(
    flight: Flight, measured: Floats, predicted: Mapping[str, Floats], width_px: float = WIDE_PX
) -> Figure:
    """Measured acceleration of one flight and what one or two models predict, shape (n, 3) each; the height below."""
    figure = Figure(figsize=(width_px / 72, 6.6))
    axes = figure.subplots(4, 1, sharex=True, height_ratios=[2.4, 1.0, 1.0, 0.8])
    pixels = len(flight.time_s) > MAX_DRAWN or width_px < WIDE_PX
    # A gap in time is a gap in the line.
    gaps = np.flatnonzero(np.diff(flight.time_s) > 3.0 * np.median(np.diff(flight.time_s))) + 1
    time = np.insert(flight.time_s, gaps, np.nan)
    colours = (BEFORE, AFTER) if len(predicted) > 1 else (BEFORE,)

    def line(ax: Axes, values: Floats, colour: str, label: str | None = None, width: float = 1.1) -> None:
        ax.plot(time, np.insert(values, gaps, np.nan), color=colour, label=label, linewidth=width, rasterized=pixels)

    for ax, axis in zip(axes, ("up", "north", "east"), strict=False):
        column = AXES.index(axis)
        line(ax, measured[:, column], BLACK, "measured", 1.5)
        for (label, values), colour in zip(predicted.items(), colours, strict=False):
            line(ax, values[:, column], colour, _label(label))
        shown = np.concatenate([measured[:, column], *(values[:, column] for values in predicted.values())])
        _limits(ax, shown)
        ax.set_ylabel(f"{axis} / m/s²")
        ax.yaxis.set_major_locator(MaxNLocator(4 if axis == "up" else 3))
    _legend_above(axes[0], columns=3)
    line(axes[3], flight.filtered(flight.conditions.height_m), GREY)
    axes[3].set_ylabel("height / m")
    axes[3].yaxis.set_major_locator(MaxNLocator(3))
    axes[3].set_xlabel("time in the log / s")
    axes[3].set_xlim(flight.time_s[0], flight.time_s[-1])
    figure.align_ylabels(axes)
    return figure


@_figure
def residual_over_variable(comparison: Comparison, profile: Profile) -> Figure:
    """Binned means of the residual with 95% error bars over a faint cloud of all samples."""
    figure, ax = _panel()
    x = comparison.dataset.variable(profile.variable)
    values = comparison.residual[:, AXES.index(profile.axis)]
    if x is not None:
        _cloud(ax, x, values, GREY)
        _limits(ax, values)
        ax.set_xlim(*_inner_range(x))
        centre = np.array([np.mean(x[(x >= a) & (x <= b)]) for a, b in _pairs(profile.edges)])
        _points(ax, centre, profile.mean, profile.error, BEFORE)
    ax.axhline(0.0, color=BLACK, linewidth=0.8)
    ax.set_xlabel(label_of(profile.variable))
    ax.set_ylabel(f"residual {profile.axis} / m/s²")
    return figure


@_figure
def open_loop_errors(models: Mapping[str, Sequence[OpenLoop]]) -> Figure:
    """Error of the predicted position of one or two models after each horizon, and of holding the velocity."""
    figure, ax = _panel()
    held = next(iter(models.values()))
    curves = {"velocity held": [e.held_position["total"] for e in held]}
    curves |= {_label(name): [e.position["total"] for e in errors] for name, errors in models.items()}
    for (name, ends), colour, marker in zip(curves.items(), (GREY, BEFORE, AFTER), "so^", strict=False):
        x = [e.horizon_s for e in held[: len(ends)]]
        y = np.array([end.rmse for end in ends])
        low, high = np.array([end.ci95 or (end.rmse, end.rmse) for end in ends]).T
        ax.errorbar(x, y, [y - low, high - y], color=colour, marker=marker, label=name, capsize=2, markersize=5)
    ax.set_yscale("log")
    ax.yaxis.set_major_formatter("{x:g}")
    ax.set_xticks([e.horizon_s for e in held])
    ax.set_xlabel("time simulated / s")
    ax.set_ylabel("position error (RMSE) / m")
    _legend_above(ax, columns=3)
    return figure


# --- what is missing --------------------------------------------------------------------------------------------------


def chosen(diagnosis: Diagnosis) -> set[str]:
    """Names of the effects that are missing."""
    return {step.effect for step in diagnosis.steps[1:]}


@_figure
def ranking(diagnosis: Diagnosis, floor_total: float) -> Figure:
    """Drop of the held-out error with each candidate of the ranking, and the drop that the noise allows."""
    candidates = diagnosis.ranking
    figure, ax = _panel(0.9 + 0.36 * (len(candidates) + 1))
    drops = [*(100.0 * c.held_out_drop for c in candidates), 0.0]
    low = max(-20.0, min(0.0, *drops) - 2.0)
    colours = [AFTER if c.effect.name in chosen(diagnosis) else SKY if c.supported else LIGHT for c in candidates]
    possible = 100.0 * (1.0 - floor_total / diagnosis.steps[0].rmse["total"])
    ax.axvline(possible, color=FLOOR, linestyle="--", label="all that the logged variables explain")
    ax.axvline(0.0, color=BLACK, linewidth=0.8)
    ax.barh(range(len(drops)), np.maximum(drops, low), color=[*colours, LIGHT], height=0.66)
    notes = [f"{change_in_words(c.held_out_drop)}, p {p_in_words(c.p_value)}" for c in candidates]
    for row, (drop, note) in enumerate(zip(drops, [*notes, "the model as it is"], strict=True)):
        _beside(ax, max(drop, 0.0), row, note)
    ax.set_yticks(range(len(drops)), [*(c.effect.name for c in candidates), "none"])
    ax.set_xlim(low, max(possible, 5.0, *drops) * 1.05 + 38.0)
    ax.set_ylim(len(drops) - 0.5, -0.6)
    ax.grid(axis="y", visible=False)
    ax.set_xlabel("drop of the held-out error / %")
    figure.legend(loc="outside upper left")
    return figure


@_figure
def ladder(diagnosis: Diagnosis, floor_total: float) -> Figure:
    """Held-out error of the model as it is, then with each missing family in the order of adding."""
    figure, ax = _panel(0.9 + 0.46 * len(diagnosis.steps))
    totals = [step.rmse["total"] for step in diagnosis.steps]
    names = [diagnosis.model.name, *(f"+ {step.effect}" for step in diagnosis.steps[1:])]
    rows = np.arange(len(totals))
    ax.barh(rows, totals, color=[BEFORE] + [AFTER] * (len(totals) - 1), height=0.62)
    for row, total in enumerate(totals):
        _beside(ax, total, row, f"{total:#.3g}")
    ax.axvline(floor_total, color=FLOOR, linestyle="--", label="noise floor")
    ax.set_yticks(rows, names)
    ax.set_ylim(len(rows) - 0.5, -0.6)
    ax.set_xlim(0.0, 1.14 * max(*totals, floor_total))
    ax.grid(axis="y", visible=False)
    ax.set_xlabel("held-out error, total RMSE / m/s²")
    figure.legend(loc="outside upper left")
    return figure


@_figure
def before_after(before: Mapping[str, float], after: Mapping[str, float], floor: Mapping[str, float] | None) -> Figure:
    """Error per axis and total, before and after; the noise floor where it is known for these data."""
    figure, ax = _panel()
    names = (*AXES, "total")
    x = np.arange(len(names))
    for offset, values, colour, label in ((-0.2, before, BEFORE, "before"), (0.2, after, AFTER, "after")):
        heights = [values[name] for name in names]
        ax.bar(x + offset, heights, 0.38, color=colour, label=label)
        tops = heights if floor is None else [max(h, floor[name]) for h, name in zip(heights, names, strict=True)]
        for place, height, top in zip(x + offset, heights, tops, strict=True):
            ax.annotate(f"{height:#.2g}", (place, top), (0, 2), textcoords="offset points", ha="center", fontsize=9.5)
    if floor is not None:
        ax.hlines([floor[name] for name in names], x - 0.42, x + 0.42, color=FLOOR, linewidth=2.2, label="noise floor")
    ax.set_xticks(x, names)
    ax.grid(axis="x", visible=False)
    ax.margins(y=0.1)
    ax.set_ylabel("error (RMSE) / m/s²")
    _legend_above(ax, columns=3)
    return figure


# --- what was found ---------------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Binned:
    """Means over bins of a variable."""

    x: Floats
    mean: Floats
    error: Floats
    """Standard error of the mean, autocorrelation included."""


@dataclass(frozen=True, eq=False)
class RatioCurve:
    """A fitted ground effect: thrust ratio over height."""

    height_over_radius: Floats
    ratio: Floats
    low: Floats
    high: Floats
    """95% band from the bootstrap draws."""
    measured: Binned
    """Measured over predicted specific force along up, the prediction without this effect."""
    data_range: tuple[float, float]
    """Heights flown, rotor radii."""


def ratio_curve(addition: Addition, index: int) -> RatioCurve:
    """The ground effect at place `index` of the stack, over the heights that a plot shows."""
    vehicle, dataset = addition.model.vehicle, addition.dataset
    radius = vehicle.rotor.radius_m
    low, high = (h / radius for h in dataset.heights_m)
    end = min(1.15 * high, max(HIGHEST_HEIGHT_OVER_RADIUS, 1.15 * low))
    x = np.linspace(max(LOWEST_HEIGHT_OVER_RADIUS, min(0.75 * low, 1.0)), end, 160)
    models = _drawn_models(addition, index, RATIO_DRAWS)
    draws = [_ratio(model.effects[index], x * radius, addition.model) for model in models]
    band = np.percentile(draws, [2.5, 97.5], axis=0)

    expected = dataset.predicted(_without(addition.model, index))[:, 2] + GRAVITY_M_S2
    ratio = (dataset.measured[:, 2] + GRAVITY_M_S2) / expected
    noise = dataset.residual(addition.model)[:, 2] / expected
    heights = _variable(dataset, "height_over_radius")
    shown = heights <= end
    return RatioCurve(
        x,
        _ratio(addition.model.effects[index], x * radius, addition.model),
        band[0],
        band[1],
        binned(heights, ratio, noise, dataset, shown),
        (low, high),
    )


@_figure
def thrust_ratio(addition: Addition, index: int, width_px: float = WIDE_PX) -> Figure:
    """Fitted thrust ratio over height with its 95% band, the measured ratio in bins, the textbook's curves faint."""
    curve = ratio_curve(addition, index)
    radius = addition.model.vehicle.rotor.radius_m
    x = curve.height_over_radius
    figure = Figure(figsize=(width_px / 72, 5.4))
    ax = figure.subplots()
    ax.axvspan(max(curve.data_range[0], x[0]), min(curve.data_range[1], x[-1]), color="#EEF2F7")
    for variant, (colour, dashes) in TEXTBOOK.items():
        textbook = CATALOG[f"ground_effect.{variant}"]()
        if textbook == addition.model.effects[index]:
            continue
        ratio = _ratio(textbook, x * radius, addition.model)
        ax.plot(x, ratio, dashes, color=colour, linewidth=1.3, alpha=0.75, label=f"{variant}, textbook")
    ax.fill_between(x, curve.low, curve.high, color=AFTER, alpha=0.22, linewidth=0.0, label="95% band")
    ax.plot(x, curve.ratio, color=AFTER, linewidth=2.2, label=f"{addition.model.effects[index].name}, fitted")
    _points(ax, curve.measured.x, curve.measured.mean, curve.measured.error, BLACK, "measured, mean ± 95%")
    ax.axhline(1.0, color=BLACK, linewidth=0.8)
    top = max(float(curve.high.max()), float(np.max(curve.measured.mean + 2.0 * curve.measured.error)))
    ax.set_ylim(min(0.98, float(np.min(curve.measured.mean)) - 0.01), 1.0 + 1.35 * (top - 1.0) + 0.01)
    ax.set_xlim(x[0], x[-1])
    ax.set_xlabel("rotor height above the ground / rotor radii")
    ax.set_ylabel("thrust ratio K (1 = far from the ground)")
    ax.legend(loc="upper right", fontsize=10.5)
    return figure


@dataclass(frozen=True, eq=False)
class EffectCurve:
    """A fitted effect over one of its own variables, along one axis of the vehicle's heading."""

    variable: str
    component: str
    x: Floats
    before: Floats
    """Residual without the effect, m/s^2, shape (n,)."""
    after: Floats
    """The same with it."""
    binned_before: Binned
    binned_after: Binned
    fitted: Binned
    """What the effect adds, in the same bins; its error is that of the bootstrap draws."""


def effect_curves(addition: Addition, index: int) -> list[EffectCurve]:
    """The effect at place `index` of the stack over the variables that it depends on.

    Where it depends on none, over time, along the axes on which it does most.
    """
    dataset, effect = addition.dataset, addition.model.effects[index]
    without = dataset.predicted(_without(addition.model, index))
    full = dataset.predicted(addition.model)
    heading = _heading(dataset)
    before = _in_heading(dataset.measured - without, heading)
    after = _in_heading(dataset.measured - full, heading)
    push = _in_heading(full - without, heading)
    draws = [_in_heading(dataset.predicted(m) - without, heading) for m in _drawn_models(addition, index, CURVE_DRAWS)]

    variables = [name for name in effect.depends_on if dataset.variable(name) is not None]
    pairs = [(name, _ACROSS.get(name, "up")) for name in variables] or [("time", c) for c in _pushed(push)]
    found = []
    for variable, component in pairs:
        a = BODY_AXES.index(component)
        x = _variable(dataset, variable)
        fitted = binned(x, push[:, a], after[:, a], dataset)
        spread = np.std([binned(x, d[:, a], None, dataset).mean for d in draws], axis=0)
        found.append(
            EffectCurve(
                variable,
                component,
                x,
                before[:, a],
                after[:, a],
                binned(x, before[:, a], after[:, a], dataset),
                binned(x, after[:, a], after[:, a], dataset),
                Binned(fitted.x, fitted.mean, spread),
            )
        )
    return found


@_figure
def effect_over_variable(curve: EffectCurve) -> Figure:
    """Residual before and after an effect is in, over the effect's own variable, and what the effect adds."""
    figure, ax = _panel(4.4)
    _cloud(ax, curve.x, curve.before, GREY)
    _limits(ax, np.concatenate([curve.before, curve.after]))
    ax.set_xlim(*_inner_range(curve.x))
    ax.axhline(0.0, color=BLACK, linewidth=0.8)
    low, high = curve.fitted.mean - 1.96 * curve.fitted.error, curve.fitted.mean + 1.96 * curve.fitted.error
    ax.fill_between(curve.fitted.x, low, high, color=AFTER, alpha=0.22, linewidth=0.0)
    ax.plot(curve.fitted.x, curve.fitted.mean, color=AFTER, linewidth=2.0, label="fitted effect, 95% band")
    _points(ax, curve.binned_before.x, curve.binned_before.mean, curve.binned_before.error, BEFORE, "without it")
    _points(ax, curve.binned_after.x, curve.binned_after.mean, curve.binned_after.error, AFTER, "with it", "s")
    ax.set_xlabel(label_of(curve.variable))
    ax.set_ylabel(f"residual {curve.component} / m/s²")
    _legend_above(ax, columns=3)
    return figure


# --- step responses ---------------------------------------------------------------------------------------------------


@_figure
def step_heights(tracks: Mapping[str, Tracking], width_px: float = PANEL_PX) -> Figure:
    """Heights over time against the reference."""
    figure, ax = _panel(4.2, width_px)
    _draw_steps(ax, tracks)
    ax.set_ylabel("height / m")
    return figure


@_figure
def step_tail(tracks: Mapping[str, Tracking], width_px: float = PANEL_PX) -> Figure:
    """The same after the step has been flown: millimetres above the reference."""
    figure, ax = _panel(4.2, width_px)
    settled = []
    for i, (name, track) in enumerate(tracks.items()):
        error_mm = 1000.0 * track.error_m
        ax.plot(track.time_s, error_mm, label=_label(name), **_step_line(i))
        settled.append(error_mm[track.time_s > 0.2 * track.time_s[-1]])
    ax.axhline(0.0, color=BLACK, linewidth=1.0, linestyle="--")
    end = max(float(track.time_s[-1]) for track in tracks.values())
    ax.set_xlim(0.1 * end, end)
    _limits(ax, np.concatenate(settled), whole=True)
    ax.set_xlabel("time since the step / s")
    ax.set_ylabel("height above the reference / mm")
    _legend_above(ax, columns=2)
    return figure


def _draw_steps(ax: Axes, tracks: Mapping[str, Tracking]) -> None:
    first = next(iter(tracks.values()))
    ax.plot(first.time_s, first.reference_m, color=BLACK, linewidth=1.0, linestyle="--", label="reference")
    for i, (name, track) in enumerate(tracks.items()):
        ax.plot(track.time_s, track.position_m, label=_label(name), **_step_line(i))
    ax.set_xlim(0.0, max(float(track.time_s[-1]) for track in tracks.values()))
    ax.set_xlabel("time since the step / s")
    _legend_above(ax, columns=2)


def _step_line(i: int) -> dict[str, Any]:
    return {"color": FLIGHT_COLOURS[i % len(FLIGHT_COLOURS)], "linewidth": 1.5, "zorder": 3.0 - 0.01 * i}


# --- what the figures share -------------------------------------------------------------------------------------------


def label_of(variable: str) -> str:
    """`climb rate / m/s`"""
    return f"{VARIABLE_NAMES[variable]} / {VARIABLE_UNITS[variable]}"


def p_in_words(p: float) -> str:
    """`< 0.0001`, `0.003`, `0.62`"""
    return "< 0.0001" if p < 1e-4 else f"{p:.1g}" if p < 0.01 else f"{p:.2f}"


def change_in_words(drop: float) -> str:
    """The change of an error whose drop is given, with a true minus sign; `0%` where it rounds to none."""
    percent = round(-100.0 * drop)
    return f"{percent:+d}%".replace("-", "\u2212") if percent else "0%"


def binned(
    x: Floats, values: Floats, noise: Floats | None, dataset: Dataset, shown: np.ndarray | None = None
) -> Binned:
    """Means of `values` in bins of `x` with about the same number of samples each, of the samples `shown`.

    Standard errors come from `noise`, which is `values` without its structure; without it they are 0.
    """
    use = np.ones(len(x), dtype=bool) if shown is None else shown
    edges = np.unique(np.quantile(x[use], np.linspace(0.0, 1.0, RATIO_BINS + 1)))
    index = np.where(use, np.clip(np.searchsorted(edges, x, side="right") - 1, 0, max(len(edges) - 2, 0)), -1)
    centre, mean, error = [], [], []
    for b in np.unique(index[use]):
        inside = index == b
        centre.append(x[inside].mean())
        mean.append(values[inside].mean())
        error.append(0.0 if noise is None else variance_of_sum(inside / inside.sum(), noise, dataset) ** 0.5)
    return Binned(np.array(centre), np.array(mean), np.array(error))


def _drawn_models(addition: Addition, index: int, number: int) -> list[Model]:
    """The model with the parameters of one effect as some of the bootstrap draws have them."""
    free = free_parameters(addition.model)
    own = [i for i, f in enumerate(free) if f.effect == index]
    draws = addition.draws[:number]
    return [with_values(addition.model, [free[i] for i in own], draw[own]) for draw in draws]


def _without(model: Model, index: int) -> Model:
    return replace(model, stack=tuple(item for i, item in enumerate(model.stack) if i != index))


def _ratio(effect: Effect, height_m: Floats, model: Model) -> Floats:
    if not isinstance(effect, NearGround):
        raise TypeError(f"{effect.name} has no thrust ratio over height")
    conditions = Conditions(height_m, (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0))
    return np.asarray(effect.ratio(conditions, model.vehicle) + 0.0 * height_m)


def _variable(dataset: Dataset, name: str) -> Floats:
    found = dataset.variable(name)
    return np.zeros(len(dataset.measured)) if found is None else found


def _heading(dataset: Dataset) -> Floats:
    """Yaw of every sample, rad."""
    yaw = [
        flight.filtered(np.unwrap(np.asarray(euler_from_quaternion(flight.conditions.attitude)[2])))
        for flight in dataset.flights
    ]
    return np.concatenate(yaw)


def _in_heading(values: Floats, yaw: Floats) -> Floats:
    """North, east, up as forward, right, up of a level vehicle with that heading."""
    north, east, up = values.T
    return np.column_stack([np.cos(yaw) * north + np.sin(yaw) * east, np.cos(yaw) * east - np.sin(yaw) * north, up])


def _pushed(push: Floats) -> list[str]:
    """The axes on which an effect does most."""
    size = np.sqrt(np.mean(push**2, axis=0))
    return [axis for axis, value in zip(BODY_AXES, size, strict=True) if value >= 0.3 * size.max()]


def _panel(height_in: float = 4.0, width_px: float = PANEL_PX) -> tuple[Figure, Axes]:
    figure = Figure(figsize=(width_px / 72, height_in))
    return figure, figure.subplots()


def _beside(ax: Axes, x: float, row: int, text: str) -> None:
    """A note to the right of the end of a bar."""
    white = {"facecolor": "white", "edgecolor": "none", "pad": 1.0}
    ax.annotate(
        text, (x, row), (5, 0), textcoords="offset points", va="center", fontsize=10.0, color="#333333", bbox=white
    )


def _label(name: str) -> str:
    """matplotlib leaves out labels that begin with an underscore."""
    return f"\u200b{name}" if name.startswith("_") else name


def _legend_above(ax: Axes, columns: int) -> None:
    ax.legend(
        loc="lower left",
        bbox_to_anchor=(0.0, 1.0),
        ncols=columns,
        borderaxespad=0.2,
        handlelength=1.5,
        columnspacing=1.2,
    )


def _cloud(ax: Axes, x: Floats, y: Floats, colour: str) -> None:
    some = slice(None, None, max(1, len(x) // MAX_DRAWN))
    ax.scatter(x[some], y[some], s=5, color=colour, alpha=0.25, linewidths=0, rasterized=True)


def _points(
    ax: Axes, x: Floats, mean: Floats, error: Floats, colour: str, label: str | None = None, marker: str = "o"
) -> None:
    """Means with 95% error bars."""
    ax.errorbar(
        x, mean, 1.96 * error, fmt=marker, color=colour, label=label, markersize=5, linewidth=1.4, capsize=2, zorder=4
    )


def _limits(ax: Axes, values: Floats, whole: bool = False) -> None:
    """Room for zero and all but the wildest values."""
    low, high = np.quantile(values, [0.0, 1.0] if whole else [0.002, 0.998])
    low, high = min(low, 0.0), max(high, 0.0)
    room = 0.08 * max(float(high - low), 1e-3)
    ax.set_ylim(float(low) - room, float(high) + room)


def _inner_range(x: Floats) -> tuple[float, float]:
    low, high = np.quantile(x, [0.001, 0.999])
    room = 0.03 * max(float(high - low), 1e-6)
    return float(low) - room, float(high) + room


def _pairs(edges: Floats) -> list[tuple[float, float]]:
    return [(float(a), float(b)) for a, b in pairwise(edges)]
