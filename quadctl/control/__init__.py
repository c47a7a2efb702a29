"""Pure functions: state and setpoint to attitude and throttle. `cascade.control` is one tick, top to bottom."""

from quadctl.control.cascade import ControlOutput, Memory, control
from quadctl.control.settings import AxisGains, ControllerSettings

__all__ = ["AxisGains", "ControlOutput", "ControllerSettings", "Memory", "control"]
