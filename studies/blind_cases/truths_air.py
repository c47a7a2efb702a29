"""Hidden truths of the air: ground, ceiling, drag, wind, inflow, wakes. Forms that the catalogue does not use."""

import math
import random
from typing import ClassVar

from quadctl.state import Vec3
from quadctl.vehicle import Vehicle

from .world import Instant, Truth

SOLIDITY, LIFT_SLOPE = 0.1, 5.0
"""Solidity of a two-bladed 10 x 4.5 propeller; lift slope per radian at low Reynolds numbers."""


class GroundCushion(Truth):
    """K = 1 + 0.2 / (1 + (z / 1.9 R)^3) for each rotor at its own height: flat at the ground, z^-3 far away.

    10 % more thrust at z = 1.9 R, as in the hovering flights of the RAPTOR (Appius' thesis, figure 10) and on the
    stand of Sanchez-Cuevas et al. 2017. The lower rotors of a tilted vehicle lift more: that levels it.
    """

    family = "ground_effect"
    also = ("ground_torque",)

    def act(self, now: Instant) -> None:
        width = 1.9 * self.vehicle.rotor.radius_m
        for i, height in enumerate(now.heights):
            x = max(height, 0.0) / width
            now.thrusts[i] *= 1.0 + self.strength * 0.2 / (1.0 + x**3)


class GroundImages(Truth):
    """Each rotor is a source whose image below the ground slows the inflow of every rotor; a fountain adds to it.

    Cheeseman & Bennett 1955 for each pair of rotors at their own heights, fountain as a Gaussian in height after the
    measurements of Garofano-Soldado et al. (7 % more at z = 2 R below the centre of a hexarotor). The lower rotors of a
    tilted vehicle lift more: that levels it.
    """

    family = "ground_effect"
    also = ("ground_torque",)

    def __init__(self, vehicle: Vehicle, strength: float, chance: random.Random) -> None:
        super().__init__(vehicle, strength, chance)
        places = [rotor.position_m for rotor in vehicle.rotors]
        self._distances2 = [[(p[0] - q[0]) ** 2 + (p[1] - q[1]) ** 2 for q in places] for p in places]

    def act(self, now: Instant) -> None:
        radius = self.vehicle.rotor.radius_m
        heights = [max(height, 0.6 * radius) for height in now.heights]
        for i, z in enumerate(heights):
            slowed = 0.0
            for image, distance2 in zip(heights, self._distances2[i], strict=True):
                gap = z + image
                slowed += 0.25 * radius**2 * gap / (distance2 + gap * gap) ** 1.5
            fountain = 0.07 * math.exp(-((z / (2.6 * radius)) ** 2))
            now.thrusts[i] *= 1.0 + self.strength * (1.0 / (1.0 - slowed) - 1.0 + fountain)


class CeilingSuction(Truth):
    """K = 1 / (1 - (R / (D + 0.02 R))^2 / 6.9) for each rotor at its own distance D from the ceiling.

    Fitted by Sanchez-Cuevas et al. 2017 (ICUAS, ceiling effect) to a rotor on a stand: 15 % more at D = R.
    """

    family = "ceiling_effect"

    def act(self, now: Instant) -> None:
        radius, ceiling = self.vehicle.rotor.radius_m, self.vehicle.ceiling_m or math.inf
        for i, height in enumerate(now.heights):
            near = (radius / max(ceiling - height + 0.02 * radius, 0.7 * radius)) ** 2 / 6.9
            now.thrusts[i] *= 1.0 + self.strength * (1.0 / (1.0 - near) - 1.0)


class HubForce(Truth):
    """Each rotor is pushed back in its plane in proportion to rotor speed times airspeed (blade flapping's H-force).

    In hover as much as Faessler et al. 2018 found: 0.5 and 0.4 m/s^2 per m/s.
    """

    family = "rotor_drag"
    PER_S: ClassVar[tuple[float, float]] = (0.5, 0.4)

    def act(self, now: Instant) -> None:
        u, v, _ = now.air_velocity
        dx, dy = self.PER_S
        turning = self.strength * self.vehicle.mass_kg * sum(now.rpm) / len(now.rpm) / self.hover_rpm
        now.push(-turning * dx * u, -turning * dy * v, 0.0)


