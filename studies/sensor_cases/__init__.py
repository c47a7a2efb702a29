"""Simulated flights whose barometer has a hidden error, to test `quadctl diagnose --sensors` without its own code."""
