"""Every fault on every simulated autopilot, in real time over MAVLink: the answer of the flight, and its time."""
