"""Where the model fails: in words, over each variable, on a map; what is selected stands out in the flight."""

from typing import TYPE_CHECKING, Any

from nicegui import ui
from nicegui.events import GenericEventArguments

from quadctl.lab.comparison.comparison import Comparison
from quadctl.lab.comparison.failures import Failure, Profile, most_telling
from quadctl.lab.comparison.wording import failure_in_words
from quadctl.lab.selection.candidate import MATERIAL, SIGNIFICANT
from quadctl.web.elements.html import empty, heading, loading, plot, tag
from quadctl.web.figures.error_map import error_map
from quadctl.web.figures.path import path_figure
from quadctl.web.figures.profile import profile_figure
from quadctl.web.figures.timeline import full_timeline
from quadctl.web.panels.over_time import brush_note, choose_flight
from quadctl.web.panels.zoomed import zoomed_plot

if TYPE_CHECKING:
    from quadctl.web.page.page import Page

_SCROLL = "document.querySelector('#selected').scrollIntoView()"
SHOWN_SENTENCES, SHOWN_PANELS = 4, 6


def draw_fails(page: "Page") -> None:
    evaluation = page.bench.results.evaluation
    if evaluation is None:
        if page.bench.work is not None:
            loading("Comparing the model with the flights")
        else:
            empty("troubleshoot", "No flight yet", "Open a flight log to see where your model fails.")
        return
    comparison = evaluation.comparison
    with tag("section", "card"):
        heading("Where the model fails")
        if not comparison.fails_where:
            tag("p", "verdict", "Nowhere beyond the noise.")
        for failure in most_telling(comparison.fails_where)[:SHOWN_SENTENCES]:
            _sentence(page, failure)
    telling = [p for p in comparison.profiles if p.share > MATERIAL and p.p_value < SIGNIFICANT]
    with tag("section", "card"):
        heading(
            "The residual over each variable, the most telling first"
            if telling
            else "No variable goes with what is left; these two come closest",
            "Points on the zero line: nothing is missing there. Drag over a range to see where in the flight it was.",
        )
        with tag("div", "panes"):
            for profile in (telling or comparison.profiles[:2])[:SHOWN_PANELS]:
                _profile(page, comparison, profile)


def _sentence(page: "Page", failure: Failure) -> None:
    """What is said, and a way to see it in the flight that needs no mouse."""
    with tag("div", "line top said"):
        tag("p", "grow", f"{failure_in_words(failure)} ({abs(failure.sigma):.0f} sigma).")
        ranges = {failure.variable: (failure.low, failure.high)}
        show = ui.button("Show", icon="my_location", on_click=lambda: page.select(ranges, failure.axis))
        show.props(f'flat dense no-caps size=sm aria-label="Show where in the flight: {failure.text}"')


def _profile(page: "Page", comparison: Comparison, profile: Profile) -> None:
    name = f"residual_{profile.axis}_over_{profile.variable}"
    shown = plot(profile_figure(comparison, profile, page.theme), name, name.replace("_", " "))
    _brushes(page, shown, profile.axis, (profile.variable,))


def draw_brushed(page: "Page") -> None:
    """The map, and what is selected: on the path of the flight and in time."""
    evaluation = page.bench.results.evaluation
    if evaluation is None:
        return
    comparison = evaluation.comparison
    over = _two_strongest(comparison.profiles)
    flight, opened = page.flight, page.bench.opened
    with tag("div", "panes").props('id="selected"'):
        if over is not None:
            axis_name, variables = over
            with tag("section", "card"):
                heading("Over the two most telling variables", "Drag a box to select.")
                drawn = error_map(comparison, axis_name, variables, page.theme)
                map_shown = plot(drawn, f"residual_{axis_name}_map", "Residual over two variables")
                _brushes(page, map_shown, axis_name, variables)
        if flight is not None:
            with tag("section", "card"):
                with tag("div", "line wrap"):
                    tag("h2", "title grow", "On the flight path")
                    choose_flight(page)
                plot(path_figure(flight, page.brushed(flight), page.theme), f"{flight.name}_path", "Flight path")
    if page.brush and flight is not None and opened is not None:
        with tag("div", "card brush-bar"):
            brush_note(page)
            show = ui.button("Show", icon="south", on_click=lambda: ui.run_javascript(_SCROLL))
            show.props('no-caps unelevated dense aria-label="Show what is selected"')
        with tag("section", "card"):
            heading("In time")
            timeline = full_timeline(
                flight, opened.log(flight.name), page.predictions(flight), page.axis, page.theme, page.brushed(flight)
            )
            zoomed_plot(timeline, page.theme, f"{flight.name}_selected", "What is selected, over time")


def _two_strongest(profiles: list[Profile]) -> tuple[str, tuple[str, str]] | None:
    """The axis that is most wrong, and the two variables that its residual goes with most."""
    if not profiles:
        return None
    axis_name = profiles[0].axis
    variables = [profile.variable for profile in profiles if profile.axis == axis_name]
    return (axis_name, (variables[0], variables[1])) if len(variables) > 1 else None


def _brushes(page: "Page", shown: ui.plotly, axis_name: str, variables: tuple[str, ...]) -> None:
    """Selecting a part of a figure over `variables` selects it everywhere."""
    # Of the event only the range: it also holds the points, each with the whole figure, which is too much to be sent.
    shown.on("plotly_selected", lambda event: _select(page, event, axis_name, variables), args=["range"])
    shown.on("plotly_deselect", page.clear_brush, args=[])


def _select(page: "Page", event: GenericEventArguments, axis_name: str, variables: tuple[str, ...]) -> None:
    """What the mouse selected becomes ranges of variables; nothing where the selection was taken back."""
    ranges = event.args.get("range") if isinstance(event.args, dict) else None
    if not isinstance(ranges, dict):
        return
    ends: list[Any] = [ranges.get(letter) for letter in ("x", "y")[: len(variables)]]
    if not all(isinstance(pair, list) and len(pair) == 2 for pair in ends):
        return
    chosen = {name: (min(pair), max(pair)) for name, pair in zip(variables, ends, strict=True)}
    page.select(chosen, axis_name)
