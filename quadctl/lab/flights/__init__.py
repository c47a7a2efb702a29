"""Flights: a log becomes a prepared flight, flights become a dataset.

In come a `FlightLog` and the vehicle that flew it; out comes a `Dataset` of filtered samples on an even clock with
the folds that hold them out, and, aligned for a model, its prediction. Nothing is fitted here but the delay of the
rotor signal.
"""
