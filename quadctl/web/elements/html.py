"""Small things that several panels are made of."""

from collections.abc import Callable
from functools import partial

from nicegui import ui
from nicegui.element import Element

from quadctl.web.elements.figure import Figure, to_csv

PICTURE_PX = 1200


def tag(name: str, classes: str = "", text: str = "") -> Element:
    """A plain element of HTML, with text that is never taken for HTML."""
    element = ui.element(name).classes(classes)
    if text:
        with element:
            ui.label(text).style("display:contents")
    return element


def heading(title: str, text: str = "") -> None:
    tag("h2", "title", title)
    if text:
        tag("p", "muted", text)


def empty(icon: str, title: str, text: str) -> None:
    """What is shown where there is nothing yet."""
    with tag("div", "empty"):
        ui.icon(icon).classes("empty-icon")
        tag("h3", "", title)
        tag("p", "muted", text)


def busy() -> None:
    """A sign that work goes on. It blinks, twice a second: what moves smoothly costs the machine that does the work."""
    tag("span", "busy").props('aria-hidden="true"')


def loading(text: str) -> None:
    with tag("div", "empty").props('role="status"'):
        busy()
        tag("p", "muted", text)


def plot(drawn: Figure, name: str, label: str) -> ui.plotly:
    """A figure, and below it the ways to take it along: PNG, SVG and CSV, named `name`; `label` is read aloud."""
    with tag("figure", "figure"):
        shown = ui.plotly(drawn).props(f'role="img" aria-label="{label}"')
        with tag("div", "take"):
            for form in ("png", "svg"):
                _button(form, label, partial(_picture, shown, name, form))
            _button("csv", label, lambda: ui.download.content(to_csv(shown.figure), f"{name}.csv", "text/csv"))
    return shown


def _button(form: str, label: str, act: Callable[[], object]) -> None:
    ui.button(form.upper(), on_click=act, color=None).props(
        f'flat dense no-caps size=sm aria-label="{label} as {form.upper()}"'
    )


def _picture(shown: ui.plotly, name: str, form: str) -> None:
    assert isinstance(shown.figure, dict)
    size = {"width": PICTURE_PX, "height": shown.figure["layout"]["height"]}
    shown.run_plot_method("downloadImage", {"format": form, "filename": name, **size})
