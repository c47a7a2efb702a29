"""The evidence for an effect, missing or in the model: its curve, the error per axis, what lost, the next flight."""

from dataclasses import dataclass
from typing import Literal

from nicegui import ui

from quadctl.lab.comparison.wording import ERRORS, change_in_words, listed, plain, sentence
from quadctl.lab.evidence import Evidence as Found
from quadctl.lab.flights.flight import VARIABLE_NAMES
from quadctl.lab.flights.prediction import GROUPS, MOMENTS, SENSED
from quadctl.lab.planning.suggestion import Suggestion
from quadctl.lab.selection.candidate import LEAST_ERROR, Candidate
from quadctl.lab.selection.wording import error_in_table, p_in_table, reason_against, rival_of, unit_of
from quadctl.lab.words import in_words
from quadctl.web.elements.html import heading, loading, plot, table, tag
from quadctl.web.elements.theme import Theme
from quadctl.web.figures.evidence import evidence_figure
from quadctl.web.panels.panel import Controls, Panel, work_button
from quadctl.web.panels.words import Said
from quadctl.web.session.findings import Diagnosed
from quadctl.web.work.state import Gathered
from quadctl.words import Fact, fact

_OF_GROUP = {"total": "all axes", "turning": "moments of all axes", "sensing": "accelerometer error of all axes"}
_AXES = {axis: f"{axis} moment" for axis in MOMENTS}
_AXES |= {axis: f"accelerometer error {axis.removeprefix('imu_')}" for axis in SENSED}
"""Names of axes in words, where the name of the axis does not say it."""
LOSERS = 8
"""Most effects whose reason is shown at once; the others are folded."""


@dataclass(frozen=True)
class Evidence(Panel):
    """The evidence for the effect that was asked for; it is computed when it is opened, not before."""

    gathered: Gathered | None
    gathering: Literal["", "wanted", "waiting", "cancelled"]
    suggestion: Suggestion | None
    evidence: str
    theme: Theme

    def draw(self, do: Controls) -> None:
        if self.gathered is None:
            self._draw_gathering(do)
            return
        shown, search = self.gathered.evidence, self.gathered.search
        name = plain(shown.effect.family())
        with tag("section", "card evidence").props(f'id="evidence" aria-label="Evidence for {name}"') as card:
            with tag("div", "line top"):
                with tag("div", "grow"):
                    heading(f"Evidence for {name}", shown.effect.physics)
                ui.button(icon="close", on_click=lambda: do.show_evidence("")).props(
                    'flat dense round aria-label="Close the evidence"'
                )
            tag("p", "muted", str(fact(Said.FITTED_TOGETHER, beside=shown.beside)))
            with tag("div", "panes"):
                for curve in shown.curves:
                    label = f"{sentence(name)} over {VARIABLE_NAMES[curve.variable]}, {curve.component}"
                    file = f"{shown.effect.name}_over_{curve.variable}_{curve.component.replace(' ', '_')}"
                    plot(evidence_figure(curve, self.theme), file, label)
            tag("h3", "", "Held-out error before and after")
            beside = f", beside {listed([plain(family) for family in shown.beside])}," if shown.beside else ""
            change = f"the held-out {ERRORS[shown.measure]} changes by {shown.drop_in_words} (95%)"
            tag("p", "", f"With it{beside} instead of without it, {change}.")
            _draw_errors(shown)
            tag("h3", "", "What else was tried, and why it lost")
            _draw_losers(search, shown.effect.name)
            tag("h3", "", "The next flight")
            self._draw_next(do, shown)
        card.run_method("scrollIntoView", {"block": "nearest"})

    def _draw_gathering(self, do: Controls) -> None:
        """Draw what is to be seen until the evidence is there; what is wanted is begun."""
        if not self.gathering:
            return
        with tag("section", "card evidence").props('id="evidence" aria-label="Evidence"') as card:
            heading(f"Evidence for {self.evidence}")
            if self.gathering == "cancelled":
                again = ui.button("Gather the evidence", on_click=lambda: do.act(do.bench.gather(self.evidence)))
                again.props("no-caps outline")
            else:
                loading("Fitting the model with it and without it")
        card.run_method("scrollIntoView", {"block": "nearest"})
        if self.gathering == "wanted":
            do.bench.begin_to_gather(self.evidence)

    def _draw_next(self, do: Controls, shown: Found) -> None:
        """Draw one command: that of the mission that would add the most to these flights, as soon as it is known."""
        if self.suggestion is not None:
            tag("p", "", "Of all missions, by what their data would add to these flights about the whole model:")
            draw_suggestion(self.suggestion)
        else:
            name = plain(shown.effect.family())
            tag("p", "", f"To distinguish {name} from confounded effects: {shown.effect.distinguished_by}.")
            work_button(do, "Compare all missions", do.bench.suggest, "outline")


