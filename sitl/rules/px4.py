"""The simulated autopilot: PX4's rules of arming, modes and failsafes around inner loops, estimator and body.

It runs in simulated time: `step(until_s)` advances it. `run.py` drives it as fast as the machine can, `server/` in
real time over MAVLink. `copter.py` has ArduPilot's rules instead.
"""

import math
from collections import deque
from typing import ClassVar, NamedTuple

from quadctl.errors import SettingsError
from quadctl.frames import GRAVITY_M_S2, multiply, quaternion_from_euler, rotate
from quadctl.sitl.rules.static_pressure import PX4_DEFAULTS, px4_correction_m
from quadctl.sitl.vehicle.body import STEP_S, SimulatedBody
from quadctl.sitl.vehicle.estimator import Estimator
from quadctl.sitl.vehicle.hidden import HiddenTruth, height_sensors, true_model
from quadctl.sitl.vehicle.inner_loops import PX4, Gains, InnerLoops, level_with_yaw
from quadctl.sitl.vehicle.position_loop import AxisGains, PositionLaw, PositionLoop
from quadctl.state import NAN, AttitudeTarget, Quat, Setpoint, Vec3, VehicleState
from quadctl.vehicle import Vehicle

STREAM_AGE_S = 0.5
"""Largest age of the last setpoint when offboard is entered: PX4 wants 2 Hz or more."""
BATTERY_HOLD_S = 5.0
"""Time for which it holds its place before it lands with a failed battery (COM_FAIL_ACT_T)."""
REMOTE_LOST = {1: "HOLD", 2: "RTL", 3: "LAND"}
"""Mode of the failsafe by NAV_RCL_ACT, when the remote control is lost."""
TARGETS_LOST = {0: "POSCTL", 1: "POSCTL", 2: "POSCTL", 3: "RTL", 4: "LAND", 5: "HOLD"}
"""Mode of the failsafe by COM_OBL_RC_ACT, when targets stop; of the modes of a pilot it simulates one."""
EXCEPT_OFFBOARD = 4
"""Bit of COM_RCL_EXCEPT: offboard goes on without a remote control."""
CRITICAL, INFO = 2, 6
"""MAV_SEVERITY of its texts."""
LEVEL: Quat = (1.0, 0.0, 0.0, 0.0)
POSITION_LAW = PositionLaw(
    AxisGains(0.95, 1.8, 0.4, 0.2), AxisGains(1.0, 4.0, 2.0, 0.0), damps_error=False, derivative_hz=5.0
)
"""Defaults of MPC_XY_P, MPC_XY_VEL_P_ACC, _I_ACC and _D_ACC, the same for Z, MPC_VELD_LP and MPC_TILTMAX_AIR."""


class MotorTest(NamedTuple):
    """A motor test: one rotor runs until a time."""

    rotor: int
    output: float
    until_s: float


