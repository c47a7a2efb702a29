"""The vehicle: chosen from those that ship, entered as a few numbers, or edited as the text of its file."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import yaml
from nicegui import ui

from quadctl.frames import GRAVITY_M_S2
from quadctl.lab.comparison.reservations import vehicle_in_words
from quadctl.lab.comparison.wording import listed
from quadctl.logs.formats import suffixes_with_parameters
from quadctl.vehicle import Vehicle
from quadctl.vehicle_draft.draft import THRUST_COEFFICIENT, Answers, answers_of, told
from quadctl.vehicle_draft.frames import (
    APART,
    FRAMES,
    are_relative,
    arm_m_of,
    assumed_arm_m,
    frame_places,
    overlap,
    scaled_to,
)
from quadctl.vehicle_draft.questions import ITS_NUMBERS, NEW_VEHICLE, Question, wrong
from quadctl.web.elements.html import heading, tag
from quadctl.web.elements.theme import Theme
from quadctl.web.elements.upload import StreamedUpload, choose_button
from quadctl.web.figures.rotors import rotors_svg
from quadctl.web.panels.panel import Controls, Panel, work_button
from quadctl.web.session.files import vehicle_in

TEMPLATE = """\
name: my_vehicle
mass_kg: 1.5
rotor:
  radius_m: 0.12
  thrust_n_per_rpm2: 1.14e-7      # thrust of one rotor = this * rpm^2
rotors:                           # forward, right, down from the centre of mass; motor1, motor2, ...
  - {position_m: [ 0.12,  0.12, 0.0], spin: ccw}
  - {position_m: [-0.12, -0.12, 0.0], spin: ccw}
  - {position_m: [ 0.12, -0.12, 0.0], spin: cw}
  - {position_m: [-0.12,  0.12, 0.0], spin: cw}
throttle: {per_newton: 0.024, offset: 0.16, max_thrust_per_rotor_n: 9.0}
"""
"""Text of a vehicle file to begin with."""
AS_LOGGED = "as in the log"
"""Choice of the frame whose rotors are those of a log's parameters."""
ASSUMED = (
    "Assumed, since it is not asked: a motor lag of 0.04 s; the inertia, worked out from mass and arm; without a "
    f"diagonal, rotors {APART:g} propeller diameters apart; a straight line "
    "from throttle to thrust, in hover the tangent of a square law, unless the "
    "parameters of a log say otherwise. Without a rotor speed in hover, thrust per "
    f"rpm² is assumed, too (thrust coefficient {THRUST_COEFFICIENT:g}; most propellers have 0.007 to 0.015): a thrust "
    "scale that is found in a flight then corrects this guess. The file lists under `assumed` what nobody has measured."
)
"""Numbers of a new vehicle that nobody was asked for."""
TYPICAL = Answers("my_vehicle", 1.5, 0.254, "quad-x", None, 0.5)
"""Numbers that a form of a new vehicle begins with: those of a quadrotor with propellers of ten inches."""


@dataclass(frozen=True)
class WhichVehicle(Panel):
    """The question whether the vehicle is the one that flew: where it was assumed, until it is answered, and where its
    thrust would carry another weight."""

    unconfirmed: Vehicle | None
    silent: str
    weight_doubts: tuple[str, ...]

    def draw(self, do: Controls) -> None:
        vehicle = self.unconfirmed
        if vehicle is None and not self.weight_doubts:
            return
        with tag("div", "which-vehicle").props('role="group" aria-label="The vehicle that flew"'):
            for doubt in self.weight_doubts:
                tag("p", "", doubt)
            if vehicle is not None:
                tag("p", "", f"Evaluated as {vehicle_in_words(vehicle)}: is that the vehicle that flew? {self.silent}")
            with tag("div", "line wrap"):
                if vehicle is not None:
                    ui.button("Yes", on_click=do.bench.confirm_vehicle).props("no-caps outline dense")
                ui.button("Choose another", on_click=do.show_vehicles).props("no-caps flat dense")


