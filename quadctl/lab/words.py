"""Words of findings: one table of templates for the terminal, the page and the report."""

from collections.abc import Mapping, Sequence
from typing import Any

from quadctl.lab.comparison.wording import (
    change_in_words,
    flights_in_words,
    interval_in_words,
    listed,
    number,
    p_in_words,
    percent,
    plain,
    quantity,
)
from quadctl.lab.finding import Finding, Kind
from quadctl.lab.flights.flight import SPAN_NAMES, VARIABLE_NAMES
from quadctl.words import Format, Words

TEMPLATES: Mapping[Kind, str] = {
    Kind.MISSING: "Missing: {families:families}.",
    Kind.ONLY_SMALL: "Nothing that matters much is missing; measured, but small: {families:families}.",
    Kind.NONE: "No known effect is missing: none reduces the held-out error enough to matter.",
    Kind.UNEXPLAINED: "Something is missing that no known effect explains.",
    Kind.LITTLE_UNEXPLAINED: "A little is left that no known effect explains.",
    Kind.NOTHING_SIGNIFICANT: "Nothing significant is missing.",
    Kind.NONE_BUT_MORE_THAN_NOISE: "No known effect is missing, but not all of the error is noise.",
    Kind.NONE_BUT_LARGER_HELD_OUT: "No known effect is missing in {flights:flights}; the held-out error is larger.",
    Kind.NONE_BUT_FITTED_TO_HELD_OUT: "No further effect is missing, but the model is fitted to {flights:list}, "
    "which is held out.",
    Kind.NONE_BUT_FITTED_TO_OTHERS: "No further effect is missing, but the model is fitted to {flights:list} only.",
    Kind.NONE_BUT_NOT_FITTED: "No further effect is missing, but the model is not fitted to these flights.",
    Kind.EFFECT: "{effect}: {parameters:parameters}",
    Kind.ERROR: "Held-out acceleration error: {before:number} → {after:m/s²} ({drop:change}).",
    Kind.PART_UNEXPLAINED: "Part of the remaining error depends on the logged variables; no known effect explains it.",
    Kind.CONFOUNDED: "These data do not distinguish {family:family} from {others:others}: it may be that instead.",
    Kind.FLIGHTS_DIFFER: "The flights differ in {parameter} of {effect} (p {p:p}): {flights:parameters}.",
    Kind.NEXT_FLIGHT: "Next flight: {mission}; `quadctl suggest` compares all missions.",
    Kind.UNSEEN_BY_CHOICE: "On data that neither the fit nor the choice of effects has seen: {before:number} → "
    "{after:m/s²} on {data} ({searches} searches; {found:counts}).",
    Kind.SEEN_BY_CHOICE: "These errors are of held-out data, but the effects were chosen with the same data: `quadctl "
    "diagnose --nested` repeats the choice without them.",
    Kind.WHOLE_FLIGHTS: "With whole flights held out: {before:number} → {after:m/s²}.",
    Kind.PART_SEARCHED: "The search has seen {searched} of {all} samples, in stretches spread over the flights, and so "
    "have its errors; the parameters of what is missing are fitted to all samples.",
    Kind.SMALL: "Measured, but small in these flights: {effect}, {parameters:parameters}{alternatives:or}. Held-out "
    "error: {before:number} → {after:number} {unit:unit}; alone it moves the vehicle {off_m:g} m off "
    "{off_after_s:after}. {depends_on:more}. `quadctl add {effect} MODEL.yaml LOG... -o NEW.yaml` adds it.",
    Kind.USUAL: "There (p {p:p}), but no larger than the per-flight biases of any real vehicle: {effect}, "
    "{parameters:parameters}.",
    Kind.LATE_POSITION: "The position comes {delay_ms:.0f} ms [{low_ms:.0f}, {high_ms:.0f}] after the rotors' signal, "
    "and no lag of the motors explains it: what brings or filters the position is slow. It has been taken out.",
    Kind.ATTITUDE_OFF: "The attitude by motion capture is off by up to {largest_deg:.1f}° ({flights:leans}): the "
    "motion and the accelerometer agree on that. It has been taken out.",
    Kind.ATTITUDE_OR_TILT: "The attitude by motion capture is off, or the thrust is tilted, by up to "
    "{largest_deg:.1f}° ({flights:leans}): without an accelerometer the two are alike. It has been taken out.",
    Kind.UNTRIED: "{effect} (to distinguish it from others, {variable:span} must span {needed:g} {unit}; in these data "
    "it spans {span:.2g})",
    Kind.UNTRIED_FOLLOWS: "{effect} (to distinguish it from others, {variable:span} must span {needed:g} {unit}; in "
    "these data the thrust follows disturbances more than the motion)",
    Kind.NO_DROP: "it does not reduce the held-out error",
    Kind.NOT_SIGNIFICANT: "its gain is not significant: p {p:p}, expected below {limit:g}",
    Kind.ZERO: "these data do not show that {parameters:any} differs from 0",
    Kind.UNDETERMINED: "these data determine none of its parameters",
    Kind.AT_BOUND: "a parameter ran into a bound of what is physically possible",
    Kind.IMPLAUSIBLE: "its fit is not physically plausible",
    Kind.HARMFUL: "it makes a moment worse, as a stand-in for another effect does",
    Kind.NOT_IN_MOMENTS: "not every moment in which its physics shows has a smaller error",
    Kind.AS_USUAL: "it is no larger than the per-flight biases of any real vehicle",
    Kind.IMPLIED: "the other effects of the model imply it",
    Kind.TOO_SMALL: "it is there, but small: {share:.1%} of an axis' error and {explained:.2g} m/s², expected more "
    "than {least_share:.0%} and {least:g} m/s², or {enough:g} m/s²",
    Kind.NOT_DISTINCT: "these data do not distinguish it from what it is confounded with; what would: "
    "{distinguished_by}",
    Kind.SMALLER_THAN_SMALL: "what explains more is too small to be called missing",
    Kind.OTHER_FORM: "another form of the same effect, no better than {chosen} (it explains {drop:percent} of the "
    "error, that one {chosen_drop:percent})",
    Kind.NOT_NEEDED: "it is not needed beside {chosen}, which was found first or explains more (it explains "
    "{drop:percent} of the error, that one {chosen_drop:percent})",
}


