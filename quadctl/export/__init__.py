"""A fitted model in the words of an autopilot, a simulator or another program, with its intervals.

What a target cannot say is listed; nothing is dropped in silence.
"""
