"""The figure: sensitivity of the loops, and the error along a figure 8."""

from collections.abc import Mapping

from matplotlib.figure import Figure

from quadctl.lab.plots.style import BLUE, GREY, VERMILION, WIDE_PX, styled

from .comparison import ROBUST_MOCKS, Results
from .flights import BEFORE, FOUND, OWN
from .margins import RAD_S, Transfer, sensitivity

STYLES = {BEFORE: (VERMILION, "the law before"), OWN: (GREY, "the autopilot's own"), FOUND: (BLUE, "quadctl")}
SHOWN_RAD_S = 0.1, 30.0


@styled
def figure(results: Results, loops: Mapping[tuple[str, str], Transfer]) -> Figure:
    """Horizontal sensitivity above, error over time below, one column for each mock."""
    drawn = Figure(figsize=(WIDE_PX / 72, 7.0))
    upper, lower = drawn.subplots(2, len(ROBUST_MOCKS), sharey="row")
    shown = (SHOWN_RAD_S[0] <= RAD_S) & (SHOWN_RAD_S[1] >= RAD_S)
    for where, above, below in zip(ROBUST_MOCKS, upper, lower, strict=True):
        for law, (colour, label) in STYLES.items():
            size = sensitivity(loops[where.title, law])
            above.loglog(RAD_S[shown], size[shown], color=colour, label=label)
            time_s, error_m = results.errors[where.title, law]
            below.semilogy(time_s, 100.0 * error_m, color=colour, label=label)
        above.axhline(1.0, color="#666666", linewidth=0.7)
        above.set_title(f"{where.title}: sensitivity |S(jω)|, horizontal")
        above.set_xlabel("ω, rad/s")
        above.set_ylim(1e-3, 3.0)
        below.set_title("figure 8: distance from the reference")
        below.set_xlabel("time, s")
        below.set_ylim(0.1, 200.0)
    upper[0].set_ylabel("|S|")
    lower[0].set_ylabel("cm")
    upper[0].legend(loc="lower right")
    return drawn
