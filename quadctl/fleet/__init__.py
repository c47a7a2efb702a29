"""Logs of many vehicles over time: each flight is measured once, and the vehicles that change are told from the rest.

In: a folder with one folder of logs for each vehicle, and a model. Out: an index of what every flight says, the spread
of the population, the vehicles that drift or jump, and a report.
"""
