"""The autopilot: the port that a flight commands, its MAVSDK adapter, and a description of each firmware.

Targets, requests and a URL come in, one snapshot of the vehicle's state goes out. It never decides what to fly, and
never repeats a target by itself.
"""
