"""A replay with its controls: Play and Pause, a slider that the keyboard moves too, and the cursor of another figure.

All of it runs in the browser: a round trip for every frame would stutter.
"""

from nicegui import ui

from quadctl.lab.arrays import Floats
from quadctl.web.elements.figure import Figure
from quadctl.web.elements.html import plot, tag

LONGEST_S = 20.0
"""Longest time that a flight is played back in."""
_LEAST_S = 1e-6


def replayed_plot(drawn: Figure, times: Floats, cursor: ui.plotly, name: str, label: str) -> None:
    """Draw a figure with frames at evenly spaced `times`, s; it shows the one at the mouse in `cursor`."""
    shown = plot(drawn, name, label)
    with tag("div", "line replay"):
        play = ui.button("Play", icon="play_arrow").props("flat dense no-caps")
        pause = ui.button("Pause", icon="pause").props("flat dense no-caps")
        slider = tag("input", "grow").props(
            f'type=range min=0 max={len(times) - 1} step=1 value=0 aria-label="Time in the flight"'
        )
        clock = tag("span", "mono")
    step_s = max(float(times[-1] - times[0]) / max(len(times) - 1, 1), _LEAST_S)
    each_ms = 1000.0 * min(step_s, LONGEST_S / len(times))
    prepare = f"""
        const figure = getElement({shown.id}), slider = getHtmlElement({slider.id}), clock = getHtmlElement({clock.id});
        if (!figure?.Plotly) return;
        const first = {float(times[0])}, step = {step_s}, last = {len(times) - 1};
        const say = (frame) => {{
            slider.value = frame;
            clock.textContent = (first + step * frame).toFixed(1) + " s";
        }};
        const animate = (frames, ms) => figure.Plotly.animate(figure.$el, frames, {{
            mode: "immediate", frame: {{duration: ms, redraw: true}}, transition: {{duration: 0}},
        }}).catch(() => {{}});  // the next one has interrupted it
        const show = (frame) => {{ say(frame); return animate([String(frame)], 0); }};
        if (!figure.$el.follows) {{
            figure.$el.follows = true;
            figure.$el.on("plotly_animatingframe", (event) => say(Number(event.name)));
        }}
    """
    begin = "const from = Number(slider.value) < last ? Number(slider.value) : 0;"
    rest = "Array.from({length: last - from + 1}, (_, i) => String(from + i))"
    play.on("click", js_handler=f"() => {{ {prepare} {begin} animate({rest}, {each_ms}); }}")
    pause.on("click", js_handler=f"() => {{ {prepare} animate([null], 0); }}")
    slider.on("input", js_handler=f"(event) => {{ {prepare} show(Number(event.target.value)); }}")
    cursor.on(
        "plotly_hover",
        js_handler=f"""(event) => {{ {prepare}
            const time = event.points?.[0]?.x;
            if (typeof time === "number") show(Math.min(last, Math.max(0, Math.round((time - first) / step))));
        }}""",
    )
