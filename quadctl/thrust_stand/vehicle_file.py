"""A vehicle file with other numbers: only they change in its text, so that comments and layout stay."""

from collections.abc import Mapping
from pathlib import Path

from quadctl.settings_text import Keys, with_numbers
from quadctl.vehicle import Vehicle


def with_values(path: Path, values: Mapping[Keys, float]) -> str:
    """The text of the vehicle file `path` with the numbers at `values`' keys, e.g. ("throttle", "offset"), replaced.

    Raises
    ------
    SettingsError
        The file cannot be read, or would not be a vehicle with these values.
    """
    return with_numbers(path, values, Vehicle, "vehicle file")
