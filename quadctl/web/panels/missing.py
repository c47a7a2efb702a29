"""Panels of what is missing: the candidates with their Add buttons, and the next flight."""

from dataclasses import dataclass

from nicegui import ui

from quadctl.lab.comparison.reservations import is_of_the_thrust
from quadctl.lab.comparison.wording import ERRORS, Said, change_in_words, p_in_words, parameters_in_text, plain
from quadctl.lab.flights.dataset import Dataset
from quadctl.lab.flights.flight import VARIABLE_NAMES
from quadctl.lab.planning.suggestion import Suggestion
from quadctl.lab.selection.candidate import Candidate
from quadctl.lab.selection.wording import reason_against, rival_of
from quadctl.lab.words import Answer, in_words
from quadctl.model import Model
from quadctl.web.elements.html import heading, tag
from quadctl.web.elements.theme import Theme
from quadctl.web.figures.sketch import sketch_svg
from quadctl.web.panels.evidence import Evidence, draw_suggestion
from quadctl.web.panels.overview import Overview
from quadctl.web.panels.panel import Controls, Panel, Tab, work_button
from quadctl.web.panels.verdict import Verdict, draw_expression
from quadctl.web.session.findings import Diagnosed
from quadctl.words import Fact, fact

NOT_NEEDED = "Alternatives to the effects above, not needed beside them."
NO_HELP = "Not significant, too small to matter, within the usual per-flight bias, or physically impossible."


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
        chosen = diagnosis.chosen
        missing = {candidate.effect.name for candidate in chosen}
        alike = {other: first for first, other in diagnosis.confounded}
        rest = [c for c in diagnosis.ranking if c.effect.name not in missing]
        near = diagnosis.considered
        others = [c for c in rest if c not in near]
        if chosen:
            several = (
                "Each change is relative to the model with the effects before it; all parameters are fitted together."
            )
            heading("Missing effects, in the order of adding", several if len(chosen) > 1 else "")
            with tag("div", "candidates"):
                for i, candidate in enumerate(chosen):
                    looks = [other for other, first in alike.items() if first == candidate.family]
                    self._draw_card(do, found, candidate, looks, primary=i == 0)
        for title, text, group in (
            ("Other forms and confounded effects", NOT_NEEDED, near),
            ("Not missing", NO_HELP, others),
        ):
            if group:
                more = ui.expansion(f"{title} ({len(group)})", caption=text).classes("more")
                with more, tag("div", "candidates"):
                    for candidate in group:
                        why = None
                        if candidate.family in alike:
                            why = fact(Answer.INSTEAD, family=alike[candidate.family])
                        if group is others:
                            against = in_words(reason_against(candidate, rival_of(candidate, chosen)))
                            why = fact(Answer.WHY_NOT, reason=against)
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
                draw_expression(do, diagnosis)

    def _draw_expected(self, do: Controls, before: Diagnosed) -> None:
        held = {effect.family() for effect in self.model.effects} if self.model is not None else set()
        left = [candidate for candidate in before.diagnosis.chosen if candidate.family not in held]
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
        why: Fact | None = None,
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
                            f"residual {sketch.component}, bias removed, over {VARIABLE_NAMES[sketch.variable]}",
                        )
                with tag("div", "grow"):
                    tag("h3", "", plain(candidate.family).capitalize())
                    tag("div", "mono muted", name)
                    if candidate.fitted:
                        with tag("div", "numbers"):
                            error = f"held-out {ERRORS[candidate.measure]}"
                            along = f"({change_in_words(candidate.largest_drop)} {candidate.axis})"
                            tag("span", "fall", f"{change_in_words(candidate.held_out_drop)} {error} {along}")
                            tag("span", "muted", f"p {p_in_words(candidate.p_value)}")
            tag("p", "", candidate.effect.physics)
            if candidate.fitted:
                intervals = " (95% intervals)" if candidate.ci95 else ""
                tag("p", "mono muted", f"{parameters_in_text(candidate.effect, candidate.ci95)}{intervals}")
            if alike:
                tag("p", "note", str(fact(Said.LOOKS_LIKE, families=alike)))
            if why is not None:
                tag("p", "note", str(why))
            for remark in candidate.remarks:
                tag("p", "note", f"Note: {remark}.")
            if self.thrust_reservation and is_of_the_thrust(candidate.effect):
                tag("p", "note", self.thrust_reservation)
            held = candidate.family in {effect.family() for effect in candidate.model.effects[:-1]}
            with tag("div", "line wrap actions"):
                props = f'aria-label="Add {name}" {"unelevated" if primary else "outline"}'
                work_button(do, "Add", lambda: do.bench.add(name), props, "add", not held)
                if candidate in found.diagnosis.chosen:
                    show = ui.button("Evidence", icon="fact_check", on_click=lambda: do.show_evidence(name))
                    show.props(f'flat no-caps aria-label="Evidence for {name}"')


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
                    work_button(do, "Suggest a flight", do.bench.suggest, "outline")
            else:
                draw_suggestion(self.suggestion)


TAB = Tab("missing", "What is missing", "search", (Verdict, Candidates, Evidence, NextFlight, Overview))
