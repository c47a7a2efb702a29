"""The inverse of a model: from the wanted force to the force commanded to the rotors, with all effects of the model.

Any model can be the compensator, the one without effects too. A compensator is limited on purpose: it corrects at most
a band around 1, and its correction fades out beyond the heights of the data that its effects were fitted on.
"""

import itertools
import math
from dataclasses import replace
from typing import NamedTuple

from pydantic import Field

from quadctl.effects import Conditions
from quadctl.errors import SettingsError
from quadctl.frames import rotate, rotate_inverse
from quadctl.model import Model, StackedEffect, conditions
from quadctl.settings import Settings
from quadctl.state import Motion, Vec3, VehicleState
from quadctl.surfaces import Place
from quadctl.words import Fact, Kinds, fact


class CompensatorLimits(Settings):
    """Limits of a compensator's correction."""

    band: float = Field(default=0.3, gt=0.0, lt=1.0)
    """Largest correction: of the thrust as a fraction of it, of the side force as a fraction of the weight."""
    fade_m: float = Field(default=0.3, gt=0.0)
    """Distance beyond the heights of the fit over which the correction falls linearly to zero."""


class Compensation(NamedTuple):
    """Correction for one tick."""

    thrust_ratio: float
    """Thrust of the rotors over the nominal thrust k rpm^2: divide the commanded thrust by it."""
    force_ned_n: Vec3
    """Force of the effects that is not thrust: subtract it from the wanted force."""
    trust: float = 1.0
    """Smallest of the effects' shares of correction, 0..1; below 1 beyond the heights of an effect's data."""


NOTHING = Compensation(1.0, (0.0, 0.0, 0.0))


class Surroundings(NamedTuple):
    """Conditions at one tick that the effects depend on, without the thrust."""

    conditions: Conditions
    trusts: tuple[float, ...]
    """Share of each effect's correction that is used here, 0..1, in the order of the stack."""
    trust: float = 1.0
    """Smallest of `trusts`."""


LEAST_POWER = 0.1
"""Smallest exponent of the thrust given as a power of the thrust asked at which asking for more is worthwhile."""

EMPTY = Surroundings(Conditions(0.0, (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0)), ())


class Compensator:
    """Inverts a model at the present state of flight: call `surroundings`, then `force_ned_n`, then `thrust_ratio`.

    The wanted force less `force_ned_n` is what the rotors must give; that over `thrust_ratio` is what to ask of them.
    """

    def __init__(self, model: Model, limits: CompensatorLimits | None = None, place: Place | None = None) -> None:
        self.model = model
        self._place = place
        self.limits = limits or CompensatorLimits()
        self._trusted_m = [_trusted_heights(item) for item in model.stack]
        self._bent = any("thrust" in effect.depends_on and not effect.adds_lag for effect in model.effects)

    def __call__(self, state: VehicleState, ground_down_m: float, thrust_n: float) -> Compensation:
        """Correction for `state` with the ground at `ground_down_m` (NED), where the rotors are to give `thrust_n`."""
        here = self.surroundings(state, ground_down_m)
        return Compensation(self.thrust_ratio(here, thrust_n), self.force_ned_n(here, thrust_n), here.trust)

    def surroundings(self, state: VehicleState, ground_down_m: float, motion: Motion | None = None) -> Surroundings:
        """Conditions of the effects at `state`, with the ground at `ground_down_m` (NED).

        `motion` takes the place of the state's position and velocity.
        """
        if not self.model.stack:
            return EMPTY
        (north, east, down), velocity = motion or Motion(state.position_ned_m, state.velocity_ned_m_s)
        c = conditions(
            self.model.vehicle,
            ground_down_m - down,
            rotate_inverse(state.attitude, velocity),
            state.attitude,
            state.time_s,
            state.battery_v,
            (north, east),
            self._place,
        )
        trusts = tuple([self._trust(c.height_m, trusted_m) for trusted_m in self._trusted_m])
        return Surroundings(self.model.in_air(c), trusts, min(trusts))

    def force_ned_n(self, here: Surroundings, thrust_n: float) -> Vec3:
        """Force of the effects besides the rotors' total thrust `thrust_n`, NED, N, limited to its band."""
        if not self.model.effects_on_body:
            return NOTHING.force_ned_n
        fx, fy, fz = self.model.side_force(self._felt_n(thrust_n), here.conditions, here.trusts)
        longest = self.limits.band * self.model.vehicle.weight_n
        length = math.sqrt(fx * fx + fy * fy + fz * fz)
        shrink = longest / length if length > longest else 1.0
        return rotate(here.conditions.attitude, (shrink * fx, shrink * fy, shrink * fz))

    def thrust_ratio(self, here: Surroundings, thrust_n: float) -> float:
        """Thrust of the rotors over the thrust to ask for, where they are to give `thrust_n`, limited to its band."""
        given_n = self._felt_n(thrust_n)
        ratio = self._ratio(here, given_n)
        return self._in_band(self._bent_ratio(here, given_n, ratio) if self._bent else ratio)

    def _bent_ratio(self, here: Surroundings, given_n: float, ratio: float) -> float:
        """Thrust ratio at which the rotors give `given_n`, from the `ratio` at which `given_n` is asked of them.

        The thrust given is taken for a power of the thrust asked: one secant step on logarithms, exact where the
        exponent is constant.
        """
        asked_n = given_n / self._in_band(ratio)
        there = self._ratio(here, asked_n)
        if asked_n == given_n or not (0.0 < ratio < math.inf and 0.0 < there < math.inf):
            return ratio
        power = 1.0 + math.log(there / ratio) / math.log(asked_n / given_n)
        if power < LEAST_POWER:
            return there
        return given_n / asked_n * math.pow(asked_n * there / given_n, 1.0 / power)

    def _ratio(self, here: Surroundings, asked_n: float) -> float:
        """Thrust given over thrust asked, where `asked_n` is asked in total and shared equally by the rotors."""
        n, total, ratio = self.model.vehicle.n_rotors, asked_n, 1.0
        by_effect = self.model.thrust_by_effect([asked_n / n] * n, here.conditions)
        for thrusts, trust in zip(by_effect, here.trusts, strict=True):
            before, total = total, sum(thrusts)
            if before != 0.0:  # what changes a thrust of nothing has no ratio
                ratio *= 1.0 + trust * (total / before - 1.0)
        return ratio

    def _felt_n(self, thrust_n: float) -> float:
        """Thrust, but at least a tenth of the weight: rotors that give nothing have no thrust ratio."""
        return max(thrust_n, 0.1 * self.model.vehicle.weight_n)

    def _in_band(self, ratio: float) -> float:
        return min(max(ratio, 1.0 - self.limits.band), 1.0 + self.limits.band)

    def _trust(self, height_m: float, trusted_m: tuple[float, float]) -> float:
        """Share of an effect's correction: 1 inside the heights of its data, falling linearly to 0 beyond them."""
        outside = max(trusted_m[0] - height_m, height_m - trusted_m[1], 0.0)
        return max(0.0, 1.0 - outside / self.limits.fade_m)


