"""The verdict of the search for missing effects, with what limits it, and the formula where no effect explains the
residual."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

from nicegui import ui

from quadctl.lab.comparison.agreement import flights_of_the_fit
from quadctl.lab.comparison.remainder import Remainder
from quadctl.lab.comparison.wording import ERRORS, listed, percent, plain
from quadctl.lab.evaluation import Evaluation
from quadctl.lab.finding import Finding, Kind
from quadctl.lab.flights.dataset import Dataset, HoldOut
from quadctl.lab.selection.diagnosis import Diagnosis
from quadctl.lab.selection.unseen import UnseenError
from quadctl.lab.words import Answer, in_words
from quadctl.model import Model
from quadctl.vehicle import Vehicle
from quadctl.web.elements.html import busy, tag
from quadctl.web.panels.evidence import chosen_of
from quadctl.web.panels.glossary import explained
from quadctl.web.panels.panel import Controls, Panel, work_button
from quadctl.web.session.findings import Diagnosed
from quadctl.web.session.session import Rung
from quadctl.web.work.state import LOOKING
from quadctl.words import Fact, fact

OPEN = "info"
"""Icon of a verdict that names nothing, and has no tick either."""
OF_BLOCKS = (
    "Judged on blocks of time of these flights: this is what all of them tell of the vehicle. The other choice, whole "
    "flights (on Flights), also counts what differs from flight to flight, and so tells what to expect of a further "
    "one; of two or three flights it tells little."
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
    rung: Rung | None

    def draw(self, do: Controls) -> None:
        if self.seen is None:
            return
        with tag("section", "card").props('aria-live="polite"'):
            if self.searching:
                with tag("div", "line"):
                    busy()
                    tag("span", "verdict grow", f"{LOOKING}\u2026")
            elif self.found is None:
                self._draw_invitation(do)
            else:
                _draw_verdict(do, self.found.diagnosis, self._said(self.found.diagnosis))
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
        if self.found is None or self.searching:
            return ()
        said = self._said(self.found.diagnosis)
        return said.sentence, *map(in_words, said.more), *self.reservations, *self.cautions

    def _draw_invitation(self, do: Controls) -> None:
        with tag("div", "line"):
            why = "An effect is switched off: switch it on again to search." if self.off else "Not searched yet."
            tag("span", "verdict grow", why)
            if not self.off:
                look = ui.button("Look for what is missing", on_click=lambda: do.act(do.bench.look()))
                look.props("no-caps unelevated")

    def _said(self, diagnosis: Diagnosis) -> "_Said":
        verdict = diagnosis.answer[0]
        if diagnosis.verdict == "missing":
            return _Said("lightbulb", verdict, self._missing(diagnosis), self.condition)
        left = self._remainder()
        stands = self.evaluation is not None and self.evaluation.kind == "as it stands"
        unseen = None if self.evaluation is None else self.evaluation.unseen
        more: list[Finding | Fact] = []
        if stands:
            more = [fact(Answer.AS_AT_STEP)]
        elif left is not None:
            more = [left.said(() if unseen is None else unseen.dataset.names)]
        small = left is not None and left.is_near_the_floor
        if diagnosis.verdict == "unexplained":
            little = Finding(Kind.LITTLE_UNEXPLAINED) if small else verdict
            return _Said("help", little, [*more, fact(Answer.NO_FORM)], self.condition)
        if diagnosis.verdict == "small":
            of_small = [found for found in diagnosis.answer if found.kind is Kind.SMALL]
            return _Said(OPEN, verdict, [*of_small, *more], self.condition)
        found = self._none(diagnosis, stands, small)
        icon = "check_circle" if found.kind is Kind.NOTHING_SIGNIFICANT else OPEN
        return _Said(icon, found, [fact(Answer.NONE_HELPS), *more], self.condition)

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

    def _missing(self, diagnosis: Diagnosis) -> "list[Finding | Fact]":
        """What is said below the verdict on what is missing."""
        more: list[Finding | Fact] = [found for found in diagnosis.answer if found.kind is Kind.ERROR]
        if self.unseen:
            more = [fact(Answer.FOR_FITTING, finding=in_words(found)) for found in more]
        for c in chosen_of(diagnosis):
            if c.measure != "total":
                other = {"family": c.family, "drop": c.held_out_drop, "error": ERRORS[c.measure]}
                more.append(fact(Answer.OTHER_ERROR, **other))
        return [*more, *(found for found in diagnosis.answer if found.kind is Kind.PART_UNEXPLAINED)]

    def _remainder(self) -> Remainder | None:
        """The remaining error, beside the reference error that the ladder shows."""
        if self.evaluation is None or self.floor_m_s2 is None:
            return None
        return replace(self.evaluation.remainder, floor_m_s2=self.floor_m_s2)


class _Said(NamedTuple):
    """A verdict, what is said below it, and the vehicle that must be the one that flew for it to hold."""

    icon: str
    verdict: Finding
    more: list[Finding | Fact]
    condition: Vehicle | None

    @property
    def sentence(self) -> str:
        return in_words(self.verdict, self.condition)


def _draw_verdict(do: Controls, diagnosis: Diagnosis, said: "_Said") -> None:
    with tag("div", "line top verdict-line"):
        ui.icon(said.icon).classes(f"verdict-icon {'open' if said.icon == OPEN else diagnosis.verdict}")
        with tag("div", "grow"):
            tag("p", "verdict", said.sentence).props(f'id="verdict" data-verdict="{diagnosis.verdict}"')
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