class CrossflowDrag(Truth):
    """Each axis has its own pressure drag, -1/2 rho A u |u|: cross-flow on a frame with arms, legs and a battery.

    Areas of 0.03 and 0.04 m^2 for 1.5 kg, growing with the face of the vehicle: Hattenberger et al. 2022 find drag
    areas of 0.02 to 0.05 m^2 on vehicles of this size.
    """

    family = "body_drag"

    def act(self, now: Instant) -> None:
        half = 0.5 * self.vehicle.air_density_kg_m3 * self.strength * (self.vehicle.mass_kg / 1.5) ** (2.0 / 3.0)
        u, v, w = now.air_velocity
        now.push(-half * 0.03 * u * abs(u), -half * 0.04 * v * abs(v), -half * 0.05 * w * abs(w))


class BladeElements:
    """Thrust of one rotor at constant speed in any airflow, by blade-element momentum theory.

    Leishman 2006, eq. 3.58 and 5.41: T = Q (theta (1 + 3/2 mu^2) - V_c - v_i) with Q = rho a sigma A V_tip / 4, and
    Glauert's T = 2 rho A v_i sqrt(V_h^2 + (V_c + v_i)^2); v_i by Newton's iteration.
    """

    def __init__(self, vehicle: Vehicle, hover_rpm: float) -> None:
        rho, radius = vehicle.air_density_kg_m3, vehicle.rotor.radius_m
        disk = math.pi * radius**2
        self.hover_n = vehicle.weight_n / vehicle.n_rotors
        self.tip_m_s = hover_rpm * math.pi / 30.0 * radius
        self.momentum = 2.0 * rho * disk
        self.slope = 0.25 * rho * LIFT_SLOPE * SOLIDITY * disk * self.tip_m_s
        self.hover_inflow = math.sqrt(self.hover_n / self.momentum)
        self.pitch_m_s = self.hover_inflow + self.hover_n / self.slope

    def ratio(self, climb_m_s: float, across_m_s: float) -> float:
        """Thrust over that in hover at the same rotor speed."""
        q, m = self.slope, self.momentum
        advance = across_m_s / self.tip_m_s
        theta = self.pitch_m_s * (1.0 + 1.5 * advance * advance)
        inflow = self.hover_inflow
        for _ in range(4):
            through = climb_m_s + inflow
            total = math.sqrt(across_m_s * across_m_s + through * through) + 1e-9
            error = q * (theta - through) - m * inflow * total
            inflow += error / (q + m * (total + inflow * through / total))
        return q * (theta - climb_m_s - inflow) / self.hover_n


class AxialBlades(Truth):
    """Climbing blades meet the air at a smaller angle: blade-element momentum theory of the flow along the axis."""

    family = "inflow"

    def __init__(self, vehicle: Vehicle, strength: float, chance: random.Random) -> None:
        super().__init__(vehicle, strength, chance)
        self.blades = BladeElements(vehicle, self.hover_rpm)

    def act(self, now: Instant) -> None:
        ratio = 1.0 + self.strength * (self.blades.ratio(-now.air_velocity[2], 0.0) - 1.0)
        now.thrusts[:] = [ratio * thrust for thrust in now.thrusts]


class FreshAir(Truth):
    """In level flight rotors breathe fresh air: blade-element momentum theory of the flow across the disk."""

    family = "translational_lift"

    def __init__(self, vehicle: Vehicle, strength: float, chance: random.Random) -> None:
        super().__init__(vehicle, strength, chance)
        self.blades = BladeElements(vehicle, self.hover_rpm)

    def act(self, now: Instant) -> None:
        across = math.hypot(now.air_velocity[0], now.air_velocity[1])
        ratio = 1.0 + self.strength * (self.blades.ratio(0.0, across) - 1.0)
        now.thrusts[:] = [ratio * thrust for thrust in now.thrusts]


