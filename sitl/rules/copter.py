"""ArduPilot Copter's rules of arming, modes and failsafes, on the same simulated vehicle."""

import enum
import math
from typing import ClassVar

import numpy as np

from quadctl.frames import cos_tilt
from quadctl.sitl.rules.px4 import CRITICAL, SimulatedAutopilot
from quadctl.sitl.rules.static_pressure import COPTER_DEFAULTS, copter_correction_m
from quadctl.sitl.vehicle.inner_loops import PX4, Gains, level_with_yaw
from quadctl.sitl.vehicle.position_loop import AxisGains, PositionLaw
from quadctl.state import AttitudeTarget, Setpoint, Vec3
from quadctl.thrust_chain.ardupilot import angle_boost
from quadctl.thrust_chain.atmosphere import Air, Version, air_density_ratio, atmosphere_of
from quadctl.thrust_chain.chain import Ambient
from quadctl.vehicle import Vehicle

THRUST_AS_THRUST = 8
"""Bit 3 of GUID_OPTIONS: set, the thrust of a target is a thrust; clear, it is a climb rate."""
UNAIDED_S, DISTRUST_S = 8.1, 7.3
"""Times without GPS after which it says "EKF variance" and its own failsafe acts (measured were 8.05 and 8.2 s), and
after which the flags of its estimator tell (7.3 s)."""
MAX_CLIMB_M_S = 2.5
"""Climb rate of a target's thrust of 1 (PILOT_SPEED_UP)."""
STATION_LOST = {1: "RTL", 3: "RTL", 4: "LAND", 5: "LAND", 7: "LAND"}
"""Mode of the failsafe by FS_GCS_ENABLE, which acts when the heartbeats of SYSID_MYGCS stop, and of no other system.
A mode that a pilot flies goes on, as bit 4 of FS_OPTIONS, which is set by default, says."""
REMOTE_LOST = {1: "RTL", 2: "RTL", 3: "LAND", 4: "RTL", 5: "LAND", 6: "RTL", 7: "LAND"}
"""Mode of the failsafe by FS_THR_ENABLE, which acts when the remote control is lost, in GUIDED too."""
FRAME_CLASSES = {4: 1.0, 6: 2.0, 8: 3.0}
"""FRAME_CLASS by number of rotors."""
CLIMBED_M = 0.3
"""Distance to the height of a return within which it counts as reached."""
CONE_SLOPE, CONE_CLIMB_M = 3.0, 2.5
"""Slope of the cone above home that bounds the climb of a return (RTL_CONE_SLOPE), and the climb that older versions
allow in any case (RTL_ABS_MIN_CLIMB); since 4.6 it is RTL_CLIMB_MIN, 0 by default."""
CLIMB_MIN_SINCE: Version = (4, 6)
LAND_PAUSE_S = 4.0
"""Time for which a failsafe's LAND keeps its height first (LAND_WITH_DELAY_MS); a commanded one does not."""
LANE_STEP_M = 0.72
"""Step of the height when its estimator switches to another lane, measured on 4.7-dev."""
AIR = Air(pressure_pa=95598.0, ground_temperature_c=28.16, height_m=0.0, altitude_m=488.1)
"""Air at the take-off place of the recorded flights."""
ANGLE_P, RATE_PI, MAX_INTEGRAL = 4.5, 0.135, 0.5
"""Defaults of ATC_ANG_RLL_P, ATC_RAT_RLL_P and _I, and ATC_RAT_RLL_IMAX, the same for pitch."""
POSITION_LAW = PositionLaw(
    AxisGains(1.0, 2.0, 1.0, 0.5),
    AxisGains(1.0, 5.0, 0.0, 0.0),
    damps_error=True,
    derivative_hz=5.0,
    error_hz=5.0,
    braking_m_s2=5.0,
    lift_p=1.42,
    lift_i=2.84,
    lift_hz=20.0,
    max_tilt_deg=30.0,
)
"""Defaults of PSC_POSXY_P, PSC_VELXY_P, _I, _D, _FLTE and _FLTD, PSC_POSZ_P, PSC_VELZ_P and ANGLE_MAX; PSC_ACCZ_P of
0.5 and PSC_ACCZ_I of 1, in thousandths of the throttle per cm/s^2, over a throttle of hover of 0.345 per g."""
NOT_ARMABLE = ("LAND", "RTL", "BRAKE")


