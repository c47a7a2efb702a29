"""Settings of a flight besides its mission (config/flight.yaml): vehicle, compensator, controller, link, guards."""

from pathlib import Path
from typing import Literal, NamedTuple

from pydantic import Field

from quadctl.compensator import CompensatorLimits
from quadctl.control import ControllerSettings
from quadctl.effects import find_effect
from quadctl.errors import SettingsError
from quadctl.flight.pilot.guards import GuardLimits
from quadctl.installed import locate
from quadctl.model import Model, load_model
from quadctl.settings import Settings, load
from quadctl.vehicle import load_vehicle

NO_COMPENSATION = "none"

HeightDatum = Literal["frame", "takeoff"]


class LinkSettings(Settings):
    """Link to the autopilot."""

    url: str = "udpin://0.0.0.0:14540"
    timeout_s: float = Field(default=10.0, gt=0.0, le=120.0)
    system_id: int = Field(default=1, ge=1, le=255)
    """MAVLink system id of quadctl, whose heartbeats ArduPilot's ground-station failsafe watches."""


class FlightSettings(Settings):
    """The keys of config/flight.yaml; paths are relative to that file."""

    vehicle: str
    compensator: str = NO_COMPENSATION
    """`none`, the name of an effect with its textbook parameters, or a model file."""
    height_datum: HeightDatum = "frame"
    """Height of the ground: z = 0 of the autopilot's frame (motion capture), or the place of take-off."""
    rest_height_m: float = Field(default=0.05, ge=0.0, lt=5.0)
    """Height of the logged body point when the vehicle stands on the ground; used with `takeoff`."""
    controller: ControllerSettings = ControllerSettings()
    compensator_limits: CompensatorLimits = CompensatorLimits()
    link: LinkSettings = LinkSettings()
    guards: GuardLimits = GuardLimits()


class FlightModels(NamedTuple):
    """Models of a flight: the vehicle that control assumes, and the model that the compensator inverts."""

    body: Model
    compensator: Model


DEFAULT_CONFIG = Path("config/flight.yaml")


def find_config(given: Path | None, mission: Path) -> Path:
    """The configuration file: the one given, else config/flight.yaml here, else beside the mission's folder, else the
    one installed with quadctl."""
    if given is not None:
        return given
    for candidate in (DEFAULT_CONFIG, mission.parent.parent / DEFAULT_CONFIG):
        if candidate.is_file():
            return candidate
    return locate(DEFAULT_CONFIG)


def load_flight_settings(path: Path) -> FlightSettings:
    return load(path, FlightSettings)


def choose_models(settings: FlightSettings, config: Path, word: str | None) -> FlightModels:
    """The vehicle and the compensator of a flight.

    `word` (of `--model`) takes the place of the configuration's `compensator`; a model file's vehicle takes the place
    of the configuration's vehicle too.
    """
    choice = word if word is not None else settings.compensator
    vehicle_path = config.parent / settings.vehicle
    if choice == NO_COMPENSATION:
        body = Model(load_vehicle(vehicle_path), name=NO_COMPENSATION, vehicle_path=vehicle_path)
        return FlightModels(body, body)
    if choice.endswith((".yaml", ".yml")):
        model = load_model(Path(choice) if word is not None else config.parent / choice)
        return FlightModels(Model(model.vehicle, name=model.name, vehicle_path=model.vehicle_path), model)
    source = "--model" if word is not None else f"{config}: compensator"
    if "/" in choice:
        raise SettingsError(f"{source} is '{choice}', expected an effect or a model file, whose name ends in .yaml")
    effect = find_effect(choice, source)()
    body = Model(load_vehicle(vehicle_path), name=choice, vehicle_path=vehicle_path)
    return FlightModels(body, body.plus(effect))
