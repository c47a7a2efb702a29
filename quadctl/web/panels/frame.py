"""The frame of the page: the bar on top, the work in progress, and the place to begin without a flight."""

from dataclasses import dataclass
from pathlib import Path

from nicegui import ui

from quadctl.lab.comparison.agreement import flights_of_the_fit
from quadctl.lab.comparison.wording import ended, listed
from quadctl.lab.flights.dataset import Dataset
from quadctl.model import Model
from quadctl.web.elements.browser_theme import theme_button
from quadctl.web.elements.html import busy, heading, tag
from quadctl.web.elements.theme import Theme
from quadctl.web.panels.flights import drop_zone
from quadctl.web.panels.glossary import explained
from quadctl.web.panels.panel import Controls, Panel, work_button
from quadctl.web.panels.vehicle import VehicleChoice
from quadctl.web.session.earlier import Earlier
from quadctl.web.session.session import Step
from quadctl.web.work.jobs import Opened
from quadctl.web.work.reading import OpenedLog
from quadctl.web.work.state import Message, Work

READ_S = 15.0
"""Time after which a message that is no error goes by itself: it lies over a part of the page."""


@dataclass(frozen=True)
class Header(Panel):
    """The bar on top: files to save, and the colours."""

    theme: Theme
    starting: bool
    model: Model | None
    windows: int

    def draw(self, do: Controls) -> None:
        tag("h1", "brand", "quadctl lab")
        tag("span", "grow")
        if self.windows > 1:
            with tag("span", "windows").props('role="status"'):
                explained(f"{self.windows} windows")
        holds_effects = self.model is not None and bool(self.model.stack)
        for label, icon, act, there in (
            ("New session", "note_add", do.start_anew, not self.starting or holds_effects),
            ("Save session", "save", do.save_session, not self.starting),
            ("Report", "description", do.save_report, not self.starting),
            ("Download model", "download", do.export_model, not self.starting or holds_effects),  # outlives its flights
        ):
            if there:
                button = ui.button(label, icon=icon, on_click=act).props(f'flat no-caps aria-label="{label}"')
                button.classes("header-button").props(f'data-short="{label.split()[0]}"')
        help_button = ui.button(icon="help_outline", on_click=do.show_help)
        help_button.props('flat round aria-label="Help" title="Keys and words (?)"')
        theme_button(self.theme, do.toggle_theme)


@dataclass(frozen=True)
class Status(Panel):
    """The work and the search in progress, each with a way to cancel it, and the last message: always in sight."""

    idle: bool
    searching: bool
    message: Message | None
    waiting: tuple[str, ...]

    def draw(self, do: Controls) -> None:
        if not self.idle:
            with tag("div", "banner work").props('role="status"'):
                busy()
                do.nest(WorkInWords, "grow")
                ui.button("Cancel", on_click=do.bench.cancel).props("flat dense no-caps")
        if self.searching:
            with tag("div", "banner search").props('role="status"'):
                busy()
                do.nest(SearchInWords, "grow")
                ui.button("Cancel", on_click=do.bench.cancel_search).props("flat dense no-caps")
        if self.waiting:
            with tag("div", "banner").props('role="status"'):
                ui.icon("schedule")
                tag("span", "grow", f"Next: {listed(self.waiting)}.")
        message = self.message
        if message is not None:
            role = 'role="alert"' if message.kind == "error" else 'role="status"'
            with tag("div", f"banner {message.kind}").props(role):
                ui.icon("error" if message.kind == "error" else "info")
                with tag("div", "grow"):
                    tag("span", "", ended(message.text))
                if message.undo:
                    work_button(do, "Undo", do.bench.undo, "flat dense", "undo")
                if message.go_back:
                    work_button(do, "Go back to it", do.bench.go_back, "flat dense", "undo")
                elif message.kind != "error":  # an error stays until it is read
                    ui.timer(READ_S, lambda: do.bench.dismiss(message), once=True)
                ui.button(icon="close", on_click=lambda: do.bench.dismiss(message)).props(
                    'flat dense round aria-label="Dismiss"'
                )


