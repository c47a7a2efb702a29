"""One open tab of the live view: drawn once; after that only numbers and curves are updated."""

import asyncio
import time
from collections.abc import Sequence
from contextlib import suppress
from enum import Enum

from nicegui import ui
from nicegui.client import Client
from nicegui.events import KeyEventArguments

from quadctl.flight.pilot.tick import Stage
from quadctl.web.elements.browser_theme import keep_theme, theme_button, wanted_theme
from quadctl.web.elements.html import heading, plot, tag
from quadctl.web.elements.theme import DARK, LIGHT, Theme
from quadctl.web.live.history import Row
from quadctl.web.live.land import LandButton
from quadctl.web.live.panels import EventList, GuardList, NowPanel, Tiles
from quadctl.web.live.space import NO_BOX, additions, box_for, place, present, space_figure
from quadctl.web.live.strips import FLIGHT, MACHINE, WINDOW_ROWS, marks, points, strips
from quadctl.web.live.viewing import Viewing

REFRESH_S = 0.2
SLOW_S = 10.0
"""Longest time to wait for a browser to draw."""
LAND_KEY = "l"
LOADING_S = 60.0
_CHARTS_ARE_THERE = """return new Promise(done => {
  const look = () => document.querySelector('.charts .main-svg') ? done(true) : setTimeout(look, 100);
  look();
})"""


class _Land(Enum):
    """Title, hint and kind of the button."""

    OVER = "Over", "the flight has ended", "off"
    BEFORE = "LAND", "as soon as there is a flight", "off"
    RELEASED = "Released", "somebody else flies", "off"
    LANDING = "Landing", "the autopilot lands", "off"
    ASKED = "Landing", "the flight has been asked", "off"
    PRESSED = "Press again: LAND", "or wait, and nothing happens", "sure"
    READY = "LAND", "press twice, or type L L", "ready"


_DRAWN = "return true"
"""Script whose answer comes after everything sent to the browser before."""


