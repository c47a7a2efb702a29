"""Figure of a vehicle: its rotors from above with spin and tilt, and the lateral force that they hold over thrust."""

import math
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from quadctl.errors import SettingsError
from quadctl.files import writing
from quadctl.lab.plots.style import BLUE, GREY, LIGHT, STYLE, VERMILION
from quadctl.vehicle import Vehicle

SPIN_COLOUR = {"cw": BLUE, "ccw": VERMILION}
ARROW_PER_SINE = 2.5
"""Length of the arrow of a tilted rotor, in radii, per sine of its tilt."""


def vehicle_figure(vehicle: Vehicle) -> Figure:
    """Draw `vehicle`; forward is up."""
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(10.4, 5.2), layout="constrained")
        above, reach = figure.subplots(1, 2)
        _rotors(above, vehicle)
        _reach(reach, vehicle)
        figure.suptitle(vehicle.name, x=0.01, ha="left", fontsize=12.5, fontweight="bold")
        return figure


def save_vehicle_plot(vehicle: Vehicle, path: Path) -> None:
    """Write the figure as PNG; raises SettingsError when `path` does not end in .png or cannot be written."""
    if path.suffix.lower() != ".png":
        raise SettingsError(f"{path}: ends in '{path.suffix}', expected .png")
    with writing(path, SettingsError):
        vehicle_figure(vehicle).savefig(path, dpi=110)


def _rotors(ax: Axes, vehicle: Vehicle) -> None:
    radius_m = vehicle.rotor.radius_m
    for number, rotor in enumerate(vehicle.rotors, start=1):
        (forward, right, _), (leans_forward, leans_right, _) = rotor.position_m, rotor.axis
        colour = SPIN_COLOUR[rotor.spin]
        ax.plot([0.0, right], [0.0, forward], color=LIGHT, zorder=0)
        ax.add_patch(Circle((right, forward), radius_m, edgecolor=colour, facecolor=(*mpl.colors.to_rgb(colour), 0.08)))
        outside = 1.0 + 0.55 * radius_m / max(math.hypot(forward, right), 1e-3)
        place = (outside * right, outside * forward)
        ax.text(*place, f"{number} {rotor.spin}", ha="center", va="center", color=colour)
        if math.hypot(leans_forward, leans_right) > 1e-3:
            length_m = ARROW_PER_SINE * radius_m
            tip = (right + length_m * leans_right, forward + length_m * leans_forward)
            ax.annotate("", tip, (right, forward), arrowprops={"arrowstyle": "-|>", "color": colour, "linewidth": 1.8})
    ax.set(
        aspect="equal",
        xlabel="right / m",
        ylabel="forward / m",
        title="rotors from above; arrows: side force of the tilt",
    )
    ax.autoscale_view()


def _reach(ax: Axes, vehicle: Vehicle) -> None:
    up_n = np.linspace(0.0, vehicle.max_thrust_n * vehicle.axial_share, 200)
    ax.plot(up_n, [vehicle.allocation.lateral_reach_n(float(n)) for n in up_n], color=BLUE)
    ax.axvline(vehicle.weight_n, color=GREY, linestyle="--")
    ax.text(vehicle.weight_n, 1.0, " hover", color=GREY, va="top", transform=ax.get_xaxis_transform())
    ax.set(xlabel="force along the thrust axis / N", ylabel="lateral force / N", title="lateral force without a moment")
    ax.set_ylim(bottom=0.0)
