"""A flight model: a vehicle and a stack of effects, which only this module applies; its file (docs/file-formats.md)."""

import os
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import yaml
from pydantic import Field

from quadctl.effects import Conditions, Effect, catalog_with, find_effect
from quadctl.effects.base import NO_TORQUE
from quadctl.errors import SettingsError
from quadctl.files import write_text
from quadctl.frames import GRAVITY_M_S2, Quaternion, rotate, rotate_inverse
from quadctl.installed import is_installed
from quadctl.numeric import Number, Vector, plus
from quadctl.observer import Observer
from quadctl.settings import Settings, read_yaml, validate
from quadctl.surfaces import Place
from quadctl.vehicle import Vehicle


class Provenance(Settings):
    """Origin of an effect's fitted parameters: written by `add`, read by people and the compensator."""

    logs: tuple[str, ...] = ()
    rmse_before: float | None = None
    """Held-out acceleration error without the effect, the rest of the model refitted, m/s^2; None where not known."""
    rmse_after: float | None = None
    """The same with the effect."""
    held_out: bool = False
    ci95: dict[str, tuple[float, float]] = Field(default_factory=dict)
    height_m: tuple[float, float] | None = None
    """Range of the rotor plane's height in the data of the fit."""
    command_delay_s: tuple[float, float, float] | None = None
    """Time from a command of the rotors to their thrust, beyond the lag of the vehicle file, in the flights of the fit:
    value and 95 % interval. A late position of the logs is in it. None where rotor speeds were measured."""
    software: str | None = None


@dataclass(frozen=True)
class StackedEffect:
    """One effect of a model, with its provenance where it was fitted."""

    effect: Effect
    fitted: Provenance | None = None
    held: bool = False
    """True: a fit leaves its parameters as they are."""

    @property
    def ci95(self) -> dict[str, tuple[float, float]]:
        """95 % intervals of the fitted parameters, by their names."""
        return self.fitted.ci95 if self.fitted else {}

    def to_dict(self) -> dict[str, Any]:
        """Name, parameters and intervals, as JSON can hold them."""
        ci95 = {name: list(ci) for name, ci in self.ci95.items()}
        return {"effect": self.effect.name, "parameters": self.effect.values(), "ci95": ci95}


class Loads(NamedTuple):
    """Force and moment on a vehicle, of its rotors and of all effects; weight excluded."""

    force_n: Vector
    """Force on the body, FRD, N."""
    torque_n_m: Vector
    """Moment about the centre of mass, FRD, N m."""


