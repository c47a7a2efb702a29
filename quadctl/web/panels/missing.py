"""What could be missing: the verdict, the candidates with their Add buttons, and the next flight."""

from typing import TYPE_CHECKING

from nicegui import ui

from quadctl.lab.comparison.wording import (
    change_in_words,
    listed,
    p_in_words,
    parameters_in_text,
    percent,
    plain,
    quantity,
)
from quadctl.lab.selection.candidate import Candidate
from quadctl.lab.selection.diagnosis import Diagnosis
from quadctl.web.elements.html import busy, empty, heading, loading, tag
from quadctl.web.figures.sketch import sketch_svg
from quadctl.web.figures.timeline import short_timeline
from quadctl.web.panels.zoomed import zoomed_plot
from quadctl.web.session.findings import Diagnosed

if TYPE_CHECKING:
    from quadctl.web.page.page import Page

NOT_NEEDED = "Other forms of the same, or look-alikes: not needed beside the above."
NO_HELP = "They do not help on unseen data, or only with parameters that they cannot have."


def draw_overview(page: "Page") -> None:
    """The first thing that a person sees: measured against predicted."""
    flight = page.flight
    if flight is None and page.bench.work is not None:
        loading("Reading the flights")
        return
    if flight is None:
        empty("insights", "No flight yet", "Open a flight log to see where your model is wrong.")
        return
    with tag("section", "card"):
        heading(f"{flight.name}: measured against predicted")
        timeline = short_timeline(flight, page.predictions(flight), page.axis, page.theme)
        zoomed_plot(timeline, page.theme, "measured_and_predicted", "Measured against predicted acceleration over time")


def draw_missing(page: "Page") -> None:
    """What could make up the difference."""
    page.search_detail = None
    if page.bench.seen is None:
        return
    with tag("section", "card").props('aria-live="polite"'):
        _verdict(page)
    found, before = page.bench.results.found, page.bench.results.before
    if found is not None:
        _candidates(page, found)
        if found.diagnosis.verdict == "missing" and found.diagnosis.unexplained:
            with tag("section", "card"):
                heading("What these effects do not explain")
                _expression(page, found.diagnosis)
        _next_flight(page)
    elif before is not None and not page.bench.session.off:
        _expected(page, before)


def _verdict(page: "Page") -> None:
    bench = page.bench
    if bench.search is not None:
        with tag("div", "line"):
            busy()
            tag("span", "verdict grow", f"{bench.search.title}\u2026")
            ui.button("Cancel", on_click=bench.cancel_search).props("flat dense no-caps")
        page.search_detail = ui.label(bench.search.detail or "Every effect of the catalogue is tried.").classes("muted")
        return
    if bench.results.found is None:
        with tag("div", "line"):
            off = bench.session.off
            why = "An effect is switched off: switch it on again to look." if off else "Not looked yet."
            tag("span", "verdict grow", why)
            if not off:
                look = ui.button("Look for what is missing", on_click=lambda: page.act(bench.look()))
                look.props("no-caps unelevated")
        return
    diagnosis = bench.results.found.diagnosis
    icon, text, more = _in_words(diagnosis)
    with tag("div", "line top verdict-line"):
        ui.icon(icon).classes(f"verdict-icon {diagnosis.verdict}")
        with tag("div", "grow"):
            tag("p", "verdict", text).props(f'id="verdict" data-verdict="{diagnosis.verdict}"')
            for sentence in more:
                tag("p", "muted", sentence)
        names = [step.effect for step in diagnosis.steps[1:]]
        if names:
            label = f"Add {plain(diagnosis.missing[0])}" if len(names) == 1 else f"Add all {len(names)}"
            add = ui.button(label, on_click=lambda: page.act(bench.add(*names)))
            page.when_idle(add.props(f'no-caps unelevated aria-label="Add {listed(names)}"'))
    if diagnosis.verdict == "unexplained":
        _expression(page, diagnosis)


def _expression(page: "Page", diagnosis: Diagnosis) -> None:
    """What no effect explains, as formulas."""
    if not diagnosis.unexplained:
        return
    if diagnosis.symbolic is None:
        tag("p", "muted", "No expression of a few terms says it: what the flights have in common may not be logged.")
        return
    tag("p", "", "What is left, as an expression of the logged variables:")
    for law in diagnosis.symbolic.laws:
        tag("pre", "expression", f"{law.axis} acceleration / m/s² = {law.best.text}")
        share = percent(law.best.held_out_share)
        tag("p", "muted", f"It explains {share} of the squared error left on that axis, on unseen data.")
    with tag("div", "line wrap"):
        add = ui.button(
            "Add it as an effect of your own", icon="add", on_click=lambda: page.act(page.bench.add_expression())
        )
        page.when_idle(add.props("no-caps unelevated"))
        tag("span", "muted grow", "A formula without physics: it holds where these flights were, and nowhere else.")


