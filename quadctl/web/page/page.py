"""One open tab of a browser: what it looks at (which part, which flight, which axis), drawn from the workbench.

The page is made of parts. A part is drawn again when what it depends on has changed, and only then: a figure that a
person has zoomed into stays as it is while work goes on elsewhere.
"""

from collections.abc import Awaitable, Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from nicegui import ui
from nicegui.client import Client
from nicegui.element import Element
from nicegui.elements.upload_files import FileUpload

from quadctl.lab.arrays import Floats, Mask
from quadctl.lab.comparison.wording import listed
from quadctl.lab.flights.dataset import AXES, predict
from quadctl.lab.flights.flight import VARIABLE_NAMES, VARIABLE_UNITS, Flight
from quadctl.web.elements.browser_theme import keep_theme, wanted_theme
from quadctl.web.elements.html import tag
from quadctl.web.elements.theme import DARK, LIGHT, Theme
from quadctl.web.panels.compensator import draw_check, draw_export, draw_ratio, draw_simulation
from quadctl.web.panels.fails import draw_brushed, draw_fails
from quadctl.web.panels.flights import draw_flights, draw_intake, draw_vehicle
from quadctl.web.panels.frame import draw_header, draw_start, draw_status
from quadctl.web.panels.ladder import draw_ladder
from quadctl.web.panels.missing import draw_missing, draw_overview
from quadctl.web.panels.over_time import draw_over_time
from quadctl.web.panels.stack import draw_stack
from quadctl.web.work.worker import CancelledError
from quadctl.web.workbench.intake import Intake
from quadctl.web.workbench.workbench import Workbench

Brush = dict[str, tuple[float, float]]
"""Ranges of variables that are selected."""


@dataclass(eq=False)
class Part:
    """A piece of the page, and what it was last drawn from."""

    place: Element
    draw: Callable[["Page"], None]
    depends_on: Callable[["Page"], Sequence[Any]]
    drawn_from: Sequence[Any] | None = None
    locked: list[tuple[Any, bool]] = field(default_factory=list)
    """Elements that can be used only while no work is done, and whether they can be used then."""


