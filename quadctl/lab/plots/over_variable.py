"""Residual over one variable."""

from matplotlib.figure import Figure

from quadctl.lab.comparison.comparison import Comparison
from quadctl.lab.comparison.failures import Profile
from quadctl.lab.comparison.wording import label_of
from quadctl.lab.flights.prediction import AXES
from quadctl.lab.plots.style import BEFORE, BLACK, GREY, cloud, inner_range, limits, panel, points, styled


@styled
def residual_over_variable(comparison: Comparison, profile: Profile) -> Figure:
    """Binned means of the residual with 95% error bars over a faint cloud of all samples."""
    figure, ax = panel()
    x = comparison.dataset.variable(profile.variable)
    values = comparison.residual[:, AXES.index(profile.axis)]
    if x is not None:
        cloud(ax, x, values, GREY)
        limits(ax, values)
        ax.set_xlim(*inner_range(x))
        points(ax, profile.centre, profile.mean, profile.error, BEFORE)
    ax.axhline(0.0, color=BLACK, linewidth=0.8)
    ax.set_xlabel(label_of(profile.variable))
    ax.set_ylabel(f"residual {profile.axis} / m/s²")
    return figure