class LivePage:
    """Content of one tab."""

    def __init__(self, viewing: Viewing) -> None:
        self._viewing = viewing
        self._history = viewing.history
        self._theme = LIGHT
        self._button = LandButton()
        self._rows_drawn = 0
        self._phases_drawn = 0
        self._all_drawn = False
        self._box = NO_BOX
        """Space that is shown."""
        self._can_extend = False
        """False until the browser has loaded Plotly, which takes long: until then new rows wait."""

    async def open(self, client: Client) -> None:
        """Draw all of it, and follow the flight until the tab is closed."""
        self._dark = ui.dark_mode()
        await client.connected()
        if not client.has_socket_connection:  # it left before it was there
            return
        self._set_theme(await wanted_theme())
        self._layout()
        self._refresh()
        ui.keyboard(on_key=self._key)
        ui.timer(REFRESH_S, self._follow)
        with suppress(TimeoutError):
            self._can_extend = await ui.run_javascript(_CHARTS_ARE_THERE, timeout=LOADING_S)

    # --- building -----------------------------------------------------------------------------------------------------

    def _layout(self) -> None:
        brief = self._history.brief
        self._head = tag("header", "head-bar")
        self._draw_head()
        with tag("div", "lab live"):
            with tag("aside", "side"):
                with tag("section", "card now-card").props('aria-label="Now"'):
                    self._now = NowPanel(brief)
                self._land = ui.element("button").classes("land").props('type="button" id="land"')
                with self._land:
                    self._land_title = ui.label().classes("land-title")
                    self._land_hint = ui.label().classes("land-hint")
                self._land.on("click", self._press)
                with tag("section", "card").props('aria-label="Guards"'):
                    heading("Guards", "Present value and limit of each guard.")
                    self._guards = GuardList(brief)
            with tag("main", "main"):
                self._banner = tag("div", "banner").props('role="status" aria-live="assertive" id="banner"')
                with self._banner:
                    self._banner_icon = ui.icon("info")
                    self._banner_text = ui.label().classes("grow banner-text")
                self._tiles = Tiles()
                self._charts = tag("section", "card panes charts")
                self._draw_charts()
                with tag("section", "card").props('aria-label="Events"'):
                    heading("Events")
                    self._events = EventList()

    def _draw_head(self) -> None:
        brief = self._history.brief
        self._head.clear()
        with self._head:
            tag("span", "brand", "quadctl live")
            words = f"{brief.mission.name} · {brief.vehicle.name} · compensator {brief.compensator}"
            tag("span", "muted head-what", words)
            tag("span", "grow")
            theme_button(self._theme, self._toggle_theme)

    def _draw_charts(self) -> None:
        """Draw the curves of the last minute; when the flight is over, those of all of it."""
        history = self._history
        self._all_drawn = history.over
        rows = history.since(0, len(history.rows) if history.over else WINDOW_ROWS)
        step = max(len(rows) // (2 * WINDOW_ROWS), 1)
        phases = [(t, name) for t, name in history.phases if not rows or t >= rows[0].time_s]
        self._rows_drawn, self._phases_drawn = history.n_rows, len(history.phases)
        self._charts.clear()
        with self._charts:
            flight = strips(FLIGHT, rows[::step], phases, self._theme)
            machine = strips(MACHINE, rows[::step], phases, self._theme)
            self._box = box_for(NO_BOX, [*map(place, rows), *present(history.latest)])
            in_space = space_figure(rows[::step], history.latest, history.brief.vehicle, self._box, self._theme)
            self._plots = [
                (FLIGHT, plot(flight, "flight", "Height, speed, tilt, throttle and residual of the model over time"))
            ]
            self._space = plot(in_space, "path", "The vehicle from above, with its path and setpoint")
            self._plots += [(MACHINE, plot(machine, "link", "Tick lateness, ages and battery over time"))]

    # --- following ----------------------------------------------------------------------------------------------------

    async def _follow(self) -> None:
        """Refresh, and wait until the browser has drawn: otherwise updates would queue up in a slow one."""
        began = time.monotonic()
        self._refresh()
        await self._drawn()
        # As long again for whatever else this machine has to do, a flight for example.
        await asyncio.sleep(time.monotonic() - began)

    async def _drawn(self) -> None:
        """Wait until the browser has drawn, but not longer than `SLOW_S`."""
        with suppress(TimeoutError):
            await ui.run_javascript(_DRAWN, timeout=SLOW_S)

    def _refresh(self) -> None:
        history = self._history
        self._say_how_it_is()
        self._show_land()
        if history.latest is None:
            return
        self._now.show(history)
        self._tiles.show(history)
        self._guards.show(history.latest)
        self._events.show(history)
        if history.over and not self._all_drawn:
            self._draw_charts()
        elif self._can_extend:
            self._extend_charts()

    def _extend_charts(self) -> None:
        history = self._history
        rows = history.since(self._rows_drawn, WINDOW_ROWS)
        if rows and not self._all_drawn:
            self._rows_drawn = history.n_rows
            for panes, shown in self._plots:
                xs, ys = points(panes, rows)
                shown.run_plot_method("extendTraces", {"x": xs, "y": ys}, list(range(len(xs))), WINDOW_ROWS)
            self._move_vehicle(rows)
        if len(history.phases) > self._phases_drawn:
            self._phases_drawn = len(history.phases)
            since_s = history.rows[-WINDOW_ROWS].time_s if len(history.rows) >= WINDOW_ROWS else 0.0
            drawn = marks([(t, name) for t, name in history.phases if t >= since_s], self._theme)
            for _, shown in self._plots:
                shown.run_plot_method("relayout", drawn)

    def _move_vehicle(self, rows: Sequence[Row]) -> None:
        """Show the vehicle where it is now, in a larger space where it has left the one that is shown."""
        history = self._history
        box = box_for(self._box, [*map(place, rows), *present(history.latest)])
        if box == self._box:
            points, most = additions(rows, history.latest, history.brief.vehicle, box, WINDOW_ROWS)
            self._space.run_plot_method("extendTraces", points, list(range(len(most["x"]))), most)
        else:
            self._box = box
            shown = history.since(0, WINDOW_ROWS)
            self._space.update_figure(space_figure(shown, history.latest, history.brief.vehicle, box, self._theme))

    def _say_how_it_is(self) -> None:
        history = self._history
        silent_s, ending, latest = history.silent_s, history.ending, history.latest
        if ending is not None:
            self._say("done" if ending.completed else "error", "\n".join(ending.lines))
        elif silent_s is not None:
            self._say(
                "error",
                f"No data from the flight for {silent_s:.0f} s. LAND may not reach it: Ctrl-C in its terminal lands, "
                "and the switch on the remote control takes the vehicle.",
            )
        elif latest is None:
            self._say("work", "Waiting for the autopilot.")
        elif latest.ended:
            self._say("done" if latest.ended == "completed" else "error", f"The flight ends: {latest.ended}.")
        else:
            self._banner.set_visibility(False)

    def _say(self, kind: str, text: str) -> None:
        self._banner.set_visibility(True)
        self._banner.classes(replace=f"banner {kind}")
        self._banner_icon.set_name({"done": "check_circle", "error": "error", "work": "hourglass_empty"}[kind])
        self._banner_text.set_text(text)

    # --- landing ------------------------------------------------------------------------------------------------------

    async def _key(self, event: KeyEventArguments) -> None:
        if event.action.keydown and not event.action.repeat and str(event.key).lower() == LAND_KEY:
            await self._press()

    async def _press(self) -> None:
        if self._history.can_land and self._button.press(time.monotonic()):
            self._viewing.land()
        self._show_land()
        await self._drawn()
        self._button.asks(time.monotonic())

    def _show_land(self) -> None:
        title, hint, kind = self._land_button().value
        self._land_title.set_text(title)
        self._land_hint.set_text(hint)
        self._land.classes(replace=f"land {kind}")
        self._land.props(**{"add" if kind == "off" else "remove": "disabled"})

    def _land_button(self) -> _Land:
        history = self._history
        if history.over:
            return _Land.OVER
        if history.latest is None:
            return _Land.BEFORE
        if history.latest.stage == Stage.RELEASED.name:
            return _Land.RELEASED
        if history.latest.stage == Stage.LAND.name:
            return _Land.LANDING
        if self._viewing.land_asked:
            return _Land.ASKED
        return _Land.PRESSED if self._button.waits(time.monotonic()) else _Land.READY

    # --- colours ------------------------------------------------------------------------------------------------------

    def _toggle_theme(self) -> None:
        self._set_theme(LIGHT if self._theme is DARK else DARK)
        keep_theme(self._theme)
        self._draw_head()
        self._draw_charts()

    def _set_theme(self, theme: Theme) -> None:
        self._theme = theme
        self._dark.set_value(theme is DARK)
