"""Flights that are meant to fool the lab.

Each trap is a plausible flight of a plausible vehicle whose truth is known and that invites a false answer: a name of
an effect that is not there, a parameter whose interval leaves out the truth, a fault in a clean flight. The honest
answers were written down before the lab had seen a flight. Three controls, which the lab should get right, show that
the simulation is sane.
"""
