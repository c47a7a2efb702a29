"""The rules of each autopilot: arming, modes, take-off, failsafes, parameters.

Targets and requests come in, motor outputs for the simulated vehicle and a state estimate go out. They never read a
real clock or a socket: time is what `step` is given.
"""
