"""The evidence for an effect that was found missing: its curve, the error per axis, what lost, and the next flight."""

from dataclasses import dataclass

from nicegui import ui

from quadctl.lab.comparison.wording import ERRORS, change_in_words, listed, plain, sentence
from quadctl.lab.flights.dataset import Dataset
from quadctl.lab.flights.flight import VARIABLE_NAMES
from quadctl.lab.flights.prediction import GROUPS
from quadctl.lab.planning.suggestion import Suggestion
from quadctl.lab.selection.candidate import LEAST_ERROR, Candidate
from quadctl.lab.selection.diagnosis import Diagnosis
from quadctl.lab.selection.effect_curves import last_effect_curves
from quadctl.lab.selection.wording import UNITS, error_in_table, p_in_table, reason_against
from quadctl.web.elements.html import heading, plot, tag
from quadctl.web.elements.theme import Theme
from quadctl.web.figures.evidence import evidence_figure
from quadctl.web.panels.panel import Controls, Panel
from quadctl.web.session.findings import Diagnosed

LOSERS = 8
"""Most effects whose reason is shown at once; the others are folded."""


@dataclass(frozen=True)
class Evidence(Panel):
    """The evidence for the effect that was asked for; it is computed when it is opened, not before."""

    seen: Dataset | None
    found: Diagnosed | None
    suggestion: Suggestion | None
    evidence: str
    theme: Theme

    def draw(self, do: Controls) -> None:
        if self.seen is None or self.found is None:
            return
        diagnosis = self.found.diagnosis
        shown = next((c for c in chosen_of(diagnosis) if c.effect.name == self.evidence), None)
        if shown is None:
            return
        name = plain(shown.family)
        with tag("section", "card evidence").props(f'id="evidence" aria-label="Evidence for {name}"') as card:
            with tag("div", "line top"):
                with tag("div", "grow"):
                    heading(f"Evidence for {name}", shown.effect.physics)
                ui.button(icon="close", on_click=lambda: do.show_evidence("")).props(
                    'flat dense round aria-label="Close the evidence"'
                )
            with tag("div", "panes"):
                for curve in last_effect_curves(shown.model, self.seen):
                    label = f"{sentence(name)} over {VARIABLE_NAMES[curve.variable]}, along {curve.component}"
                    file = f"{shown.effect.name}_over_{curve.variable}"
                    plot(evidence_figure(curve, self.theme), file, label)
            tag("h3", "", "Held-out error before and after")
            _draw_errors(shown)
            tag("h3", "", "What else was tried, and why it lost")
            _draw_losers(diagnosis, shown)
            tag("h3", "", "The flight that shows it best")
            self._draw_next(do, shown)
        card.run_method("scrollIntoView", {"block": "nearest"})

    def _draw_next(self, do: Controls, shown: Candidate) -> None:
        name = sentence(plain(shown.family))
        tag("p", "", f"{name} is told from its look-alikes by {shown.effect.distinguished_by}.")
        tag("code", "command", f"quadctl fly {shown.effect.mission}")
        if self.suggestion is not None:
            tag("p", "muted", "Compared with all missions, by what their data would add to these flights:")
            draw_suggestion(self.suggestion)
        else:
            ask = ui.button("Compare all missions", on_click=lambda: do.act(do.bench.suggest()))
            do.when_idle(ask.props("no-caps outline"))


def _draw_errors(shown: Candidate) -> None:
    with tag("div", "scroll").props('tabindex="0"'), tag("table", "small"):
        with tag("tr"):
            tag("th", "", "axis")
            for head in ("without it", "with it", "change"):
                tag("th", "number", head)
        for group, axes in GROUPS.items():
            for axis in (*axes, group):
                if axis not in shown.after:
                    continue
                before, after = shown.before[axis], shown.after[axis]
                with tag("tr"):
                    title = f"all axes / {UNITS[group]}" if axis == group else f"{plain(axis)} / {UNITS[group]}"
                    tag("td", "", title.replace("m/s^2", "m/s²"))
                    tag("td", "number", error_in_table(before))
                    tag("td", "number", error_in_table(after))
                    tag("td", "number", change_in_words(1.0 - after / max(before, LEAST_ERROR)))


def _draw_losers(diagnosis: Diagnosis, shown: Candidate) -> None:
    chosen = {candidate.effect.name for candidate in chosen_of(diagnosis)}
    losers = [candidate for candidate in diagnosis.ranking if candidate.effect.name not in chosen]
    if not losers:
        tag("p", "muted", "Nothing else was tried.")
        return
    _draw_reasons(losers[:LOSERS], shown)
    if losers[LOSERS:]:
        with ui.expansion(f"{len(losers) - LOSERS} more").classes("more"):
            _draw_reasons(losers[LOSERS:], shown)


def _draw_reasons(losers: list[Candidate], shown: Candidate) -> None:
    with tag("div", "scroll").props('tabindex="0"'), tag("table", "small reasons"):
        with tag("tr"):
            for head in ("effect", "tried beside", "change", "p", "why it lost"):
                tag("th", "", head)
        for candidate in losers:
            beside = [plain(effect.family()) for effect in candidate.model.effects[:-1]]
            with tag("tr"):
                tag("td", "mono", candidate.effect.name)
                tag("td", "", listed(beside) if beside else "the rigid body")
                tag("td", "", f"{change_in_words(candidate.held_out_drop)} {ERRORS[candidate.measure]}")
                tag("td", "", p_in_table(candidate.p_value))
                tag("td", "", sentence(reason_against(candidate, shown)).replace("m/s^2", "m/s²"))


def chosen_of(diagnosis: Diagnosis) -> list[Candidate]:
    """Candidates for the missing effects, in the order of adding."""
    missing = {step.effect for step in diagnosis.steps[1:]}
    return [candidate for candidate in diagnosis.ranking if candidate.effect.name in missing]


def draw_suggestion(suggestion: Suggestion) -> None:
    """Draw the command of the best mission with what it is expected to tell, or why none is suggested."""
    *reasons, answer = suggestion.lines()
    if suggestion.best is None:
        tag("p", "", answer)
    else:
        command = suggestion.best.command
        with tag("div", "line"):
            tag("code", "command grow", command)
            ui.button(icon="content_copy", on_click=lambda: ui.clipboard.write(command)).props(
                'flat dense round aria-label="Copy the command"'
            )
    for reason in (*suggestion.reasons(), *reasons):
        tag("p", "muted", reason)
