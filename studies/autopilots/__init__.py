"""The simulated autopilots beside the real ones: facts, probes and recordings; writes docs/autopilots.md."""
