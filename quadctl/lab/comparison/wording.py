"""Sentences and numbers about results, shared by the report and the page."""

from collections.abc import Callable, Mapping, Sequence

from quadctl.effects import Effect
from quadctl.frames import GRAVITY_M_S2
from quadctl.lab.comparison.agreement import CLOSE, Agreement
from quadctl.lab.comparison.failures import Failure, Stretch, told
from quadctl.lab.comparison.remainder import Remainder
from quadctl.lab.flights.dataset import FOLDS, Dataset
from quadctl.lab.flights.flight import VARIABLE_NAMES, VARIABLE_UNITS
from quadctl.lab.flights.prediction import AXES
from quadctl.lab.flights.preparation import BLOCK_S

UNIT = "m/s²"
FLOOR = "held-out error of a regression on all logged variables, the lowest over all steps"
"""Meaning of the reference error; the steps are the models that were compared on these flights."""
TWO_DECIMALS_M_S2 = 0.05
"""Difference of two mean residuals from which on they are told with two decimals instead of three."""
NAMED_FLIGHTS = 2
"""Most flights that a sentence names."""
MUCH = 0.2
"""Share of the squared error from which on an axis is told of, whatever its error goes with."""
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
    return f"{float(f'{value:.2g}'):g} {UNIT}"


def percent(share: float) -> str:
    return f"{share:.0%}".replace("-", "\u2212")


def share_of_g(value: float) -> str:
    """Format an acceleration, m/s^2, as a share of gravity with two digits: `4.1%`."""
    share = 100.0 * value / GRAVITY_M_S2
    return f"{share:.0f}%" if share >= 9.95 else f"{share:.1f}%" if share >= 0.095 else f"{share:.2f}%"


def p_in_words(p: float) -> str:
    """Format a p-value, such as `< 0.0001`, `0.003`, `0.62`."""
    return "< 0.0001" if p < 1e-4 else f"{p:.1g}" if p < 0.01 else f"{p:.2f}"


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
    parts = [
        f"{name} = {value_in_text(values[name])}{units[name]} {interval_in_text(values[name], ci)}"
        for name, ci in ci95.items()
    ]
    return ", ".join(parts) or "no free parameters"


def parameter_lines(effect: Effect, ci95: Mapping[str, tuple[float, float]]) -> list[str]:
    """Parameters with 95 % intervals, one a line: `a = 0.114 [0.10, 0.12]`.

    One that is not fitted, but chosen from the data or from the literature, has no interval: `rotor = 1`.
    """
    return [
        f"{name} = {value:.4g} {interval_in_words(value, ci95[name])}" if name in ci95 else f"{name} = {value:.4g}"
        for name, value in effect.values().items()
    ]


def parameters_in_words(effect: Effect, ci95: Mapping[str, tuple[float, float]]) -> str:
    """Parameters with 95 % intervals: `a = 0.114 [0.10, 0.12], b = 5.4 [5.0, 5.8], c = 1` (see `parameter_lines`)."""
    return ", ".join(parameter_lines(effect, ci95)) or "-"


def interval_in_words(value: float, ci95: tuple[float, float]) -> str:
    """95 % interval of a value, `[0.10, 0.12]`; that of a parameter at a bound has one end, `(at most 0.12)`."""
    return _interval(value, ci95, lambda end: f"{end:.4g}")


def interval_in_text(value: float, ci95: tuple[float, float]) -> str:
    """The same for text with typographic signs: see `value_in_text`."""
    return _interval(value, ci95, value_in_text)


def _interval(value: float, ci95: tuple[float, float], shown: Callable[[float], str]) -> str:
    low, high = ci95
    if low < high and value == low:
        return f"(at most {shown(high)})"
    if low < high and value == high:
        return f"(at least {shown(low)})"
    return f"[{shown(low)}, {shown(high)}]"


def value_in_text(value: float) -> str:
    """Format the value of a parameter; less than a millionth is shown as 0, which the solver has not quite reached."""
    return f"{value if abs(value) > 1e-6 else 0.0:.4g}".replace("-", "\u2212")


def held_out(dataset: Dataset) -> str:
    if dataset.hold_out == "flights" and len(dataset.flights) > 1:
        return "held-out flights (cross-validation)"
    return f"held-out blocks of {BLOCK_S:.0f} s ({FOLDS}-fold cross-validation)"


