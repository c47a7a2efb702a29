"""Small picture of a candidate: dots are the mean residual of the model, the line is the prediction of the effect."""

from html import escape

import numpy as np

from quadctl.lab.effect_curves import Sketch
from quadctl.lab.flights.flight import VARIABLE_NAMES
from quadctl.web.elements.theme import Theme

WIDTH, HEIGHT, MARGIN = 150, 64, 6


def sketch_svg(sketch: Sketch, theme: Theme) -> str:
    """Draw a sketch as an SVG element."""
    values = np.concatenate([sketch.residual.mean, sketch.effect.mean, [0.0]])
    low, high = float(values.min()), float(values.max())
    left, right = float(sketch.effect.x.min()), float(sketch.effect.x.max())

    def at(x: float, y: float) -> tuple[float, float]:
        across = (x - left) / max(right - left, 1e-9)
        up = (y - low) / max(high - low, 1e-9)
        return MARGIN + across * (WIDTH - 2 * MARGIN), HEIGHT - MARGIN - up * (HEIGHT - 2 * MARGIN)

    zero = at(left, 0.0)[1]
    dots = "".join(
        '<circle cx="{:.1f}" cy="{:.1f}" r="2.2"/>'.format(*at(x, y))
        for x, y in zip(sketch.residual.x, sketch.residual.mean, strict=True)
    )
    line = " ".join("{:.1f},{:.1f}".format(*at(x, y)) for x, y in zip(sketch.effect.x, sketch.effect.mean, strict=True))
    what = escape(
        f"residual {sketch.component} over {VARIABLE_NAMES[sketch.variable]}, and the prediction of the effect"
    )
    return (
        f'<svg viewBox="0 0 {WIDTH} {HEIGHT}" width="{WIDTH}" height="{HEIGHT}" role="img" aria-label="{what}">'
        f"<title>{what}</title>"
        f'<line x1="0" x2="{WIDTH}" y1="{zero:.1f}" y2="{zero:.1f}" stroke="{theme.grid}"/>'
        f'<g fill="{theme.measured}" fill-opacity="0.65">{dots}</g>'
        f'<polyline points="{line}" fill="none" stroke="{theme.after}" stroke-width="2.2"/></svg>'
    )
