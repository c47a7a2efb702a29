"""The model as a compensator: its thrust ratio, its check before a flight, its file, and a flight in simulation."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from nicegui import ui

from quadctl.lab.comparison.wording import change_in_words
from quadctl.lab.effect_curves import far_ratio, hover_ratio
from quadctl.lab.flights.dataset import Dataset
from quadctl.lab.tracking.step_response import StepResponses
from quadctl.model import Model
from quadctl.web.elements.html import empty, heading, plot, tag
from quadctl.web.elements.theme import Theme
from quadctl.web.figures.ratio import ratio_over_height, ratio_over_speed
from quadctl.web.figures.steps import step_figure
from quadctl.web.panels.glossary import explained
from quadctl.web.panels.panel import Controls, Panel, Tab, work_button
from quadctl.web.panels.words import Said
from quadctl.web.work.simulated import FAR, WITH, WITHOUT
from quadctl.words import Fact, fact

NAMED_EFFECTS = 3
"""Most effects that the name of a file with a model says."""
UNITY = 5e-4
"""Largest difference of a factor from 1 that three decimals hide."""


@dataclass(frozen=True)
class Ratio(Panel):
    """The thrust ratio that the compensator divides by."""

    model: Model | None
    seen: Dataset | None
    thrust_reservation: str
    theme: Theme

    def draw(self, do: Controls) -> None:
        if self.model is None or self.seen is None:
            empty("flight", "No model to fly yet", "Open a flight log and add what is missing.")
            return
        with tag("section", "card"):
            heading("Thrust ratio", "The compensator divides the thrust command by this ratio.")
            with tag("p"):
                explained(str(far(self.model)))
            if self.thrust_reservation:
                tag("p", "note", self.thrust_reservation)
            with tag("div", "panes"):
                drawn = ratio_over_height(self.model, self.seen, self.theme)
                plot(drawn, "thrust_ratio_over_height", "Thrust ratio over height")
                over_speed = ratio_over_speed(self.model, self.seen, self.theme)
                if over_speed is not None:
                    plot(over_speed, "thrust_ratio_over_speed", "Thrust ratio over forward speed")


def far(model: Model) -> Fact:
    """The factor of the thrust far from the ground, to which the curve over height is relative."""
    factor = far_ratio(model)
    return fact(Said.FACTOR_ONE if abs(factor - 1.0) < UNITY else Said.FACTOR, factor=factor)


@dataclass(frozen=True)
class Check(Panel):
    """The result of the check before a flight, which begins when this is drawn, and what may be another effect."""

    model: Model | None
    seen: Dataset | None
    confounded: dict[str, tuple[str, ...]]
    checked: tuple[str, ...] | None
    refused: str

    def draw(self, do: Controls) -> None:
        if self.model is None or self.seen is None:
            return
        if self.checked is None and not self.refused:
            ui.timer(0.0, do.bench.check, once=True)
        with tag("div", "line check"):
            if self.refused:
                ui.icon("block").classes("bad")
                tag("p", "grow", f"The check refuses it: {self.refused}.")
            elif self.checked is None:
                tag("p", "muted grow", "Checking\u2026")
            elif not self.model.stack:
                ui.icon("info").classes("muted")
                tag("p", "muted grow", "The model holds no effect: nothing is corrected.")
            elif self.checked:
                ui.icon("warning").classes("warn")
                tag("p", "grow", f"The check warns: {'; '.join(self.checked)}.")
            else:
                ui.icon("check_circle").classes("good")
                text = "The check accepts it: the ratio is finite, positive, and nowhere rises with height."
                tag("p", "grow", text)
        if self.refused or self.checked is None:
            return
        for doubt in doubts(self.model, self.confounded):
            with tag("div", "line check"):
                ui.icon("help").classes("warn")
                tag("p", "grow", str(doubt))


def doubts(model: Model, confounded: Mapping[str, Sequence[str]]) -> list[Fact]:
    """The effects of a model that the flights do not tell from those of other families: what corrects for the wrong one
    fits only flights like these."""
    families = dict.fromkeys(effect.family() for effect in model.effects)
    return [
        fact(Said.WHICH_OF_THEM, family=family, families=(family, *others))
        for family in families
        if (others := [other for other in confounded.get(family, ()) if other not in families])
    ]


@dataclass(frozen=True)
class Export(Panel):
    """The model as a file, and the command that flies it."""

    model: Model | None
    seen: Dataset | None

    def draw(self, do: Controls) -> None:
        if self.model is None or self.seen is None:
            return
        with tag("section", "card"):
            heading("Export")
            with tag("div", "line wrap"):
                ui.button("Download model", icon="download", on_click=do.export_model).props("no-caps unelevated")
                tag("span", "muted grow", "Commands that use the file; run them in the folder where it is saved:")
            for purpose, command in COMMANDS:
                with tag("div", "next-command"):
                    tag("span", "muted", purpose)
                    tag("code", "", command.format(name=name_of_file(self.model)))


@dataclass(frozen=True)
class SimulatedFlight(Panel):
    """Step responses flown in simulation, with the compensator and without it."""

    model: Model | None
    seen: Dataset | None
    hidden: Path | None
    steps: StepResponses | None
    refused: str
    theme: Theme

    def draw(self, do: Controls) -> None:
        if self.model is None or self.seen is None:
            return
        with tag("section", "card"):
            world = "that obeys this model" if self.hidden is None else f"with the effects in {self.hidden.name}"
            heading(
                "Fly it in simulation",
                f"Simulates a step down, close to the ground, {WITHOUT} and {WITH}, and one {FAR}, in a world {world}.",
            )
            if self.hidden is None:
                tag("p", "muted", "It shows what the compensator does to the flight, not whether the model is right.")
            allowed = not self.refused
            work_button(do, "Fly it in simulation", do.bench.fly, "unelevated", "flight_takeoff", allowed)
            if self.steps is None:
                return
            with tag("div", "panes"):
                plot(step_figure(self.steps, self.theme, close_up=False), "step_response", "Step response")
                close_up = step_figure(self.steps, self.theme, close_up=True)
                plot(close_up, "step_response_error", "Step response, close up")
            found = answer(self.model, self.steps)
            if found is not None:
                with tag("p", "verdict"):
                    explained(str(found))
            _draw_metrics(self.steps, corrects_near_the_ground(self.model))


def corrects_near_the_ground(model: Model) -> bool:
    """Tell whether the thrust of the model's rotors near the ground differs from that far from it."""
    height_m = model.vehicle.rotor.radius_m * np.array([1.0, 2.0])
    change = hover_ratio(model, height_m, np.zeros(2)) / far_ratio(model) - 1.0
    return bool(np.abs(change).max() > UNITY)