def in_words(finding: Finding) -> str:
    """Sentence, or of a reason the part of one, with typographic signs."""
    return _WORDS.say(TEMPLATES[finding.kind], finding.facts)


def _after(time_s: float | None) -> str:
    return "in no part of these flights" if time_s is None else f"after {time_s:.1f} s"


def _more(variables: Sequence[str]) -> str:
    """Sentence on what makes an effect of these variables matter more."""
    if not variables:
        return "It is the same in all flight"
    return f"It matters more over larger ranges of {listed([VARIABLE_NAMES[name] for name in variables])}"


def _leans(flights: Mapping[str, Mapping[str, float]]) -> str:
    """Roll and pitch of each flight; of many, of the first three."""
    shown = [
        f"{name}: roll {lean['roll_deg']:+.1f}°, pitch {lean['pitch_deg']:+.1f}°" for name, lean in flights.items()
    ]
    more = [f"{len(shown) - 3} more"] if len(shown) > 3 else []
    return "; ".join([*shown[:3], *more])


def _parameters(values: Mapping[str, Mapping[str, Any]]) -> str:
    lines = [
        f"{name} = {p['value']:.4g}" + (f" {interval_in_words(p['value'], tuple(p['ci95']))}" if p["ci95"] else "")
        for name, p in values.items()
    ]
    return ", ".join(lines) or "no parameters"


_FORMATS: Mapping[str, Format] = {
    "families": lambda names: listed([plain(name) for name in names]),
    "family": plain,
    "others": lambda names: " or ".join(map(plain, names)),
    "list": listed,
    "any": " or ".join,
    "or": lambda names: f"; or, explaining as much, {listed(names)}" if names else "",
    "counts": lambda found: ", ".join(f"{plain(f)} in {n}" for f, n in found.items()) or "nothing in any",
    "flights": flights_in_words,
    "parameters": _parameters,
    "leans": _leans,
    "after": _after,
    "more": _more,
    "unit": lambda unit: str(unit).replace("^2", "²"),
    "span": lambda name: str(SPAN_NAMES.get(name, name)),
    "number": number,
    "m/s²": quantity,
    "percent": percent,
    "change": change_in_words,
    "p": p_in_words,
}

_WORDS = Words(_FORMATS)
