"""The flight: everything with a clock.

A mission, settings and models come in as files; an autopilot is commanded at a fixed rate; a log and an outcome go
out. It never analyses a log, and needs none of the lab's libraries.
"""
