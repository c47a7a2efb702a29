"""The simulated vehicle, the autopilot that flies it, and two ways to reach it: lockstep in process, and MAVLink."""