@dataclass(frozen=True)
class Model:
    """A vehicle and its effects, in the order in which they were added; no effects: the rigid body."""

    vehicle: Vehicle
    stack: tuple[StackedEffect, ...] = ()
    name: str = "rigid body"
    vehicle_path: Path | None = field(default=None, compare=False)
    """The file that the vehicle was read from, so that a saved model can refer to it."""
    effect_files: tuple[Path, ...] = field(default=(), compare=False)
    """The user's Python files whose effects the model may hold."""
    observer: Observer | None = None
    """Noise by which slow forces and moments are observed in flights of this vehicle."""

    @cached_property
    def effects(self) -> tuple[Effect, ...]:
        return tuple(item.effect for item in self.stack)

    def plus(self, effect: Effect, fitted: Provenance | None = None) -> "Model":
        return replace(self, stack=(*self.stack, StackedEffect(effect, fitted)))

    def with_effects(self, effects: Sequence[Effect]) -> "Model":
        """The same stack with other parameters; `effects` in the stack's order."""
        stack = tuple(replace(old, effect=new) for new, old in zip(effects, self.stack, strict=True))
        return replace(self, stack=stack)

    def without(self, effect: Effect) -> "Model":
        """Copy without one of its effects; the others keep their parameters."""
        return replace(self, stack=tuple(item for item in self.stack if item.effect is not effect))

    def in_air(self, c: Conditions) -> Conditions:
        """The same conditions with the velocity relative to the air, as the effects want them."""
        for effect in self.effects_on_air:
            north, east, down = effect.wind_ned_m_s(c)
            air = rotate_inverse(c.attitude, (north, east, down))
            u, v, w = c.velocity_body_m_s
            c = replace(c, velocity_body_m_s=(u - air[0], v - air[1], w - air[2]))
        return c

    def thrust_by_effect(self, nominal_n: Sequence[Number], c: Conditions) -> Iterator[Sequence[Number]]:
        """Thrust of each rotor, N, after the first effect of the stack, after the second, and so on to the last.

        `nominal_n` is k rpm^2 of each rotor; `c` is as `in_air` gives it. Each effect acts on the thrust that the
        effects before it leave.
        """
        thrust, vehicle = nominal_n, self.vehicle
        for effect in self._thrusting:
            if effect is not None:
                thrust = effect.rotor_thrust(thrust, c, vehicle)
            yield thrust

    def rotor_thrust(self, nominal_n: Sequence[Number], c: Conditions) -> Sequence[Number]:
        """Thrust of each rotor, N, all effects included, from the nominal k rpm^2 of each; `c` as `in_air` gives it."""
        for effect in self.effects_on_thrust:
            nominal_n = effect.rotor_thrust(nominal_n, c, self.vehicle)
        return nominal_n

    def side_force(self, total_thrust_n: Number, c: Conditions, shares: Sequence[float] | None = None) -> Vector:
        """Force of the effects that is not the rotors' thrust, FRD, N; `c` as `in_air` gives it.

        `shares` has a factor for each effect of the stack, by which its force is multiplied; None: all forces in full.
        """
        x: Number = 0.0
        y: Number = 0.0
        z: Number = 0.0
        for i, effect in self._pushing:
            fx, fy, fz = effect.force(total_thrust_n, c, self.vehicle)
            if shares is not None:
                fx, fy, fz = shares[i] * fx, shares[i] * fy, shares[i] * fz
            x, y, z = x + fx, y + fy, z + fz
        return x, y, z

    def side_torque(self, thrust_n: Sequence[Number], c: Conditions) -> Vector:
        """Moment of the effects that is not the rotors', FRD, N m; `c` as `in_air` gives it."""
        if not self.effects_on_turning:
            return NO_TORQUE
        return _sum([effect.torque(thrust_n, c, self.vehicle) for effect in self.effects_on_turning])

    def loads(self, nominal_n: Sequence[Number], c: Conditions) -> Loads:
        """Force and moment together, from the nominal thrust of each rotor, N; the velocity in `c` is over ground."""
        c = self.in_air(c)
        thrust = self.rotor_thrust(nominal_n, c)
        return Loads(self._force(thrust, c), self._torque(thrust, c))

    def body_force(self, nominal_n: Sequence[Number], c: Conditions) -> Vector:
        """Force on the body without weight, FRD, N, from the nominal thrust of each rotor."""
        c = self.in_air(c)
        return self._force(self.rotor_thrust(nominal_n, c), c)

    def body_torque(self, nominal_n: Sequence[Number], c: Conditions) -> Vector:
        """Moment on the body, FRD, N m, from the nominal thrust of each rotor."""
        c = self.in_air(c)
        return self._torque(self.rotor_thrust(nominal_n, c), c)

    def _force(self, thrust: Sequence[Number], c: Conditions) -> Vector:
        of_rotors = self.vehicle.rotor_force(thrust)
        return plus(of_rotors, self.side_force(sum(thrust), c)) if self.effects_on_body else of_rotors

    def _torque(self, thrust: Sequence[Number], c: Conditions) -> Vector:
        of_rotors = self.vehicle.rotor_torque(thrust)
        return plus(of_rotors, self.side_torque(thrust, c)) if self.effects_on_turning else of_rotors

    def acceleration_ned(self, nominal_n: Sequence[Number], c: Conditions) -> Vector:
        """Kinematic acceleration, NED, m/s^2: what an ideal observer on the ground would measure."""
        fx, fy, fz = rotate(c.attitude, self.body_force(nominal_n, c))
        m = self.vehicle.mass_kg
        return fx / m, fy / m, fz / m + GRAVITY_M_S2

    def sensed_ned_m_s2(self, c: Conditions) -> Vector:
        """Reading of the accelerometer beyond the true acceleration, NED."""
        return rotate(c.attitude, _sum(e.sensed_m_s2(c) for e in self.effects if e.acts_by("sensed_m_s2")))

    def late(self) -> "Model":
        """The model with only those effects that delay the thrust."""
        return replace(self, stack=tuple(item for item in self.stack if item.effect.adds_lag))

    def prompt(self) -> "Model":
        """The model with the other effects, those that act without delay."""
        return replace(self, stack=tuple(item for item in self.stack if not item.effect.adds_lag))

    def turning(self) -> "Model":
        """The model with only those effects that the balance of moments can show."""
        return replace(self, stack=tuple(item for item in self.stack if item.effect.affects_moment))

    @cached_property
    def effects_on_thrust(self) -> tuple[Effect, ...]:
        return tuple(effect for effect in self._thrusting if effect is not None)

    @cached_property
    def effects_on_body(self) -> tuple[Effect, ...]:
        return tuple(effect for _, effect in self._pushing)

    @cached_property
    def resists_motion(self) -> bool:
        """True where it has a force that varies with the velocity: a drag."""
        return any({"speed_forward", "speed_right"} & set(effect.depends_on) for effect in self.effects_on_body)

    @cached_property
    def _thrusting(self) -> tuple[Effect | None, ...]:
        """The stack, with None for each effect that leaves the rotors' thrust as it is."""
        return tuple(e if e.acts_by("rotor_thrust") else None for e in self.effects)

    @cached_property
    def _pushing(self) -> tuple[tuple[int, Effect], ...]:
        """The effects with a force, each with its place in the stack."""
        return tuple((i, e) for i, e in enumerate(self.acting) if e.acts_by("force"))

    @cached_property
    def effects_on_turning(self) -> tuple[Effect, ...]:
        return tuple(e for e in self.acting if e.acts_by("torque"))

    @cached_property
    def needs_thrust_rate(self) -> bool:
        """True where an effect depends on how the thrust of each rotor changes."""
        return any(e.needs_thrust_rate for e in self.effects)

    @cached_property
    def effects_on_air(self) -> tuple[Effect, ...]:
        return tuple(e for e in self.effects if e.acts_by("wind_ned_m_s"))

    @cached_property
    def command_delay_s(self) -> tuple[float, float, float] | None:
        """Delay of the thrust after its command, s, with its interval, as the flights of the fit have shown it last,
        else that of the vehicle file; None where there is none above 0."""
        told = [item.fitted.command_delay_s for item in self.stack if item.fitted is not None]
        of_file = self.vehicle.rotor.delay_s
        known = [(of_file, of_file, of_file), *(delay for delay in told if delay is not None)]
        return known[-1] if known[-1][0] > 0.0 else None

    @cached_property
    def acting(self) -> tuple[Effect, ...]:
        """The effects of the stack, each standing back for the others where it must."""
        present = {effect.family() for effect in self.effects}
        return tuple(e.standing_back() if present & set(e.stands_back_for) else e for e in self.effects)


