"""Rotors of a vehicle from above, the nose at the top: to see at a glance whether each is where it belongs."""

from collections.abc import Sequence
from typing import NamedTuple, Protocol

from quadctl.web.elements.theme import Theme

SIDE, MARGIN = 200.0, 10.0
ARROWS = {"cw": "\u21bb", "ccw": "\u21ba"}


class Place(Protocol):
    """Place of one rotor, FRD, m, and its sense of rotation seen from above."""

    @property
    def position_m(self) -> tuple[float, float, float]: ...
    @property
    def spin(self) -> str: ...


class _OnPaper(NamedTuple):
    x: float
    y: float


def rotors_svg(places: Sequence[Place], radius_m: float, theme: Theme) -> str:
    """Draw rotors of one radius to scale, with their numbers and senses of rotation, as an SVG element."""
    reach_m = max(abs(p) for place in places for p in place.position_m[:2]) + radius_m
    scale = (0.5 * SIDE - MARGIN) / reach_m
    centre = 0.5 * SIDE
    drawn = []
    for number, place in enumerate(places, start=1):
        at = _OnPaper(centre + scale * place.position_m[1], centre - scale * place.position_m[0])
        drawn.append(
            f'<line x1="{centre:.1f}" y1="{centre:.1f}" x2="{at.x:.1f}" y2="{at.y:.1f}" stroke="{theme.grid}" '
            'stroke-width="3"/>'
            f'<circle cx="{at.x:.1f}" cy="{at.y:.1f}" r="{scale * radius_m:.1f}" fill="{theme.after}" '
            f'fill-opacity="0.15" stroke="{theme.after}"/>'
            f'<text x="{at.x:.1f}" y="{at.y + 5.0:.1f}" text-anchor="middle" font-size="14" '
            f'fill="{theme.measured}">{number} {ARROWS[place.spin]}</text>'
        )
    nose = f"M {centre} {centre - 16:.0f} l 6 12 h -12 z"
    what = f"{len(places)} rotors seen from above, the nose at the top"
    return (
        f'<svg viewBox="0 0 {SIDE:.0f} {SIDE:.0f}" width="{SIDE:.0f}" height="{SIDE:.0f}" role="img" '
        f'aria-label="{what}"><title>{what}</title>{"".join(drawn)}<path d="{nose}" fill="{theme.before}"/></svg>'
    )