class Page:
    """What one tab of a browser shows."""

    def __init__(self, bench: Workbench, intake: Intake, client: Client, tab: str) -> None:
        self.bench, self.intake, self.client = bench, intake, client
        self.tab = tab if tab in TABS else next(iter(TABS))
        self.theme = LIGHT
        self.axis = "up"
        self.flight_name = ""
        self.brush: Brush = {}
        self.search_detail: ui.label | None = None
        self._parts: list[Part] = []
        self._tab_parts: list[Part] = []
        self._drawing: Part | None = None
        self._predicted: list[tuple[Any, Flight, Floats]] = []

    # --- building -----------------------------------------------------------------------------------------------------

    async def open(self) -> None:
        """Draw all of it, and follow the workbench until the tab is closed."""
        self._dark = ui.dark_mode()
        await self.client.connected()
        if not self.client.has_socket_connection:  # it left before it was there
            return
        self._set_theme(await wanted_theme())
        self._layout()
        unsubscribe = self.bench.subscribe(self.refresh)
        self.client.on_delete(unsubscribe)
        self.refresh()

    def _layout(self) -> None:
        self._part(tag("header", "head-bar"), draw_header, lambda p: (p.theme, p.starting))
        with tag("div", "lab"):
            with tag("aside", "side"):
                self._part(tag("div", "place-ladder"), draw_ladder, lambda p: (*_state(p), p.bench.work is None))
                self._part(tag("div", "place-stack"), draw_stack, _state)
            with tag("main", "main"):
                self._part(
                    tag("div", "place-status").props('aria-live="polite"'),
                    draw_status,
                    lambda p: (p.bench.message, p.bench.work, p.bench.work and p.bench.work.detail),
                )
                self._part(
                    tag("div", "place-start"),
                    draw_start,
                    lambda p: (p.starting, p.bench.session.rungs[:1], p.bench.session.logs),
                )
                with ui.tabs().classes("tabs") as tabs:
                    for name, (title, icon, _) in TABS.items():
                        ui.tab(name, label=title, icon=icon)
                tabs.set_value(self.tab)
                tabs.on_value_change(lambda event: self._show(event.value))
                tabs.props('no-caps inline-label outside-arrows mobile-arrows align="left"')
                self._tabs = tabs
                self._body = tag("div", "body")

    def _part(
        self, place: Element, draw: Callable[["Page"], None], depends_on: Callable[["Page"], Sequence[Any]]
    ) -> None:
        self._parts.append(Part(place, draw, depends_on))

    def _show(self, tab: str) -> None:
        self.tab = tab
        ui.navigate.history.replace(f"/?show={tab}")
        self._tab_parts, self.search_detail = [], None
        self.refresh()

    # --- drawing ------------------------------------------------------------------------------------------------------

    def refresh(self) -> None:
        """Draw again what has changed."""
        with self.client:
            self._tabs.set_visibility(not self.starting)
            self._body.set_visibility(not self.starting)
            if not self._tab_parts:
                self._body.clear()
                with self._body:
                    _, _, parts = TABS[self.tab]
                    self._tab_parts = [Part(tag("div", "part"), draw, depends_on) for draw, depends_on in parts]
            for part in [*self._parts, *([] if self.starting else self._tab_parts)]:
                self._refresh(part)
            if self.search_detail is not None and self.bench.search is not None and self.bench.search.detail:
                self.search_detail.set_text(self.bench.search.detail)

    def _refresh(self, part: Part) -> None:
        now = part.depends_on(self)
        if part.drawn_from is not None and _same(part.drawn_from, now):
            for element, allowed in part.locked:
                element.set_enabled(allowed and self.idle)
            return
        part.drawn_from, part.locked = now, []
        part.place.clear()
        self._drawing = part
        with part.place:
            part.draw(self)

    def when_idle(self, element: Any, allowed: Any = True) -> None:
        """Let `element` be used only while no work is done, and where it is `allowed`."""
        element.set_enabled(bool(allowed) and self.idle)
        if self._drawing is not None:
            self._drawing.locked.append((element, bool(allowed)))

    def toggle_theme(self) -> None:
        self._set_theme(LIGHT if self.theme is DARK else DARK)
        keep_theme(self.theme)
        self.refresh()

    def _set_theme(self, theme: Theme) -> None:
        self.theme = theme
        self._dark.set_value(theme is DARK)

    # --- what is looked at --------------------------------------------------------------------------------------------

    @property
    def idle(self) -> bool:
        return self.bench.work is None

    @property
    def starting(self) -> bool:
        """There is nothing to look at yet."""
        return self.bench.opened is None and self.bench.work is None

    @property
    def flights(self) -> list[Flight]:
        opened = self.bench.opened
        datasets = [] if opened is None else [d for d in (opened.seen, opened.unseen) if d is not None]
        return [flight for dataset in datasets for flight in dataset.flights]

    @property
    def flight(self) -> Flight | None:
        """The flight that is looked at; the first where none was chosen."""
        flights = self.flights
        return next((flight for flight in flights if flight.name == self.flight_name), flights[0] if flights else None)

    def look_at(self, flight: str | None = None, axis: str | None = None) -> None:
        self.flight_name = flight or self.flight_name
        self.axis = axis or self.axis
        self.refresh()

    def predictions(self, flight: Flight) -> dict[str, Floats]:
        """What the first model of the ladder and the present one say, by the names they have in a legend."""
        session = self.bench.session
        if session.model is None:
            return {}
        first = session.rungs[0]
        models = {first.name: first.model}
        if session.current or session.off:
            models["with what was added"] = session.model
        return {name: self._prediction(model, flight) for name, model in models.items()}

    def _prediction(self, model: Any, flight: Flight) -> Floats:
        for known, on, values in self._predicted:
            if on is flight and known == model:
                return values
        values = predict(model, flight)
        self._predicted = [*self._predicted[-8:], (model, flight, values)]
        return values

    # --- brushing -----------------------------------------------------------------------------------------------------

    def select(self, ranges: Brush, axis: str) -> None:
        self.brush, self.axis = ranges, axis if axis in AXES else self.axis
        self.refresh()

    def clear_brush(self) -> None:
        self.brush = {}
        self.refresh()

    def brushed(self, flight: Flight) -> Mask | None:
        """The samples of `flight` that are selected, shape (n,); None where nothing is."""
        if not self.brush:
            return None
        inside = [(flight.variables[n] >= a) & (flight.variables[n] <= b) for n, (a, b) in self.brush.items()]
        selected = inside[0]
        for other in inside[1:]:
            selected = selected & other
        return selected

    def brush_in_words(self) -> str:
        return listed(
            [f"{VARIABLE_NAMES[n]} {a:.3g} to {b:.3g} {VARIABLE_UNITS[n]}" for n, (a, b) in self.brush.items()]
        )

    # --- doing --------------------------------------------------------------------------------------------------------

    async def act(self, work: Awaitable[None]) -> None:
        """Do what was asked for; the workbench has said already why it did not, where it did not."""
        with suppress(CancelledError):
            await work

    async def take_files(self, files: Sequence[FileUpload]) -> None:
        await self.act(self.intake.take(files))

    def refuse_file(self, name: str, size: float, too_large: bool) -> None:
        self.intake.refuse(name, size, too_large)

    async def use_vehicle(self, text: str) -> None:
        await self.act(self.intake.use_vehicle(text))

    @property
    def vehicles(self) -> list[Path]:
        return self.intake.vehicles

    @property
    def template(self) -> str:
        return self.intake.template

    def export_model(self) -> None:
        ui.download.content(self.bench.model_file(), "model.yaml", "application/yaml")

    def save_session(self) -> None:
        ui.download.content(self.bench.session_file(), "session.lab.yaml", "application/yaml")

    async def save_report(self) -> None:
        with suppress(CancelledError):
            html = await self.bench.report()
            if html is not None:
                ui.download.content(html, "report.html", "text/html")


