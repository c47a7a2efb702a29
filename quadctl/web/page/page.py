"""One open tab of a browser: its choices (part, flight, axis, selection), and its panels, drawn from the workbench."""

from collections.abc import Awaitable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import Any

from nicegui import ui
from nicegui.client import Client
from nicegui.element import Element
from nicegui.elements.mixins.disableable_element import DisableableElement
from nicegui.events import KeyEventArguments

from quadctl.web.elements.browser_theme import keep_theme, wanted_theme
from quadctl.web.elements.html import tag
from quadctl.web.elements.theme import DARK, LIGHT, Theme
from quadctl.web.elements.upload import SentFile
from quadctl.web.panels import compensator, fails, flights, missing, over_time
from quadctl.web.panels.choices import FILE, Choices, choices_of
from quadctl.web.panels.frame import Doubts, FittedTo, Header, Start, Status
from quadctl.web.panels.help import help_dialog
from quadctl.web.panels.panel import Panel, Tab
from quadctl.web.panels.sequence import ModelSequence
from quadctl.web.panels.stack import Stack, at_limits
from quadctl.web.panels.verdict import Verdict
from quadctl.web.panels.view import View
from quadctl.web.work.state import Message
from quadctl.web.work.worker import CancelledError
from quadctl.web.workbench.intake import Intake
from quadctl.web.workbench.workbench import Workbench

WENT_BACK = "quadctl-went-back"
TELL_OF_BACK = f"""<script>
window.addEventListener("popstate", () => emitEvent("{WENT_BACK}", location.search));
</script>"""
"""Tells the server of the browser's Back and Forward."""
SESSION_FILE = "session.lab.yaml"
REPORT_FILE = "report.html"
"""Name of the file that a saved session gives to the browser."""
SCROLL_TO_VEHICLE = """
const scroll = (trials) => {
  const card = document.querySelector('.card.vehicle');
  if (card) card.scrollIntoView();
  else if (trials > 0) requestAnimationFrame(() => scroll(trials - 1));
};
scroll(600);
"""
"""Runs a moment before the part of the page is drawn that holds the vehicle."""
TABS: dict[str, Tab] = {tab.name: tab for tab in (missing.TAB, over_time.TAB, fails.TAB, compensator.TAB, flights.TAB)}

KEYS_OF_TABS = {str(number): name for number, name in enumerate(TABS, start=1)}


def _known(choices: Choices) -> Choices:
    """The same choices, if the part of the page that they name is there; else those of the first part."""
    return choices if choices.show in TABS else replace(choices, show=next(iter(TABS)))


@dataclass(eq=False)
class Part:
    """A place on the page, and the panel that was last drawn there."""

    place: Element
    panel: type[Panel]
    drawn: Panel | None = None
    locked: list[tuple[DisableableElement, bool]] = field(default_factory=list)
    """Elements that are enabled only while no work is done, and whether they are enabled then."""
    nested: "list[Part]" = field(default_factory=list)


