"""Effects that users bring along: a Python file of their own, or an installed package that announces them.

Nothing is registered anywhere: who wants a file's effects asks for them, and other models do not see them.
"""

import dataclasses
import re
import runpy
import traceback
from functools import lru_cache
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from typing import Any

import numpy as np

from quadctl.effects.base import (
    HOOKS,
    NUMBERS,
    SPANS,
    VARIABLES,
    Conditions,
    Effect,
    Identifiability,
    Parametric,
    Physics,
    Prior,
    ThrustRatio,
)
from quadctl.errors import SettingsError
from quadctl.vehicle import Vehicle
from quadctl.words import nearest

GROUP = "quadctl.effects"
"""Group of the entry points `"family.variant" = "package.module:Class"`."""

MODULE = "quadctl_own_effects"
"""`__name__` of a user's file while it runs."""

RENAMED = {
    "told_apart_by": "distinguished_by",
    "turns": "affects_moment",
    "retards": "adds_lag",
}
"""Former names of class variables, which users' files may still have, with the present names."""

PARTS = (Parametric, Physics, Prior, Identifiability)
ATTRIBUTES = tuple(name for part in PARTS for name in part.__annotations__)
DECLARED = tuple(name for name in ATTRIBUTES if not hasattr(Effect, name))
"""Class variables that every effect must declare: its name, source, physics, ..."""

SAMPLE = Vehicle.model_validate(
    {
        "name": "sample",
        "mass_kg": 1.5,
        "rotor": {"radius_m": 0.12, "thrust_n_per_rpm2": 1.14e-7},
        "rotors": [
            {"position_m": [x, y, 0.0], "spin": "ccw" if x * y > 0.0 else "cw"}
            for x in (0.12, -0.12)
            for y in (0.12, -0.12)
        ],
        "throttle": {"per_newton": 0.024, "offset": 0.16, "max_thrust_per_rotor_n": 9.0},
        "ceiling_m": 3.0,
    }
)
"""Vehicle on which a user's effect is tried once, so that a mistake in it gives one clear sentence."""


def effects_of(path: Path) -> dict[str, type[Effect]]:
    """Effects that a Python file defines, by name; classes whose names begin with an underscore are ignored.

    The file is run, once for each version of it: while it does not change, the same classes come back.

    Raises
    ------
    SettingsError
        The file is missing, fails when it is run, holds no effect, or holds one that cannot be used.
    """
    if not path.is_file():
        raise SettingsError(f"{path}: there is no such file, expected a Python file with an effect")
    status = path.stat()
    try:
        return dict(_effects_of(path.resolve(), (status.st_mtime_ns, status.st_size)))
    except SettingsError as error:
        raise SettingsError(f"{path}: {error}") from None


@lru_cache(maxsize=64)
def _effects_of(path: Path, version: tuple[int, int]) -> dict[str, type[Effect]]:
    """Effects as from `effects_of`; errors do not name the file, which callers may know by another path."""
    found: dict[str, type[Effect]] = {}
    for kind in _run(path).values():
        own = isinstance(kind, type) and issubclass(kind, Effect) and kind.__module__ == MODULE
        if not own or kind.__name__.startswith("_"):
            continue
        _require_usable(kind)
        if found.setdefault(kind.name, kind) is not kind:
            raise SettingsError(f"holds two effects named {kind.name}, expected a name of its own for each")
    if not found:
        raise SettingsError("holds no effect, expected a class derived from quadctl.effects.Effect")
    return found


def installed() -> dict[str, EntryPoint]:
    """Entry points of installed packages, by the name of the effect; no package is imported yet."""
    return {entry.name: entry for entry in entry_points(group=GROUP)}


def load_installed(entry: EntryPoint) -> type[Effect]:
    """The effect of an entry point.

    Raises
    ------
    SettingsError
        Its package cannot be imported, or what it announces is no usable effect of that name.
    """
    source = f"entry point '{entry.name} = {entry.value}'"
    try:
        kind = entry.load()
    except Exception as error:
        raise SettingsError(f"{source}: cannot be loaded ({type(error).__name__}: {error})") from None
    if not (isinstance(kind, type) and issubclass(kind, Effect)):
        raise SettingsError(f"{source}: is no effect, expected a class derived from quadctl.effects.Effect")
    try:
        _require_usable(kind)
    except SettingsError as error:
        raise SettingsError(f"{source}: {error}") from None
    if kind.name != entry.name:
        raise SettingsError(f"{source}: the effect is named {kind.name}, expected the name of the entry point")
    return kind


