"""Step responses flown in simulation: height over time, and the error after the step."""

import numpy as np

from quadctl.lab.tracking.step_response import StepResponses
from quadctl.web.elements.figure import Figure, axis, figure
from quadctl.web.elements.theme import Theme
from quadctl.web.work.simulated import FAR, WITH, WITHOUT


def step_figure(steps: StepResponses, theme: Theme, close_up: bool) -> Figure:
    """Heights above the reference (`close_up`, mm) or above the ground (m)."""
    looks = {WITHOUT: (theme.before, "solid"), WITH: (theme.after, "solid"), FAR: (theme.muted, "dot")}
    data = []
    settled = [0.0]
    for name, track in steps.on_one_reference.items():
        colour, dash = looks.get(name, (theme.muted, "dash"))
        y = 1000.0 * track.error_m if close_up else track.position_m
        line = {"color": colour, "dash": dash, "width": 2}
        moved = f"{name} (shifted to this setpoint)" if name == FAR else name
        data.append({"type": "scatter", "mode": "lines", "name": moved, "x": track.time_s, "y": y, "line": line})
        settled += np.quantile(y[track.time_s > 0.15 * track.time_s[-1]], [0.0, 1.0]).tolist()
    if close_up:
        room = 0.15 * (max(settled) - min(settled))
        y_axis = axis("above the setpoint / mm", theme, range=[min(settled) - room, max(settled) + room])
    else:
        first = next(iter(steps.on_one_reference.values()))
        line = {"color": theme.measured, "dash": "dash", "width": 1}
        setpoint = {"type": "scatter", "mode": "lines", "name": "setpoint", "x": first.time_s, "line": line}
        data.insert(0, {**setpoint, "y": first.reference_m})
        y_axis = axis("height / m", theme)
    return figure(data, theme, 300, xaxis=axis("time since the step / s", theme), yaxis=y_axis, hovermode="x")
