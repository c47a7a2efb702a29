"""The lab: how wrong a flight model is, where, what it lacks, and what that costs on flights it has not seen.

Examples
--------
>>> from quadctl.lab import compare, diagnose
>>> print(compare("raptor.yaml", "flight.csv"))  # doctest: +ELLIPSIS
raptor against flight.csv
...
>>> diagnose("raptor.yaml", "flight.csv", ["thrust_scale", "ground_effect.exponential"]).missing
['ground_effect']
"""

# Imported at once and not when first asked for: modules of the lab are called as their functions are (`compare`), and
# importing one later would put the module in the function's place. What flies does not import the lab.
from quadctl.lab.estimator import FlightModel
from quadctl.lab.interface import add, compare, diagnose, discover, fit, prepare_flights, remove, suggest
from quadctl.logs.read import read_log, read_logs
from quadctl.model import Model, load_model, save_model

__all__ = [
    "FlightModel",
    "Model",
    "add",
    "compare",
    "diagnose",
    "discover",
    "fit",
    "load_model",
    "prepare_flights",
    "read_log",
    "read_logs",
    "remove",
    "save_model",
    "suggest",
]