def _in_words(diagnosis: Diagnosis) -> tuple[str, str, list[str]]:
    """Icon, verdict, and what else is to be said."""
    more = []
    if diagnosis.verdict == "none":
        text = "Nothing significant is missing."
        more.append("What is left is noise: no effect of the catalogue earns its place on unseen data.")
        return "check_circle", text, more
    if diagnosis.verdict == "unexplained":
        more.append("No effect of the catalogue explains it on unseen data, yet it goes with the logged variables.")
        return "help", "Something is there that no known effect explains.", more
    first, last = diagnosis.steps[0].rmse["total"], diagnosis.steps[-1].rmse["total"]
    them = "it" if len(diagnosis.missing) == 1 else "them"
    more.append(
        f"With {them} in, the error on unseen data goes from {quantity(first)} to {quantity(last)}, "
        f"{percent(1.0 - last / first)} less."
    )
    if diagnosis.unexplained:
        more.append("Even so, something is left that the variables explain and these effects do not.")
    return "lightbulb", f"Missing: {listed([plain(family) for family in diagnosis.missing])}.", more


def _expected(page: "Page", before: Diagnosed) -> None:
    """What the last search found and is not added yet, while it is looked at again."""
    model = page.bench.session.model
    held = {effect.family() for effect in model.effects} if model is not None else set()
    left = [candidate for candidate in _chosen(before.diagnosis) if candidate.family not in held]
    if left:
        heading("Found before, and not added yet")
        with tag("div", "candidates"):
            for i, candidate in enumerate(left):
                _card(page, before, candidate, [], primary=i == 0)


def _chosen(diagnosis: Diagnosis) -> list[Candidate]:
    """What is missing, in the order of adding."""
    missing = {step.effect for step in diagnosis.steps[1:]}
    return [candidate for candidate in diagnosis.ranking if candidate.effect.name in missing]


def _candidates(page: "Page", found: Diagnosed) -> None:
    diagnosis = found.diagnosis
    chosen = _chosen(diagnosis)
    missing = {candidate.effect.name for candidate in chosen}
    alike = {other: first for first, other in diagnosis.confounded}
    rest = [c for c in diagnosis.ranking if c.effect.name not in missing]
    near = [c for c in rest if c.supported or c.family in alike]
    others = [c for c in rest if c not in near]
    if chosen:
        heading("What is missing, in the order of adding")
        with tag("div", "candidates"):
            for i, candidate in enumerate(chosen):
                looks = [other for other, first in alike.items() if first == candidate.family]
                _card(page, found, candidate, looks, primary=i == 0)
    for title, text, group in (("Did well too", NOT_NEEDED, near), ("Not supported by these data", NO_HELP, others)):
        if group:
            more = ui.expansion(f"{title} ({len(group)})", caption=text).classes("more")
            with more, tag("div", "candidates"):
                for candidate in group:
                    _card(page, found, candidate, [], primary=False)
    if diagnosis.untried:
        text = "These flights lack the variety to tell them from others."
        with ui.expansion(f"Not tried ({len(diagnosis.untried)})", caption=text).classes("more"), tag("ul", "plain"):
            for reason in diagnosis.untried:
                tag("li", "", f"{reason}.")


def _card(page: "Page", found: Diagnosed, candidate: Candidate, looks_like: list[str], primary: bool) -> None:
    name = candidate.effect.name
    with tag("article", "card candidate primary" if primary else "card candidate").props(f'data-effect="{name}"'):
        with tag("div", "line top"):
            if name in found.sketches:
                ui.html(sketch_svg(found.sketches[name], page.theme), sanitize=False).classes("sketch")
            with tag("div", "grow"):
                tag("h3", "", plain(candidate.family).capitalize())
                tag("div", "mono muted", name)
                with tag("div", "numbers"):
                    tag("span", "fall", f"{change_in_words(candidate.held_out_drop)} error on unseen data")
                    tag("span", "muted", f"p {p_in_words(candidate.p_value)}")
        tag("p", "", candidate.effect.physics)
        tag("p", "mono muted", parameters_in_text(candidate.effect, candidate.ci95))
        if looks_like:
            tag("p", "note", f"Looks like {listed([plain(f) for f in looks_like])} in these data: they cannot tell.")
        for remark in candidate.remarks:
            tag("p", "note", f"Note: {remark}.")
        held = {effect.family() for effect in candidate.model.effects[:-1]} & {candidate.family}
        add = ui.button("Add", icon="add", on_click=lambda: page.act(page.bench.add(name)))
        add.props(f'no-caps aria-label="Add {name}"').props("unelevated" if primary else "outline")
        page.when_idle(add, not held)


def _next_flight(page: "Page") -> None:
    bench, suggestion = page.bench, page.bench.results.suggestion
    with tag("section", "card"):
        heading("Which flight next?")
        if suggestion is None:
            with tag("div", "line"):
                tag("p", "muted grow", "Every mission is flown in thought, and judged by what its data would add.")
                ask = ui.button("Suggest a flight", on_click=lambda: page.act(bench.suggest()))
                page.when_idle(ask.props("no-caps outline"))
            return
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
        for reason in reasons:
            tag("p", "muted", reason)
