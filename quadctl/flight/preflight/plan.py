"""The plan of a flight: mission, settings and models, read from their files."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from quadctl.compensator import Compensator
from quadctl.errors import SettingsError
from quadctl.flight.pilot.pilot import Pilot
from quadctl.flight.pilot.settings import FlightSettings, choose_models, find_config, load_flight_settings
from quadctl.flight.preflight.findings import Finding
from quadctl.flight.record.recorder import Recorder
from quadctl.missions import Mission, load_mission
from quadctl.model import Model
from quadctl.vehicle import Vehicle, load_vehicle


class FlightPlan(NamedTuple):
    """Mission, settings and models of one flight."""

    mission: Mission
    settings: FlightSettings
    body: Model
    compensator: Model
    warnings: Sequence[Finding] = ()
    """Warnings of the check of this plan."""

    @property
    def rotor_heights_m(self) -> tuple[float, float]:
        """Lowest and highest height of the rotor plane that the mission's limits allow."""
        up = self.body.vehicle.rotor_height_m
        return max(self.mission.limits.min_z_m + up, 0.01), self.mission.limits.max_z_m + up

    def speaking_as(self, system_id: int | None) -> "FlightPlan":
        """The same plan with another MAVLink system id of quadctl; None: that of the configuration."""
        if system_id is None:
            return self
        link = self.settings.link.model_copy(update={"system_id": system_id})
        return self._replace(settings=self.settings.model_copy(update={"link": link}))

    def pilot(self, autopilot_takes_off: bool = False, autopilot_stays_up: bool = False) -> Pilot:
        compensator = Compensator(self.compensator, self.settings.compensator_limits, self.mission.place)
        return Pilot(self.mission, self.body, self.settings, compensator, autopilot_takes_off, autopilot_stays_up)

    def recorder(self, log_dir: Path, autopilot: str, real_time: Sequence[str] = (), heights: bool = False) -> Recorder:
        """Recorder of this flight; `real_time` names the means that keep the ticks of a real flight punctual, with
        `heights` the sensors of the height are written, too."""
        vehicle = self.body.vehicle
        meta: dict[str, Any] = {
            "mission": self.mission.name,
            "offset_up_m": self.mission.offset_up_m,
            "time_scale": self.mission.time_scale,
            "parameters": dict(self.mission.parameters),
            "autopilot": autopilot,
            "compensator": self.compensator.name,
            "model": [{"effect": e.name, "parameters": e.values()} for e in self.compensator.effects],
            "vehicle": vehicle.model_dump(mode="json", exclude_none=True),
            "controller": self.settings.controller.model_dump(mode="json"),
            "guards": self.settings.guards.model_dump(mode="json"),
            "real_time": list(real_time),
        }
        if self.mission.place is not None:
            meta |= self.mission.place.model_dump(mode="json")
        lateral = self.settings.controller.actuation == "full"
        return Recorder(log_dir, self.mission.name, vehicle.n_rotors, meta, lateral, heights)


def read_flight(
    mission: Path,
    config: Path | None,
    model: str | None,
    offset_up_m: float | None,
    overrides: Sequence[str] = (),
    vehicle: Path | None = None,
) -> FlightPlan:
    """Read mission (with `overrides` of its parameters), configuration and model; `vehicle` goes before the
    configuration's.

    Raises
    ------
    SettingsError
        One sentence that names the file, the field, the value and what was expected.
    """
    loaded = load_mission(mission, offset_up_m, overrides)
    config_path = find_config(config, mission)
    settings = load_flight_settings(config_path)
    if vehicle is not None:
        settings = settings.model_copy(update={"vehicle": str(vehicle.absolute())})
    models = choose_models(settings, config_path, model)
    if vehicle is not None:
        _check_same_body(load_vehicle(vehicle), vehicle, models.body.vehicle)
    return FlightPlan(loaded, settings, models.body, models.compensator)


def _check_same_body(named: Vehicle, file: Path, flown: Vehicle) -> None:
    """Refuse a vehicle file that is not of the vehicle that flies, which is that of the model file; a model also holds
    the attitude's response, which `quadctl fit` finds.

    Raises
    ------
    SettingsError
        They differ.
    """
    one, other = (body.model_copy(update={"attitude_response": None}) for body in (named, flown))
    if one != other:
        raise SettingsError(
            f"{file}: holds '{named.name}', but the model that flies holds '{flown.name}' with other numbers, expected "
            "the vehicle of the model, or no vehicle file"
        )
