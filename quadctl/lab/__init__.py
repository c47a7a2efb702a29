"""The lab: measures the error of a flight model, finds where it is large and which physical effect is missing.

Examples
--------
>>> from quadctl.lab import compare, diagnose
>>> print(compare("raptor.yaml", "flight.csv"))  # doctest: +ELLIPSIS
Acceleration error of raptor, ...
>>> diagnose("raptor.yaml", "flight.csv", ["thrust_scale", "ground_effect.exponential"]).missing
['ground_effect']
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from quadctl.lab.estimator import FlightModel
    from quadctl.lab.interface import add, compare, diagnose, discover, fit, judge, remove, suggest
    from quadctl.lab.rotation.interface import add_rotation, identify_rotation, rollouts
    from quadctl.lab.study import Study, prepare_flights
    from quadctl.logs.read import read_log, read_logs
    from quadctl.model import Model, load_model, save_model

__all__ = [
    "FlightModel",
    "Model",
    "Study",
    "add",
    "add_rotation",
    "compare",
    "diagnose",
    "discover",
    "fit",
    "identify_rotation",
    "judge",
    "load_model",
    "prepare_flights",
    "read_log",
    "read_logs",
    "remove",
    "rollouts",
    "save_model",
    "suggest",
]

_HOMES = {
    "FlightModel": "quadctl.lab.estimator",
    **dict.fromkeys(("add_rotation", "identify_rotation", "rollouts"), "quadctl.lab.rotation.interface"),
    **dict.fromkeys(("Study", "prepare_flights"), "quadctl.lab.study"),
    **dict.fromkeys(("Model", "load_model", "save_model"), "quadctl.model"),
    **dict.fromkeys(("read_log", "read_logs"), "quadctl.logs.read"),
}
"""Modules of the public names; all others are in `quadctl.lab.interface`."""


def __getattr__(name: str) -> Any:
    """Load a public name at its first use (PEP 562): importing scipy and polars takes seconds."""
    if name not in __all__:
        raise AttributeError(f"module 'quadctl.lab' has no attribute '{name}'")
    return getattr(import_module(_HOMES.get(name, "quadctl.lab.interface")), name)


def __dir__() -> list[str]:
    return sorted(__all__)
