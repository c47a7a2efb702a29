"""The pilot: a state machine with its guards, which decides every tick of a flight.

State and lateness of a tick come in, a target and requests to the autopilot go out. It never reads a clock, a file or
a link, so that the same code flies in real time and in simulated time.
"""
