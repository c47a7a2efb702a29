"""Faults of the link to a simulated autopilot, and of the estimate that it sends; set from any thread."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal

from quadctl.frames import multiply, quaternion_from_euler
from quadctl.state import NO_VECTOR, Vec3, VehicleState

Distortion = Callable[[VehicleState], VehicleState]


def honest(estimate: VehicleState) -> VehicleState:
    """Estimate without a fault."""
    return estimate


@dataclass
class Faults:
    """Faults of the link and of the estimate."""

    silent: bool = False
    """True: nothing is sent."""
    deaf: bool = False
    """True: nothing that arrives is read."""
    withheld: frozenset[str] = frozenset()
    """Names of messages that are not sent, and refused when asked for."""
    distort: Distortion = honest
    """Function from the true estimate to the one that is sent."""
    estimator_ratio: float = 0.1
    """Innovation test ratio of position that is sent; from 1 on the estimator rejects its sensors."""
    refuse_arming: str = ""
    """Reason with which arming is refused; empty: it is not."""
    refuse_modes: str = ""
    """Reason with which every change of mode over the link is refused; empty: it is not."""

    def lets_out(self, name: str) -> bool:
        """True when a message of this name reaches the wire."""
        return not self.silent and name not in self.withheld


def nan_position(estimate: VehicleState) -> VehicleState:
    return replace(estimate, position_ned_m=NO_VECTOR)


def no_attitude(estimate: VehicleState) -> VehicleState:
    return replace(estimate, attitude=(0.0, 0.0, 0.0, 0.0))


def frozen(part: Literal["position", "attitude"]) -> Distortion:
    """Freeze a part: the messages keep coming, with the values of the first estimate."""
    first: list[VehicleState] = []

    def distort(estimate: VehicleState) -> VehicleState:
        if not first:
            first.append(estimate)
        if part == "position":
            stuck = first[0].position_ned_m, first[0].velocity_ned_m_s
            return replace(estimate, position_ned_m=stuck[0], velocity_ned_m_s=stuck[1])
        return replace(estimate, attitude=first[0].attitude, rates_rad_s=first[0].rates_rad_s)

    return distort


def displaced(by_m: Vec3, over_s: float = 0.0) -> Distortion:
    """The position is off by `by_m` (NED): at once, or growing to that in `over_s`."""
    began: list[float] = []

    def distort(estimate: VehicleState) -> VehicleState:
        if not began:
            began.append(estimate.time_s)
        share = min((estimate.time_s - began[0]) / over_s, 1.0) if over_s > 0.0 else 1.0
        x, y, z = (p + share * d for p, d in zip(estimate.position_ned_m, by_m, strict=True))
        return replace(estimate, position_ned_m=(x, y, z))

    return distort


def hurried(to_m_s: float, over_s: float) -> Distortion:
    """A velocity to the north grows by `to_m_s` in `over_s`."""
    began: list[float] = []

    def distort(estimate: VehicleState) -> VehicleState:
        if not began:
            began.append(estimate.time_s)
        share = min((estimate.time_s - began[0]) / over_s, 1.0)
        vx, vy, vz = estimate.velocity_ned_m_s
        return replace(estimate, velocity_ned_m_s=(vx + share * to_m_s, vy, vz))

    return distort


def leaning(roll_rad: float) -> Distortion:
    """Roll the attitude by `roll_rad` more."""
    roll = quaternion_from_euler(roll_rad, 0.0, 0.0)
    return lambda estimate: replace(estimate, attitude=multiply(estimate.attitude, roll))


def battery_at(volts: float) -> Distortion:
    return lambda estimate: replace(estimate, battery_v=volts)
