"""Lags of the loop, and what follows from them: the times of the reference, and the share of the gains.

state, true at t - age | this tick, t | setpoint arrives, t + way | the vehicle has turned, t + way + turn
"""

from typing import NamedTuple

from quadctl.control.settings import ControllerSettings
from quadctl.control.velocity import FULL, Easing
from quadctl.model import Model
from quadctl.state import Setpoint, VehicleState

GAIN_TIMES_LAG = 0.5
"""Product of velocity gain and lag of the loop at which the largest sensitivity is 1.2."""
SMOOTHING_S = 2.0
"""Time constant with which a measured delay lowers the gains: a late message alone does not change them."""


class Lags(NamedTuple):
    """Lags at one tick, s."""

    age_s: float = 0.0
    """Age of the state."""
    way_s: float = 0.0
    """Way of the setpoint to the autopilot."""
    turn_s: float | None = None
    """From a setpoint to the force to the side; None: not known, and nothing is fed forward ahead of its time."""
    rotors_s: float = 0.0
    """From a setpoint to the thrust."""

    @property
    def link_s(self) -> float:
        """Delay of state and setpoint together."""
        return self.age_s + self.way_s

    @property
    def ahead_s(self) -> float | None:
        """From this tick to the time at which the vehicle does what it is told."""
        return None if self.turn_s is None else self.way_s + self.turn_s


class Preview(NamedTuple):
    """Reference at the time when the vehicle will do what it is told."""

    ahead: Setpoint
    horizon_s: float = 0.0
    """From the time of the state to that time."""
    rise_share: float = 1.0
    """Share of the horizon after which the thrust has followed, which need not wait for the attitude."""
    easing: Easing = FULL


def preview(ahead: Setpoint, at: Lags, easing: Easing) -> Preview:
    """Preview of the reference `ahead`, at the end of the lags `at`."""
    if at.turn_s is None:
        return Preview(ahead, easing=easing)
    horizon_s = at.link_s + at.turn_s
    return Preview(ahead, horizon_s, min(1.0, (at.link_s + at.rotors_s) / max(horizon_s, 1e-6)), easing)


def turn_lag_s(vehicle_and_effects: Model, settings: ControllerSettings) -> float | None:
    """Lag of the force to the side behind its setpoint; None where the attitude's lag is not known, or the drag.

    Without the drag, which pulls back by about as much, looking ahead alone would make the tracking worse. Tilted
    rotors push to the side as quickly as they turn.
    """
    vehicle = vehicle_and_effects.vehicle
    if settings.actuation == "full":
        return vehicle.rotor.time_constant_s
    response = vehicle.attitude_response
    return response.lag_s if response is not None and vehicle_and_effects.resists_motion else None


def lags(state: VehicleState, turn_s: float | None, rotors_s: float, settings: ControllerSettings) -> Lags:
    """Lags with which `state` and the answer to it come; none without look-ahead."""
    if not settings.look_ahead:
        return Lags()
    return Lags(max(0.0, state.age_s("position")), state.setpoint_delay_s, turn_s, rotors_s)


def smoothed(delay_s: float, at: Lags, dt: float) -> float:
    """Delay of the link, state and setpoint together, `dt` after it was `delay_s`."""
    return delay_s + min(dt / SMOOTHING_S, 1.0) * (at.link_s - delay_s)


def eased(delay_s: float, turn_s: float | None, rotors_s: float, settings: ControllerSettings) -> Easing:
    """Shares of the gains with a link of `delay_s`: Kv is at most 0.5 over all lags together.

    The lag of an attitude loop that is not known is taken for the one that the gains are made for.
    """
    if not settings.look_ahead:
        return FULL
    return Easing(
        _share(settings.velocity_horizontal.p, delay_s, turn_s), _share(settings.velocity_vertical.p, delay_s, rotors_s)
    )


def _share(kv: float, delay_s: float, lag_s: float | None) -> float:
    if kv == 0.0:
        return 1.0
    made_for_s = GAIN_TIMES_LAG / kv
    return made_for_s / max(made_for_s, delay_s + (made_for_s if lag_s is None else lag_s))
