"""The hidden truth of a simulated flight: effects and noise that only the simulator reads.

Besides the catalogue's effects, the truth may hold effects of other functional forms, so that an analysis is tested on
a world that does not share its code.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

from pydantic import Field, NonNegativeFloat

from quadctl.effects import Conditions, Effect, ThrustRatio, catalog_with, find_effect, parameter
from quadctl.effects.sensors import SENSOR_ERRORS
from quadctl.effects.wind import SteadyWind
from quadctl.errors import SettingsError
from quadctl.model import EffectEntry, Model, StackedEffect, model_from_dict
from quadctl.numeric import Number, maximum
from quadctl.settings import Settings, read_yaml, validate
from quadctl.sitl.vehicle.height_sensors import Barometer, HeightSensors, RangeFinder
from quadctl.surfaces import Place
from quadctl.vehicle import AxisResponse, Vehicle

Triple = tuple[NonNegativeFloat, NonNegativeFloat, NonNegativeFloat]


class Noise(Settings):
    """Standard deviations of the noise of the autopilot's estimate, white except for the drifts.

    A drift is slow, as the error of a filter is: its correlation falls to 1/e in its time.
    """

    position_m: NonNegativeFloat = 0.0005
    position_drift_m: NonNegativeFloat = 0.0
    """Standard deviation of a slow position error in each axis, such as satellite navigation has."""
    drift_time_s: float = Field(default=30.0, gt=0.0)
    """Correlation time of the drift."""
    velocity_m_s: NonNegativeFloat = 0.01
    velocity_drift_m_s: Triple = (0.0, 0.0, 0.0)
    """North, east, up."""
    velocity_drift_time_s: float = Field(default=3.0, gt=0.0)
    attitude_deg: NonNegativeFloat = 0.1
    attitude_drift_deg: Triple = (0.0, 0.0, 0.0)
    """Roll, pitch, yaw."""
    attitude_drift_time_s: float = Field(default=5.0, gt=0.0)
    rates_rad_s: NonNegativeFloat = 0.01
    rpm: NonNegativeFloat = 20.0
    battery_v: NonNegativeFloat = 0.01


class Telemetry(Settings):
    """Delay and rate of the estimate, as seen in public flight logs."""

    delay_s: float = Field(default=0.02, ge=0.0, le=0.5)
    """Age of position, velocity and attitude."""
    rotor_speeds: bool = True
    """True: rotor speeds are sent."""
    rpm_delay_s: float = Field(default=0.03, ge=0.0, le=0.5)
    rpm_rate_hz: float = Field(default=25.0, gt=0.0, le=100.0)


class AutopilotTruth(Settings):
    """Behaviour of the simulated autopilot that differs from its default."""

    ready_after_s: NonNegativeFloat = 0.0
    """Time after boot at which it lets itself be armed."""
    climb_m_s: float = Field(default=1.0, gt=0.0)
    """Largest climb rate of its own modes."""
    attitude: AxisResponse | None = None
    """Answer of the attitude to its target, as measured on a real one; None: that of PX4's gains on this vehicle."""
    parameters: dict[str, float] = Field(default_factory=dict)


class HiddenTruth(Settings):
    """Content of the file of `simulate --hidden FILE`."""

    effects: list[EffectEntry] = Field(default_factory=list)
    """Forces and moments, and errors of the barometer and the range finder, by their names."""
    effect_files: list[Path] = Field(default_factory=list)
    """Python files with a user's own effects."""
    ground: Place | None = None
    """True places of the surfaces of `ground_effect.surfaces`."""
    noise: Noise = Noise()
    telemetry: Telemetry = Telemetry()
    autopilot: AutopilotTruth = AutopilotTruth()
    barometer: Barometer | None = None
    """Its noise, and how the estimate follows it. None: it has none, unless `effects` give it errors."""
    range_finder: RangeFinder | None = None


@dataclass(frozen=True)
class GroundCushion(ThrustRatio):
    """K = 1 + gain / (1 + (z / (width R))^2)^(3/2): the pressure of a cushion seen from its axis.

    Not in the catalogue on purpose: it falls off as z^-3 far away and is flat at the ground.
    """

    name: ClassVar[str] = "hidden.ground_cushion"
    depends_on: ClassVar[tuple[str, ...]] = ("height_over_radius",)

    gain: float = parameter(0.25, 0.0, 1.0, "", "gain in thrust at height 0")
    width: float = parameter(1.8, 0.2, 10.0, "", "height, in rotor radii, at which it has faded to a third")

    def ratio(self, c: Conditions, vehicle: Vehicle) -> Number:
        z = maximum(c.height_m, 0.0) / (self.width * vehicle.rotor.radius_m)
        return 1.0 + self.gain / (1.0 + z * z) ** 1.5


HIDDEN_EFFECTS: dict[str, type[Effect]] = {GroundCushion.name: GroundCushion}


def load_hidden(path: Path | str | None) -> HiddenTruth:
    """Read the truth of a file; None: no effects, default noise.

    The file may also be that of a model: then the world has the effects of the model, and default noise.
    """
    if path is None:
        return HiddenTruth()
    content = read_yaml(Path(path))
    if "vehicle" not in content:
        return validate(content, HiddenTruth, str(path))
    model = model_from_dict(content, Path(path))
    entries = [EffectEntry(effect=effect.name, parameters=effect.values()) for effect in model.effects]
    return HiddenTruth(effects=entries, effect_files=list(model.effect_files))


def true_model(vehicle: Vehicle, truth: HiddenTruth, source: str) -> Model:
    """The model that the simulated world obeys."""
    known = catalog_with(truth.effect_files)
    stack = []
    for entry in truth.effects:
        if entry.effect in SENSOR_ERRORS:
            continue
        kind = HIDDEN_EFFECTS.get(entry.effect) or find_effect(entry.effect, source, known)
        effect = kind.from_values(entry.parameters, source)
        if problem := effect.mismatch(vehicle):
            raise SettingsError(f"{source}: {problem}")
        stack.append(StackedEffect(effect))
    return Model(vehicle, tuple(stack), name="truth")


def height_sensors(vehicle: Vehicle, truth: HiddenTruth, model: Model, source: str, seed: int) -> HeightSensors | None:
    """The sensors of the height in the world of `model`; None where the truth asks for none.

    Raises
    ------
    SettingsError
        An error of a sensor has a parameter that it does not know, or one out of bounds.
    """
    entries = [entry for entry in truth.effects if entry.effect in SENSOR_ERRORS]
    if not entries and truth.barometer is None and truth.range_finder is None:
        return None
    errors = [SENSOR_ERRORS[entry.effect].from_values(entry.parameters, source) for entry in entries]
    winds = [(effect.north_m_s, effect.east_m_s) for effect in model.effects if isinstance(effect, SteadyWind)]
    wind = winds[0] if winds else (0.0, 0.0)
    return HeightSensors(vehicle, errors, truth.barometer or Barometer(), truth.range_finder, wind, seed)