class Guided(enum.Enum):
    """Activity of GUIDED mode, which obeys the last command or target."""

    PLACE = "holds its place"
    TAKE_OFF = "takes off"
    TARGETS = "follows attitude targets"
    PLACES = "follows position targets"
    LEVEL = "levels and holds its height"


class SimulatedCopter(SimulatedAutopilot):
    """An ArduPilot Copter in its defaults, at rest on the ground at the origin, disarmed, in STABILIZE."""

    name: ClassVar[str] = "ArduPilot"
    version: ClassVar[Version] = (4, 5)
    modes: ClassVar[tuple[str, ...]] = ("STABILIZE", "GUIDED", "LAND", "RTL", "BRAKE", "LOITER")
    first_mode: ClassVar[str] = "STABILIZE"
    offboard_mode: ClassVar[str] = "GUIDED"
    position_law: ClassVar[PositionLaw] = POSITION_LAW
    aid_timeout_s: ClassVar[float] = 0.4  # by GPS_RAW_INT.fix_type, as measured
    station_parameter: ClassVar[str] = "SYSID_MYGCS"
    """Parameter with the id of the ground station whose heartbeats it watches."""
    return_parameter: ClassVar[str] = "RTL_ALT"
    """Parameter with the height of a return, in cm, or in m where its name ends so."""
    default_parameters: ClassVar[dict[str, float]] = {
        "GUID_OPTIONS": 0.0,
        "GUID_TIMEOUT": 3.0,
        "DISARM_DELAY": 10.0,
        "LAND_SPEED": 50.0,
        "FS_GCS_ENABLE": 0.0,
        "FS_GCS_TIMEOUT": 5.0,
        "SYSID_MYGCS": 255.0,
        "FS_THR_ENABLE": 1.0,
        "FS_EKF_ACTION": 1.0,
        "RTL_ALT": 1500.0,
        "ARMING_CHECK": 1.0,
        "MOT_THST_HOVER": 0.5,
        "ATC_ANGLE_BOOST": 1.0,
        "ATC_RATE_R_MAX": 0.0,
        "ATC_RATE_P_MAX": 0.0,
        "MOT_THST_EXPO": 0.65,
        "MOT_SPIN_MIN": 0.15,
        "MOT_SPIN_MAX": 0.95,
        "MOT_BAT_VOLT_MAX": 16.8,
        "MOT_BAT_VOLT_MIN": 13.2,
        **COPTER_DEFAULTS,
    }

    guided = Guided.PLACE
    _taken_off = False
    """True after a take-off by command."""
    _internal_error = False
    stick_neutral = True
    """False: the throttle stick of its remote control is off neutral."""
    _climbs = False
    """True while a return climbs."""
    _pause_until_s = -math.inf
    """Time until which its LAND keeps the height."""
    _station_heard_s: float | None = None
    """Time of the last heartbeat of the ground station; its failsafe acts only after the first."""

    def hear_heartbeat(self, system_id: int) -> None:
        if system_id == int(self.parameters[self.station_parameter]):
            self._station_heard_s = self.time_s

    def baro_correction_m(self, over_ground_m_s: Vec3, through_air_m_s: Vec3) -> float:
        """By the velocity over ground: without EK3_DRAG_BCOEF it estimates no wind."""
        return copter_correction_m(self.parameters, over_ground_m_s)

    def gains(self, vehicle: Vehicle) -> Gains:
        """Gains for this vehicle: the rate loop's output 1 moves the outermost rotors by half of their thrust."""
        arms = np.abs([arm[:2] for arm in vehicle.moment_arms_m])
        torque_nm = 0.5 * vehicle.throttle.max_thrust_per_rotor_n * np.sum(arms**2, axis=0) / np.max(arms, axis=0)
        roll, pitch = (float(size) for size in torque_nm / vehicle.principal_inertia_kg_m2[:2])
        return Gains(
            (ANGLE_P, ANGLE_P, PX4.attitude_p[2]),
            (RATE_PI * roll, RATE_PI * pitch, PX4.rate_p[2]),
            (RATE_PI * roll, RATE_PI * pitch, PX4.rate_i[2]),
            MAX_INTEGRAL * max(roll, pitch),
        )

    def rotor_parameters(self, vehicle: Vehicle) -> dict[str, float]:
        """Number of the frame: it does not know the axes of rotors."""
        return {"FRAME_CLASS": FRAME_CLASSES.get(vehicle.n_rotors, 0.0)}

    def set_attitude_target(self, target: AttitudeTarget) -> None:
        super().set_attitude_target(target)
        if self.mode == "GUIDED" and self.armed:  # also in the middle of a take-off, which that ends
            self.guided = Guided.TARGETS

    def set_position_target(self, setpoint: Setpoint) -> None:
        super().set_position_target(setpoint)
        if self.mode == "GUIDED" and self.armed:
            self.guided = Guided.PLACES

    @property
    def ambient(self) -> Ambient:
        """Battery and air as the compensations of the motor outputs see them."""
        atmosphere = atmosphere_of(self.version, is_standard=True)
        return Ambient(self.body.battery.resting_v, air_density_ratio(AIR, atmosphere), atmosphere=atmosphere)

    def request_take_off(self, height_m: float) -> str | None:
        if not (self.armed and self.mode == "GUIDED" and self.landed and height_m > 0.0):
            return "Take-off needs GUIDED, armed, on the ground"
        x, y, z = self.body.position
        self._anchor = (x, y, z - height_m)
        self.guided, self._taken_off = Guided.TAKE_OFF, True
        return None

    def _say_disarmed(self) -> None:
        """Nothing: its heartbeats tell."""

    def fail_battery(self) -> None:
        """Let the battery fail, with BATT_FS_LOW_ACT 1 (Land)."""
        self.said.append((CRITICAL, f"Battery 1 is low {self.estimator.battery_v:.2f}V used 0 mAh"))
        self._fail_to("LAND")

    def lose_remote(self) -> None:
        """Lose the remote control."""
        self.remote = False
        mode = REMOTE_LOST.get(int(self.parameters["FS_THR_ENABLE"]))
        if self.armed and mode is not None:
            self.said.append((CRITICAL, "Radio Failsafe"))
            self._fail_to(mode)

    def switch_lane(self) -> None:
        """Let the estimator switch to another lane: the height that it tells steps."""
        self.said.append((CRITICAL, "EKF3 lane switch 1"))
        self.estimator.height_step_m += LANE_STEP_M

    def _fail_to(self, mode: str) -> None:
        """Enter the mode of a failsafe."""
        if mode == "LAND" and self.mode != "LAND":
            self._pause_until_s = self.time_s + LAND_PAUSE_S
        self._enter(mode)

    def _objection_before_arming(self) -> str | None:
        if self.time_s < self.ready_after_s:
            if not self._checks_off:
                return "PreArm: EKF attitude is bad"
            return "Arm: Need Position Estimate" if self.mode == "GUIDED" else None  # it insists on that
        return "PreArm: Internal errors 0x4000000" if self._internal_error else None

    def _objection_to_arming(self) -> str | None:
        problem = self._objection_before_arming()
        if problem is not None:
            return problem
        if not self.stick_neutral:
            return "Arm: Throttle (RC3) is not neutral"
        return f"Arm: {self.mode.title()} mode not armable" if self.mode in NOT_ARMABLE else None

    def _objection_to_mode(self, mode: str) -> str | None:
        return None

    @property
    def _follows_targets(self) -> bool:
        return self.mode == "GUIDED" and self.guided is Guided.TARGETS

    @property
    def _active(self) -> AttitudeTarget:
        if not self._follows_targets:  # its own modes compute the thrust that they need at a tilt
            return self._own_target
        attitude, throttle, lateral = self.target
        throttle = min(throttle * angle_boost(cos_tilt(self.body.attitude), self.parameters), 1.0)
        if not int(self.parameters["GUID_OPTIONS"]) & THRUST_AS_THRUST:
            climb_m_s = (2.0 * throttle - 1.0) * MAX_CLIMB_M_S
            grounded = self.landed and climb_m_s <= 0.0
            throttle = 0.0 if grounded else self._throttle(attitude, -climb_m_s)
        return AttitudeTarget(attitude, throttle, lateral)

    def _obey_rules(self) -> None:
        super()._obey_rules()
        heard_s, mode = self._station_heard_s, STATION_LOST.get(int(self.parameters["FS_GCS_ENABLE"]))
        lost = heard_s is not None and self.time_s - heard_s > self.parameters["FS_GCS_TIMEOUT"]
        if lost and mode is not None and self.armed and self.mode in ("GUIDED", "BRAKE"):
            self._fail_to(mode)

        place = self._place
        if place is not None and self.time_s - self._target_s > self.parameters["GUID_TIMEOUT"]:
            self._place = Setpoint(place.position_ned_m, yaw_rad=place.yaw_rad)  # it stays where that was

        acts = self.armed and self.parameters["FS_EKF_ACTION"] and self.mode not in ("STABILIZE", "LAND")
        if acts and self.estimator.unaided_s(self.time_s) > UNAIDED_S:
            self.said.append((CRITICAL, "EKF variance"))
            self._fail_to("LAND")

    @property
    def _trusts_estimate(self) -> bool:
        return self.time_s >= self.ready_after_s and self.estimator.unaided_s(self.time_s) <= DISTRUST_S

    @property
    def _checks_off(self) -> bool:
        return self.parameters["ARMING_CHECK"] == 0.0

    def power_cycle(self) -> None:
        super().power_cycle()
        self._station_heard_s = None

    def _watch_targets(self, silence_s: float) -> None:
        if not self.landed and not self._taken_off:
            self._internal_error = True  # lifted off by targets: what the real one does not forgive
        if silence_s > self.parameters["GUID_TIMEOUT"]:
            self._anchor = self.body.position
            self.guided = Guided.LEVEL

    def _enter(self, mode: str) -> None:
        if mode != self.mode:
            self.guided = Guided.PLACE
            self._climbs = mode == "RTL"
        super()._enter(mode)
        if self._climbs:
            north, east, _ = self.body.position
            self._anchor = (north, east, -self._return_height_m)

    @property
    def _return_height_m(self) -> float:
        """Height of a return from here, bounded by a cone above home.

        Source: `ModeRTL::compute_return_target`, `build_path` before 4.6.
        """
        x, y, z = self.body.position
        unit_m = 1.0 if self.return_parameter.endswith("_M") else 0.01
        least_m = -z + (CONE_CLIMB_M if self.version < CLIMB_MIN_SINCE else 0.0)
        cone_m = max(CONE_SLOPE * math.hypot(x, y), least_m)
        return max(min(unit_m * self.parameters[self.return_parameter], cone_m), -z)

    @property
    def _has_climbed(self) -> bool:
        """True once a return has climbed on the spot as far as it wants to; then it goes home, and down."""
        if self._climbs and self.body.position[2] <= self._anchor[2] + CLIMBED_M:
            self._climbs, self._anchor = False, (0.0, 0.0, self._anchor[2])
        return not self._climbs

    @property
    def _disarm_after_s(self) -> float:
        # On the ground after a landing in a mode that lands, at once; in any other, after DISARM_DELAY.
        return 0.5 if self._flown and self.mode in ("LAND", "RTL") else self.parameters["DISARM_DELAY"]

    def _after_disarming(self) -> None:
        self.guided = Guided.PLACE
        self._taken_off = False

    @property
    def _stands(self) -> bool:
        return self.landed and self.guided is not Guided.TAKE_OFF

    @property
    def _land_speed_m_s(self) -> float:
        return 0.01 * self.parameters["LAND_SPEED"]

    @property
    def _lands(self) -> bool:
        return super()._lands and self.time_s >= self._pause_until_s

    def _position_control(self) -> AttitudeTarget:
        if self.guided is Guided.PLACES and self._place is not None:
            return self._position_loop.target(self._place, self.estimator)
        own = super()._position_control()
        if self.guided is Guided.LEVEL:
            return own._replace(attitude=level_with_yaw(self.body.attitude))
        return own


class SimulatedCopter47(SimulatedCopter):
    """A Copter 4.7, which has renamed the parameters of the ground station's id and of the return's height."""

    version: ClassVar[Version] = (4, 7)
    station_parameter: ClassVar[str] = "MAV_GCS_SYSID"
    return_parameter: ClassVar[str] = "RTL_ALT_M"
    default_parameters: ClassVar[dict[str, float]] = {
        name: value
        for name, value in SimulatedCopter.default_parameters.items()
        if name not in ("SYSID_MYGCS", "RTL_ALT")
    } | {"MAV_GCS_SYSID": 255.0, "RTL_ALT_M": 15.0}
