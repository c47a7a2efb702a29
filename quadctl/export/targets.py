"""The targets of `quadctl export`; a new one is a file and a line here."""

from quadctl.export.ardupilot import ARDUPILOT
from quadctl.export.px4 import PX4

AUTOPILOTS = {"px4": PX4, "ardupilot": ARDUPILOT}
"""Targets that are parameters of an autopilot, by the word of `--to`."""