class Page:
    """One open tab. It is the `Controls` of its panels."""

    def __init__(self, bench: Workbench, intake: Intake, client: Client, query: str) -> None:
        """A tab of `bench` whose address has this query; without one, it begins with the choices of the session."""
        self.bench = bench
        self.intake, self._client = intake, client
        self._choices = _known(choices_of(query or bench.session.view))
        self._theme = LIGHT
        self._frame_parts: list[Part] = []
        self._tab_parts: list[Part] = []
        self._drawing: Part | None = None
        self._idle = True
        self._worst_axis = "up"
        self._vehicle = ""
        self._of_flights: frozenset[str] = frozenset()

    # --- building -----------------------------------------------------------------------------------------------------

    async def open(self) -> None:
        """Draw all of it, and follow the workbench until the tab is closed."""
        await self._client.connected()
        if not self._client.has_socket_connection:  # it left before it was there
            return
        self._client.on_disconnect(lambda: self.bench.count_window(-1))
        self._client.on_connect(lambda: self.bench.count_window(1))  # again, after a lost connection
        self.bench.count_window(1)
        theme = await wanted_theme()
        self.build(theme)
        unsubscribe = self.bench.subscribe(self.refresh)
        self._client.on_delete(unsubscribe)

    def build(self, theme: Theme) -> None:
        """Draw all of it."""
        self._dark = ui.dark_mode()
        self._set_theme(theme)
        self._layout()
        self.refresh()

    def _layout(self) -> None:
        self._frame_parts.append(Part(tag("header", "head-bar"), Header))
        with tag("div", "lab"):
            with tag("aside", "side"):
                self._frame_parts.append(Part(tag("div", "place-sequence"), ModelSequence))
                self._frame_parts.append(Part(tag("div", "place-stack"), Stack))
            with tag("div", "main"):  # Quasar's page around it is the main region
                self._frame_parts.append(Part(tag("div", "place-status").props('aria-live="polite"'), Status))
                self._frame_parts.append(Part(tag("div", "place-fitted"), Doubts))
                self._frame_parts.append(Part(tag("div", "place-fitted"), FittedTo))
                self._frame_parts.append(Part(tag("div", "place-start"), Start))
                self._above_tabs = tag("div", "above-tabs")
                with ui.tabs().classes("tabs") as tabs:
                    for tab in TABS.values():
                        ui.tab(tab.name, label=tab.title, icon=tab.icon)
                tabs.set_value(self._choices.show)
                tabs.on_value_change(lambda event: self._show(event.value))
                tabs.props('no-caps inline-label outside-arrows mobile-arrows align="left"')
                self._tabs = tabs
                ui.on(WENT_BACK, lambda event: self._go_back(event.args))
                self._body = tag("div", "body")
        self._help = help_dialog()
        ui.keyboard(on_key=self._on_key, repeating=False, ignore=["input", "select", "textarea"])

    async def _on_key(self, event: KeyEventArguments) -> None:
        modifiers = event.modifiers
        if event.action.keydown and not (modifiers.ctrl or modifiers.alt or modifiers.meta):
            await self.press(event.key.name, modifiers.shift)

    async def press(self, key: str, shift: bool = False) -> None:
        """Do what a key stands for (see `panels/help.py`); other keys do nothing."""
        bench = self.bench
        if key == "?":
            self._help.value = not self._help.value
        elif self.view().starting:
            return
        elif key in KEYS_OF_TABS:
            self._tabs.set_value(KEYS_OF_TABS[key])
        elif key.lower() == "z":
            await self.act(bench.redo() if shift else bench.undo())
        elif key.lower() == "r":
            await self.act(bench.refit())
        elif key.lower() == "a":
            await self._add_missing()

    async def _add_missing(self) -> None:
        found = self.bench.results.found
        missing = [] if found is None else [step.effect for step in found.diagnosis.steps[1:]]
        if missing:
            await self.act(self.bench.add(*missing))
        else:
            self.bench.say("done", "There is nothing to add: no effect has been found missing.")

    def _show(self, tab: str) -> None:
        if tab == self._choices.show:
            return
        self._choices = replace(self._choices, show=tab)
        if self.bench.message is not None and self.bench.message.kind != "error":  # read, or not of this part
            self.bench.dismiss()
        ui.navigate.history.push(f"/?{self._choices.query()}")
        self._above_tabs.run_method("scrollIntoView", {"block": "nearest"})  # a key leaves the page where it is
        self._tab_parts = []
        self.refresh()

    def _go_back(self, query: object) -> None:
        """Show the state of the page that the browser's Back or Forward has led to."""
        self._show_choices(choices_of(query if isinstance(query, str) else ""))

    def _show_choices(self, choices: Choices) -> None:
        self._choices = _known(choices)
        self._tabs.set_value(self._choices.show)
        self._tab_parts = []
        self.refresh()

    def choose(self, **changes: Any) -> None:
        """Change choices of this tab; its address follows, so that it is a link to what is shown."""
        self._choices = replace(self._choices, **changes)
        self._tell_address()
        self.refresh()

    def _tell_address(self) -> None:
        """Make the address of this tab a link to what it shows."""
        with self._client:  # the element that was clicked may have been drawn again, and be gone
            ui.navigate.history.replace(f"/?{self._choices.query()}")

    # --- drawing ------------------------------------------------------------------------------------------------------

    def view(self) -> View:
        """All that can be shown now."""
        bench, chosen = self.bench, self._choices
        if bench.results.evaluation is not None:  # until the next one is there, the figures stay as they are
            self._worst_axis = bench.results.evaluation.worst_axis
        return View(
            choices=replace(chosen, axis=chosen.axis or self._worst_axis),
            session=bench.session,
            history=bench.history,
            opened=bench.opened,
            results=bench.results,
            work=bench.work,
            search=bench.search,
            message=None if self._is_in_sight(bench.message) else bench.message,
            as_read=bench.as_read,
            waiting=bench.waiting,
            windows=bench.windows,
            hidden=bench.simulation.hidden,
            vehicles=tuple(self.intake.vehicles),
            own_vehicles=tuple(self.intake.own_vehicles),
            folder=bench.folder,
            other_model=bench.other_model,
            theme=self._theme,
        )

    def _is_in_sight(self, message: Message | None) -> bool:
        """Tell whether a message says what this part of the page shows anyway."""
        return message is not None and message.kind == "found" and self._choices.show == missing.TAB.name

    def _forget_other_flights(self, open_: frozenset[str]) -> bool:
        """Drop the choices that belong to flights that are open no more, flight, axis, selection and others: where the
        chosen one is gone, or all of them are."""
        gone = self._of_flights - open_
        others = bool(open_ and self._of_flights and (self._choices.flight in gone or gone == self._of_flights))
        if others:
            self._choices = Choices(self._choices.show, channels=self._choices.channels)
        self._of_flights = open_ or self._of_flights
        return others

    def _forget_axis_of(self, vehicle: str) -> bool:
        """Drop the chosen axis where another vehicle is in use now: its error may be along another one."""
        other = self._vehicle not in ("", vehicle) and bool(self._choices.axis)
        if other:
            self._choices = replace(self._choices, axis="")
        self._vehicle = vehicle
        return other

    def refresh(self) -> None:
        """Draw the panels again whose fields have changed."""
        view = self.view()
        others = self._forget_other_flights(frozenset(view.opened.flight_names))
        vehicle = view.session.vehicle
        if self._forget_axis_of("" if vehicle is None else vehicle.name) or others:
            self._tell_address()
            view = self.view()
        self._idle = view.idle
        with self._client:
            self._tabs.set_visibility(not view.starting)
            self._body.set_visibility(not view.starting)
            if not self._tab_parts:
                self._body.clear()
                with self._body:
                    panels = TABS[self._choices.show].panels
                    self._tab_parts = [
                        Part(tag("div", f"part part-{panel.__name__.lower()}"), panel) for panel in panels
                    ]
            for part in [*self._frame_parts, *([] if view.starting else self._tab_parts)]:
                self._refresh(part, view)

    def _refresh(self, part: Part, view: View) -> None:
        now = part.panel.of(view)
        if now.shows_the_same_as(part.drawn):
            for element, allowed in part.locked:
                element.set_enabled(allowed and self._idle)
        else:
            part.drawn, part.locked, part.nested = now, [], []
            part.place.clear()
            self._drawing = part
            with part.place:
                now.draw(self)
        for nested in part.nested:
            self._refresh(nested, view)

    # --- controls of the panels ---------------------------------------------------------------------------------------

    async def act(self, work: Awaitable[None]) -> None:
        """Do some work of the bench, which says by itself why where it cannot."""
        with suppress(CancelledError):
            await work

    def when_idle(self, element: DisableableElement, allowed: bool = True) -> None:
        """Enable `element` only while no work is done, and only where it is `allowed`."""
        assert self._drawing is not None, "only a panel that is being drawn has elements to enable"
        self._drawing.locked.append((element, bool(allowed)))
        element.set_enabled(bool(allowed) and self._idle)

    def nest(self, panel: type[Panel], classes: str = "") -> None:
        """Put a panel here that is drawn again by itself; it is drawn when the one around it is complete."""
        assert self._drawing is not None, "only a panel that is being drawn has room for another"
        self._drawing.nested.append(Part(tag("div", classes), panel))

    def show_evidence(self, effect: str) -> None:
        """Open the evidence for an effect of the model or a missing one; close it where `effect` is empty."""
        self.choose(evidence=effect)
        if effect:
            self._tabs.set_value(missing.TAB.name)

    def show_vehicles(self) -> None:
        """Show the part of the page where another vehicle is chosen."""
        self._tabs.set_value(flights.TAB.name)
        with self._client:
            ui.run_javascript(SCROLL_TO_VEHICLE)

    def toggle_theme(self) -> None:
        self._set_theme(LIGHT if self._theme is DARK else DARK)
        keep_theme(self._theme)
        self.refresh()

    def show_help(self) -> None:
        self._help.open()

    def _set_theme(self, theme: Theme) -> None:
        self._theme = theme
        self._dark.set_value(theme is DARK)

    async def start_anew(self) -> None:
        """Begin a new session, and show it as a new tab would."""
        before = self.bench.session
        await self.act(self.bench.start_anew())
        if self.bench.session is not before:
            self._show_choices(Choices())
            self._tell_address()
            with self._client:
                ui.run_javascript("scrollTo(0, 0)")

    async def take_files(self, files: Sequence[SentFile]) -> None:
        before = self.bench.session.view
        await self.act(self.intake.take(files))
        view = self.bench.session.view
        if view and view != before:  # a session was opened, and this tab shows it as it was saved
            self._show_choices(choices_of(view))
            self._tell_address()

    async def take_model(self, file: SentFile) -> None:
        """Draw the model of a file beside the others."""
        if await self.intake.take_model(file):
            self.choose(beside=FILE)

    def export_model(self) -> None:
        text, model = self.bench.model_file(), self.bench.session.model
        assert model is not None  # else there is no text
        name = compensator.name_of_file(model)
        ui.download.content(text, name, "application/yaml")
        self.bench.say_exported(name)

    def save_session(self) -> None:
        ui.download.content(self.bench.session_file(self._choices.query()), SESSION_FILE, "application/yaml")
        self.bench.say("done", f"The session is saved as {SESSION_FILE} in the downloads folder of your browser.")

    async def save_report(self) -> None:
        with suppress(CancelledError):
            session, results = self.bench.session, self.bench.results
            verdict = Verdict.of(self.view())
            facts = [] if session.model is None else compensator.doubts(session.model, session.confounded)
            if results.evaluation is not None:
                agreement = results.evaluation.agreement
                facts += [] if agreement is None else [agreement.answer]
                facts += at_limits(results.evaluation, results.found)
            html = await self.bench.report([*verdict.sentences, *map(str, facts)], verdict.condition)
            if html is not None:
                ui.download.content(html, REPORT_FILE, "text/html")
                self.bench.say("done", f"The report is saved as {REPORT_FILE} in the downloads folder of your browser.")
