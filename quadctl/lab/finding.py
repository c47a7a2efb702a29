"""Findings: facts that an analysis has found; only `quadctl.lab.words` makes sentences of them."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any

from quadctl.effects import Effect


class Kind(StrEnum):
    """Kinds of findings, as `findings` in JSON names them, with the facts of each."""

    MISSING = "missing"
    """`families`, in the order of adding."""
    ONLY_SMALL = "only small"
    """`families` that are measured, but too small to be called missing."""
    NONE = "none"
    UNEXPLAINED = "unexplained"
    LITTLE_UNEXPLAINED = "little unexplained"
    NOTHING_SIGNIFICANT = "nothing significant"
    NONE_BUT_MORE_THAN_NOISE = "none, but more than noise"
    NONE_BUT_LARGER_HELD_OUT = "none, but larger held out"
    """`flights` of the search."""
    NONE_BUT_FITTED_TO_HELD_OUT = "none, but fitted to held out"
    """`flights` that are held out."""
    NONE_BUT_FITTED_TO_OTHERS = "none, but fitted to others"
    """`flights` of the fit."""
    NONE_BUT_NOT_FITTED = "none, but not fitted"
    EFFECT = "effect"
    """`effect`, `parameters` (each with `value` and `ci95`)."""
    ERROR = "error"
    """`before`, `after`, m/s^2, `drop`; held out."""
    ERROR_LEFT = "error left"
    """`rmse`, m/s^2; held out, where nothing was added."""
    PART_UNEXPLAINED = "part unexplained"
    CONFOUNDED = "confounded"
    """`family`, `others`: families that these data do not distinguish from it."""
    FLIGHTS_DIFFER = "flights differ"
    """`effect`, `parameter`, `flights`: by name `value` and `ci95` by that flight alone, `p`."""
    NEXT_FLIGHT = "next flight"
    """`mission`."""
    UNSEEN_BY_CHOICE = "unseen by choice"
    """`before`, `after`, m/s^2, `data`, `searches`, `found`: families with the number of searches that found them."""
    SEEN_BY_CHOICE = "seen by choice"
    WHOLE_FLIGHTS = "whole flights"
    """`before`, `after`, m/s^2, with whole flights held out."""
    PART_SEARCHED = "part searched"
    """`searched`, `all`: numbers of samples."""
    SMALL = "small"
    """`effect`, `parameters`, `alternatives`: effects that explain as much; `before`, `after`: held-out error, `unit`;
    `off_m`, `off_after_s`: by how much the effect alone moves the vehicle, and after which time, null where no flight
    lasts so long; `depends_on`, `distinguished_by`: what would make it matter."""
    USUAL = "usual"
    """`effect`, `parameters`, `p`."""
    LATE_POSITION = "late position"
    """`delay_ms`, `low_ms`, `high_ms`; `usual_ms` of usual positions."""
    LATE_OR_LAGGING = "late position or motor lag"
    """The same."""
    ATTITUDE_OFF = "attitude off"
    """`flights`: by name, `roll_deg` and `pitch_deg` by which the vehicle leans more than its motion capture says, as
    its motion and its accelerometer show; `largest_deg`."""
    ATTITUDE_OR_TILT = "attitude off or thrust tilted"
    """The same where no accelerometer tells it from a tilted thrust."""
    UNTRIED = "untried"
    """`effect`, `variable`, `needed`, `unit`, `span`."""
    UNTRIED_FOLLOWS = "untried, follows disturbances"
    """`effect`, `variable`, `needed`, `unit`."""
    # Reasons for which the decision rule has not called a candidate missing.
    NOT_FITTED = "not fitted"
    """`chosen`: the formula of its family that explains more, where that is in the model."""
    NO_DROP = "no drop"
    NOT_SIGNIFICANT = "not significant"
    """`p`, `limit`."""
    ZERO = "zero"
    """`parameters` that may be 0."""
    UNDETERMINED = "undetermined"
    AT_BOUND = "at bound"
    IMPLAUSIBLE = "implausible"
    HARMFUL = "harmful"
    NOT_IN_MOMENTS = "not in moments"
    AS_USUAL = "as usual"
    IMPLIED = "implied"
    TOO_SMALL = "too small"
    """`share`, `explained`, `least_share`, `least`, `enough`: of an axis' error, and m/s^2."""
    NOT_DISTINCT = "not distinct"
    """`distinguished_by`."""
    SMALLER_THAN_SMALL = "smaller than what is small"
    OTHER_FORM = "other form"
    """`chosen`, `drop`, `chosen_drop`."""
    NOT_NEEDED = "not needed"
    """`chosen`, `drop`, `chosen_drop`."""


@dataclass(frozen=True)
class Finding:
    """Fact of one kind."""

    kind: Kind
    facts: Mapping[str, Any] = field(default_factory=dict)
    """Numbers and names, as JSON can hold them."""

    def to_dict(self) -> dict[str, Any]:
        return {"kind": self.kind.value, **self.facts}


def parameters_of(effect: Effect, ci95: Mapping[str, tuple[float, float]]) -> dict[str, Any]:
    """Facts `effect` and `parameters`, each with `value`, `ci95` and `unit`; one that is chosen and not fitted has no
    interval."""
    units = {p.name: p.unit for p in effect.parameters()}
    parameters = {
        name: {"value": v, "ci95": list(ci95[name]) if name in ci95 else None, "unit": units.get(name, "")}
        for name, v in effect.values().items()
    }
    return {"effect": effect.name, "parameters": parameters}
