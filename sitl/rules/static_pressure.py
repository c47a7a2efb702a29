"""Corrections of the barometer's height for its static pressure error by the parameters of each firmware."""

from collections.abc import Mapping

from quadctl.frames import GRAVITY_M_S2
from quadctl.state import Vec3

PX4_DEFAULTS = {
    "EKF2_PCOEF_XP": 0.0,
    "EKF2_PCOEF_XN": 0.0,
    "EKF2_PCOEF_YP": 0.0,
    "EKF2_PCOEF_YN": 0.0,
    "EKF2_PCOEF_Z": 0.0,
    "EKF2_ASPD_MAX": 20.0,
    "EKF2_DRAG_CTRL": 0.0,
}
COPTER_DEFAULTS = {f"BARO1_WCF_{name}": 0.0 for name in ("ENABLE", "FWD", "BCK", "RGT", "LFT", "UP", "DN")}
_PX4_SIDES = (("XP", "XN"), ("YP", "YN"), ("Z", "Z"))
_COPTER_SIDES = (("FWD", "BCK"), ("RGT", "LFT"), ("UP", "DN"))


def px4_correction_m(parameters: Mapping[str, float], through_air_m_s: Vec3) -> float:
    """Height that EKF2 adds to the barometer's, by the velocity through the air, FRD.

    Ekf::compensateBaroForDynamicPressure: only while a wind is estimated, which a multirotor's drag tells.
    """
    if not parameters["EKF2_DRAG_CTRL"]:
        return 0.0
    most = parameters["EKF2_ASPD_MAX"] ** 2
    total = sum(
        parameters[f"EKF2_PCOEF_{ahead if speed >= 0.0 else behind}"] * min(speed * speed, most)
        for (ahead, behind), speed in zip(_PX4_SIDES, through_air_m_s, strict=True)
    )
    return total / (2.0 * GRAVITY_M_S2)


def copter_correction_m(parameters: Mapping[str, float], velocity_m_s: Vec3) -> float:
    """Height that ArduPilot adds to the barometer's, by the velocity that it takes for that through the air, FRD.

    AP_Baro::wind_pressure_correction, whose UP acts where the vehicle descends.
    """
    if not parameters["BARO1_WCF_ENABLE"]:
        return 0.0
    total = sum(
        parameters[f"BARO1_WCF_{ahead if speed > 0.0 else behind}"] * speed * speed
        for (ahead, behind), speed in zip(_COPTER_SIDES, velocity_m_s, strict=True)
    )
    return total / (2.0 * GRAVITY_M_S2)
