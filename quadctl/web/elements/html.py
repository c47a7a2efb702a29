"""Building blocks of the pages: headings, placeholders, and a figure with its download buttons."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial

from nicegui import ui
from nicegui.element import Element

from quadctl.web.elements.figure import Figure, in_a_sentence, to_csv

PICTURE_PX = 1200
LOAD_PLOTLY = """<script>
addEventListener("unhandledrejection", (event) => {
  if (event.reason?.message === "Resize must be passed a displayed plot div element.") event.preventDefault();
});
</script>
<script type="module">import("nicegui-plotly");</script>"""
"""Plotly is large: it is loaded while the page is still being connected, not when the first figure comes.
A figure that has just left the page, or is hidden, may still be told of its new size, which is none: what Plotly says
to that is no error. Its functions are left alone: which script gets hold of them first is not certain."""


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
    """Draw a placeholder for content that does not exist yet."""
    with tag("div", "empty"):
        ui.icon(icon).classes("empty-icon")
        tag("h3", "", title)
        tag("p", "muted", text)


def table(classes: str, columns: Mapping[str, str], rows: Iterable[Sequence[str]]) -> None:
    """Draw a table; `columns` are the classes of its cells by their heads: "number" where they stand on the right."""
    with tag("table", classes):
        with tag("tr"):
            for head, kind in columns.items():
                tag("th", "number" if kind == "number" else "", head)
        for row in rows:
            with tag("tr"):
                for kind, text in zip(columns.values(), row, strict=True):
                    tag("td", kind, text)


def busy() -> None:
    """Draw a sign of work in progress. It blinks twice a second: a smooth animation would slow down the work."""
    tag("span", "busy").props('aria-hidden="true"')


def loading(text: str) -> None:
    with tag("div", "empty").props('role="status"'):
        busy()
        tag("p", "muted", text)


def plot(drawn: Figure, name: str, label: str, caption: str = "") -> ui.plotly:
    """Draw a figure and its buttons for files called `name`; screen readers read `label` and the ranges of curves.

    The `caption` stands above it as text of the page: it breaks into lines where a title in the figure would be cut.
    """
    with tag("figure", "figure") as whole:
        whole.props["aria-label"] = f"{label}. {in_a_sentence(drawn)}"
        if caption:
            tag("figcaption", "muted", caption)
        # A group, not an image: its buttons can have the focus.
        shown = ui.plotly(drawn).props(f'role="group" aria-label="{label}"')
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
