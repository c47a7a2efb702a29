"""The text of a settings file with other numbers: only they change, so that comments and layout stay."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeVar

import yaml

from quadctl.errors import SettingsError
from quadctl.settings import Settings, parse_yaml, read_yaml, validate

Keys = tuple[str, ...]
S = TypeVar("S", bound=Settings)


def with_numbers(path: Path, values: Mapping[Keys, float], kind: type[S], what: str) -> str:
    """The text of the file `path` with the numbers at `values`' keys, e.g. ("throttle", "offset"), replaced.

    A number whose key is not there goes before its neighbours. `what` names the file in messages: "vehicle file".

    Raises
    ------
    SettingsError
        The file cannot be read, has no place for a number, or would not be of this `kind` with them.
    """
    read_yaml(path)  # with its own sentences about what is no YAML
    text = path.read_text(encoding="utf-8")
    root = yaml.compose(text)
    edits = []
    for keys, value in values.items():
        start, end, new = _edit(root, keys, f"{value:.6g}", what)
        edits.append((start, end, new))
    for start, end, new in sorted(edits, reverse=True):
        text = text[:start] + new + text[end:]
    settings = validate(parse_yaml(text, path), kind, f"{path} with the measured numbers")
    for keys, value in values.items():
        found: Any = settings
        for key in keys:
            found = getattr(found, key)
        if abs(found - value) > 1e-4 * abs(value):  # an alias or a merge, which the edit does not follow
            raise SettingsError(f"{path}: {'.'.join(keys)} could not be replaced, write {value:.6g} there by hand")
    return text


def _edit(root: yaml.Node | None, keys: Keys, new: str, what: str) -> tuple[int, int, str]:
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
        raise SettingsError(f"the {what} holds no {'.'.join(keys)}, expected {new} to go there")
    return node.start_mark.index, node.end_mark.index, new