def where_in_words(seen: Dataset, held_out_flights: Sequence[str], as_it_stands: bool = False) -> str:
    """Data that an error is computed on: the flights held out of all fits, or else held-out parts of `seen`, or all
    of `seen` for a model `as_it_stands`."""
    if held_out_flights:
        return f"per-flight bias included, on the held-out {listed(held_out_flights)}"
    if as_it_stands:
        return f"as it stands, {trim_in_words(seen)}, on {flights_in_words(seen.names)}"
    return f"{trim_in_words(seen)}, on {held_out(seen)}"


def trim_in_words(seen: Dataset) -> str:
    """Trims in an error on held-out parts of `seen`: that of a flight which no fit has seen is not known."""
    return "per-flight bias included" if seen.whole_flights else "apart from the per-flight bias"


def flights_in_words(names: Sequence[str]) -> str:
    return listed(names) if len(names) <= 3 else f"{len(names)} flights"


def variance_in_words(explained: float) -> str:
    """Sentence on the share of the variance that a model explains (see `Comparison.explained`)."""
    if explained > 0.0:
        return f"The model explains {percent(explained)} of the acceleration's variance."
    return "The model is worse than predicting the mean acceleration."


def count(n: int, what: str) -> str:
    return f"{n} {what}{'' if n == 1 else 's'}"


def listed(words: Sequence[str]) -> str:
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} and {words[-1]}"


def looks_like(families: Sequence[str]) -> str:
    """Sentence on an effect that the data do not distinguish from those of other families."""
    return f"Looks like {listed([plain(family) for family in families])}: these data do not distinguish them."


def plain(family: str) -> str:
    return family.replace("_", " ")


def sentence(text: str) -> str:
    return text[:1].upper() + text[1:]


def ended(text: str) -> str:
    """Sentence with a full stop at its end, unless it is a question."""
    return text if text.endswith(("?", ".")) else f"{text}."


def agreement_in_short(found: Agreement) -> str:
    """The answer of `agreement_in_words` in a few words: `Under this model the flights differ.`"""
    if found.verdict in ("otherwise", "worse", "better"):
        return "Under this model the flights differ."
    if found.verdict == "not known":
        return "Whether the flights agree under this model cannot be told."
    if found.widest is not None and found.widest.reach_m_s2 > found.limit_m_s2:
        return "Under this model the error is as large in each flight; whether it is the same cannot be told."
    return "Under this model the flights agree."


def agreement_in_words(found: Agreement) -> str:
    """Sentence that answers whether two flights agree: `The model fitted to A predicts B as well as A: ...`."""
    answer, *reasons = agreement_parts(found)
    return f"{answer}: {'; '.join(reasons)}."


def agreement_parts(found: Agreement) -> list[str]:
    """Answer whether two flights agree, and the reasons for it, as parts of a sentence."""
    judged, reference = flights_in_words(found.judged), flights_in_words(found.reference)
    model = {
        "": "the model",
        "these": f"the model fitted to {reference}",
        "others": "the model fitted to the other flights each time",
        "all": "the model fitted to all flights",
    }[found.fitted]
    them = f"{judged}, which differs most," if found.differs_most else judged
    errors = (
        f"its error is {quantity(found.judged_m_s2)} on {judged} and {quantity(found.reference_m_s2)} on {reference}"
    )
    limit = f"{number(found.limit_m_s2)}, {percent(CLOSE)} of the error on {reference}, that count as none"
    shift = [] if found.shift is None else [_shift_in_words(found)]
    if found.verdict == "otherwise":
        return [f"{sentence(model)} predicts {them} otherwise than {reference}", *shift, errors]
    if found.verdict == "not known" or found.ci95 is None:
        why = "one of them is too short for an interval"
        if found.ci95 is not None:
            why = f"the difference is anything {_range_of(found.ci95)}, which may be more than the {limit}"
        return [f"Whether {model} predicts {them} as well as {reference} is not known from these flights", errors, why]
    if found.verdict == "as well":
        less = f"the difference is {_range_of(found.ci95)}, less than the {limit}"
        return [f"{sentence(model)} predicts {them} as well as {reference}", errors, less, *_widest_in_words(found)]
    low, high = sorted(abs(end) for end in found.ci95)
    by = f"by {quantity(abs(found.difference_m_s2))} [{number(low)}, {number(high)}]"
    return [f"{sentence(model)} predicts {them} {found.verdict} than {reference}, {by}", errors, *shift]


