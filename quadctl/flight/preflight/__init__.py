"""Preflight: a flight is read from its files and checked, and the autopilot is asked whether it is ready.

Files come in, and an autopilot that is connected; a plan, or findings with a verdict, go out. It never arms a motor;
the only parameters that it sets are those that the user allowed, and it restores them.
"""
