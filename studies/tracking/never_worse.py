"""Tracking with a model of an effect and without it, in a world with that effect, for every family of the catalogue."""

from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import NamedTuple

from quadctl.effects import Effect
from quadctl.effects.battery_sag import LinearSag
from quadctl.effects.body_drag import QuadraticDrag
from quadctl.effects.ceiling_effect import MomentumCeiling
from quadctl.effects.ground_effect import Exponential
from quadctl.effects.ground_torque import Levelling
from quadctl.effects.inflow import AxialInflow
from quadctl.effects.rotor_drag import LinearDrag
from quadctl.effects.rotor_fault import WeakRotor
from quadctl.effects.rotor_interaction import FrontWake
from quadctl.effects.tether import HangingTether
from quadctl.effects.thrust_curve import PowerCurve
from quadctl.effects.thrust_map import LineMap
from quadctl.effects.thrust_scale import ConstantScale
from quadctl.effects.thrust_tilt import FixedTilt
from quadctl.effects.translational_lift import HorizontalLift
from quadctl.flight.preflight.plan import FlightPlan, read_flight
from quadctl.model import EffectEntry, Model, StackedEffect
from quadctl.sitl.rules.px4 import SimulatedAutopilot
from quadctl.sitl.vehicle.hidden import AutopilotTruth, HiddenTruth, Telemetry
from quadctl.vehicle import AttitudeResponse, AxisResponse, Vehicle
from studies.page import ROOT

from .flights import flown

COURSE = Path(__file__).with_name("course.yaml")
CONFIG = ROOT / "config" / "flight.yaml"
RESPONSE = AxisResponse(frequency_rad_s=10.0, delay_s=0.05)
CEILING_M = 0.95
"""Height of a ceiling for the effect of one."""
TOLERANCE = 1.02
SEED = 3
DRAG = LinearDrag(d_x=0.4, d_y=0.3, d_z=0.1)
SMALL_DRAG = QuadraticDrag(0.05, 0.07, 0.05)
UNTOLD_S = 0.02
"""Age of an estimate of which nothing tells, in the case that is worse."""
TRUTHS: tuple[Effect, ...] = (
    ConstantScale(0.88),
    LineMap(0.9, 0.3),
    Exponential(0.2, 4.0),
    MomentumCeiling(2.0),
    DRAG,
    SMALL_DRAG,
    AxialInflow(0.5),
    FixedTilt(2.0, -3.0),
    HangingTether(1.5),
    HorizontalLift(1.0),
    LinearSag(1.5),
    PowerCurve(1.6),
    WeakRotor(0.15, 2.0),
    FrontWake(0.5),
    Levelling(1.5, 2.0),
)
"""Moderate truths, one for each family."""
NOT_FLOWN = {
    "wind": "belongs to one day: `check` refuses it",
    "payload": "the time of the change belongs to one flight: `check` refuses it",
    "motor_lag": "acts on whole logs only",
    "imu_bias": "acts on the accelerometer only",
    **dict.fromkeys(
        ("airspeed_moment", "centre_of_mass", "rate_damping", "rotor_reaction"),
        "turns the vehicle: moments are left to the rate controller",
    ),
}
"""Families without a row, and why."""


class Pair(NamedTuple):
    """RMSE of the tracking, m, without the effect's model and with it."""

    without_m: float
    with_m: float

    @property
    def worse(self) -> bool:
        return self.with_m > TOLERANCE * self.without_m


class Compared(NamedTuple):
    """Tracking in the worlds of one effect."""

    effect: Effect
    alone: Pair
    """In a world with this effect; nothing is fed forward ahead, unless it is a drag."""
    beside_drag: Pair | None
    """In a world with a drag too, which both models know; None for a drag."""


def compare(effect: Effect) -> Compared:
    """Fly the course in the worlds of one effect."""
    alone = Pair(rmse_m([effect], []), rmse_m([effect], [effect]))
    if effect.family() == DRAG.family():
        return Compared(effect, alone, None)
    return Compared(effect, alone, Pair(rmse_m([DRAG, effect], [DRAG]), rmse_m([DRAG, effect], [DRAG, effect])))


def late_drag() -> Pair:
    """A small drag beside a known one, where the estimate is late and nothing tells it."""
    return Pair(rmse_m([DRAG, SMALL_DRAG], [DRAG], UNTOLD_S), rmse_m([DRAG, SMALL_DRAG], [DRAG, SMALL_DRAG], UNTOLD_S))


def rmse_m(truth: Sequence[Effect], known: Sequence[Effect], estimate_delay_s: float = 0.0) -> float:
    """RMSE of the tracking in the world `truth` with a model of the `known` effects.

    `estimate_delay_s` is the age of the estimate of which nothing tells; on both real autopilots none was measured.
    """
    entries = [EffectEntry(effect=effect.name, parameters=effect.values()) for effect in truth]
    hidden = HiddenTruth(
        effects=entries, telemetry=Telemetry(delay_s=estimate_delay_s), autopilot=AutopilotTruth(attitude=RESPONSE)
    )
    model = Model(vehicle(), tuple(map(StackedEffect, known)), name="known")
    plan = _plan()._replace(body=Model(vehicle(), name=model.name), compensator=model)
    return flown(plan, SimulatedAutopilot(vehicle(), hidden, SEED), ("multisine",)).rmse_m


@cache
def vehicle() -> Vehicle:
    """Vehicle of the configuration, below a ceiling, with the attitude's answer of PX4's mock."""
    answer = AttitudeResponse(roll=RESPONSE, pitch=RESPONSE)
    return _plan().body.vehicle.model_copy(update={"attitude_response": answer, "ceiling_m": CEILING_M})


@cache
def _plan() -> FlightPlan:
    return read_flight(COURSE, CONFIG, "none", None)
