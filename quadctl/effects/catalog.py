"""The effects that the project knows, by name: every effect of every module of this package. A new effect is one file.

The modules come in the order in which their effects are tried and shown, and within a module the effects do; a family
is known by its first effect.
"""

import pkgutil
from collections.abc import Iterator, Mapping, Sequence
from importlib import import_module
from pathlib import Path

from quadctl.effects.base import Effect
from quadctl.effects.user import effects_of, installed, load_installed
from quadctl.errors import SettingsError
from quadctl.words import nearest

FIRST = (
    *("thrust_scale", "thrust_map", "ground_effect", "ground_effect_hexarotor", "ground_effect_surfaces"),
    *("ceiling_effect", "rotor_drag", "body_drag", "inflow", "thrust_tilt", "tether", "wind", "translational_lift"),
    *("payload", "battery_sag", "thrust_curve", "motor_lag", "rotor_fault", "rotor_interaction", "ground_torque"),
    *("airspeed_moment", "imu_bias"),
)
"""Modules that come first; others follow by their names."""


def effects_in(path: Sequence[str], package: str) -> Iterator[type[Effect]]:
    """Effects that the modules of a package define, with the folders of its `path`."""
    names = {module.name for module in pkgutil.iter_modules(path)} - {__name__.rpartition(".")[2]}
    for name in sorted(names, key=lambda name: (FIRST.index(name) if name in FIRST else len(FIRST), name)):
        module = import_module(f"{package}.{name}")
        for kind in vars(module).values():
            own = isinstance(kind, type) and issubclass(kind, Effect) and kind.__module__ == module.__name__
            if own and "name" in vars(kind):
                yield kind


CATALOG: dict[str, type[Effect]] = {
    kind.name: kind for kind in effects_in([str(Path(__file__).parent)], __name__.rpartition(".")[0])
}


def find_effect(word: str, source: str, known: Mapping[str, type[Effect]] = CATALOG) -> type[Effect]:
    """The effect called `word`: its full name, its variant alone, or its family (then the family's first variant).

    What is not `known` is looked for among the effects that installed packages announce.

    Raises
    ------
    SettingsError
        No effect has that name; the sentence names `source` and the nearest known name.
    """
    name = _full_name(word, known)
    if name is not None:
        return known[name]
    announced = installed()
    name = _full_name(word, announced)
    if name is not None:
        return load_installed(announced[name])
    names = [*known, *announced]
    near = nearest(word, [*names, *(part for name in names for part in name.split("."))])
    hint = near or f", expected one of: {', '.join(names)}"
    raise SettingsError(f"{source}: there is no effect '{word}'{hint}")


def _full_name(word: str, names: Mapping[str, object]) -> str | None:
    if word in names:
        return word
    for part in (2, 0):  # the variant, then the family
        for name in names:
            if name.partition(".")[part] == word:
                return name
    return None


def catalog_with(files: Sequence[Path]) -> dict[str, type[Effect]]:
    """The catalogue and the effects that a user's `files` define.

    Raises
    ------
    SettingsError
        A file cannot be used, or gives an effect a name that is taken.
    """
    known = dict(CATALOG)
    for path in files:
        for name, effect in effects_of(path).items():
            if known.setdefault(name, effect) is not effect:
                holder = "the catalogue" if name in CATALOG else "another file"
                raise SettingsError(f"{path}: {name} is in {holder} already, expected another name")
    return known


def every_effect(files: Sequence[Path]) -> dict[str, type[Effect]]:
    """The catalogue, the effects that `files` define, and those that installed packages announce.

    Raises
    ------
    SettingsError
        A file or an announced effect cannot be used, or a name is taken.
    """
    known = catalog_with(files)
    for name, entry in installed().items():
        if name in known:
            raise SettingsError(
                f"entry point '{name} = {entry.value}': that effect exists already, expected another name"
            )
        known[name] = load_installed(entry)
    return known


def choose_effect(word: str, source: str, files: Sequence[Path]) -> tuple[type[Effect], tuple[Path, ...]]:
    """The effect that a command names, as `find_effect` does, or as FILE.py or FILE.py:NAME; and the files it needs.

    Raises
    ------
    SettingsError
        There is no such effect, the file cannot be used, or it holds several and none is named.
    """
    file, colon, name = word.partition(".py:")
    if not colon and not word.endswith(".py"):
        return find_effect(word, source, catalog_with(files)), tuple(files)
    path = Path(f"{file}.py" if colon else word)
    listed = [known for known in files if known.resolve() == path.resolve()]
    path = listed[0] if listed else path
    wanted = tuple(files) if listed else (*files, path)
    catalog_with(wanted)  # a name that is taken is found here
    own = effects_of(path)
    if not name and len(own) > 1:
        raise SettingsError(f"{source}: {path} holds {', '.join(own)}, expected one of them: {path}:{next(iter(own))}")
    return find_effect(name or next(iter(own)), str(path), own), wanted
