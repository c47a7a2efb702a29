"""The sensors of the height: where they fail, which errors they have, and what the logs lack to tell."""

from dataclasses import dataclass

from quadctl.lab.sensors.answers import SensorAnswers
from quadctl.lab.sensors.comparison import flown
from quadctl.lab.sensors.diagnosis import NoAnswer
from quadctl.lab.sensors.words import answer, no_reference
from quadctl.web.elements.html import heading, plot, tag
from quadctl.web.elements.theme import Theme
from quadctl.web.figures.height_sensor import sensor_figure
from quadctl.web.panels.panel import Controls, Panel


@dataclass(frozen=True)
class HeightSensors(Panel):
    """The barometer, and the range finder, beside their references; nothing where no log has one."""

    sensors: SensorAnswers | None
    theme: Theme

    def draw(self, do: Controls) -> None:
        del do
        for found in () if self.sensors is None else self.sensors.answers:
            with tag("section", "card").props(f'data-sensor="{found.sensor}"'):
                heading(f"The {found.sensor}", "Its reading beside a reference that does not lean on it.")
                if isinstance(found, NoAnswer):
                    for fact in no_reference(found):
                        tag("p", "verdict", f"{fact}.")
                    continue
                for i, fact in enumerate(answer(found)):
                    tag("p", "muted" if i else "verdict", str(fact).strip())
                with tag("div", "panes"):
                    for variable in flown(found.flights):
                        drawn = sensor_figure(found, variable, self.theme)
                        name = f"{found.sensor}_over_{variable.replace(' ', '_')}"
                        plot(drawn, name, f"{found.sensor} over {variable}")
        for problem in () if self.sensors is None else self.sensors.problems:
            with tag("section", "card"):
                tag("p", "problem", problem)
