"""The effects that the project knows, by name. A new effect is one class in one file and one line here."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from quadctl.effects.base import Effect
from quadctl.effects.battery_sag import LinearSag, PowerSag
from quadctl.effects.body_drag import QuadraticDrag
from quadctl.effects.ceiling_effect import MomentumCeiling
from quadctl.effects.ground_effect import (
    Cheeseman,
    CheesemanForward,
    Danjun,
    Exponential,
    Hayden,
    Kan,
    Nobahari,
    Sanchez,
    Surface,
)
from quadctl.effects.ground_effect_hexarotor import Hexarotor, HexarotorTilted
from quadctl.effects.ground_effect_surfaces import Surfaces
from quadctl.effects.ground_torque import Levelling
from quadctl.effects.imu_bias import ConstantBias
from quadctl.effects.inflow import AxialInflow
from quadctl.effects.motor_lag import FirstOrderLag
from quadctl.effects.payload import MassStep
from quadctl.effects.rotor_drag import LinearDrag
from quadctl.effects.rotor_fault import FailingRotor, WeakRotor
from quadctl.effects.rotor_interaction import FrontWake
from quadctl.effects.tether import HangingTether
from quadctl.effects.thrust_curve import PowerCurve
from quadctl.effects.thrust_map import LineMap
from quadctl.effects.thrust_scale import ConstantScale
from quadctl.effects.thrust_tilt import FixedTilt
from quadctl.effects.translational_lift import HorizontalLift
from quadctl.effects.user import effects_of, installed, load_installed
from quadctl.effects.wind import Push, QuadraticWind, SteadyWind, WindOfEachFlight
from quadctl.errors import SettingsError
from quadctl.settings import nearest

CATALOG: dict[str, type[Effect]] = {
    effect.name: effect
    for effect in (
        ConstantScale,
        LineMap,
        Exponential,
        Sanchez,
        Cheeseman,
        Hayden,
        Danjun,
        CheesemanForward,
        Hexarotor,
        HexarotorTilted,
        Surface,
        Surfaces,
        Nobahari,
        Kan,
        MomentumCeiling,
        LinearDrag,
        QuadraticDrag,
        AxialInflow,
        FixedTilt,
        HangingTether,
        SteadyWind,
        WindOfEachFlight,
        QuadraticWind,
        Push,
        HorizontalLift,
        MassStep,
        LinearSag,
        PowerSag,
        PowerCurve,
        FirstOrderLag,
        WeakRotor,
        FailingRotor,
        FrontWake,
        Levelling,
        ConstantBias,
    )
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