@dataclass(frozen=True)
class VehicleChoice(Panel):
    """The vehicle in use with its rotors drawn, others to choose from, and forms for its numbers or another's."""

    vehicle: Vehicle | None
    vehicles: tuple[Path, ...]
    own_vehicles: tuple[Path, ...]
    logs: tuple[Path, ...]
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
                        _draw_choice(do, path, "flight", vehicle)
            if self.own_vehicles:
                tag("p", "muted", f"Yours, kept in {self.own_vehicles[0].parent.resolve()}:")
                with tag("div", "line wrap").props('id="own-vehicles"'):
                    for path in self.own_vehicles:
                        _draw_choice(do, path, "person", vehicle)
            entered = self._entered()
            if entered is not None:
                with _form(f"What was entered for {entered.name}"):
                    tag("p", "muted", "Correct an answer here: all that was worked out from the answers follows it.")
                    _NewVehicle(do, [], entered, self.theme)
            if vehicle is not None:
                with ui.expansion("Its numbers").props("dense"):
                    if entered is not None:
                        tag("p", "muted", "Each number by itself: the others stay, also those worked out from it.")
                    _draw_numbers(do, vehicle, self.theme)
            with _form("A new vehicle"):
                logs = [log for log in self.logs if log.suffix.lower() in suffixes_with_parameters()]
                _NewVehicle(do, logs, TYPICAL, self.theme)
            with ui.expansion("As a file (YAML)").props("dense"):
                upload = StreamedUpload()
                do.intake.receive(upload, do.take_files)
                upload.props('accept=".yaml,.yml"').classes("hidden")
                choose_button(upload, "Choose a file", "file_open", "outline")
                tag("p", "muted", "Or write it here:")
                text = TEMPLATE if vehicle is None else _as_text(_content(vehicle))
                box = ui.textarea("Vehicle file", value=text).props("outlined").classes("yaml")
                work_button(do, "Use this file", lambda: do.intake.use_vehicle(box.value), "outline")

    def _entered(self) -> Answers | None:
        """Answers of the form from which the vehicle in use was made; None of one from a file, which assumes nothing,
        and of one whose rotors are on no regular frame."""
        vehicle = self.vehicle
        if vehicle is None or not vehicle.assumed or all(vehicle_in(path) != vehicle for path in self.own_vehicles):
            return None
        answers = answers_of(vehicle)
        return None if answers.frame is None else answers


def _form(title: str) -> ui.expansion:
    """A form that is folded; one that opens below the end of the window would seem to do nothing."""
    form = ui.expansion(title).props("dense")
    form.on("after-show", js_handler=f"() => getHtmlElement({form.id}).scrollIntoView()")
    return form


def _draw_choice(do: Controls, path: Path, icon: str, used: Vehicle | None) -> None:
    """Draw a button that begins with the vehicle of a file; that in use is marked, and can be confirmed."""
    vehicle = vehicle_in(path)
    here = vehicle is not None and vehicle == used
    label = path.stem if vehicle is None else f"{path.stem}, {vehicle.mass_kg:g} kg"
    choose = do.bench.confirm_vehicle if here else lambda: do.act(do.bench.begin_with(path))
    button = ui.button(label, icon="check" if here else icon, on_click=choose)
    button.props(f'no-caps aria-pressed="{"true" if here else "false"}"').props("unelevated" if here else "outline")
    do.when_idle(button)


