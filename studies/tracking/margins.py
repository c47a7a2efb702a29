"""Margins of the loops from linear models: lag of the attitude or of the rotors, delay, and the control law.

The loop is cut at the acceleration that control asks for. With G the answer from there to the acceleration flown, and
F a filter of first order on the derivative:

    L = G(s) / s * ((Kv + Ki / s) (1 + Kp / s) + Kd s F(s))

Drag, which damps, is left out.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from quadctl.control.margins import Margins, margins_of
from quadctl.control.settings import ControllerSettings
from quadctl.logs.flight_log import Floats
from quadctl.sitl.vehicle.position_loop import PositionLaw
from quadctl.vehicle import AxisResponse, Vehicle

Complex = NDArray[np.complex128]
Transfer = Callable[[Complex], Complex]

RAD_S: Floats = np.geomspace(0.02, 200.0, 40001)
OWN_HOLD_S = 0.005
"""Mean age of a target of the autopilot's own control, at 100 Hz."""


@dataclass(frozen=True)
class Gains:
    """Gains of one axis, with the filter of its derivative."""

    position_p: float
    p: float
    i: float
    d: float
    derivative_s: float
    error_s: float = 0.0
    """Time constant of a filter on the error of the velocity."""
    damps_error: bool = False
    """True: D acts on the error of the velocity, in which that of the position is."""


def law(gains: Gains, tick_s: float = 0.0) -> Transfer:
    """Transfer from the velocity to the acceleration that is asked for, with its sign turned.

    `tick_s` is the interval over which the velocity's difference is taken.
    """

    def at(s: Complex) -> Complex:
        led = 1.0 + gains.position_p / s
        damping = gains.d * s * np.exp(-0.5 * tick_s * s) / (gains.derivative_s * s + 1.0)
        found: Complex = (gains.p + gains.i / s) * led + damping * (led if gains.damps_error else 1.0)
        return found / (gains.error_s * s + 1.0)

    return at


def loop(gains: Gains, answer: Transfer, tick_s: float = 0.0) -> Transfer:
    """Open loop of the velocity and the position of one axis."""
    control = law(gains, tick_s)
    return lambda s: answer(s) / s * control(s)


def attitude(response: AxisResponse, delay_s: float) -> Transfer:
    """Answer of the force to the side: the attitude's second order behind a delay."""
    frequency, damping = response.frequency_rad_s, response.damping
    late_s = response.delay_s + delay_s

    def at(s: Complex) -> Complex:
        found: Complex = np.exp(-late_s * s) * frequency**2 / (s * s + 2.0 * damping * frequency * s + frequency**2)
        return found

    return at


def rotors(time_constant_s: float, delay_s: float) -> Transfer:
    """Answer of the thrust: the rotors' lag behind a delay."""
    return lambda s: np.exp(-delay_s * s) / (time_constant_s * s + 1.0)


def sensitivity(open_loop: Transfer, rad_s: Floats = RAD_S) -> Floats:
    """Size of 1 / (1 + L)."""
    size: Floats = np.abs(1.0 / (1.0 + open_loop(_on_axis(rad_s))))
    return size


def margins(open_loop: Transfer) -> Margins:
    """Margins of a loop that is stable when closed."""
    return margins_of(RAD_S, open_loop(_on_axis(RAD_S)))


def _on_axis(rad_s: Floats) -> Complex:
    return np.asarray(1j * rad_s, dtype=np.complex128)


class Axes(NamedTuple):
    """Open loops of one controller on one vehicle."""

    horizontal: Transfer
    vertical: Transfer


def of_quadctl(settings: ControllerSettings, vehicle: Vehicle) -> Axes:
    """Loops of the control law, whose target waits for half a tick on average."""
    response, tick_s, filter_s = vehicle.attitude_response, 1.0 / settings.rate_hz, settings.derivative_time_s
    assert response is not None
    level, upright = settings.velocity_horizontal, settings.velocity_vertical
    return Axes(
        loop(
            Gains(settings.position_p, level.p, level.i, level.d, filter_s),
            attitude(response.roll, 0.5 * tick_s),
            tick_s,
        ),
        loop(
            Gains(settings.position_p_vertical, upright.p, upright.i, upright.d, filter_s),
            rotors(vehicle.rotor.time_constant_s, 0.5 * tick_s),
            tick_s,
        ),
    )


def of_autopilot(own: PositionLaw, vehicle: Vehicle) -> Axes:
    """Loops of an autopilot's own control, near its target."""
    response = vehicle.attitude_response
    assert response is not None
    level, upright = (
        Gains(
            k.position_p,
            k.velocity_p,
            k.velocity_i,
            k.velocity_d,
            _constant_s(own.derivative_hz),
            _constant_s(own.error_hz),
            own.damps_error,
        )
        for k in (own.horizontal, own.vertical)
    )
    lift = rotors(vehicle.rotor.time_constant_s, OWN_HOLD_S)
    return Axes(
        loop(level, attitude(response.roll, OWN_HOLD_S)),
        loop(upright, _with_lift_loop(own, lift) if own.lift_p else lift),
    )


def _with_lift_loop(own: PositionLaw, lift: Transfer) -> Transfer:
    """Answer of the vertical acceleration to its setpoint in a loop of its own."""

    def at(s: Complex) -> Complex:
        inner = lift(s) * (own.lift_p + own.lift_i / s) / (_constant_s(own.lift_hz) * s + 1.0)
        return inner / (1.0 + inner * np.exp(-OWN_HOLD_S * s))

    return at


def _constant_s(cut_off_hz: float) -> float:
    return 0.0 if math.isinf(cut_off_hz) else 1.0 / (2.0 * math.pi * cut_off_hz)
