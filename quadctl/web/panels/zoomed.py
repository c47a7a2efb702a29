"""A timeline that gets its detail from the server: what is drawn is what the screen can show of the window in view."""

from typing import Any

from nicegui import ui
from nicegui.events import GenericEventArguments

from quadctl.web.elements.html import plot
from quadctl.web.elements.theme import Theme
from quadctl.web.figures.timeline import Timeline


def zoomed_plot(timeline: Timeline, theme: Theme, name: str, label: str) -> ui.plotly:
    """Draw `timeline`; after every zoom and pan its lines are sent again for the window in view."""
    shown = plot(timeline.figure(theme), name, label)

    def show_window(event: GenericEventArguments) -> None:
        window = _window(event.args)
        if window is not None:
            xs, ys = timeline.points(window or None)
            shown.run_plot_method("restyle", {"x": xs, "y": ys}, list(range(len(xs))))

    shown.on("plotly_relayout", show_window)
    return shown


def _window(change: Any) -> tuple[float, float] | tuple[()] | None:
    """The window of time after a change of the layout; () for all of it, None where the window did not change."""
    if not isinstance(change, dict):
        return None
    if change.get("xaxis.autorange"):
        return ()
    ends = change.get("xaxis.range", [change.get("xaxis.range[0]"), change.get("xaxis.range[1]")])
    if not all(isinstance(end, int | float) for end in ends):
        return None
    return float(ends[0]), float(ends[1])