def _draw_numbers(do: Controls, vehicle: Vehicle, theme: Theme) -> None:
    """Draw a form of the numbers of a vehicle; all others, and its rotors, stay as they are."""
    line = vehicle.throttle
    with tag("div", "form"):
        with tag("div", "form-fields"):
            now = {
                "mass_kg": vehicle.mass_kg,
                "propeller_m": 2.0 * vehicle.rotor.radius_m,
                "thrust_n_per_rpm2": vehicle.rotor.thrust_n_per_rpm2,
                "per_newton": line.per_newton,
                "offset": line.offset,
                "max_thrust_per_rotor_n": line.max_thrust_per_rotor_n,
            }
            numbers = {name: _number(question, now[name]) for name, question in ITS_NUMBERS.items()}
        ui.html(rotors_svg(vehicle.rotors, vehicle.rotor.radius_m, theme), sanitize=False).classes("rotors")
    hover = tag("p", "muted").props('role="status"')

    def say_hover() -> None:
        mass, slope, offset = (numbers[name].value for name in ("mass_kg", "per_newton", "offset"))
        known = None not in (mass, slope, offset)
        hover.clear()
        with hover:
            said = f"It then hovers at a throttle of {offset + slope * mass * GRAVITY_M_S2:.3g}." if known else ""
            ui.label(said).style("display:contents")

    for name in ("mass_kg", "per_newton", "offset"):
        numbers[name].on_value_change(say_hover)
    say_hover()

    async def use() -> None:
        if _say_what_is_wrong(ITS_NUMBERS, numbers):
            return
        value = {name: number.value for name, number in numbers.items()}
        content = _content(vehicle) | {"mass_kg": value["mass_kg"]}
        content["rotor"] |= {
            "radius_m": 0.5 * value["propeller_m"],
            "thrust_n_per_rpm2": value["thrust_n_per_rpm2"],
        }
        content["throttle"] = {name: value[name] for name in ("per_newton", "offset", "max_thrust_per_rotor_n")}
        entered = {
            "rotor.thrust_n_per_rpm2": value["thrust_n_per_rpm2"] != now["thrust_n_per_rpm2"],
            "throttle": any(value[name] != now[name] for name in ("per_newton", "offset")),
        }
        if "assumed" in content:
            content["assumed"] = [name for name in content["assumed"] if not entered.get(name, False)]
        await do.intake.use_vehicle(_as_text(content), from_a_form=True)

    work_button(do, "Use these numbers", use, "unelevated")


