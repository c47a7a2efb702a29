"""Words for what flights tell of a vehicle's rotation, made once, at the edge."""

import numpy as np
from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from quadctl.lab.rotation.parameters import MOST_UNKNOWN, Rotation
from quadctl.lab.rotation.rollout_errors import FORECAST_ERRORS, FORECAST_HOLDS, FORECAST_OF, Unseen
from quadctl.lab.rotation.value import Value
from quadctl.words import count

ROWS = (
    ("gain", "moment gain", "rad/s² per (thrust difference / weight)"),
    ("slope", "gain from command", "rad/s² per relative difference of the commands"),
    ("damping_1_s", "damping of the rate", "1/s"),
    ("airspeed", "moment by airspeed", "rad/s² per m/s"),
    ("lag_s", "rotor lag", "s"),
    ("lead_s", "lead by the rotors' inertia", "s"),
)
INERTIA = ("inertia", "kg m²")
"""Name and unit of the row of the moments of inertia."""


def answer(found: Rotation) -> RenderableType:
    """Table of the parameters of each axis with 95 % intervals, and sentences on thrust, rotors and what is not
    told."""
    table = Table(
        title=f"Rotation, from {count(len(found.names), 'flight')}: value [95 % interval]", title_justify="left"
    )
    for heading in ("", *found.axes, "unit"):
        table.add_column(heading, overflow="fold")
    told = {axis: found.told(axis) for axis in found.axes}
    for key, name, unit in ROWS:
        if any(key in values for values in told.values()):
            table.add_row(name, *(_shown(values.get(key)) for values in told.values()), unit)
    if found.inertia:
        table.add_row(INERTIA[0], *(_shown(found.inertia.get(axis)) for axis in found.axes), INERTIA[1])
    said = Text("\n".join([*_thrust(found), *_untold(found)]))
    return Group(table, said) if table.rows else said


def forecasts(unseen: Unseen) -> RenderableType:
    """Table of the errors of forecasts with 95 % intervals, beside those of a state that is held."""
    table = Table(title=f"Whole state from commands: {FORECAST_ERRORS}", title_justify="left")
    for heading in ("after", "model", *FORECAST_OF):
        table.add_column(heading, overflow="fold")
    for row in unseen.rows():
        table.add_row(*row)
    return Group(table, Text(FORECAST_HOLDS))


def _shown(value: Value | None) -> str:
    return "-" if value is None else str(value)


def _thrust(found: Rotation) -> list[str]:
    lines = []
    kind = "squared speed, krpm²," if found.measured else "output"
    lines.append(f"Mean {kind} in flight: {found.hover_drive:.3g}.")
    if found.level is not None:
        lines.append(f"Mean {kind} in level hover: {_shown(found.level)}.")
    lines += _unbalanced(found)
    if found.lag is not None:
        behind = "" if found.delay is None else f", behind a delay of the command of {_shown(found.delay)} s"
        lines.append(f"Rotor lag by roll and pitch: {_shown(found.lag)} s{behind}.")
    if found.thrust.found is not None and not found.measured:
        by = "output times voltage" if found.thrust.by_voltage else kind
        lines.append(f"Thrust map: 1 % more {by} raises the thrust by {_shown(found.thrust.found)} % of the weight.")
    drags = {name: fit.values["drag_1_s"] for name, fit in found.drag.items() if fit.white}
    if drags:
        said = ", ".join(f"{name} = {_shown(value)} 1/s" for name, value in drags.items())
        lines.append(f"Drag by the accelerometer: {said}.")
    return lines


def _unbalanced(found: Rotation) -> list[str]:
    """Sentences on the rotors' mean commands, and on the causes that they may have."""
    lines = []
    half = found.share_half
    if half is not None and np.all(np.isfinite(half)):
        differ = any(abs(s - 1) > h for s, h in zip(found.share, half, strict=True))
        causes = "; causes may be unequal rotors, a centre of mass off the middle, or wind" if differ else ""
        own = ", ".join(f"{100 * (s - 1):+.1f} ± {100 * h:.1f} %" for s, h in zip(found.share, half, strict=True))
        lines.append(f"Rotor commands relative to their mean: {own}{causes}.")
    if found.centre_m:
        off = ", ".join(
            f"{name} {1e3 * v.value:.3g} [{1e3 * v.low:.3g}, {1e3 * v.high:.3g}] mm"
            for name, v in found.centre_m.items()
        )
        lines.append(f"As a centre of mass, with rotors that are alike and no wind: {off}.")
    if found.shares is not None:
        shares = ", ".join(
            f"{100 * (s.value - 1):+.1f} [{100 * (s.low - 1):+.1f}, {100 * (s.high - 1):+.1f}] %"
            for s in found.shares.rotors.values()
        )
        which = "the unequal rotors" if found.shares.turns else "the centre of mass, if any"
        lines += [
            "As unequal rotors, with a centre of mass in the middle and no wind: thrusts "
            f"{shares} relative to their mean.",
            "A centre of mass that is off makes no moment about yaw, unequal rotors do. The mean yaw moment is "
            f"{found.shares.yaw} of that of half of the rotors; so -o saves {which}.",
        ]
    return lines


def _untold(found: Rotation) -> list[str]:
    """Sentences on what these flights do not tell, and why."""
    lines = []
    if found.thrust.found is None:
        lines.append(
            "Not identified: the thrust map, and so the gain per weight. Fly quick climbs, and log the accelerometer."
        )
    if not found.drag:
        lines.append(
            "Not identified without velocity: drag and the moment by airspeed. These sensors never tell the mass."
        )
    for axis, fit in found.axes.items():
        if not found.told(axis):
            changed = found.unknown.get(axis, 0.0) >= MOST_UNKNOWN
            why = "its prediction errors are correlated" if not fit.white else "the commands hardly turned it"
            why = "its commands are logged too slowly" if changed else why
            lines.append(f"Not identified about {axis}: {why}.")
    return lines
