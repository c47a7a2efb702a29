"""The vehicle: chosen from those that ship, entered as a few numbers, or edited as the text of its file."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml
from nicegui import ui

from quadctl.vehicle import Vehicle
from quadctl.vehicle_draft.draft import Answers
from quadctl.vehicle_draft.frames import FRAMES, frame_places
from quadctl.web.elements.html import heading, tag
from quadctl.web.elements.theme import Theme
from quadctl.web.figures.rotors import rotors_svg
from quadctl.web.panels.panel import Controls, Panel

TYPICAL = Answers("my_vehicle", 1.5, 0.254, "quad-x", 0.225, 0.5)
"""Numbers that a form of a new vehicle begins with: those of a quadrotor with propellers of ten inches."""


@dataclass(frozen=True)
class VehicleChoice(Panel):
    """The vehicle in use with its rotors drawn, others to choose from, and forms for its numbers or another's."""

    vehicle: Vehicle | None
    vehicles: tuple[Path, ...]
    template: str
    theme: Theme

    def draw(self, do: Controls) -> None:
        vehicle = self.vehicle
        with tag("section", "card vehicle"):
            heading("Vehicle" if vehicle is None else f"Vehicle: {vehicle.name}")
            if vehicle is None:
                tag("p", "muted", "Choose the vehicle that flew, or enter its numbers.")
            if self.vehicles:
                with tag("div", "line wrap"):
                    for path in self.vehicles:
                        _draw_choice(do, path)
            if vehicle is not None:
                with ui.expansion("Its numbers").props("dense"):
                    _draw_numbers(do, vehicle, self.theme)
            with ui.expansion("A new vehicle").props("dense"):
                _draw_new(do, self.theme)
            with ui.expansion("As a file (YAML)").props("dense"):
                text = self.template if vehicle is None else _as_text(_content(vehicle))
                box = ui.textarea("Vehicle file", value=text).props("outlined").classes("yaml")
                use = ui.button("Use this file", on_click=lambda: do.use_vehicle(box.value))
                do.when_idle(use.props("no-caps outline"))


def _draw_choice(do: Controls, path: Path) -> None:
    button = ui.button(path.stem, icon="flight", on_click=lambda: do.act(do.bench.begin_with(path)))
    do.when_idle(button.props("no-caps outline"))


def _draw_numbers(do: Controls, vehicle: Vehicle, theme: Theme) -> None:
    """Draw a form of the numbers of a vehicle; all others, and its rotors, stay as they are."""
    line = vehicle.throttle
    with tag("div", "form"):
        with tag("div", "form-fields"):
            mass = _number("Mass with battery / kg", vehicle.mass_kg)
            propeller = _number("Propeller diameter / m", 2.0 * vehicle.rotor.radius_m)
            coefficient = _number("Thrust of a rotor / N per rpm²", vehicle.rotor.thrust_n_per_rpm2)
            slope = _number("Throttle per newton of thrust", line.per_newton)
            offset = _number("Throttle without thrust", line.offset)
            most = _number("Most thrust of a rotor / N", line.max_thrust_per_rotor_n)
        ui.html(rotors_svg(vehicle.rotors, vehicle.rotor.radius_m, theme), sanitize=False).classes("rotors")

    def changed() -> str:
        content = _content(vehicle)
        content["mass_kg"] = mass.value
        content["rotor"] |= {"radius_m": 0.5 * (propeller.value or 0.0), "thrust_n_per_rpm2": coefficient.value}
        content["throttle"] = {"per_newton": slope.value, "offset": offset.value, "max_thrust_per_rotor_n": most.value}
        return _as_text(content)

    use = ui.button("Use these numbers", on_click=lambda: do.use_vehicle(changed()))
    do.when_idle(use.props("no-caps unelevated"))


def _draw_new(do: Controls, theme: Theme) -> None:
    """Draw a form of a vehicle on a regular frame; what is not asked is assumed, and its file says so."""
    assert TYPICAL.arm_m is not None and TYPICAL.propeller_m is not None and TYPICAL.frame is not None
    with tag("div", "form"):
        with tag("div", "form-fields"):
            name = ui.input("Name", value=TYPICAL.name).props("outlined dense")
            mass = _number("Mass with battery / kg", TYPICAL.mass_kg)
            propeller = _number("Propeller diameter / m", TYPICAL.propeller_m)
            frame = ui.select(list(FRAMES), label="Frame", value=TYPICAL.frame).props("outlined dense")
            arm = _number("Centre to a rotor's axis / m", TYPICAL.arm_m)
            hover = _number("Throttle in hover, 0 to 1", TYPICAL.hover_throttle)
            speed = _number("Rotor speed in hover / rpm, where known", None)
        drawing = ui.html("", sanitize=False).classes("rotors")

    def draw() -> None:
        if arm.value and propeller.value:
            drawing.set_content(rotors_svg(frame_places(frame.value, arm.value), 0.5 * propeller.value, theme))

    for field in (propeller, frame, arm):
        field.on_value_change(draw)
    draw()

    def answers() -> Answers:
        return Answers(
            name.value, mass.value, propeller.value, frame.value, arm.value, hover.value, speed.value or None
        )

    use = ui.button("Use this vehicle", on_click=lambda: do.use_new_vehicle(answers()))
    do.when_idle(use.props("no-caps unelevated"))


def _number(label: str, value: float | None) -> ui.number:
    return ui.number(label, value=value).props("outlined dense step=any")


def _content(vehicle: Vehicle) -> dict[str, Any]:
    return vehicle.model_dump(mode="json", exclude_none=True)


def _as_text(content: dict[str, Any]) -> str:
    return yaml.safe_dump(content, sort_keys=False, default_flow_style=None)
