"""Words of comparisons, for the terminal, the page and the report: formats of numbers, and one table of templates."""

from collections.abc import Mapping, Sequence
from enum import unique
from typing import Any

from quadctl.effects import Effect
from quadctl.frames import GRAVITY_M_S2
from quadctl.lab.flights.dataset import FOLDS, Dataset
from quadctl.lab.flights.flight import VARIABLE_NAMES, VARIABLE_UNITS
from quadctl.lab.flights.preparation import BLOCK_S
from quadctl.words import NEARLY_ZERO, By, Fact, Format, Kinds, Template, When, Words, estimate, fact

UNIT = "m/s²"
FLOOR = (
    "what a regression of a model's residual on all logged variables leaves, held out; of the models compared, the "
    "smallest"
)
"""Meaning of the reference error."""
NO_PARAMETERS = "no free parameters"
ERRORS = {"total": "acceleration error", "turning": "moment error", "sensing": "accelerometer error"}
"""Name of the error of each measured group."""


def on_terminal(text: str) -> str:
    """The text with the signs that every terminal has."""
    return text.replace("m/s²", "m/s^2").replace("→", "->").replace("\u2212", "-")


def number(value: float) -> str:
    """Format with three significant digits."""
    return f"{value:#.3g}".removesuffix(".")


def quantity(value: float) -> str:
    """Format an acceleration with its unit."""
    return f"{number(value)} {UNIT}"


def roughly(value: float) -> str:
    """Format an acceleration that is known roughly, as a reference error is, with two digits and its unit."""
    return f"{value:#.2g}".removesuffix(".") + f" {UNIT}"


def percent(share: float) -> str:
    return f"{share:.0%}".replace("-", "\u2212")


def share_of_g(value: float) -> str:
    """Format an acceleration, m/s^2, as a share of gravity with two digits: `4.1%`."""
    share = 100.0 * value / GRAVITY_M_S2
    return f"{share:.0f}%" if share >= 9.95 else f"{share:.1f}%" if share >= 0.095 else f"{share:.2f}%"


def p_in_words(p: float) -> str:
    """Format a p-value, such as `< 0.0001`, `0.0031`, `0.62`."""
    return "< 0.0001" if p < 1e-4 else f"{p:.2g}" if p < 0.1 else f"{p:.2f}"


def change_in_words(drop: float) -> str:
    """Format the change of an error from its relative drop, with a true minus sign; `0%` where it rounds to zero."""
    percent = round(-100.0 * drop)
    return f"{percent:+d}%".replace("-", "\u2212") if percent else "0%"


def plus(value: float, decimals: int = 3) -> str:
    """Format with sign and so many decimals; what rounds to zero has no sign."""
    rounded = round(value, decimals)
    return (f"{rounded:+.{decimals}f}" if rounded else f"{0.0:.{decimals}f}").replace("-", "\u2212")


def parameters_in_text(effect: Effect, ci95: Mapping[str, tuple[float, float]]) -> str:
    """Fitted parameters with units and 95 % intervals: `a = 0.114 [0.1, 0.12], b = 5.4 1/m [5, 5.8]`."""
    values, units = effect.values(), {p.name: f" {p.unit}" if p.unit else "" for p in effect.parameters()}
    parts = []
    for name, ci in ci95.items():
        value, interval = estimate_in_text(values[name], ci)
        parts.append(f"{name} = {value}{units[name]} {interval}")
    return ", ".join(parts) or NO_PARAMETERS


