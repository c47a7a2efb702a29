"""The search for missing effects: its verdict, the candidates with their Add buttons, and the next flight."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from nicegui import ui

from quadctl.lab.comparison.agreement import flights_of_the_fit
from quadctl.lab.comparison.remainder import Remainder
from quadctl.lab.comparison.reservations import is_of_the_thrust, on_condition
from quadctl.lab.comparison.wording import (
    ERRORS,
    change_in_words,
    listed,
    looks_like,
    p_in_words,
    parameters_in_text,
    percent,
    plain,
    quantity,
    remainder_in_words,
    sentence,
)
from quadctl.lab.evaluation import Evaluation
from quadctl.lab.finding import Finding, Kind
from quadctl.lab.flights.dataset import Dataset, HoldOut
from quadctl.lab.flights.flight import VARIABLE_NAMES, Flight
from quadctl.lab.flights.prediction import AXES, rmse
from quadctl.lab.planning.suggestion import Suggestion
from quadctl.lab.selection.candidate import Candidate
from quadctl.lab.selection.diagnosis import Diagnosis
from quadctl.lab.selection.rule import is_supported
from quadctl.lab.selection.unseen import UnseenError
from quadctl.lab.selection.wording import reason_against
from quadctl.lab.words import in_words
from quadctl.logs.flight_log import FlightLog
from quadctl.model import Model
from quadctl.vehicle import Vehicle
from quadctl.web.elements.html import busy, empty, heading, loading, plot, tag
from quadctl.web.elements.theme import Theme
from quadctl.web.figures.channels import channel_timeline
from quadctl.web.figures.sketch import sketch_svg
from quadctl.web.figures.timeline import short_timeline
from quadctl.web.panels.evidence import Evidence, chosen_of, draw_suggestion, rival_of
from quadctl.web.panels.glossary import explained
from quadctl.web.panels.panel import Controls, Panel, Tab
from quadctl.web.panels.stack import kind_in_words
from quadctl.web.panels.zoomed import zoomed_plot
from quadctl.web.session.findings import Diagnosed
from quadctl.web.session.session import Rung
from quadctl.web.work.predictions import predictions

OPEN = "info"
"""Icon of a verdict that names nothing, and has no tick either."""
AS_LOGGED = ("z_m", "z_ref_m", "vx_m_s", "vy_m_s", "vz_m_s")
TRIM_SEEN = 1.1
"""Least ratio of the error of a line as it is drawn to the error without trim at which the difference is told."""
OF_BLOCKS = (
    "Judged on blocks of time of these flights: this is what all of them tell of the vehicle. The other choice, whole "
    "flights (on Flights), also counts what differs from flight to flight, and so tells what to expect of a further "
    "one; of two or three flights it tells little."
)
NOT_NEEDED = "They explain what those above explain, and are not needed together with them."
NO_HELP = "These effects do not reduce the held-out error by more than chance might, or not as they physically can."


@dataclass(frozen=True)
class Overview(Panel):
    """Measured and predicted acceleration: the first figure that a person sees."""

    flight: Flight | None
    reading: bool
    as_read: tuple[FlightLog, ...]
    models: dict[str, Model]
    axis: str
    theme: Theme

    def draw(self, do: Controls) -> None:
        flight = self.flight
        if flight is None and self.reading and self.as_read:
            first = self.as_read[0]
            with tag("section", "card"):
                heading(f"{first.name}, as it was logged", "It is being prepared: a prediction follows.")
                timeline = channel_timeline(self.as_read[:1], AS_LOGGED, self.theme)
                plot(timeline.figure(self.theme), "as_logged", "Height and velocity as logged")
        elif flight is None and self.reading:
            loading("Reading the flights")
        elif flight is None:
            empty("insights", "No flight yet", "Open a flight log to see where your model is wrong.")
        else:
            with tag("section", "card"):
                heading(f"{flight.name}: measured and predicted acceleration")
                do.nest(ErrorsByAxis)
                timeline = short_timeline(flight, predictions(self.models, flight), self.axis, self.theme)
                label = "Measured and predicted acceleration over time"
                zoomed_plot(timeline, self.theme, "measured_and_predicted", label)


@dataclass(frozen=True)
class ErrorsByAxis(Panel):
    """Errors in the flight that is shown, of all axes and of the one that is shown; a panel of its own, so that the
    figure below stays."""

    evaluation: Evaluation | None
    flight: Flight | None
    model: Model | None
    axis: str

    def draw(self, do: Controls) -> None:
        if self.evaluation is None or self.flight is None or self.flight.name not in self.evaluation.by_flight:
            return
        errors = self.evaluation.by_flight[self.flight.name]
        worst = max(AXES, key=errors.__getitem__)
        where = "Error" if len(self.evaluation.by_flight) == 1 else "Error in this flight"
        shown = f"{where}, all axes: {quantity(errors['total'])}; shown is {self.axis}, {quantity(errors[self.axis])}"
        largest = f". It is largest {worst}: {quantity(errors[worst])}"
        kind = sentence(kind_in_words(self.evaluation))
        with tag("p", "muted"):
            at_worst = ", the axis with the largest error"
            drawn = "" if self.model is None else as_drawn(errors[self.axis], self.model, self.flight, self.axis)
            quiet = beside_the_motion(errors[self.axis], self.flight, self.axis)
            explained(f"{shown}{at_worst if self.axis == worst else largest}. {kind}.{drawn}{quiet}")


def as_drawn(error_m_s2: float, model: Model, flight: Flight, axis: str) -> str:
    """Sentence on a line that is farther from the measured one than the error says, which leaves trims out; empty where
    it is not."""
    off = rmse(flight.measured - predictions({"": model}, flight)[""])[axis]
    if off < TRIM_SEEN * error_m_s2:
        return ""
    return f" The line is drawn without the per-flight bias, as the model flies: it is off by {quantity(off)} {axis}."


def on_whole_flights(unseen: Sequence[UnseenError]) -> str:
    """Sentence on the error with what was found where whole flights are held out, beside that on blocks of time; empty
    where it is not known."""
    by = {error.hold_out: error for error in unseen}
    if not {"blocks", "flights"} <= by.keys():
        return ""
    before, after = (getattr(by["flights"], which)["total"] for which in ("before", "after"))
    if before == after:
        return f" With whole flights held out the error is {quantity(before)}."
    on_blocks = quantity(by["blocks"].after["total"])
    return (
        f" With all that is missing, the error with whole flights held out is {quantity(after)} instead of "
        f"{quantity(before)}; on blocks of time it is {on_blocks}."
    )


def beside_the_motion(error_m_s2: float, flight: Flight, axis: str) -> str:
    """Sentence on a flight that accelerates less along an axis than the model is wrong by; empty where it does not."""
    moves = float(np.sqrt(np.mean(flight.measured[:, AXES.index(axis)] ** 2)))
    if error_m_s2 <= moves:
        return ""
    closer = " No acceleration at all would be a closer prediction here"
    return f"{closer}: it is {quantity(moves)} {axis} (RMS)."


@dataclass(frozen=True)
class Verdict(Panel):
    """The state of the search, or its verdict, with a button that adds all that is missing."""

    seen: Dataset | None
    search_title: str | None
    found: Diagnosed | None
    off: frozenset[str]
    unseen: frozenset[Path]
    evaluation: Evaluation | None
    floor_m_s2: float | None
    hold_out: HoldOut
    unconfirmed: Vehicle | None
    weight_doubts: tuple[str, ...]
    model: Model | None
    cautions: tuple[str, ...]
    reservations: tuple[str, ...]
    rung: Rung | None

    def draw(self, do: Controls) -> None:
        if self.seen is None:
            return
        with tag("section", "card").props('aria-live="polite"'):
            if self.search_title is not None:
                with tag("div", "line"):
                    busy()
                    tag("span", "verdict grow", f"{self.search_title}\u2026")
            elif self.found is None:
                self._draw_invitation(do)
            else:
                _draw_verdict(do, self.found.diagnosis, self._with_reservation(self._in_words(self.found.diagnosis)))
                if self.hold_out == "blocks" and not self.unseen and len(self.seen.flights) > 1:
                    tag("p", "muted", f"{OF_BLOCKS}{on_whole_flights(self.found.diagnosis.unseen)}")
                for said in (*self.reservations, *self.cautions):
                    tag("p", "note", said)

    @property
    def condition(self) -> Vehicle | None:
        """The vehicle, where the verdict holds only if it is the one that flew."""
        return self.model.vehicle if self.weight_doubts and self.model is not None else self.unconfirmed

    @property
    def sentences(self) -> tuple[str, ...]:
        """The verdict in words with what is to be said of the data, the main sentence first; empty before the end of
        the search."""
        if self.found is None or self.search_title is not None:
            return ()
        said = self._with_reservation(self._in_words(self.found.diagnosis))
        return said.verdict, *said.more, *self.reservations, *self.cautions

    def _draw_invitation(self, do: Controls) -> None:
        with tag("div", "line"):
            why = "An effect is switched off: switch it on again to search." if self.off else "Not searched yet."
            tag("span", "verdict grow", why)
            if not self.off:
                look = ui.button("Look for what is missing", on_click=lambda: do.act(do.bench.look()))
                look.props("no-caps unelevated")

    def _in_words(self, diagnosis: Diagnosis) -> "_Said":
        if diagnosis.verdict == "missing":
            return _Said("lightbulb", in_words(diagnosis.answer[0]), self._missing(diagnosis))
        left = self._remainder()
        stands = self.evaluation is not None and self.evaluation.kind == "as it stands"
        more = [] if left is None else [remainder_in_words(left, self._on_held_out())]
        if stands:
            more = ["The search refits the model to these flights; the error at the top is of the model as it stands."]
        small = left is not None and left.is_near_the_floor
        if diagnosis.verdict == "unexplained":
            more.append("The residual depends on the logged variables, but no effect of the catalogue describes how.")
            return _Said("help", in_words(Finding(Kind.LITTLE_UNEXPLAINED) if small else diagnosis.answer[0]), more)
        if diagnosis.verdict == "small":
            of_small = [in_words(found) for found in diagnosis.answer if found.kind is Kind.SMALL]
            return _Said(OPEN, in_words(diagnosis.answer[0]), of_small + more)
        more.insert(0, "No effect of the catalogue reduces the held-out error enough to matter.")
        found = self._none(diagnosis, stands, small)
        return _Said("check_circle" if found.kind is Kind.NOTHING_SIGNIFICANT else OPEN, in_words(found), more)

    def _none(self, diagnosis: Diagnosis, stands: bool, small: bool) -> Finding:
        """Finding that nothing is missing, with what limits it: the flights of the fit, or the error that remains."""
        used, new = ([], []) if self.rung is None else flights_of_the_fit(self.rung.model, diagnosis.dataset.names)
        known = sorted({log.name for log in self.unseen} & set(used))
        if known:
            return Finding(Kind.NONE_BUT_FITTED_TO_HELD_OUT, {"flights": known})
        if used and (stands or new):
            return Finding(Kind.NONE_BUT_FITTED_TO_OTHERS, {"flights": used})
        if stands:
            return Finding(Kind.NONE_BUT_NOT_FITTED)
        if small:
            return Finding(Kind.NOTHING_SIGNIFICANT)
        if self._remainder() is not None and self.evaluation is not None and self.evaluation.unseen is not None:
            return Finding(Kind.NONE_BUT_LARGER_HELD_OUT, {"flights": list(diagnosis.dataset.names)})
        return Finding(Kind.NONE_BUT_MORE_THAN_NOISE)

    def _with_reservation(self, said: "_Said") -> "_Said":
        """The verdict on the condition that the vehicle is the one that flew, where nobody has said so, or where its
        thrust would carry another weight."""
        return said._replace(verdict=on_condition(said.verdict, self.condition))

    def _missing(self, diagnosis: Diagnosis) -> list[str]:
        """Sentences below the verdict on what is missing."""
        more = [in_words(found) for found in diagnosis.answer if found.kind is Kind.ERROR]
        if self.unseen:
            more = [f"{said} The flights are those for fitting." for said in more]
        for candidate in chosen_of(diagnosis):
            if candidate.measure != "total":
                falls = f"{change_in_words(candidate.held_out_drop)} held-out {ERRORS[candidate.measure]}"
                more.append(f"What shows {plain(candidate.family)} is another error: {falls}.")
        return more + [in_words(found) for found in diagnosis.answer if found.kind is Kind.PART_UNEXPLAINED]

    def _remainder(self) -> Remainder | None:
        """The remaining error, beside the reference error that the ladder shows."""
        if self.evaluation is None or self.floor_m_s2 is None:
            return None
        return replace(self.evaluation.remainder, floor_m_s2=self.floor_m_s2)

    def _on_held_out(self) -> str:
        if self.evaluation is None or self.evaluation.unseen is None:
            return ""
        return f" on the held-out {listed(self.evaluation.unseen.dataset.names)}"


class _Said(NamedTuple):
    """A verdict in words."""

    icon: str
    verdict: str
    more: list[str]


def _draw_verdict(do: Controls, diagnosis: Diagnosis, said: "_Said") -> None:
    with tag("div", "line top verdict-line"):
        ui.icon(said.icon).classes(f"verdict-icon {'open' if said.icon == OPEN else diagnosis.verdict}")
        with tag("div", "grow"):
            tag("p", "verdict", said.verdict).props(f'id="verdict" data-verdict="{diagnosis.verdict}"')
            for each in said.more:
                with tag("p", "muted"):
                    explained(each)
        names = [step.effect for step in diagnosis.steps[1:]]
        if names:
            label = f"Add {plain(diagnosis.missing[0])}" if len(names) == 1 else f"Add all {len(names)}"
            add = ui.button(label, on_click=lambda: do.act(do.bench.add(*names)))
            do.when_idle(add.props(f'no-caps unelevated aria-label="{label}: {listed(names)}"'))
    if diagnosis.verdict == "unexplained":
        _draw_expression(do, diagnosis)


def _draw_expression(do: Controls, diagnosis: Diagnosis) -> None:
    """Draw the formulas for what no effect explains."""
    if not diagnosis.unexplained:
        return
    if diagnosis.symbolic is None:
        text = "No expression of a few terms describes it: its cause may not be logged."
        tag("p", "muted", text)
        return
    tag("p", "", "The residual as an expression of the logged variables:")
    for law in diagnosis.symbolic.laws:
        tag("pre", "expression", f"{law.axis} acceleration / m/s² = {law.best.text}")
        share = percent(law.best.held_out_share)
        tag("p", "muted", f"It explains {share} of the squared residual on that axis, on held-out data.")
    with tag("div", "line wrap"):
        add = ui.button(
            "Add it as an effect of your own", icon="add", on_click=lambda: do.act(do.bench.add_expression())
        )
        do.when_idle(add.props("no-caps outline"))
        tag("span", "muted grow", "A formula without physics: valid only within the range of these flights.")


@dataclass(frozen=True)
class Candidates(Panel):
    """The effects that were tried, best first; while a new search runs, those that the last one found missing."""

    seen: Dataset | None
    model: Model | None
    off: frozenset[str]
    found: Diagnosed | None
    before: Diagnosed | None
    thrust_reservation: str
    theme: Theme

    def draw(self, do: Controls) -> None:
        if self.seen is None:
            return
        if self.found is not None:
            self._draw_found(do, self.found)
        elif self.before is not None and not self.off:
            self._draw_expected(do, self.before)

    def _draw_found(self, do: Controls, found: Diagnosed) -> None:
        diagnosis = found.diagnosis
        chosen = chosen_of(diagnosis)
        missing = {candidate.effect.name for candidate in chosen}
        alike = {other: first for first, other in diagnosis.confounded}
        rest = [c for c in diagnosis.ranking if c.effect.name not in missing]
        near = [c for c in rest if is_supported(c) or c.family in alike]
        others = [c for c in rest if c not in near]
        if chosen:
            several = "Each change is against the model with those before it; the parameters are of all together."
            heading("Missing effects, in the order of adding", several if len(chosen) > 1 else "")
            with tag("div", "candidates"):
                for i, candidate in enumerate(chosen):
                    looks = [other for other, first in alike.items() if first == candidate.family]
                    self._draw_card(do, found, candidate, looks, primary=i == 0)
        for title, text, group in (
            ("Other forms and confounded effects", NOT_NEEDED, near),
            ("Not supported by these data", NO_HELP, others),
        ):
            if group:
                more = ui.expansion(f"{title} ({len(group)})", caption=text).classes("more")
                with more, tag("div", "candidates"):
                    for candidate in group:
                        why = _instead_of(alike[candidate.family]) if candidate.family in alike else ""
                        if group is others:
                            why = f"Why not: {in_words(reason_against(candidate, rival_of(candidate, chosen)))}."
                        self._draw_card(do, found, candidate, [], primary=False, why=why)
        if diagnosis.untried:
            text = "The flights do not vary enough to identify these effects."
            with (
                ui.expansion(f"Not tried ({len(diagnosis.untried)})", caption=text).classes("more"),
                tag("ul", "plain"),
            ):
                for reason in diagnosis.untried:
                    tag("li", "", f"{in_words(reason)}.")
        if diagnosis.verdict == "missing" and diagnosis.unexplained:
            with tag("section", "card"):
                heading("Residual that these effects do not explain")
                _draw_expression(do, diagnosis)

    def _draw_expected(self, do: Controls, before: Diagnosed) -> None:
        held = {effect.family() for effect in self.model.effects} if self.model is not None else set()
        left = [candidate for candidate in chosen_of(before.diagnosis) if candidate.family not in held]
        if left:
            heading("Found by the last search, and not added yet")
            with tag("div", "candidates"):
                for i, candidate in enumerate(left):
                    self._draw_card(do, before, candidate, [], primary=i == 0)

    def _draw_card(
        self,
        do: Controls,
        found: Diagnosed,
        candidate: Candidate,
        alike: list[str],
        primary: bool,
        why: str = "",
    ) -> None:
        name = candidate.effect.name
        with tag("article", "card candidate primary" if primary else "card candidate").props(f'data-effect="{name}"'):
            with tag("div", "line top"):
                if name in found.sketches:
                    with tag("figure", "sketch-figure"):
                        sketch = found.sketches[name]
                        ui.html(sketch_svg(sketch, self.theme), sanitize=False).classes("sketch")
                        tag(
                            "figcaption",
                            "muted",
                            f"{sketch.component} over {VARIABLE_NAMES[sketch.variable]}, without per-flight biases",
                        )
                with tag("div", "grow"):
                    tag("h3", "", plain(candidate.family).capitalize())
                    tag("div", "mono muted", name)
                    with tag("div", "numbers"):
                        error = f"held-out {ERRORS[candidate.measure]}"
                        tag("span", "fall", f"{change_in_words(candidate.held_out_drop)} {error}")
                        tag("span", "muted", f"p {p_in_words(candidate.p_value)}")
            tag("p", "", candidate.effect.physics)
            intervals = " (95% intervals)" if candidate.ci95 else ""
            tag("p", "mono muted", f"{parameters_in_text(candidate.effect, candidate.ci95)}{intervals}")
            if alike:
                tag("p", "note", looks_like(alike))
            if why:
                tag("p", "note", why)
            for remark in candidate.remarks:
                tag("p", "note", f"Note: {remark}.")
            if self.thrust_reservation and is_of_the_thrust(candidate.effect):
                tag("p", "note", self.thrust_reservation)
            held = candidate.family in {effect.family() for effect in candidate.model.effects[:-1]}
            with tag("div", "line wrap actions"):
                add = ui.button("Add", icon="add", on_click=lambda: do.act(do.bench.add(name)))
                add.props(f'no-caps aria-label="Add {name}"').props("unelevated" if primary else "outline")
                do.when_idle(add, not held)
                if candidate in chosen_of(found.diagnosis):
                    show = ui.button("Evidence", icon="fact_check", on_click=lambda: do.show_evidence(name))
                    show.props(f'flat no-caps aria-label="Evidence for {name}"')


def _instead_of(other: str) -> str:
    """Sentences on a candidate that the data did not distinguish from an effect that was chosen."""
    same = f"It explains the same as {plain(other)}: beside that it changes nothing, instead of it it would."
    return f"{same} These data do not tell which of the two it is."


@dataclass(frozen=True)
class NextFlight(Panel):
    """The mission whose data would tell most."""

    seen: Dataset | None
    found: Diagnosed | None
    suggestion: Suggestion | None

    def draw(self, do: Controls) -> None:
        if self.seen is None or self.found is None:
            return
        with tag("section", "card"):
            heading("Which flight next?")
            if self.suggestion is None:
                with tag("div", "line"):
                    text = "Every mission is predicted with the model, and ranked by the information that it adds."
                    tag("p", "muted grow", text)
                    ask = ui.button("Suggest a flight", on_click=lambda: do.act(do.bench.suggest()))
                    do.when_idle(ask.props("no-caps outline"))
            else:
                draw_suggestion(self.suggestion)


TAB = Tab("missing", "What is missing", "search", (Verdict, Candidates, Evidence, NextFlight, Overview))
