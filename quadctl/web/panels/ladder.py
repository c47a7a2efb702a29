"""The error ladder: the number that matters, and how it came down."""

import re
from typing import TYPE_CHECKING

from nicegui import ui

from quadctl.lab.comparison.wording import change_in_words, held_out, listed, number, plain
from quadctl.web.elements.html import tag

if TYPE_CHECKING:
    from quadctl.web.page.page import Page


def draw_ladder(page: "Page") -> None:
    bench, session = page.bench, page.bench.session
    with tag("section", "card ladder").props('aria-label="Error ladder"'):
        if page.starting:
            tag("p", "muted", "The error of your model, on data that it has not seen, appears here.")
            return
        evaluation = bench.results.evaluation
        now = _error_now(page)
        errors = [rung.error_m_s2 for rung in session.rungs if rung.error_m_s2 is not None]
        with tag("div", "now"):
            if now is None:
                tag("div", "big", "\u2013" if bench.work is None else "\u2026")
            else:
                with tag("div", "big"):
                    tag("span", "", number(now)).props('id="error-now"')
                    tag("span", "unit", "m/s²")
                if errors and now < 0.995 * errors[0]:
                    change = change_in_words(1.0 - now / errors[0])
                    tag("span", "change", change).props('title="since the first step"')
        if evaluation is not None:
            tag("p", "muted what", _on_what(page))
        largest = max([*errors, now or 0.0, 1e-9])
        floors = [session.floor_m_s2, None if evaluation is None else evaluation.floor_m_s2]
        least = min((floor for floor in floors if floor is not None), default=None)
        floor = None if least is None else min(least / largest, 1.0)
        with tag("ol", "steps"):
            for step, rung in enumerate(session.rungs):
                here = step == session.current
                _step(page, step, rung.name, rung.error_m_s2, largest, floor, here and not session.off)
            if session.off:
                _step(page, session.current, f"without {listed(sorted(session.off))}", now, largest, floor, True)
        if least is not None:
            with tag("p", "floor-key"):
                tag("span", "floor-mark")
                words = "what a fit without any physics leaves, at the best of the steps so far"
                tag("span", "", f"noise floor {number(least)} m/s²: {words}")


def _error_now(page: "Page") -> float | None:
    """Of the model as it stands: while it is worked out, what is known from before."""
    evaluation, session = page.bench.results.evaluation, page.bench.session
    if evaluation is not None:
        return evaluation.error_m_s2
    return None if session.rung is None or session.off else session.rung.error_m_s2


def _on_what(page: "Page") -> str:
    evaluation, seen = page.bench.results.evaluation, page.bench.seen
    if evaluation is None or seen is None:
        return ""
    if evaluation.unseen is not None:
        return f"error on {listed(evaluation.unseen.dataset.names)}, which no fit has seen"
    if page.bench.session.off:
        return f"the others refitted: error on {held_out(seen)}"
    return f"error on {held_out(seen)}"


def _plain(name: str) -> str:
    """`+ ground effect` for `+ ground_effect.exponential`"""
    return re.sub(r"(\w+)\.\w+", lambda found: plain(found[1]), name)


def _step(
    page: "Page", step: int, name: str, error: float | None, largest: float, floor: float | None, here: bool
) -> None:
    with tag("li", "step here" if here else "step"):
        button = ui.element("button").classes("step-button").props('type="button"')
        button.props(f'aria-current="{"step" if here else "false"}"')
        button.on("click", lambda: page.act(page.bench.go(step)))
        if page.bench.work is not None:
            button.props("disabled")
        with button:
            tag("span", "step-name", _plain(name)).props(f'title="{name}"')
            tag("span", "step-value", "\u2026" if error is None else number(error))
            with tag("span", "bar-room"):
                if error is not None:
                    tag("span", "bar first" if step == 0 else "bar").style(f"width:{100.0 * error / largest:.1f}%")
                if floor is not None:
                    tag("span", "floor").style(f"left:{100.0 * floor:.1f}%")
