"""A vehicle file with other numbers: only they change in its text, so that comments and layout stay."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml

from quadctl.errors import SettingsError
from quadctl.settings import parse_yaml, read_yaml, validate
from quadctl.vehicle import Vehicle

Keys = tuple[str, ...]


def with_values(path: Path, values: Mapping[Keys, float]) -> str:
    """The text of the vehicle file `path` with the numbers at `values`' keys, e.g. ("throttle", "offset"), replaced.

    Raises
    ------
    SettingsError
        The file cannot be read, or would not be a vehicle with these values.
    """
    read_yaml(path)  # with its own sentences about what is no YAML
    text = path.read_text(encoding="utf-8")
    root = yaml.compose(text)
    edits = []
    for keys, value in values.items():
        start, end, new = _edit(root, keys, f"{value:.6g}")
        edits.append((start, end, new))
    for start, end, new in sorted(edits, reverse=True):
        text = text[:start] + new + text[end:]
    vehicle = validate(parse_yaml(text, path), Vehicle, f"{path} with the measured numbers")
    for keys, value in values.items():
        found: Any = vehicle
        for key in keys:
            found = getattr(found, key)
        if abs(found - value) > 1e-4 * abs(value):  # an alias or a merge, which the edit does not follow
            raise SettingsError(f"{path}: {'.'.join(keys)} could not be replaced, write {value:.6g} there by hand")
    return text


def _edit(root: yaml.Node | None, keys: Keys, new: str) -> tuple[int, int, str]:
    """Edit (begin, end, text) that sets a value: in its place, or before the first key where its key is not there."""
    node = root
    for i, key in enumerate(keys):
        if not isinstance(node, yaml.MappingNode) or not node.value:
            break
        found = next((value for name, value in node.value if name.value == key), None)
        if found is None:
            first = node.value[0][0].start_mark
            following = ", " if node.flow_style else "\n" + " " * first.column
            if i == len(keys) - 1:
                return first.index, first.index, f"{key}: {new}{following}"
            break
        node = found
    if not isinstance(node, yaml.ScalarNode):
        raise SettingsError(f"the vehicle file holds no {'.'.join(keys)}, expected {new} to go there")
    return node.start_mark.index, node.end_mark.index, new
