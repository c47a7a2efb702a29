"""Regions where the model fails: in words, over each variable, on a map; the selected samples, in time and space."""

from dataclasses import dataclass
from typing import Any

from nicegui import ui
from nicegui.events import GenericEventArguments

from quadctl.lab.arrays import Mask
from quadctl.lab.comparison.comparison import Comparison
from quadctl.lab.comparison.failures import MOST, Failure, Profile, followed, told, unexplained
from quadctl.lab.comparison.wording import ended, listed, sentence
from quadctl.lab.evaluation import Evaluation
from quadctl.lab.flights.flight import Flight
from quadctl.lab.flights.prediction import AXES
from quadctl.web.elements.html import empty, heading, loading, plot, tag
from quadctl.web.elements.theme import Theme
from quadctl.web.figures.error_map import error_map
from quadctl.web.figures.profile import profile_figure
from quadctl.web.panels.choices import Brush
from quadctl.web.panels.chosen_flight import ChosenFlightPanel, selected
from quadctl.web.panels.glossary import explained
from quadctl.web.panels.panel import Controls, Panel, Tab
from quadctl.web.panels.rollouts import Rollouts
from quadctl.web.panels.sensors import HeightSensors
from quadctl.web.panels.stack import apart
from quadctl.web.panels.words import Said
from quadctl.words import Fact, fact

_SCROLL = "document.querySelector('#selected').scrollIntoView()"
_SCROLL_WHEN_DRAWN = """
const scroll = (trials) => requestAnimationFrame(() => {
  if (document.querySelector('#selected-in-time .main-svg')) document.querySelector('#selected').scrollIntoView();
  else if (trials > 0) scroll(trials - 1);
});
requestAnimationFrame(() => scroll(600));
"""
"""The selection that was just asked for is drawn a moment later than this runs; before, there is no room to scroll."""
SHOWN_SENTENCES, SHOWN_PROFILES = 4, 6


@dataclass(frozen=True)
class Failures(Panel):
    """Sentences on where the model fails, and the residual over the variables that explain most of it."""

    evaluation: Evaluation | None
    thrust_reservation: str
    comparing: bool
    theme: Theme

    def draw(self, do: Controls) -> None:
        evaluation = self.evaluation
        if evaluation is None:
            if self.comparing:
                loading("Comparing the model with the flights")
            else:
                empty("troubleshoot", "No flight yet", "Open a flight log to see where your model fails.")
            return
        comparison = evaluation.comparison
        with tag("section", "card"):
            heading("Where the model fails")
            with tag("p", "muted"):
                explained(
                    "Sigma says how certain a difference is, not how large. Here the model is as it is exported: the "
                    "per-flight bias is not removed here, so errors are larger than the error of the model."
                )
            if self.thrust_reservation:
                tag("p", "note", self.thrust_reservation)
            if evaluation.unseen is None:
                _draw_sentences(do, comparison)
            else:
                for role, each in (("used by the fits", comparison), ("held out", evaluation.unseen)):
                    tag("h3", "", f"On {listed(each.dataset.names)} ({role})")
                    _draw_sentences(do, each)
        if evaluation.agreement is not None:
            with tag("section", "card"):
                heading(str(evaluation.agreement.answer))
                for i, part in enumerate(evaluation.agreement.parts):
                    tag("p", "verdict-of-flights" if i == 0 else "muted", ended(sentence(str(part))))
                for said in apart(evaluation):
                    tag("p", "muted", str(said))
        telling = comparison.telling
        with tag("section", "card"):
            heading(
                "Residual over each variable, the largest share of the error of all axes first"
                if telling
                else "Residual over the two variables that explain most, although neither explains much",
                "Where the mean is on the zero line, the model is right. "
                "Drag over a range to see when these samples occurred.",
            )
            with tag("div", "panes"):
                for profile in (telling or comparison.profiles[:2])[:SHOWN_PROFILES]:
                    name = f"residual_{profile.axis}_over_{profile.variable}"
                    drawn, caption = profile_figure(comparison, profile, self.theme), str(share_of(profile, comparison))
                    shown = plot(drawn, name, name.replace("_", " "), caption)
                    _let_select(do, shown, profile.axis, (profile.variable,))


def share_of(profile: Profile, comparison: Comparison) -> Fact:
    """Share of the squared residual in the means of a profile, with its p-value."""
    return fact(Said.SHARE, share=profile.share, of_all=comparison.share_of_all(profile), p=profile.p_value)


def _draw_sentences(do: Controls, comparison: Comparison) -> None:
    if not comparison.fails_where:
        tag("p", "verdict", "In no range does the mean of the residual differ significantly from zero.")
    shown = told(comparison.fails_where, SHOWN_SENTENCES)
    for failure in shown:
        _draw_sentence(do, failure, comparison)
    for said in (followed(shown, comparison.dataset), unexplained(comparison.fails_where, comparison.rmse)):
        if said is not None:
            tag("p", "muted", str(said))


