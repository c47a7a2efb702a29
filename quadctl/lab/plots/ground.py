"""A fitted ground effect over height."""

import numpy as np
from matplotlib.figure import Figure

from quadctl.effects import CATALOG
from quadctl.lab.effect_curves import ratio_at, ratio_curve
from quadctl.lab.plots.style import AFTER, BLACK, TEXTBOOK, WIDE_PX, points, styled
from quadctl.lab.selection.addition import Addition


@styled
def thrust_ratio(addition: Addition, index: int, width_px: float = WIDE_PX) -> Figure:
    """Fitted thrust ratio over height with its 95% band, the measured ratio in bins, and textbook curves for
    comparison."""
    curve = ratio_curve(addition, index)
    radius = addition.model.vehicle.rotor.radius_m
    x = curve.height_over_radius
    figure = Figure(figsize=(width_px / 72, 5.4))
    ax = figure.subplots()
    ax.axvspan(max(curve.data_range[0], x[0]), min(curve.data_range[1], x[-1]), color="#EEF2F7")
    for variant, (colour, dashes) in TEXTBOOK.items():
        textbook = CATALOG[f"ground_effect.{variant}"]()
        if textbook == addition.model.effects[index]:
            continue
        ratio = ratio_at(textbook, x * radius, addition.model)
        ax.plot(x, ratio, dashes, color=colour, linewidth=1.3, alpha=0.75, label=f"{variant}, textbook")
    ax.fill_between(x, curve.low, curve.high, color=AFTER, alpha=0.22, linewidth=0.0, label="95% band")
    ax.plot(x, curve.ratio, color=AFTER, linewidth=2.2, label=f"{addition.model.effects[index].name}, fitted")
    points(ax, curve.measured.x, curve.measured.mean, curve.measured.error, BLACK, "measured, mean and 95% interval")
    ax.axhline(1.0, color=BLACK, linewidth=0.8)
    top = max(float(curve.high.max()), float(np.max(curve.measured.mean + 2.0 * curve.measured.error)))
    ax.set_ylim(min(0.98, float(np.min(curve.measured.mean)) - 0.01), 1.0 + 1.35 * (top - 1.0) + 0.01)
    ax.set_xlim(x[0], x[-1])
    ax.set_xlabel("rotor height above the ground / rotor radii")
    ax.set_ylabel("thrust ratio K (1 = far from the ground)")
    ax.legend(loc="upper right", fontsize=10.5)
    return figure
