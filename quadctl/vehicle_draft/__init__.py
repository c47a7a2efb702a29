"""A vehicle file for a vehicle of one's own: from an autopilot's parameters where there are some, and a few answers."""
