"""The model as a compensator: its thrust ratio, what the check says, export, and a flight in simulation."""

from typing import TYPE_CHECKING

from nicegui import ui

from quadctl.lab.comparison.wording import change_in_words
from quadctl.lab.tracking.step_response import StepResponses
from quadctl.web.elements.html import empty, heading, plot, tag
from quadctl.web.figures.ratio import ratio_over_height, ratio_over_speed
from quadctl.web.figures.steps import step_figure
from quadctl.web.work.simulated import WITH, WITHOUT

if TYPE_CHECKING:
    from quadctl.web.page.page import Page


def draw_ratio(page: "Page") -> None:
    model, seen = page.bench.session.model, page.bench.seen
    if model is None or seen is None:
        empty("flight", "No model to fly yet", "Open a flight log and add what is missing.")
        return
    with tag("section", "card"):
        heading("What the compensator corrects", "It divides the thrust command by this ratio.")
        with tag("div", "panes"):
            drawn = ratio_over_height(model, seen, page.theme)
            plot(drawn, "thrust_ratio_over_height", "Thrust ratio over height")
            over_speed = ratio_over_speed(model, seen, page.theme)
            if over_speed is not None:
                plot(over_speed, "thrust_ratio_over_speed", "Thrust ratio over forward speed")


def draw_check(page: "Page") -> None:
    """What the check before a flight says; it is asked when this is first looked at."""
    results = page.bench.results
    if page.bench.session.model is None or page.bench.seen is None:
        return
    if results.checked is None and not results.refused:
        ui.timer(0.0, page.bench.check, once=True)
    with tag("div", "line check"):
        if results.refused:
            ui.icon("block").classes("bad")
            tag("p", "grow", f"The check refuses it: {results.refused}.")
        elif results.checked is None:
            tag("p", "muted grow", "Checking\u2026")
        elif not page.bench.session.model.stack:
            ui.icon("info").classes("muted")
            tag("p", "muted grow", "The model holds no effect: nothing is corrected.")
        elif results.checked:
            ui.icon("warning").classes("warn")
            tag("p", "grow", f"The check warns: {'; '.join(results.checked)}.")
        else:
            ui.icon("check_circle").classes("good")
            tag("p", "grow", "The check finds nothing against flying it: finite, positive, and falling with height.")


def draw_export(page: "Page") -> None:
    if page.bench.session.model is None or page.bench.seen is None:
        return
    with tag("section", "card"):
        heading("Take it along")
        with tag("div", "line wrap"):
            ui.button("Export model", icon="download", on_click=page.export_model).props("no-caps unelevated")
            tag("code", "command grow", "quadctl fly missions/step_response.yaml --model model.yaml --link URL")


def draw_simulation(page: "Page") -> None:
    bench, steps = page.bench, page.bench.results.steps
    if bench.session.model is None or bench.seen is None:
        return
    with tag("section", "card"):
        world = "as this model says" if bench.simulation.hidden is None else f"of {bench.simulation.hidden.name}"
        heading("Fly it in simulation", f"A step down to the ground, flown twice in a world {world}.")
        fly = ui.button("Fly it in simulation", icon="flight_takeoff", on_click=lambda: page.act(bench.fly()))
        page.when_idle(fly.props("no-caps unelevated"), not bench.results.refused)
        if steps is None:
            return
        with tag("div", "panes"):
            plot(step_figure(steps, page.theme, close_up=False), "step_response", "Step response")
            plot(step_figure(steps, page.theme, close_up=True), "step_response_error", "Step response, close up")
        _metrics(steps)


def _metrics(steps: StepResponses) -> None:
    flown = steps.flown
    rows = (
        ("M_A, absolute", "m s", "m_a_absolute"),
        ("M_B, absolute", "m s", "m_b_absolute"),
        ("M_B, signed", "m s", "m_b_signed"),
        ("RMSE", "m", "rmse_m"),
    )
    with tag("table", "metrics"):
        with tag("tr"):
            for head in ("", WITHOUT, WITH, "change"):
                tag("th", "number" if head else "", head)
        for name, unit, field in rows:
            with tag("tr"):
                tag("td", "", f"{name} / {unit}")
                without, compensated = (getattr(flown[name], field) or 0.0 for name in (WITHOUT, WITH))
                for value in (without, compensated):
                    tag("td", "number", f"{value:.4f}".replace("-", "\u2212"))
                tag("td", "number", change_in_words(1.0 - abs(compensated) / abs(without)) if without else "\u2013")
    tag(
        "p",
        "muted",
        "M_A: integral of the tracking error. M_B: of what differs from the step far from the ground.",
    )