def parameter_lines(parameters: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """Parameters, as `parameters_of` gives them, with units and 95 % intervals, one a line: `b = 5.4 1/m [5.0, 5.8]`.

    One that was chosen beside those that were fitted, from the data or from the literature: `c = 1 (chosen)`.
    """
    are_fitted = any(p["ci95"] for p in parameters.values())
    others = " (chosen)" if are_fitted else ""
    lines = []
    for name, p in parameters.items():
        value, interval = estimate(p["value"], tuple(p["ci95"])) if p["ci95"] else (f"{p['value']:.4g}", "")
        unit = f" {p['unit']}" if p.get("unit") else ""
        lines.append(f"{name} = {value}{unit}{f' {interval}' if interval else others}")
    return lines


def parameters_in_words(parameters: Mapping[str, Mapping[str, Any]]) -> str:
    """Parameters with 95 % intervals in one line: `a = 0.114 [0.10, 0.12], c = 1 (chosen)`."""
    return ", ".join(parameter_lines(parameters)) or "no parameters"


def estimate_in_text(value: float, ci95: tuple[float, float] | None) -> tuple[str, str]:
    """As `estimate`, with a true minus sign; without an interval, the value with four digits."""
    shown, interval = (f"{value:.4g}", "") if ci95 is None else estimate(value, ci95)
    shown = shown if abs(value) > NEARLY_ZERO else "0"
    return shown.replace("-", "\u2212"), interval.replace("-", "\u2212")


def flights_in_words(names: Sequence[str]) -> str:
    return listed(names) if len(names) <= 3 else f"{len(names)} flights"


def listed(words: Sequence[str]) -> str:
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} and {words[-1]}"


def plain(family: str) -> str:
    return family.replace("_", " ")


def sentence(text: str) -> str:
    return text[:1].upper() + text[1:]


def ended(text: str) -> str:
    """Sentence with a full stop at its end, unless it is a question."""
    return text if text.endswith(("?", ".")) else f"{text}."


def label_of(variable: str) -> str:
    """Axis label of a variable with its unit, such as `climb rate / m/s`."""
    return f"{VARIABLE_NAMES[variable]} / {VARIABLE_UNITS[variable]}"


IF_IT_FLEW: Template = When("vehicle", ", if the vehicle is {vehicle}")
"""Condition of a verdict, before its full stop (see `reservations.vehicle_in_words`)."""

_PUSH: Template = By(
    "direction",
    {
        "more": "the vehicle gets more thrust than the model says, by {weight_share:.1%} of its weight",
        "less": "the vehicle gets less thrust than the model says, by {weight_share:.1%} of its weight",
    },
    "the vehicle is pushed {direction} by {size_m_s2:.2f} m/s² more than the model says",
)
_FITTED: Template = By(
    "fitted",
    {
        "these": " fitted to {reference:flights}",
        "others": " fitted to the other flights each time",
        "all": " fitted to all flights",
    },
)
_JUDGED: Template = ("{judged:flights}", When("differs_most", ", which differs most,"))
_PREDICTS: Template = ("The model", _FITTED, " predicts ", _JUDGED)
_LIMIT = "{limit_m_s2:number}, {close:percent} of the error on {reference:flights}"
_BIAS: Template = When("whole_flights", "per-flight bias not removed", "per-flight bias removed")
_HELD_OUT: Template = When(
    "whole_flights",
    "held-out flights (cross-validation)",
    f"held-out blocks of {BLOCK_S:.0f} s ({FOLDS}-fold cross-validation)",
)
_REMAINS = ("An error of {error_m_s2:m/s²} remains", When("flights", " on the held-out {flights:listed}"))


NAMED_FLIGHTS = 2
"""Most flights that a sentence names."""


MOSTLY, THROUGHOUT = "mostly in {0.flight} ({0.begin_s:.0f} to {0.end_s:.0f} s)", "throughout {0.flight}"


def _stretches(found: Sequence[Any]) -> str:
    """`mostly in HOVERING.csv (12 to 31 s)`, `throughout HOVERING.csv`; of many flights, the first."""
    parts = [(THROUGHOUT if stretch.whole else MOSTLY).format(stretch) for stretch in found]
    return listed(parts) if len(parts) <= NAMED_FLIGHTS else f"in {len(parts)} flights, {parts[0]}"