class _NewVehicle:
    """Form of a vehicle on a regular frame, or on that of a log's parameters; what is not asked is assumed, and its
    file says so."""

    def __init__(self, do: Controls, logs: Sequence[Path], first: Answers, theme: Theme) -> None:
        """Draw the form with the answers `first`; it can be filled in from the parameters of one of `logs`."""
        self._do, self._theme = do, theme
        self._parameters: Mapping[str, float] = {}
        for log in logs:
            fill = ui.button(
                f"Fill in from {log.name}",
                icon="input",
                on_click=partial(self._fill, log),
            )
            fill.props("no-caps outline dense")
        self._filled = tag("p", "muted").props('role="status"')
        with tag("div", "form"):
            with tag("div", "form-fields"):
                self._name = ui.input("Name", value=first.name).props("outlined dense stack-label")
                self._numbers: dict[str, ui.number] = {}
                self._ask("mass_kg", first.mass_kg)
                self._propeller = self._ask("propeller_m", first.propeller_m)
                self._frame = ui.select(list(FRAMES), label="Frame", value=first.frame).props(
                    "outlined dense stack-label"
                )
                self._diagonal = self._ask("diagonal_m", None if first.arm_m is None else 2.0 * first.arm_m)
                self._hover = self._ask("hover_throttle", first.hover_throttle)
                self._ask("hover_rpm", first.hover_rpm)
            with tag("div", "drawn"):
                self._drawing = ui.html("", sanitize=False).classes("rotors")
                self._overlap = tag("p", "").props('role="status"')
        for field in (self._propeller, self._frame, self._diagonal):
            field.on_value_change(self._draw_rotors)
        self._draw_rotors()
        tag("p", "muted", ASSUMED)
        work_button(do, "Use this vehicle", self._use, "unelevated")

    def _ask(self, name: str, value: float | None) -> ui.number:
        self._numbers[name] = _number(NEW_VEHICLE[name], value)
        return self._numbers[name]

    @property
    def _as_logged(self) -> bool:
        """The rotors are those of the parameters."""
        return bool(self._frame.value == AS_LOGGED)

    def _draw_rotors(self) -> None:
        if not self._propeller.value:
            return
        layout = told(self._parameters).places if self._as_logged else frame_places(self._frame.value, 1.0)
        if layout is None:
            return
        diagonal_m = self._diagonal.value
        arm_m = 0.5 * diagonal_m if diagonal_m else assumed_arm_m(layout, self._propeller.value)
        places = scaled_to(layout, arm_m)
        self._drawing.set_content(rotors_svg(places, 0.5 * self._propeller.value, self._theme))
        self._overlap.clear()
        with self._overlap:
            touching = overlap([place.position_m for place in places], self._propeller.value)
            ui.label("" if touching is None else str(touching)).style("display:contents")

    async def _fill(self, log: Path) -> None:
        """Fill in what the parameters of an autopilot in a log say; the intake says why where it holds none."""
        parameters = await self._do.intake.parameters_of(log)
        if not parameters:
            return
        self._parameters, known, check = parameters, told(parameters), ""
        if known.places is not None:
            self._frame.set_options([AS_LOGGED, *FRAMES], value=AS_LOGGED)
            relative = are_relative(known.places)
            self._diagonal.set_value(None if relative else round(2.0 * arm_m_of(known.places), 4))
            check = "" if relative else " PX4 needs no true distances of the rotors: check the diagonal."
        elif known.frame is not None:
            self._frame.set_value(known.frame)
            self._diagonal.set_value(None)
        if known.hover_throttle is not None:
            self._hover.set_value(round(known.hover_throttle, 4))
        rotors = "the rotors" if known.places is not None else "the frame"
        found = {
            rotors: known.places is not None or known.frame is not None,
            "the throttle in hover": known.hover_throttle is not None,
            "the mass": False,
            "the propellers": False,
        }
        names, entered = (
            listed([name for name, there in found.items() if there is is_told]) for is_told in (True, False)
        )
        self._filled.clear()
        with self._filled:
            ui.label(f"{log.name} says {names}; enter {entered}.{check}").style("display:contents")

    async def _use(self) -> None:
        self._name.error = None if (self._name.value or "").strip() else "expected a name"
        if _say_what_is_wrong(NEW_VEHICLE, self._numbers):
            return
        if self._name.error:
            _show(self._name)
            return
        value = {name: number.value for name, number in self._numbers.items()}
        diagonal_m = value.pop("diagonal_m")
        value["arm_m"] = None if diagonal_m is None else 0.5 * diagonal_m
        answers = Answers(self._name.value.strip(), frame=None if self._as_logged else self._frame.value)
        await self._do.intake.use_new_vehicle(answers._replace(**value), self._parameters)


def _number(question: Question, value: float | None) -> ui.number:
    number = ui.number(question.label, value=None if value is None else float(f"{value:.4g}")).props(
        "outlined dense stack-label step=any"
    )
    return number.props(f'hint="{question.hint}"') if question.hint else number


def _say_what_is_wrong(questions: Mapping[str, Question], numbers: Mapping[str, ui.number]) -> bool:
    """Mark every field whose number is not possible, with what is expected, and show the first of them; tell whether
    there is one."""
    expected = wrong(questions, {name: number.value for name, number in numbers.items()})
    for name, number in numbers.items():
        number.error = expected.get(name)
    if expected:
        _show(numbers[next(name for name in numbers if name in expected)])
    return bool(expected)


def _show(field: ui.input | ui.number) -> None:
    """Bring a field into sight, where the next key is typed; its own `focus` does not scroll."""
    field.run_method("focus")
    ui.run_javascript(f"getHtmlElement({field.id}).scrollIntoView({{block: 'center'}})")


def _content(vehicle: Vehicle) -> dict[str, Any]:
    return vehicle.model_dump(mode="json", exclude_none=True)


def _as_text(content: dict[str, Any]) -> str:
    return yaml.safe_dump(content, sort_keys=False, default_flow_style=None)