def _shift_in_words(found: Agreement) -> str:
    """`the mean residual up is +0.300 m/s² on B and +0.100 m/s² on A, a difference of +0.200 m/s² [+0.1, +0.3]`"""
    shift = found.shift
    assert shift is not None
    judged, reference = flights_in_words(found.judged), flights_in_words(found.reference)
    where = ""
    if shift.variable:
        unit = VARIABLE_UNITS[shift.variable]
        where = f" at a {VARIABLE_NAMES[shift.variable]} from {shift.low:.3g} to {shift.high:.3g} {unit}"
    low, high = (f"{end:+.2g}".replace("-", "\u2212") for end in shift.ci95)
    decimals = 2 if abs(shift.difference_m_s2) > TWO_DECIMALS_M_S2 else 3
    there, here = (round(value, decimals) for value in (shift.judged_m_s2, shift.reference_m_s2))
    return (
        f"the mean residual {shift.axis}{where} is {plus(there, decimals)} {UNIT} on {judged} and "
        f"{plus(here, decimals)} {UNIT} on {reference}, a difference of {plus(there - here, decimals)} {UNIT} "
        f"[{low}, {high}]"
    )


def _widest_in_words(found: Agreement) -> list[str]:
    """Limits of the mean residuals where none differs clearly."""
    widest = found.widest
    if widest is None:
        return []
    reach = f"{number(widest.reach_m_s2)} {UNIT} along any axis"
    if widest.reach_m_s2 <= found.limit_m_s2:
        return [f"nor do the mean residuals differ by more than {reach}"]
    most = f"{quantity(widest.reach_m_s2)} {widest.axis}"
    return [f"whether the mean residuals agree is not known: they may differ by up to {most}"]


def _range_of(ci95: tuple[float, float]) -> str:
    """`from -0.05 to +0.07 m/s²`"""
    low, high = (f"{end:+.2g}".replace("-", "\u2212") for end in ci95)
    return f"from {low} to {high} {UNIT} (95%)"


def remainder_in_words(found: Remainder, where: str = "") -> str:
    """Sentences on the error that remains: how far above the reference error, and what explains the difference.

    `where` names the flights, as in ` on the held-out A.csv`.
    """
    error, floor = quantity(found.error_m_s2), roughly(found.floor_m_s2)
    if found.above_the_floor <= 0.0:
        return f"An error of {error} remains{where}, no more than the reference error of {floor}."
    if found.is_near_the_floor:
        above = f"{percent(found.above_the_floor)} above the reference error of {floor}"
        return f"An error of {error} remains{where}, {above}; the difference is mostly {found.axis}."
    share, by_causes = percent(found.explained), percent(found.explained_by_causes)
    remains = f"An error of {error} remains{where}. A regression on all logged variables explains {share} of its square"
    remains = f"{remains}, mostly {found.axis}, and leaves {floor}, the reference error"
    if found.explained_by_causes > 0.5 * found.explained or not found.others:
        return f"{remains}."
    others = listed([VARIABLE_NAMES[name] for name in found.others])
    return (
        f"{remains}; without {others} it explains {by_causes}. What goes with {others} can be a missing effect, or the "
        "error of a sensor, or the controller's answer to a disturbance: these flights do not tell."
    )


def failure_in_words(failure: Failure) -> str:
    """Failure without a full stop: `At a height below 2 rotor radii the vehicle gets more thrust than ...`."""
    return sentence(_FAILURE_WORDS[failure.kind](failure))


def _offset_in_words(failure: Failure) -> str:
    over = "the whole flight" if failure.flights == 1 else "all flights"
    held = [stretch.flight for stretch in failure.stretches]
    most = f", most of it in {' and '.join(held)}" if len(held) < min(failure.flights, NAMED_FLIGHTS + 1) else ""
    return f"on average over {over} {_push_in_words(failure)}{most}"


