"""Rotation from motor commands: its parameters with intervals that hold in closed loop, and rollouts of the whole
state."""