class SimulatedAutopilot:
    """A PX4-like autopilot on a simulated vehicle, at rest on the ground at the origin, disarmed, in HOLD."""

    name: ClassVar[str] = "PX4"
    modes: ClassVar[tuple[str, ...]] = ("HOLD", "OFFBOARD", "LAND", "RTL", "POSCTL")
    first_mode: ClassVar[str] = "HOLD"
    offboard_mode: ClassVar[str] = "OFFBOARD"
    position_law: ClassVar[PositionLaw] = POSITION_LAW
    aid_timeout_s: ClassVar[float] = math.inf
    """Time without GPS or motion capture after which it says that those have failed; inf: it never does."""
    default_parameters: ClassVar[dict[str, float]] = {
        "COM_OF_LOSS_T": 1.0,
        "COM_OBL_RC_ACT": 3.0,  # by default 0, which without a remote control ends in the same return
        "RTL_RETURN_ALT": 30.0,
        "COM_DISARM_LAND": 2.0,
        "COM_DISARM_PRFLT": 10.0,
        "MPC_LAND_SPEED": 0.7,
        "EKF2_NOAID_TOUT": 5e6,
        "NAV_RCL_ACT": 2.0,
        "COM_RC_IN_MODE": 3.0,
        "COM_RC_OVERRIDE": 1.0,
        "COM_LOW_BAT_ACT": 0.0,
        "COM_RCL_EXCEPT": 0.0,
        "MPC_THR_HOVER": 0.5,
        "THR_MDL_FAC": 0.0,
        "MC_BAT_SCALE_EN": 0.0,
        "MC_AIRMODE": 0.0,
        "MC_ROLLRATE_MAX": 220.0,
        "MC_PITCHRATE_MAX": 220.0,
        **PX4_DEFAULTS,
    }

    def __init__(self, vehicle: Vehicle, truth: HiddenTruth | None = None, seed: int = 0, source: str = "") -> None:
        truth = truth or HiddenTruth()
        self.vehicle = vehicle
        world = true_model(vehicle, truth, source)
        self.body = SimulatedBody(world, ground=truth.ground)
        sensors = height_sensors(vehicle, truth, world, source, seed)
        if sensors is not None:
            sensors.correction = self.baro_correction_m
        self.estimator = Estimator(truth.noise, truth.telemetry, seed, sensors)
        self.loops = InnerLoops(vehicle, truth.autopilot.attitude, self.gains(vehicle))
        self.mode = self.first_mode
        self.armed = False
        self.landed = True
        self.ready_after_s = truth.autopilot.ready_after_s
        self._climb_m_s = truth.autopilot.climb_m_s
        """Time after boot at which it lets itself be armed; real ones need up to 40 s."""
        self.parameters = self._parameters(vehicle, truth.autopilot.parameters, source)
        self.target = AttitudeTarget(LEVEL, 0.0)
        self._own_target = AttitudeTarget(LEVEL, 0.0)
        self._place: Setpoint | None = None
        """Position target that is followed; None: the last target was an attitude."""
        self._position_loop = PositionLoop(self.position_law, vehicle)
        self.outputs = [0.0] * vehicle.n_rotors
        self._rate_sp: Vec3 = (0.0, 0.0, 0.0)
        self._target_s = -math.inf
        self._armed_s = -math.inf
        self._on_ground_s = 0.0
        self._flown = False
        self._anchor: Vec3 = (0.0, 0.0, 0.0)
        self._sink_integral_m_s2 = 0.0
        self._steps = 0
        self._motor_test = MotorTest(0, 0.0, -math.inf)
        self._battery_failed_s: float | None = None
        self.remote = True
        """False: there is no remote control."""
        self.battery_remaining = 1.0
        """Share of the battery's charge that remains, as it is told."""
        self.battery_alarm = ""
        """Charge state of the battery as it is told, where it is critical or worse."""
        self.said: deque[tuple[int, str]] = deque()
        """Texts that it has to say, with their MAV_SEVERITY; taken by whoever sends them."""
        self.estimator.observe(self.body.motion())

    def baro_correction_m(self, over_ground_m_s: Vec3, through_air_m_s: Vec3) -> float:
        """Height that it adds to the barometer's, by velocities along the body, FRD; its wind is the true one."""
        return px4_correction_m(self.parameters, through_air_m_s)

    def gains(self, vehicle: Vehicle) -> Gains:
        """Gains of its attitude and rate loops."""
        return PX4

    def _parameters(self, vehicle: Vehicle, changes: dict[str, float], source: str) -> dict[str, float]:
        """Default parameters with changes; raises SettingsError for a parameter that it does not have."""
        own = self.default_parameters | self.rotor_parameters(vehicle)
        if unknown := sorted(changes.keys() - own.keys()):
            raise SettingsError(f"{source}: autopilot.parameters: the simulated {self.name} has no {unknown[0]}")
        return own | changes

    def rotor_parameters(self, vehicle: Vehicle) -> dict[str, float]:
        """Parameters of the control allocation, for a vehicle that is set up as its file says."""
        axes = {
            f"CA_ROTOR{i}_A{axis}": value
            for i, rotor in enumerate(vehicle.rotors)
            for axis, value in zip("XYZ", rotor.axis, strict=True)
        }
        return {"CA_AIRFRAME": 0.0, "CA_ROTOR_COUNT": float(vehicle.n_rotors), **axes}

    @property
    def time_s(self) -> float:
        return self._steps * STEP_S

    # --- requests ----------------------------------------------------------------------------------------------

    def set_attitude_target(self, target: AttitudeTarget) -> None:
        """Take in a setpoint that arrives now."""
        self.target = target
        self._place = None
        self._target_s = self.time_s

    def set_position_target(self, setpoint: Setpoint) -> None:
        """Take in a setpoint of position, velocity, acceleration and yaw that arrives now.

        It is what SET_POSITION_TARGET_LOCAL_NED asks for: the autopilot's own position control flies it.
        """
        if self._place is None:
            self._position_loop.start()
        self._place = setpoint
        self._target_s = self.time_s

    def hear_heartbeat(self, system_id: int) -> None:
        """Take in a heartbeat of another system; this autopilot watches the targets instead."""

    def request_checks(self) -> str | None:
        """Run the checks before arming, and say what is wrong."""
        problem = self._objection_before_arming()
        if problem is not None:
            self.said.append((CRITICAL, problem))
        return None

    def request_arm(self) -> str | None:
        """Arm; None when accepted, else the reason for the refusal."""
        refusal = self._objection_to_arming()
        if refusal is None and not self.armed:
            self.armed, self._armed_s, self._flown = True, self.time_s, False
            self.loops.reset()
        return refusal

    def request_take_off(self, height_m: float) -> str | None:
        """Refuse to take off by command: here the targets of offboard lift the vehicle off."""
        del height_m
        return "take-off by command is not simulated"

    def request_disarm(self) -> str | None:
        if self.armed and not self.landed:
            return "the vehicle is not landed"
        self._disarm()
        return None

    def force_disarm(self) -> None:
        """Disarm whatever it does, by a ground station's command."""
        self._say_disarmed()
        self._disarm()

    def _say_disarmed(self) -> None:
        self.said.append((INFO, "Disarmed by external command"))

    def request_motor_test(self, rotor: int, output: float, seconds: float) -> str | None:
        """Run one rotor (from 0) at a motor output for a time, 0 to stop, on a vehicle that is fixed to a stand."""
        if self.armed or not self.landed:
            return "Motor Test: vehicle not landed and disarmed"
        if not 0 <= rotor < self.vehicle.n_rotors:
            return "Motor Test: no such motor"
        self._motor_test = MotorTest(rotor, output, self.time_s + seconds)
        return None

    def request_mode(self, mode: str) -> str | None:
        refusal = self._objection_to_mode(mode) if mode in self.modes else f"there is no mode {mode}"
        if refusal is None and not self._stays(mode):
            self._enter(mode)
        return refusal

    def _stays(self, mode: str) -> bool:
        """True when it accepts a mode and does not enter it: offboard, on the ground, with an empty battery."""
        return mode == "OFFBOARD" and not self.armed and bool(self.battery_alarm)

    def lose_position_aid(self) -> None:
        """Lose GPS or motion capture: from now on the estimate of the position is dead reckoning."""
        self.estimator.aid_lost_s = self.time_s

    def fail_battery(self) -> None:
        """Let the battery fail."""
        self.said.append((CRITICAL, "Battery failure"))
        self._battery_failed_s = self.time_s
        self._enter("HOLD")

    def lose_remote(self) -> None:
        """Lose the remote control."""
        self.remote = False
        excepted = self.mode == "OFFBOARD" and int(self.parameters["COM_RCL_EXCEPT"]) & EXCEPT_OFFBOARD
        mode = REMOTE_LOST.get(int(self.parameters["NAV_RCL_ACT"]))
        if self.armed and mode is not None and not excepted:
            self._enter(mode)

    def power_cycle(self) -> None:
        """Restart after a loss of power: motors off, in the mode of a fresh start."""
        self._disarm()
        self._enter(self.first_mode)

    # --- time --------------------------------------------------------------------------------------------------

    def step(self, until_s: float) -> None:
        """Advance to `until_s` in steps of the physics."""
        steps, body, motor_outputs = round(until_s / STEP_S), self.body, self.loops.motor_outputs
        while self._steps < steps:
            if self._steps * STEP_S < self._motor_test.until_s:
                body.step_on_stand(self._motor_test.rotor, self._motor_test.output)
                self._end_step()
                continue
            self._obey_rules()
            if self._steps % 2 == 0:  # attitude loop at 250 Hz, rate loop at 500 Hz
                self._attitude_loop()
            throttle, lateral = 0.0, None
            if self.armed:
                _, throttle, lateral = self._active
            airborne = not body.in_contact
            self.outputs = motor_outputs(self._rate_sp, body.rates, throttle, STEP_S, airborne, lateral)
            body.step(self.outputs, self.armed)
            self._end_step()

    def _end_step(self) -> None:
        self._steps += 1
        self.body.time_s = self._steps * STEP_S
        self.estimator.observe(self.body.motion())

    def estimate(self) -> VehicleState:
        """State estimate at this time."""
        e = self.estimator
        now = self.time_s
        return VehicleState(
            time_s=now,
            position_ned_m=e.position,
            velocity_ned_m_s=e.velocity,
            attitude=e.attitude,
            rates_rad_s=e.rates,
            rotor_rpm=e.rotor_rpm,
            motor_current_a=self.body.motor_current_a(e.rotor_rpm),
            motor_output=tuple(self.outputs),
            battery_v=e.battery_v,
            battery_remaining=self.battery_remaining,
            battery_alarm=self.battery_alarm,
            remote=self.remote,
            armed=self.armed,
            landed=self.landed,
            mode=self.mode,
            offboard_mode=self.offboard_mode,
            ready_to_arm=self._objection_before_arming() is None,
            checks_off=self._checks_off,
            estimator_ok=self._trusts_estimate,
            horizontal_std_m=e.horizontal_std_m,
            vertical_std_m=e.vertical_std_m,
            baro_m=NAN if e.height_sensors is None else e.height_sensors.baro_m,
            range_m=NAN if e.height_sensors is None else e.height_sensors.range_m,
            aid_lost=e.unaided_s(now) > self.aid_timeout_s,
            connected=True,
            received_s={
                "position": e.updated_s,
                "attitude": e.updated_s,
                "rates": e.updated_s,
                "rpm": e.rpm_updated_s,
                "battery": e.rpm_updated_s,
                "heartbeat": now,
            },
        )

    # --- inside ------------------------------------------------------------------------------------------------

    @property
    def _trusts_estimate(self) -> bool:
        """False once dead reckoning has lasted for longer than the estimator trusts it."""
        return self.estimator.unaided_s(self.time_s) <= 1e-6 * self.parameters["EKF2_NOAID_TOUT"]

    @property
    def _checks_off(self) -> bool:
        """True when its checks before arming are switched off."""
        return False

    @property
    def _streaming(self) -> bool:
        return self.time_s - self._target_s < STREAM_AGE_S

    def _objection_before_arming(self) -> str | None:
        """Reason why its own checks do not pass: those of the present mode, in which offboard needs setpoints."""
        return None if self.armed else self._objection_to_arming()

    def _objection_to_arming(self) -> str | None:
        if self.time_s < self.ready_after_s:
            return "Preflight Fail: ekf2 missing data"
        return self._lacking_targets(self.mode)

    def _objection_to_mode(self, mode: str) -> str | None:
        """Reason against a mode; on the ground, disarmed, PX4 accepts offboard without setpoints."""
        return self._lacking_targets(mode) if self.armed else None

    def _lacking_targets(self, mode: str) -> str | None:
        return "no offboard setpoints are arriving" if mode == "OFFBOARD" and not self._streaming else None

    @property
    def _follows_targets(self) -> bool:
        return self.mode == self.offboard_mode

    @property
    def _active(self) -> AttitudeTarget:
        """The companion's target while that is followed, the autopilot's own otherwise."""
        return self.target if self._follows_targets else self._own_target

    def _attitude_loop(self) -> None:
        if not self._follows_targets:
            target = self._own_target = self._position_control()
        else:
            if self._place is not None:
                self.target = self._position_loop.target(self._place, self.estimator)
            target = self.target
        self._rate_sp = self.loops.rate_setpoint(target.attitude, self.body.attitude, not self.body.in_contact)

    def _obey_rules(self) -> None:
        now = self.time_s
        failed_s = self._battery_failed_s
        if failed_s is not None and self.armed and self.mode == "HOLD" and now - failed_s > BATTERY_HOLD_S:
            self._enter("LAND")
        in_contact = self.body.in_contact
        if not in_contact or (self.armed and self._active.throttle > 0.6 * self._hover_throttle):
            self._on_ground_s = now
            if not in_contact and self.body.position[2] < -0.1:
                self._flown, self.landed = True, False
        elif now - self._on_ground_s > 0.3:
            self.landed = True
        if self._follows_targets:
            self._watch_targets(now - self._target_s)
        if self.armed and self.landed and now - max(self._on_ground_s, self._armed_s) > self._disarm_after_s:
            self._disarm()

    def _watch_targets(self, silence_s: float) -> None:
        """Apply the failsafe for a companion that has fallen silent."""
        if self.armed and silence_s > self.parameters["COM_OF_LOSS_T"]:
            mode = TARGETS_LOST[int(self.parameters["COM_OBL_RC_ACT"])]
            self._enter("RTL" if mode == "POSCTL" and not self.remote else mode)

    @property
    def _disarm_after_s(self) -> float:
        """Time on the ground after which it disarms, s."""
        return self.parameters["COM_DISARM_LAND" if self._flown else "COM_DISARM_PRFLT"]

    def _enter(self, mode: str) -> None:
        if mode != self.mode:
            self.mode = mode
            home = mode == "RTL"
            x, y, z = self.body.position
            self._anchor = (0.0, 0.0, z) if home else (x, y, z)

    def _disarm(self) -> None:
        self.armed = False
        self._on_ground_s = self.time_s
        self._after_disarming()

    def _after_disarming(self) -> None:
        if self.mode in ("LAND", "RTL"):
            self.mode = "HOLD"

    @property
    def _hover_throttle(self) -> float:
        return self.vehicle.hover_throttle

    @property
    def _stands(self) -> bool:
        """True on the ground, in a mode that does not ask for lift-off."""
        return self.mode == "HOLD" and self.landed

    @property
    def _has_climbed(self) -> bool:
        """True once a return has climbed as far as it wants to: here it keeps its height."""
        return True

    @property
    def _lands(self) -> bool:
        """True in a mode that descends on the spot."""
        return self.mode == "LAND"

    @property
    def _land_speed_m_s(self) -> float:
        return self.parameters["MPC_LAND_SPEED"]

    def _position_control(self) -> AttitudeTarget:
        """Target of the autopilot's own modes, which hold the anchor or land on it: a slow PD on the true state."""
        level = level_with_yaw(self.body.attitude)
        if not self.armed or self._stands:
            return AttitudeTarget(level, 0.0)
        x, y, z = self.body.position
        vx, vy, vz = self.body.velocity
        ax, ay, az = self._anchor
        returned = self.mode == "RTL" and self._has_climbed and math.hypot(x - ax, y - ay) < 0.3
        landing = self._lands or returned
        sink = self._land_speed_m_s if landing else min(max(az - z, -self._climb_m_s), 1.0)
        if landing and self.body.in_contact:
            return AttitudeTarget(level, 0.0)
        # Without an integrator a strong ground effect would carry the vehicle for ever.
        integral = self._sink_integral_m_s2 + 1.5 * (sink - vz) * 2.0 * STEP_S if landing else 0.0
        self._sink_integral_m_s2 = min(max(integral, -3.0), 6.0)
        north = min(max(1.2 * (ax - x) - 1.6 * vx, -3.0), 3.0)
        east = min(max(1.2 * (ay - y) - 1.6 * vy, -3.0), 3.0)
        yaw = 2.0 * math.atan2(level[3], level[0])
        forward, right = math.cos(yaw) * north + math.sin(yaw) * east, math.cos(yaw) * east - math.sin(yaw) * north
        pitch, roll = -math.atan2(forward, GRAVITY_M_S2), math.atan2(right, GRAVITY_M_S2)
        attitude = multiply(level, quaternion_from_euler(roll, pitch, 0.0))
        return AttitudeTarget(attitude, self._throttle(attitude, sink, self._sink_integral_m_s2))

    def _throttle(self, attitude: Quat, sink_m_s: float, integral_m_s2: float = 0.0) -> float:
        """Throttle that brings the vehicle to the vertical speed `sink_m_s`, down."""
        up = rotate(attitude, (0.0, 0.0, -1.0))[2]
        error_m_s = sink_m_s - self.body.velocity[2]
        thrust = self.vehicle.mass_kg * (GRAVITY_M_S2 - 3.0 * error_m_s - integral_m_s2) / max(-up, 0.5)
        curve = self.vehicle.throttle
        throttle: float = min(max(curve.offset + curve.per_newton * thrust, 0.1), 0.9)
        return throttle
