"""The MAVLink server: puts a simulated autopilot on the wire, in real time.

MAVLink messages come in and go out over UDP; faults of the link and of the estimate can be set. It never decides
about arming, modes or failsafes: those are the rules' part.
"""