class Breeze(Truth):
    """A breeze of 3 m/s (Beaufort 2) with gusts of 15 %, felt through an H-force of 0.35 m/s^2 per m/s.

    Gusts after Dryden (MIL-F-8785C): a first-order process over 3 s, along the wind.
    """

    family = "wind"
    also = ("rotor_drag",)
    MEAN_M_S, GUSTS, GUST_TIME_S, PER_S = 3.0, 0.15, 3.0, 0.35

    def __init__(self, vehicle: Vehicle, strength: float, chance: random.Random) -> None:
        super().__init__(vehicle, strength, chance)
        toward = chance.uniform(0.0, 2.0 * math.pi)
        self.mean = (
            strength * self.MEAN_M_S * math.cos(toward),
            strength * self.MEAN_M_S * math.sin(toward),
        )
        self._chance = random.Random(chance.random())
        self._gust = 0.0
        self._drawn_s = -1.0

    def wind(self, time_s: float) -> Vec3:
        if time_s - self._drawn_s > 0.05 or time_s < self._drawn_s:
            keep = math.exp(-0.05 / self.GUST_TIME_S)
            self._gust = keep * self._gust + math.sqrt(1.0 - keep**2) * self._chance.gauss(0.0, self.GUSTS)
            self._drawn_s = time_s
        return (1.0 + self._gust) * self.mean[0], (1.0 + self._gust) * self.mean[1], 0.0

    def act(self, now: Instant) -> None:
        u, v, _ = now.air_velocity
        push = self.PER_S * self.vehicle.mass_kg * sum(now.rpm) / len(now.rpm) / self.hover_rpm
        if self.strength > 0.0:
            now.push(-push * u, -push * v, 0.0)

    def parameters(self) -> dict[str, dict[str, float]]:
        return {"wind.steady": {"north_m_s": self.mean[0], "east_m_s": self.mean[1]}}


class SkewedWakes(Truth):
    """Rotors behind others fly in their wakes, which lean back by atan(V / v_i): up to 12 % of their thrust is lost.

    The share of the rear disk in a front rotor's wake is a Gaussian of its distance from the wake's axis. Luo et al.
    2015 and Bannwarth et al. 2019 measured 5 to 15 % at advance ratios of small quadrotors.
    """

    family = "rotor_interaction"
    LOSS = 0.12

    def act(self, now: Instant) -> None:
        u, v, _ = now.air_velocity
        speed = math.hypot(u, v)
        if speed < 0.05:
            return
        vh = self.vehicle.hover_induced_velocity_m_s
        lean = math.sin(math.atan2(speed, vh)) ** 1.5  # how far the wake reaches back instead of down
        radius = self.vehicle.rotor.radius_m
        places = [rotor.position_m for rotor in self.vehicle.rotors]
        for i, (x, y, _) in enumerate(places):
            shaded = 0.0
            for px, py, _ in places:
                behind = ((px - x) * u + (py - y) * v) / speed
                beside = ((px - x) * v - (py - y) * u) / speed
                if behind > 0.5 * radius:
                    shaded += math.exp(-0.5 * (beside / radius) ** 2)
            now.thrusts[i] *= 1.0 - self.strength * self.LOSS * 1.6 * lean * min(shaded, 1.5)


class LevellingGround(Truth):
    """The lower side of a tilted vehicle lifts more: thrusts differ by the rotors' heights, their sum stays.

    K_i - mean(K) with K = 1 + 0.35 / (1 + (z / 1.2 R)^2)^2, four times as steep as a rotor alone: the restoring moment
    of the frame's fountain comes on top (Kan et al. 2019 and Matus-Vargas et al. 2021 describe it).
    """

    family = "ground_torque"

    def act(self, now: Instant) -> None:
        width = 1.2 * self.vehicle.rotor.radius_m
        mean = sum(now.heights) / len(now.heights)
        lift = []
        for height in now.heights:
            x = max(mean + 4.0 * (height - mean), 0.0) / width
            lift.append(self.strength * 0.35 / (1.0 + x * x) ** 2)
        middle = sum(lift) / len(lift)
        # A moment alone: the differences act, not the thrusts.
        total = sum(now.thrusts) / len(now.thrusts)
        for gain, rotor in zip(lift, self.vehicle.rotors, strict=True):
            px, py, _ = rotor.position_m
            extra = (gain - middle) * total
            now.turn(-py * extra, px * extra, 0.0)