FORMATS: Mapping[str, Format] = {
    "listed": lambda words: listed(list(map(str, words))),
    "Listed": lambda names: sentence(listed(names)),
    "families": lambda names: listed([plain(name) for name in names]),
    "semicolons": lambda parts: "; ".join(map(str, parts)),
    "flights": flights_in_words,
    "stretches": _stretches,
    "variable": lambda name: str(VARIABLE_NAMES[name]),
    "variables": lambda names: listed([VARIABLE_NAMES[name] for name in names]),
    "unit": lambda name: str(VARIABLE_UNITS[name]),
    "number": number,
    "m/s²": quantity,
    "roughly": roughly,
    "percent": percent,
    "of_g": share_of_g,
    "change": change_in_words,
    "p": p_in_words,
    "end": lambda end: f"{end:.3g}".replace("-", "\u2212"),
    "signed": lambda mean: f"{mean:+.2f}".replace("-", "\u2212"),
    "interval": lambda ends: "[{:+.2g}, {:+.2g}]".format(*ends).replace("-", "\u2212"),
    "range": lambda ends: "from {:+.2g} to {:+.2g} m/s² (95%)".format(*ends).replace("-", "\u2212"),
}


@unique
class Said(Kinds, words=Words(FORMATS)):
    """Facts about the errors of a model, each with its template."""

    VARIANCE = When(
        "better",
        "The model explains {explained:percent} of the acceleration's variance.",
        "The model is worse than predicting the mean acceleration.",
    )
    NO_FAILURE = ("{model} has no significant error in any range of a variable", IF_IT_FLEW, ".")
    OFFSET = (
        "On average over ",
        By("flights", {1: "the whole flight"}, "all flights"),
        " ",
        _PUSH,
        When("mostly_in", ", most of it in {mostly_in:and}"),
    )
    RANGE = (
        "At a {variable:variable} ",
        By(
            "at_edge",
            {(True, False): "below {high:end}", (False, True): "above {low:end}"},
            "from {low:end} to {high:end}",
        ),
        " {variable:unit} ",
        _PUSH,
        When(
            "average",
            (
                " (on average over all samples: ",
                By("axis", {"up": "{average_share:.1%}"}, "{average_m_s2:.2f} m/s²"),
                ")",
            ),
        ),
        When("stretches", ", {stretches:stretches}"),
    )
    DEPENDENCE = (
        "The {axis} residual depends on the {variable:variable} (mean {ends:and}): {share:.0%} of the squared "
        "error of this axis",
        When("also", "; the same error shows over {also:variables}, too"),
    )
    MEAN_AT = "{mean_m_s2:signed} m/s² at {at:end} {unit}"
    FAILS = ("{failure}", IF_IT_FLEW, ".")
    FOLLOWS = (
        By("flights", {1: "In this flight"}, "In these flights"),
        " the {variables:variables} ",
        By("one", {True: "changes"}, "change"),
        " mostly because the controller counters disturbances, so a dependence of the residual on ",
        By("one", {True: "it"}, "them"),
        " may come from the controller instead of a missing effect.",
    )
    UNEXPLAINED = "Along {axes:listed} no logged variable explains much of the error."
    ERROR_ALONG = "{axis} ({error_m_s2:m/s²}, {share:percent} of the squared error)"
    DIFFER = "Under this model the flights differ."
    AGREE = "Under this model the flights agree."
    MAY_AGREE = "Not known: whether the flights agree under this model."
    AS_LARGE = (
        "Under this model the error has the same size in each flight; whether its cause is the same is not known."
    )
    AGREEMENT = "{answer}: {reasons:semicolons}."
    OTHERWISE = (_PREDICTS, " otherwise than {reference:flights}")
    AS_WELL = (_PREDICTS, " as well as {reference:flights}")
    NOT_KNOWN = (
        "Whether the model",
        _FITTED,
        " predicts ",
        _JUDGED,
        " as well as {reference:flights} is not known from these flights",
    )
    BETTER_OR_WORSE = (
        _PREDICTS,
        " {verdict} than {reference:flights}, by {size_m_s2:m/s²} [{least_m_s2:number}, {most_m_s2:number}]",
    )
    ERRORS = "its error is {judged_m_s2:m/s²} on {judged:flights} and {reference_m_s2:m/s²} on {reference:flights}"
    TOO_SHORT = "one of them is too short for an interval"
    MAY_BE_MORE = f"the difference, {{ci95:range}}, may be more than what counts as equal, {_LIMIT}"
    IS_LESS = f"the difference, {{ci95:range}}, is less than {_LIMIT}"
    SHIFT = (
        "the mean residual {axis}",
        When("variable", " at a {variable:variable} from {low:.3g} to {high:.3g} {variable:unit}"),
        " is {judged_m_s2} m/s² on {judged:flights} and {reference_m_s2} m/s² on {reference:flights}, a difference of "
        "{difference_m_s2} m/s² {ci95:interval}",
    )
    NO_SHIFT = "nor do the mean residuals differ by more than {reach_m_s2:m/s²} along any axis"
    MAY_SHIFT = "whether the mean residuals agree is not known: they may differ by up to {reach_m_s2:m/s²} {axis}"
    IS_FLOOR = (*_REMAINS, ", no more than the reference error of {floor_m_s2:roughly}.")
    NEAR_FLOOR = (
        *_REMAINS,
        ", {above:percent} above the reference error of {floor_m_s2:roughly}; the difference is mostly {axis}.",
    )
    REMAINS = (
        *_REMAINS,
        ". A regression on all logged variables explains {explained:percent} of its square, mostly {axis}, and leaves "
        "{floor_m_s2:roughly}, the reference error",
        When(
            "others",
            "; without {others:variables} it explains {by_causes:percent}. A dependence on {others:variables} can be a "
            "missing effect, the error of a sensor, or the controller's answer to a disturbance: these flights do not "
            "tell",
        ),
        ".",
    )
    HELD_OUT = _HELD_OUT
    BIAS = _BIAS
    ON_HELD_OUT_FLIGHTS = "per-flight bias not removed, on the held-out {flights:listed}"
    AS_IT_STANDS = ("as it stands, ", _BIAS, ", on {flights:flights}")
    ON_HELD_OUT = (_BIAS, ", on ", _HELD_OUT)
    OTHER_FLIGHTS = "{effect} holds values of {logs:list}, which are used in this order for {flights:list}"
    THRUST_ASSUMED = "{names:Listed} assumed: a wrong mass or thrust would look the same"
    ASSUMED = "Assumed, and not measured: {names:listed}"
    OPEN_LOOP = (
        "A prediction over {horizon_s:g} s, not corrected by measurements, misses the position by {position} (RMSE); "
        "a constant velocity misses it by {held_m:number} m."
    )
    LOOKS_LIKE = "Looks like {families:families}: these data do not distinguish them."


def held_out(dataset: Dataset) -> Fact:
    """The parts of the data that the fits of a cross-validation leave out by turns."""
    return fact(Said.HELD_OUT, whole_flights=dataset.whole_flights)


def bias_of(seen: Dataset) -> Fact:
    """Part of the per-flight bias in an error on held-out parts of `seen`: of a flight which no fit has seen, it is
    not known."""
    return fact(Said.BIAS, whole_flights=seen.whole_flights)


def where(seen: Dataset, held_out_flights: Sequence[str], as_it_stands: bool = False) -> Fact:
    """Data that an error is computed on: the flights held out of all fits, or else held-out parts of `seen`, or all of
    `seen` for a model `as_it_stands`."""
    if held_out_flights:
        return fact(Said.ON_HELD_OUT_FLIGHTS, flights=held_out_flights)
    kind = Said.AS_IT_STANDS if as_it_stands else Said.ON_HELD_OUT
    return fact(kind, whole_flights=seen.whole_flights, flights=seen.names)
