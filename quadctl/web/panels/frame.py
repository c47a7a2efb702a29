"""The frame of the page: the bar on top, what is being done, and where one begins without a flight."""

from typing import TYPE_CHECKING

from nicegui import ui

from quadctl.lab.comparison.wording import listed
from quadctl.web.elements.browser_theme import theme_button
from quadctl.web.elements.html import busy, heading, tag
from quadctl.web.panels.flights import draw_vehicle, drop_zone

if TYPE_CHECKING:
    from quadctl.web.page.page import Page


def draw_header(page: "Page") -> None:
    tag("span", "brand", "quadctl lab")
    tag("span", "grow")
    if not page.starting:
        for label, icon, act in (
            ("Save session", "save", page.save_session),
            ("Report", "description", page.save_report),
            ("Export model", "download", page.export_model),
        ):
            button = ui.button(label, icon=icon, on_click=act).props(f'flat no-caps aria-label="{label}"')
            button.classes("header-button")
    theme_button(page.theme, page.toggle_theme)


def draw_status(page: "Page") -> None:
    work, message = page.bench.work, page.bench.message
    if work is not None:
        with tag("div", "banner work").props('role="status"'):
            busy()
            tag("span", "grow", f"{work.title}: {work.detail}\u2026" if work.detail else f"{work.title}\u2026")
            ui.button("Cancel", on_click=page.bench.cancel).props("flat dense no-caps")
    if message is not None:
        with tag("div", f"banner {message.kind}").props('role="alert"' if message.kind == "error" else 'role="status"'):
            ui.icon("error" if message.kind == "error" else "info")
            tag("span", "grow", message.text if message.text.endswith((".", "?")) else f"{message.text}.")
            ui.button(icon="close", on_click=page.bench.dismiss).props('flat dense round aria-label="Dismiss"')


def draw_start(page: "Page") -> None:
    """Where a person begins who has named no flight."""
    if not page.starting:
        return
    with tag("section", "card start"):
        heading("Find what your flight model is missing")
        tag(
            "p",
            "",
            "Open a log of a flight. You will see where the model of your vehicle is wrong, which physical effect "
            "explains it, and how far the error falls when you add it.",
        )
        waiting = page.bench.session.logs
        if waiting:
            names = listed([path.name for path in waiting])
            tag("p", "verdict", f"Waiting for their vehicle: {names}. Choose below what flew.")
        drop_zone(page)
        with tag("p", "muted"):
            ui.label("No log at hand? ").style("display:contents")
            tag("code", "", "quadctl demo")
            ui.label(" flies one with a hidden effect, in a minute.").style("display:contents")
    draw_vehicle(page)
