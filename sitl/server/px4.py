"""A PX4 on the wire, as measured on its onboard link: the messages that it sends by itself, and its refusals."""

import math
from dataclasses import replace

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from quadctl.sitl.rules.px4 import SimulatedAutopilot
from quadctl.sitl.server import dialect, messages
from quadctl.sitl.server.manners import Manners, Stream
from quadctl.sitl.server.server import MavlinkMock
from quadctl.state import VehicleState

MAX_INTEGRAL_RAD_S2 = 60.0
"""Limit of the rate integrals, that of a PX4 (MC_RR_INT_LIM 0.3): with one of four motors at half thrust it hovers."""
CHECKED_S = 0.5
"""Time from entering offboard, disarmed, to the check of that mode; until then it counts as failed."""
TOLD_S = 0.028
"""Time after which SYS_STATUS tells so, before CURRENT_MODE tells the mode."""


class MavlinkPx4(MavlinkMock):
    """A PX4 on UDP."""

    rules = SimulatedAutopilot

    def __init__(
        self, autopilot: SimulatedAutopilot, port: int = 14540, host: str = "127.0.0.1", heartbeat_hz: float = 1.0
    ) -> None:
        super().__init__(autopilot, port, host, heartbeat_hz)
        autopilot.loops.max_integral_rad_s2 = MAX_INTEGRAL_RAD_S2

    _offboard_s = -math.inf
    """Time at which offboard was entered disarmed."""

    def _set_mode(self, command: messages.Message) -> int:
        before = self.autopilot.mode
        result = super()._set_mode(command)
        if self._waits_in_offboard and before != "OFFBOARD":
            self._offboard_s = self.autopilot.time_s
            self._streams[mavlink.MAVLINK_MSG_ID_SYS_STATUS].due_s = self._offboard_s + TOLD_S
        return result

    @property
    def _waits_in_offboard(self) -> bool:
        return self.autopilot.mode == "OFFBOARD" and not self.autopilot.armed

    @property
    def unchecked(self) -> bool:
        """True while the check of offboard has not run since it was entered."""
        return self._waits_in_offboard and self.autopilot.time_s < self._offboard_s + CHECKED_S

    def _arm_disarm(self, command: messages.Message) -> int:
        if command.param1 == 1.0 and self.unchecked:
            return self._answer("Arming denied: Resolve system health failures first")
        return super()._arm_disarm(command)

    def _stamped(self, estimate: VehicleState) -> VehicleState:
        stamped = super()._stamped(estimate)
        return replace(stamped, ready_to_arm=False) if self.unchecked else stamped

    def _run_checks(self, command: messages.Message) -> int:
        result = super()._run_checks(command)
        ready = self.autopilot.estimate().ready_to_arm
        for event in messages.arming_report(ready, round(1000.0 * self._clock_s)):
            self._send(event)
        return result

    def new_manners(self) -> Manners:
        return Manners(
            mav_autopilot=mavlink.MAV_AUTOPILOT_PX4,
            custom_modes={
                "POSCTL": 3 << 16,
                "HOLD": 4 << 16 | 3 << 24,
                "RTL": 4 << 16 | 5 << 24,
                "LAND": 4 << 16 | 6 << 24,
                "OFFBOARD": 6 << 16,
            },
            sub_mode_shift=16,
            streams={
                mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED: Stream(messages.local_position, 30.0, "position"),
                mavlink.MAVLINK_MSG_ID_ATTITUDE_QUATERNION: Stream(messages.attitude_quaternion, 50.0, "attitude"),
                mavlink.MAVLINK_MSG_ID_ATTITUDE: Stream(messages.attitude, 100.0, "attitude"),
                dialect.ESC_STATUS_ID: Stream(messages.esc_status, 10.0, "rpm"),
                mavlink.MAVLINK_MSG_ID_ACTUATOR_OUTPUT_STATUS: Stream(
                    messages.actuator_output_status, 0.0, "heartbeat"
                ),
                mavlink.MAVLINK_MSG_ID_ESTIMATOR_STATUS: Stream(messages.estimator_status, 1.0, "position"),
                mavlink.MAVLINK_MSG_ID_SYS_STATUS: Stream(messages.sys_status(lists_prearm=False), 5.0, "heartbeat"),
                mavlink.MAVLINK_MSG_ID_BATTERY_STATUS: Stream(messages.battery_status, 0.5, "battery"),
                mavlink.MAVLINK_MSG_ID_TIMESYNC: Stream(messages.timesync, 10.0, "heartbeat"),
                mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: Stream(messages.extended_sys_state, 5.0, "heartbeat"),
                mavlink.MAVLINK_MSG_ID_ALTITUDE: Stream(messages.altitude, 10.0, "position"),
                mavlink.MAVLINK_MSG_ID_DISTANCE_SENSOR: Stream(messages.distance_sensor, 10.0, "position"),
            },
            unknown_interval=mavlink.MAV_RESULT_FAILED,
            refusal=mavlink.MAV_RESULT_TEMPORARILY_REJECTED,
            takes_off_by_command=False,
            motor_test_output=lambda share: share,
            tests_motors_clockwise=False,
            integer_parameters=frozenset(
                {
                    "COM_OBL_RC_ACT",
                    "NAV_RCL_ACT",
                    "COM_RCL_EXCEPT",
                    "COM_RC_IN_MODE",
                    "COM_RC_OVERRIDE",
                    "COM_LOW_BAT_ACT",
                    "EKF2_NOAID_TOUT",
                    "EKF2_DRAG_CTRL",
                    "MC_BAT_SCALE_EN",
                    "MC_AIRMODE",
                    "CA_AIRFRAME",
                    "CA_ROTOR_COUNT",
                }
            ),
            texts_for_stations=True,
            sends_current_mode=True,
            acknowledges_modes_twice=True,
            fixed_heartbeats=True,
            bytewise_integers=True,
            takes_body_thrust=True,
            capabilities=mavlink.MAV_PROTOCOL_CAPABILITY_MAVLINK2
            | mavlink.MAV_PROTOCOL_CAPABILITY_SET_ATTITUDE_TARGET
            | mavlink.MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_BYTEWISE,
            version=0x010F00FF,  # 1.15.0, a release
        )
