"""Physical effects, one file per family. `catalog.py` lists them, `base.py` says what one is."""

from quadctl.effects.base import Conditions, Effect, Parameter, ThrustRatio, parameter
from quadctl.effects.catalog import CATALOG, catalog_with, choose_effect, every_effect, find_effect

__all__ = [
    "CATALOG",
    "Conditions",
    "Effect",
    "Parameter",
    "ThrustRatio",
    "catalog_with",
    "choose_effect",
    "every_effect",
    "find_effect",
    "parameter",
]
