"""Words of findings and verdicts: one table of templates for the terminal, the page and the report.

Those of comparisons stand with the formats of numbers in `quadctl.lab.comparison.wording`.
"""

from collections.abc import Mapping
from enum import unique

from quadctl.lab.comparison.reservations import vehicle_in_words
from quadctl.lab.comparison.wording import FORMATS, IF_IT_FLEW, listed, parameters_in_words, plain, sentence
from quadctl.lab.finding import Finding, Kind
from quadctl.lab.flights.flight import SPAN_NAMES
from quadctl.vehicle import Vehicle
from quadctl.words import By, Fact, Format, Kinds, Template, When, Words, estimate

_FAMILIES = When("alternatives", "{alternatives:alternatives}", "{families:families}")
_VERDICTS: Mapping[Kind, Template] = {
    Kind.MISSING: ("Missing: ", _FAMILIES),
    Kind.ONLY_SMALL: "Nothing that matters much is missing; measured, but small: {families:families}",
    Kind.NONE: "No known effect is missing: none reduces the held-out error enough to matter",
    Kind.UNEXPLAINED: "Something is missing that no known effect explains",
    Kind.LITTLE_UNEXPLAINED: "A little is left that no known effect explains",
    Kind.NOTHING_SIGNIFICANT: "No missing effect is found",
    Kind.NONE_BUT_MORE_THAN_NOISE: "No known effect is missing, but not all of the error is noise",
    Kind.NONE_BUT_LARGER_HELD_OUT: "No known effect is missing in {flights:flights}; the held-out error is larger",
    Kind.NONE_BUT_FITTED_TO_HELD_OUT: "No further effect is missing, but the model is fitted to {flights:list}, "
    "which is held out",
    Kind.NONE_BUT_FITTED_TO_OTHERS: "No further effect is missing, but the model is fitted to {flights:list} only",
    Kind.NONE_BUT_NOT_FITTED: "No further effect is missing, but the model was not refitted to these flights",
}
TEMPLATES: Mapping[Kind, Template] = {
    **{kind: (template, IF_IT_FLEW, ".") for kind, template in _VERDICTS.items()},
    Kind.EFFECT: "{effect}: {parameters:parameters}",
    Kind.ERROR: "Held-out acceleration error, per-flight bias removed: {before:number} → {after:m/s²} ({drop:change}).",
    Kind.ERROR_LEFT: "Held-out acceleration error, per-flight bias removed: {rmse:m/s²}; `quadctl compare` gives the "
    "reference error.",
    Kind.PART_UNEXPLAINED: "Part of the remaining error depends on the logged variables; no known effect explains it.",
    Kind.CONFOUNDED: "{family:Family} or {others:others}: these data do not distinguish them.",
    Kind.FLIGHTS_DIFFER: "The flights differ in {parameter} of {effect} (p {p:p}): {flights:parameters}.",
    Kind.NEXT_FLIGHT: "Next flight: {mission}; `quadctl suggest` simulates all missions and ranks them.",
    Kind.UNSEEN_BY_CHOICE: "On data that neither the fit nor the choice of effects has seen: {before:number} → "
    "{after:m/s²} on {data} ({searches} searches; {found:counts}).",
    Kind.SEEN_BY_CHOICE: "The effects were chosen by the held-out error, which may thus be too small: "
    "--nested tests that, several times slower.",
    Kind.WHOLE_FLIGHTS: "With whole flights held out, per-flight bias not removed: {before:number} → {after:m/s²}.",
    Kind.PART_SEARCHED: "The search used {searched} of {all} samples, in stretches spread over the flights: errors are "
    "of these, parameters of what is missing of all samples.",
    Kind.SMALL: (
        "Measured, but small in these flights: {effect}, {parameters:parameters}{alternatives:or}. Held-out error: "
        "{before:number} → {after:number} {unit:unit}; alone it moves the vehicle {off_m:g} m off ",
        When("off_after_s", "after {off_after_s:.1f} s", "in no part of these flights"),
        ". ",
        When(
            "depends_on", "It matters more over larger ranges of {depends_on:variables}", "It is the same in all flight"
        ),
        ". `quadctl add {effect} MODEL.yaml LOG... -o NEW.yaml` adds it.",
    ),
    Kind.USUAL: "Significant (p {p:p}), but within the per-flight bias of any real vehicle: {effect}, "
    "{parameters:parameters}.",
    Kind.LATE_POSITION: "The position comes {delay_ms:.0f} ms [{low_ms:.0f}, {high_ms:.0f}] after the rotors' signal, "
    "and no lag of the motors explains it: what brings or filters the position is slow. It has been taken out.",
    Kind.LATE_OR_LAGGING: "The force comes {delay_ms:.0f} ms [{low_ms:.0f}, {high_ms:.0f}] after the rotors' signal. "
    "Of that, {usual_ms:.0f} ms are taken for a late position; the rest looks like a lag of the motors, and may be "
    "either.",
    Kind.ATTITUDE_OFF: "The attitude by motion capture is off by up to {largest_deg:.1f}° ({flights:leans}): the "
    "motion and the accelerometer agree on that. It has been taken out.",
    Kind.ATTITUDE_OR_TILT: "The attitude by motion capture is off, or the thrust is tilted, by up to "
    "{largest_deg:.1f}° ({flights:leans}): without an accelerometer the two are alike. It has been taken out.",
    Kind.UNTRIED: "{effect} (it needs {variable:span} over a range of {needed:g} {unit}; in these data {span:.2g})",
    Kind.UNTRIED_FOLLOWS: "{effect} (it needs manoeuvres that change {variable:span} by {needed:g} {unit}; in these "
    "data mostly the controller's disturbance rejection changes it)",
    Kind.NOT_FITTED: (
        "it was not fitted: to first order it explains ",
        When("chosen", "less than {chosen}", "no more than noise, or less than another formula of its family"),
    ),
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


_IMPROVES = "It lowers the held-out error by {drop:.0%}, on the {axis} axis by {largest_drop:.0%}."


def _leans(flights: Mapping[str, Mapping[str, float]]) -> str:
    """Roll and pitch of each flight; of many, of the first three."""
    shown = [
        f"{name}: roll {lean['roll_deg']:+.1f}°, pitch {lean['pitch_deg']:+.1f}°" for name, lean in flights.items()
    ]
    more = [f"{len(shown) - 3} more"] if len(shown) > 3 else []
    return "; ".join([*shown[:3], *more])


_FORMATS: Mapping[str, Format] = {
    **FORMATS,
    "family": plain,
    "Family": lambda family: sentence(plain(family)),
    "others": lambda names: " or ".join(map(plain, names)),
    "alternatives": lambda found: "; ".join(" or ".join(map(plain, (f, *others))) for f, others in found.items()),
    "list": listed,
    "names": ", ".join,
    "any": " or ".join,
    "or": lambda names: f"; or, explaining as much, {listed(names)}" if names else "",
    "counts": lambda found: ", ".join(f"{plain(f)} in {n}" for f, n in found.items()) or "nothing in any",
    "parameters": parameters_in_words,
    "leans": _leans,
    "unit": lambda unit: str(unit).replace("^2", "²"),
    "span": lambda name: str(SPAN_NAMES.get(name, name)),
    "Semicolons": lambda parts: sentence("; ".join(map(str, parts))),
    "value": lambda found: " ".join(estimate(found[0], found[1:])),
    "sign": lambda p: "< 1e-4" if p < 1e-4 else f"= {p:.2g}",
}


_WORDS = Words(_FORMATS)


@unique
class Answer(Kinds, words=_WORDS):
    """Answers of an analysis that are no findings of a diagnosis, each with its template."""

    ADDED = "Added to {model}: {families:families}."
    FOUND_AND_ADDED = ("Found and added: ", _FAMILIES, IF_IT_FLEW, ".")
    LEAVE_OUT = ("{effect} does not lower the held-out error significantly: leave it out", IF_IT_FLEW, ".")
    LOWERS = ("{effect} lowers the held-out error by {drop:percent}", IF_IT_FLEW, ".")
    ON_FLIGHTS = "on {flights:flights}"
    ON_UNSEEN = "on {flights:flights}, which no fit has seen"
    FALLS = "The error on the unseen data falls by {drop:percent} (95% interval {low:percent} to {high:percent})."
    LEFT = "The remaining error is {times:.2f} times the reference error of {floor_m_s2:roughly}."
    LEFT_WITH = (
        "With these effects, the remaining error is {times:.2f} times the reference error of {floor_m_s2:roughly}."
    )
    ERROR_OF_MODEL = (
        "The acceleration error of the model is {error_m_s2:m/s²} (95% interval {low:.3g} to {high:.3g}); a flexible "
        "regression on all logged variables leaves {floor_m_s2:roughly}."
    )
    TRIED = (
        "{tried:count effect} of the catalogue were tried beside {model}, each judged on {held_out}; {fitted} of "
        "them were fitted. p-values account for autocorrelation and for the number of candidates tried."
    )
    NOT_FITTED = "Not fitted, as to first order no better than noise or another formula of the family: {effects:names}."
    REFERENCE = "The reference error is {floor_m_s2:roughly}."
    OTHERS_THAN = ("{finding}", When("distinguished", " {distinguished:Semicolons}."))
    DISTINGUISHED = "{family:family} is distinguished by {distinguished_by}"
    NONE_AS_WELL = "No other effect explains these data equally well."
    SUPPORTED = _IMPROVES
    NOT_SEPARATE = f"{_IMPROVES} These data do not separate it from others (distinguished by {{distinguished_by}})."
    NO_LARGER = "It is no larger than the per-flight biases of any real vehicle."
    NOT_SUPPORTED = "The held-out data do not support it."
    NOTE = "Note: {remark}."
    AS_AT_STEP = (
        "The search refits the model to these flights, so that its error differs a little from that of the file's "
        "parameters."
    )
    NO_FORM = "The residual depends on the logged variables, but no effect of the catalogue describes how."
    NONE_HELPS = "No effect of the catalogue, added to this model, reduces the held-out error enough to matter."
    FOR_FITTING = "{finding} The flights are those for fitting."
    OTHER_ERROR = "{family:Family} changes the held-out {error} by {drop:change}."
    BY_FLIGHTS = By(
        "same",
        {True: "With whole flights held out the error is {before:m/s²}."},
        "After adding all missing effects the error with whole flights held out is {after:m/s²} instead of "
        "{before:m/s²}; with blocks of time held out it is {on_blocks:m/s²}.",
    )
    INSTEAD = (
        "It explains the same as {family:family}: beside that it changes nothing, in its place it would. These data "
        "do not tell which of the two it is."
    )
    WHY_NOT = "Why not: {reason}."
    WITHOUT_AND_WITH = "Held-out acceleration error, without and with {effect}"
    WITH_AND_WITHOUT = "Held-out acceleration error, with and without {effect}"
    DOES_NOT_LOWER = "The effect does not lower the held-out error significantly: leave it out."
    WORSE_WITHOUT = "The held-out data support {effect}: the model is worse without it."
    NO_WORSE_WITHOUT = "The held-out data do not support {effect}: leave it out."
    ONE_AND_EACH = "Held-out acceleration error, with one weight for all surfaces and with one for each"
    SURFACES_ALIKE = "The surfaces cannot be told apart in these data (p = {p:.2g}): one weight is enough."
    SURFACES_DIFFER = (
        "The surfaces differ: by up to {most:.1%} of the thrust with the rotor plane at {height_m:g} m (p {p:sign})."
    )
    CHANGED = (
        "{flight}: {parameter} of {effect} is {now:value}, was {before:value}",
        When("since", " (first in {since})"),
        ".",
    )
    MISSING_ON_TOP = "{flight}: missing on top of the model: {families:names}."
    NOT_DETERMINED = "{flight}: does not determine {parameters:names}."
    AT_LOWEST = (
        "At the lowest height flown, {height_over_radius:.2f} rotor radii, the rotors give {ratio:.3f} times the "
        "thrust they give far from the ground (",
        When("fitted", "95% interval {low:.3f} to {high:.3f}", "the form has no free parameter"),
        ").",
    )
    DOTS = (
        "Dots are the measured thrust divided by the prediction without this effect. They assume no form: where they "
        "differ from the curve, the fitted form is wrong."
    )
    HOLDS = "The model holds."
    HOLDS_NOT = "The model does not hold on these flights."


def in_words(found: Finding | Fact, vehicle: Vehicle | None = None) -> str:
    """Sentence, or of a reason the part of one, with typographic signs; a verdict that holds only if it was `vehicle`
    that flew says so."""
    facts = found.facts if vehicle is None else {**found.facts, "vehicle": vehicle_in_words(vehicle)}
    return found.kind.said(facts) if isinstance(found, Fact) else _WORDS.say(TEMPLATES[found.kind], facts)
