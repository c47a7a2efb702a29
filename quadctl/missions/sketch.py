"""A mission drawn with characters: height, speed and tilt over time, the path from above, a table of the phases."""

import math
from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import NamedTuple

from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from quadctl.missions.mission import Mission
from quadctl.missions.profile import PhaseProfile, Sample, profiles, sampled

WIDTH = 78
"""Width of a drawing over time, characters."""
MAP_ROWS = 12
NEAR = 1.5
"""Largest limit that is drawn, as a multiple of the curve's peak: beyond it the curve would be flat."""
NOTHING = 1e-3
"""Peak below which a curve is not drawn."""
_AXIS = 7
"""Characters left of a drawing, for its numbers."""
_DOTS = ((0x01, 0x08), (0x02, 0x10), (0x04, 0x20), (0x40, 0x80))
"""Bits of a Braille character's dots, four rows of two."""

Point = tuple[float, float]


class Line(NamedTuple):
    """A limit: drawn where it lies, and named."""

    value: float
    name: str


class Canvas:
    """Characters with two by four dots each. x runs right and y up, both from 0 to 1."""

    def __init__(self, columns: int, rows: int) -> None:
        self.columns, self.rows = columns, rows
        self._bits = [[0] * columns for _ in range(rows)]

    def dot(self, x: float, y: float) -> None:
        column = min(max(round(x * (2 * self.columns - 1)), 0), 2 * self.columns - 1)
        row = min(max(round((1.0 - y) * (4 * self.rows - 1)), 0), 4 * self.rows - 1)
        self._bits[row // 4][column // 2] |= _DOTS[row % 4][column % 2]

    def line(self, a: Point, b: Point) -> None:
        steps = 1 + math.ceil(max(2 * self.columns * abs(b[0] - a[0]), 4 * self.rows * abs(b[1] - a[1])))
        for i in range(steps + 1):
            self.dot(a[0] + (b[0] - a[0]) * i / steps, a[1] + (b[1] - a[1]) * i / steps)

    def lines(self) -> list[str]:
        return ["".join(chr(0x2800 + bits) if bits else " " for bits in row) for row in self._bits]


def sketch(mission: Mission, max_speed_m_s: float, max_tilt_deg: float) -> RenderableType:
    """The whole picture; the limits of speed and tilt are those of the flight, the others the mission's."""
    samples = sampled(mission)
    flat = [sample for of_phase in samples for sample in of_phase]
    limits = mission.limits
    ground, ceiling = Line(limits.min_z_m, "min_z_m"), Line(limits.max_z_m, "max_z_m")
    parts: list[RenderableType] = [
        _heading(mission),
        *_over_time("height, m", [(s.time_s, s.reference.position_m[2]) for s in flat], 8, [ground, ceiling]),
        *_over_time("speed, m/s", [(s.time_s, s.speed_m_s) for s in flat], 3, [Line(max_speed_m_s, "guard")]),
        *_over_time(
            "tilt, deg", [(s.time_s, math.degrees(s.tilt_rad)) for s in flat], 3, [Line(max_tilt_deg, "limit")]
        ),
        Text(f"{'':{_AXIS}} 0{f'{mission.duration_s:.0f} s':>{WIDTH - 2}}", style="dim"),
        *_from_above(mission, flat),
        phase_table(profiles(mission, samples)),
    ]
    return Group(*parts)


def phase_table(phases: Sequence[PhaseProfile]) -> Table:
    """A row for each phase; phases that are repeated share theirs."""
    table = Table(box=None, pad_edge=False, header_style="bold", collapse_padding=True)
    for column in ("phase", "trajectory"):
        table.add_column(column, overflow="fold")
    for column in ("at s", "for s", "from", "to", "heights m", "m/s", "m/s²", "tilt", "jump m"):
        table.add_column(column, justify="right", no_wrap=True)
    for profile, times in _repeated(phases):
        p = profile.phase
        table.add_row(
            p.name + (f" (x{times})" if times > 1 else ""),
            p.trajectory.kind,
            f"{p.start_s:.1f}",
            f"{p.end_s - p.start_s:.1f}",
            _place(p.start_m),
            _place(profile.end_m),
            f"{profile.lowest_m:.2f}..{profile.highest_m:.2f}",
            _shown(profile.top_speed_m_s),
            _shown(profile.top_acceleration_m_s2),
            f"{math.degrees(profile.top_tilt_rad):.0f}°",
            _shown(profile.longest_jump_m),
        )
    return table


def _heading(mission: Mission) -> Text:
    text = Text(f"{mission.name}: {mission.description}\n", style="bold")
    values = ", ".join(f"{name}={value}" for name, value in mission.parameters.items())
    turns = ", ".join(f"{math.degrees(turn.yaw_rad):.0f}° at {turn.start_s:.0f} s" for turn in mission.turns)
    if values:
        text.append(f"parameters (--set): {values}\n", style="not bold")
    if turns:
        text.append(f"heading: {turns}\n", style="not bold")
    return text


def _over_time(title: str, points: Sequence[Point], rows: int, limits: Sequence[Line]) -> Iterator[Text]:
    """A curve with those limits that lie near it; the others are only named."""
    named = ", ".join(f"{limit.name} {limit.value:g}" for limit in limits)
    end, peak = points[-1][0], max(value for _, value in points)
    if peak < NOTHING:
        yield Text(f"{'':{_AXIS}} {title}  (none; {named})", style="bold")
        return
    near = [limit.value for limit in limits if limit.value <= NEAR * peak]
    top = max([1.05 * peak, *near])
    canvas = Canvas(WIDTH, rows)
    for limit in near:
        for i in range(0, 2 * WIDTH, 4):
            canvas.dot(i / (2 * WIDTH), limit / top)
    for a, b in pairwise(points):
        canvas.line((a[0] / end, a[1] / top), (b[0] / end, b[1] / top))
    yield Text(f"{'':{_AXIS}} {title}  (top {peak:.2f}; {named})", style="bold")
    for i, line in enumerate(canvas.lines()):
        number = f"{top:.2f}" if i == 0 else "0" if i == rows - 1 else ""
        yield Text(f"{number:>{_AXIS}} ", style="dim").append(line, style="cyan")


def _from_above(mission: Mission, samples: Sequence[Sample]) -> Iterator[Text]:
    """The path over the ground, north up, within the fence; nothing of a mission that goes up and down alone."""
    places = [sample.reference.position_m for sample in samples]
    if max(math.hypot(x, y) for x, y, _ in places) < 0.05:
        return
    fence = mission.limits.max_distance_m
    canvas = Canvas(2 * MAP_ROWS, MAP_ROWS)  # a character is twice as high as wide

    def on_map(north: float, east: float) -> Point:
        return 0.5 + 0.5 * east / fence, 0.5 + 0.5 * north / fence

    for degree in range(0, 360, 6):
        canvas.dot(*on_map(fence * math.cos(math.radians(degree)), fence * math.sin(math.radians(degree))))
    for a, b in pairwise(places):
        canvas.line(on_map(a[0], a[1]), on_map(b[0], b[1]))
    yield Text(f"\n{'':{_AXIS}} from above, north up; fence {fence:g} m from take-off", style="bold")
    for line in canvas.lines():
        yield Text(f"{'':{_AXIS}} ").append(line, style="cyan")


def _repeated(phases: Sequence[PhaseProfile]) -> Iterator[tuple[PhaseProfile, int]]:
    """Each phase at its first time, and how often it is flown alike (from the same place, by the same trajectory)."""
    alike: dict[object, list[PhaseProfile]] = {}
    for profile in phases:
        phase = profile.phase
        alike.setdefault((phase.name, phase.trajectory.model_dump_json(), phase.start_m), []).append(profile)
    for same in alike.values():
        yield same[0], len(same)


def _place(place: tuple[float, float, float]) -> str:
    return " ".join(f"{0.0 + round(value, 2):g}" for value in place)


def _shown(value: float) -> str:
    return f"{value:.2f}" if value > 0.0 else "-"
