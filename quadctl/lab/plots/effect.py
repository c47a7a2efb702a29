"""A fitted effect over one of its variables."""

import numpy as np
from matplotlib.figure import Figure

from quadctl.lab.comparison.wording import label_of
from quadctl.lab.effect_curves import EffectCurve
from quadctl.lab.plots.style import (
    AFTER,
    BEFORE,
    BLACK,
    GREY,
    cloud,
    inner_range,
    legend_above,
    limits,
    panel,
    points,
    styled,
)


@styled
def effect_over_variable(curve: EffectCurve) -> Figure:
    """Residual without and with an effect over one of its variables, and the contribution of the effect."""
    figure, ax = panel(4.4)
    cloud(ax, curve.x, curve.before, GREY)
    limits(ax, np.concatenate([curve.before, curve.after]))
    ax.set_xlim(*inner_range(curve.x))
    ax.axhline(0.0, color=BLACK, linewidth=0.8)
    low, high = curve.fitted.mean - 1.96 * curve.fitted.error, curve.fitted.mean + 1.96 * curve.fitted.error
    ax.fill_between(curve.fitted.x, low, high, color=AFTER, alpha=0.22, linewidth=0.0)
    ax.plot(curve.fitted.x, curve.fitted.mean, color=AFTER, linewidth=2.0, label="fitted effect, 95% band")
    points(ax, curve.binned_before.x, curve.binned_before.mean, curve.binned_before.error, BEFORE, "without it")
    points(ax, curve.binned_after.x, curve.binned_after.mean, curve.binned_after.error, AFTER, "with it", "s")
    ax.set_xlabel(label_of(curve.variable))
    ax.set_ylabel(curve.residual_label)
    legend_above(ax, columns=3)
    return figure
