"""Cases of the worlds: what is hidden in which vehicle, and how it is flown and logged."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from studies.worlds.borrowed.effects import Parameters
from studies.worlds.borrowed.missions import Mission, part


@dataclass(frozen=True)
class Case:
    """Case: hidden effects in a vehicle, its flights, and its equipment."""

    name: str
    kind: str
    missions: tuple[Mission, ...]
    effects: Mapping[str, Parameters] = field(default_factory=dict)
    outdoors: bool = False
    source: str = "speeds"
    imu: bool = False
    quick: bool = False
    """Telemetry of the rotors fast enough for moments."""
    states_lag: bool = True
    ceiling_m: float | None = None
    endurance_s: float = 700.0

    @property
    def families(self) -> list[str]:
        """Families of the hidden effects."""
        return [name.split(".")[0] for name in self.effects]


SWAY = part("sway")
M = Mission


def stairs(seconds: float, turn: str = "slow", low: float = 0.75, across: tuple[str, dict[str, float]] = SWAY) -> M:
    """Staircase of hovers between the ground and free air."""
    return M(seconds, across, part("stairs", low=low, high=8.0, steps=6), turn, "radii")


def under(seconds: float, turn: str = "slow", low: float = 1.6) -> M:
    """Staircase of hovers under the ceiling."""
    return M(seconds, SWAY, part("stairs", low=low, high=7.0, steps=6, ramp=2.6), turn, "below")


def runs(seconds: float, speed: float, turn: str = "slow", height: float = 8.0, pull: float = 2.5) -> M:
    """Out-and-back runs at one height."""
    return M(seconds, part("runs", speed=speed, cruise=2.5, pull=pull), part("hold", height=height), turn)


def swings(seconds: float, middle: float, pull: float, period: float, turn: str = "slow") -> M:
    """Vertical oscillations."""
    return M(seconds, SWAY, part("swings", middle=middle, pull=pull, period=period), turn)


def climbs(seconds: float, low: float, high: float, speed: float, turn: str = "slow") -> M:
    """Climbs and descents."""
    return M(seconds, SWAY, part("climbs", low=low, high=high, speed=speed), turn)


def roam(seconds: float, speed: float, low: float, high: float, turn: str = "slow", smooth: float = 1.3) -> M:
    """Smooth random path at smooth random heights."""
    up = part("wander", low=low, high=high, smooth=1.6)
    return M(seconds, part("smooth", speed=speed, smooth=smooth), up, turn)


def eight(seconds: float, size: float, period: float, height: float, turn: str = "slow") -> M:
    """Figure-eights at one height."""
    return M(seconds, part("eight", size=size, period=period), part("hold", height=height), turn)


def shakes(seconds: float, pull: float, period: float) -> M:
    """Lateral oscillations on a staircase near the ground."""
    up = part("stairs", low=1.0, high=6.0, steps=4)
    return M(seconds, part("shake", pull=pull, period=period), up, "slow", "radii")


H, P, C = "hummingbird", "px4_quadx", "crazyflie"
# fmt: off
ROTORPY = [
    Case("ground_effect_1", H, (stairs(70), stairs(55, "steps")), {"ground_effect.images": {"rho": 2.5}}),
    Case("ground_effect_2", P, (stairs(70, low=0.9), stairs(55, "steps")), {"ground_effect.hayden": {"a": 1.5}}),
    Case("ceiling_effect_1", H, (under(70), under(60, "steps")), {"ceiling_effect.sanchez": {"a1": 6.9, "a2": 0.35}},
        ceiling_m=2.6),
    Case("ceiling_effect_2", P, (under(70), under(60, "fixed")), {"ceiling_effect.throttled": {"a": 3.0}},
        ceiling_m=3.2),
    Case("ground_torque_1", P, (shakes(65, 1.4, 2.5), shakes(50, 1.3, 2.3)), {"ground_torque": {"stiffness": 55.0}},
        quick=True),
    Case("rotor_drag_1", H, (runs(70, 5.0), eight(60, 4.0, 9.0, 3.0)), {"rotor_drag": {"x": 0.3}}, outdoors=True),
    Case("rotor_drag_2", C, (eight(65, 1.5, 6.0, 1.3), roam(60, 1.6, 0.8, 1.8)), {"rotor_drag": {"x": 0.32}}),
    Case("body_drag_1", H, (runs(80, 9.0, "fixed", 15.0, 3.5), runs(70, 8.0)),
        {"body_drag": {"x": 0.0083, "y": 0.0083, "z": 0.016}}, outdoors=True),
    Case("body_drag_2", P, (runs(80, 9.0, "fixed", 15.0, 3.0), eight(70, 20.0, 18.0, 10.0)),
        {"body_drag": {"x": 0.016, "y": 0.018, "z": 0.026}}, outdoors=True),
    Case("translational_lift_1", H, (runs(80, 7.0, "slow", 10.0), roam(70, 5.5, 6.0, 10.0, "fixed", 1.6)),
        {"translational_lift.hub": {"per_m": 0.022}}, outdoors=True),
    Case("translational_lift_2", P, (runs(80, 7.0, "fixed", 10.0), eight(60, 9.0, 12.0, 8.0)),
        {"translational_lift": {"blade": 6.0}}, outdoors=True),
    Case("rotor_interaction_1", P, (runs(80, 7.0, "fixed"), eight(60, 10.0, 14.0, 8.0)),
        {"rotor_interaction": {"per_m_s": 0.045}}, outdoors=True, quick=True),
    Case("wind_1", H, (roam(75, 1.0, 4.0, 7.0), roam(60, 0.8, 3.0, 6.0, "steps")),
        {"wind": {"speed": 5.5, "course_deg": 70.0, "rate": 0.13}}, outdoors=True),
    Case("wind_2", P, (roam(75, 1.0, 6.0, 9.0), runs(60, 1.5, "steps", 10.0, 1.0)),
        {"wind": {"speed": 7.0, "course_deg": -160.0, "area": 0.025}}, outdoors=True),
    Case("inflow_1", H, (climbs(75, 4.0, 14.0, 3.0), climbs(60, 3.0, 12.0, 2.5, "fixed")),
        {"inflow.hub": {"rate": 0.4}}, outdoors=True),
    Case("inflow_2", P, (climbs(75, 4.0, 14.0, 3.0), swings(60, 8.0, 2.5, 3.4, "fixed")),
        {"inflow": {"blade": 6.0}}, outdoors=True),
    Case("thrust_scale_1", H, (roam(60, 2.0, 1.0, 4.0), eight(60, 2.5, 8.0, 2.0, "fixed")),
        {"thrust_scale": {"error": -0.08}}),
    Case("thrust_scale_2", P, (roam(70, 2.0, 5.0, 10.0), swings(60, 8.0, 2.0, 3.0)),
        {"thrust_scale": {"error": 0.07}}, outdoors=True, imu=True),
    Case("payload_1", H, (roam(80, 1.5, 1.0, 3.5),), {"payload": {"share": 0.1, "time": 36.0}}),
    Case("payload_2", P, (roam(90, 2.0, 5.0, 10.0),), {"payload": {"share": -0.12, "time": 48.0}}, outdoors=True),
    Case("tether_1", P, (climbs(80, 2.0, 15.0, 2.0), roam(70, 0.8, 2.0, 14.0, "fixed")),
        {"tether": {"share": 0.01}}, outdoors=True),
    Case("rotor_fault_1", H, (roam(70, 1.5, 1.0, 3.0), eight(60, 1.5, 7.0, 2.0, "fixed")),
        {"rotor_fault": {"rotor": 2, "loss": 0.17}}, quick=True),
    Case("rotor_fault_2", P, (roam(70, 1.5, 4.0, 8.0), swings(60, 6.0, 2.5, 2.6, "steps")),
        {"rotor_fault": {"rotor": 3, "loss": 0.2}}, outdoors=True, quick=True),
    Case("thrust_curve_1", H, (swings(65, 2.5, 4.0, 2.1, "fixed"), swings(60, 2.5, 4.2, 2.4)),
        {"thrust_curve": {"change": 0.35}}, quick=True),
    Case("thrust_curve_2", P, (swings(65, 3.0, 3.8, 2.3, "fixed"), swings(60, 3.0, 4.0, 2.5)),
        {"thrust_curve": {"change": -0.35}}, quick=True),
    Case("battery_sag_1", P, (roam(110, 1.5, 1.0, 3.5), roam(80, 1.0, 1.0, 3.0, "fixed")),
        {"battery_sag": {"exponent": 1.6}}, source="outputs", endurance_s=250.0),
    Case("motor_lag_1", H, (swings(65, 2.5, 3.0, 2.2), roam(60, 1.5, 1.5, 3.5)), {"motor_lag": {"extra": 0.13}},
        source="outputs"),
    Case("motor_lag_2", P, (swings(65, 3.0, 3.0, 2.4), swings(60, 3.0, 2.8, 2.8, "fixed")),
        {"motor_lag": {"extra": 0.13}}, source="throttle", states_lag=False),
    Case("thrust_tilt_1", H, (roam(60, 1.0, 1.0, 2.0), roam(60, 1.0, 1.0, 3.0, "steps")),
        {"thrust_tilt": {"forward_deg": 2.6, "left_deg": -1.5}}, imu=True),
    Case("thrust_tilt_2", P, (eight(70, 4.0, 12.0, 6.0), roam(60, 1.0, 5.0, 8.0, "steps")),
        {"thrust_tilt": {"forward_deg": -1.8, "left_deg": 2.6}}, outdoors=True),
    Case("imu_bias_1", H, (roam(65, 1.5, 1.0, 3.0), eight(60, 2.0, 7.0, 2.0, "fixed")),
        {"imu_bias": {"x": 0.45, "y": -0.3, "z": 0.35}}, imu=True),
    Case("thrust_map_1", P, (swings(70, 3.0, 3.2, 2.6, "fixed"), swings(60, 3.0, 3.0, 2.8)),
        {"thrust_map": {"slope": -0.22, "offset": 0.16}}, source="throttle"),
    Case("pair_ground_rotor_drag", H, (stairs(75), runs(70, 4.0, "fixed", 3.0)),
        {"ground_effect.images": {"rho": 2.5}, "rotor_drag": {"x": 0.28}}),
    Case("pair_inflow_rotor_drag", H, (climbs(70, 2.0, 10.0, 2.5), eight(65, 4.0, 9.0, 3.0, "fixed")),
        {"inflow.hub": {"rate": 0.35}, "rotor_drag": {"x": 0.28}}),
    Case("pair_scale_body_drag", P, (runs(80, 9.0, "slow", 12.0, 3.0), roam(60, 2.0, 6.0, 12.0)),
        {"thrust_scale": {"error": -0.07}, "body_drag": {"x": 0.017, "y": 0.017, "z": 0.02}}, outdoors=True),
    Case("pair_payload_tilt", H, (roam(90, 1.5, 1.0, 3.0),),
        {"payload": {"share": -0.1, "time": 45.0}, "thrust_tilt": {"forward_deg": 2.4, "left_deg": 1.8}}),
    Case("pair_wind_scale", P, (roam(90, 1.0, 6.0, 12.0), roam(60, 0.8, 7.0, 9.0, "steps")),
        {"wind": {"speed": 6.0, "course_deg": -110.0, "rate": 0.12}, "thrust_scale": {"error": 0.06}}, outdoors=True),
    Case("clean_1", H, (stairs(70), stairs(60, "steps"))),
    Case("clean_2", P, (runs(80, 9.0, "slow", 15.0, 3.0), eight(60, 16.0, 17.0, 10.0, "fixed"))),
    Case("clean_3", P, (climbs(80, 4.0, 15.0, 3.0), roam(60, 1.0, 4.0, 12.0)), outdoors=True),
    Case("clean_4", C, (eight(65, 1.5, 6.0, 1.3), under(60, low=1.8)), ceiling_m=2.4),
    Case("clean_5", H, (roam(70, 3.0, 5.0, 9.0), runs(60, 5.0)), outdoors=True, imu=True),
    Case("clean_6", P, (swings(75, 3.0, 2.8, 2.6),), source="outputs", endurance_s=280.0),
    Case("clean_7", H, (roam(75, 1.5, 1.5, 3.5), swings(55, 2.5, 3.0, 2.5)), source="throttle"),
    Case("clean_8", P, (shakes(65, 1.4, 2.5),), quick=True),
]

L, S, T, B = "cf2x_L250", "cf2x_P250", "cf2x_T350", "cf21B_500"
DRONE_MODELS = [
    Case("ground_effect_1", L, (stairs(70, low=0.9), stairs(55, "steps")), {"ground_effect.images": {"rho": 2.5}}),
    Case("ground_effect_2", B, (stairs(70, low=0.9), stairs(55, "steps")), {"ground_effect.hayden": {"a": 1.5}}),
    Case("ceiling_effect_1", T, (under(70), under(60, "steps")), {"ceiling_effect.sanchez": {"a1": 6.9, "a2": 0.35}},
        ceiling_m=2.2),
    Case("ceiling_effect_2", B, (under(70), under(60, "fixed")), {"ceiling_effect.throttled": {"a": 3.0}},
        ceiling_m=2.5),
    Case("ground_torque_1", T, (shakes(65, 1.4, 2.3), shakes(50, 1.3, 2.1)), {"ground_torque": {"stiffness": 160.0}},
        quick=True),
    Case("rotor_drag_1", L, (eight(65, 1.5, 6.0, 1.3), roam(60, 1.6, 0.8, 1.8)),
        {"rotor_drag.measured": {"size": 1.0}}),
    Case("rotor_drag_2", B, (runs(65, 3.0, "fixed", 1.6, 2.5), eight(60, 2.0, 6.5, 1.6)),
        {"rotor_drag": {"x": 0.34, "y": 0.28}}),
    Case("body_drag_1", B, (runs(70, 4.5, "fixed", 2.0, 3.0), runs(65, 4.0, "slow", 2.0)),
        {"body_drag": {"x": 0.0028, "y": 0.0031, "z": 0.004}}),
    Case("translational_lift_1", T, (runs(70, 4.0, "slow", 2.0), eight(60, 2.8, 6.5, 2.0, "fixed")),
        {"translational_lift": {"blade": 6.0}}),
    Case("rotor_interaction_1", B, (runs(75, 4.0, "fixed", 2.0), eight(60, 3.0, 7.0, 2.0)),
        {"rotor_interaction": {"per_m_s": 0.08}}, quick=True),
    Case("wind_1", S, (roam(65, 0.6, 0.8, 1.6), roam(60, 0.5, 0.7, 1.6, "steps")),
        {"wind": {"speed": 1.9, "course_deg": -20.0, "rate": 0.36}}),
    Case("wind_2", B, (roam(65, 0.6, 0.8, 2.0), roam(60, 0.5, 1.0, 2.0, "steps")),
        {"wind": {"speed": 2.4, "course_deg": 130.0, "area": 0.006}}),
    Case("inflow_1", T, (climbs(70, 0.8, 4.0, 1.8), swings(60, 2.0, 2.5, 2.6, "fixed")), {"inflow": {"blade": 6.0}}),
    Case("inflow_2", B, (climbs(70, 1.0, 5.0, 2.0), climbs(60, 1.0, 4.0, 1.6, "fixed")), {"inflow": {"blade": 7.0}}),
    Case("thrust_scale_1", L, (roam(60, 1.0, 0.7, 1.8), eight(55, 1.2, 6.0, 1.2, "fixed")),
        {"thrust_scale": {"error": 0.07}}),
    Case("thrust_scale_2", B, (roam(60, 1.2, 0.8, 2.0), swings(55, 1.5, 2.0, 2.4)),
        {"thrust_scale": {"error": -0.08}}, imu=True),
    Case("payload_1", T, (roam(75, 1.0, 0.8, 1.8),), {"payload": {"share": 0.1, "time": 33.0}}),
    Case("payload_2", L, (roam(75, 1.0, 0.8, 1.8),), {"payload": {"share": -0.1, "time": 38.0}}, imu=True),
    Case("tether_1", B, (climbs(70, 0.7, 3.8, 1.0), roam(60, 0.6, 0.7, 3.8, "fixed")), {"tether": {"share": 0.035}}),
    Case("rotor_fault_1", T, (roam(70, 1.0, 0.8, 1.8), eight(60, 1.2, 6.5, 1.3, "fixed")),
        {"rotor_fault": {"rotor": 2, "loss": 0.17}}, quick=True),
    Case("rotor_fault_2", B, (roam(70, 1.0, 0.8, 2.0), swings(55, 1.5, 2.0, 2.4, "steps")),
        {"rotor_fault": {"rotor": 4, "loss": 0.18}}, quick=True),
    Case("thrust_curve_1", T, (swings(65, 1.8, 3.5, 2.1, "fixed"), swings(60, 1.8, 3.6, 2.3)),
        {"thrust_curve.measured": {"size": 3.0}}, quick=True),
    Case("thrust_curve_2", B, (swings(65, 1.8, 3.5, 2.1, "fixed"), swings(60, 1.8, 3.6, 2.3)),
        {"thrust_curve": {"change": -0.35}}, quick=True),
    Case("battery_sag_1", B, (roam(110, 1.0, 0.7, 1.9), swings(80, 1.4, 2.0, 2.5, "fixed")),
        {"battery_sag": {"exponent": 1.4}}, source="outputs", endurance_s=270.0),
    Case("motor_lag_1", B, (swings(65, 1.8, 2.8, 2.1), swings(60, 1.8, 2.8, 2.4, "fixed")),
        {"motor_lag": {"extra": 0.12}}, source="outputs"),
    Case("motor_lag_2", T, (swings(65, 1.8, 2.8, 2.1), swings(60, 1.8, 2.8, 2.4, "fixed")),
        {"motor_lag": {"extra": 0.13}}, source="throttle", states_lag=False),
    Case("thrust_tilt_1", L, (roam(60, 0.8, 0.8, 1.6), roam(60, 0.8, 0.8, 1.6, "steps")),
        {"thrust_tilt": {"forward_deg": -2.0, "left_deg": 2.4}}),
    Case("thrust_tilt_2", B, (roam(60, 0.8, 0.8, 1.8), eight(55, 1.2, 6.0, 1.3)),
        {"thrust_tilt": {"forward_deg": 2.6, "left_deg": 1.5}}, imu=True),
    Case("imu_bias_1", T, (roam(65, 1.0, 0.8, 1.8), eight(60, 1.3, 6.0, 1.3, "fixed")),
        {"imu_bias": {"x": 0.45, "y": -0.3, "z": 0.35}}, imu=True),
    Case("thrust_map_1", B, (swings(70, 1.8, 3.2, 2.3, "fixed"), swings(60, 1.8, 3.0, 2.5)),
        {"thrust_map": {"slope": -0.22, "offset": 0.16}}, source="throttle"),
    Case("pair_ground_rotor_drag", B, (stairs(75), eight(60, 1.8, 6.5, 1.5, "fixed")),
        {"ground_effect.images": {"rho": 2.5}, "rotor_drag.measured": {"size": 0.7}}),
    Case("pair_scale_rotor_drag", L, (eight(65, 1.4, 6.0, 1.3), roam(60, 1.6, 0.8, 1.8)),
        {"thrust_scale": {"error": -0.06}, "rotor_drag.measured": {"size": 0.9}}),
    Case("pair_payload_tilt", T, (roam(80, 1.0, 0.8, 1.8),),
        {"payload": {"share": -0.1, "time": 40.0}, "thrust_tilt": {"forward_deg": 2.4, "left_deg": 1.8}}),
    Case("pair_ground_ceiling", T, (stairs(70), under(65)),
        {"ground_effect.images": {"rho": 2.5}, "ceiling_effect.sanchez": {"a1": 6.9, "a2": 0.35}}, ceiling_m=2.2),
    Case("pair_inflow_rotor_drag", B, (climbs(70, 0.8, 4.5, 2.0), eight(60, 1.8, 6.0, 1.6, "fixed")),
        {"inflow": {"blade": 7.0}, "rotor_drag.measured": {"size": 0.7}}),
    Case("clean_1", L, (stairs(70, low=0.9), stairs(60, "steps"))),
    Case("clean_2", B, (runs(75, 4.0, "slow", 2.0), eight(60, 2.5, 6.5, 1.6, "fixed"))),
    Case("clean_3", T, (climbs(70, 0.8, 4.0, 1.8), roam(60, 1.0, 0.8, 3.0))),
    Case("clean_4", S, (eight(65, 1.4, 6.0, 1.3), under(60, low=1.8)), ceiling_m=2.2),
    Case("clean_5", B, (roam(65, 1.5, 0.8, 2.0), eight(55, 1.5, 6.0, 1.4)), imu=True),
    Case("clean_6", B, (swings(75, 1.8, 2.5, 2.4),), source="outputs", endurance_s=280.0),
    Case("clean_7", T, (roam(70, 1.2, 1.0, 2.0), swings(55, 1.6, 2.8, 2.3)), source="throttle"),
    Case("clean_8", T, (shakes(65, 1.4, 2.3),), quick=True),
]
# fmt: on

WORLDS = {"rotorpy": ROTORPY, "drone_models": DRONE_MODELS}
