"""The autopilots that quadctl flies, by MAV_AUTOPILOT of their heartbeat. A new one is a file and its name here."""

from quadctl.flight.autopilot.ardupilot import ARDUPILOT
from quadctl.flight.autopilot.firmware import Firmware
from quadctl.flight.autopilot.px4 import PX4

FIRMWARES: dict[int, Firmware] = {firmware.mav_autopilot: firmware for firmware in (PX4, ARDUPILOT)}