@dataclass(frozen=True)
class Doubts(Panel):
    """Questions about flights that seem to be of another vehicle; they are not used before the answer."""

    opened: Opened

    def draw(self, do: Controls) -> None:
        for log in self.opened.logs:
            if log.doubt:
                _draw_doubt(do, log)


def _draw_doubt(do: Controls, log: OpenedLog) -> None:
    with tag("div", "banner wrap").props('role="status" id="doubt"'):
        ui.icon("help").classes("warn")
        tag("span", "grow", f"{log.path.name}: {log.doubt}. Use it anyway?")
        work_button(do, "Use it anyway", lambda: do.bench.use_anyway(log.path), "outline dense")
        work_button(do, "Leave it out", lambda: do.bench.forget_log(log.path), "flat dense")


@dataclass(frozen=True)
class FittedTo(Panel):
    """A word on flights that the parameters have not been fitted to, with a way to refit them."""

    step: Step | None
    seen: Dataset | None
    off: frozenset[str]
    unseen: frozenset[Path]
    of_other_flights: tuple[str, ...]

    def draw(self, do: Controls) -> None:
        if self.step is None or self.seen is None:
            return
        for said in self.of_other_flights:
            with tag("div", "banner").props('role="status" id="of-other-flights"'):
                ui.icon("rule")
                tag("span", "grow", f"{said} The error counts that.")
        used, new = flights_of_the_fit(self.step.model, self.seen.names)
        known = sorted({log.name for log in self.unseen} & set(used))
        if not (new or known):
            return
        if known:
            words = f"The model is fitted to {listed(known)}, too: the error there is no held-out error."
            what = "Refit without what is held out"
        else:
            words = f"The model is fitted to {listed(used)} only, not to {listed(new)}."
            what = "Refit to all flights"
        with tag("div", "banner").props('role="status" id="fitted-to"'):
            ui.icon("rule")
            tag("span", "grow", words)
            work_button(do, what, do.bench.refit, "outline dense", allowed=not self.off)


@dataclass(frozen=True)
class WorkInWords(Panel):
    """Title and step of the work in progress.

    A panel of its own: if the Cancel button beside it were replaced at every step, clicks on it would be lost.
    """

    work: Work | None

    def draw(self, do: Controls) -> None:
        if self.work is not None:
            ui.label(f"{self.work.title}: {self.work.detail}\u2026" if self.work.detail else f"{self.work.title}\u2026")


@dataclass(frozen=True)
class SearchInWords(Panel):
    """Title and step of the search; a panel of its own for the reason of `WorkInWords`."""

    search: Work | None

    def draw(self, do: Controls) -> None:
        if self.search is not None:
            ui.label(f"{self.search.title}: {self.search.detail or 'every effect of the catalogue is tried'}\u2026")


@dataclass(frozen=True)
class Start(Panel):
    """The page before a flight is open: a place to drop one, and the choice of the vehicle."""

    starting: bool
    logs: tuple[Path, ...]
    earlier: tuple[Earlier, ...]

    def draw(self, do: Controls) -> None:
        if not self.starting:
            return
        with tag("section", "card start"):
            heading("Find what your flight model is missing")
            tag(
                "p",
                "",
                "Open a log of a flight. You will see where the model of your vehicle is wrong, which physical effect "
                "explains it, and how far the error falls when you add it.",
            )
            if self.logs:
                names = listed([path.name for path in self.logs])
                tag("p", "verdict", f"Open: {names}. Choose below the vehicle that flew.")
            drop_zone(do)
            with tag("div", "line wrap"):
                sample = ui.button(
                    "Try a sample flight", icon="flight_takeoff", on_click=lambda: do.act(do.bench.open_sample())
                )
                sample.props("no-caps outline")
                text = "No log at hand? The vehicle below is flown in simulation, with an effect that its model lacks."
                tag("span", "muted grow", text)
        if self.earlier:
            with tag("section", "card").props('id="earlier"'):
                heading("Earlier sessions")
                for one in self.earlier:
                    _draw_earlier(do, one)
        do.nest(VehicleChoice)


def _draw_earlier(do: Controls, one: Earlier) -> None:
    with tag("div", "line wrap"):
        work_button(do, one.title, lambda: do.bench.open_earlier(one.path), "outline dense", "history")
        tag("span", "muted grow", f"{one.details} ({one.path.name})")
