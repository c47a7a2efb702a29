"""Ground effect over several surfaces: one weight of the fountain for each of them, and their mean elsewhere."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, make_dataclass
from functools import cache
from typing import Any, ClassVar, Self, cast

from quadctl.effects.base import Conditions, Effect, parameter
from quadctl.effects.ground_effect import LOWEST_HEIGHT_OVER_RADIUS, NearGround, quadrotor_ratio
from quadctl.errors import SettingsError
from quadctl.numeric import Number, maximum
from quadctl.vehicle import Vehicle

PREFIX = "k_"


@dataclass(frozen=True)
class Surfaces(NearGround):
    """`sanchez` with k_b + k_NAME in the place of k_b over the surface NAME, and k_b over ground without a name.

    The parameters are those of the surfaces that a model file names, or that the flights of a fit were flown over:
    `over` makes the class that has them. k_b is the mean over surfaces, which a fit keeps, as a change of it could not
    be told from the same change of all surfaces. Over an edge the weights pass linearly into each other. A sum below 0
    is taken as 0: a surface may swallow the fountain, but it does not pull.
    """

    name: ClassVar[str] = "ground_effect.surfaces"
    source: ClassVar[str] = "Dena et al. eq. 20, with a k_s for each surface"
    depends_on: ClassVar[tuple[str, ...]] = ("height_over_radius", "north", "east")
    distinguished_by: ClassVar[str] = "hovering at many low heights over each of the surfaces"
    mission: ClassVar[str] = "missions/hover_heights.yaml"
    candidate: ClassVar[bool] = False
    surfaces: ClassVar[tuple[str, ...]] = ()

    k_b: float = parameter(0.4509, 0.0, 6.0, "", "weight of the fountain on the body, mean over surfaces", fitted=False)

    @classmethod
    def applies_to(cls, vehicle: Vehicle) -> bool:
        return vehicle.n_rotors == 4

    @classmethod
    def over(cls, surfaces: Sequence[str]) -> "type[Surfaces]":
        """The effect with a parameter for each of these surfaces."""
        return _over(tuple(surfaces))

    @classmethod
    def from_values(cls, values: Mapping[str, Any], source: str) -> Self:
        named = [name.removeprefix(PREFIX) for name in values if name.startswith(PREFIX) and name != "k_b"]
        for name in named:
            if not name.isidentifier():
                raise SettingsError(f"{source}: '{PREFIX}{name}' names no surface, expected {PREFIX} and its name")
        # Every class that `_over` makes is a Surfaces, and has the inherited method.
        return cast(Self, super(Surfaces, _over(tuple(named))).from_values(values, source))

    @classmethod
    def starts(cls, flights: Sequence[Conditions], vehicle: Vehicle) -> Sequence[Effect]:
        named = dict.fromkeys(name for c in flights for name, _ in c.surfaces)
        return [cls.over(tuple(named))()]

    def weight(self, surface: str) -> float:
        """Weight of the fountain over one surface; that of the mean where it has no name here."""
        return max(self.k_b + self.values().get(PREFIX + surface, 0.0), 0.0)

    def ratio(self, c: Conditions, vehicle: Vehicle) -> Number:
        z = maximum(c.height_m, LOWEST_HEIGHT_OVER_RADIUS * vehicle.rotor.radius_m)
        weight: Number = self.k_b
        for name, share in c.surfaces:
            if name in self.surfaces:
                weight = weight + share * getattr(self, PREFIX + name)
        return quadrotor_ratio(z, vehicle, maximum(weight, 0.0))

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickled by the names of its surfaces: its class is in no module."""
        return _restored, (self.surfaces, self.values())


@cache
def _over(surfaces: tuple[str, ...]) -> type[Surfaces]:
    if not surfaces:
        return Surfaces
    fields = [
        (PREFIX + name, float, parameter(0.0, -6.0, 6.0, "", f"what {name} adds to the weight of the fountain"))
        for name in surfaces
    ]
    made = make_dataclass("Surfaces", fields, bases=(Surfaces,), frozen=True, namespace={"surfaces": surfaces})
    return made


def _restored(surfaces: tuple[str, ...], values: dict[str, float]) -> Surfaces:
    return _over(surfaces)(**values)
