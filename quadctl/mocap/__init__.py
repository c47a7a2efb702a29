"""Motion-capture poses on their way to the autopilot."""
