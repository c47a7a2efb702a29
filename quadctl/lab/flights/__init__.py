"""Flights: logs become prepared flights, and flights become a dataset.

Input: a `FlightLog` and the vehicle that flew it. Output: a `Dataset` of filtered samples on an even clock with folds
that hold them out, and, aligned for a model, its prediction. Nothing is fitted here except the delay of the rotor
signal.
"""
