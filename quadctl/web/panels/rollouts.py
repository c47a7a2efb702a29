"""Rollouts of the whole state: how far a forecast from commands is off, of flights that no fit saw."""

from dataclasses import dataclass

from quadctl.lab.flights.dataset import Dataset
from quadctl.lab.rotation.rollout_errors import FORECAST_ERRORS, FORECAST_HOLDS, FORECAST_OF, QUANTITIES, Unseen
from quadctl.web.elements.html import heading, plot, table, tag
from quadctl.web.elements.theme import Theme
from quadctl.web.figures.rollouts import rollout_figure
from quadctl.web.panels.panel import Controls, Panel, work_button


@dataclass(frozen=True)
class Rollouts(Panel):
    """Errors of forecasts of position, velocity, rotation and rates, or the button that computes them."""

    seen: Dataset | None
    rollouts: Unseen | None
    theme: Theme

    def draw(self, do: Controls) -> None:
        if self.seen is None:
            return
        with tag("section", "card").props('id="rollouts"'):
            heading("Whole state from commands", f"{FORECAST_ERRORS.capitalize()}. {FORECAST_HOLDS}")
            if self.rollouts is None:
                tag(
                    "p",
                    "muted",
                    "Needs body rates at 20 Hz or more, and speeds or outputs of the rotors at 40 Hz or more.",
                )
                work_button(do, "Forecast the whole state", do.bench.forecast, "unelevated", "timeline")
                return
            with tag("div", "panes"):
                for quantity, name in enumerate(QUANTITIES):
                    drawn = rollout_figure(self.rollouts, quantity, self.theme)
                    plot(drawn, f"rollouts_{name}", f"Error of {FORECAST_OF[quantity]} over the horizon")
            with tag("div", "scroll"):
                columns = {"after": "", "model": "", **dict.fromkeys(FORECAST_OF, "number")}
                table("small", columns, self.rollouts.rows())
