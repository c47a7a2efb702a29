"""The simulator: a vehicle, the rules of an autopilot over it, and two ways to fly it, in lockstep or over MAVLink.

A vehicle, a hidden truth and a seed come in; a flight's outcome, or the URL of an autopilot, goes out. It never uses
the control or the analysis that it is there to test.
"""