def _range_in_words(failure: Failure) -> str:
    name, unit = VARIABLE_NAMES[failure.variable], VARIABLE_UNITS[failure.variable]
    begins, ends = failure.at_edge
    low, high = (f"{end:.3g}".replace("-", "\u2212") for end in (failure.low, failure.high))
    where = f"from {low} to {high}"
    if begins != ends:
        where = f"below {high}" if begins else f"above {low}"
    average = ""
    if failure.average:
        on_average = abs(failure.average)
        by = f"{on_average / GRAVITY_M_S2:.1%}" if failure.axis == "up" else f"{on_average:.2f} {UNIT}"
        average = f" (over all ranges by {by})"
    return f"at a {name} {where} {unit} {_push_in_words(failure)}{average}{_most_in_words(failure.stretches)}"


def _dependence_in_words(failure: Failure) -> str:
    name, unit = VARIABLE_NAMES[failure.variable], VARIABLE_UNITS[failure.variable]
    ends = [f"{mean:+.2f} {UNIT} at {at:.3g} {unit}".replace("-", "\u2212") for at, mean in failure.extremes]
    reach = " and ".join(ends)
    share = f"{failure.share:.0%} of the squared error on this axis"
    return f"the {failure.axis} residual depends on the {name}: {reach} on average, {share}"


_FAILURE_WORDS = {"offset": _offset_in_words, "range": _range_in_words, "dependence": _dependence_in_words}


def _push_in_words(failure: Failure) -> str:
    mean = failure.mean_residual
    if failure.axis == "up":
        more, share = "more" if mean > 0.0 else "less", abs(mean) / GRAVITY_M_S2
        return f"the vehicle gets {more} thrust than the model says, by {share:.1%} of its weight"
    direction = {"north": ("north", "south"), "east": ("east", "west")}[failure.axis][0 if mean > 0.0 else 1]
    return f"the vehicle is pushed {direction} by {abs(mean):.2f} {UNIT} more than the model says"


def _most_in_words(found: Sequence[Stretch]) -> str:
    """`, mostly in HOVERING.csv between 12 and 31 s`"""
    if not found:
        return ""
    whole = [f"throughout {stretch.flight}" for stretch in found if stretch.whole]
    part = [f"in {s.flight} between {s.begin_s:.0f} and {s.end_s:.0f} s" for s in found if not s.whole]
    if len(found) > NAMED_FLIGHTS:
        most = (whole if found[0].whole else [f"mostly {each}" for each in part])[0]
        return f", in {len(found)} flights, of which the most {most}"
    mostly = [f"mostly {' and '.join(part)}"] if part else []
    return f", {' and '.join([*mostly, *whole] if not found[0].whole else [*whole, *mostly])}"


def followed_in_words(found: Sequence[Failure], dataset: Dataset) -> str:
    """Sentence on the failures whose variable follows disturbances, so that it need not be a cause (see
    `Dataset.is_flown`); empty where there is none."""
    names = dict.fromkeys(VARIABLE_NAMES[f.variable] for f in found if not dataset.is_flown(f.variable))
    if not names:
        return ""
    flights = "In this flight" if len(dataset.flights) == 1 else "In these flights"
    verb, them = ("follows", "it") if len(names) == 1 else ("follow", "them")
    return (
        f"{flights} the {listed(list(names))} {verb} disturbances, which the controller counters, more than the "
        f"motion: a residual that depends on {them} may come from the controller, and not from a missing effect."
    )


def untold_in_words(found: Sequence[Failure], errors: Mapping[str, float]) -> str:
    """Sentence on the axes that hold much of the squared error, of which none of all failures `found` explains more
    than next to nothing; empty where there is none. `errors` are the RMSE per axis, m/s^2."""
    whole = sum(errors[axis] ** 2 for axis in AXES)
    explained = {failure.axis for failure in told(found, len(found))}
    share = {axis: errors[axis] ** 2 / whole for axis in AXES if axis not in explained} if whole > 0.0 else {}
    untold = [axis for axis in share if share[axis] >= MUCH]
    if not untold:
        return ""
    errors_in_words = [
        f"{axis} ({quantity(errors[axis])}, {percent(share[axis])} of the squared error)" for axis in untold
    ]
    return f"Along {listed(errors_in_words)} no logged variable explains much of the error."


def label_of(variable: str) -> str:
    """Axis label of a variable with its unit, such as `climb rate / m/s`."""
    return f"{VARIABLE_NAMES[variable]} / {VARIABLE_UNITS[variable]}"
