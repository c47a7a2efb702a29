"""The effects that the project knows, by name. A new effect is one class in one file and one line here."""

from quadctl.effects.base import Effect
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
from quadctl.effects.inflow import AxialInflow
from quadctl.effects.rotor_drag import LinearDrag
from quadctl.effects.tether import HangingTether
from quadctl.effects.thrust_scale import ConstantScale
from quadctl.effects.thrust_tilt import FixedTilt
from quadctl.errors import SettingsError
from quadctl.settings import nearest

CATALOG: dict[str, type[Effect]] = {
    effect.name: effect
    for effect in (
        ConstantScale,
        Exponential,
        Sanchez,
        Cheeseman,
        Hayden,
        Danjun,
        CheesemanForward,
        Hexarotor,
        HexarotorTilted,
        Surface,
        Nobahari,
        Kan,
        MomentumCeiling,
        LinearDrag,
        QuadraticDrag,
        AxialInflow,
        FixedTilt,
        HangingTether,
    )
}


def find_effect(word: str, source: str) -> type[Effect]:
    """The effect called `word`: its full name, its variant alone, or its family (then the family's first variant).

    Raises
    ------
    SettingsError
        No effect has that name; the sentence names `source` and the nearest known name.
    """
    if word in CATALOG:
        return CATALOG[word]
    for part in (2, 0):  # the variant, then the family
        for name, effect in CATALOG.items():
            if name.partition(".")[part] == word:
                return effect
    known = [*CATALOG, *(part for name in CATALOG for part in name.split("."))]
    hint = nearest(word, known) or f", expected one of: {', '.join(CATALOG)}"
    raise SettingsError(f"{source}: there is no effect '{word}'{hint}")