def _is_most(flight: Flight, ranges: Brush) -> bool:
    """Tell whether most samples of the flight are in these ranges."""
    inside = selected(flight, ranges)
    return inside is not None and float(inside.mean()) > MOST


def _draw_sentence(do: Controls, failure: Failure, comparison: Comparison) -> None:
    """Draw one sentence, with a button that selects its range, in the flight that has most of it, and shows it."""
    ranges = {failure.variable: (failure.low, failure.high)}
    flight = failure.stretches[0].flight if failure.stretches else None
    with tag("div", "line top said"):
        tag("p", "grow", f"{failure.said} ({abs(failure.sigma):.0f} sigma).")
        if any(_is_most(other, ranges) for other in comparison.dataset.flights if other.name == flight):
            if len(comparison.dataset.flights) > 1:  # a selection of the whole flight shows nothing
                tag("span", "muted", f"range: most of {flight}")
            return

        def select() -> None:
            _choose(do, ranges, failure.axis, flight)
            ui.run_javascript(_SCROLL_WHEN_DRAWN)

        show = ui.button("Show", icon="my_location", on_click=select)
        show.props(f'flat dense no-caps size=sm aria-label="Show where in the flight: {failure.said}"')


@dataclass(frozen=True)
class Selected(ChosenFlightPanel):
    """The map of the residual, and the selected samples: on the path of the flight and in time."""

    evaluation: Evaluation | None

    def draw(self, do: Controls) -> None:
        if self.evaluation is None:
            return
        comparison = self.evaluation.comparison
        flight, over = self.flight, _two_strongest(comparison.profiles)
        brushed = None if flight is None else selected(flight, self.brush)
        with tag("div", "panes").props('id="selected"'):
            if over is not None:
                axis_name, variables = over
                with tag("section", "card"):
                    heading("Residual over two variables at once", "Drag a box to select samples.")
                    drawn = error_map(comparison, axis_name, variables, self.theme)
                    shown = plot(drawn, f"residual_{axis_name}_map", "Residual over two variables")
                    _let_select(do, shown, axis_name, variables)
            if flight is not None:
                with tag("section", "card"):
                    with tag("div", "line wrap"):
                        tag("h2", "title grow", "On the flight path")
                        self.draw_flight_choice(do, flight)
                    tag("p", "muted", "Selected samples are marked.")
                    self.draw_path(flight, brushed)
        if flight is not None and brushed is not None:
            self._draw_in_time(do, flight, brushed)

    def _draw_in_time(self, do: Controls, flight: Flight, brushed: Mask) -> None:
        with tag("div", "card brush-bar"):
            self.draw_brush_note(do, brushed)
            show = ui.button("Show", icon="south", on_click=lambda: ui.run_javascript(_SCROLL))
            show.props('no-caps unelevated dense aria-label="Show the selected samples"')
        with tag("section", "card").props('id="selected-in-time"'):
            heading("In time")
            self.draw_timeline(flight, brushed, f"{flight.name}_selected", "Selected samples over time")


def _two_strongest(profiles: list[Profile]) -> tuple[str, tuple[str, str]] | None:
    """The axis with the largest error, and the two variables that explain most of its residual."""
    if not profiles:
        return None
    axis_name = profiles[0].axis
    variables = [profile.variable for profile in profiles if profile.axis == axis_name]
    return (axis_name, (variables[0], variables[1])) if len(variables) > 1 else None


def _let_select(do: Controls, shown: ui.plotly, axis_name: str, variables: tuple[str, ...]) -> None:
    """Select ranges of `variables` with the mouse, on a figure over them."""
    # Of the event only the range: it also holds the points, each with the whole figure, which is too much to be sent.
    shown.on("plotly_selected", lambda event: _select(do, event, axis_name, variables), args=["range"])
    shown.on("plotly_deselect", lambda: do.choose(brush={}), args=[])


def _select(do: Controls, event: GenericEventArguments, axis_name: str, variables: tuple[str, ...]) -> None:
    """Turn the box drawn with the mouse into ranges of variables; nothing where it was taken back."""
    ranges = event.args.get("range") if isinstance(event.args, dict) else None
    if not isinstance(ranges, dict):
        return
    ends: list[Any] = [ranges.get(letter) for letter in ("x", "y")[: len(variables)]]
    if not all(isinstance(pair, list) and len(pair) == 2 for pair in ends):
        return
    chosen = {name: (min(pair), max(pair)) for name, pair in zip(variables, ends, strict=True)}
    _choose(do, chosen, axis_name)


def _choose(do: Controls, ranges: Brush, axis: str, flight: str | None = None) -> None:
    """Select the samples in `ranges`, and look at an axis and a flight; None: at the same flight."""
    shown = {"axis": axis} if axis in AXES else {}  # not "total"
    do.choose(brush=ranges, **shown, **({} if flight is None else {"flight": flight}))


TAB = Tab("fails", "Where it fails", "troubleshoot", (Failures, Selected, HeightSensors, Rollouts))