def _run(path: Path) -> dict[str, Any]:
    """Run the file and return the names that it defines."""
    try:
        return runpy.run_path(str(path), run_name=MODULE)
    except SyntaxError as error:
        raise SettingsError(f"line {error.lineno} is not Python ({error.msg})") from None
    except (Exception, SystemExit) as error:
        lines = [f.lineno for f in traceback.extract_tb(error.__traceback__) if f.filename == str(path)]
        where = f"line {lines[-1]} fails" if lines else "cannot be run"
        raise SettingsError(f"{where} ({type(error).__name__}: {error})") from None


def _require_usable(kind: type[Effect]) -> None:
    """Raise SettingsError for the first declaration that an effect lacks, or the first answer that is none."""
    _rename(kind)
    try:
        _require_declarations(kind)
        _require_parameters(kind)
        _require_hooks(kind)
    except SettingsError as error:
        raise SettingsError(f"{kind.__name__} {error}") from None


def _rename(kind: type[Effect]) -> None:
    """Give `kind` the present names of what it declares by former ones."""
    parameters = {field.name for field in dataclasses.fields(kind)}
    for former, present in RENAMED.items():
        if hasattr(kind, former) and former not in parameters:
            setattr(kind, present, getattr(kind, former))


def _require_declarations(kind: type[Effect]) -> None:
    for name in DECLARED:
        if not hasattr(kind, name):
            raise SettingsError(f"declares no {name}, expected {', '.join(DECLARED)}")
    if not re.fullmatch(r"[a-z][a-z0-9_]*\.[a-z][a-z0-9_]*", str(kind.name)):
        raise SettingsError(f"is named '{kind.name}', expected family.variant in small letters")
    if "__dataclass_params__" not in vars(kind):
        raise SettingsError("is no dataclass, expected @dataclass(frozen=True) above it")
    for says, names, known in (
        ("depends on", kind.depends_on, VARIABLES),
        ("needs a span of", kind.needs, SPANS),
        ("corrects", kind.corrects, NUMBERS),
    ):
        for name in names:
            if name not in known:
                raise SettingsError(f"{says} '{name}'{nearest(name, known)}, expected some of {', '.join(known)}")


def _require_parameters(kind: type[Effect]) -> None:
    for field in dataclasses.fields(kind):
        if "low" not in field.metadata:
            raise SettingsError(
                f"has a field {field.name}, expected it to be declared: {field.name}: float = parameter(...)"
            )
        low, high = field.metadata["low"], field.metadata["high"]
        if not low < high or not low <= field.default <= high:
            raise SettingsError(
                f"has {field.name} = {field.default} within {low} to {high}, expected a default between low and high"
            )


def _require_hooks(kind: type[Effect]) -> None:
    if not any(kind.acts_by(hook) for hook in HOOKS):
        raise SettingsError(f"does nothing, expected one of {', '.join(HOOKS)}")
    unsaid = issubclass(kind, ThrustRatio) and kind.ratio is ThrustRatio.ratio
    if unsaid and kind.rotor_thrust is ThrustRatio.rotor_thrust:
        raise SettingsError("is a ThrustRatio without ratio, expected that method")
    try:
        for number in (1.0, np.array([1.0, 1.1, 1.2])) if kind.applies_to(SAMPLE) else ():
            _require_answers(kind(), number)
    except SettingsError:
        raise
    except Exception as error:
        raise SettingsError(
            f"fails when it is evaluated ({type(error).__name__}: {error}), "
            f"expected it to take floats and arrays, as the functions of quadctl.numeric do"
        ) from None


def _require_answers(effect: Effect, number: Any) -> None:
    """Evaluate the hooks 1 m above the ground, at speeds of 1 m/s; raise SettingsError where one is not finite."""
    level = (number / number, 0.0 * number, 0.0 * number, 0.0 * number)
    c = Conditions(number, (number, number, number), level, number, 16.0 * number)
    thrust = [3.7 * number] * SAMPLE.n_rotors
    answers = {
        "rotor_thrust": (effect.rotor_thrust(thrust, c, SAMPLE), SAMPLE.n_rotors),
        "force": (effect.force(sum(thrust), c, SAMPLE), 3),
        "torque": (effect.torque(thrust, c, SAMPLE), 3),
        "wind_ned_m_s": (effect.wind_ned_m_s(c), 3),
        "sensed_m_s2": (effect.sensed_m_s2(c), 3),
    }
    for hook, (answer, count) in answers.items():
        if not isinstance(answer, tuple | list) or len(answer) != count:
            raise SettingsError(f"gives {answer!r} as {hook}, expected a tuple of {count}")
        if not all(np.all(np.isfinite(component)) for component in answer):
            raise SettingsError(f"gives a {hook} that is not finite 1 m above the ground, expected finite numbers")