def _same(old: Sequence[Any], new: Sequence[Any]) -> bool:
    return len(old) == len(new) and all(a is b or a == b for a, b in zip(old, new, strict=True))


def _state(p: Page) -> tuple[Any, ...]:
    return p.bench.session, p.bench.results.evaluation


def _view(p: Page) -> tuple[Any, ...]:
    """What a figure of a flight depends on."""
    session = p.bench.session
    return p.theme, p.bench.opened, session.current, session.off, len(session.rungs), p.axis, p.flight_name


_Parts = list[tuple[Callable[[Page], None], Callable[[Page], Sequence[Any]]]]

TABS: dict[str, tuple[str, str, _Parts]] = {
    "missing": (
        "What is missing",
        "search",
        [
            (draw_overview, lambda p: (*_view(p), p.flight is None and p.bench.work is None)),
            (
                draw_missing,
                lambda p: (
                    p.theme, p.bench.results.found, p.bench.search, p.bench.results.suggestion, p.bench.session.off,
                    p.bench.opened,
                ),
            ),
        ],
    ),
    "time": ("Over time", "timeline", [(draw_over_time, lambda p: (*_view(p), p.brush))]),
    "fails": (
        "Where it fails",
        "troubleshoot",
        [
            (draw_fails, lambda p: (p.theme, p.bench.results.evaluation, p.bench.work is None)),
            (draw_brushed, lambda p: (*_view(p), p.bench.results.evaluation, p.brush)),
        ],
    ),
    "compensator": (
        "Compensator",
        "flight_takeoff",
        [
            (draw_ratio, _view),
            (draw_check, lambda p: (p.bench.opened, p.bench.results.checked, p.bench.results.refused)),
            (draw_export, lambda p: (p.bench.opened,)),
            (draw_simulation, lambda p: (p.theme, p.bench.opened, p.bench.results.steps, p.bench.results.refused)),
        ],
    ),
    "flights": (
        "Flights",
        "folder_open",
        [
            (draw_flights, lambda p: (p.bench.opened, p.bench.session.rungs[:1], p.bench.session.hold_out)),
            (draw_intake, lambda p: ()),
            (draw_vehicle, lambda p: (p.bench.opened, p.bench.session.rungs[:1])),
        ],
    ),
}  # fmt: skip
