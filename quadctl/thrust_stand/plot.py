"""The picture of a measurement: thrust over rotor speed, throttle over total thrust."""

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from quadctl.errors import LogError
from quadctl.files import writing
from quadctl.thrust_stand.result import StandResult

MEASURED, FITTED, BEFORE = "#1f77b4", "#d62728", "#999999"


def draw(result: StandResult, path: Path) -> None:
    """Write the picture to `path` (PNG, SVG or PDF by its suffix).

    Raises
    ------
    LogError
        It cannot be written.
    """
    figure = Figure(figsize=(10, 4.2), layout="constrained")
    axes = figure.subplots(1, 2)
    _draw_thrust(axes[0], result)
    _draw_throttle(axes[1], result)
    for panel in axes:
        panel.grid(alpha=0.3)
        panel.spines[["top", "right"]].set_visible(False)
        panel.legend(frameon=False)
    with writing(path, LogError):
        path.parent.mkdir(parents=True, exist_ok=True)
        figure.savefig(path, dpi=120)


def _draw_thrust(axes: Axes, result: StandResult) -> None:
    axes.set(title="one rotor", xlabel="rotor speed, rpm", ylabel="thrust, N")
    rpm = np.array([point.rpm for point in result.points])
    thrust = np.array([point.thrust_n for point in result.points])
    known = np.isfinite(rpm)
    axes.plot(rpm[known], thrust[known], "o", color=MEASURED, label="measured")
    if result.thrust is None:
        axes.text(0.5, 0.5, "no rotor speeds", transform=axes.transAxes, ha="center")
        return
    x = np.linspace(0.0, rpm[known].max() * 1.03, 200)
    axes.plot(x, result.vehicle.rotor.thrust_n_per_rpm2 * x**2, "--", color=BEFORE, label="vehicle file")
    axes.plot(x, result.thrust.k.value * x**2, color=FITTED, label=f"k rpm², k = {result.thrust.k.value:.3g}")
    better = result.thrust.better
    if better is not None and better.law == "power":
        hover_n = result.vehicle.weight_n / result.vehicle.n_rotors
        curve = hover_n * (better.k_hover * x**2 / hover_n) ** (0.5 * better.parameter.value)
        axes.plot(x, curve, ":", color="black", label=f"rpm^{better.parameter.value:.2f}")


def _draw_throttle(axes: Axes, result: StandResult) -> None:
    n, line, before = result.vehicle.n_rotors, result.throttle, result.vehicle.throttle
    axes.set(title=f"{n} rotors alike", xlabel="total thrust, N", ylabel="throttle")
    thrust = np.array([n * point.thrust_n for point in result.points])
    axes.plot(
        thrust, [point.throttle for point in result.points], "o", color=MEASURED, label="measured, times the rotors"
    )
    x = np.linspace(0.0, thrust.max() * 1.03, 2)
    axes.plot(x, before.offset + before.per_newton * x, "--", color=BEFORE, label="vehicle file")
    label = f"{line.offset.value:.3g} + {line.per_newton.value:.3g} T"
    axes.plot(x, line.offset.value + line.per_newton.value * x, color=FITTED, label=label)
    axes.axvline(result.vehicle.weight_n, color=BEFORE, linewidth=0.8)
    axes.annotate("weight", (result.vehicle.weight_n, axes.get_ylim()[0]), fontsize=8, color=BEFORE)
