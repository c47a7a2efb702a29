"""Sections on added effects: errors before and after, and the fitted effects."""

from typing import NamedTuple

import numpy as np

from quadctl.effects.ground_effect import NearGround
from quadctl.lab import plots
from quadctl.lab.comparison.failures import most_telling
from quadctl.lab.comparison.reservations import is_of_the_thrust, thrust_reservation
from quadctl.lab.comparison.wording import (
    change_in_words,
    flights_in_words,
    held_out,
    listed,
    parameters_in_text,
    percent,
    quantity,
)
from quadctl.lab.effect_curves import effect_curves, ratio_curve
from quadctl.lab.fitting.bootstrap import drop_interval
from quadctl.lab.flights.dataset import Dataset
from quadctl.lab.flights.flight import VARIABLE_NAMES, VARIABLE_UNITS
from quadctl.lab.report.compared import time_figures
from quadctl.lab.report.numbers import unseen_before, unseen_residuals
from quadctl.lab.report.parts import Cell, Figure, Section, Table, both_widths, figure
from quadctl.lab.report.results import Results
from quadctl.lab.selection.addition import Addition
from quadctl.lab.words import Answer
from quadctl.words import Fact, count, fact


def before_and_after(r: Results) -> Section | None:
    figures, text = [], []
    for name, (what, beside, dataset, before, after) in _held_out_results(r).items():
        change = change_in_words(1.0 - after["total"] / before["total"])
        text.append(
            f"On {held_out(dataset)}, adding {what} takes the acceleration error from {quantity(before['total'])} to "
            f"{quantity(after['total'])} ({change}){beside}."
        )
        floor = r.floors if dataset.names == r.comparison.dataset.names else None
        caption = f"Held-out parts of the flights of the fit, without and with {what}."
        figures.append(figure(plots.before_after(before, after, floor), name, caption))
    if r.after is not None:
        old, new = unseen_residuals(r)
        low, high = drop_interval(old, new, r.after.dataset.block)
        flights = flights_in_words(r.after.dataset.names)
        before = unseen_before(r)
        text.append(
            f"On {flights}, which no fit has seen, the acceleration error goes from {quantity(before['total'])} to "
            f"{quantity(r.after.rmse['total'])}: {percent(1.0 - r.after.rmse['total'] / before['total'])} less "
            f"(95% interval {percent(low)} to {percent(high)})."
        )
        places = len(r.after.fails_where)
        text.append(
            f"There the improved model still fails in {count(places, 'range')}. "
            f"{most_telling(r.after.fails_where)[0].said}."
            if places
            else "There the improved model has no significant error in any range of a variable."
        )
        figures.append(
            figure(
                plots.before_after(before, r.after.rmse, r.after.noise_floor), "unseen-bars", f"Unseen data: {flights}."
            )
        )
        improved = {"before": r.comparison, "after": r.after}
        figures += time_figures(r.after, improved, "unseen")
    if not figures:
        return None
    return Section(
        "before-after", "Acceleration error before and after, on data that the fit has not seen", text, figures
    )


class _HeldOut(NamedTuple):
    what: str
    beside: str
    """Effects that the model holds without it, in words."""
    dataset: Dataset
    before: dict[str, float]
    after: dict[str, float]


def _held_out_results(r: Results) -> dict[str, _HeldOut]:
    """Held-out errors with all missing effects, and with the effect added last where that is not the same."""
    found = {}
    d, a = r.diagnosis, r.addition
    if d is not None and len(d.steps) > 1:
        what = listed([step.effect for step in d.steps[1:]])
        found["found"] = _HeldOut(what, "", d.dataset, d.steps[0].rmse, d.steps[-1].rmse)
    if a is not None and (not found or a.model.effects[-1].name != found["found"].what):
        others = [effect.name for effect in a.model.effects[:-1]]
        beside = f", the last step, beside {listed(others)}" if others else ""
        found["added"] = _HeldOut(a.model.effects[-1].name, beside, a.dataset, a.before, a.after)
    return found


def fitted_effects(r: Results) -> Section | None:
    a = r.addition
    if a is None:
        return None
    text: list[str] = []
    figures, rows = [], []
    order = list(range(len(a.model.stack)))[::-1]  # what was added last is what the page is about
    for index in order:
        item = a.model.stack[index]
        reservation = thrust_reservation(a.model.vehicle, a.dataset) if is_of_the_thrust(item.effect) else None
        note = " ".join([item.effect.source, *([] if reservation is None else [f"{reservation}."])])
        rows.append([Cell(item.effect.name, note), Cell(parameters_in_text(item.effect, item.ci95))])
        if isinstance(item.effect, NearGround):
            sentences, figure = _ground_effect(a, index)
            text += map(str, sentences)
            figures.append(figure)
        else:
            figures += _other_effect(a, index)
    figures.sort(key=lambda figure: not figure.whole_width)
    if any(not isinstance(effect, NearGround) for effect in a.model.effects):
        text.append(
            "For effects that are not a ratio over height: residual without and with the effect, apart from the "
            "per-flight bias, and its contribution (band: 95% of its parameters' bootstrap draws); forward and right "
            "are those of the vehicle's heading."
        )
    return Section(
        "effects",
        r.titled_last("The fitted effect" if len(order) == 1 else "The fitted effects"),
        text,
        figures,
        points=[f"Note: {remark}." for remark in a.remarks],
        tables=[Table(["effect", "parameters [95% interval]"], rows, words=2)],
    )


def _ground_effect(a: Addition, index: int) -> tuple[list[Fact], Figure]:
    curve = ratio_curve(a, index)
    lowest = max(curve.data_range[0], float(curve.height_over_radius[0]))
    ratio, low, high = (
        float(np.interp(lowest, curve.height_over_radius, y)) for y in (curve.ratio, curve.low, curve.high)
    )
    facts = {"height_over_radius": lowest, "ratio": ratio, "low": low, "high": high, "fitted": high > low}
    text = [fact(Answer.AT_LOWEST, **facts), fact(Answer.DOTS)]
    name = a.model.effects[index].name
    figure = both_widths(
        f"ratio-{index}",
        f"{name}: thrust ratio over height, with textbook curves for comparison; the shaded heights were flown.",
        plots.thrust_ratio(a, index),
        plots.thrust_ratio(a, index, plots.NARROW_PX),
    )
    return text, figure


def _other_effect(a: Addition, index: int) -> list[Figure]:
    name = a.model.effects[index].name
    return [
        figure(
            plots.effect_over_variable(curve),
            f"effect-{index}-{i}",
            f"{name}: {curve.component} residual over {VARIABLE_NAMES[curve.variable]} "
            f"({VARIABLE_UNITS[curve.variable]}).",
        )
        for i, curve in enumerate(effect_curves(a, index))
    ]
