"""The autopilots that quadctl flies, by MAV_AUTOPILOT of their heartbeat."""

from quadctl.flight.ardupilot import ARDUPILOT
from quadctl.flight.firmware import Firmware
from quadctl.flight.px4 import PX4

FIRMWARES: dict[int, Firmware] = {firmware.mav_autopilot: firmware for firmware in (PX4, ARDUPILOT)}