def answer(model: Model, steps: StepResponses) -> Fact | None:
    """Benefit of the compensator, and the measure of it; None where the flights have no measure."""
    if not corrects_near_the_ground(model):
        return fact(Said.NO_GROUND)
    without, compensated = (steps.flown[name] for name in (WITHOUT, WITH))
    if not without.m_b_absolute or compensated.m_b_absolute is None:
        return None
    return fact(
        Said.COMPENSATED,
        better=compensated.m_b_absolute < without.m_b_absolute,
        drop=1.0 - compensated.m_b_absolute / without.m_b_absolute,
        without_m_s=without.m_b_absolute,
        compensated_m_s=compensated.m_b_absolute,
        rmse_drop=1.0 - compensated.rmse_m / without.rmse_m if without.rmse_m else 0.0,
    )


def _draw_metrics(steps: StepResponses, comparable: bool) -> None:
    """Draw the measures of both flights, and how they change where the flights are `comparable`."""
    flown = steps.flown
    rows = (
        ("M_A, absolute", "m s", "m_a_absolute"),
        ("M_B, absolute", "m s", "m_b_absolute"),
        ("M_B, signed", "m s", "m_b_signed"),
        ("RMSE", "m", "rmse_m"),
    )
    with tag("table", "metrics"):
        with tag("tr"):
            for head in ("", WITHOUT, WITH, "change"):
                tag("th", "number" if head else "", head)
        for name, unit, field in rows:
            with tag("tr"):
                with tag("td"):
                    explained(f"{name} / {unit}")
                without, compensated = (getattr(flown[name], field) or 0.0 for name in (WITHOUT, WITH))
                for value in (without, compensated):
                    tag("td", "number", f"{value:.4f}".replace("-", "\u2212"))
                changes = comparable and without * compensated > 0.0  # a share of a number across zero says nothing
                tag("td", "number", change_in_words(1.0 - compensated / without) if changes else "\u2013")


def name_of_file(model: Model) -> str:
    """Name of the file that an export gives to the browser: `raptor_ground_effect.yaml`, without blanks."""
    families = [effect.family() for effect in model.effects]
    if len(families) > NAMED_EFFECTS:
        families = [f"{len(families)}_effects"]
    return "_".join(re.sub(r"[^\w.-]+", "_", word) for word in (model.vehicle.name, *families)) + ".yaml"


COMMANDS = (
    ("fly with it as the compensator", "quadctl fly MISSION --model {name}"),
    ("simulate the flight in a world with the same effects", "quadctl simulate MISSION --model {name} --hidden {name}"),
    ("give it to the autopilot", "quadctl export {name} --to px4 --link URL --apply"),
    ("compare it with a further flight", "quadctl compare {name} LOG"),
)
"""Commands that use the model in the file `name`, each with its purpose."""


TAB = Tab("compensator", "Compensator", "flight_takeoff", (Ratio, Check, Export, SimulatedFlight))
