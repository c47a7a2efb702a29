"""The effect stack: the effects of the model, their parameters with intervals, and the bias of each flight."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from nicegui import ui

from quadctl.lab.arrays import Mask
from quadctl.lab.comparison.reservations import is_of_the_thrust
from quadctl.lab.comparison.wording import Said as Compared
from quadctl.lab.comparison.wording import bias_of, estimate_in_text, number, plain, plus
from quadctl.lab.evaluation import Evaluation
from quadctl.lab.fitting.nuisances import KINDS, bounds
from quadctl.lab.flights.dataset import Dataset
from quadctl.lab.selection.rule import is_significant
from quadctl.model import StackedEffect
from quadctl.web.elements.html import table, tag
from quadctl.web.panels.glossary import explained
from quadctl.web.panels.panel import Controls, Panel, work_button
from quadctl.web.panels.words import Said
from quadctl.web.session.findings import Diagnosed
from quadctl.web.session.session import Step
from quadctl.words import Fact, fact

AT_LIMIT = 0.98
"""Share of its bound at which an offset is said to be at its limit."""
APART = 3.0
"""Difference of an offset between two flights that is told, in standard deviations of what is usual."""
NUISANCES = {
    "thrust_scale": ("thrust", 100.0, "%"),
    "roll_rad": ("roll", np.degrees(1.0), "°"),
    "pitch_rad": ("pitch", np.degrees(1.0), "°"),
    "height_m": ("height", 1000.0, "mm"),
    "delay_s": ("rotor signal delay", 1000.0, "ms"),
    "levelling": ("tilt error in acceleration", 100.0, "%"),
    "slow_levelling": ("tilt error in acceleration, 3 s mean", 100.0, "%"),
    "attitude_delay_s": ("attitude delay", 1000.0, "ms"),
}
"""Name, factor and unit of each nuisance parameter that acts on the acceleration, for a table."""
BEYOND = {
    "thrust_scale": "more thrust is a thrust scale, or a mass that is not that of the vehicle file: weigh the vehicle",
    "roll_rad": "more roll or pitch is a thrust tilt, a wind, or an autopilot that was not levelled",
    "height_m": "more height is a ground that is not at 0 in the log, or rotors at another height in the vehicle file",
    "delay_s": "more delay is a motor lag, or clocks of the log that differ",
    "attitude_delay_s": "more delay of the attitude is an error of the estimator or of the log's clocks",
    "levelling": "a larger share is an attitude estimate that cannot be relied on in manoeuvres",
}
"""Cause of what is more than a nuisance can be, for the first of those that have the same one."""
SAME_CAUSE = {"pitch_rad": "roll_rad", "slow_levelling": "levelling"}
CORRECTED = {"thrust_scale": "thrust", "roll_rad": "tilt", "delay_s": "lag"}
"""Number of the vehicle that more of a nuisance would correct, for those of which a search can tell."""

_KINDS_BY_FLIGHT = {
    "cross-validated": Said.CROSS_VALIDATED,
    "as it stands": Said.AS_IT_STANDS,
    "held out": Said.HELD_OUT,
}


@dataclass(frozen=True)
class Stack(Panel):
    """The effects of the model, each with a switch and a button that removes it."""

    step: Step | None
    off: frozenset[str]
    confounded: dict[str, tuple[str, ...]]
    seen: Dataset | None
    evaluation: Evaluation | None
    found: Diagnosed | None
    thrust_reservation: str
    can_undo: bool
    can_redo: bool

    def draw(self, do: Controls) -> None:
        if self.step is None:
            return
        model = self.step.model
        with tag("section", "card stack").props('aria-label="Effect stack"'):
            with tag("div", "line"):
                tag("h2", "title grow", "Effects in the model")
                if self.can_undo or self.can_redo:
                    _draw_undo(do, self.can_undo, self.can_redo)
                if model.stack:
                    allowed = self.seen is not None and not self.off
                    work_button(do, "Refit", do.bench.refit, "flat dense", allowed=allowed)
            if not model.stack:
                tag(
                    "p",
                    "muted",
                    f"No effect yet: {model.vehicle.name} is a rigid body with its weight and rotor thrust.",
                )
            for item in model.stack:
                alike = self.confounded.get(item.effect.family(), ())
                _draw_effect(do, item, alike, on=item.effect.name not in self.off)
                if self.thrust_reservation and is_of_the_thrust(item.effect):
                    tag("p", "note", self.thrust_reservation)
            if self.evaluation is not None and len(self.evaluation.by_flight) > 1:
                _draw_errors(self.evaluation)
            if self.evaluation is not None and self.seen is not None:
                _draw_nuisances(self.evaluation, self.seen, self.found)


def _draw_undo(do: Controls, can_undo: bool, can_redo: bool) -> None:
    for name, icon, act, allowed in (
        ("Undo", "undo", do.bench.undo, can_undo),
        ("Redo", "redo", do.bench.redo, can_redo),
    ):
        work_button(do, "", act, f'flat dense round size=sm aria-label="{name}" title="{name}"', icon, allowed)


def _draw_effect(do: Controls, item: StackedEffect, alike: Sequence[str], on: bool) -> None:
    effect = item.effect
    with tag("div", "effect" if on else "effect off"):
        with tag("div", "line"):
            switch = ui.switch(value=on, on_change=lambda: do.act(do.bench.switch(effect.name)))
            do.when_idle(switch.props(f'dense aria-label="{effect.name} on or off"'))
            tag("span", "effect-name grow", plain(effect.family())).props(f'title="{effect.name}"')
            show = ui.button(icon="fact_check", on_click=lambda: do.show_evidence(effect.name))
            show.props(f'flat dense round size=sm aria-label="Evidence for {effect.name}" title="Evidence"')
            show.set_enabled(on)
            props = f'flat dense round size=sm aria-label="Remove {effect.name}"'
            work_button(do, "", lambda: do.bench.remove(effect.name), props, "close")
        tag("div", "mono muted", effect.name)
        if alike:
            tag("p", "note", str(fact(Compared.LOOKS_LIKE, families=alike)))
        ci95 = item.ci95
        units = {p.name: p.unit for p in effect.parameters()}
        if ci95:
            tag("p", "muted what", "In brackets: 95% intervals.")
        with tag("dl", "parameters"):
            for name, value in effect.values().items():
                tag("dt", "", name)
                shown, interval = estimate_in_text(value, ci95.get(name))
                with tag("dd"):
                    tag("span", "", f"{shown} {units[name]}".strip())
                    if interval:
                        tag("span", "muted", f" {interval}").props('title="95% confidence interval"')


def _draw_errors(evaluation: Evaluation) -> None:
    with tag("p", "muted what"):
        explained(f"Errors {kind_of(evaluation)}:")
    rows = [(flight, number(errors["total"])) for flight, errors in evaluation.by_flight.items()]
    table("small by-flight", {"flight": "", "error / m/s²": "number"}, rows)


def kind_of(evaluation: Evaluation) -> Fact:
    """The kind of the errors by flight."""
    return fact(_KINDS_BY_FLIGHT[evaluation.kind], bias=bias_of(evaluation.comparison.dataset))


def apart(evaluation: Evaluation) -> list[Fact]:
    """Biases of single flights that differ much from flight to flight; none where nothing does."""
    fitted = evaluation.solution.optimum.nuisances
    found = []
    for place, kind in enumerate(KINDS):
        size = float(np.ptp(fitted[:, place]))
        if kind.name in NUISANCES and size > APART * kind.prior_std:
            name, factor, unit = NUISANCES[kind.name]
            least = "at least " if _limited(evaluation)[:, place].any() else ""
            space = "" if unit in ("%", "°") else " "
            found.append(fact(Said.APART_BY, name=name, least=least, size=factor * size, unit=f"{space}{unit}"))
    return [fact(Said.APART, differences=found)] if found else []


def at_limits(evaluation: Evaluation, found: Diagnosed | None) -> list[Fact]:
    """The per-flight biases and calibrations that are at the limit of what is usual, and what the search says of an
    effect that more of them would be; none where none is."""
    limited = _at_limit(evaluation)
    if not limited:
        return []
    named = [fact(Said.OF_FLIGHTS, name=NUISANCES[name][0], flights=flights) for name, flights in limited.items()]
    facts = [fact(Said.AT_LIMIT, nuisances=named)]
    causes = dict.fromkeys(SAME_CAUSE.get(name, name) for name in limited)
    ranking = [] if found is None else found.diagnosis.ranking
    for corrected in (CORRECTED[cause] for cause in causes if cause in CORRECTED):
        tried = {c.p_value: c.family for c in ranking if c.effect.corrects == (corrected,)}
        if tried and not is_significant(p := min(tried)):
            facts.append(fact(Said.MORE_IS, family=tried[p], p=p))
    return facts


def _at_limit(evaluation: Evaluation) -> dict[str, list[str]]:
    """Names of the flights with a bias or calibration at its limit, by the name of its kind."""
    names = evaluation.comparison.dataset.names
    limited = _limited(evaluation)
    found = {
        kind.name: [name for name, at_limit in zip(names, limited[:, place], strict=True) if at_limit]
        for place, kind in enumerate(KINDS)
        if kind.name in NUISANCES
    }
    return {kind: flights for kind, flights in found.items() if flights}


def _limited(evaluation: Evaluation) -> Mask:
    """Mask of the offsets that are at the limit of their flight, shape (flights, kinds)."""
    highest = np.array([bounds(flight)[1] for flight in evaluation.comparison.dataset.flights])
    return np.asarray(np.abs(evaluation.solution.optimum.nuisances) > AT_LIMIT * highest)


def _draw_nuisances(evaluation: Evaluation, seen: Dataset, found: Diagnosed | None) -> None:
    fitted = evaluation.solution.optimum.nuisances
    shown = [(place, kind) for place, kind in enumerate(KINDS) if kind.name in NUISANCES]
    at_limit, limited = _at_limit(evaluation), _limited(evaluation)
    if at_limit:
        tag("p", "note", " ".join(map(str, at_limits(evaluation, found))))
    with ui.expansion("Per-flight bias and calibration").classes("nuisances").props("dense"):
        with tag("p", "muted"):
            explained(
                "Per-flight bias and calibration are small offsets that differ between flights. They are fitted "
                "together with the effects, and are not saved with the model."
            )
        with tag("div", "scroll").props('tabindex="0"'), tag("table", "small"):
            with tag("tr"):
                tag("th")
                for flight in seen.names:
                    tag("th", "number", flight)
            for place, kind in shown:
                name, factor, unit = NUISANCES[kind.name]
                with tag("tr"):
                    with tag("td"):
                        explained(f"{name} / {unit}")
                    for value, is_limited in zip(fitted[:, place], limited[:, place], strict=True):
                        text = plus(factor * value, decimals=2)
                        tag("td", "number limited" if is_limited else "number", f"{text} *" if is_limited else text)
        if at_limit:
            beyond = dict.fromkeys(BEYOND[SAME_CAUSE.get(name, name)] for name in at_limit)
            tag("p", "note", f"* At the limit: {'; '.join(beyond)}.")