def _sum(vectors: Iterable[Vector]) -> Vector:
    x: Number = 0.0
    y: Number = 0.0
    z: Number = 0.0
    for dx, dy, dz in vectors:
        x, y, z = x + dx, y + dy, z + dz
    return x, y, z


def conditions(
    vehicle: Vehicle,
    z_up_m: Number,
    velocity_body_m_s: Vector,
    attitude: Quaternion,
    time_s: Number = 0.0,
    battery_v: Number = float("nan"),
    position_ne_m: tuple[Number, Number] = (0.0, 0.0),
    place: Place | None = None,
    rates_rad_s: Vector = (0.0, 0.0, 0.0),
    thrust_rate_n_s: Sequence[Number] = (),
) -> Conditions:
    """Conditions of a vehicle whose logged position is `z_up_m` above the ground; `place` maps its surfaces."""
    height_m = z_up_m + vehicle.rotor_height_m
    surfaces = place.shares(position_ne_m) if place is not None else ()
    return Conditions(
        height_m,
        velocity_body_m_s,
        attitude,
        time_s,
        battery_v,
        position_ne_m,
        surfaces,
        rates_rad_s=rates_rad_s,
        thrust_rate_n_s=thrust_rate_n_s,
    )


class EffectEntry(Settings):
    """One effect as a file names it."""

    effect: str
    parameters: dict[str, Any] = Field(default_factory=dict)
    fitted: Provenance | None = None


