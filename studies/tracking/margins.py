"""Margins of the horizontal loops from linear models: lag of the attitude, delay, and the control law.

The loop is cut at the acceleration that control asks for. With G the answer from there to the acceleration flown, and
F a filter of first order on the derivative:

    L = G(s) / s * ((Kv + Ki / s) (1 + Kp / s) + Kd s F(s))

Drag, which damps, is left out.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

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


def sensitivity(open_loop: Transfer, rad_s: Floats = RAD_S) -> Floats:
    """Size of 1 / (1 + L)."""
    size: Floats = np.abs(1.0 / (1.0 + open_loop(_on_axis(rad_s))))
    return size


def margins(open_loop: Transfer) -> Margins:
    """Margins of a loop that is stable when closed."""
    return margins_of(RAD_S, open_loop(_on_axis(RAD_S)))


def _on_axis(rad_s: Floats) -> Complex:
    return np.asarray(1j * rad_s, dtype=np.complex128)


def of_quadctl(settings: ControllerSettings, vehicle: Vehicle) -> Transfer:
    """Horizontal loop of the control law, whose target waits for half a tick on average."""
    response, tick_s, gains = vehicle.attitude_response, 1.0 / settings.rate_hz, settings.velocity_horizontal
    assert response is not None
    axis = Gains(settings.position_p, gains.p, gains.i, gains.d, settings.derivative_time_s)
    return loop(axis, attitude(response.roll, 0.5 * tick_s), tick_s)


def of_autopilot(own: PositionLaw, vehicle: Vehicle) -> Transfer:
    """Horizontal loop of an autopilot's own control, near its target."""
    response, k = vehicle.attitude_response, own.horizontal
    assert response is not None
    filters_s = _constant_s(own.derivative_hz), _constant_s(own.error_hz)
    axis = Gains(k.position_p, k.velocity_p, k.velocity_i, k.velocity_d, *filters_s, own.damps_error)
    return loop(axis, attitude(response.roll, OWN_HOLD_S))


def _constant_s(cut_off_hz: float) -> float:
    return 0.0 if math.isinf(cut_off_hz) else 1.0 / (2.0 * math.pi * cut_off_hz)
