"""Gains, limits and choices of the controller. `config/flight_thesis.yaml` has those of the thesis."""

from typing import Literal

from pydantic import Field, NonNegativeFloat, PositiveFloat, model_validator

from quadctl.settings import Settings


class AxisGains(Settings):
    """Velocity PID of one axis pair: m/s^2 per m/s, per m, per m/s^2."""

    p: NonNegativeFloat
    i: NonNegativeFloat
    d: NonNegativeFloat


class ControllerSettings(Settings):
    """Gains, limits, rate and choices of the cascade."""

    actuation: Literal["tilt", "full"] = "tilt"
    """`tilt`: force to the side by leaning; `full`: by tilted rotors with the attitude level, as far as they reach."""
    rate_hz: float = Field(default=50.0, ge=10.0, le=250.0)
    look_ahead: bool = True
    """True: the reference is compared at the time of the state, and fed forward at the time when the attitude will have
    followed, where the vehicle's `attitude_response` is known."""
    derivative: Literal["error", "velocity"] = "error"
    """Acceleration that D damps: `error`: what the reference does not have; `velocity`: all."""
    horizontal_integral: Literal["velocity", "position"] = "velocity"
    """Error that it sums up: `velocity`: that of the velocity; `position`: the velocity that leads back to the place,
    limited, so that a constant error of the estimated velocity makes no error of the position."""
    vertical_integral: Literal["thrust", "force"] = "thrust"
    """`thrust`: a factor on the thrust; `force`: an acceleration, which turns the direction of the force."""
    effects_at: Literal["reference", "state"] = "reference"
    """State at which the compensator's effects are evaluated: `reference`: the one ahead, while that is near."""
    position_p: NonNegativeFloat = 0.8
    """1/s: velocity setpoint per position error, horizontal."""
    position_p_vertical: NonNegativeFloat = 0.95
    velocity_horizontal: AxisGains = AxisGains(p=2.0, i=0.4, d=0.2)
    velocity_vertical: AxisGains = AxisGains(p=4.0, i=2.0, d=0.0)
    max_horizontal_m_s: PositiveFloat = 12.0
    max_up_m_s: PositiveFloat = 3.0
    max_down_m_s: PositiveFloat = 1.0
    max_tilt_deg: float = Field(default=35.0, gt=0.0, lt=80.0)
    max_integral_m_s2: PositiveFloat = 4.0
    """Largest acceleration that the integrator of one axis may ask for."""
    max_acceleration_up_m_s2: PositiveFloat = 8.0
    max_acceleration_down_m_s2: float = Field(default=7.0, gt=0.0, lt=9.0)
    """Largest acceleration downwards: less than gravity, so that some thrust, and with it attitude control, is left."""
    derivative_time_s: PositiveFloat = 0.05
    """Time constant of the filter on the acceleration of the D term."""
    min_throttle: float = Field(default=0.05, ge=0.0, lt=1.0)
    max_throttle: float = Field(default=0.9, gt=0.0, le=1.0)

    @model_validator(mode="after")
    def _ordered(self) -> "ControllerSettings":
        if self.min_throttle >= self.max_throttle:
            raise ValueError(f"min_throttle is {self.min_throttle}, expected less than max_throttle")
        return self