def _draw_errors(shown: Found) -> None:
    rows = []
    for group, axes in GROUPS.items():
        for axis in (each for each in (*axes, group) if each in shown.after):
            before, after = shown.before[axis], shown.after[axis]
            named = _OF_GROUP[group] if axis == group else _AXES.get(axis, axis)
            change = change_in_words(1.0 - after / max(before, LEAST_ERROR))
            rows.append((f"{named} / {unit_of(group)}", error_in_table(before), error_in_table(after), change))
    with tag("div", "scroll").props('tabindex="0"'):
        table("small", {"axis": "", "without it": "number", "with it": "number", "change": "number"}, rows)


def _draw_losers(search: Diagnosed | None, name: str) -> None:
    ranking = [] if search is None else search.diagnosis.ranking
    shown = next((candidate for candidate in ranking if candidate.effect.name == name), None)
    if search is None or shown is None:
        tag("p", "muted", "No search on these flights has tried it beside others. Remove it to search without it.")
        return
    winners = search.diagnosis.chosen
    chosen = {name, *(candidate.effect.name for candidate in winners)}
    losers = [candidate for candidate in ranking if candidate.effect.name not in chosen]
    if not losers:
        tag("p", "muted", "Nothing else was tried.")
        return
    change = f"{change_in_words(shown.held_out_drop)} {ERRORS[shown.measure]}, p {p_in_table(shown.p_value)}"
    tag(
        "p",
        "muted",
        "Numbers of the search that found it: each effect was fitted together with those named, and p is corrected for "
        f"all tried. {name} gave {change}, together with {_beside(shown)}.",
    )
    _draw_reasons(losers[:LOSERS], [shown, *winners])
    if losers[LOSERS:]:
        with ui.expansion(f"{len(losers) - LOSERS} more").classes("more"):
            _draw_reasons(losers[LOSERS:], [shown, *winners])


def _draw_reasons(losers: list[Candidate], winners: list[Candidate]) -> None:
    rows = [
        (
            candidate.effect.name,
            str(_beside(candidate)),
            f"{change_in_words(candidate.held_out_drop)} {ERRORS[candidate.measure]}" if candidate.fitted else "",
            p_in_table(candidate.p_value) if candidate.fitted else "",
            sentence(in_words(reason_against(candidate, rival_of(candidate, winners)))),
        )
        for candidate in losers
    ]
    with tag("div", "scroll").props('tabindex="0"'):
        columns = {"effect": "mono", "together with": "", "change": "", "p": "", "why it lost": ""}
        table("small reasons", columns, rows)


def _beside(candidate: Candidate) -> Fact:
    """The effects beside which a candidate was tried."""
    return fact(Said.BESIDE, families=[effect.family() for effect in candidate.model.effects[:-1]])


def draw_suggestion(suggestion: Suggestion) -> None:
    """Draw the command of the best mission with what it is expected to tell, or why none is suggested."""
    answer, *reasons = map(str, suggestion.answer)
    if suggestion.best is None:
        tag("p", "", answer)
    else:
        command = suggestion.best.command
        with tag("div", "line"):
            tag("code", "command grow", command)
            ui.button(icon="content_copy", on_click=lambda: ui.clipboard.write(command)).props(
                'flat dense round aria-label="Copy the command"'
            )
    for reason in (*map(str, suggestion.reasons), *reasons):
        tag("p", "muted", reason)