class _ModelFile(Settings):
    vehicle: str | Vehicle
    effect_files: list[str] = Field(default_factory=list)
    """Python files with a user's own effects, relative to this file."""
    effects: list[EffectEntry] = Field(default_factory=list)
    observer: Observer | None = None


def load_model(path: Path | str) -> Model:
    """Read a model file, or a bare vehicle file as the rigid-body model.

    Raises
    ------
    SettingsError
        One sentence that names file, field, value and what was expected.
    """
    path = Path(path)
    return model_from_dict(read_yaml(path), path)


def model_from_dict(data: dict[str, Any], path: Path) -> Model:
    """The model that a file `path` with this content would hold; raises SettingsError as `load_model` does."""
    if "vehicle" not in data and "effects" not in data:
        return Model(validate(data, Vehicle, str(path)), name=path.stem, vehicle_path=path)
    entry = validate(data, _ModelFile, str(path))
    if isinstance(entry.vehicle, str):
        vehicle_path = path.parent / entry.vehicle
        vehicle = validate(read_yaml(vehicle_path), Vehicle, str(vehicle_path))
    else:
        vehicle_path, vehicle = None, entry.vehicle
    files = tuple(path.parent / file for file in entry.effect_files)
    known = catalog_with(files)
    stack = tuple(
        StackedEffect(find_effect(e.effect, source, known).from_values(e.parameters, source), e.fitted)
        for e, source in ((e, f"{path}: effects[{i}]") for i, e in enumerate(entry.effects, start=1))
    )
    for i, item in enumerate(stack, start=1):
        if problem := item.effect.mismatch(vehicle):
            raise SettingsError(f"{path}: effects[{i}]: {problem}")
    families = [item.effect.family() for item in stack]
    for i, family in enumerate(families):
        if family in families[:i]:
            raise SettingsError(f"{path}: effects[{i + 1}] is a second {family}, expected each family once")
    return Model(vehicle, stack, name=path.stem, vehicle_path=vehicle_path, effect_files=files, observer=entry.observer)


def save_model(model: Model, path: Path | str) -> None:
    """Write `model` so that `load_model` gives it back; the vehicle is referred to where it came from a file."""
    path = Path(path)
    text = yaml.safe_dump(model_to_dict(model, path.parent), sort_keys=False)
    write_text(path, text, SettingsError)


def model_to_dict(model: Model, folder: Path | None) -> dict[str, Any]:
    """Content of the file of `model`.

    The vehicle is a path relative to `folder`; it is written out without one, and where its file is installed with
    quadctl.
    """
    vehicle: Any = model.vehicle.model_dump(mode="json", exclude_none=True)
    # An installed vehicle file moves and changes with the installation: a model that is kept holds the vehicle itself.
    if model.vehicle_path is not None and folder is not None and not is_installed(model.vehicle_path):
        vehicle = _relative(model.vehicle_path, folder)
    effects = []
    for item in model.stack:
        entry: dict[str, Any] = {"effect": item.effect.name, "parameters": item.effect.values()}
        if item.fitted is not None:
            entry["fitted"] = item.fitted.model_dump(mode="json", exclude_none=True)
        effects.append(entry)
    files = [_relative(file, folder) if folder is not None else str(file.resolve()) for file in model.effect_files]
    own = {"effect_files": files} if files else {}
    observer = {"observer": model.observer.model_dump()} if model.observer is not None else {}
    return {"vehicle": vehicle, **own, "effects": effects, **observer}


def _relative(path: Path, folder: Path) -> str:
    return os.path.relpath(path.resolve(), folder.resolve())
