"""An ArduPilot Copter on the wire: it sends only heartbeats until asked for more, and compensated pulses."""

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from quadctl.sitl.rules.copter import AIR, SimulatedCopter
from quadctl.sitl.server import messages
from quadctl.sitl.server.manners import Manners, Stream
from quadctl.sitl.server.server import MavlinkMock
from quadctl.thrust_chain.ardupilot import output_of_thrust, thrust_of_output


class MavlinkArduPilot(MavlinkMock):
    """An ArduPilot Copter on UDP."""

    rules = SimulatedCopter

    def new_manners(self) -> Manners:
        return Manners(
            mav_autopilot=mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA,
            custom_modes={"STABILIZE": 0, "GUIDED": 4, "LOITER": 5, "RTL": 6, "LAND": 9, "BRAKE": 17},
            sub_mode_shift=0,
            streams={
                mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED: Stream(messages.local_position, 0.0, "position"),
                mavlink.MAVLINK_MSG_ID_ATTITUDE_QUATERNION: Stream(messages.attitude_quaternion, 0.0, "attitude"),
                mavlink.MAVLINK_MSG_ID_ATTITUDE: Stream(messages.attitude, 0.0, "attitude"),
                mavlink.MAVLINK_MSG_ID_ESC_TELEMETRY_1_TO_4: Stream(messages.esc_telemetry, 0.0, "rpm"),
                mavlink.MAVLINK_MSG_ID_SERVO_OUTPUT_RAW: Stream(
                    messages.servo_output_raw(self.pulse_us), 0.0, "heartbeat"
                ),
                mavlink.MAVLINK_MSG_ID_EKF_STATUS_REPORT: Stream(messages.ekf_status_report, 0.0, "position"),
                mavlink.MAVLINK_MSG_ID_SCALED_PRESSURE: Stream(
                    messages.scaled_pressure(AIR.pressure_pa, AIR.ground_temperature_c), 0.0, "position"
                ),
                mavlink.MAVLINK_MSG_ID_DISTANCE_SENSOR: Stream(messages.distance_sensor, 0.0, "position"),
                mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: Stream(
                    messages.global_position(AIR.altitude_m), 0.0, "position"
                ),
                mavlink.MAVLINK_MSG_ID_GPS_RAW_INT: Stream(messages.gps_raw, 0.0, "heartbeat"),
                mavlink.MAVLINK_MSG_ID_SYS_STATUS: Stream(messages.sys_status(lists_prearm=True), 0.0, "battery"),
                mavlink.MAVLINK_MSG_ID_BATTERY_STATUS: Stream(messages.battery_status, 0.0, "battery"),
                mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: Stream(messages.extended_sys_state, 0.0, "heartbeat"),
            },
            unknown_interval=mavlink.MAV_RESULT_DENIED,
            refusal=mavlink.MAV_RESULT_FAILED,
            announces_unknown=True,
            takes_off_by_command=True,
            motor_test_output=self.thrust_of_share,
            tests_motors_clockwise=True,
            integer_parameters=frozenset(
                {
                    "GUID_OPTIONS",
                    "DISARM_DELAY",
                    "LAND_SPEED",
                    "FS_GCS_ENABLE",
                    "SYSID_MYGCS",
                    "MAV_GCS_SYSID",
                    "FRAME_CLASS",
                    "FS_THR_ENABLE",
                    "FS_EKF_ACTION",
                    "RTL_ALT",
                    "BARO1_WCF_ENABLE",
                    "ARMING_CHECK",
                    "ATC_ANGLE_BOOST",
                }
            ),
            version=self._copter.version[0] << 24 | self._copter.version[1] << 16,
        )

    def pulse_us(self, throttle: float) -> float:
        """Pulse length of a motor for a share of its greatest thrust, cut down to whole microseconds."""
        output = output_of_thrust(throttle, self._copter.parameters, self._copter.ambient)
        return float(int(1000.0 * (1.0 + output)))

    def thrust_of_share(self, share: float) -> float:
        """Share of the greatest thrust from a share of the pulses' range: the inverse of `pulse_us`."""
        return float(thrust_of_output(share, self._copter.parameters, self._copter.ambient))

    @property
    def _copter(self) -> SimulatedCopter:
        assert isinstance(self.autopilot, SimulatedCopter)
        return self.autopilot
