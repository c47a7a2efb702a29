"""Tracking of the control law, of the one before, and of the autopilots' own control; writes docs/tracking.md."""
