"""The verdict of the search for missing effects, with what limits it, and the formula where no effect explains the
residual."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from nicegui import ui

from quadctl.lab.comparison.wording import listed, percent, plain
from quadctl.lab.evaluation import Evaluation
from quadctl.lab.finding import Kind
from quadctl.lab.flights.dataset import Dataset, HoldOut
from quadctl.lab.selection.diagnosis import Diagnosis
from quadctl.lab.selection.unseen import UnseenError
from quadctl.lab.verdict import Statement, statement
from quadctl.lab.words import Answer, in_words
from quadctl.model import Model
from quadctl.vehicle import Vehicle
from quadctl.web.elements.html import busy, tag
from quadctl.web.panels.glossary import explained
from quadctl.web.panels.panel import Controls, Panel, work_button
from quadctl.web.session.findings import Diagnosed
from quadctl.web.session.session import Step
from quadctl.web.work.state import LOOKING
from quadctl.words import Fact, fact

OPEN = "info"
"""Icon of a verdict that names nothing, and has no tick either."""
ICONS = {"missing": "lightbulb", "unexplained": "help"}
OF_BLOCKS = (
    "Judged on blocks of time of these flights. Judging on whole flights (tab Flights) shows what to expect of a new "
    "flight; use four or more for this."
)


@dataclass(frozen=True)
class Verdict(Panel):
    """The state of the search, or its verdict, with a button that adds all that is missing."""

    seen: Dataset | None
    searching: bool
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
    step: Step | None

    def draw(self, do: Controls) -> None:
        if self.seen is None:
            return
        with tag("section", "card").props('aria-live="polite"'):
            if self.searching:
                with tag("div", "line"):
                    busy()
                    tag("span", "verdict grow", f"{LOOKING}\u2026")
            elif self.found is None or self.statement is None:
                self._draw_invitation(do)
            else:
                _draw_verdict(do, self.found.diagnosis, self.statement, self.condition)
                if self.hold_out == "blocks" and not self.unseen and len(self.seen.flights) > 1:
                    tag("p", "muted", " ".join([OF_BLOCKS, *map(str, on_whole_flights(self.found.diagnosis.unseen))]))
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
        if self.statement is None:
            return ()
        verdict, more = self.statement
        return in_words(verdict, self.condition), *map(in_words, more), *self.reservations, *self.cautions

    def _draw_invitation(self, do: Controls) -> None:
        with tag("div", "line"):
            why = "An effect is switched off: switch it on again to search." if self.off else "Not searched yet."
            tag("span", "verdict grow", why)
            if not self.off:
                look = ui.button("Look for what is missing", on_click=lambda: do.act(do.bench.look()))
                look.props("no-caps unelevated")

    @property
    def statement(self) -> Statement | None:
        """The verdict, with what is said below it; None before the end of the search."""
        if self.found is None or self.searching:
            return None
        unseen, model = {log.name for log in self.unseen}, None if self.step is None else self.step.model
        return statement(self.found.diagnosis, model, unseen, self.evaluation, self.floor_m_s2)


def _draw_verdict(do: Controls, diagnosis: Diagnosis, said: Statement, condition: Vehicle | None) -> None:
    with tag("div", "line top verdict-line"):
        sure = said.verdict.kind is Kind.NOTHING_SIGNIFICANT
        icon = "check_circle" if sure else ICONS.get(diagnosis.verdict, OPEN)
        ui.icon(icon).classes(f"verdict-icon {'open' if icon == OPEN else diagnosis.verdict}")
        with tag("div", "grow"):
            verdict = tag("p", "verdict", in_words(said.verdict, condition))
            verdict.props(f'id="verdict" data-verdict="{diagnosis.verdict}"')
            for each in said.more:
                with tag("p", "muted"):
                    explained(in_words(each))
        names = [step.effect for step in diagnosis.steps[1:]]
        if names:
            label = f"Add {plain(diagnosis.missing[0])}" if len(names) == 1 else f"Add all {len(names)}"
            props = f'unelevated aria-label="{label}: {listed(names)}"'
            work_button(do, label, lambda: do.bench.add(*names), props)
    if diagnosis.verdict == "unexplained":
        draw_expression(do, diagnosis)


def draw_expression(do: Controls, diagnosis: Diagnosis) -> None:
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
        work_button(do, "Add it as an effect of your own", do.bench.add_expression, "outline", "add")
        tag("span", "muted grow", "A formula without physics: valid only within the range of these flights.")


def on_whole_flights(unseen: Sequence[UnseenError]) -> list[Fact]:
    """The error with what was found where whole flights are held out, beside that on blocks of time; none where it is
    not known."""
    by = {error.hold_out: error for error in unseen}
    if not {"blocks", "flights"} <= by.keys():
        return []
    before, after = (getattr(by["flights"], which)["total"] for which in ("before", "after"))
    on_blocks = by["blocks"].after["total"]
    return [fact(Answer.BY_FLIGHTS, same=before == after, before=before, after=after, on_blocks=on_blocks)]