def _trusted_heights(item: StackedEffect) -> tuple[float, float]:
    """Lowest and highest rotor plane, m, in the data of a fitted effect that depends on height; infinite for others."""
    if item.fitted is None or item.fitted.height_m is None or "height_over_radius" not in item.effect.depends_on:
        return -math.inf, math.inf
    return item.fitted.height_m


class Unphysical(Kinds):
    """Warnings about a compensator that may fly, each with its template."""

    RISES = "{source}: the thrust ratio rises with height somewhere, no ground effect does"
    LOWER_NEAR_GROUND = "{source}: the thrust ratio is lower near the ground than far from it, no ground effect is"


def check_compensator(model: Model, lowest_m: float, highest_m: float, source: str) -> list[Fact]:
    """Refuse a compensator that must not fly; return warnings about one that may but looks unphysical.

    The thrust ratio is evaluated in level hover from `lowest_m` to `highest_m` (height of the rotor plane). That it
    is below 1 near the ground is a warning, as a weak rotor or a fit's noise can make it so; an effect that is known
    to be wrong in flight says so itself (`not_for_flight`) and is refused.

    Raises
    ------
    SettingsError
        The ratio has a pole, is not positive or not finite somewhere in that range, or an effect is not for flight.
    """
    for effect in model.effects:
        if effect.not_for_flight:
            raise SettingsError(
                f"{source}: {effect.name} cannot be compensated ({effect.not_for_flight}), "
                f"expected a model without it: not safe to fly"
            )
    steps = 200
    heights = [lowest_m + (highest_m - lowest_m) * i / steps for i in range(steps + 1)]
    for z in heights:
        ratio = _hover_ratio(model, z)
        if not math.isfinite(ratio) or ratio <= 0.0:
            raise SettingsError(
                f"{source}: the thrust ratio is {ratio:g} at a rotor height of {z:.2f} m, "
                f"expected a finite positive number from {lowest_m:g} to {highest_m:g} m: not safe to fly"
            )
    # Below a ceiling thrust does rise with height; the ground's part is judged without it.
    open_sky = replace(model, vehicle=model.vehicle.model_copy(update={"ceiling_m": None}))
    ratios = [_hover_ratio(open_sky, z) for z in heights]
    warnings = []
    if any(b > a + 1e-6 for a, b in itertools.pairwise(ratios)):
        warnings.append(fact(Unphysical.RISES, source=source))
    if ratios[0] < 0.999 * ratios[-1]:
        warnings.append(fact(Unphysical.LOWER_NEAR_GROUND, source=source))
    return warnings


def _hover_ratio(model: Model, height_m: float) -> float:
    """Thrust over nominal thrust in level hover with the rotor plane at `height_m`; nan where it has no value."""
    vehicle = model.vehicle
    rotors = [vehicle.weight_n / vehicle.n_rotors] * vehicle.n_rotors
    c = Conditions(height_m, (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0))
    try:
        return float(sum(model.rotor_thrust(rotors, c))) / vehicle.weight_n
    except (ArithmeticError, ValueError):  # division by zero, overflow, a root of a negative number
        return math.nan
