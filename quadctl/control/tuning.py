"""Gains for the lags of a vehicle: Kv = 0.5 / T with all lags together, Kp = 0.4 Kv, I and D in proportion."""

from typing import NamedTuple

from quadctl.control.lags import GAIN_TIMES_LAG
from quadctl.control.margins import LoopGains, LoopLags
from quadctl.control.settings import AxisGains, ControllerSettings
from quadctl.vehicle import AttitudeResponse, AxisResponse

POSITION_SHARE = 0.4
"""Position gain over velocity gain."""
LARGEST_D = 0.3
"""Largest gain of D: it is a share of the acceleration, which a quicker loop does not make larger."""
USUAL = ControllerSettings()
"""Defaults: their ratios of I and D to the velocity gain, and their vertical gains as the largest."""


class LagsFound(NamedTuple):
    """Lags of a vehicle and its link, s."""

    age_s: float
    """Age of the state."""
    attitude: AttitudeResponse
    """Answer of the attitude, with the way of the setpoint."""
    rotors_s: float

    def horizontal_s(self, settings: ControllerSettings) -> float:
        """All lags to the force to the side together."""
        return self.age_s + (self.rotors_s if settings.actuation == "full" else self.attitude.lag_s)

    @property
    def vertical_s(self) -> float:
        return self.age_s + self.rotors_s


def tuned(settings: ControllerSettings, found: LagsFound) -> ControllerSettings:
    """The settings with gains for these lags.

    Where the rotors' lag alone counts, vertically and with full actuation, today's vertical gain is the largest: noise
    and what the model of the loop leaves out limit it, not the lag.
    """
    most = USUAL.velocity_vertical.p
    level = GAIN_TIMES_LAG / max(found.horizontal_s(settings), 1e-3)
    if settings.actuation == "full":
        level = min(level, most)
    upright = min(GAIN_TIMES_LAG / max(found.vertical_s, 1e-3), most)
    return settings.model_copy(
        update={
            "position_p": round(POSITION_SHARE * level, 3),
            "position_p_vertical": round(min(POSITION_SHARE * upright, USUAL.position_p_vertical), 3),
            "velocity_horizontal": _in_proportion(USUAL.velocity_horizontal, level),
            "velocity_vertical": _in_proportion(USUAL.velocity_vertical, upright),
        }
    )


def horizontal_loop(settings: ControllerSettings, found: LagsFound) -> tuple[LoopGains, LoopLags]:
    """Loop of the axis, of roll and pitch, whose attitude is the later."""
    delay_s = found.age_s + 0.5 / settings.rate_hz
    gains = _gains(settings.position_p, settings.velocity_horizontal, settings)
    if settings.actuation == "full":
        return gains, LoopLags(delay_s, time_constant_s=found.rotors_s)
    later = max((found.attitude.roll, found.attitude.pitch), key=_lag_s)
    return gains, LoopLags(delay_s + later.delay_s, later.frequency_rad_s, later.damping)


def vertical_loop(settings: ControllerSettings, found: LagsFound) -> tuple[LoopGains, LoopLags]:
    gains = _gains(settings.position_p_vertical, settings.velocity_vertical, settings)
    return gains, LoopLags(found.age_s + 0.5 / settings.rate_hz, time_constant_s=found.rotors_s)


def _gains(position_p: float, velocity: AxisGains, settings: ControllerSettings) -> LoopGains:
    return LoopGains(position_p, velocity.p, velocity.i, velocity.d, settings.derivative_time_s)


def _in_proportion(usual: AxisGains, p: float) -> AxisGains:
    """Gains with the ratios of `usual`; a slower loop integrates slower yet, as its time constants are longer."""
    i, d = usual.i / usual.p * p * min(1.0, p / usual.p), min(usual.d / usual.p * p, LARGEST_D)
    return AxisGains(p=round(p, 3), i=round(i, 3), d=round(d, 3))


def _lag_s(axis: AxisResponse) -> float:
    return axis.lag_s
