"""Every fault on every autopilot, in real time over MAVLink: what happened, and after how long."""
