"""Evidence for one effect: the residual without and with it, and the effect, over one of its variables."""

import numpy as np

from quadctl.lab.comparison.wording import label_of
from quadctl.lab.effect_curves import Binned, EffectCurve
from quadctl.lab.selection.wording import unit_of
from quadctl.web.elements.figure import Figure, axis, faded, figure
from quadctl.web.elements.theme import Theme

CLOUD = 1500
"""Most samples that are drawn."""


def evidence_figure(curve: EffectCurve, theme: Theme, height_px: int = 340) -> Figure:
    """Draw one curve of an effect: samples and binned means of the residual, and the effect as a line."""
    unit = unit_of(curve.group)
    some = slice(None, None, max(1, len(curve.x) // CLOUD))
    cloud = {
        "type": "scatter", "mode": "markers", "name": "samples without it", "x": curve.x[some],
        "y": curve.before[some], "marker": {"color": faded(theme.muted, 0.3), "size": 3}, "hoverinfo": "skip",
    }  # fmt: skip
    line = {
        "type": "scatter", "mode": "lines", "name": "the effect", "x": curve.fitted.x, "y": curve.fitted.mean,
        "line": {"color": theme.after, "width": 2.5}, "hovertemplate": f"%{{x:.3g}}: %{{y:.3g}} {unit}",
    }  # fmt: skip
    low, high = np.quantile(curve.x, [0.002, 0.998])
    reach = 1.15 * max(float(np.quantile(np.abs(curve.before), 0.98)), float(np.max(np.abs(curve.binned_before.mean))))
    return figure(
        [
            cloud,
            line,
            _means(curve.binned_before, "residual without it, mean and 95% interval", theme.before, "circle", unit),
            _means(curve.binned_after, "residual with it, mean and 95% interval", theme.after, "square", unit),
        ],
        theme,
        height_px,
        xaxis=axis(label_of(curve.variable), theme, range=[float(low), float(high)]),
        yaxis=axis(curve.residual_label, theme, range=[-reach, reach]),
    )


def _means(means: Binned, name: str, colour: str, symbol: str, unit: str) -> dict[str, object]:
    bars = {"type": "data", "array": 1.96 * means.error, "color": colour, "thickness": 1.2}
    return {
        "type": "scatter", "mode": "markers", "name": name, "x": means.x, "y": means.mean, "error_y": bars,
        "marker": {"color": colour, "size": 7, "symbol": symbol}, "hovertemplate": f"%{{x:.3g}}: %{{y:.3g}} {unit}",
    }  # fmt: skip
